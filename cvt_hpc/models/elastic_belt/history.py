"""The history of a run of the elastic belt: quantities over time, and quantities along the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.models.elastic_belt.along_belt import (
    ELSEWHERE,
    SLIDING,
    WRAP_ANGLE,
    along_belt,
    elsewhere,
    wrap_angles,
)
from cvt_hpc.models.elastic_belt.fluctuation import at_stations
from cvt_hpc.models.elastic_belt.momentary import PREFIX, last_profiles
from cvt_hpc.netcdf import attributes
from cvt_hpc.variator import PULLEYS
from cvt_hpc.variator.history import dataset, of_means

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
        `position`; with a profile_duration also those of the last samples over `profile_time`.
    """
    over_time = {
        f"{pulley}_position": (f"{pulley} position", "m", f"axial opening of the {pulley} pulley")
        for pulley in PULLEYS
    }
    found = dataset(run, over_time, _profiles(run), run.mesh.position, run.regions)
    moment = run.channel("driving_power") / run.channel("driving_speed")
    words = "driving moment", "N m", "of the belt on the driving pulley, which the drive has to overcome"
    found = found.assign(driving_moment=("time", moment, attributes(*words)))
    momentary = last_profiles(run)
    if not momentary:
        return found
    count = len(next(iter(momentary.values()))[0])
    times = attributes("time of the profiles", "s")
    return found.assign_coords(profile_time=("profile_time", found["time"].values[-count:], times)).assign(
        {
            PREFIX + name: (("profile_time", "position"), values, attributes(*named))
            for name, (values, *named) in momentary.items()
        }
    )


def _profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str, str]]:
    """Means of the judged part at the stations, (N,): of a cell, half at either end; name, unit, comment."""
    means, fed = run.means, run.fluctuation
    dual = at_stations(run.mesh.cell)
    damping = (fed.belt + fed.rings) / dual
    sliding = along_belt(means, run.mesh, run.parameters)
    return {
        **{name: (values, *of_means(ELSEWHERE[name])) for name, values in elsewhere(means).items()},
        "flank_feed": (fed.flanks / dual, "feed by flank friction", "W m-1", FED),
        "stress_feed": (
            at_stations(fed.stresses) / dual,
            "feed by push and tension",
            "W m-1",
            FED,
        ),
        "damping_feed": (damping, "feed by damping and rings", "W m-1", f"{FED}; negative: taken"),
        "wrap_angle": (wrap_angles(run.mesh), *WRAP_ANGLE),
        **{
            name: (sliding[name], words, unit, f"{comment}; of means")
            for name, (words, unit, comment) in SLIDING.items()
        },
    }
