"""Several studies as one dataset with the axis `study`, for pictures on one scale of colours."""

from collections.abc import Collection, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.alignment import COMPARED, axes_of
from cvt_hpc.analysis.arrangement import CHOSEN, At, Sides
from cvt_hpc.analysis.classes import check_results
from cvt_hpc.analysis.conversion import standard
from cvt_hpc.analysis.measured import File
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.errors import mismatch, one_line
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import OccurrenceClass

AXIS = "study"
_ALIKE = 1e-9  # relative: by so much values of an axis differ that are the same


def join_studies(
    datasets: Sequence[xr.Dataset], sources: Sequence[str], names: Collection[str] = ()
) -> xr.Dataset:
    """Join studies over grids of the same axes, with `study` as the first one.

    Their values on the axes may differ: what a study does not have was not run. `sources` say for the errors
    where they are from; these also name studies of jobs of one name. `names` are of variables to be kept
    beside verdict, amplitude and frequency. InputError if one of them holds no results, or samples, or is
    over other axes than the first.
    """
    for dataset, source in zip(datasets, sources, strict=True):
        check_results(dataset, source)
        if is_sampled(dataset):
            raise mismatch(source, "results over a grid, to be drawn beside others", "samples")
        if {*axes_of(dataset)} != {*axes_of(datasets[0])}:
            expected = f"the axes of {sources[0]}: {', '.join(axes_of(datasets[0]))}"
            raise mismatch(source, expected, ", ".join(axes_of(dataset)) or "none")
    titles = [one_line(dataset.attrs.get("job_name", "")) for dataset in datasets]
    labels = titles if len({*titles}) == len(titles) and all(titles) else list(map(str, sources))
    kept = (*COMPARED, "inferred_class", *names)
    parts = [_with_values_of(datasets[0], one[[name for name in kept if name in one]]) for one in datasets]
    joined = xr.concat(parts, AXIS, join="outer", data_vars="all", coords="minimal", compat="override")
    joined = joined.assign_coords({AXIS: (AXIS, labels, {"long_name": AXIS})})
    blank = {"status": Status.NOT_RUN, "inferred_class": OccurrenceClass.NOT_RUN, "vibrates": 0}
    missing = ((name, value) for name, value in blank.items() if name in joined)
    filled = {name: joined[name].fillna(value).astype(np.int8) for name, value in missing}
    return joined.assign(filled).drop_attrs(deep=False).assign_attrs(job_name=", ".join(labels))


def side_by_side(
    datasets: Sequence[xr.Dataset], sources: Sequence[str], names: Collection[str], sides: Sides
) -> tuple[xr.Dataset, Sides]:
    """Return studies joined, and the sides of their map: a panel for each unless `study` has a side."""
    placed = sides if AXIS in sides else sides._replace(panel=sides.panel or AXIS)
    return join_studies(datasets, sources, names), placed


def maps_figure(
    datasets: Sequence[xr.Dataset],
    quantities: Sequence[str] = (),
    at: At = None,
    sources: Sequence[str] = (),
    sides: Sides = CHOSEN,
    vmax: float | str | None = None,
    measured: File = None,
) -> Figure:
    """Draw where vibration occurs, or quantities, of one study or of several on one scale of colours.

    Arguments as of `map_figure`; where there are several datasets, `study` is one of the axes, as of
    `join_studies`. `quantities` are variables to be drawn instead of occurrence.
    """
    from cvt_hpc.analysis.maps import map_figure
    from cvt_hpc.analysis.value_maps import value_map_figure

    named = list(sources) or [f"results {k + 1}" if k else "results" for k in range(len(datasets))]
    datasets = list(map(standard, datasets, named))
    dataset, source = datasets[0], ", ".join(named)
    if len(datasets) > 1:
        dataset, sides = side_by_side(datasets, named, quantities, sides)
    if quantities:
        end = None if isinstance(vmax, str) else vmax  # their colours fit by default
        return value_map_figure(dataset, quantities, at, source, sides, end, measured)
    return map_figure(dataset, at, source, sides, vmax, measured)


def _with_values_of(first: xr.Dataset, dataset: xr.Dataset) -> xr.Dataset:
    """A dataset whose axes have the values of another one to the last digit, where they are the same."""
    for name in axes_of(dataset):
        if dataset[name].dtype.kind not in "iuf":
            continue
        own, others = dataset[name].values.astype(float), first[name].values.astype(float)
        near = np.isclose(own[:, np.newaxis], others, rtol=_ALIKE, atol=0.0)
        values = np.where(near.any(axis=1), others[near.argmax(axis=1)], own)
        dataset = dataset.assign_coords({name: (name, values, dataset[name].attrs)})
    return dataset
