"""`dataset.cvt`: what people ask of the results of a study, as methods of its xarray dataset.

It is there once `cvt_hpc.open_results` was used, or this module was imported, and then on any dataset of this
program, whoever opened it:

    import xarray as xr
    import cvt_hpc.accessor

    results = xr.open_dataset("out/lebrecht_2004/results.nc")
    results.cvt.onset().sel(sheave_stiffness=1.0)
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import Sides
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, check_results, map_classes
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.files import naming_refusals, read_regular
from cvt_hpc.job.units import to_si
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.study import open_results
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.onsets import levels, onsets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Results", "open_results", "read_table"]

_LARGEST_TABLE = 16 << 20  # [byte]
_LABELS = {"strand": ("t1", "t2"), "pulley": ("driving", "driven")}


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

    def campbell(self, *, orders: Sequence[float] = (1.0, 2.0, 4.0, 8.0, 16.0), **at: Any) -> Figure:
        """Draw the spectra over the driving speed, with eigenfrequencies and orders of that speed."""
        from cvt_hpc.analysis.waterfall import campbell_figure

        return campbell_figure(self._dataset, at, orders=orders)

    def spectrogram(self) -> Figure:
        """Draw the spectra of the strands of one run along its ramp, or over time; of a history."""
        from cvt_hpc.analysis.ramps import spectrogram_figure

        return spectrogram_figure([self._dataset])

    def phase(self) -> Figure:
        """Draw the phase portraits of the strands of one run; of a history."""
        from cvt_hpc.analysis.histories import phase_figure

        return phase_figure(self._dataset)

    def flanks(self) -> Figure:
        """Draw left and right flank along the belt; of a history of a spatial pushbelt."""
        from cvt_hpc.analysis.flanks import flanks_figure

        return flanks_figure(self._dataset)

    def energy(self) -> Figure:
        """Draw what friction takes on the arcs of one run, and what feeds its vibration; of a history."""
        from cvt_hpc.analysis.on_variator import energy_figure

        return energy_figure(self._dataset)

    def variator(self, *quantities: str) -> Figure:
        """Draw quantities along the belt on the variator, the push force by default; of a history."""
        from cvt_hpc.analysis.on_variator import variator_figure

        return variator_figure(self._dataset, quantities or ("push_force",))

    def history(self) -> Figure:
        """Draw one run: motion, spectrum, load and forces; of a history."""
        from cvt_hpc.analysis.histories import history_figure

        return history_figure(self._dataset)

    def hysteresis(self, **at: Any) -> Figure:
        """Draw where vibration begins and ends along ramps up and down, and the bands between them."""
        from cvt_hpc.analysis.hysteresis_bands import hysteresis_figure

        return hysteresis_figure(self._dataset, at)

    def classes(self) -> xr.DataArray:
        """Return the class of each run or cell as a flag variable: quiet, vibrating, failed, ..."""
        check_results(self._dataset, "results")
        return map_classes(self._dataset)

    def strongest(self, name: str = "amplitude") -> xr.DataArray:
        """Return a variable at the strand with the largest amplitude, where the run vibrates; else nan.

        It has the dimensions of `amplitude`, such as `frequency`.
        """
        check_results(self._dataset, "results")
        if name not in self._dataset:
            raise unknown("results", "variable", name, map(str, self._dataset.data_vars))
        dims = set(self._dataset["amplitude"].dims) if "amplitude" in self._dataset else set()
        if set(self._dataset[name].dims) != dims:
            found = ", ".join(map(str, self._dataset[name].dims)) or "none"
            raise mismatch(f"results: {name}", "a variable with the dimensions of amplitude", found)
        values = at_strongest_strand(self._dataset, name)
        values.attrs = dict(self._dataset[name].attrs)
        return values.rename(name).where(self.classes() == OccurrenceClass.VIBRATING)

    def onset(self, along: str = "load") -> xr.DataArray:
        """Return where vibration sets in: the lowest load, or value of another axis, of a change from quiet.

        Returns
        -------
        DataArray
            Over the other axes [unit of the axis], midway between a quiet and a vibrating neighbour, so known
            within half a step, and inf next to an infinite one; nan where nothing sets in. Undecided, failed
            and missing runs are passed over, slipping and irregular ones too.
        """
        boundary = self.boundary(along)
        onset = boundary.where(boundary["rising"] == 1.0).min("boundary", keep_attrs=True)
        return onset.rename("onset").assign_attrs(long_name=f"onset of vibration in {along}")

    def boundary(self, along: str = "load") -> xr.DataArray:
        """Return all boundaries between quiet and vibrating along an axis.

        Returns
        -------
        DataArray
            Over the other axes and `boundary` [unit of the axis], ascending, nan behind the last one; there
            are as many places as there can be boundaries, one less than values on the axis.
            `rising` says whether the belt vibrates above: windows begin at rising boundaries. A vibration at
            the lowest value already has no rising boundary.
        """
        classes = self.classes()
        if along not in classes.dims or classes[along].dtype.kind not in "iuf":
            numeric = [name for name in map(str, classes.dims) if classes[name].dtype.kind in "iuf"]
            raise mismatch("results: along", f"one of the axes {', '.join(numeric) or '(none)'}", along)
        axis = np.asarray(classes[along].values, float)
        most = max(axis.size - 1, 1)
        places, rising = xr.apply_ufunc(
            _boundaries,
            classes,
            input_core_dims=[[along]],
            output_core_dims=[["boundary"]] * 2,
            kwargs={"axis": axis, "most": most},
            dask="parallelized",
            dask_gufunc_kwargs={"allow_rechunk": True, "output_sizes": {"boundary": most}},
            output_dtypes=[float, float],
        )
        of_axis = classes[along].attrs
        attributes = {key: of_axis[key] for key in ("units", "job_units") if key in of_axis}
        attributes |= {"long_name": f"boundary of vibration in {along}"}
        found = places.rename("boundary").assign_coords(rising=rising.variable)
        return found.drop_attrs(deep=False).assign_attrs(attributes)


def _boundaries(classes: np.ndarray, axis: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Boundaries along the last dimension, and which of them rise: both (..., most), nan behind the last one."""
    places, rising = np.full((2, *classes.shape[:-1], most), np.nan)
    for line in np.ndindex(classes.shape[:-1]):
        for k, one in enumerate(onsets(axis, levels(classes[line]))):
            places[line][k], rising[line][k] = one.load, one.rising
    return places, rising


def read_table(path: str | Path) -> xr.Dataset:
    """Return the results that a small table of a study keeps, such as jobs/results/lebrecht_2004.csv.

    Parameters
    ----------
    path : str or Path
        A CSV file as `jobs/tabulate.py` writes it: axes [SI], `status`, `vibrates`, quantities with the unit
        in their head and a column for each strand or pulley. The axes make a full grid.

    Returns
    -------
    Dataset
        As `open_results` returns it, of these quantities alone [SI].

    Raises
    ------
    InputError
        If the file cannot be read or is no such table.
    """
    with naming_refusals(Path(path), "a table of a study"):
        rows = list(csv.reader(read_regular(Path(path), _LARGEST_TABLE).decode().splitlines()))
    head, body = (rows[0] if rows else []), rows[1:]
    if "status" not in head or any(len(row) != len(head) for row in body):
        raise mismatch(str(path), "a table of a study, with a column status and full rows", ", ".join(head))
    columns = dict(zip(head, zip(*body, strict=True), strict=True))
    axes = {name: _numbers(columns[name]) for name in head[: head.index("status")]}
    coordinates = {name: np.unique(values) for name, values in axes.items()}
    shape = tuple(map(len, coordinates.values()))
    places = tuple(np.searchsorted(coordinates[name], values) for name, values in axes.items())
    if len(body) != np.prod(shape) or len(set(zip(*places, strict=True))) != len(body):
        raise mismatch(str(path), "a row for each place of the grid", f"{len(body)} rows")

    def grid(values: np.ndarray) -> np.ndarray:
        filled = np.empty(shape, values.dtype)
        filled[places] = values
        return filled

    dataset = xr.Dataset(
        coords={name: (name, v, {"units": _unit_of(name)}) for name, v in coordinates.items()}
    )
    for name, flags in (("status", Status), ("vibrates", Vibrates)):
        known = {flag.name.lower(): flag for flag in flags}
        values = [known.get(word, Vibrates.UNDECIDED) for word in columns[name]]
        meanings = {"flag_values": np.array(list(flags), np.int8), "flag_meanings": " ".join(known)}
        dataset[name] = (tuple(axes), grid(np.array(values, np.int8)), meanings)
    for column in head[head.index("vibrates") + 1 :]:
        _add(dataset, column, tuple(axes), columns[column], grid)
    return dataset.assign_attrs(job_name=Path(path).stem)


def _add(dataset: xr.Dataset, column: str, dims: tuple[str, ...], texts: Sequence[str], grid: Any) -> None:
    """Add a column of numbers to a dataset, where it belongs to a strand or pulley at its place."""
    name, _, unit = column.removesuffix("]").partition(" [")
    try:
        values = grid(_numbers(texts))
    except ValueError:
        return  # of texts
    si = {"um": "m"}.get(unit, unit)
    values = values * (to_si(f"1 {unit}", si) if unit else 1.0)
    name, label = next(
        (
            (name.removesuffix(f"_{one}"), one)
            for labels in _LABELS.values()
            for one in labels
            if name.endswith(f"_{one}")
        ),
        (name, ""),
    )
    attributes = {"units": si or "1"}
    if not label:
        dataset[name] = (dims, values, attributes)
        return
    extra = next(dim for dim, labels in _LABELS.items() if label in labels)
    if name not in dataset:
        labels = list(_LABELS[extra])
        dataset[name] = ((*dims, extra), np.full((*values.shape, len(labels)), np.nan), attributes)
        dataset[extra] = labels
    dataset[name].loc[{extra: label}] = values


def _numbers(texts: Sequence[str]) -> np.ndarray:
    return np.array([float(text) if text else np.nan for text in texts])


def _unit_of(key: str) -> str:
    """The SI unit of a parameter of any model; "1" of what none knows."""
    tables = (table for model in MODELS for table in load_model(model).parameters.values())
    return next((table[key].unit or "1" for table in tables if key in table), "1")
