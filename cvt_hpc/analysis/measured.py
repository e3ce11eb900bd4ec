"""Measurements of a test rig, placed among the cells of a study or on the course of a run.

A measured file is a CSV file as `read_csv` takes it, of one of three kinds, told by its columns:

    window    AXIS_from, AXIS_to; optional measured_AXIS_from, measured_AXIS_to, frequency_from, frequency_to,
              amplitude: noise between two values of an axis such as load, silence elsewhere in the measured
              range; a row of one value twice states silence alone
    onset     onset_AXIS; optional direction (1: AXIS rises, as without this column; -1: it falls) and the
              measured range: where noise sets in
    peak      AXIS, frequency; optional amplitude: a line of a measured spectrum

Further columns have the name of an axis or a parameter, and say at which value of it a row was measured.
"""

import json
import math
import re
import warnings
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis.alignment import job_held
from cvt_hpc.analysis.classes import ALONG
from cvt_hpc.analysis.figures import coordinate_unit
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.errors import JobWarning, did_you_mean, few_of, mismatch, nearest, show
from cvt_hpc.job.csv_files import MOST_BYTES, content_of, read_csv
from cvt_hpc.job.values import si_unit
from cvt_hpc.parameters import Column, FromFile, RowError

WINDOW, ONSET, PEAK = "window", "onset", "peak"
FREQUENCY = "frequency"
ALIKE = 0.01  # of a parameter that does not vary: so far the measured value may be off
_PLACE = "measured file"
_MOST_NAMED = 8
_LEAST = 1e-300  # stands for zero on a logarithmic side
_BAND = (f"{FREQUENCY}_from", f"{FREQUENCY}_to")
_POSITIVE = (*_BAND, FREQUENCY, "amplitude")

Span = tuple[float, float]
Quantity = tuple[float, str]  # value that does not vary [SI], and its unit


class Side(NamedTuple):
    """A side of a panel, on which values have their places.

    Attributes
    ----------
    name : str
        The axis or quantity along it.
    edges : array, shape (cell + 1,)
        Borders of its cells, in the units that are drawn; of a side without cells its ends.
    factor : float
        From SI to these units.
    values : array, shape (cell,)
        Values of the cells [SI]; empty of a side without cells.
    sign : float
        Sign of all values of a logarithmic side; 0 of a linear one.
    """

    name: str
    edges: NDArray[np.float64]
    factor: float = 1.0
    values: NDArray[np.float64] = np.empty(0)
    sign: float = 0.0

    def place(self, value: float) -> float:
        """Return the place of a value [SI]."""
        shown = self.factor * value
        return self.sign * math.log10(max(self.sign * shown, _LEAST)) if self.sign else shown

    def span(self, low: float, high: float) -> NDArray[np.float64] | None:
        """Return the places of two values [SI], within the ends; None where both lie beyond one end."""
        places, ends = np.array([self.place(low), self.place(high)]), self.edges[[0, -1]]
        return None if places[1] < ends[0] or places[0] > ends[1] else np.clip(places, *ends)

    def cell(self, value: float) -> int | None:
        """Return the cell in which a value [SI] lies, None where there is none."""
        place = self.place(value)
        inside = (self.edges[:-1] <= place) & (place <= self.edges[1:]) & np.isfinite(self.values)
        return int(np.argmax(inside)) if inside.any() else None


class Row(NamedTuple):
    """A row of a measured file.

    Attributes
    ----------
    at : dict
        By axis of the study the value of the cell in which the measured one lies [SI].
    span : (float, float)
        Between which values of the axis `along` noise was measured [SI]; the same twice of onset and peak.
    cell : float
        Value of the cell of an onset or a peak [SI]; not a number of a window.
    frequency : (float, float) or None
        Between which frequencies [Hz].
    amplitude : float
        [m]; not a number where it was not measured.
    swept : (float, float)
        Measured range of the axis [SI], infinite where it is not stated.
    rising : bool
        Whether the axis rose as noise set in.
    """

    at: dict[str, float]
    span: Span
    cell: float
    frequency: Span | None
    amplitude: float
    swept: Span
    rising: bool


class Measured(NamedTuple):
    """A measured file: its name, its kind, the axis of its windows, onsets or peaks, and its rows."""

    name: str
    kind: str
    along: str
    rows: tuple[Row, ...]


def side_of(dataset: xr.Dataset, name: str | None) -> Side:
    """Return an axis of results, sorted if numeric, as a side of a map; without a name, of a single row."""
    if name is None:
        return Side("", layout.ONE_ROW.edges)
    coordinate = dataset[name]
    ruler, values = layout.ruler(coordinate), coordinate.values
    if values.dtype.kind not in "iuf":
        return Side(name, ruler.edges)
    factor, finite = coordinate_unit(coordinate.attrs)[0], np.isfinite(values)
    is_linear = np.allclose(ruler.centres[finite], factor * values[finite])
    sign = 0.0 if is_linear else float(np.sign(values[finite][0]))
    return Side(name, ruler.edges, factor, values.astype(float), sign)


def read_measured(path: str | Path, dataset: xr.Dataset, source: str = "results") -> Measured:
    """Read a measured file beside what was computed.

    Parameters
    ----------
    path : str or Path
        The file.
    dataset : Dataset
        Results of a study over a grid, or the history of a run.
    source : str
        Where it is from, for the errors.

    Returns
    -------
    Measured
        Rows at values that the study does not have are left out, with a warning.

    Raises
    ------
    InputError
        As of `read_csv`; the columns are those of no kind; all rows are left out; or results are samples.
    """
    if is_sampled(dataset):
        raise mismatch(source, "results over a grid, beside which measurements are drawn", "samples")
    dims = map(str, dataset["status"].dims if "status" in dataset else ())
    axes = {
        name: dataset[name] for name in dims if name in dataset.coords and dataset[name].dtype.kind in "iuf"
    }
    constants = {key: value for key, value in _constants(dataset).items() if key not in axes}
    units = {name: si_unit(axis.attrs) for name, axis in axes.items()}
    kind, along, file = _declaration(Path(path), units, {key: unit for key, (_, unit) in constants.items()})
    columns: dict[str, Column] = read_csv(file, str(path), "", _PLACE)
    sides = {name: side_of(dataset.coords.to_dataset().sortby(name), name) for name in axes}
    table = {name: column.values for name, column in columns.items()}
    count = len(next(iter(table.values())))
    told = [{name: values[k] for name, values in table.items()} for k in range(count)]
    placed = [_row(one, kind, along, sides, constants) for one in told]
    rows = tuple(row for row in placed if row is not None)
    if len(rows) < count:
        first = told[placed.index(None)]
        at = ", ".join(f"{name} {value:g} {columns[name].unit}".rstrip() for name, value in first.items())
        text = f"{len(rows)} of {count}; the first that it has not: {at}"
        if axes and not rows:
            raise mismatch(f"{_PLACE}: {path}", f"rows at values that {source} has", text)
        warnings.warn(f"{_PLACE}: {path}: rows at values that {source} has: {text}", JobWarning, stacklevel=2)
    return Measured(Path(path).name, kind, along, rows)


def _constants(dataset: xr.Dataset) -> dict[str, Quantity]:
    """Return by name what a study, or a run, holds at one value."""
    told: dict[str, Any] = {}
    units: dict[str, str] = {}
    if job := job_held(dataset):
        told |= {**job.parameters, **json.loads(dataset.attrs.get("point", "{}"))}
        units |= {key: parameter.unit for key, parameter in job.schema.parameters.items()}
    for name in ALONG:  # courses of a run
        if name in dataset and dataset[name].dims == ("time",):
            units[name] = si_unit(dataset[name].attrs)
            told.setdefault(name, float(dataset[name].values[-1]))
    found = {key: (told[key], unit) for key, unit in units.items() if isinstance(told.get(key), (int, float))}
    return found | {
        name: (value, si_unit(dataset[name].attrs)) for name, value in fixed_values(dataset).items()
    }


def fixed_values(dataset: xr.Dataset) -> dict[str, float]:
    """Return the numbers at which axes of results are fixed [SI]."""
    scalars = {str(name): values for name, values in dataset.coords.items() if not values.ndim}
    return {name: float(values) for name, values in scalars.items() if values.dtype.kind in "iuf"}


def _declaration(path: Path, axes: dict[str, str], constants: dict[str, str]) -> tuple[str, str, FromFile]:
    """Return kind and axis of a measured file by the words in it, and the columns that it may have.

    `axes` and `constants` are SI units by name.
    """
    text = content_of(path, MOST_BYTES, f"{_PLACE}: {path}", "a CSV file", ".csv").replace(b"\0", b"")
    lines = [line for line in text.decode("latin-1").splitlines() if not line.lstrip().startswith("#")]
    cells = [re.split(r"[\[(]", cell)[0].strip(' "') for cell in re.split(r"[,;\t\n]", "\n".join(lines))]
    words = list(dict.fromkeys(re.sub(r"[\s_]+", "_", cell.casefold()) for cell in cells))
    units = axes | constants
    names = sorted(units, key=lambda name: (name not in axes, name not in ALONG))
    heads = {
        head: (kind, name)
        for kind, ends in ((WINDOW, ("{}_from", "{}_to")), (ONSET, ("onset_{}",)))
        for name in names
        for head in (end.format(name) for end in ends)
    }
    known = [heads[word] for word in words if word in heads]
    known += [(PEAK, name) for name in names if {name, FREQUENCY} <= {*words}]
    if not known:
        name = (*names, "load")[0]
        expected = f"columns {name}_from and {name}_to, or onset_{name}, or {name} and {FREQUENCY}"
        near = (did_you_mean(word, [head for head in heads if heads[head][1] in axes]) for word in words)
        found = few_of(list(map(show, words)), _MOST_NAMED) + next(filter(None, near), "")
        raise mismatch(f"{_PLACE}: {path}", expected, found)
    kind, along = known[0]
    unit, swept = (units[along],), [f"measured_{along}_from", f"measured_{along}_to"]
    required, optional = {
        WINDOW: ((f"{along}_from", f"{along}_to"), [*swept, *_BAND, "amplitude"]),
        ONSET: ((f"onset_{along}",), [*swept, "direction"]),
        PEAK: ((along, FREQUENCY), ["amplitude"]),
    }[kind]
    of_units = {"amplitude": ("m",), "direction": ("",)} | dict.fromkeys((*_BAND, FREQUENCY), ("Hz",))
    columns = {name: of_units.get(name, unit) for name in (*required, *optional)}
    meant = {nearest(word, constants) for word in words}
    columns |= {name: (units[name],) for name in names if name != along and (name in axes or name in meant)}
    return kind, along, FromFile(columns, required, (), partial(_checked, along))


def _checked(along: str, columns: Mapping[str, Column]) -> dict[str, Any]:
    """Return the columns of a measured file; RowError or ValueError for what has no meaning."""
    values = {name: np.array(column.values) for name, column in columns.items()}
    faults: list[tuple[tuple[str, ...], str, NDArray[np.bool_]]]
    faults = [((name,), f"{name} > 0", values[name] <= 0.0) for name in _POSITIVE if name in values]
    if "direction" in values:
        is_none = np.abs(values["direction"]) != 1.0
        faults.append((("direction",), "direction 1 (rising) or -1 (falling)", is_none))
    for name in (along, f"measured_{along}", FREQUENCY):
        pair = f"{name}_from", f"{name}_to"
        if len(there := [one for one in pair if one in values]) == 1:
            raise ValueError(f"expected columns {' and '.join(pair)}, found {there[0]} alone")
        if there:
            faults.append((pair, f"{pair[0]} of at most {pair[1]}", values[pair[0]] > values[pair[1]]))
    for names, expected, wrong in faults:
        if wrong.any():
            k = int(np.argmax(wrong))
            raise RowError(k, expected, " and ".join(f"{values[name][k]:g}" for name in names))
    return dict(columns)


def _row(
    told: dict[str, float], kind: str, along: str, sides: dict[str, Side], constants: dict[str, Quantity]
) -> Row | None:
    """Return a row at its place in a study; None where it has none."""
    first = {WINDOW: f"{along}_from", ONSET: f"onset_{along}", PEAK: along}[kind]
    span = told[first], told.get(f"{along}_to", told[first])
    swept = told.get(f"measured_{along}_from", -math.inf), told.get(f"measured_{along}_to", math.inf)
    reach = (span, swept) if math.isfinite(swept[0]) else (span,)
    if along in sides and all(sides[along].span(*one) is None for one in reach):
        return None
    points = {name: told[name] for name in sides if name in told and name != along}
    if kind != WINDOW and along in sides:
        points[along] = span[0]
    at: dict[str, float] = {}
    for name, value in points.items():
        if (cell := sides[name].cell(value)) is None:
            return None
        at[name] = float(sides[name].values[cell])
    for name in (name for name in constants if name in told and name != along):
        if not math.isclose(told[name], constants[name][0], rel_tol=ALIKE):
            return None
    frequencies = [told[name] for name in (*_BAND, FREQUENCY) if name in told]
    return Row(
        at,
        span,
        at.pop(along, math.nan),
        (frequencies[0], frequencies[-1]) if frequencies else None,
        told.get("amplitude", math.nan),
        swept,
        told.get("direction", 1.0) > 0.0,
    )
