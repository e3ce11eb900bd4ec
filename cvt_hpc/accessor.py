"""`dataset.cvt`: what people ask of the results of a study, as methods of its xarray dataset.

It is there once `cvt_hpc.open_results` was used, or this module was imported, and then on any dataset of this
program, whoever opened it:

    import xarray as xr
    import cvt_hpc.accessor

    results = xr.open_dataset("out/lebrecht_2004/results.nc")
    results.cvt.onset().sel(sheave_stiffness=1.0)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import Sides
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, check_results, map_classes
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.study import open_results
from cvt_hpc.vibration.onsets import onsets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Results", "open_results"]

_LEVEL = {OccurrenceClass.QUIET: -1.0, OccurrenceClass.VIBRATING: 1.0}


@xr.register_dataset_accessor("cvt")
class Results:
    """Questions to the results of a study.

    Axes to fix are given by name, as numbers [SI] or texts: `results.cvt.map(sheave_stiffness=1.5)`. Figures
    are shown by a notebook, and written by `figure.savefig("map.pdf")`. All raise InputError for datasets
    that hold no results of a study, and for axes and values that these do not have.

    Parameters
    ----------
    dataset : Dataset
        As `open_results` returns it, or a part of it.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def map(
        self,
        show: str | Sequence[str] = (),
        *,
        x: str | None = None,
        y: str | None = None,
        panel: str | None = None,
        vmax: float | None = None,
        **at: Any,
    ) -> Figure:
        """Draw where vibration occurs, or quantities over two axes.

        Parameters
        ----------
        show : str or sequence of str
            Variables, such as "efficiency", instead of occurrence.
        x, y, panel : str
            Axes that run along x, along y and over the panels.
        vmax : float
            Where the colours end [SI unit of what is shown].
        **at
            Axes to fix.
        """
        from cvt_hpc.analysis.maps import map_figure
        from cvt_hpc.analysis.value_maps import value_map_figure

        sides, quantities = Sides(x, y, panel), [show] if isinstance(show, str) else list(show)
        if quantities:
            return value_map_figure(self._dataset, quantities, at, sides=sides, vmax=vmax)
        return map_figure(self._dataset, at, sides=sides, vmax=vmax)

    def waterfall(self, *, x: str | None = None, **at: Any) -> Figure:
        """Draw the spectra of the strands over an axis, with eigenfrequencies where they are known."""
        from cvt_hpc.analysis.waterfall import waterfall_figure

        return waterfall_figure(self._dataset, at, sides=Sides(x))

    def classes(self) -> xr.DataArray:
        """Return the class of each run or cell as a flag variable: quiet, vibrating, failed, ..."""
        check_results(self._dataset, "results")
        return map_classes(self._dataset)

    def strongest(self, name: str = "amplitude") -> xr.DataArray:
        """Return a variable at the strand with the largest amplitude, where the run vibrates; else nan."""
        check_results(self._dataset, "results")
        if name not in self._dataset:
            raise unknown("results", "variable", name, map(str, self._dataset.data_vars))
        values = at_strongest_strand(self._dataset, name)
        values.attrs = dict(self._dataset[name].attrs)
        return values.rename(name).where(self.classes() == OccurrenceClass.VIBRATING)

    def onset(self, along: str = "load") -> xr.DataArray:
        """Return where vibration sets in: the lowest load, or value of another axis, of a change from quiet.

        Returns
        -------
        DataArray
            Over the other axes [unit of the axis], midway between a quiet and a vibrating neighbour, so known
            within half a step; nan where nothing sets in. Undecided, failed and missing runs are passed over,
            slipping and irregular ones too.
        """
        boundary = self.boundary(along)
        onset = boundary.where(boundary["rising"] == 1.0).min("boundary", keep_attrs=True)
        return onset.rename("onset").assign_attrs(long_name=f"onset of vibration in {along}")

    def boundary(self, along: str = "load") -> xr.DataArray:
        """Return all boundaries between quiet and vibrating along an axis.

        Returns
        -------
        DataArray
            Over the other axes and `boundary` [unit of the axis], ascending, nan behind the last one.
            `rising` says whether the belt vibrates above: windows begin at rising boundaries. A vibration at
            the lowest value already has no rising boundary.
        """
        classes = self.classes()
        if along not in classes.dims or classes[along].dtype.kind not in "iuf":
            numeric = [name for name in map(str, classes.dims) if classes[name].dtype.kind in "iuf"]
            raise mismatch("results: along", f"one of the axes {', '.join(numeric) or '(none)'}", along)
        others = [name for name in classes.dims if name != along]
        level = np.full(classes.shape, np.nan)
        for kind, value in _LEVEL.items():
            level[classes.values == kind] = value
        rows = np.moveaxis(level, classes.dims.index(along), -1)
        axis = np.asarray(classes[along].values, float)
        found = [onsets(axis, row) for row in rows.reshape(-1, axis.size)]
        most = max([1, *map(len, found)])
        places, rising = np.full((2, len(found), most), np.nan)
        for k, line in enumerate(found):
            places[k, : len(line)] = [one.load for one in line]
            rising[k, : len(line)] = [one.rising for one in line]
        shape, dims = (*rows.shape[:-1], most), (*others, "boundary")
        of_axis = classes[along].attrs
        attributes = {key: of_axis[key] for key in ("units", "job_units") if key in of_axis}
        attributes |= {"long_name": f"boundary of vibration in {along}"}
        array = xr.DataArray(places.reshape(shape), dims=dims, name="boundary", attrs=attributes)
        coordinates = {name: classes[name] for name in others} | {"rising": (dims, rising.reshape(shape))}
        return array.assign_coords(coordinates)
