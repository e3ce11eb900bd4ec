"""Left and right flank of one run along the belt, with the ends of the arcs enlarged."""

from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.figures import NARROW, in_words, styled
from cvt_hpc.analysis.profiles import ARC, regions, shown_unit
from cvt_hpc.analysis.telling_apart import check_holds, entitle_runs

SIDES = ("left", "right")
QUANTITIES = ("contact_force", "flank_slip", "radial_slip")
LOOKS = {"left": {"color": "#0072b2", "ls": "-"}, "right": {"color": "#d55e00", "ls": "--"}}
AROUND = 0.02  # [m] of the path on both sides of an end
TOUCHES = 0.05  # of the largest force: a flank that has less carries nothing


class End(NamedTuple):
    """An end of an arc.

    Attributes
    ----------
    name : str
        Such as "driving inlet".
    position : float
        Path coordinate [m].
    inwards : float
        1 where the arc follows, -1 where it ends.
    """

    name: str
    position: float
    inwards: float


def ends_of_arcs(history: xr.Dataset) -> list[End]:
    """Inlet and outlet of both arcs, in the order of the path; places are those between two of `position`."""
    half = float(history["position"].values[0])
    arcs = [(a, b, name.split()[0]) for a, b, name in regions(history)]
    arcs = [arc for arc in arcs if arc[2] in ("driving", "driven")]
    return [
        End(f"{pulley} {end}", at - half, way)
        for a, b, pulley in arcs
        for end, at, way in (("inlet", a, 1.0), ("outlet", b, -1.0))
    ]


def alone(history: xr.Dataset, end: End) -> tuple[str, float]:
    """Which flank carries alone at an end, and how far [m].

    A flank carries where its normal force is more than TOUCHES of the largest force of both.

    Returns
    -------
    (str, float)
        Side, and the distance between the outermost places at which the flanks carry; 0 where both begin at
        the same place.
    """
    far = end.inwards * from_end(history, end)
    forces = [history[f"contact_force_{side}"].values for side in SIDES]
    near = np.abs(far) < AROUND
    least = TOUCHES * np.nanmax(np.where(near, forces, 0.0))
    begins = [float(far[near & (force > least)].min(initial=AROUND)) for force in forces]
    return SIDES[int(np.argmin(begins))], abs(begins[0] - begins[1])


@styled
def flanks_figure(history: xr.Dataset, source: str = "history") -> Figure:
    """Draw normal force and sliding of both flanks: along the belt, and where elements enter and leave arcs.

    Parameters
    ----------
    history : Dataset
        Of a run of a spatial pushbelt, as `simulate` returns it: QUANTITIES of SIDES over `position` [m].
    source : str
        Where the history is from, for the errors.

    Raises
    ------
    InputError
        The history has no flanks of two sides.
    """
    needed = [f"{name}_{side}" for name in QUANTITIES for side in SIDES]
    check_holds([history], [source], dict.fromkeys(needed, "of a spatial pushbelt"))
    ends = ends_of_arcs(history)
    figure = Figure((NARROW, 1.75 * (1 + len(QUANTITIES)) + 1.0), layout="constrained")
    grid = figure.add_gridspec(1 + len(QUANTITIES), len(ends))
    whole = figure.add_subplot(grid[0, :])
    position = 1e3 * history["position"].values
    _draw(whole, history, "contact_force", position)
    for start, stop, name in regions(history):
        whole.text(500.0 * (start + stop), 1.02, name, transform=whole.get_xaxis_transform(), ha="center")
        if name.split()[0] in ("driving", "driven"):
            whole.axvspan(1e3 * start, 1e3 * stop, color=ARC, lw=0, zorder=0)
    whole.set(xlim=(0.0, position[-1]), xlabel="position along the path [mm]")
    for row, name in enumerate(QUANTITIES, 1):
        first = None
        for column, end in enumerate(ends):
            axes = first = figure.add_subplot(grid[row, column], sharey=first)
            distance = 1e3 * from_end(history, end)
            order = np.argsort(distance)
            near = order[np.abs(distance[order]) < 1e3 * AROUND]
            _draw(axes, history.isel(position=near), name, distance[near], named=column == 0)
            axes.axvspan(*sorted((0.0, 1e3 * end.inwards * AROUND)), color=ARC, lw=0, zorder=0)
            axes.set_xlim(-1e3 * AROUND, 1e3 * AROUND)
            axes.tick_params(labelleft=column == 0, labelbottom=row == len(QUANTITIES))
            if row == len(QUANTITIES):
                axes.set_xlabel("from its end [mm]")
            if row == 1:
                side, length = alone(history, end)
                told = f"{side} alone: {1e3 * length:.2g} mm" if length else "both alike"
                axes.set_title(f"{end.name}\n{told}", loc="left", pad=4)
    handles, told = whole.get_legend_handles_labels()
    figure.legend(handles, told, loc="outside lower center", frameon=False, ncols=2)
    entitle_runs(figure, [history], "Left and right flank", width=80)
    return figure


def from_end(history: xr.Dataset, end: End) -> np.ndarray:
    """Distance of places from an end along the path, forwards, (position,) [m]."""
    position = history["position"].values
    length = position[-1] + position[0]  # places are the middles of equal parts
    return (position - end.position + 0.5 * length) % length - 0.5 * length


def _draw(axes: Axes, history: xr.Dataset, name: str, over: np.ndarray, named: bool = True) -> None:
    """A quantity of both sides."""
    factor, unit = shown_unit(history[f"{name}_left"])
    for side in SIDES:
        array = history[f"{name}_{side}"]
        axes.plot(over, factor * array.values, label=f"{side} flank", lw=1.2, **LOOKS[side])  # type: ignore[arg-type]  # of a line
    if named:
        axes.set_ylabel(f"{in_words(array).removesuffix(' right')}\n[{unit}]")
    axes.axhline(0.0, color="#333333", lw=0.7, zorder=1)
    axes.grid(lw=0.4, alpha=0.5)
