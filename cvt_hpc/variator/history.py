"""The history of a run of a variator as a dataset: quantities over time, and quantities along the path.

The path of a belt in the plane has points along it, and tells where others lie along it and how far off. It
is run through counter-clockwise around the driving pulley at (0, 0) and the driven one at (a, 0), so that t1
is the lower strand. Path coordinates begin at the inlet of the driving arc.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.physics.geometry import Variator
from cvt_hpc.storage.netcdf import attributes

if TYPE_CHECKING:
    import xarray as xr

REGIONS = ("driving", "t1", "driven", "t2")

_OVER_TIME = {
    "load": ("load", "N m", "torque at the driving pulley"),
    "driving_speed": ("driving speed", "rad s-1", "of the driving pulley"),
    "driven_speed": ("driven speed", "rad s-1", "of the driven pulley"),
}

# along the belt, of an instant
ALONG = {
    "ring_tension": ("ring tension", "N", ""),
    "push_force": ("push force", "N", "between elements"),
    "mean_displacement": ("mean displacement", "m", "off the reference path, outward"),
}


def of_means(words: tuple[str, str, str]) -> tuple[str, str, str]:
    """Long name, unit and comment of a quantity's mean; one of the texts states that it is a mean."""
    name, unit, comment = words
    return words if name.startswith("mean") else (name, unit, ", ".join(filter(None, ("mean", comment))))


def dataset(
    run: Any,
    over_time: Mapping[str, tuple[str, str, str]],
    profiles: Mapping[str, tuple[np.ndarray, str, str, str]],
    position: np.ndarray,
    regions: np.ndarray,
) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed.

    `displacement` (time, probe) is in [m]. A blank in the name of a channel is an underscore here.

    Parameters
    ----------
    run : object
        With `displacement`, `probes` that have labels and positions, `done`, `interval` and `channel(name)`.
    over_time : mapping
        By the name of a channel its long name, unit and comment; _OVER_TIME are in any case.
    profiles : mapping
        By name the values of means over the judged part (place,), their long name, unit and comment.
    position, regions : (place,) arrays
        Path coordinates [m], and names of the path's regions.
    """
    import xarray as xr

    moved = attributes("displacement", "m", "transverse, outward")
    variables: dict[str, Any] = {"displacement": (("time", "probe"), run.displacement, moved)}
    for name, words in {**_OVER_TIME, **over_time}.items():
        variables[name.replace(" ", "_")] = ("time", run.channel(name), attributes(*words))
    coordinates = {
        "time": ("time", (1 + np.arange(run.done)) * run.interval, attributes("time", "s")),
        "probe": ("probe", np.array([probe.label for probe in run.probes], object), attributes("probe")),
        "probe_position": (
            "probe",
            np.array([probe.position for probe in run.probes]),
            attributes("position of the probe", "m", "path coordinate"),
        ),
    }
    return xr.Dataset(variables, coordinates).merge(along_path(profiles, position, regions))


def along_path(
    profiles: Mapping[str, tuple[np.ndarray, str, str, str]], position: np.ndarray, regions: np.ndarray
) -> xr.Dataset:
    """Quantities by `position` along the path, with the region of each place; arguments as of `dataset`."""
    import xarray as xr

    variables = {
        name: ("position", values, attributes(*named)) for name, (values, *named) in profiles.items()
    }
    words = "position", "m", "path coordinate, from the inlet of the driving arc"
    coordinates = {
        "position": ("position", position, attributes(*words)),
        "region": ("position", np.array(regions, object), attributes("region", comment="of the path")),
    }
    return xr.Dataset(variables, coordinates)


def points_at(
    path: Variator, centre_distance: float, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of the path (n, 2) [m], angles of the running direction (n,) [rad], and curvatures (n,) [1/m].

    At path coordinates `position` (n,) [m]; the centre distance is in [m].
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
    """Path coordinates (n,) of points (n, 2), below the path's length, and distances outwards (n,) [m]."""
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
