"""Parameters of a variator in every model of it: the scene, the friction of the flanks, damping.

Only ratio, driving_speed and thrust of the defaults are from a paper (Lebrecht et al. 2004, sec. 3.1); sizes
are those of a common passenger-car belt; seven were fitted to what that paper states of the noise, as
jobs/lebrecht_2004.toml says; every other default is an assumption, plausible and not measured.

The measures of a scene are its size beside the default one: limits with a unit scale with it, whatever its
units are.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters, Problem, Substitute, not_negative, positive
from cvt_hpc.physics import capacity
from cvt_hpc.physics.friction_laws import FRICTION_LAWS, friction_file
from cvt_hpc.physics.geometry import driven_radius


def _closing_radius(parameters: Parameters) -> float:
    return driven_radius(*(parameters[key] for key in ("ratio", "belt_length", "centre_distance")))


SCENE: dict[str, Parameter] = {
    "ratio": positive(2.52, "", "speed ratio, driven radius / driving radius (Lebrecht 2004: LOW stop)"),
    "driven_radius": positive(0.075, "m", "pitch radius on the driven pulley", (0.01, 0.5)),
    "belt_length": positive(
        None,
        "m",
        "length of the closed pitch line, in the place of driven_radius, which follows at each ratio",
        gives=Substitute("driven_radius", ("ratio", "centre_distance"), _closing_radius),
        sensible=(0.1, 5.0),
    ),
    "centre_distance": positive(0.155, "m", "distance of the shafts", (0.03, 2.0)),
    "driving_speed": positive(
        3000.0 * np.pi / 30.0,
        "rad/s",
        "speed of the driving pulley, prescribed; at the end of a ramp",
        (1.0, 800.0),
    ),
    "thrust": positive(50e3, "N", "axial force on the driven pulley", (500.0, 2e6)),
    "load": Parameter(
        0.0,
        "N m",
        "torque at the driving pulley; the driven one is loaded by ratio x load",
        sensible=(0.5, 2000.0),
    ),
    "load_share": Parameter(
        None,
        "",
        "torque ratio, load over the torque that friction carries, in the place of load, which follows",
        minimum=-1.0,
        maximum=1.0,
        exclusive=True,
        gives=Substitute("load", capacity.NEEDS, capacity.shared_load),
    ),
    "load_history": Parameter(
        "constant",
        "",
        "load is reached within rise_time and kept, or rises from load_start over the whole run",
        choices=("constant", "ramp"),
    ),
    "load_start": Parameter(0.0, "N m", "load at the start of a ramp", sensible=(0.5, 2000.0)),
    "speed_history": Parameter(
        "constant",
        "",
        "driving_speed is kept, or the driving pulley goes to it from speed_start over the whole run",
        choices=("constant", "ramp"),
    ),
    "speed_start": positive(
        1000.0 * np.pi / 30.0, "rad/s", "speed of the driving pulley at the start of a ramp", (1.0, 800.0)
    ),
    "rise_time": positive(
        0.03, "s", "start-up: load rises smoothly, extra damping of the belt fades out", (1e-4, 10.0)
    ),
    "disturbance": not_negative(
        1e-6, "m", "largest random displacement of the strands, given to them at rise_time", (1e-12, 0.01)
    ),
    "seed": Parameter(1, "", "seed of that disturbance", minimum=0),
}


def rise_problems(p: Parameters) -> list[Problem]:
    """Problems of a load that rises, in the form of a model's check: (key, expected, found).

    Of the parameters [SI] `rise_time`, `duration` and `judged_fraction` count.
    """
    before = (1.0 - p["judged_fraction"]) * p["duration"]
    if p["rise_time"] <= before * (1.0 + 1e-9):
        return []
    expected = f"a load that has risen before the run is judged, within {before:g} s"
    return [("rise_time", expected, f"{p['rise_time']:g} s")]


def course_problems(parameters: Parameters) -> list[Problem]:
    """Problems of a run's courses of load and speed, in the form of a model's check: (key, expected, found).

    Of the parameters [SI] those of SCENE, `duration` and `judged_fraction` count.
    """
    p, problems = parameters, rise_problems(parameters)
    if p["load_history"] == p["speed_history"] == "ramp":
        problems.append(("speed_history", 'constant under load_history = "ramp": one ramp a run', "ramp"))
    return problems


def course_inert(p: Parameters) -> dict[str, str]:
    """Parameters of courses that are constant, each with the setting that makes it without effect."""
    return {
        f"{name}_start": f"{name}_history constant"
        for name in ("load", "speed")
        if p[f"{name}_history"] == "constant"
    }


FRICTION: dict[str, Parameter] = {
    "friction_law": Parameter(
        "stribeck", "", "friction of the flanks over sliding speed", choices=FRICTION_LAWS
    ),
    "friction_gradient": Parameter(
        -0.8,
        "s/m",
        "slope dmu/dv of the friction law at v -> 0+, its steepest fall, without regularisation",
        maximum=0.0,
        sensible=(1e-3, 100.0),
    ),
    "kinetic_friction": positive(0.1, "", "the level that does not change with the gradient"),
    "stribeck_velocity": positive(0.05, "m/s", "speed scale of the fall", (1e-4, 10.0)),
    "friction_speed": positive(0.017, "m/s", "regularisation speed of the flanks' friction", (1e-6, 5.0)),
    "friction_memory": not_negative(
        0.18e-3, "s", "time constant of the filtered sliding speed; 0: no memory", (1e-7, 0.1)
    ),
    "table_file": friction_file("N/m"),
    "table_force": Parameter(
        (), "N/m", "normal line forces of a friction table, ascending", sensible=(1.0, 1e8)
    ),
    "table_speed": Parameter((), "m/s", "speeds of a friction table, ascending", sensible=(1e-7, 100.0)),
    "table_mu": Parameter((), "", "friction table: a row of coefficients for each force"),
}

TRANSVERSE_DAMPING = not_negative(1000.0, "N s/m^2", "viscous damping of the transverse motion", (0.1, 1e6))

RINGS: dict[str, Parameter] = {
    "bending_stiffness": not_negative(
        0.5, "N m^2", "EI of the belt against leaving its path's curvature", (1e-4, 1000.0)
    ),
    "reference_tension": not_negative(
        5300.0, "N", "ring tension at which the rings fit the reference path", (10.0, 1e6)
    ),
    "ring_damping": not_negative(4.0, "N s", "longitudinal damping of the rings", (1e-3, 1e5)),
}

# Of an element on its rings, whose saddle is ring_offset above the pitch line
TILT: dict[str, Parameter] = {
    "tilt_spring": not_negative(
        3267.0,
        "N",
        "stiffness of the elements' tilt against the rings, moment by angle and length",
        (1.0, 1e9),
    ),
    "tilt_damper": not_negative(
        0.03267,
        "N s",
        "damping of the elements' tilt against the rings, moment by angular velocity and length",
        (1e-6, 1e6),
    ),
}

TILT_LAG: dict[str, Parameter] = {
    "tilt_lag": not_negative(
        0.6e-3, "s", "time constant T1 of the movable sheaves' tilt; 0: it follows at once", (1e-6, 1.0)
    ),
}

HALF_WEDGE_ANGLE = Parameter(
    np.deg2rad(11.0),
    "rad",
    "half wedge angle of the groove",
    minimum=0.0,
    maximum=1.0,
    exclusive=True,
    sensible=(0.02, 0.8),
)


def nested(values: Sequence[Any]) -> bool:
    """Whether values are lists in their turn."""
    return any(isinstance(value, Sequence) for value in values)


def nested_problems(parameters: Parameters, keys: Iterable[str]) -> list[Problem]:
    """The first list whose values are no numbers, in the form of a model's check: (key, expected, found)."""
    for key in keys:
        if nested(parameters[key]):
            return [(key, "a list of numbers", f"{list(parameters[key])}")]
    return []


def length_problems(parameters: Parameters, keys: Sequence[str]) -> list[Problem]:
    """Lists that are missing beside others, or not as long as most of them: (key, expected, found)."""
    lengths = {key: len(parameters[key]) for key in keys}
    usual = Counter(filter(None, lengths.values())).most_common(1)[0][0]
    first = next(key for key, length in lengths.items() if length == usual)
    expected = f"as many values as {first} has, {usual}"
    return [(key, expected, f"{length or 'none'}") for key, length in lengths.items() if length != usual]


class Measures(NamedTuple):
    """A scene's thrust, time of a radian of the driving pulley, and distance of shafts over the default's."""

    force: float
    time: float
    length: float


def measures(p: Parameters) -> Measures:
    """Measures of a scene, by flat values [SI] of a run: all 1 for the default one."""
    thrust, speed, distance = (
        p[key] / SCENE[key].default for key in ("thrust", "driving_speed", "centre_distance")
    )
    return Measures(thrust, 1.0 / speed, distance)


def rounded(share: float) -> float:
    """The power of 2 next to a share: for limits of rounding, of which the order of magnitude counts.

    Scenes that differ by powers of 2 in their units alone then have the same digits to the last.
    """
    return float(2.0 ** np.rint(np.log2(share)))
