"""What to do next with a study: commands and changes of its job, by what came out."""

from collections.abc import Iterator
from shlex import quote

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import value_text
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, map_classes, occurrence_classes
from cvt_hpc.analysis.figures import coordinate_unit, in_words
from cvt_hpc.analysis.ticks import number
from cvt_hpc.job import Job
from cvt_hpc.job.shown import shown
from cvt_hpc.models.contract import load_model
from cvt_hpc.variables import Status
from cvt_hpc.vibration.onsets import levels, onsets

COARSE = 0.02  # of an axis: a step beyond is worth a smaller one
_RETRIES = {
    Status.FAILED_NUMERICS: "with a smaller step",
    Status.FAILED_ERROR: "once the cause is removed",
    Status.TIMED_OUT: "with a longer `--run-limit`",
}


def next_steps(dataset: xr.Dataset, job: Job | None, x: str | None) -> Iterator[str]:
    """Yield what to do next, one sentence each, code between backticks.

    Parameters
    ----------
    dataset : Dataset
        Results of a study.
    job : Job or None
        Its job, where this version reads it.
    x : str or None
        The numeric axis along which windows are told; None of samples.
    """
    status, classes = dataset["status"].values, map_classes(dataset)
    for kind, how in _RETRIES.items():
        if count := int(np.count_nonzero(status == kind)):
            runs = f"{count} runs" if count > 1 else "run"
            yield f"`cvt-hpc run JOB --retry {kind.name.lower()}` does the {runs} again, {how}."
    if "inferred_class" not in dataset and (left := int(np.sum(classes == OccurrenceClass.NOT_RUN))):
        yield f"`cvt-hpc run JOB` goes on: {left} {'runs are' if left > 1 else 'run is'} left."
    undecided = int(np.sum(occurrence_classes(dataset) == OccurrenceClass.UNDECIDED))
    has_transient = job is not None and load_model(job.model).default_stepper is not None
    if has_transient and undecided:
        runs = "The undecided run was" if undecided == 1 else f"The {undecided} undecided runs were"
        yield f"{runs} too short to tell: a larger `longest_duration` in [run] may decide more."
    if x is not None and x in classes.dims and dataset[x].dtype.kind in "iuf":
        yield from _along(dataset[x], classes)
    vibrating = (classes == OccurrenceClass.VIBRATING) & (dataset["status"] == Status.DONE)
    if has_transient and vibrating.any() and "run" not in classes.dims:
        sizes = np.where(vibrating, at_strongest_strand(dataset, "amplitude"), -1.0)
        places = np.unravel_index(int(np.nanargmax(sizes)), sizes.shape)
        at = (
            "--at " + quote(f"{name}={shown(dataset[name].values.tolist()[place], dataset[name].attrs)}")
            for name, place in zip(map(str, classes.dims), places, strict=True)
        )
        feeds = "; then `cvt-hpc plot energy run.nc` what feeds it" if "flank_fed" in dataset else ""
        command = f"cvt-hpc simulate JOB {' '.join(at)} --out run.nc --plot run.png"
        yield f"`{command}` shows the run that vibrates most{feeds}."


def _along(axis: xr.DataArray, classes: xr.DataArray) -> Iterator[str]:
    """How far windows reach along an axis, and how well their ends are known."""
    classes = classes.sortby(str(axis.name)).transpose(..., str(axis.name))
    axis = axis.sortby(str(axis.name))
    values, name = axis.values.astype(float), in_words(axis)
    if np.count_nonzero(np.isfinite(values)) < 2:
        return
    rows = levels(classes.values).reshape(-1, values.size)
    for place, side in ((-1, "largest"), (0, "smallest")):
        if (count := int(np.sum(rows[:, place] > 0.0))) and np.isfinite(values[place]):
            lines = "a line" if count == 1 else f"{count} lines"
            value = value_text(axis, place)
            yield f"Vibration reaches the {side} {name}, {value}, in {lines}: go further there."
    ends = sorted({one.load for row in rows for one in onsets(values, row) if np.isfinite(one.load)})
    steps = np.diff(values[np.isfinite(values)])
    if ends and steps.max() > COARSE * steps.sum():
        factor, unit = coordinate_unit(axis.attrs)
        behind = f" {unit}" if unit else ""
        low, high, step = (number(factor * value, ".4g") for value in (ends[0], ends[-1], steps.max()))
        between = f"near {low}" if low == high else f"between {low} and {high}"
        closer = f"Steps of {name} below {step}{behind} {between}{behind}"
        yield f"{closer} would tell better where windows begin and end."
