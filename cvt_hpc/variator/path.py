"""Where points lie along the path of a belt, and how far off it."""

from __future__ import annotations

import numpy as np

from cvt_hpc.physics.geometry import Variator

REGIONS = ("driving", "t1", "driven", "t2")


def along(path: Variator, centre_distance: float, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Path coordinates of points, and their distances from the path.

    Parameters
    ----------
    path : Variator
        The path, run through counter-clockwise around the driving pulley at (0, 0) and the driven one at
        (centre_distance, 0), so that t1 is the lower strand.
    centre_distance : float
        [m]
    points : (n, 2) array
        [m]

    Returns
    -------
    position : (n,) array
        From the inlet of the driving arc on, less than the path's length [m].
    offset : (n,) array
        Outwards [m].
    """
    y, z = points.T
    tilt = 0.5 * (path.driven_wrap - np.pi)
    sine, cosine = np.sin(tilt), np.cos(tilt)
    strand, (driving, driven) = path.strand_length, (path.driving_radius, path.driven_radius)
    starts = np.concatenate([[0.0], np.cumsum(path.lengths)])
    lower = z < 0.0
    # distance from the driving end of the strand on the point's side, and from the strand's line
    side = np.where(lower, -1.0, 1.0)
    reach = cosine * (y + driving * sine) + side * sine * (z - side * driving * cosine)
    beyond = -sine * y + side * cosine * z - driving
    angle = np.mod(np.arctan2(z, y) - (0.5 * np.pi + tilt), 2.0 * np.pi)
    on_driving = driving * np.minimum(angle, path.driving_wrap)
    angle = np.mod(np.arctan2(z, y - centre_distance) + 0.5 * np.pi + tilt, 2.0 * np.pi)
    on_driven = starts[2] + driven * np.minimum(angle, path.driven_wrap)
    on_strand = np.where(lower, starts[1] + reach, starts[4] - reach)
    where = [reach < 0.0, reach > strand]
    position = np.select(where, [on_driving, on_driven], on_strand)
    radial = [np.hypot(y, z) - driving, np.hypot(y - centre_distance, z) - driven]
    return np.mod(position, path.path_length), np.select(where, radial, beyond)


def regions(path: Variator, position: np.ndarray) -> np.ndarray:
    """Index in REGIONS of path coordinates (n,) [m]."""
    return np.searchsorted(np.cumsum(path.lengths)[:3], position, side="right")
