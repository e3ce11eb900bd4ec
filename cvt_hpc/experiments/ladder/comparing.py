"""Answers of each model of the ladder to a question, compared with the reference.

Cells count that the reference decides, or in which it vibrates. A model that gives no answer in a
cell is not in error there: such cells are counted by themselves.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.classes import at_strongest_strand, occurrence_classes
from cvt_hpc.experiments.ladder.loading import REFERENCE
from cvt_hpc.experiments.sweeps import Sweep
from cvt_hpc.models.linear_stability.modes import DECAY
from cvt_hpc.study.audit import FORCES
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import DECIDED, levels, onsets, paired_errors

Array = NDArray[np.float64]


class Score(NamedTuple):
    """Score of a model's answers to a question."""

    cells: int  # cells behind the errors; of onsets, pairs of them
    # median, high: median of the errors and the bound that 95 % of them keep: of onsets [N m], of all else
    # relative. Not a number of occurrence, and where there is nothing to compare.
    median: float = math.nan
    high: float = math.nan
    # of occurrence, the share of cells that are decided here and there, but of another class
    wrong: float = math.nan
    # share of the reference's cells that the model leaves undecided, fails at or does not answer; of onsets
    # the share that it misses
    undecided: float = math.nan
    additional: int = 0  # onsets that the reference does not have, though it decides below and above them


class Finding(NamedTuple):
    """A row of the table."""

    # question, rung: the question, and the model that answered
    question: str
    rung: str
    score: Score  # how well; of the reference its estimated error
    core_seconds: float  # of a run of the model, mean [s]


def compare(rungs: Sequence[Sweep], results: Mapping[str, xr.Dataset]) -> Iterator[Finding]:
    """Yield the score of each model for each question that it answers, the reference last.

    The reference's own error is taken as large as the distance of the model before it, which is a refined
    one. Of the elastic belt it would be 0.8 of that if all errors were of second order in mesh and step, and
    twice as much if of the first; of the pushbelt a third, and as much. No onset is known more closely than
    half a step of the load. Rungs are as `ladder` returns them, results by the model's name.
    """
    reference = results[REFERENCE]
    costs = {name: float(dataset["core_seconds"].mean()) for name, dataset in results.items()}
    for question, score in _SCORES.items():
        for rung in rungs:
            if question in rung.answers:
                found = score(_beside(results[rung.name], reference), reference)
                yield Finding(question, rung.name, found, costs[rung.name])
        # the model before the reference answers all questions, and stands last
        yield Finding(question, REFERENCE, _own(question, found, reference), costs[REFERENCE])


def _own(question: str, coarser: Score, reference: xr.Dataset) -> Score:
    """Return the estimated error of the reference, by the score of the model that it refines."""
    if question == "onset":
        spacing = np.diff(np.sort(reference["load"].values)).max(initial=0.0)
        return Score(coarser.cells, median=float(np.fmax(coarser.median, 0.5 * spacing)))
    return Score(coarser.cells, median=coarser.median, wrong=coarser.wrong)


def _beside(dataset: xr.Dataset, reference: xr.Dataset) -> xr.Dataset:
    """Return a model's results over all axes of the reference, equal along axes that it does not know."""
    order = reference["status"].dims
    missing = {name: reference[name] for name in order if name not in dataset["status"].dims}
    return dataset.expand_dims(missing).transpose(*order, ...)


def _occurrence(found: xr.Dataset, true: xr.Dataset) -> Score:
    one, other = (occurrence_classes(each).values for each in (found, true))
    asked = np.isin(other, DECIDED)
    cells = int(asked.sum())
    if not cells:
        return Score(0)
    is_told = np.isin(one[asked], DECIDED)
    wrong = (is_told & (one != other)[asked]).mean()
    return Score(cells, wrong=float(wrong), undecided=float((~is_told).mean()))


def _onset(found: xr.Dataset, true: xr.Dataset) -> Score:
    loads, axis = true["load"].values, true["status"].dims.index("load")
    is_linear = "growth_rate" in found and found["growth_rate"].dims == found["status"].dims
    level = _growth(found) if is_linear else _levels(found)
    lines = [np.moveaxis(values, axis, -1).reshape(-1, loads.size) for values in (level, _levels(true))]
    errors: list[float] = []
    missed = additional = 0
    for one, other in zip(*lines, strict=True):
        decided = loads[np.isfinite(other)]
        known = (decided.min(initial=np.inf), decided.max(initial=-np.inf))
        pairs, less, more = paired_errors(onsets(loads, one), onsets(loads, other), known)
        errors, missed, additional = errors + pairs, missed + less, additional + more
    number = len(errors) + missed
    score = _score(np.array(errors), number)
    return score._replace(additional=additional)


def _levels(dataset: xr.Dataset) -> Array:
    """Return 1 where a run vibrates, -1 where it is quiet, nan elsewhere."""
    return levels(occurrence_classes(dataset).values)


def _growth(dataset: xr.Dataset) -> Array:
    """Return the growth rate of the fastest mode [1/s], at least the limit of the search for modes."""
    rate = dataset["growth_rate"].values
    return np.where(dataset["status"] == Status.DONE, np.where(np.isnan(rate), -DECAY, rate), np.nan)


def _frequency(found: xr.Dataset, true: xr.Dataset) -> Score:
    own = at_strongest_strand(true, "frequency")
    if "eigenfrequency" in found:  # a strand alone has no strongest mode: the nearest one of the same strand
        known = found["eigenfrequency"]
        nearest = known.isel(half_waves=abs(known - own).fillna(np.inf).argmin("half_waves"))
        said = at_strongest_strand(true.assign(nearest=nearest.reset_coords(drop=True)), "nearest").values
    elif "amplitude" in found:
        said = _where_vibrating(found, at_strongest_strand(found, "frequency"))
    else:
        said = _where_vibrating(found, found["frequency"])
    return _relative(said, _where_vibrating(true, own))


def _amplitude(found: xr.Dataset, true: xr.Dataset) -> Score:
    said, own = (_where_vibrating(each, at_strongest_strand(each, "amplitude")) for each in (found, true))
    return _relative(said, own)


def _where_vibrating(dataset: xr.Dataset, values: xr.DataArray) -> Array:
    return np.where(_levels(dataset) > 0.0, values.values, np.nan)


def _relative(said: Array, own: Array) -> Score:
    asked = np.isfinite(own)
    return _score(np.abs(said[asked] / own[asked] - 1.0), int(asked.sum()))


def _forces(found: xr.Dataset, true: xr.Dataset) -> Score:
    """Score the larger deviation in each cell, of strand forces or of axial forces, over the largest."""
    largest = np.zeros(true["status"].shape)
    for names in FORCES:
        one, other = (
            np.concatenate([_where_done(each, name) for name in names], axis=-1) for each in (found, true)
        )
        largest = np.maximum(largest, np.abs(one - other).max(axis=-1) / np.abs(other).max(axis=-1))
    return _score(largest, int((true["status"] == Status.DONE).sum()))


def _where_done(dataset: xr.Dataset, name: str) -> Array:
    status = dataset["status"]
    return dataset[name].where(status == Status.DONE).transpose(*status.dims, ...).values


def _score(errors: Array, asked: int) -> Score:
    """Score errors, nan where the model gives no answer, for the number of requested cells."""
    known = errors[np.isfinite(errors)]
    undecided = 1.0 - known.size / asked if asked else math.nan
    if not known.size:
        return Score(0, undecided=undecided)
    median, high = (float(np.quantile(known, q)) for q in (0.5, 0.95))
    return Score(known.size, median, high, undecided=undecided)


_SCORES: dict[str, Callable[[xr.Dataset, xr.Dataset], Score]] = {
    "occurrence": _occurrence,
    "onset": _onset,
    "frequency": _frequency,
    "amplitude": _amplitude,
    "forces": _forces,
}
