"""Measurements of a test rig, placed among the cells of a study or on the course of a run, and drawn there.

A measured file is a CSV file as `read_csv` takes it, of one of three kinds, told by its columns:

    window    AXIS_from, AXIS_to; optional frequency_from, frequency_to, amplitude: noise between two values
              of an axis such as load, silence elsewhere in the measured range; a row of one value twice
              states silence alone
    onset     onset_AXIS; optional direction (1: AXIS rises, as without this column; -1: it falls): where
              noise sets in
    peak      AXIS, frequency; optional amplitude: a line of a measured spectrum
    peak      AXIS, frequency, level: a spectrum at each value of the axis, of which the lines that stand out
              by _PROMINENCE and are within _LEVEL_RANGE of the file's highest level are read as peaks

Windows and onsets may have a measured range, measured_AXIS_from and measured_AXIS_to, and AXIS_deviation, the
standard deviation of their places. Further columns have the name of an axis or a parameter, and say at which
value of it a row was measured.
"""

import json
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis.classes import ALONG
from cvt_hpc.analysis.figures import Handle, coordinate_unit, legend_below, outlined
from cvt_hpc.analysis.held_job import job_held
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.errors import JobWarning, did_you_mean, few_of, mismatch, nearest, show
from cvt_hpc.job import Job
from cvt_hpc.job.csv_files import content_of, read_csv
from cvt_hpc.job.values import shown, si_unit
from cvt_hpc.parameters import Column, FromFile, RowError
from cvt_hpc.variables import shortened

WINDOW, ONSET, PEAK = "window", "onset", "peak"
FREQUENCY, LEVEL, AMPLITUDE = "frequency", "level", "amplitude"
_BAND, _SWEPT = ("frequency_from", "frequency_to"), ("measured_{}_from", "measured_{}_to")
# By kind the columns that it needs, and those that it may have; {} stands for the axis
_KINDS = {
    WINDOW: (("{}_from", "{}_to"), (*_SWEPT, *_BAND, AMPLITUDE, "{}_deviation")),
    ONSET: (("onset_{}",), (*_SWEPT, "direction", "{}_deviation")),
    PEAK: (("{}", FREQUENCY), (AMPLITUDE, LEVEL)),
}
# else the axis' own
_UNITS = dict.fromkeys((*_BAND, FREQUENCY), "Hz") | {AMPLITUDE: "m", "direction": "", LEVEL: "dB"}
# Assumptions: what is taken for a line of a spectrum
_PROMINENCE = 6.0  # [dB] of a peak, above the valleys beside it
_LEVEL_RANGE = 20.0  # [dB] below the highest level of the file
_LEAST_FREQUENCIES = 8  # of a spectrum
ALIKE = 0.01  # of a parameter that does not vary: so far the measured value may be off
_PLACE = "measured file"
_MOST_NAMED = 8
_MOST_BYTES = 2**22  # of a table of onsets, windows or peaks, or of spectra
_LEAST = 1e-300  # stands for zero on a logarithmic side

INK = "#0033dd"  # of nothing that is computed; in grey, dark within a white outline
_DASHES, _DOTS = (0, (6, 1.5, 1.5, 1.5)), (0, (1, 1.5))
LONGEST_NAME = 60  # letters of the file's name in a title
LEGEND = 0.4  # [inch]: height of a legend of its own
_ABOVE = {"zorder": 2.6, "path_effects": outlined(4.2)}
_LOOK: dict[str, Any] = {"color": INK, "lw": 2.0, "ms": 7.0}
_MARKS = {"x": {True: ">", False: "<"}, "y": {True: "^", False: "v"}}  # of an onset, as the axis goes

Array = NDArray[np.float64]
File = str | Path | None  # with measured values, if there is one
Span = tuple[float, float]
Constants = dict[str, tuple[float, str]]  # by key a value [SI] and its unit
Fault = tuple[Sequence[str], str, NDArray[np.bool_]]  # columns, what is expected of rows, which ones differ


class Side(NamedTuple):
    """A side of a panel, on which values have their places."""

    name: str  # the axis or quantity along it
    edges: Array  # (cell + 1,) borders of its cells, or its ends, in the units that are drawn
    factor: float = 1.0  # from SI to these
    values: Array = np.empty(0)  # (cell,) of the cells [SI], if it has any
    sign: float = 0.0  # of values of a logarithmic side, 0 of a linear one

    def place(self, value: float) -> float:
        """Return the place of a value [SI]."""
        place = self.factor * value
        return self.sign * math.log10(max(self.sign * place, _LEAST)) if self.sign else place

    def span(self, low: float, high: float) -> Array | None:
        """Return the places of two values [SI], within the ends; None where both lie beyond one end."""
        places, ends = np.array([self.place(low), self.place(high)]), self.edges[[0, -1]]
        return np.clip(places, *ends) if places[1] >= ends[0] and places[0] <= ends[1] else None

    def cell(self, value: float) -> int | None:
        """Return the cell in which a value [SI] lies, None where there is none."""
        place = self.place(value)
        inside = (self.edges[:-1] <= place) & (place <= self.edges[1:]) & np.isfinite(self.values)
        return int(np.argmax(inside)) if inside.any() else None


class Row(NamedTuple):
    """A row of a measured file, in SI units.

    The span is between which values of the axis `along` noise was measured: the same twice of onset and peak,
    nan where the row states silence alone.
    """

    at: dict[str, float]  # by axis of the study the value of the cell in which the measured one lies
    span: Span
    cell: float  # value of the cell of an onset or a peak; nan of a window, or of a run
    frequency: Span | None  # None where it was not measured
    amplitude: float  # nan likewise
    swept: Span  # the measured range, infinite where it is not stated
    rising: bool  # whether the axis rose as noise set in
    deviation: float  # standard, of the ends of the span

    def covers(self, values: Array) -> NDArray[np.bool_]:
        """Whether the row tells of noise at values of its axis [SI], of the shape of these."""
        if self.span[0] < self.span[1]:
            return within(values, self.span)
        is_run = math.isnan(self.cell)
        return np.isclose(values, self.span[0], ALIKE, 0.0) if is_run else values == self.cell


class Measured(NamedTuple):
    """A measured file: its name, its kind, the axis of its windows, onsets or peaks, and its rows."""

    name: str
    kind: str
    along: str
    rows: tuple[Row, ...]


def within(values: Array, span: Span) -> NDArray[np.bool_]:
    """Whether values lie between two others, or on them within rounding."""
    on_ends = np.isclose(np.asarray(values)[..., None], span, 1e-9, 0.0).any(axis=-1)
    return ((span[0] <= values) & (values <= span[1])) | on_ends


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


def read_columns(
    path: str | Path,
    place: str,
    columns: Mapping[str, tuple[str, ...]],
    required: tuple[str, ...],
    faults: Callable[[dict[str, Array]], Iterable[Fault]],
    other_names: Mapping[str, str] | None = None,
) -> dict[str, Array]:
    """Read the columns (row,) of a CSV file of measurements, in SI units.

    `columns`, `required` and `other_names` are as of `FromFile`. InputError, as of `read_csv`, names `place`
    and path, and the line of the first of the `faults`, of which a ValueError stands for the whole file.
    """

    def arrange(found: Mapping[str, Column]) -> dict[str, Array]:
        values = {name: np.array(column.values) for name, column in found.items()}
        for names, expected, wrong in faults(values):
            if wrong.any():
                k = int(np.argmax(wrong))
                raise RowError(k, expected, " and ".join(f"{values[name][k]:g}" for name in names))
        return values

    return read_csv(FromFile(columns, required, (), arrange, other_names or {}), str(path), "", place).values


def read_measured(
    path: str | Path, dataset: xr.Dataset, source: str = "results", job: Job | None = None
) -> Measured:
    """Read a measured file beside the results of a study over a grid, or beside the history of a run.

    The job is that in the attributes of the dataset, unless it is at hand. Rows at values that these do not
    have are left out. Of this, and of a window that holds no value of its axis that was run, a warning tells.
    InputError as of `read_csv`; if the columns are those of no kind; all rows are left out; or results are
    samples.
    """
    if is_sampled(dataset):
        raise mismatch(source, "results over a grid, beside which measurements are drawn", "samples")
    dims = map(str, dataset["status"].dims if "status" in dataset else ())
    axes = [name for name in dims if name in dataset.coords and dataset[name].dtype.kind in "iuf"]
    constants = _constants(dataset, job or job_held(dataset))
    constants = {key: value for key, value in constants.items() if key not in axes}
    units = {name: si_unit(dataset[name].attrs) for name in axes}
    units |= {key: unit for key, (_, unit) in constants.items()}
    kind, along, columns = _declaration(Path(path), units, axes)
    required = tuple(name.format(along) for name in _KINDS[kind][0])
    legal = {name: (unit,) for name, unit in columns.items()}
    table = read_columns(path, _PLACE, legal, required, partial(_faults, along))
    if LEVEL in table:
        table = _peaks(table, f"{_PLACE}: {path}")
    sides = {name: side_of(dataset.coords.to_dataset().sortby(name), name) for name in axes}
    told = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
    placed = [_row(one, kind, along, sides, constants) for one in told]
    rows = tuple(row for row in placed if row is not None)
    if len(rows) < len(told):
        first = told[placed.index(None)]
        at = ", ".join(f"{name} {value:g} {columns[name]}".rstrip() for name, value in first.items())
        text = f"{len(rows)} of {len(told)}; the first that it has not: {at}"
        if axes and not rows:
            raise mismatch(f"{_PLACE}: {path}", f"rows at values that {source} has", text)
        warnings.warn(f"{_PLACE}: {path}: rows at values that {source} has: {text}", JobWarning, stacklevel=2)
    if kind == WINDOW and (side := sides.get(along)):
        for number, row in enumerate(placed, 1):
            if row and side.span(*row.span) is not None and not row.covers(side.values).any():
                low, high = (shown(one, dataset[along].attrs) for one in row.span)
                text = f"row {number}: no {along} from {low} to {high} was run in {source}, but"
                text = f"{_PLACE}: {path}: {text} {layout.known_values(dataset[along])}"
                warnings.warn(text, JobWarning, stacklevel=2)
    return Measured(Path(path).name, kind, along, rows)


def _peaks(table: dict[str, Array], place: str) -> dict[str, Array]:
    """Return the rows at the peaks of spectra [dB], and tell how many these are."""
    from scipy.signal import find_peaks  # scipy.signal takes long to load

    of_line = (FREQUENCY, LEVEL, AMPLITUDE)
    where = np.column_stack([values for name, values in table.items() if name not in of_line])
    of_spectrum = np.unique(where, axis=0, return_inverse=True)[1].ravel()
    order = np.lexsort((table[FREQUENCY], of_spectrum))
    spectra = np.split(order, np.flatnonzero(np.diff(of_spectrum[order])) + 1)
    if (fewest := min(map(len, spectra))) < _LEAST_FREQUENCIES:
        raise mismatch(place, f"{_LEAST_FREQUENCIES} frequencies or more in each spectrum", str(fewest))
    if any((np.diff(table[FREQUENCY][rows]) == 0.0).any() for rows in spectra):  # no spectrum, but several
        then = "average spectra of one place, or name in a column what tells them apart"
        raise mismatch(place, "each frequency once in a spectrum", "some twice", then)
    least = table[LEVEL].max() - _LEVEL_RANGE
    levels = (table[LEVEL][rows] for rows in spectra)
    at = [find_peaks(own, height=least, prominence=_PROMINENCE)[0] for own in levels]
    found = np.concatenate([rows[peaks] for rows, peaks in zip(spectra, at, strict=True)])
    rule = f"maxima that stand out by {_PROMINENCE:g} dB, at most {_LEVEL_RANGE:g} dB below the highest level"
    if not found.size:
        raise mismatch(place, rule, f"none in {len(spectra)} spectra")
    text = f"{found.size} peaks of {len(spectra)} spectra are read: {rule}"
    warnings.warn(f"{place}: {text}", JobWarning, stacklevel=3)
    return {name: values[found] for name, values in table.items() if name != LEVEL}


def _constants(dataset: xr.Dataset, job: Job | None) -> Constants:
    """Return by name what a study, or a run, holds at one value [SI], and its unit."""
    told: dict[str, Any] = {}
    units: dict[str, str] = {}
    if job:
        told |= {**job.parameters, **json.loads(dataset.attrs.get("point", "{}"))}
        units |= {key: parameter.unit for key, parameter in job.schema.parameters.items()}
    if "time" in dataset.coords:  # of a run, over which its course goes
        told["time"], units["time"] = float(dataset["time"].values[-1]), "s"
    for name in ALONG:  # courses of a run
        if name in dataset and dataset[name].dims == ("time",):
            units[name] = si_unit(dataset[name].attrs)
            told.setdefault(name, float(dataset[name].values[-1]))
    fixed = _fixed(dataset)
    told, units = told | fixed, units | {name: si_unit(dataset[name].attrs) for name in fixed}
    return {key: (told[key], unit) for key, unit in units.items() if isinstance(told.get(key), (int, float))}


def _fixed(dataset: xr.Dataset) -> dict[str, float]:
    """Return the numbers at which axes of results are fixed [SI]."""
    scalars = {str(name): values for name, values in dataset.coords.items() if not values.ndim}
    return {name: float(values) for name, values in scalars.items() if values.dtype.kind in "iuf"}


def _declaration(path: Path, units: dict[str, str], axes: list[str]) -> tuple[str, str, dict[str, str]]:
    """Return kind and axis of a measured file by the words in it, and units of columns that it may have.

    `units` are those of axes and constants [SI].
    """
    text = content_of(path, _MOST_BYTES, f"{_PLACE}: {path}", "a CSV file", ".csv").replace(b"\0", b"")
    lines = [line for line in text.decode("latin-1").splitlines() if not line.lstrip().startswith("#")]
    cells = [re.split(r"[\[(]", cell)[0].strip(' "') for cell in re.split(r"[,;\t\n]", "\n".join(lines))]
    words = list(dict.fromkeys(re.sub(r"[\s_]+", "_", cell.casefold()) for cell in cells))
    names = sorted(units, key=lambda name: (name not in axes, name not in ALONG))
    kinds = (WINDOW, ONSET)
    heads = {head.format(name): (kind, name) for kind in kinds for name in names for head in _KINDS[kind][0]}
    known = [heads[word] for word in words if word in heads]
    known += [(PEAK, name) for name in names if {name, FREQUENCY} <= {*words}]
    if not known:
        name = (*names, "load")[0]
        expected = f"columns {name}_from and {name}_to, or onset_{name}, or {name} and {FREQUENCY}"
        near = (did_you_mean(word, [head for head in heads if heads[head][1] in axes]) for word in words)
        found = few_of(list(map(show, words)), _MOST_NAMED) + next(filter(None, near), "")
        raise mismatch(f"{_PLACE}: {path}", expected, found)
    kind, along = known[0]
    columns = [name.format(along) for part in _KINDS[kind] for name in part]
    meant = {nearest(word, units) for word in words}
    columns += [name for name in names if name != along and (name in axes or name in meant)]
    return kind, along, {name: _UNITS.get(name, units.get(name, units[along])) for name in columns}


def _faults(along: str, values: dict[str, Array]) -> Iterator[Fault]:
    """Yield what has no meaning in a measured file; ValueError of a column without its partner."""
    for name in (*_BAND, FREQUENCY, AMPLITUDE, f"{along}_deviation"):
        if name in values:
            yield (name,), f"{name} > 0", values[name] <= 0.0
    if "direction" in values:
        yield ("direction",), "direction 1 (rising) or -1 (falling)", np.abs(values["direction"]) != 1.0
    for name in (along, f"measured_{along}", FREQUENCY):
        pair = f"{name}_from", f"{name}_to"
        if len(there := [one for one in pair if one in values]) == 1:
            raise ValueError(f"expected columns {' and '.join(pair)}, found {there[0]} alone")
        if there:
            yield pair, f"{pair[0]} of at most {pair[1]}", values[pair[0]] > values[pair[1]]


def _row(
    told: dict[str, float], kind: str, along: str, sides: dict[str, Side], constants: Constants
) -> Row | None:
    """Return a row at its place in a study; None where it has none."""
    ends = [told[name.format(along)] for name in _KINDS[kind][0] if name != FREQUENCY]
    span = ends[0], ends[-1]
    swept = told.get(_SWEPT[0].format(along), -math.inf), told.get(_SWEPT[1].format(along), math.inf)
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
        span if kind != WINDOW or span[0] < span[1] else (math.nan, math.nan),
        at.pop(along, math.nan),
        (frequencies[0], frequencies[-1]) if frequencies else None,
        told.get(AMPLITUDE, math.nan),
        swept,
        told.get("direction", 1.0) > 0.0,
        told.get(f"{along}_deviation", 0.0),
    )


class Overlay:
    """Measured noise, drawn over panels one by one: a file, or what `read_measured` has read; or nothing.

    Attributes
    ----------
    entries : dict
        Handles of what was drawn, by their labels in a legend.
    height, note : float, str
        Height that a legend of its own takes [inch]; line of the title, which names the file.
    """

    def __init__(
        self, path: str | Path | Measured | None, dataset: xr.Dataset, source: str = "results"
    ) -> None:
        if path is None or isinstance(path, Measured):
            self._measured = path or Measured("", "", "", ())
        else:
            self._measured = read_measured(path, dataset, source)
        self.entries: dict[str, Handle] = {}
        self.height = 0.0 if path is None else LEGEND
        self.note = "" if path is None else f"measured: {shortened(self._measured.name, LONGEST_NAME)}"

    @property
    def handles(self) -> list[Handle]:
        """Handles of the entries."""
        return list(self.entries.values())

    def draw(self, axes: Axes, x: Side, y: Side, shown: xr.Dataset) -> None:
        """Draw what was measured over a panel whose limits are set.

        `x` and `y` are its sides; coordinates of `shown` without a dimension say at which values.
        """
        along, fixed = self._measured.along, _fixed(shown)
        at = fixed.pop(along, None)
        for row in self._measured.rows:
            if all(row.at.get(name, value) == value for name, value in fixed.items()):
                if at is None or row.covers(np.array(at)):
                    self._draw_row(axes, row, (x, y))

    def _box(self, row: Row, sides: tuple[Side, Side]) -> list[Array]:
        """Places of the ends of a row on both sides; empty where it lies beyond an end."""
        box: list[Array | None] = []
        for side in sides:
            if side.name == self._measured.along:
                box.append(side.span(*row.span))
            elif side.name == FREQUENCY and row.frequency:
                box.append(side.span(*row.frequency))
            elif side.name in row.at:
                cell = int(np.argmax(side.values == row.at[side.name]))
                box.append(side.edges[cell : cell + 2])
            else:
                box.append(side.edges[[0, -1]])
        found = [one for one in box if one is not None]
        return found if len(found) == len(box) else []

    def _draw_row(self, axes: Axes, row: Row, sides: tuple[Side, Side]) -> None:
        _, kind, along, _ = self._measured
        on = next((which for which, side in zip("xy", sides, strict=True) if side.name == along), "")
        if kind == WINDOW and on and np.isfinite(row.swept).all():
            swept = row._replace(span=row.swept, frequency=None)
            self._outline(axes, self._box(swept, sides), "measured range", _DOTS)
        box = self._box(row, sides)
        if kind == WINDOW:
            self._outline(axes, box, "measured noise", _DASHES)
        elif kind == PEAK and box:  # at the lower end of a side that tells nothing of it
            whole = [np.array_equal(one, side.edges[[0, -1]]) for one, side in zip(box, sides, strict=True)]
            pairs = zip(box, whole, strict=True)
            x, y = (one[:1] if rest else one.mean(keepdims=True) for one, rest in pairs)
            self._line(axes, x, y, "measured peak", marker="P", ls="")
        elif kind == ONSET and on and box:
            x, y = (np.array([low, 0.5 * (low + high), high]) for low, high in box)
            label = f"measured onset, {'rising' if row.rising else 'falling'}"
            self._line(axes, x, y, label, marker=_MARKS[on][row.rising], ls=_DASHES)

    def _line(self, axes: Axes, x: Array, y: Array, label: str, **look: Any) -> None:
        """Draw a line with a mark in its middle, or the mark alone, without a change of the limits."""
        how = {"markevery": [x.size // 2], "clip_on": x.size > 1, **_ABOVE}
        axes.add_artist(Line2D(x, y, **_LOOK, **look, **how))
        self.entries.setdefault(label, Line2D([], [], **_LOOK, **look, label=label))

    def _outline(self, axes: Axes, box: list[Array], label: str, style: Any) -> None:
        if box:
            (left, right), (low, high) = box
            look = {"fill": False, "ec": INK, "lw": 2.0, "ls": style}
            axes.add_artist(Rectangle((left, low), right - left, high - low, **look, **_ABOVE))
            self.entries.setdefault(label, Rectangle((0.0, 0.0), 1.0, 1.0, **look, label=label))


def put_legend(figure: Figure, *overlays: Overlay) -> None:
    """Put a legend of what was measured below a picture that has none of its own."""
    legend_below(figure, {label: handle for over in overlays for label, handle in over.entries.items()})
