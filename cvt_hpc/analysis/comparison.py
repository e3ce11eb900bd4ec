"""Two studies against each other, cell by cell: which classes contradict, how far numbers deviate.

`sample_sentences` says what a sample of runs that were done again another way tells of their study.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.alignment import COMPARED, align, axes_of
from cvt_hpc.analysis.arrangement import labelled
from cvt_hpc.analysis.classes import at_strongest_strand, occurrence_classes
from cvt_hpc.analysis.held_job import job_of
from cvt_hpc.job.values import Document, Point, heading, shown, shown_number
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.storage.files import write_rows
from cvt_hpc.study import open_results
from cvt_hpc.study.intervals import interval
from cvt_hpc.study.job_difference import differences, short_pair
from cvt_hpc.study.repeats import AUDIT, WAYS
from cvt_hpc.tables import number
from cvt_hpc.variables import Status
from cvt_hpc.vibration import classes as agreement

_HEAD = (
    *("class_a", "class_b", "pair"),
    *("amplitude_a [um]", "amplitude_b [um]", "frequency_a [Hz]", "frequency_b [Hz]"),
)
# Tables and keys that say how a scene is computed or disturbed, not what it is
_METHOD = (
    *("model", "stepper", "mesh", "numerics", "limit", "record", "run", "vibration", "judgement", "auto"),
    *("design", "versions"),
)
_METHOD_KEYS = ("seed", "disturbance", "friction_treatment", "contact_points", "coarse", "git_revision")

_SAMPLES = (*WAYS.values(), ("in full", AUDIT))  # words of a way, and the folder of its runs


class Deviation(NamedTuple):
    """Deviation of B from A, relative to A [1]; not a number where nothing is known."""

    median: float
    high: float  # what 95 % of the cells keep
    largest: float


class Cell(NamedTuple):
    """A cell of a comparison; pairs of values are of A and of B."""

    at: Point  # values of the axes by name [SI]
    place: str  # the same for people, in the units of the job
    classes: tuple[agreement.OccurrenceClass, agreement.OccurrenceClass]
    pair: int  # the class that both have, or a `PairClass`
    amplitude: tuple[float, float]  # [m]
    frequency: tuple[float, float]  # [Hz]
    quantities: dict[str, tuple[float, float]]  # further values by name [SI]

    @property
    def pair_label(self) -> str:
        """Name for people of `pair`."""
        return (agreement.OccurrenceClass if self.pair >= 0 else agreement.PairClass)(self.pair).label


@dataclass(frozen=True)
class Comparison:
    """Two studies, A and B, over their common cells.

    The cells have over the axes of A: `class_a`, `class_b`, values of `OccurrenceClass`; `occurrence_class`,
    as `classify_pairs` has it; `amplitude_a`, `amplitude_b` [m] and `frequency_a`, `frequency_b` [Hz] at the
    strand with the largest amplitude, not a number where unknown; and `QUANTITY_a`, `QUANTITY_b` of the
    quantities: what the model has compared besides, of a variable along strands or pulleys with the label of
    the place, such as "strand_tension_t1".
    """

    cells: xr.Dataset
    thresholds: tuple[float, float]  # amplitude from which a strand vibrates [m]; nan where a job has none
    left_out: tuple[int, int]  # number of runs of A and of B that are not among the cells
    notes: tuple[str, ...]  # which axes were reduced, in words
    differences: tuple[str, ...]  # in what the jobs and the versions of the program differ, in words
    quantities: dict[str, str]  # units by name
    are_designs: bool = False  # whether A and B are different scenes, and not one scene computed twice

    @property
    def better(self) -> NDArray[np.bool_]:
        """Whether a cell that vibrates in A is quiet in B, shape of the grid."""
        return np.isin(self.pairs, (agreement.PairClass.A_ONLY, agreement.PairClass.A_ONLY_NEAR))

    @property
    def worse(self) -> NDArray[np.bool_]:
        """Whether a cell that is quiet in A vibrates in B, shape of the grid."""
        return np.isin(self.pairs, (agreement.PairClass.B_ONLY, agreement.PairClass.B_ONLY_NEAR))

    @property
    def pairs(self) -> NDArray[np.int8]:
        """Class of each cell, shape of the grid: that of both runs, or a `PairClass`."""
        return self.cells["occurrence_class"].values

    @property
    def contradicts(self) -> NDArray[np.bool_]:
        """Whether a cell is quiet in one study and vibrates in the other, shape of the grid."""
        return np.isin(self.pairs, agreement.CONTRADICTIONS)

    @property
    def contradicts_beyond(self) -> NDArray[np.bool_]:
        """Whether it does so with a larger amplitude that is not near the threshold, shape of the grid."""
        return self.contradicts & ~np.isin(self.pairs, agreement.NEAR_CONTRADICTIONS)

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Whether both runs of a cell have ended with results, shape of the grid."""
        both = (self.cells[name].values for name in ("class_a", "class_b"))
        return ~np.any([np.isin(classes, agreement.WITHOUT_RESULTS) for classes in both], axis=0)

    def counts(self) -> dict[tuple[agreement.OccurrenceClass, agreement.OccurrenceClass], int]:
        """Number of cells by their class in A and in B, of all pairs of classes."""
        a, b = self.cells["class_a"].values, self.cells["class_b"].values
        kinds = product(agreement.OccurrenceClass, repeat=2)
        return {(of_a, of_b): int(((a == of_a) & (b == of_b)).sum()) for of_a, of_b in kinds}

    def deviation(self, name: str) -> Deviation:
        """Return how far B deviates: "amplitude", "frequency" where both vibrate, others where both end."""
        both = self.answered if name in self.quantities else self.pairs == agreement.OccurrenceClass.VIBRATING
        a, b = (self.cells[f"{name}_{study}"].values[both] for study in "ab")
        with np.errstate(divide="ignore", invalid="ignore"):
            deviations = np.abs(b / a - 1.0)
        known = deviations[np.isfinite(deviations)]
        if not known.size:
            return Deviation(math.nan, math.nan, math.nan)
        return Deviation(float(np.median(known)), float(np.quantile(known, 0.95)), float(known.max()))

    def amplitude_ratio(self) -> float:
        """Return the median of amplitude B over amplitude A where both vibrate; not a number of none."""
        a, b = (self.cells[f"amplitude_{study}"].values for study in "ab")
        both = (self.pairs == agreement.OccurrenceClass.VIBRATING) & (a > 0.0)
        return float(np.median(b[both] / a[both])) if both.any() else math.nan

    def largest_difference(self, name: str) -> float:
        """Return the largest magnitude of B - A of one of `quantities` [SI] where both end; 0 of none."""
        a, b = (self.cells[f"{name}_{study}"].values[self.answered] for study in "ab")
        return float(np.nan_to_num(np.abs(b - a), posinf=0.0).max(initial=0.0))

    def rows(self, chosen: NDArray[np.bool_]) -> Iterator[Cell]:
        """Yield the cells that an array of bool marks, shape of the grid."""
        dims = self.cells["status"].dims
        along = {name: self.cells[name] for name in axes_of(self.cells)}
        axes = {name: (values.values.tolist(), dims.index(values.dims[0])) for name, values in along.items()}
        arrays = {str(name): array.values for name, array in self.cells.data_vars.items()}
        for place in map(tuple, np.argwhere(chosen)):
            found = {name: values[place].item() for name, values in arrays.items()}
            at = {name: values[place[dim]] for name, (values, dim) in axes.items()}
            yield Cell(
                at,
                ", ".join(f"{name} = {shown(value, along[name].attrs)}" for name, value in at.items()),
                (agreement.OccurrenceClass(found["class_a"]), agreement.OccurrenceClass(found["class_b"])),
                found["occurrence_class"],
                (found["amplitude_a"], found["amplitude_b"]),
                (found["frequency_a"], found["frequency_b"]),
                {name: (found[f"{name}_a"], found[f"{name}_b"]) for name in self.quantities},
            )


def compare(a: xr.Dataset, b: xr.Dataset, sources: tuple[str, str] = ("A", "B")) -> Comparison:
    """Compare two studies over their common cells; arguments and errors as of `align`."""
    aligned = align(a, b, sources, _compared(a, b))
    thresholds = _threshold(a), _threshold(b)
    known = [_known(dataset) for dataset in (aligned.a, aligned.b)]
    sizes = (found["amplitude"] / least for found, least in zip(known, thresholds, strict=True))
    near = agreement.is_near(*sizes)
    frame = aligned.a["status"]
    values = {f"{name}_{study}": array for study, found in zip("ab", known, strict=True)
              for name, array in found.items()}  # fmt: skip
    values |= {"status": frame.values}
    values |= {"occurrence_class": agreement.classify_pairs(values["class_a"], values["class_b"], near)}
    quantities = [_quantities(dataset) for dataset in (aligned.a, aligned.b)]
    common = {name: unit for name, (_, unit) in quantities[0].items() if name in quantities[1]}
    for study, found in zip("ab", quantities, strict=True):
        values |= {f"{name}_{study}": found[name][0] for name in common}
    cells = xr.Dataset({name: frame.copy(data=array) for name, array in values.items()})
    differing = _differing(a, b)
    told = aligned.left_out, aligned.notes, tuple(_in_words(differing))
    return Comparison(cells, thresholds, *told, common, any(map(_is_of_scene, differing.items())))


def _compared(*studies: xr.Dataset) -> list[str]:
    """Variables that the models of the studies have compared."""
    models = [name for study in studies if (name := job_of(study).get("model")) in MODELS]
    return list(dict.fromkeys(name for model in models for name in load_model(model).compared))


def _quantities(dataset: xr.Dataset) -> dict[str, tuple[NDArray, str]]:
    """Values and unit of each number that is compared beside COMPARED, by its name with its place."""
    dims = dataset["status"].dims
    found = {}
    for name, array in dataset.drop_vars(COMPARED, errors="ignore").data_vars.items():
        unit = array.attrs.get("units", "1")
        for labels, part in labelled(array, dims):
            found["_".join([str(name), *labels])] = part.transpose(*dims).values, unit
    return found


def only(dataset: xr.Dataset, chosen: NDArray[np.bool_]) -> xr.Dataset:
    """Return results without the runs that are not chosen, shape (runs,): these count as not run."""
    status = dataset["status"]
    return dataset.assign(status=status.where(chosen.reshape(status.shape), Status.NOT_RUN))


def _known(dataset: xr.Dataset) -> dict[str, NDArray]:
    """Quantities of a study's runs that are compared."""
    sizes = {name: at_strongest_strand(dataset, name).values for name in ("amplitude", "frequency")}
    return {"class": occurrence_classes(dataset).values, **sizes}


def write_comparison(found: Comparison, table: Path) -> Path:
    """Write all cells of a comparison as a CSV table, a row each, and return its path."""
    told = {name: found.cells[name].attrs for name in axes_of(found.cells)}
    units = {name: "" if unit == "1" else f" [{unit}]" for name, unit in found.quantities.items()}
    further = [f"{name}_{study}{unit}" for name, unit in units.items() for study in "ab"]
    rows = []
    for cell in found.rows(np.ones(found.pairs.shape, bool)):
        numbers = [number(size * 1e6, 4) for size in cell.amplitude]
        numbers += [number(frequency, 5) for frequency in cell.frequency]
        numbers += [number(value, 6) for pair in cell.quantities.values() for value in pair]
        labels = [kind.label for kind in cell.classes]
        place = [shown_number(value, told[name]) for name, value in cell.at.items()]
        rows.append([*place, *labels, cell.pair_label, *numbers])
    heads = [heading(name, attributes) for name, attributes in told.items()]
    return write_rows(table, [*heads, *_HEAD, *further], rows)


def _threshold(dataset: xr.Dataset) -> float:
    return float(job_of(dataset).get("vibration", {}).get("amplitude_threshold", math.nan))


def _differing(a: xr.Dataset, b: xr.Dataset) -> dict[str, tuple[object, object]]:
    """Return by key the values in A and in B that differ beside their axes; None where there is none."""
    swept = {name for dataset in (a, b) for name in axes_of(dataset)}
    found = differences(_document(a), _document(b))
    return {key: pair for key, pair in found.items() if key.rpartition(".")[2] not in swept}


def _is_of_scene(difference: tuple[str, tuple[object, object]]) -> bool:
    """Whether two studies that differ so are of two scenes; what one model alone knows makes none."""
    key, pair = difference
    words = key.split(".")
    return None not in pair and words[0] not in _METHOD and words[-1] not in _METHOD_KEYS


def _in_words(found: Mapping[str, tuple[object, object]]) -> Iterator[str]:
    """Yield the differences of two studies in words."""
    for key, (in_a, in_b) in found.items():
        if in_a is not None and in_b is not None:
            yield "{}: {} in A, {} in B".format(key, *short_pair(in_a, in_b))
    for label, missing in (("A", 1), ("B", 0)):
        alone = [key for key, pair in found.items() if pair[missing] is None]
        if alone:
            yield f"in {label} alone: {', '.join(alone)}"


def _document(dataset: xr.Dataset) -> Document:
    """Return what determines the numbers of a study, its axes apart: the resolved job and the versions."""
    job = {key: value for key, value in job_of(dataset).items() if key not in ("name", "description", "axes")}
    versions = json.loads(dataset.attrs.get("versions", "{}"))
    return job | {"versions": versions, "git_revision": dataset.attrs.get("git_revision")}


def contradictions(found: Comparison, way: str) -> str:
    """Return how many runs that were done again, in a way in words, contradict those of the study."""
    runs, contradicting = int(found.answered.sum()), int(found.contradicts.sum())
    low, high = interval(contradicting, runs)
    share = f"{contradicting / runs:.2%}, " if runs else ""
    others = int((found.answered & (found.pairs == agreement.PairClass.OTHERWISE)).sum())
    fails = [found.cells[name].values == agreement.OccurrenceClass.FAILED for name in ("class_a", "class_b")]
    failed = int((fails[1] & ~fails[0]).sum())
    return (
        f"{contradicting} of {runs} contradict (quiet against vibrating; {share}95 % interval {low:.2%} to "
        f"{high:.2%}), {int(found.contradicts_beyond.sum())} of them beyond the threshold; "
        f"{others} more of another class" + (f"; {failed} more failed {way}" if failed else "")
    )


def deviations(found: Comparison, who: str = "B deviates") -> Iterator[str]:
    """Yield how far amplitude, frequency and what else is compared deviate; `who` is subject and verb."""
    both = int((found.pairs == agreement.OccurrenceClass.VIBRATING).sum())
    where = {name: f"{name} where both vibrate ({both} cells)" for name in ("amplitude", "frequency")}
    where |= {name: f"{name} where both have ended" for name in found.quantities}
    for name, text in where.items():
        deviation = found.deviation(name)
        if math.isnan(deviation.median):
            continue
        most = ""
        if name in found.quantities:
            unit = found.quantities[name]
            most = f"; at most {found.largest_difference(name):.3g} {'' if unit == '1' else unit}".rstrip()
        middle, high, largest = (f"{share:.2%}" for share in deviation)
        yield f"{text}: {who} by {middle} (median), {high} (95 %), {largest} (largest){most}"


def sample_sentences(dataset: xr.Dataset, folder: Path, source: str) -> Iterator[str]:
    """Yield what the samples in the folder of a study tell: checks of the time step, and the audit.

    InputError, which names the source, if one cannot be read, or has nothing in common with the study.
    """
    for way, name in _SAMPLES:
        if not (folder / name / "results.nc").is_file():
            continue
        with open_results(folder / name) as again:
            found = compare(dataset, again, (source, str(folder / name)))
        repeated = int(np.sum(found.cells["class_b"] != agreement.OccurrenceClass.NOT_RUN))
        runs = "1 run was" if repeated == 1 else f"{repeated} runs were"
        yield f"{runs} done again {way}, in `{name}`: {contradictions(found, way)}."
        for line in deviations(found, "those done again deviate"):
            yield f"{line[:1].upper()}{line[1:]}."
