"""Stability of the steady states along the load, and where it is lost or regained: Hopf points.

Between two loads of which one is stable the growth rate of the mode that grows fastest is brought to zero by
the secant and bisection (Brent's method); every state on the way is solved for, and none is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.linear_stability.modes import Mode, modes
from cvt_hpc.models.steady_variator.walking import Steady, SteadyBelt

CLOSE = 0.05  # [N m]: how closely an onset is found


class Point(NamedTuple):
    """A steady state with its modes, the one that grows fastest first; none: all decay fast."""

    steady: Steady
    modes: list[Mode]

    @property
    def growth(self) -> float:
        """Largest growth rate [1/s]; -inf where there is no mode."""
        return self.modes[0].growth if self.modes else -np.inf


class Onset(NamedTuple):
    """A Hopf point.

    Attributes
    ----------
    load : float
        [N m]
    frequency : float
        Of the mode that neither grows nor decays there [Hz].
    rising : bool
        Whether the steady state is unstable above that load.
    """

    load: float
    frequency: float
    rising: bool


def branch(belt: SteadyBelt, grid: Mesh, loads: Sequence[float]) -> list[Point]:
    """Steady states with their modes under several loads, each from the one before."""
    return [Point(steady, modes(steady, grid)) for steady in belt.along(loads)]


def onsets(belt: SteadyBelt, grid: Mesh, points: Sequence[Point]) -> list[Onset]:
    """Hopf points between points that follow each other along the load."""
    found = []
    for before, after in zip(points, points[1:], strict=False):
        if (before.growth > 0.0) != (after.growth > 0.0):
            found.append(_onset(belt, grid, before, after))
    return found


def _onset(belt: SteadyBelt, grid: Mesh, before: Point, after: Point) -> Onset:
    found = {point.steady.load: point for point in (before, after)}

    def growth(load: float) -> float:
        if load not in found:
            near = min(found, key=lambda known: abs(known - load))
            steady = belt.at(load, found[near].steady)
            found[load] = Point(steady, modes(steady, grid))
        # where all modes decay fast there is no rate to interpolate with
        return max(found[load].growth, -1e3)

    load = brentq(growth, before.steady.load, after.steady.load, xtol=CLOSE)
    near = min(found, key=lambda known: abs(known - load))
    unstable = found[near] if found[near].modes else max(before, after, key=lambda point: point.growth)
    return Onset(float(load), unstable.modes[0].frequency, after.growth > 0.0)
