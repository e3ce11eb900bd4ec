"""Layout of a study's axes as a map: along x, along y, over panels, or fixed.

A `Ruler` spreads the values of an axis, evenly or by their logarithms, and has the borders between them.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axis import Axis
from numpy.typing import NDArray

from cvt_hpc.analysis.figures import axis_label, coordinate_unit, in_words, number, put_ticks, short_numbers
from cvt_hpc.errors import few_of, mismatch, show, unknown
from cvt_hpc.job.values import shown_as_read, shown_number, shown_unit

EVEN, EQUAL = 1.5, 1.01  # of steps: largest over smallest, below which they are taken for even
_LEAST_SPAN = 4.0  # last over first value of a logarithmic axis

Fixed = Mapping[str, float | str]  # axes to fix: value by name, a number [SI] or a text
At = Fixed | None
_MOST_VALUES_NAMED = 12
FEW, _FEW_ON_DECADES = 12, 6  # values of an axis that have ticks of their own
_FEW_DECADES = 2.5  # on which 1, 2 and 5 have labels, not powers of ten alone


@dataclass(frozen=True)
class Arrangement:
    """A study's dataset, reduced to what one picture shows."""

    dataset: xr.Dataset  # sorted along x, y and panels; the dimensions of `status` are among these
    x: str  # dimension along x
    y: str | None  # along y, if the study has that many
    panel: str | None  # over the panels, likewise
    notes: tuple[str, ...]  # what is fixed, in words


class Sides(NamedTuple):
    """Axes of a study that are to run along x, along y and over the panels; None: the program chooses."""

    x: str | None = None
    y: str | None = None
    panel: str | None = None


CHOSEN = Sides()


def arrange(dataset: xr.Dataset, at: Fixed, source: str, sides: Sides = CHOSEN) -> Arrangement:
    """Choose what a map shows.

    Where `sides` leave it open `load` runs along x, or `load_share`, else the last numeric axis;
    `friction_gradient` along y, `sheave_stiffness` over the panels, else the first axes that are left.
    Further axes are fixed at their first value.

    Arguments as of all pictures of results (`figures.py`). InputError if `at` names no axis, or no value on
    it; `sides` name no axis, a fixed one, or one twice; or no axis is left to draw.
    """
    axes = list(map(str, dataset["status"].dims))
    check_sides(sides, axes, at, source)
    notes = []
    for name, value in at.items():
        if name not in axes:
            raise unknown(f"{source}: at {name}", "axis of the results", name, axes)
        index = index_of(dataset[name], value, f"{source}: at {name}")
        notes.append(place_text(dataset[name], index, " = "))
        dataset = dataset.isel({name: index})
    free = [name for name in axes if name not in at]
    if not free:
        then = "`cvt-hpc simulate` draws one"
        raise mismatch(source, "results over one axis or more to be drawn", "a single run", then)
    numeric = [name for name in free if dataset[name].dtype.kind in "iuf"]
    rest = [name for name in free if name not in sides]
    x = sides.x or _take_along_x(rest, numeric, source)
    # The panels' axis must not be taken for y where there is another one to take.
    y = sides.y or _take(rest, "friction_gradient", avoid="sheave_stiffness")
    panel = sides.panel or _take(rest, "sheave_stiffness")
    for name in rest:
        dataset = _at_first(dataset, name, notes)
    for name in filter(None, (x, y, panel)):
        if dataset[name].dtype.kind in "iuf" and not dataset[name].to_index().is_monotonic_increasing:
            dataset = dataset.sortby(name)  # which takes long
    return Arrangement(dataset, x, y, panel, tuple(notes))


def check_sides(sides: Sides, axes: list[str], at: Fixed, source: str) -> None:
    """Raise InputError where sides name no axis of the results, one that `at` fixes, or one twice."""
    for side, name in sides._asdict().items():
        if name is None:
            continue
        if name not in axes:
            raise unknown(f"{source}: {side} {name}", "axis of the results", name, axes)
        if name in at:
            raise mismatch(f"{source}: {side} {name}", "an axis that is not fixed", f"{name} fixed by at")
        if sides.count(name) > 1:
            raise mismatch(f"{source}: {side} {name}", "an axis on one side", f"{name} on several")


def _take_along_x(names: list[str], numeric: list[str], source: str) -> str:
    """Take the axis that runs along x off the list; InputError where the other sides have left none."""
    if not names:
        raise mismatch(f"{source}: x", "an axis that is left for it", "all of them fixed or on other sides")
    free = [name for name in names if name in numeric] or names
    chosen = next((name for name in ("load", "load_share") if name in free), free[-1])
    names.remove(chosen)
    return chosen


def along_x(arrangement: Arrangement) -> tuple[xr.Dataset, list[str]]:
    """The first row of the first panel of an arrangement, and what is fixed, in words."""
    dataset, notes = arrangement.dataset, list(arrangement.notes)
    for name in filter(None, (arrangement.y, arrangement.panel)):
        dataset = _at_first(dataset, name, notes)
    return dataset, notes


def first_panel(arrangement: Arrangement) -> Arrangement:
    """The arrangement with the axis of its panels, if it has one, fixed at its first value."""
    if not arrangement.panel:
        return arrangement
    notes = list(arrangement.notes)
    fixed = _at_first(arrangement.dataset, arrangement.panel, notes)
    return replace(arrangement, dataset=fixed, panel=None, notes=tuple(notes))


def _at_first(dataset: xr.Dataset, name: str, notes: list[str]) -> xr.Dataset:
    """Results at the first value of an axis, which is added to the notes."""
    axis = dataset[name]
    notes.append(f"{place_text(axis, 0, ' = ')} (first of {axis.size})")
    return dataset.isel({name: 0})


def places(array: xr.DataArray | xr.Dataset, dims: Sequence[str]) -> list[dict[str, int]]:
    """Indices along dimensions, of all their combinations."""
    sizes = (range(array.sizes[dim]) for dim in dims)
    return [dict(zip(dims, place, strict=True)) for place in product(*sizes)]


def labelled(array: xr.DataArray, dims: Sequence[Hashable]) -> Iterator[tuple[list[str], xr.DataArray]]:
    """Yield the parts of a variable at all places along its dimensions beyond `dims`, with their labels."""
    for at in places(array, [str(dim) for dim in array.dims if dim not in dims]):
        yield [str(array[dim].values[k]) for dim, k in at.items()], array.isel(at)


def with_spacings(dataset: xr.Dataset, spacings: Mapping[str, str], source: str) -> xr.Dataset:
    """Results over a grid whose axes are drawn logarithmic or linear as told, whatever their values.

    `spacings` are "log" or "linear" by axis. InputError, which names the source, if there is no such axis or
    spacing, or an axis cannot be logarithmic.
    """
    axes = list(map(str, dataset["status"].dims))
    for name, spacing in spacings.items():
        where = f"{source}: spacing of {name}"
        if name not in axes:
            raise unknown(where, "axis of the results", name, axes)
        if spacing not in ("log", "linear"):
            raise mismatch(where, "log or linear", show(spacing))
        values = dataset[name].values
        if spacing == "log" and (values.dtype.kind not in "iuf" or values.min() * values.max() <= 0.0):
            raise mismatch(where, "numbers of one sign on a logarithmic axis", known_values(dataset[name]))
        dataset = dataset.assign_coords({name: dataset[name].assign_attrs(spacing=spacing)})
    return dataset


def _take(names: list[str], preferred: str, avoid: str = "") -> str | None:
    """Take the preferred name off the list, else the first, one to avoid last."""
    if not names:
        return None
    others = [name for name in names if name != avoid]
    name = preferred if preferred in names else (others or names)[0]
    names.remove(name)
    return name


def index_of(coordinate: xr.DataArray, value: float | str, where: str) -> int:
    """Index of a value on an axis."""
    values, wanted = coordinate.values, np.nan
    if values.dtype.kind in "iuf":
        with suppress(TypeError, ValueError):
            wanted = float(value)
        hits = np.flatnonzero((values == wanted) | np.isclose(values, wanted, rtol=1e-9, atol=0))
    else:
        hits = np.flatnonzero(values.astype(str) == str(value))
    if hits.size == 0:
        found = show(value) if np.isnan(wanted) else shown_as_read(wanted, coordinate.attrs)
        raise mismatch(where, f"a value of that axis: {known_values(coordinate)}", found)
    return int(hits[0])


def known_values(coordinate: xr.DataArray) -> str:
    """The values of an axis in words, a few of them if there are many."""
    numbers = (shown_number(value, coordinate.attrs) for value in coordinate.values.tolist())
    unit = shown_unit(coordinate.attrs)
    texts = [f"{value:g}" if isinstance(value, float) else str(value) for value in numbers]
    return few_of(texts, _MOST_VALUES_NAMED) + (f" [{unit}]" if unit else "")


def value_text(coordinate: xr.DataArray, index: int) -> str:
    """A value of an axis for people, in its display unit; infinite stiffness is "rigid"."""
    value = coordinate.values[index]
    if coordinate.dtype.kind not in "iuf":
        return str(value)
    if np.isinf(value):
        return infinity_in_words(str(coordinate.name))
    factor, unit = coordinate_unit(coordinate.attrs)
    return f"{number(value * factor)} {unit}".strip()


def place_text(coordinate: xr.DataArray, index: int, between: str = " ") -> str:
    """A place on an axis for people: its name and the value there, such as "load 120 N m"."""
    return f"{in_words(coordinate)}{between}{value_text(coordinate, index)}"


def infinity_in_words(name: str) -> str:
    """An infinite value on the axis of that name."""
    return "rigid" if name.endswith("stiffness") else "∞"


class Ruler(NamedTuple):
    """Positions of an axis's values along a side of the map, in display units.

    On a logarithmic axis they are logarithms to base 10, of negative values with the sign turned.
    """

    centres: NDArray[np.float64]  # (value,) of the grid points
    edges: NDArray[np.float64]  # (value + 1,) of the borders of their cells, halfway between
    ticks: NDArray[np.float64] | None  # where these have to be; None leaves it to the plotting library
    tick_labels: tuple[str, ...]  # their texts
    label: str  # name and unit
    minor: NDArray[np.float64] = np.empty(0)  # where short ticks without labels are, on a logarithmic axis

    def lay_out(self, axis: Axis) -> None:
        """Put the ticks on a side of a panel."""
        if self.ticks is not None:
            put_ticks(axis, self.ticks, self.tick_labels)
        if self.minor.size:
            axis.set_ticks(self.minor, minor=True)


ONE_ROW = Ruler(np.zeros(1), np.array([-0.5, 0.5]), np.empty(0), (), "")


def ruler(coordinate: xr.DataArray) -> Ruler:
    """Lay out an axis: numbers at their true place, an infinite one behind them, texts side by side.

    The axis (value,), sorted if numeric, is logarithmic where its finite values are spread so, or where its
    `spacing`, "log" or "linear", says so; negative ones are mirrored.
    """
    name = str(coordinate.name)
    factor, unit = coordinate_unit(coordinate.attrs)
    values = coordinate.values
    if values.dtype.kind not in "iuf":
        centres = np.arange(float(values.size))
        return Ruler(
            centres, _edges_of(centres), centres, tuple(map(str, values)), axis_label(coordinate, "")
        )
    centres = values * factor
    finite = np.isfinite(centres)
    told = coordinate.attrs.get("spacing")
    is_log = _is_logarithmic(centres[finite]) if told is None else told == "log"
    if np.all(finite):
        if is_log:
            return _logarithmic_ruler(centres, axis_label(coordinate, unit))
        ticks, exact = (centres, short_numbers(centres)) if _are_few(centres, FEW) else (None, ())
        return Ruler(centres, _edges_of(centres), ticks, exact, axis_label(coordinate, unit))
    known = centres[finite]
    texts = iter(short_numbers(known, is_log=is_log))
    labels = tuple(next(texts) if is_known else infinity_in_words(name) for is_known in finite)
    known = _on_decades(known) if is_log else known
    gap = np.diff(known).mean() if known.size > 1 else 1.0
    centres[finite], centres[~finite] = known, (known[-1] if known.size else 0.0) + gap
    return Ruler(centres, _edges_of(centres), centres, labels, axis_label(coordinate, unit))


def _logarithmic_ruler(values: NDArray[np.float64], label: str) -> Ruler:
    """A logarithmic axis: ticks at its values where they are few, else at 1, 2 and 5 or at powers of ten."""
    centres, sign = _on_decades(values), np.sign(values[0])
    edges = _edges_of(centres)
    low, high = np.sort(sign * edges[[0, -1]])
    powers = 10.0 ** np.arange(np.floor(low), np.ceil(high) + 1)

    def inside(digits: NDArray[np.float64]) -> NDArray[np.float64]:
        at = np.outer(powers, digits).ravel()
        return np.sort(sign * at[(np.log10(at) >= low) & (np.log10(at) <= high)])

    digits = np.array([1.0, 2.0, 5.0] if high - low < _FEW_DECADES else [1.0])
    ticks = values if _are_few(centres, _FEW_ON_DECADES) else inside(digits)
    minor = _on_decades(inside(np.arange(1.0, 10.0)))
    return Ruler(centres, edges, _on_decades(ticks), short_numbers(ticks, is_log=True), label, minor)


def _is_logarithmic(values: NDArray[np.float64]) -> bool:
    """Whether sorted numbers are of one sign and evenly spread by their logarithms alone."""
    if values.size < 3 or values[0] * values[-1] <= 0.0:
        return False
    sizes = np.sort(np.abs(values))
    if sizes[-1] < _LEAST_SPAN * sizes[0]:
        return False
    steps, ratios = np.diff(sizes), np.diff(np.log(sizes))
    most = EVEN if values.size > 3 else EQUAL  # of three values a middle that is a little off says nothing
    return bool(ratios.max() < most * ratios.min() and steps.max() > EVEN * steps.min())


def _on_decades(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of numbers of one sign on a logarithmic axis; negative ones are mirrored."""
    return np.sign(values) * np.log10(np.abs(values))


def _are_few(centres: NDArray[np.float64], few: int) -> bool:
    """Whether grid points can have labelled ticks: few, and about evenly spread."""
    if centres.size < 2:
        return True
    return centres.size <= few and bool(np.diff(centres).min() > 0.5 * np.ptp(centres) / (centres.size - 1))


def _edges_of(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Borders of the cells around points, halfway between; the outer cells are symmetric."""
    if centres.size == 1:
        half = 0.05 * abs(centres[0]) or 0.5
        return np.array([centres[0] - half, centres[0] + half])
    middles = (centres[1:] + centres[:-1]) / 2
    return np.concatenate(([2 * centres[0] - middles[0]], middles, [2 * centres[-1] - middles[-1]]))
