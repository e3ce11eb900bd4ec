"""A bifurcation diagram made: branches followed, Hopf points found and classified, written and drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from cvt_hpc.bifurcation.asking import Asked, Diagram
from cvt_hpc.bifurcation.attractors import Attractor, Start, attractors
from cvt_hpc.bifurcation.dataset import diagram_dataset
from cvt_hpc.bifurcation.drawing import draw_branch
from cvt_hpc.files import written_aside
from cvt_hpc.models.elastic_belt.belt import Mesh, State, mesh
from cvt_hpc.models.linear_stability.branch import Branch, Onset, branch, onsets
from cvt_hpc.models.linear_stability.modes import LOW
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from cvt_hpc.netcdf import write_netcdf
from cvt_hpc.vibration.criticality import Criticality, Kind, criticality

AGREEMENT = 5.0  # [N m]: how far runs from near the steady state may turn quiet from the Hopf point
SEEN = 2.0 / 3.0  # of the lowest frequency that is judged: limit cycles settle at up to half as much again


class Followed(NamedTuple):
    """One branch with all that was found of it.

    Attributes
    ----------
    asked : Asked
        What was asked for.
    grid : Mesh
        Of the belt.
    branch : Branch
        Steady states and their modes.
    onsets : list of Onset
        Its Hopf points, in the order of their loads.
    hidden : list of (float, float)
        Loads between which stability changes without a Hopf point that could be found [N m].
    runs : list of Attractor
        From near the steady state (start 0) and from the large start (1); empty if none were asked for.
    kinds : list of Criticality
        One for each of `onsets`.
    """

    asked: Asked
    grid: Mesh
    branch: Branch
    onsets: list[Onset]
    hidden: list[tuple[float, float]]
    runs: list[Attractor]
    kinds: list[Criticality]


@dataclass(frozen=True)
class DiagramReport:
    """What a diagram left.

    Attributes
    ----------
    followed : tuple of Followed
        The branches.
    dataset : Path
        netCDF of all of them.
    pictures : tuple of Path
        One for each branch.
    """

    followed: tuple[Followed, ...]
    dataset: Path
    pictures: tuple[Path, ...]


def make_diagram(
    diagram: Diagram, out: Path, *, tell: Callable[[str], None] = lambda line: None
) -> DiagramReport:
    """Follow all branches, run beside them, and write dataset and pictures.

    Parameters
    ----------
    diagram : Diagram
        What is asked for.
    out : Path
        Output folder; made if needed.
    tell : callable
        Given a line when a branch is done.

    Raises
    ------
    InputError
        If the system refuses to write.
    """
    followed = []
    for number, asked in enumerate(diagram.branches, 1):
        # matrices are small: threads of the linear algebra would wait for each other in loops
        with threadpool_limits(1):
            followed.append(_follow(diagram, asked))
        tell(f"branch {number}/{len(diagram.branches)}: {len(followed[-1].onsets)} Hopf points")
    with written_aside(out / "branch.nc", parents=True) as aside:
        write_netcdf(diagram_dataset(diagram, followed), aside)
    several = len(followed) > 1
    pictures = [
        draw_branch(diagram, one, out / (f"branch_{number}.png" if several else "branch.png"))
        for number, one in enumerate(followed, 1)
    ]
    return DiagramReport(tuple(followed), out / "branch.nc", tuple(pictures))


def _follow(diagram: Diagram, asked: Asked) -> Followed:
    """Follow one branch."""
    p, grid, belt = asked.parameters, mesh(asked.parameters), SteadyBelt(asked.parameters)
    band = LOW, p["band_high"]  # from far below that of runs: what enters a band seems to cross zero
    found = branch(belt, grid, diagram.loads, band)
    hopf, hidden = onsets(belt, grid, found, band)
    runs: list[Attractor] = []
    lowest = SEEN * p["band_low"]
    if diagram.disturbance:
        small, large = ({"disturbance": size} for size in diagram.disturbance)
        # the load that rises within tens of milliseconds is itself a large disturbance
        starts = (Start(small, partial(_steady_state, belt, found)), Start(large))
        places = [onset.load for onset in hopf if onset.mode.frequency >= lowest]
        runs = attractors(asked.runs, "load", starts, diagram.loads, places, diagram.resolution)
    kinds = [_kind(onset, hopf, runs, lowest) for onset in hopf]
    return Followed(asked, grid, found, hopf, hidden, runs, kinds)


def _steady_state(belt: SteadyBelt, found: Branch, load: float) -> State | None:
    """The steady state under a load; none beside a gap, where to look for one takes long."""
    points = found.points
    if not points or _beside_gap(found, load):
        return None
    near = min(points, key=lambda point: abs(point.steady.load - load)).steady
    try:
        return (near if near.load == load else belt.at(load, near)).state
    except NoSteadyState:
        return None


def _beside_gap(found: Branch, load: float) -> bool:
    """Whether the next load of the branch, on either side, is one without a steady state."""
    loads = np.array(sorted([*found.missed, *(point.steady.load for point in found.points)]))
    at = np.searchsorted(loads, load)
    beside = loads[at : at + 1] if load in loads else loads[max(at - 1, 0) : at + 1]
    return any(float(one) in found.missed for one in beside)


def _kind(onset: Onset, hopf: list[Onset], runs: list[Attractor], lowest: float) -> Criticality:
    """Whether a Hopf point is super- or subcritical, of one whose mode is within what runs are judged by."""
    if not runs:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "no runs were asked for")
    if onset.mode.frequency < lowest:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "its mode lies below the band of runs")
    loads = sorted({run.value for run in runs})
    small, large = ([int(run.occurrence) for run in runs if run.start == start] for start in (0, 1))
    others = [one.load for one in hopf if one.mode.frequency >= lowest and one is not onset]
    return criticality(
        onset.load,
        not onset.rising,
        loads,
        small,
        large,
        agreement=AGREEMENT,
        limits=(
            max((load for load in others if load <= onset.load), default=-np.inf),
            min((load for load in others if load > onset.load), default=np.inf),
        ),
    )
