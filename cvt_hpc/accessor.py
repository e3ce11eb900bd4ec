"""`dataset.cvt`: what people ask of the results of a study, as methods of its xarray dataset.

It is there once `cvt_hpc.open_results` was used, or this module was imported, and then on any dataset of this
program, whoever opened it:

    import xarray as xr
    import cvt_hpc.accessor

    results = xr.open_dataset("out/lebrecht_2004/results.nc")
    results.cvt.onset().sel(sheave_stiffness=1.0)

`read_table` reads the small tables that slow studies leave in the repository as datasets.
"""

from __future__ import annotations

from collections.abc import Sequence
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import Sides
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, check_results, map_classes
from cvt_hpc.analysis.conversion import in_units, plain, standard
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.picture_kinds import END, HISTORIES, HISTORY, KINDS, RESULTS, Kind, compose
from cvt_hpc.study import open_results
from cvt_hpc.vibration.classes import levels, onsets

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from cvt_hpc.analysis.animation import Animation
    from cvt_hpc.analysis.measured_score import Score
import csv
from collections.abc import Callable

from cvt_hpc.analysis.conversion import documented_units
from cvt_hpc.job.units import to_si
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.storage.files import naming_refusals, read_regular
from cvt_hpc.storage.netcdf import flag_attributes
from cvt_hpc.tables import below_origin
from cvt_hpc.variables import Status, Vibrates

_LARGEST_TABLE = 16 << 20  # [byte]
_LABELS = {"t1": "strand", "t2": "strand", "driving": "pulley", "driven": "pulley"}

__all__ = ["Results", "open_results", "read_table"]


@xr.register_dataset_accessor("cvt")
class Results:
    """Questions to the results of a study.

    Axes to fix are given by name, as numbers [SI] or texts: `results.cvt.map(sheave_stiffness=1.5)`. Figures
    are shown by a notebook, and written by `figure.savefig("map.pdf")`. All raise InputError for datasets
    that hold no results of a study, and for axes and values that these do not have.

    Parameters
    ----------
    dataset : Dataset
        As `open_results` or xarray open it, or what xarray and pint-xarray have made of it: a part, several
        studies in one, values in other units.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._given = dataset

    @property
    def _dataset(self) -> xr.Dataset:
        """In the form of this program, as of now: datasets can be changed in place."""
        return standard(self._given)

    def _history(self, verb: str) -> xr.Dataset:
        """History of a run, which a verb draws."""
        dataset = self._dataset
        if "status" in dataset and dataset["status"].dims:
            raise mismatch("results", f"the history of a run, which {verb} draws", "a study of several")
        return dataset

    def map(
        self,
        show: str | Sequence[str] = (),
        *,
        x: str | None = None,
        y: str | None = None,
        panel: str | None = None,
        vmax: float | str | None = None,
        beside: xr.Dataset | Sequence[xr.Dataset] = (),
        measured: str | Path | None = None,
        **at: float | str,
    ) -> Figure:
        """Draw where vibration occurs, or quantities over two axes.

        Parameters
        ----------
        show : str or sequence of str
            Variables, such as "efficiency", instead of occurrence.
        x, y, panel : str
            Axes that run along x, along y and over the panels.
        vmax : float or "fit"
            Where the colours end [SI unit of what is shown]; of occurrence by default as in all maps.
        beside : Dataset or sequence of Dataset
            Further studies over the same axes: a panel for each, on one scale of colours.
        measured : str or Path
            CSV file of a test rig, drawn over the map; see `cvt_hpc.analysis.measured`.
        **at
            Axes to fix.
        """
        from cvt_hpc.analysis.studies import maps_figure

        quantities = [show] if isinstance(show, str) else list(show)
        datasets = [self._given, *_several(beside)]
        return maps_figure(datasets, quantities, at, (), Sides(x, y, panel), vmax, measured)

    def animation(self) -> Animation:
        """Draw the belt in the last periods of a run, magnified, as a moving picture; of a history.

        A notebook shows it, and `save("belt.gif")` writes it.
        """
        from cvt_hpc.analysis.animation import animation

        return animation(self._history("animation"))

    def export(self, out: str | Path, *of: str, velocity: bool = False) -> list[str]:
        """Write signals of a run as WAV, CSV or UFF58, and return lines about it; of a history.

        See `cvt_hpc.analysis.export.export`.
        """
        from cvt_hpc.analysis.export import export

        return export(self._history("export"), of, Path(out), velocity=velocity)

    def report(self, out: str | Path = "report.html", measured: str | Path | None = None) -> Path:
        """Write a page: findings, a map with values, failed runs, cost; with a measured file the score."""
        from cvt_hpc.report import write_report

        return write_report(self._dataset, Path(out), measured=measured)

    def score(self, measured: str | Path) -> Score:
        """Return how far the study agrees with a measured file; see `cvt_hpc.analysis.measured_score`."""
        from cvt_hpc.analysis.measured_score import score

        return score(self._dataset, measured)

    def table(self) -> DataFrame:
        """Return a data frame with a row for each run.

        Its columns are the axes in the units of the job, `status`, `class`, and all results in the units of
        the dataset, those of strands and pulleys by their names: `amplitude_t1 [m]`. Flags are words. Unlike
        `to_dataframe`, which has a row for each value of each spectrum, it leaves out spectra and profiles.
        `cvt-hpc table` writes it as CSV or XLSX.
        """
        from cvt_hpc.analysis.run_table import run_table

        return run_table(plain(self._given))

    def in_units(self, **units: str) -> xr.Dataset:
        """Return the dataset with some variables and coordinates in other units: `in_units(loss="kW")`.

        Parameters
        ----------
        **units
            By the name of a variable or coordinate a unit of its dimension, such as `driving_speed="rpm"`.

        Returns
        -------
        Dataset
            Values and the attribute `units` are converted. Of a chunked dataset nothing is computed yet.
            Pictures and reports of it are those of the values in SI units, with axes in these units.
        """
        return in_units(self._given, units)

    def classes(self) -> xr.DataArray:
        """Return the class of each run or cell as a flag variable: quiet, vibrating, failed, ..."""
        dataset = plain(self._given)
        check_results(dataset, "results")
        return map_classes(dataset)

    def strongest(self, name: str = "amplitude") -> xr.DataArray:
        """Return a variable at the strand with the largest amplitude, where the run vibrates; else nan.

        It has the dimensions of `amplitude`, such as `frequency`.
        """
        dataset = plain(self._given)
        check_results(dataset, "results")
        if name not in dataset:
            raise unknown("results", "variable", name, map(str, dataset.data_vars))
        dims = set(dataset["amplitude"].dims) if "amplitude" in dataset else set()
        if set(dataset[name].dims) != dims:
            found = ", ".join(map(str, dataset[name].dims)) or "none"
            raise mismatch(f"results: {name}", "a variable with the dimensions of amplitude", found)
        values = at_strongest_strand(dataset, name)
        values.attrs = dict(dataset[name].attrs)
        return values.rename(name).where(map_classes(dataset) == OccurrenceClass.VIBRATING)

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

    def probability(self) -> xr.Dataset:
        """Return probabilities with 95 % intervals, and quantiles, over samples of uncertain parameters.

        See `cvt_hpc.analysis.probability.probabilities`.
        """
        from cvt_hpc.analysis.probability import probabilities

        return probabilities(self._dataset)

    def onset_scatter(self, along: str = "load") -> xr.Dataset:
        """Return quantiles of the onset, and what half the scatter of each parameter makes of them.

        See `cvt_hpc.analysis.sensitivity.onset_scatter`.
        """
        from cvt_hpc.analysis.sensitivity import onset_scatter

        return onset_scatter(self._dataset, along)

    def indices(self, of: str = "vibration", along: str = "") -> xr.Dataset:
        """Return to which uncertain parameters the variance of a result is due; a job needs `indices = true`.

        Each cell has its own; with `along` a row of cells, as `indices("vibration", "load")`, or the onset
        along it: `indices("onset", "load")`. See `cvt_hpc.analysis.sensitivity.indices_of`.
        """
        from cvt_hpc.analysis.sensitivity import indices_of

        return indices_of(self._dataset, of, along)

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
    """Boundaries along the last dimension, and which of them rise: both (..., most), nan behind the last."""
    places, rising = np.full((2, *classes.shape[:-1], most), np.nan)
    for line in np.ndindex(classes.shape[:-1]):
        for k, one in enumerate(onsets(axis, levels(classes[line]))):
            places[line][k], rising[line][k] = one.load, one.rising
    return places, rising


def _several(beside: xr.Dataset | Sequence[xr.Dataset]) -> Sequence[xr.Dataset]:
    return [beside] if isinstance(beside, xr.Dataset) else beside


def _verb(name: str, kind: Kind) -> Any:
    """A method of `Results` that draws a picture of a kind."""
    options = {option.key: option for option in kind.options}
    word = next((option for option in kind.options if option.is_word), None)
    takes_all = word is not None and word.key == "quantities"
    parameters = [Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)]
    if word:
        way = Parameter.VAR_POSITIONAL if takes_all else Parameter.POSITIONAL_OR_KEYWORD
        parameters.append(Parameter(word.key, way, **({} if takes_all else {"default": None})))
    keys = [key for key in (*options, *kind.sides) if word is None or key != word.key]
    keys += ["beside"] if kind.subject == HISTORIES else []
    parameters += [Parameter(key, Parameter.KEYWORD_ONLY, default=None) for key in keys]
    if kind.subject == RESULTS:
        parameters.append(Parameter("at", Parameter.VAR_KEYWORD))
    signature = Signature(parameters, return_annotation="Figure")

    def verb(self: Results, *words: Any, **given: Any) -> Figure:
        chosen = signature.bind(self, *words, **given).arguments
        if word and not word.flag and not words:  # what the command line asks for, too
            raise mismatch(name, word.text, "nothing")
        at, beside = chosen.pop("at", None), chosen.pop("beside", None)
        del chosen["self"]
        dataset = self._dataset if kind.subject == RESULTS else self._history(name)
        chosen = {key: value for key, value in chosen.items() if value is not None and value != ()}
        return compose(name, [dataset, *map(standard, _several(beside or ()))], at, **chosen)

    subjects = {RESULTS: "of results", HISTORY: "of a history", HISTORIES: "of one history or several"}
    lines = [f"Draw {kind.text}; {subjects[kind.subject]}.", "", "Parameters", "----------"]
    for key, option in options.items():
        text = "value at which colours end [SI]" if key == END else option.text
        lines += [key, f"    {text[0].upper()}{text[1:]}."]
    lines += [f"{side}\n    Axis that runs there." for side in kind.sides]
    lines += ["beside\n    Further histories."] if kind.subject == HISTORIES else []
    lines += ["**at\n    Axes to fix."] if kind.subject == RESULTS else []
    verb.__name__, verb.__qualname__ = name, f"Results.{name}"
    verb.__doc__ = "\n".join(lines if len(lines) > 4 else lines[:1])
    verb.__signature__ = signature  # type: ignore[attr-defined]  # what help() and notebooks show
    return verb


for _name, _kind in KINDS.items():
    setattr(Results, _name, _verb(_name, _kind))


def read_table(path: str | Path) -> xr.Dataset:
    """Return the results that a small table of a study keeps, such as jobs/results/lebrecht_2004.csv.

    Parameters
    ----------
    path : str or Path
        A CSV file as `jobs/tabulate.py` writes it: lines with "#" of its origin, then a head of axes [SI],
        `status`, `vibrates`, and quantities with the unit and a column for each strand or pulley. The axes
        make a full grid; what is linked to one of them is a coordinate along it.

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
        lines = read_regular(Path(path), _LARGEST_TABLE).decode().splitlines()
        rows = list(csv.reader(below_origin(lines)))
    head, body = (rows[0] if rows else []), rows[1:]
    if "status" not in head or any(len(row) != len(head) for row in body):
        raise mismatch(str(path), "a table of a study, with a column status and full rows", ", ".join(head))
    columns = dict(zip(head, zip(*body, strict=True), strict=True))
    axes = {name: _numbers(columns[name]) for name in head[: head.index("status")]}
    linked = _linked(axes)
    followers = {name: axes.pop(name) for name in linked}
    coordinates = {name: np.unique(values) for name, values in axes.items()}
    shape = tuple(map(len, coordinates.values()))
    places = tuple(np.searchsorted(coordinates[name], values) for name, values in axes.items())
    if len(body) != np.prod(shape) or len(set(zip(*places, strict=True))) != len(body):
        raise mismatch(str(path), "a row for each place of the grid", f"{len(body)} rows")

    def grid(values: np.ndarray) -> np.ndarray:
        filled = np.empty(shape, values.dtype)
        filled[places] = values
        return filled

    named = {name: (name, values, {"units": _unit_of(name)}) for name, values in coordinates.items()}
    dataset = xr.Dataset(coords=named)
    for name, leader in linked.items():
        first = np.unique(axes[leader], return_index=True)[1]
        dataset.coords[name] = (leader, followers[name][first], {"units": _unit_of(name)})
    for name, flags in (("status", Status), ("vibrates", Vibrates)):
        known = {flag.name.lower(): flag for flag in flags}
        values = [known.get(word, Vibrates.UNDECIDED) for word in columns[name]]
        dataset[name] = (tuple(axes), grid(np.array(values, np.int8)), flag_attributes(flags))
    for column in head[head.index("vibrates") + 1 :]:
        _add(dataset, column, tuple(axes), columns[column], grid)
    return dataset.assign_attrs(job_name=Path(path).stem)


def _linked(columns: dict[str, np.ndarray]) -> dict[str, str]:
    """Return the axis that decides the values of each column that varies with one axis alone."""
    found: dict[str, str] = {}
    counts = {name: np.unique(values).size for name, values in columns.items()}
    for name, values in reversed(columns.items()):  # axes come first
        for leader in columns:
            pairs = set(zip(columns[leader], values, strict=True))
            is_decided = leader != name and leader not in found and len(pairs) == counts[leader]
            if is_decided and counts[name] > 1:
                found[name] = leader
                break
    return found


def _add(
    dataset: xr.Dataset, column: str, dims: tuple[str, ...], texts: Sequence[str], grid: Callable
) -> None:
    """Add a column of numbers to a dataset, where it belongs to a strand or pulley at its place."""
    name, _, unit = column.removesuffix("]").partition(" [")
    try:
        values = grid(_numbers(texts))
    except ValueError:
        return  # of texts
    si = {"um": "m"}.get(unit, unit)
    values = values * (to_si(f"1 {unit}", si) if unit else 1.0)
    head, _, label = name.rpartition("_")
    if not head or label not in _LABELS:
        head, label = name, ""
    attributes = {"units": si or documented_units(False).get(head, "1")}
    if not label:
        dataset[name] = (dims, values, attributes)
        return
    extra = _LABELS[label]
    if head not in dataset:
        labels = [one for one, dim in _LABELS.items() if dim == extra]
        dataset[head] = ((*dims, extra), np.full((*values.shape, len(labels)), np.nan), attributes)
        dataset[extra] = labels
    dataset[head].loc[{extra: label}] = values


def _numbers(texts: Sequence[str]) -> np.ndarray:
    return np.array([float(text) if text else np.nan for text in texts])


def _unit_of(key: str) -> str:
    """The SI unit of a parameter of any model; "1" of what none knows."""
    tables = (table for model in MODELS for table in load_model(model).parameters.values())
    return next((table[key].unit or "1" for table in tables if key in table), "1")
