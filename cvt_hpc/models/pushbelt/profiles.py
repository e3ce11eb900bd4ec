"""Profiles: prescribed values over time as multiples of the job's, such as a shift or a load cycle.

Between the times of a profile multiples are linear, before the first and after the last they are constant.
"""

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters
from cvt_hpc.variator.scene import course_problems, nested_problems

PROFILED = ("load", "driving_speed", "thrust", "driving_thrust", "ratio")
_WHAT = {
    "load": "load",
    "driving_speed": "driving_speed",
    "thrust": "thrust",
    "driving_thrust": "driving_thrust",
    "ratio": "ratio, by the position of the driving sheave, which moves; from 1 on",
}

PARAMETERS: dict[str, Parameter] = {
    "profile_time": Parameter(
        (), "s", "times of the profiles, ascending from rise_time on", sensible=(1e-4, 200.0)
    ),
    **{
        f"{name}_profile": Parameter((), "", f"multiples at these times of {what}")
        for name, what in _WHAT.items()
    },
}


def extremes(parameters: Parameters, name: str) -> tuple[float, float]:
    """Least and greatest value of one of PROFILED along the run."""
    multiples = parameters[f"{name}_profile"] or (1.0,)
    values = [parameters[name] * value for value in (min(multiples), max(multiples))]
    return min(values), max(values)


def ratios_along(parameters: Parameters) -> list[float]:
    """The ratio first, then the least and greatest along its profile if that has an effect."""
    ratio, others = parameters["ratio"], extremes(parameters, "ratio")
    return [ratio, *(other for other in others if other != ratio and parameters["driving_thrust"] == 0.0)]


def profile_problems(parameters: Parameters) -> list[tuple[str, str, str]]:
    """Problems of courses in time, in the form of a model's check: (key, expected, found).

    Parameters
    ----------
    parameters : mapping
        Values by name [SI].
    """
    p, found = parameters, course_problems(parameters)
    profiles = {name: p[f"{name}_profile"] for name in PROFILED if p[f"{name}_profile"]}
    times = p["profile_time"]
    if not (profiles or times):
        return found
    if wrong := nested_problems(p, ("profile_time", *(f"{name}_profile" for name in profiles))):
        return wrong
    judged = (1.0 - p["judged_fraction"]) * p["duration"] * (1.0 + 1e-9)
    inside = [p["rise_time"], *times, judged]
    if not times or any(np.diff(times) <= 0.0) or any(np.diff(inside) < 0.0):
        expected = (
            f"ascending times from rise_time on, until the run is judged, {inside[0]:g} to {judged:g} s"
        )
        found.append(("profile_time", expected, f"{list(times)}"))
    for name, values in profiles.items():
        if len(values) != len(times):
            expected = f"as many values as profile_time has, {len(times)}"
            found.append((f"{name}_profile", expected, f"{len(values)}"))
        elif name != "load" and min(values) <= 0.0:
            found.append((f"{name}_profile", "multiples above 0", f"{min(values):g}"))
    ramps = [key for key in ("load_history", "speed_history") if p[key] == "ramp"]
    found += [(key, "constant where there are profiles", "ramp") for key in ramps]
    first = profiles.get("ratio", (1.0,))[0]
    if first != 1.0:
        found.append(("ratio_profile", "1 at first: a run begins at its ratio", f"{first:g}"))
    return found


def profile_inert(parameters: Parameters) -> dict[str, str]:
    """Profiles without effect, each with the setting that makes it so."""
    if parameters["driving_thrust"] > 0.0:
        return {"ratio_profile": "driving_thrust above 0"}
    return {"driving_thrust_profile": "driving_thrust 0"}
