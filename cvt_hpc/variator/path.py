"""The path of a belt in the plane: points along it, and where points lie along it and how far off.

It is run through counter-clockwise around the driving pulley at (0, 0) and the driven one at (a, 0), so that
t1 is the lower strand. Path coordinates begin at the inlet of the driving arc.
"""

import numpy as np

from cvt_hpc.physics.geometry import Variator

REGIONS = ("driving", "t1", "driven", "t2")


def points_at(
    path: Variator, centre_distance: float, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of the path, angles of the running direction, and curvatures.

    Parameters
    ----------
    path : Variator
        Radii, wraps and strands.
    centre_distance : float
        a [m]
    position : (n,) array
        Path coordinates [m].

    Returns
    -------
    (n, 2), (n,), (n,) arrays
        [m], [rad], [1/m]
    """
    s = np.mod(position, path.path_length)
    tilt = 0.5 * (path.driven_wrap - np.pi)  # of the strands: the lower one runs downwards for it > 0
    driving, driven = path.driving_radius, path.driven_radius
    region = regions(path, s)
    local = s - np.concatenate([[0.0], np.cumsum(path.lengths)[:3]])[region]
    turned = [np.pi + tilt + local / driving, -tilt, -tilt + local / driven, np.pi + tilt]
    angle = np.choose(region, np.broadcast_arrays(*turned))
    on_arc = region % 2 == 0
    centre = np.where((region == 2) | (region == 3), centre_distance, 0.0)
    radius = np.choose(region, [driving, driving, driven, driven])
    straight = np.where(on_arc, 0.0, local)
    # the radius along the outward normal (sin, -cos), from the end of an arc on along the strand
    y = centre + radius * np.sin(angle) + straight * np.cos(angle)
    z = -radius * np.cos(angle) + straight * np.sin(angle)
    return np.stack([y, z], 1), angle, np.where(on_arc, 1.0 / radius, 0.0)


def along(path: Variator, centre_distance: float, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Path coordinates of points, and their distances from the path.

    Parameters
    ----------
    path : Variator
        Radii, wraps and strands.
    centre_distance : float
        [m]
    points : (n, 2) array
        [m]

    Returns
    -------
    position : (n,) array
        Less than the path's length [m].
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
