"""The history of a run of the elastic belt: what moves over time, and what is where along the path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.elastic_belt.fluctuation import at_stations

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun


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
        "load": ("N m", "torque at the driving pulley"),
        "driving_speed": ("rad s-1", "speed of the driving pulley"),
        "driven_speed": ("rad s-1", "speed of the driven pulley"),
        "driven_position": ("m", "axial opening of the driven pulley"),
    }
    variables: dict[str, Any] = {
        "displacement": (
            ("time", "probe"),
            run.displacement,
            {"units": "m", "long_name": "transverse displacement, outward"},
        )
    }
    for name, (units, long_name) in over_time.items():
        variables[name] = ("time", run.channel(name), {"units": units, "long_name": long_name})
    for name, (values, units, long_name) in _profiles(run).items():
        variables[name] = ("position", values, {"units": units, "long_name": long_name})
    coordinates = {
        "time": ("time", time, {"units": "s", "long_name": "simulated time"}),
        "probe": ("probe", np.array([probe.label for probe in run.probes], object), {"long_name": "probe"}),
        "probe_position": (
            "probe",
            np.array([probe.position for probe in run.probes]),
            {"units": "m", "long_name": "path coordinate of the probe"},
        ),
        "position": (
            "position",
            run.mesh.position,
            {"units": "m", "long_name": "path coordinate, from the inlet of the driving arc"},
        ),
        "region": ("position", np.array(run.regions, object), {"long_name": "region of the path"}),
    }
    return xr.Dataset(variables, coordinates)


def _profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str]]:
    """Means of the judged part at the stations, (N,), units and long name; of a cell, half at either end."""
    means, fed = run.means, run.fluctuation
    dual = at_stations(run.mesh.cell)
    damping = (fed.belt + fed.rings) / dual
    return {
        "ring_tension": (at_stations(means["ring_tension"]), "N", "mean ring tension"),
        "push_force": (at_stations(means["push_force"]), "N", "mean push force between elements"),
        "contact_force": (means["contact_force"], "N m-1", "mean axial line force of one flank"),
        "mean_displacement": (
            means["mean_displacement"],
            "m",
            "mean displacement off the reference path, outward",
        ),
        "flank_feed": (fed.flanks / dual, "W m-1", "power that flank friction feeds into the fluctuation"),
        "stress_feed": (
            at_stations(fed.stresses) / dual,
            "W m-1",
            "power that push and tension feed into the fluctuation",
        ),
        "damping_feed": (damping, "W m-1", "power of the belt's damping and of ring friction in it"),
    }
