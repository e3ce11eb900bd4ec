"""A bifurcation diagram made: branches followed, Hopf points found and classified, kept, written, drawn."""

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from cvt_hpc.bifurcation.attractors import Attractor, Start, attractors
from cvt_hpc.bifurcation.costs import predicted_cost
from cvt_hpc.bifurcation.dataset import diagram_dataset
from cvt_hpc.bifurcation.drawing import draw_branch
from cvt_hpc.bifurcation.folder import DiagramFolder, picture_names
from cvt_hpc.bifurcation.followed import Followed, states_of
from cvt_hpc.bifurcation.job import Asked, Diagram
from cvt_hpc.bifurcation.kinds import lowest_judged, with_kinds
from cvt_hpc.files import written_aside
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.models.elastic_belt.belt import State, mesh
from cvt_hpc.models.linear_stability.branch import Branch, branch, onsets
from cvt_hpc.models.linear_stability.modes import LOW
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from cvt_hpc.netcdf import write_netcdf
from cvt_hpc.study.ranks.progress import Steps


@dataclass(frozen=True)
class DiagramReport:
    """Results of a diagram.

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
    diagram: Diagram, out: Path, *, fresh: bool = False, tell: Callable[[str], None] = lambda line: None
) -> DiagramReport:
    """Follow the branches that are not kept in the folder, run beside them, and write dataset and pictures.

    Each branch is kept, and in the dataset, once it is done. A dataset of the same job that holds more
    branches than are kept, as of an earlier version, is left until there are as many.

    Parameters
    ----------
    diagram : Diagram
        The requested diagram.
    out : Path
        Output folder; made if needed.
    fresh : bool
        Throw an earlier diagram of the folder away.
    tell : callable
        Given a line when a branch is done, with the time to go.

    Raises
    ------
    InputError
        If the folder holds the diagram of another job or is in use, or the system refuses.
    """
    folder, branches = DiagramFolder(out, diagram), diagram.branches
    pictures = [out / name for name in picture_names(len(branches))]
    with folder.claimed(diagram, fresh=fresh):
        loaded = ((number, folder.load_branch(number)) for number in range(len(branches)))
        followed = {number: one for number, one in loaded if one is not None}
        folder.branches.warn_of_others(folder.dataset)
        stored = folder.stored_branches()
        if stored > len(followed):
            words = "all but those are followed anew, and it is replaced once as many are done"
            tell(f"{folder.dataset} holds {stored} branches, {len(followed)} are kept beside it; {words}")
        for number, one in followed.items():
            draw_branch(diagram, one, pictures[number])
        missing = [number for number in range(len(branches)) if number not in followed]
        if not missing:
            _write(diagram, folder, followed)
        costs = [predicted_cost(diagram, branches[number]).total for number in missing]
        with closing(Steps(costs, len(followed), "branch", tell)) as steps:
            for number in missing:
                # matrices are small: threads of the linear algebra would wait for each other in loops
                with one_thread():
                    one = followed[number] = _follow(diagram, branches[number])
                folder.save_branch(number, one)
                if len(followed) >= stored:
                    _write(diagram, folder, followed)
                draw_branch(diagram, one, pictures[number])
                steps.ended(f"branches: {len(one.onsets)} Hopf points")
    return DiagramReport(tuple(one for _, one in sorted(followed.items())), folder.dataset, tuple(pictures))


def _write(diagram: Diagram, folder: DiagramFolder, followed: Mapping[int, Followed]) -> None:
    """Write the dataset of the branches that are done."""
    with written_aside(folder.dataset) as aside:
        write_netcdf(diagram_dataset(diagram, followed, folder.branches.makers), aside)


def _follow(diagram: Diagram, asked: Asked) -> Followed:
    """Follow one branch."""
    p, grid, belt = asked.parameters, mesh(asked.parameters), SteadyBelt(asked.parameters)
    band = LOW, p["band_high"]  # from far below that of runs: a mode that enters a band seems to cross zero
    found = branch(belt, grid, diagram.loads, band)
    hopf, hidden = onsets(belt, grid, found, band)
    runs: list[Attractor] = []
    if diagram.disturbance:
        small, large = ({"disturbance": size} for size in diagram.disturbance)
        # the load that rises within tens of milliseconds is itself a large disturbance
        starts = (Start(small, partial(_steady_state, belt, found)), Start(large))
        places = [onset.load for onset in hopf if onset.frequency >= lowest_judged(asked)]
        runs = attractors(asked.runs, "load", starts, diagram.loads, places, diagram.resolution)
    return with_kinds(diagram, asked, states_of(found, grid, diagram.loads), hopf, hidden, runs)


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
