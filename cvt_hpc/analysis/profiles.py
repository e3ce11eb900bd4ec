"""Quantities along the belt, as figs 20 to 23 of Bullinger et al. 2005 and 4.1 of Lebrecht et al. 2004.

`flanks_figure` draws left and right flank of one run, with the ends of the arcs enlarged. `wrap_figure` draws
forces between belt and pulleys over the wrap, as figs 9 and 10 of Cepon and Boltezar 2011.
"""

from collections.abc import Sequence
from itertools import cycle, pairwise
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.telling_apart import (
    check_holds,
    common_course,
    entitle_runs,
    named,
    on_axes,
    told_apart,
)
from cvt_hpc.errors import InputError, mismatch, unknown
from cvt_hpc.variator import PULLEYS

# Drawn where nothing else is asked for: of each group the first that all runs have.
DEFAULT = (("push_force", "tension"), ("friction_force", "tangential_friction"), ("ring_friction",))
LINES = ("-", "--", "-.", ":")
ARC = "#ececec"
MOST_COLUMNS = 3
LEAST, HEIGHT, FRAME = 1.0, 1.75, 1.2  # [inch]: a panel, and title, labels and legend
_UNITS = {"N m-1": (1e-3, "kN/m"), "m s-1": (1e3, "mm/s")}
_REFERENCES = {"sliding_angle": 90.0}  # [°]: where sliding turns from one hand to the other

SIDES = ("left", "right")
QUANTITIES = ("contact_force", "flank_slip", "radial_slip")
_LOOKS = {"left": {"color": "#0072b2", "ls": "-"}, "right": {"color": "#d55e00", "ls": "--"}}
AROUND = 0.02  # [m] of the path on both sides of an end
_TOUCHES = 0.05  # of the largest force: a flank that has less carries nothing

# rows: variable, label with unit, factor, and what stands beside it
ROWS = (
    ("normal_force", "normal [N/mm]", 1e-3, ""),
    ("friction_force", "friction [N/mm]", 1e-3, ""),
    ("tension", "tension [N]", 1.0, "sliding_tension"),
)
_RUN_LINES = ("-", "--", "-.")  # dotted is theory
_THEORY = "Euler and Eytelwein"
INK = "#333333"
MOST_PANELS = 3  # side by side; of more pulleys only those that carry torque have one
_LEAST_PULL = 0.05  # of the largest sum of friction forces, from which on a pulley carries torque
FEW = 10  # places on an arc, each of which has a mark


@figures.styled
def profile_figure(
    histories: Sequence[xr.Dataset],
    quantities: Sequence[str] = (),
    region: str | None = None,
    columns: str | None = None,
    sources: Sequence[str] = (),
) -> Figure:
    """Draw quantities along the belt of one or several runs, a panel for each, below each other.

    Parameters
    ----------
    histories, sources
        As of all pictures of runs (`figures.py`): quantities over `position`, with `region`.
    quantities : sequence of str
        Variables over `position`; none: push force or tension, and friction.
    region : str, optional
        "driving" or "driven": that arc alone, over the wrap angle; else the whole belt.
    columns : str, optional
        An axis of the runs' job that has a column of panels for each value, or a panel where there is one
        quantity; else all are drawn together.

    Raises
    ------
    InputError
        A history has no such quantity, no such region; or no axis, or too many values of it, for columns.
    """
    if not histories:
        raise InputError("profile: expected one history or more, found none")
    names = named(histories, sources)
    quantities = quantities or _usual(histories)
    _check(histories, names, quantities, region)
    _, labels = on_axes(histories, names)
    groups = _groups(labels, columns, MOST_COLUMNS * (2 if len(quantities) == 1 else 1))
    beside = min(len(groups), MOST_COLUMNS)
    rows = max(len(quantities), -(-len(groups) // beside))
    page = rows, (1,), (LEAST, HEIGHT), FRAME, names[0], "name fewer quantities by `--of`"
    width = figures.NARROW if beside > 1 else figures.WIDTH
    share = "all" if len(quantities) == 1 else "row"
    figure, panels, _ = figures.panels_on_a_page(*page, each=beside, width=width, sharex="col", sharey=share)
    # one quantity has its panels row by row
    stacks = panels.reshape(-1, 1) if len(quantities) == 1 else panels.T
    for unused in stacks[len(groups) :].flat:
        unused.set_visible(False)
    for column, (title, members) in zip(stacks, groups.items(), strict=False):
        for axes, name in zip(column, quantities, strict=True):
            factor, _ = shown_unit(histories[0][name])
            for run, colour, line in zip(members, cycle(figures.COLOURS), cycle(LINES), strict=False):
                told = ", ".join(text for key, text in labels[run].items() if key != columns)
                style = {"color": colour, "ls": line, "lw": 1.3, "label": told or None}
                _draw(axes, histories[run], name, factor, region, **style)
            _finish(axes, histories[members[0]], name, region)
        if region is None:
            _name_regions(column[0], histories[members[0]])
        column[0].set_title(title, loc="left", pad=16 if region is None else 4)
    lowest = stacks[: len(groups), -1][np.newaxis, -beside:]
    figures.label_x(lowest, beside, "wrap angle [°]" if region else "position along the path [mm]")
    for row, name in zip(panels, np.resize(quantities, rows), strict=True):
        _, unit = shown_unit(histories[0][name])
        row[0].set_ylabel(f"{figures.in_words(histories[0][name])}\n[{unit}]")
    legends = (figures.entries_of([axes]) for axes in stacks[: len(groups), 0])
    figures.legend_below(figure, max(legends, key=len))
    where = f" of the {region} pulley" if region else ""
    entitle_runs(figure, histories, f"Along the belt{where}")
    return figure


def _usual(histories: Sequence[xr.Dataset]) -> list[str]:
    known = [[name for name in group if all(name in history for history in histories)] for group in DEFAULT]
    return [group[0] for group in known if group] or [group[0] for group in DEFAULT]


def _check(
    histories: Sequence[xr.Dataset], names: Sequence[str], quantities: Sequence[str], region: str | None
) -> None:
    for dataset, name in zip(histories, names, strict=True):
        check_along_belt(dataset, quantities, name)
        if region is not None and not inside(dataset, region).any():
            found = ", ".join(dict.fromkeys(dataset["region"].values.astype(str)))
            raise mismatch(f"{name}: --region", "a pulley of the belt's path", f"{region}; it has {found}")


def check_along_belt(history: xr.Dataset, quantities: Sequence[str], source: str) -> None:
    """Raise InputError unless a history has these quantities over `position`, with known values."""
    known = [str(key) for key, array in history.data_vars.items() if array.dims == ("position",)]
    if not known:
        raise mismatch(source, "the history of a run with quantities along the belt", "none")
    for name in quantities:
        if name not in known:
            raise unknown(f"{source}: {name}", "quantity along the belt", name, known)
        figures.check_known(history, [name], source)


def _groups(labels: Sequence[dict[str, str]], columns: str | None, most: int) -> dict[str, list[int]]:
    """Places of the runs by the title of their column."""
    if columns is None:
        return {"": list(range(len(labels)))}
    groups: dict[str, list[int]] = {}
    for run, label in enumerate(labels):
        if columns not in label:
            raise mismatch("--columns", f"an axis in which the runs differ ({', '.join(labels[0])})", columns)
        groups.setdefault(label[columns], []).append(run)
    if len(groups) > most:
        raise mismatch("--columns", f"an axis with at most {most} values", f"{len(groups)} of {columns}")
    return groups


def inside(dataset: xr.Dataset, region: str) -> np.ndarray:
    """Stations (position,) in contact with a pulley, its arc's end included."""
    angle, at = dataset["wrap_angle"].values, dataset["region"].values.astype(str)
    here = (at == f"{region} arc") | (at == region)
    # the station at an arc's end is the first of the strand behind it
    return (here | np.roll(here, 1)) & np.isfinite(angle)


def _in_groove(dataset: xr.Dataset, region: str) -> np.ndarray:
    """Stations (n,) by the wrap angle: those of a pulley's arc, and those where contact may run on."""
    angle, here = dataset["wrap_angle"].values, inside(dataset, region)
    before, behind = angle < 0.0, angle > angle[here].max(initial=0.0)
    while (more := (before & np.roll(here, -1) | behind & np.roll(here, 1)) & ~here).any():
        here = here | more
    return np.flatnonzero(here)[np.argsort(angle[here])]


def shown_unit(array: xr.DataArray) -> tuple[float, str]:
    """Factor and unit in which a quantity along the belt is shown."""
    return _UNITS.get(str(array.attrs.get("units", ""))) or figures.value_unit(array)


def _draw(
    axes: Axes, dataset: xr.Dataset, name: str, factor: float, region: str | None, **style: object
) -> None:
    values = factor * dataset[name].values
    if region is None:
        axes.plot(1e3 * dataset["position"].values, values, **style)  # type: ignore[arg-type]  # of a line
    else:
        here = _in_groove(dataset, region)
        axes.plot(np.degrees(dataset["wrap_angle"].values[here]), values[here], **style)  # type: ignore[arg-type]


def _finish(axes: Axes, dataset: xr.Dataset, name: str, region: str | None) -> None:
    """Grid, zero line, and arcs shaded where the whole path is drawn."""
    axes.grid(linewidth=0.4, alpha=0.5)
    axes.axhline(_REFERENCES.get(name, 0.0), color="#333333", linewidth=0.7, zorder=1)
    if region is None:
        _shade_arcs(axes, dataset)
        axes.set_xlim(0.0, 1e3 * dataset["position"].values[-1])


def _shade_arcs(axes: Axes, dataset: xr.Dataset) -> None:
    for start, stop, _ in arcs(dataset):
        axes.axvspan(1e3 * start, 1e3 * stop, color=ARC, linewidth=0, zorder=0)


def arcs(dataset: xr.Dataset) -> list[tuple[float, float, str]]:
    """First and last path coordinate of each arc [m], with the name of its pulley."""
    known = [(start, stop, name.split()[0]) for start, stop, name in regions(dataset)]
    return [arc for arc in known if arc[2] in PULLEYS]


def regions(dataset: xr.Dataset) -> list[tuple[float, float, str]]:
    """First and last path coordinate of each region [m], with its name."""
    position, region = dataset["position"].values, dataset["region"].values.astype(str)
    first = [0, *(1 + np.flatnonzero(region[1:] != region[:-1]))]
    borders = [*position[first], position[-1]]
    return [(a, b, str(region[k])) for (a, b), k in zip(pairwise(borders), first, strict=True)]


def _name_regions(axes: Axes, dataset: xr.Dataset) -> None:
    for start, stop, name in regions(dataset):
        look = {"transform": axes.get_xaxis_transform(), "ha": "center", "va": "bottom", "fontsize": 9}
        axes.text(500.0 * (start + stop), 1.02, name.removesuffix(" arc"), **look)


class End(NamedTuple):
    """An end of an arc."""

    name: str  # such as "driving inlet"
    position: float  # path coordinate [m]
    inwards: float  # 1 where the arc follows, -1 where it ends


def ends_of_arcs(history: xr.Dataset) -> list[End]:
    """Inlet and outlet of both arcs, in the order of the path; places are those between two of `position`."""
    half = float(history["position"].values[0])
    ends = []
    for a, b, pulley in arcs(history):
        ends += [End(f"{pulley} inlet", a - half, 1.0), End(f"{pulley} outlet", b - half, -1.0)]
    return ends


def alone(history: xr.Dataset, end: End) -> tuple[str, float]:
    """Which flank carries alone at an end, and how far [m].

    A flank carries where its normal force is more than _TOUCHES of the largest force of both.

    Returned are its side, and the distance between the outermost places at which the flanks carry; 0 where
    both begin at the same place.
    """
    far = end.inwards * from_end(history, end)
    forces = [history[f"contact_force_{side}"].values for side in SIDES]
    near = np.abs(far) < AROUND
    least = _TOUCHES * np.nanmax(np.where(near, forces, 0.0))
    begins = [float(far[near & (force > least)].min(initial=AROUND)) for force in forces]
    return SIDES[int(np.argmin(begins))], abs(begins[0] - begins[1])


@figures.styled
def flanks_figure(history: xr.Dataset, source: str = "history") -> Figure:
    """Draw normal force and sliding of both flanks: along the belt, and where elements enter and leave arcs.

    Arguments as of all pictures of runs (`figures.py`); the run is that of a spatial pushbelt, with
    QUANTITIES of SIDES over `position` [m].
    """
    needed = [f"{name}_{side}" for name in QUANTITIES for side in SIDES]
    check_holds([history], [source], dict.fromkeys(needed, "of a spatial pushbelt"))
    ends = ends_of_arcs(history)
    figure = Figure((figures.NARROW, 1.75 * (1 + len(QUANTITIES)) + 1.0), layout="constrained")
    grid = figure.add_gridspec(1 + len(QUANTITIES), len(ends))
    whole = figure.add_subplot(grid[0, :])
    position = 1e3 * history["position"].values
    _draw_flanks(whole, history, "contact_force", position)
    for start, stop, name in regions(history):
        whole.text(500.0 * (start + stop), 1.02, name, transform=whole.get_xaxis_transform(), ha="center")
    _shade_arcs(whole, history)
    whole.set(xlim=(0.0, position[-1]), xlabel="position along the path [mm]")
    for row, name in enumerate(QUANTITIES, 1):
        first = None
        for column, end in enumerate(ends):
            axes = first = figure.add_subplot(grid[row, column], sharey=first)
            distance = 1e3 * from_end(history, end)
            order = np.argsort(distance)
            near = order[np.abs(distance[order]) < 1e3 * AROUND]
            _draw_flanks(axes, history.isel(position=near), name, distance[near], named=column == 0)
            axes.axvspan(*sorted((0.0, 1e3 * end.inwards * AROUND)), color=ARC, lw=0, zorder=0)
            axes.set_xlim(-1e3 * AROUND, 1e3 * AROUND)
            axes.tick_params(labelleft=column == 0, labelbottom=row == len(QUANTITIES))
            if row == len(QUANTITIES):
                axes.set_xlabel("from its end [mm]")
            if row == 1:
                side, length = alone(history, end)
                told = f"{side} alone: {1e3 * length:.2g} mm" if length else "both alike"
                axes.set_title(f"{end.name}\n{told}", loc="left", pad=4)
    figures.legend_below(figure, figures.entries_of([whole]), 2)
    entitle_runs(figure, [history], "Left and right flank", width=80)
    return figure


def from_end(history: xr.Dataset, end: End) -> np.ndarray:
    """Distance of places from an end along the path, forwards, (position,) [m]."""
    position = history["position"].values
    length = position[-1] + position[0]  # places are the middles of equal parts
    return (position - end.position + 0.5 * length) % length - 0.5 * length


def _draw_flanks(axes: Axes, history: xr.Dataset, name: str, over: np.ndarray, named: bool = True) -> None:
    """A quantity of both sides."""
    factor, unit = shown_unit(history[f"{name}_left"])
    for side in SIDES:
        array = history[f"{name}_{side}"]
        axes.plot(over, factor * array.values, label=f"{side} flank", lw=1.2, **_LOOKS[side])  # type: ignore[arg-type]  # of a line
    if named:
        axes.set_ylabel(f"{figures.in_words(array).removesuffix(' right')}\n[{unit}]")
    axes.axhline(0.0, color="#333333", lw=0.7, zorder=1)
    axes.grid(lw=0.4, alpha=0.5)


@figures.styled
def wrap_figure(histories: Sequence[xr.Dataset], sources: Sequence[str] = ()) -> Figure:
    """Draw the mean forces of one or several runs over the wrap of each pulley.

    Arguments as of all pictures of runs (`figures.py`), with `normal_force` and `friction_force` [N/m] and
    `tension` [N] over `position`, with `wrap_angle` [rad], nan far from arcs, and `region`; `sliding_tension`
    [N] is drawn beside the tension. Of more than MOST_PANELS pulleys those without torque are left out.
    """
    if not histories:
        raise InputError("wrap: expected one history or more, found none")
    names = named(histories, sources)
    for dataset, name in zip(histories, names, strict=True):
        missing = [key for key in ("normal_force", "friction_force", "wrap_angle") if key not in dataset]
        if missing:
            raise mismatch(name, "the history of a run with normal_force and wrap_angle", f"no {missing[0]}")
        figures.check_known(dataset, ["normal_force"], name)
    pulleys, without_torque = _pulleys(histories)
    common, labels = told_apart(histories, names)
    runs = list(zip(histories, labels, cycle(figures.COLOURS), cycle(_RUN_LINES), strict=False))
    rows = [row for row in ROWS if row[0] in histories[0]]
    figure = Figure((figures.WIDTH, 1.6 * len(rows) + 1.1), layout="constrained")
    panels = figure.subfigures()  # the label common to them keeps clear of the figure's legend
    grid = panels.subplots(len(rows), len(pulleys), sharex="col", sharey="row", squeeze=False)
    for (name, label, factor, beside), line_of_axes in zip(rows, grid, strict=True):
        for axes, pulley in zip(line_of_axes, pulleys, strict=True):
            for dataset, told, colour, line in runs:
                _draw_force(axes, dataset, pulley, name, factor, label=told, ls=line, lw=1.3, color=colour)
            for dataset, _, colour, _ in runs:
                if beside in dataset:
                    look = {"ls": ":", "lw": 1.6, "color": colour if len(runs) > 1 else INK, "zorder": 3}
                    _draw_force(axes, dataset, pulley, beside, factor, **look)
            axes.grid(linewidth=0.4, alpha=0.5)
        line_of_axes[0].set_ylabel(label)
    for axes, pulley in zip(grid[0], pulleys, strict=True):
        axes.set_title(f"{pulley.removesuffix(' arc')} pulley", loc="left", pad=3)
    panels.supxlabel("wrap angle from inlet [°]")
    entries = figures.entries_of(grid[-1:, 0])
    if "sliding_tension" in histories[0]:
        entries[_THEORY] = Line2D([], [], ls=":", lw=1.6, color=INK)
    figures.legend_below(figure, entries if len(entries) > 1 else {})
    further = [f"without torque, not drawn: {', '.join(without_torque)}"] if without_torque else []
    head = figures.headline("Forces over the wrap", *(dataset.attrs for dataset in histories))
    figures.entitle(figure, [head, common, common_course(histories), *further], 76)
    return figure


def _pulleys(histories: Sequence[xr.Dataset]) -> tuple[list[str], list[str]]:
    """Pulleys that have panels, and those that have none because no run has torque there."""
    along = [history["region"].values.astype(str) for history in histories]
    region, angle = along[0], histories[0]["wrap_angle"].values
    # the first station of a strand may be the end of the arc before it
    pulleys = [name for name in dict.fromkeys(region) if np.isfinite(angle[region == name]).all()]
    if len(pulleys) <= MOST_PANELS:
        return pulleys, []
    forces = [history["friction_force"].values for history in histories]
    pulls = [[np.nansum(f[r == p]) for p in pulleys] for f, r in zip(forces, along, strict=True)]
    largest = np.abs(pulls).max(axis=0)
    carries = dict(zip(pulleys, largest >= _LEAST_PULL * largest.max(), strict=True))
    return [p for p in pulleys if carries[p]], [p for p in pulleys if not carries[p]]


def _draw_force(axes: Axes, dataset: xr.Dataset, pulley: str, name: str, factor: float, **style: Any) -> None:
    """A quantity over the wrap of a pulley."""
    here = _in_groove(dataset, pulley.removesuffix(" arc"))
    angle = np.degrees(dataset["wrap_angle"].values[here])
    marker = "." if angle.size < FEW else ""
    axes.plot(angle, factor * dataset[name].values[here], marker=marker, ms=5, **style)
