"""The path of a belt around any number of circles: arcs, and the tangents between them, of either kind.

A belt runs around circle i counter-clockwise (turn s_i = 1) or clockwise (-1). With the running direction a
and the normal n(a) = (sin a, -cos a) to its right it touches the circle at c_i + s_i R_i n(a).
The tangent from circle i to circle j at the distance D in the direction phi has

    sin(a - phi) = (s_i R_i - s_j R_j) / D,    length = D cos(a - phi),

which is an outer tangent for equal turns and an inner one for opposite turns. A path begins where the belt
runs onto the first circle, and offsets count to its right: outwards of a belt that runs counter-clockwise.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

_MOST_WRAP = 1.5 * np.pi  # of a belt crossed around more than two: it crosses itself 0.41 radii off the rim


class BeltPath(NamedTuple):
    """A closed path around P circles, in the order in which the belt runs around them."""

    centre: np.ndarray  # of the circles, (P, 2) [m]
    radius: np.ndarray  # (P,) [m]
    turn: np.ndarray  # (P,): 1 where the belt runs counter-clockwise, else -1
    angle: np.ndarray  # running direction where the belt runs on, (P,) [rad]
    wrap: np.ndarray  # angle over which it touches the circle, (P,) [rad]
    spans: np.ndarray  # length of the span that leaves each circle, (P,) [m]

    @property
    def arcs(self) -> np.ndarray:
        """Lengths of the arcs, (P,) [m]."""
        return self.radius * self.wrap

    @property
    def ends(self) -> np.ndarray:
        """Path coordinates where arc, span, arc and so on end, (2 P,) [m]."""
        return np.cumsum(np.stack([self.arcs, self.spans], 1))

    @property
    def path_length(self) -> float:
        """Length of the whole path [m]."""
        return float(self.ends[-1])

    @property
    def leaving(self) -> np.ndarray:
        """Running direction of the spans, (P,) [rad]."""
        return self.angle + self.turn * self.wrap


def belt_path(centre: np.ndarray, radius: np.ndarray, turn: np.ndarray) -> BeltPath:
    """Lay a belt around two circles or more.

    Centres (P, 2) and radii (P,) [m], and turns (P,) as of `BeltPath`. The belt winds around all together
    once, or not at all if it crosses itself. ValueError if circles overlap, or the belt does not close around
    them or passes through itself; the text says where.
    """
    centre, radius, turn = (np.array(values, float) for values in (centre, radius, turn))
    pulleys = range(len(radius))
    for i in pulleys:
        for j in range(i):
            distance = np.hypot(*(centre[i] - centre[j]))
            if distance <= radius[i] + radius[j]:
                told = f"pulleys {j + 1} and {i + 1} at a distance of {distance:g} m, radii {radius[j]:g}"
                raise ValueError(f"overlap: {told} and {radius[i]:g} m")
    after = np.roll(centre, -1, 0) - centre
    distance = np.hypot(*after.T)
    steep = np.arcsin((turn * radius - np.roll(turn * radius, -1)) / distance)
    leaving = np.arctan2(after[:, 1], after[:, 0]) + steep
    angle = np.roll(leaving, 1)
    wrap = np.mod(turn * (leaving - angle), 2.0 * np.pi)
    path = BeltPath(centre, radius, turn, angle, wrap, distance * np.cos(steep))
    around = round(float(turn @ wrap) / (2.0 * np.pi))
    if abs(around) > 1:
        raise ValueError(f"a belt that winds around them {abs(around)} times")
    for i in pulleys:
        start, direction = span_starts(path)[i], directions(leaving)[i]
        for j in pulleys:
            if j not in (i, (i + 1) % len(radius)):
                along = np.clip((centre[j] - start) @ direction, 0.0, path.spans[i])
                if np.hypot(*(centre[j] - start - along * direction)) <= radius[j]:
                    raise ValueError(f"a span behind pulley {i + 1} that runs into pulley {j + 1}")
    crossed = _crossed_spans(path)
    if len(crossed) > (around == 0):
        i, j = crossed[0]
        raise ValueError(f"a belt whose spans behind pulleys {i + 1} and {j + 1} cross")
    i = int(np.argmax(wrap))
    if around == 0 and len(radius) > 2 and wrap[i] > _MOST_WRAP:
        told = f"pulley {i + 1} by {np.rad2deg(wrap[i]):.0f} deg"
        raise ValueError(
            f"a belt that crosses itself as it wraps {told}, more than {np.rad2deg(_MOST_WRAP):.0f}"
        )
    return path


def _crossed_spans(path: BeltPath) -> list[tuple[int, int]]:
    """Pairs of spans that cross. They alone can, as no span runs into a pulley."""
    start, direction = span_starts(path), directions(path.leaving)
    found = []
    for i, j in combinations(range(len(path.spans)), 2):
        between, sine = start[j] - start[i], _across(direction[i], direction[j])
        if sine == 0.0:
            continue
        on_first = _across(between, direction[j]) / sine
        on_second = _across(between, direction[i]) / sine
        if 0.0 < on_first < path.spans[i] and 0.0 < on_second < path.spans[j]:
            found.append((i, j))
    return found


def _across(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def directions(angle: np.ndarray) -> np.ndarray:
    """Unit vectors at angles (...), (..., 2)."""
    return np.stack([np.cos(angle), np.sin(angle)], -1)


def _normals(angle: np.ndarray) -> np.ndarray:
    """To the right of a direction."""
    return np.stack([np.sin(angle), -np.cos(angle)], -1)


def span_starts(path: BeltPath) -> np.ndarray:
    """Starts of the spans, (P, 2) [m]."""
    return path.centre + (path.turn * path.radius)[:, None] * _normals(path.leaving)


def tangents(centre: np.ndarray, radius: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends of the spans between circles, (P, 2) [m]; arguments of `belt_path`, unchecked."""
    after, aside = np.roll(centre, -1, 0) - centre, turn * radius
    steep = np.arcsin((aside - np.roll(aside, -1)) / np.hypot(*after.T))
    right = _normals(np.arctan2(after[:, 1], after[:, 0]) + steep)
    return centre + aside[:, None] * right, np.roll(centre, -1, 0) + np.roll(aside, -1)[:, None] * right


def points_at(path: BeltPath, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of a path (n, 2) [m], angles in which it runs (n,) [rad], and curvatures to the left (n,) [1/m].

    `position` holds path coordinates (n,) [m].
    """
    s = np.mod(position, path.path_length)
    where = regions(path, s)
    i, on_arc = where // 2, where % 2 == 0
    local = s - np.concatenate([[0.0], path.ends[:-1]])[where]
    curvature = np.where(on_arc, path.turn[i] / path.radius[i], 0.0)
    angle = np.where(on_arc, path.angle[i] + curvature * local, path.leaving[i])
    points = path.centre[i] + (path.turn * path.radius)[i][:, None] * _normals(angle)
    return points + np.where(on_arc, 0.0, local)[:, None] * directions(angle), angle, curvature


def regions(path: BeltPath, position: np.ndarray) -> np.ndarray:
    """Index of the region of path coordinates (n,) [m]: 2 i on the arc of circle i, 2 i + 1 behind it."""
    return np.searchsorted(path.ends[:-1], position, side="right")
