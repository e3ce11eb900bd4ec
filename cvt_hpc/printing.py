"""What the command line prints: reports, states and outcomes in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from cvt_hpc.job.values import in_words

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.study import RunReport, StudyStatus

MOST_FAILURES_NAMED = 10
_FLAGS_FIRST = ("status", "vibrates", "reason")
_LARGEST_LINE = 4  # values: one per strand or pulley, but no spectrum and no history


def report_lines(report: RunReport) -> Iterator[str]:
    """Yield the lines that say how a sweep ended."""
    yield f"{report.total} runs: {report.done} done, {len(report.failed)} failed, {report.remaining} left"
    yield f"results: {report.results}"


def trouble_lines(report: RunReport) -> Iterator[str]:
    """Yield the lines that name the failed runs of a sweep, ten at most, and say why it stopped early."""
    for run in report.failed[:MOST_FAILURES_NAMED]:
        place = ", ".join(f"{name} = {in_words(value, '')}" for name, value in run.at.items())
        yield f"run {run.index}{f' ({place})' if place else ''}: {run.status}: {run.reason}"
    unnamed = len(report.failed) - MOST_FAILURES_NAMED
    if unnamed > 0:
        yield f"{unnamed} more runs failed; `status` and `reason` in {report.results} tell which"
    if report.remaining:
        yield f"stopped early ({report.stopped}); the same command goes on from here"


def status_lines(status: StudyStatus) -> Iterator[str]:
    """Yield the lines that say how far a study is."""
    from cvt_hpc.study.progress import show_duration

    yield f"job     {status.name} ({'running' if status.running else 'not running'})"
    yield f"runs    {status.total}"
    yield f"done    {status.done} ({status.done / status.total:.1%})"
    yield f"failed  {status.failed}"
    yield f"left    {status.left}"
    if status.rate is not None:
        yield f"rate    {status.rate:.3g} runs/s"
    if status.left and status.time_to_go is not None:
        yield f"to go   {show_duration(status.time_to_go)}"


def outcome_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the lines that say what one run gave: its scalars, and what is per strand or pulley."""
    names = [str(name) for name, array in dataset.data_vars.items() if array.size <= _LARGEST_LINE]
    names.sort(key=lambda name: name not in _FLAGS_FIRST)
    width = max(map(len, names), default=0)
    for name in names:
        words = _array_in_words(dataset[name])
        if words:
            yield f"{name.ljust(width)}  {words}"


def _array_in_words(array: xr.DataArray) -> str:
    """Return the values of a small array, each with its place where there are several, and the unit."""
    if "flag_meanings" in array.attrs:
        meanings = dict(zip(array.attrs["flag_values"], array.attrs["flag_meanings"].split(), strict=True))
        return meanings[array.item()]
    unit = array.attrs.get("units", "")
    unit = "" if unit == "1" else unit
    if array.ndim == 0:
        value = array.item()
        return f"{value:.6g} {unit}".rstrip() if isinstance(value, float) else f"{value} {unit}".rstrip()
    (dimension,) = array.dims
    places = zip(array[dimension].values, array.values, strict=True)
    return f"{', '.join(f'{place} {value:.6g}' for place, value in places)} {unit}".rstrip()
