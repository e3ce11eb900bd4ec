"""The history of a run of the elastic belt: quantities over time, and quantities along the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.models.elastic_belt import along_belt as along
from cvt_hpc.models.elastic_belt.along_belt import PRECISION, WORDS
from cvt_hpc.models.elastic_belt.fluctuation import at_stations
from cvt_hpc.storage.netcdf import attributes
from cvt_hpc.variator import PULLEYS
from cvt_hpc.variator.history import dataset, of_means

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun

FED = "power into the fluctuation of the belt"
PREFIX = "momentary_"  # of the names of quantities over time and position


def histories(run: RecordedRun) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed, as far as it has samples.

    `displacement` (time, probe) [m], scalars over time, and the profiles of the judged part by `position`;
    with a profile_duration also those of the last samples over `profile_time`.
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
    sliding = along.along_belt(means, run.mesh, run.parameters)
    return {
        **{
            name: (values, *of_means(along.ELSEWHERE[name]))
            for name, values in along.elsewhere(means, run.mesh).items()
        },
        "flank_feed": (fed.flanks / dual, "feed by flank friction", "W m-1", FED),
        "stress_feed": (at_stations(fed.stresses) / dual, "feed by push and tension", "W m-1", FED),
        "damping_feed": (damping, "feed by damping and rings", "W m-1", f"{FED}; negative: taken"),
        "wrap_angle": (along.wrap_angles(run.mesh), *along.WRAP_ANGLE),
        **{
            name: (sliding[name], words, unit, f"{comment}; of means")
            for name, (words, unit, comment) in along.SLIDING.items()
        },
    }


def last_profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str, str]]:
    """Quantities of WORDS over the last samples of a run as far as it came, (sample, N), with their words.

    Empty where its profiles are not kept, or the run ended before them.
    """
    kept = run.momentary
    if kept is None or (count := len(kept) - (run.samples - run.done)) <= 0:
        return {}
    sample = dict(zip(along.NEEDED, kept[:count].transpose(1, 0, 2), strict=True))
    samples = slice(run.done - count, run.done)
    # speeds are counted from the course of the driving speed, which is constant where the drive has inertia
    is_given = np.isinf(run.parameters["driving_inertia"])
    course = run.channel("driving_speed")[samples, None] if is_given else run.parameters["driving_speed"]
    belt_speed = course * run.path.driving_radius
    lengthened = 1.0 + along.curvature_at_stations(run.mesh) * sample["mean_displacement"]
    found = along.elsewhere(sample, run.mesh) | along.along_belt(sample, run.mesh, run.parameters)
    found["element_speed"] = (belt_speed + sample["element_speed"]) / lengthened
    return {name: (found[name].astype(PRECISION), *words) for name, words in WORDS.items()}
