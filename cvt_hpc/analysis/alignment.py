"""The common runs of two studies: the same axes in the same order, and on each the values that both have."""

from collections.abc import Collection, Hashable, Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import known_values
from cvt_hpc.analysis.classes import check_results
from cvt_hpc.analysis.held_job import job_of
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.errors import InputError, did_you_mean, mismatch
from cvt_hpc.job.values import shown
from cvt_hpc.study.job_difference import flatten

COMPARED = ("status", "vibrates", "amplitude", "frequency")  # beside what a model adds


class Aligned(NamedTuple):
    """The common runs of two studies.

    A and B have those of COMPARED and of the names asked for that each study has, in memory, over the same
    runs in the same order.
    """

    a: xr.Dataset
    b: xr.Dataset
    left_out: tuple[int, int]  # number of runs of A and of B that the other study does not have
    notes: tuple[str, ...]  # which axis of one study was reduced to the value of the other one, in words


def align(a: xr.Dataset, b: xr.Dataset, sources: tuple[str, str], names: Collection[str] = ()) -> Aligned:
    """Return the common runs of two studies, both over a grid or both of samples.

    `names` are of variables to be kept beside COMPARED. InputError, which names a source, if a dataset holds
    no results, one is of samples and the other over a grid, an axis of one is neither an axis nor a parameter
    of the other, or they have no run in common.
    """
    for dataset, source in zip((a, b), sources, strict=True):
        check_results(dataset, source)
    layouts = ["samples" if is_sampled(dataset) else "results over a grid" for dataset in (a, b)]
    if layouts[0] != layouts[1]:
        raise mismatch(sources[1], f"{layouts[0]}, as in {sources[0]}", layouts[1])
    sizes = a["status"].size, b["status"].size
    reduced = []
    notes: list[str] = []
    for one, other, labels, places in ((a, b, "AB", sources), (b, a, "BA", sources[::-1])):
        one = one[[name for name in (*COMPARED, *names) if name in one]]
        reduced.append(_reduced(one, other, labels, places, notes))
    one, other = (_at_common_samples if is_sampled(a) else _on_common_grid)(reduced[0], reduced[1], sources)
    common = one["status"].size
    return Aligned(one.load(), other.load(), (sizes[0] - common, sizes[1] - common), tuple(notes))


def axes_of(dataset: xr.Dataset) -> list[str]:
    """Names of the axes of a study: dimensions of a grid, coordinates of samples."""
    if is_sampled(dataset):
        return [str(name) for name, values in dataset.coords.items() if values.dims == ("run",)]
    return list(map(str, dataset["status"].dims))


def _reduced(
    one: xr.Dataset, other: xr.Dataset, labels: str, sources: tuple[str, str], notes: list[str]
) -> xr.Dataset:
    """Fix each axis that the other study does not have at the value which its runs have there."""
    fixed = {key.rpartition(".")[2]: value for key, value in flatten(job_of(other)).items()}
    for name in [name for name in axes_of(one) if name not in axes_of(other)]:
        where = f"{sources[0]}: axis {name}"
        if name not in fixed and (is_sampled(one) or one.sizes[name] > 1):
            hint = did_you_mean(name, axes_of(other)) or f"; its axes: {', '.join(axes_of(other)) or 'none'}"
            raise InputError(f"{where}: expected an axis or a parameter of {sources[1]}, found neither{hint}")
        if is_sampled(one):
            raise mismatch(where, f"an axis of {sources[1]}, since samples have no common values", "none")
        places = np.flatnonzero(_keys(one[name]) == _key(fixed[name])) if name in fixed else np.zeros(1, int)
        if not places.size:
            found = f"{_shown(one[name], fixed[name])} in {sources[1]}"
            raise mismatch(where, f"one of {known_values(one[name])}", found)
        note = f"axis {name} of {labels[0]} alone: at {_shown(one[name], one[name].values[places[0]].item())}"
        notes.append(note + (f", as in {labels[1]}" if name in fixed else f", unknown in {labels[1]}"))
        one = one.isel({name: int(places[0])}, drop=True)
    return one


def _on_common_grid(a: xr.Dataset, b: xr.Dataset, sources: tuple[str, str]) -> tuple[xr.Dataset, xr.Dataset]:
    for name in axes_of(a):
        in_a, in_b = _common_places(_keys(a[name]), _keys(b[name]))
        if not in_a:
            expected = f"a value of {sources[0]}: {known_values(a[name])}"
            raise mismatch(f"{sources[1]}: axis {name}", expected, known_values(b[name]))
        a, b = a.isel({name: in_a}), b.isel({name: in_b})
    dims = a["status"].dims
    return a.transpose(*dims, ...), b.transpose(*dims, ...)


def _at_common_samples(
    a: xr.Dataset, b: xr.Dataset, sources: tuple[str, str]
) -> tuple[xr.Dataset, xr.Dataset]:
    keys = (zip(*(_keys(dataset[name]) for name in axes_of(a)), strict=True) for dataset in (a, b))
    in_a, in_b = _common_places(*keys)
    if not in_a:
        raise mismatch(sources[1], f"samples at places of those of {sources[0]}", "none")
    return a.isel(run=in_a), b.isel(run=in_b)


def _common_places(a: Iterable[Hashable], b: Iterable[Hashable]) -> tuple[list[int], list[int]]:
    """Places of the common entries in either sequence, in the order of the first."""
    known = {key: place for place, key in enumerate(b)}
    pairs = [(place, known[key]) for place, key in enumerate(a) if key in known]
    return [place for place, _ in pairs], [place for _, place in pairs]


def _keys(coordinate: xr.DataArray) -> np.ndarray:
    return np.array([_key(value) for value in coordinate.values.tolist()], dtype=object)


def _shown(coordinate: xr.DataArray, value: Any) -> str:
    """A value of an axis for people; of a resolved job infinity is a text."""
    return shown(value if coordinate.dtype.kind in "OUS" else float(value), coordinate.attrs)


def _key(value: Any) -> str:
    """A value of an axis as text: the same for numbers that differ by rounding alone."""
    try:
        return f"{float(value):.10g}"
    except ValueError:
        return str(value)
