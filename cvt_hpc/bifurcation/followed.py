"""A branch of a bifurcation diagram with all its results, as it is kept and as all that shows it reads it."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cvt_hpc.archives import Arrays
from cvt_hpc.bifurcation.attractors import Attractor
from cvt_hpc.bifurcation.job import Asked
from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.linear_stability.branch import Branch, Onset, tracks
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.forces import quantities
from cvt_hpc.vibration.criticality import Criticality

STRAND = "strand in which the mode is largest: 1 is t1, 2 is t2"
# value, name for people, unit, comment
OF_MODES: dict[str, tuple[Callable[[Mode], float], str, str, str]] = {
    "growth_rate": (lambda mode: mode.growth, "growth rate", "s-1", "of the mode"),
    "frequency": (lambda mode: mode.frequency, "frequency", "Hz", "of the mode"),
    "vibrating_strand": (lambda mode: mode.strand + 1, "vibrating strand", "1", STRAND),
    "half_waves": (lambda mode: mode.half_waves, "half waves", "1", "of the mode along its vibrating strand"),
}


class Stability(IntEnum):
    """Of a steady state."""

    STABLE = 0
    UNSTABLE = 1
    NOT_FOUND = 2
    NOT_COMPUTED = 3


class Followed(NamedTuple):
    """One branch with all its results.

    Attributes
    ----------
    asked : Asked
        The requested branch.
    states : dict of array
        As of `states_of`.
    onsets : list of Onset
        Its Hopf points, in the order of their loads.
    hidden : list of (float, float)
        Loads between which stability changes without a Hopf point that could be found [N m].
    runs : list of Attractor
        From near the steady state (start 0) and from the large start (1); empty if none were requested.
    kinds : list of Criticality
        One for each of `onsets`.
    """

    asked: Asked
    states: Arrays
    onsets: list[Onset]
    hidden: list[tuple[float, float]]
    runs: list[Attractor]
    kinds: list[Criticality]

    @property
    def missed(self) -> np.ndarray:
        """Whether there is no steady state, (load,)."""
        return self.states["stability"] == Stability.NOT_FOUND


def states_of(found: Branch, grid: Mesh, loads: Sequence[float]) -> Arrays:
    """Steady states and modes of a branch along the load.

    Parameters
    ----------
    found : Branch
        The branch.
    grid : Mesh
        Of its belt.
    loads : sequence of float
        All loads of the branch, ascending [N m].

    Returns
    -------
    dict of array
        `load` and `stability` (load,); by their names quantities of the steady states (load, ...) and values
        of the modes (load, mode), each mode followed as far as there are states, the most unstable first;
        nan where there is none.
    """
    lines = [
        {piece[place].steady.load: mode for place, mode in track.items()}
        for piece in found.pieces()
        for track in tracks(piece)
    ]
    lines.sort(key=lambda line: -max(mode.growth for mode in line.values()))
    states = {"load": np.array(loads), "stability": np.full(len(loads), Stability.NOT_FOUND, np.int8)}
    for point in found.points:
        place = loads.index(point.steady.load)
        states["stability"][place] = Stability.UNSTABLE if point.growth > 0.0 else Stability.STABLE
        for name, value in quantities(point.steady, grid).items():
            states.setdefault(name, np.full((len(loads), *np.shape(value)), np.nan))[place] = value
    for name, (value_of, *_) in OF_MODES.items():
        states[name] = np.full((len(loads), len(lines)), np.nan)
        for column, line in enumerate(lines):
            for load, mode in line.items():
                states[name][loads.index(load), column] = value_of(mode)
    return states
