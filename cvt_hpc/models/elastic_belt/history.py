"""The history of a run of the elastic belt: what moves over time, and what is where along the path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.elastic_belt.fluctuation import at_stations
from cvt_hpc.netcdf import attributes

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun

FED = "power into the fluctuation of the belt"


def histories(run: RecordedRun) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed.

    Parameters
    ----------
    run : RecordedRun
        With the samples that it has.

    Returns
    -------
    Dataset
        `displacement` (time, probe) [m], scalars over time, and the profiles of the judged part by
        `position`.
    """
    import xarray as xr

    time = (1 + np.arange(run.done)) * run.interval
    over_time = {
        "load": ("load", "N m", "torque at the driving pulley"),
        "driving_speed": ("driving speed", "rad s-1", "of the driving pulley"),
        "driven_speed": ("driven speed", "rad s-1", "of the driven pulley"),
        "driven_position": ("driven position", "m", "axial opening of the driven pulley"),
    }
    variables: dict[str, Any] = {
        "displacement": (
            ("time", "probe"),
            run.displacement,
            attributes("displacement", "m", "transverse, outward"),
        )
    }
    for name, named in over_time.items():
        variables[name] = ("time", run.channel(name), attributes(*named))
    for name, (values, *words) in _profiles(run).items():
        variables[name] = ("position", values, attributes(*words))
    coordinates = {
        "time": ("time", time, attributes("time", "s")),
        "probe": ("probe", np.array([probe.label for probe in run.probes], object), attributes("probe")),
        "probe_position": (
            "probe",
            np.array([probe.position for probe in run.probes]),
            attributes("position of the probe", "m", "path coordinate"),
        ),
        "position": (
            "position",
            run.mesh.position,
            attributes("position", "m", "path coordinate, from the inlet of the driving arc"),
        ),
        "region": ("position", np.array(run.regions, object), attributes("region", comment="of the path")),
    }
    return xr.Dataset(variables, coordinates)


def _profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str, str]]:
    """Means of the judged part at the stations, (N,): of a cell, half at either end; name, unit, comment."""
    means, fed = run.means, run.fluctuation
    dual = at_stations(run.mesh.cell)
    damping = (fed.belt + fed.rings) / dual
    return {
        "ring_tension": (at_stations(means["ring_tension"]), "ring tension", "N", "mean"),
        "push_force": (at_stations(means["push_force"]), "push force", "N", "mean, between elements"),
        "contact_force": (
            means["contact_force"],
            "contact force",
            "N m-1",
            "mean axial line force of one flank",
        ),
        "mean_displacement": (
            means["mean_displacement"],
            "mean displacement",
            "m",
            "off the reference path, outward",
        ),
        "flank_feed": (fed.flanks / dual, "feed by flank friction", "W m-1", FED),
        "stress_feed": (
            at_stations(fed.stresses) / dual,
            "feed by push and tension",
            "W m-1",
            FED,
        ),
        "damping_feed": (damping, "feed by damping and rings", "W m-1", f"{FED}; negative: taken"),
    }
