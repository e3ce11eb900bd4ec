"""Places of points along the path of a belt, and their distances from it: for kernels, and for arrays."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.physics.belt_path import BeltPath, directions, span_starts


class Way(NamedTuple):
    """A path as kernels take it, P circles; radius, turn, angle, wrap and spans are those of `BeltPath`."""

    centre: np.ndarray  # of the circles, (P, 2) [m]
    start: np.ndarray  # of the spans that leave them, (P, 2) [m]
    radius: np.ndarray
    turn: np.ndarray
    angle: np.ndarray
    wrap: np.ndarray
    spans: np.ndarray
    onto: np.ndarray  # running directions where the belt runs on, (P, 2)
    off: np.ndarray  # running directions of the spans, (P, 2)
    begins: np.ndarray  # path coordinates where arcs and spans begin, (P, 2) [m]
    length: float  # of the whole path [m]
    aside: float  # what it counts to run across the path [m^2]


def way(path: BeltPath) -> Way:
    """Path for kernels."""
    begins = np.concatenate([[0.0], path.ends[:-1]]).reshape(-1, 2)
    onto, off = directions(path.angle), directions(path.leaving)
    circles = path.radius, path.turn, path.angle, path.wrap, path.spans
    aside = float(path.radius.min()) ** 2
    return Way(path.centre, span_starts(path), *circles, onto, off, begins, path.path_length, aside)


@kernel
def nearest(way: Way, x: float, y: float, along_x: float, along_y: float) -> tuple[float, float]:
    """Path coordinate and offset [m] of one point, as `along` gives them."""
    per = 1.0 / np.sqrt(along_x * along_x + along_y * along_y)
    along_x, along_y = per * along_x, per * along_y
    least, position, offset = np.inf, 0.0, 0.0
    for i in range(way.radius.size):
        tx, ty = way.off[i, 0], way.off[i, 1]
        dx, dy = x - way.start[i, 0], y - way.start[i, 1]
        local = min(max(dx * tx + dy * ty, 0.0), way.spans[i])
        dx, dy = dx - local * tx, dy - local * ty
        badness = dx * dx + dy * dy + way.aside * (1.0 - tx * along_x - ty * along_y)
        if badness < least:
            least, position, offset = badness, way.begins[i, 1] + local, dx * ty - dy * tx
    for i in range(way.radius.size):
        radius, turn = way.radius[i], way.turn[i]
        dx, dy = x - way.centre[i, 0], y - way.centre[i, 1]
        distance = np.sqrt(dx * dx + dy * dy)
        if not (distance - radius) ** 2 < least:
            continue
        # where the radius through the point meets the arc, or the nearer end
        turned = turn * (np.arctan2(turn * dx, -turn * dy) - way.angle[i])
        turned -= 2.0 * np.pi * np.floor(turned / (2.0 * np.pi))
        if turned <= way.wrap[i]:
            tx, ty = -turn * dy / distance, turn * dx / distance
        elif turned - way.wrap[i] < 2.0 * np.pi - turned:
            turned, tx, ty = way.wrap[i], way.off[i, 0], way.off[i, 1]
        else:
            turned, tx, ty = 0.0, way.onto[i, 0], way.onto[i, 1]
        dx, dy = dx - turn * radius * ty, dy + turn * radius * tx
        badness = dx * dx + dy * dy + way.aside * (1.0 - tx * along_x - ty * along_y)
        if badness < least:
            least, position, offset = badness, way.begins[i, 0] + radius * turned, dx * ty - dy * tx
    return (position if position < way.length else position - way.length), offset


def along(path: BeltPath, points: np.ndarray, running: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Path coordinates (n,) [m] of points near a path, below its length, and distances to its right (n,) [m].

    Of two places of the path that are equally near to one of the `points` (n, 2) [m], as where a belt crosses
    itself, the one counts at which the belt runs in the direction of the point, `running` (n, 2), of any
    length.
    """
    position, offset = np.empty((2, len(points)))
    _along(way(path), np.array(points, float), np.array(running, float), position, offset)
    return position, offset


@kernel
def _along(
    way: Way, points: np.ndarray, running: np.ndarray, position: np.ndarray, offset: np.ndarray
) -> None:
    """Fill positions and offsets (n,) of points (n, 2), as of `along`."""
    for i in range(points.shape[0]):
        position[i], offset[i] = nearest(way, points[i, 0], points[i, 1], running[i, 0], running[i, 1])
