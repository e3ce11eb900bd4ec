"""Courses of a run: speed of the driving pulley and load over time.

Profiles are multiples of `driving_speed` and `load`, linear between their times, constant before the first
and after the last one. From there on the speed has a ripple (Cepon and Boltezar 2011, eq. 5).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.parameters import Parameter, not_negative, positive
from cvt_hpc.variator.course import load_course
from cvt_hpc.variator.scene import length_problems, multiple, nested_problems

PROFILED = ("driving_speed", "load")

PARAMETERS: dict[str, Parameter] = {
    "profile_time": Parameter(
        (), "s", "times of the profiles, ascending", minimum=0.0, sensible=(1e-4, 200.0)
    ),
    "driving_speed_profile": Parameter(
        (),
        "",
        "multiples at these times of driving_speed, 1 at last; 0 at first for a start at rest",
        minimum=0.0,
    ),
    "load_profile": Parameter((), "", "multiples at these times of load"),
    "speed_ripple": not_negative(
        0.0,
        "rad/s",
        "amplitude of a sine on driving_speed, from the last profile_time on",
        sensible=(0.01, 500.0),
    ),
    "ripple_frequency": positive(40.0, "Hz", "frequency of that sine", sensible=(0.1, 1e4)),
}


def driving_speed(parameters: Mapping[str, Any], time: float) -> float:
    """Speed of the driving pulley at a time [rad/s], in the direction in which it drives."""
    p = parameters
    since = time - (p["profile_time"][-1] if p["profile_time"] else 0.0)
    ripple = p["speed_ripple"] * np.sin(2.0 * np.pi * p["ripple_frequency"] * since) if since > 0.0 else 0.0
    return p["driving_speed"] * multiple(p, "driving_speed", time) + ripple


def load(parameters: Mapping[str, Any], time: float) -> float:
    """Load at a time [N m]: it rises smoothly within `rise_time`."""
    p = parameters
    risen = load_course.py_func(time, p["rise_time"], p["rise_time"], p["load"], p["load"])
    return risen * multiple(p, "load", time)


def course_problems(parameters: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Problems of courses, in the form of a model's check: (key, expected, found).

    Parameters
    ----------
    parameters : mapping
        Values by name [SI].
    """
    p = parameters
    times, profiles = p["profile_time"], [f"{name}_profile" for name in PROFILED if p[f"{name}_profile"]]
    if found := nested_problems(p, ("profile_time", *profiles)):
        return found
    judged = (1.0 - p["judged_fraction"]) * p["duration"] * (1.0 + 1e-9)
    if (np.diff(times) <= 0.0).any() or (times and times[-1] > judged):
        expected = f"ascending times until the run is judged, up to {judged:g} s"
        return [("profile_time", expected, f"{list(times)}")]
    found = length_problems(p, ("profile_time", *profiles)) if profiles else []
    last = p["driving_speed_profile"][-1:]
    if not found and last not in ((), (1.0,)):
        expected = "1 at last, since driving_speed is that of the judged part"
        found.append(("driving_speed_profile", expected, f"{last[0]:g}"))
    return found


def course_inert(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Parameters of courses without effect, each with the setting that makes it so."""
    return {"ripple_frequency": "speed_ripple 0"} if parameters["speed_ripple"] == 0.0 else {}
