"""Courses of a run: speed of the driving pulley and load over time.

Profiles are multiples of `driving_speed` and `load`, linear between their times, constant before the first
and after the last one. From there on the speed has a ripple (Cepon and Boltezar 2011, eq. 5).

The belt's own length gives its tension at rest, with belt and contacts in series along the path. At a tension
T the belt is longer by the factor x with EA (x^2 - 1) x / 2 = T, and the contacts sink in by T / (R k) on
each arc, which shortens the path.
"""

import numpy as np
from scipy.optimize import brentq

from cvt_hpc.models.belt_drive.layout import PULLEY_LISTS, TENSIONER, TWO, layout, layout_problems
from cvt_hpc.parameters import Parameter, Parameters, Problem, Substitute, not_negative, positive
from cvt_hpc.physics.belt_path import BeltPath
from cvt_hpc.variator.course import load_course
from cvt_hpc.variator.profiles import multiple
from cvt_hpc.variator.scene import length_problems, nested_problems

_MOST_STRAIN = 0.5  # tension over axial_stiffness

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


def driving_speed(parameters: Parameters, time: float) -> float:
    """Speed of the driving pulley at a time [rad/s], in the direction in which it drives."""
    p = parameters
    since = time - (p["profile_time"][-1] if p["profile_time"] else 0.0)
    ripple = p["speed_ripple"] * np.sin(2.0 * np.pi * p["ripple_frequency"] * since) if since > 0.0 else 0.0
    return p["driving_speed"] * multiple(p, "driving_speed", time) + ripple


def load(parameters: Parameters, time: float) -> float:
    """Load at a time [N m]: it rises smoothly within `rise_time`."""
    p = parameters
    risen = load_course.py_func(time, p["rise_time"], p["rise_time"], p["load"], p["load"])
    return risen * multiple(p, "load", time)


def course_problems(parameters: Parameters) -> list[Problem]:
    """Problems of courses, in the form of a model's check: (key, expected, found)."""
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


def course_inert(parameters: Parameters) -> dict[str, str]:
    """Parameters of courses without effect, each with the setting that makes it so."""
    return {"ripple_frequency": "speed_ripple 0"} if parameters["speed_ripple"] == 0.0 else {}


def stretch(tension: float, stiffness: float) -> float:
    """Length under a tension over that without: the root of EA (x^2 - 1) x / 2 = T."""
    x = 1.0 + tension / stiffness
    for _ in range(20):
        x -= (0.5 * (x**2 - 1.0) * x - tension / stiffness) / (1.5 * x**2 - 0.5)
    return x


def contact_compliance(path: BeltPath, contact_stiffness: float) -> float:
    """Return by how much the contacts shorten a path for each newton of tension [m/N]."""
    return float((path.wrap / path.radius).sum()) / contact_stiffness


def length_at(path: BeltPath, tension: float, parameters: Parameters) -> float:
    """Length without load of the belt that has a tension [N] on a path, nearly [m]."""
    shortened = path.path_length - contact_compliance(path, parameters["contact_stiffness"]) * tension
    return shortened / stretch(tension, parameters["axial_stiffness"])


def _tension(parameters: Parameters) -> float:
    """Tension [N] that the belt of `free_length` has."""
    p = parameters
    if layout_problems(p):
        return 0.0  # which nobody reads: they are told first
    path, most = layout(p).path, _MOST_STRAIN * p["axial_stiffness"]
    shortest = length_at(path, most, p)
    if not shortest < p["free_length"] < path.path_length:
        expected = f"more than {shortest:.6g} m, at half of axial_stiffness, and less than the path's"
        raise ValueError(f"{expected} {path.path_length:.6g} m")
    return float(brentq(lambda tension: length_at(path, tension, p) - p["free_length"], 0.0, most, xtol=1e-9))


def free_length() -> Parameter:
    """The parameter that gives the preload by the belt's own length."""
    needs = (*TWO, *PULLEY_LISTS, *TENSIONER, "axial_stiffness", "contact_stiffness")
    return positive(
        None,
        "m",
        "length of the belt without load, in the place of tension, which follows",
        gives=Substitute("tension", needs, _tension),
        sensible=(0.1, 50.0),
    )
