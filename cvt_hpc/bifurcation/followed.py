"""A branch of a bifurcation diagram with all its results."""

from __future__ import annotations

from typing import NamedTuple

from cvt_hpc.bifurcation.attractors import Attractor
from cvt_hpc.bifurcation.job import Asked
from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.linear_stability.branch import Branch, Onset
from cvt_hpc.vibration.criticality import Criticality


class Followed(NamedTuple):
    """One branch with all its results.

    Attributes
    ----------
    asked : Asked
        The requested branch.
    grid : Mesh
        Of the belt.
    branch : Branch
        Steady states and their modes.
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
    grid: Mesh
    branch: Branch
    onsets: list[Onset]
    hidden: list[tuple[float, float]]
    runs: list[Attractor]
    kinds: list[Criticality]
