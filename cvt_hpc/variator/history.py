"""The history of a run of a variator as a dataset: quantities over time, and quantities along the path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.netcdf import attributes

if TYPE_CHECKING:
    import xarray as xr

OVER_TIME = {
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

    Parameters
    ----------
    run : object
        With `displacement`, `probes` that have labels and positions, `done`, `interval` and `channel(name)`.
    over_time : mapping
        By the name of a channel its long name, unit and comment; OVER_TIME are in any case.
    profiles : mapping
        By name the values of means over the judged part (place,), their long name, unit and comment.
    position : (place,) array
        Path coordinates [m].
    regions : (place,) array of str
        Of the path.

    Returns
    -------
    Dataset
        With `displacement` (time, probe) [m]. A blank in the name of a channel is an underscore here.
    """
    import xarray as xr

    moved = attributes("displacement", "m", "transverse, outward")
    variables: dict[str, Any] = {"displacement": (("time", "probe"), run.displacement, moved)}
    for name, words in {**OVER_TIME, **over_time}.items():
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
