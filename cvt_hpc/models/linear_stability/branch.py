"""Stability of the steady states along the load, and where it is lost or regained: Hopf points.

Modes at neighbouring loads are one where their shapes are, by the modal assurance criterion (Allemang and
Brown 1982). Where one of them crosses the imaginary axis the loads are halved until they are close; every
state on the way is solved for, and none is interpolated. The band of frequencies must not end among the modes
that matter: one that enters it looks as if it had crossed the axis. A load at which no steady state is found
is a gap: nothing is joined across it.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.linear_stability.modes import HIGH, LOW, Mode, modes
from cvt_hpc.models.steady_variator.walking import NoSteadyState, Steady, SteadyBelt

CLOSE = 0.1  # [N m]: between the loads that bracket an onset
ALIKE = 0.5  # of 1: modes whose shapes have more than half in common are one


class Point(NamedTuple):
    """A steady state with its modes, the one that grows fastest first; none: all decay fast."""

    steady: Steady
    modes: list[Mode]

    @property
    def growth(self) -> float:
        """Largest growth rate [1/s]; -inf where there is no mode."""
        return self.modes[0].growth if self.modes else -np.inf


class Branch(NamedTuple):
    """Steady states along the load."""

    points: list[Point]  # those that were found, in the order of their loads
    missed: dict[float, str]  # why there is none, by load [N m]

    def pieces(self) -> Iterator[list[Point]]:
        """Yield the points between two gaps."""
        gaps = sorted(self.missed)
        for low, high in zip([-np.inf, *gaps], [*gaps, np.inf], strict=True):
            piece = [point for point in self.points if low < point.steady.load < high]
            if piece:
                yield piece


class Onset(NamedTuple):
    """A Hopf point."""

    load: float  # [N m]
    frequency: float  # of the mode that neither grows nor decays there [Hz]
    strand: int  # that which moves most in that mode, 0 or 1
    half_waves: int  # along that strand
    rising: bool  # whether the mode grows above that load, or else below
    others: int  # number of other modes that grow there: where there are none, stability is lost or regained


def branch(
    belt: SteadyBelt, grid: Mesh, loads: Sequence[float], band: tuple[float, float] = (LOW, HIGH)
) -> Branch:
    """Steady states with their modes in a band [Hz] under ascending loads [N m], each from the one before."""
    points: list[Point] = []
    missed: dict[float, str] = {}
    for load in loads:
        try:
            steady = belt.at(load, points[-1].steady if points else None)
        except NoSteadyState as error:
            missed[load] = str(error)
        else:
            points.append(Point(steady, modes(steady, grid, band)))
    return Branch(points, missed)


def onsets(
    belt: SteadyBelt, grid: Mesh, found: Branch, band: tuple[float, float] = (LOW, HIGH)
) -> tuple[list[Onset], list[tuple[float, float]]]:
    """Hopf points of a branch, in the order of their loads.

    And the loads [N m] between which stability changes in a gap, or where a state on the way is not found.
    """
    known, hidden = [], []
    for before, after in pairwise(found.points):
        ends = before.steady.load, after.steady.load
        if any(ends[0] < load < ends[1] for load in found.missed):
            if (before.growth > 0.0) != (after.growth > 0.0):
                hidden.append(ends)
            continue
        try:
            known += _onsets(belt, grid, before, after, band)
        except NoSteadyState:
            hidden.append(ends)
    return known, hidden


def tracks(piece: Sequence[Point]) -> list[dict[int, Mode]]:
    """Modes of points without a gap between them, in the order of their loads, each followed along the load.

    Of each that is followed, the mode by place in `piece`.
    """
    followed = [{0: mode} for mode in piece[0].modes]
    for place, (before, after) in enumerate(pairwise(piece), 1):
        last = {id(track[place - 1]): track for track in followed if place - 1 in track}
        for one, other in _pairs(before, after, ALIKE):
            if one is not None and other is not None:
                last[id(one)][place] = other
            elif other is not None:
                followed.append({place: other})
    return followed


def _pairs(before: Point, after: Point, alike: float) -> list[tuple[Mode | None, Mode | None]]:
    """Modes of two points that are one, by more than `alike`, and those that have no partner."""
    criterion = np.array([[_alike(one, other) for other in after.modes] for one in before.modes])
    criterion = criterion.reshape(len(before.modes), len(after.modes))
    matched = zip(*linear_sum_assignment(-criterion), strict=True)
    joined = {a: b for a, b in matched if criterion[a, b] > alike}
    pairs = [(mode, after.modes[joined[a]] if a in joined else None) for a, mode in enumerate(before.modes)]
    taken = set(joined.values())
    return pairs + [(None, mode) for b, mode in enumerate(after.modes) if b not in taken]


def _alike(one: Mode, other: Mode) -> float:
    """Modal assurance criterion of two shapes: 1 where they are one, 0 where they have nothing in common."""
    a, b = one.displacement, other.displacement
    return float(np.abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a) * np.vdot(b, b)).real)


def _onsets(
    belt: SteadyBelt, grid: Mesh, before: Point, after: Point, band: tuple[float, float]
) -> list[Onset]:
    """Hopf points between two points, by halves."""
    low, high = before.steady.load, after.steady.load
    is_close = high - low <= CLOSE
    # of states so close none is left without a partner, however much a cell that opens changes its shape
    pairs = _pairs(before, after, 0.0 if is_close else ALIKE)
    growing = [[mode for mode in pair if mode is not None and mode.growth > 0.0] for pair in pairs]
    crossing = [k for k, grown in enumerate(growing) if len(grown) == 1]
    if not crossing:
        return []
    load = 0.5 * (low + high)
    if is_close:
        others = sum(len(grown) == 2 for grown in growing)
        grown = [(growing[k][0], growing[k][0] is pairs[k][1]) for k in crossing]
        return [
            Onset(load, float(mode.frequency), int(mode.strand), int(mode.half_waves), rising, others)
            for mode, rising in grown
        ]
    steady = belt.at(load, before.steady)
    middle = Point(steady, modes(steady, grid, band))
    return [*_onsets(belt, grid, before, middle, band), *_onsets(belt, grid, middle, after, band)]
