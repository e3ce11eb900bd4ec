"""What a job may set of the pulleys' freedom and of their shafts; by default they are as they always were.

No paper gives numbers of these: every default is an assumption, plausible and not measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cvt_hpc.parameters import Parameter, Substitute, not_negative, positive
from cvt_hpc.physics import capacity

FORCES, LENGTHS = (1.0, 2e6), (1e-4, 2.0)


def piston_area(piston: tuple[float, ...]) -> float:
    """Area [m^2] of a piston by its inner and outer radius [m]."""
    inner, outer = piston
    return np.pi * (outer * outer - inner * inner)


def oil_factor(piston: tuple[float, ...], density: float) -> float:
    """C [N s^2] of the force C omega^2 of oil that turns with its cylinder.

    With the pressure p + rho omega^2 r^2 / 2 of oil that is fed on the axis, F = integral of 2 pi r dr over
    the piston: C = pi rho / 4 (outer^4 - inner^4).
    """
    if not piston:
        return 0.0
    inner, outer = piston
    return 0.25 * np.pi * density * (outer**4 - inner**4)


def _pressed(pulley: str) -> Substitute:
    def thrust(parameters: Mapping[str, Any]) -> float:
        piston = parameters[f"{pulley}_piston"]
        if len(piston) != 2:
            raise ValueError(f"{pulley}_piston beside it, the radii of the piston")
        return piston_area(piston) * parameters[f"{pulley}_pressure"] + parameters[f"{pulley}_spring_force"]

    key = "thrust" if pulley == "driven" else "driving_thrust"
    return Substitute(key, (f"{pulley}_piston", f"{pulley}_spring_force"), thrust)


def _of_each(make: Any) -> dict[str, Parameter]:
    return {key: value for pulley in ("driving", "driven") for key, value in make(pulley).items()}


def _axial(pulley: str) -> dict[str, Parameter]:
    return {
        f"{pulley}_piston": Parameter(
            (), "m", f"inner and outer radius of the {pulley} pulley's piston; none: its oil has no weight",
            minimum=0.0, sensible=LENGTHS,
        ),
        f"{pulley}_pressure": Parameter(
            None,
            "Pa",
            f"of the {pulley} pulley's oil, in the place of its thrust, which follows with its spring",
            minimum=0.0,
            gives=_pressed(pulley),
            sensible=(1e3, 1e9),
        ),
        f"{pulley}_spring_force": not_negative(
            0.0, "N", f"of the {pulley} pulley's spring where it is not shifted, beside a pressure", FORCES
        ),
        f"{pulley}_spring_rate": not_negative(
            0.0, "N/m", f"stiffness of the {pulley} pulley's spring", (1.0, 1e9)
        ),
    }  # fmt: skip


DRIVEN_INERTIA = replace(
    positive(
        0.02,
        "kg m^2",
        "moment of inertia of the driven pulley; inf: it keeps the speed that it has without load",
        sensible=(1e-05, 100.0),
    ),
    allow_infinite=True,
)

PULLEYS: dict[str, Parameter] = {
    "driving_inertia": replace(
        positive(
            np.inf, "kg m^2", "moment of inertia of the driving pulley and its drive; inf: its speed is given"
        ),
        allow_infinite=True,
        sensible=(1e-05, np.inf),
    ),
    "drive_slope": not_negative(
        0.0,
        "N m s/rad",
        "torque by which the drive falls off as the driving pulley gets faster than driving_speed",
        (1e-3, 1e5),
    ),
    "driving_axial": Parameter(
        "position",
        "",
        "driving pulley: its opening is given, or its thrust, or a controller holds the ratio by its thrust",
        choices=("position", "thrust", "ratio"),
    ),
    "driving_thrust": positive(
        60e3, "N", "axial force on the driving pulley, from rise_time on", sensible=(500.0, 2000000.0)
    ),
    "ratio_gain": not_negative(30e3, "N", "controller: driving thrust per deviation of the ratio", FORCES),
    "ratio_rate": not_negative(
        300e3, "N/s", "controller: rate of the driving thrust per deviation of the ratio", (1.0, 1e9)
    ),
    "clamping": Parameter(
        "constant",
        "",
        "driven pulley: its thrust is constant, or a controller holds the torque ratio by it",
        choices=("constant", "torque_ratio"),
    ),
    "held_torque_ratio": Parameter(
        0.6,
        "",
        "torque ratio to be held: load over what friction carries at the lesser axial force",
        minimum=-1.0,
        maximum=1.0,
        exclusive=True,
    ),
    "clamping_gain": not_negative(0.5, "", "controller: driven thrust per axial force that is lacking"),
    "clamping_rate": not_negative(
        50.0, "1/s", "controller: rate of the driven thrust per axial force that is lacking", (1e-3, 1e5)
    ),
    "least_thrust": not_negative(2e3, "N", "least thrust that a controller sets", FORCES),
    "most_thrust": positive(100e3, "N", "largest thrust that a controller sets", sensible=FORCES),
    **_of_each(_axial),
    "oil_density": positive(850.0, "kg/m^3", "density of the oil behind the pistons", sensible=(100.0, 1e4)),
    "tilt_lag": not_negative(
        0.0, "s", "time constant T1 of the movable sheaves' tilt; 0: it follows at once", (1e-6, 1.0)
    ),
    "collar_clearance": not_negative(
        0.0, "rad", "angle by which the collar of a movable sheave tilts before it bears", (1e-7, 0.1)
    ),
    "bearing_clearance": not_negative(
        0.0, "m", "radial clearance of the shafts' bearings", (1e-8, 0.01)
    ),
}  # fmt: skip

SHAFT: dict[str, Parameter] = {
    "shaft_lengths": Parameter(
        (),
        "m",
        "lengths of a shaft's sections, of both pulleys; none: tilt_stiffness includes its bending",
        minimum=0.0,
        exclusive=True,
        sensible=LENGTHS,
    ),
    "shaft_diameters": Parameter(
        (), "m", "diameters of these sections", minimum=0.0, exclusive=True, sensible=LENGTHS
    ),
    "shaft_modulus": positive(2.1e11, "Pa", "Young's modulus of the shafts", sensible=(1e9, 1e13)),
    "shaft_factor": replace(
        positive(1.0, "", "factor on the stiffness of shaft and bearings; inf: rigid"), allow_infinite=True
    ),
    "seat_positions": Parameter(
        (), "m", "where the fixed and the movable sheave sit along the shaft", minimum=0.0, sensible=LENGTHS
    ),
    "bearing_positions": Parameter(
        (), "m", "where the two bearings sit along the shaft", minimum=0.0, sensible=LENGTHS
    ),
    "bearing_stiffness": replace(
        positive(2e8, "N/m", "radial stiffness of a bearing", sensible=(1e5, 1e12)), allow_infinite=True
    ),
}  # fmt: skip

PULLEY_DEFAULTS = {
    key: parameter.default
    for table in (PULLEYS, SHAFT)
    for key, parameter in table.items()
    if parameter.gives is None
}


def are_free(parameters: Mapping[str, Any]) -> bool:
    """Whether pulleys do more than turn by a given speed, or be pressed by a constant thrust."""
    p = PULLEY_DEFAULTS | dict(parameters)
    return bool(
        np.isfinite(p["driving_inertia"])
        or np.isinf(p["driven_inertia"])
        or p["driving_axial"] != "position"
        or p["clamping"] != "constant"
        or p["driven_spring_rate"] > 0.0
        or p["driven_piston"]
        or p["tilt_lag"] > 0.0
    )


Problem = tuple[str, str, str]  # key, expected, found


def shaft_problems(parameters: Mapping[str, Any]) -> list[Problem]:
    """Problems of a shaft, in the form of a model's check."""
    p = PULLEY_DEFAULTS | dict(parameters)
    lengths, diameters = p["shaft_lengths"], p["shaft_diameters"]
    if len(lengths) != len(diameters):
        return [("shaft_diameters", f"one for each of {len(lengths)} shaft_lengths", str(len(diameters)))]
    if not lengths:
        return []
    total = sum(lengths)
    for key, what in (("bearing_positions", "bearings"), ("seat_positions", "sheaves")):
        places = p[key]
        found = ", ".join(f"{place:g} m" for place in places) or "none"
        if len(places) != 2 or places[0] == places[1] or max(places) > total * (1.0 + 1e-9):
            expected = f"two {what} at different places of the shaft, 0 to {total:g} m"
            return [(key, expected, found)]
    return []


def pulley_problems(parameters: Mapping[str, Any]) -> list[Problem]:
    """Problems of the pulleys' freedom, in the form of a model's check."""
    p = PULLEY_DEFAULTS | dict(parameters)
    found = _piston_problems(p) + _drive_problems(p)
    if p["tilt_lag"] == 0.0:
        for key in ("collar_clearance", "bearing_clearance"):
            if p[key] > 0.0:
                expected = "0, or a tilt_lag: a sheave is within its clearance for a time only"
                found.append((key, expected, f"{p[key]:g}"))
    if p["bearing_clearance"] > 0.0 and not p["shaft_lengths"]:
        found.append(("bearing_clearance", "0, or shaft_lengths", f"{p['bearing_clearance']:g} m"))
    return found + _controller_problems(p)


def _piston_problems(p: Mapping[str, Any]) -> list[Problem]:
    found = []
    for pulley in ("driving", "driven"):
        piston = p[f"{pulley}_piston"]
        if piston and (len(piston) != 2 or piston[0] >= piston[1]):
            listed = ", ".join(f"{radius:g} m" for radius in piston)
            found.append((f"{pulley}_piston", "an inner and a larger outer radius", listed))
    return found


def _drive_problems(p: Mapping[str, Any]) -> list[Problem]:
    has_given = [np.isinf(p[f"{pulley}_inertia"]) for pulley in ("driving", "driven")]
    if all(has_given):
        return [("driven_inertia", "finite, or a finite driving_inertia: one speed follows", "both inf")]
    if p.get("speed_history") == "ramp" and has_given != [True, False]:
        return [("speed_history", "constant where the driving pulley's speed is not given", "ramp")]
    return []


def _controller_problems(p: Mapping[str, Any]) -> list[Problem]:
    found: list[Problem] = []
    if p["least_thrust"] >= p["most_thrust"]:
        expected = f"less than most_thrust = {p['most_thrust']:g} N"
        found.append(("least_thrust", expected, f"{p['least_thrust']:g} N"))
    if p["clamping"] != "torque_ratio":
        return found
    starts = (p["load_start"],) if p.get("load_history") == "ramp" else ()
    loads = [load for load in (*starts, p["load"]) if load]
    if p["held_torque_ratio"] == 0.0 or any(load * p["held_torque_ratio"] < 0.0 for load in loads):
        listed = ", ".join(f"{load:g} N m" for load in loads) or "any"
        found.append(("held_torque_ratio", f"the sign of the load, {listed}", f"{p['held_torque_ratio']:g}"))
        return found
    share = abs(p["held_torque_ratio"])
    most = capacity.carried_torque(dict(p) | {"thrust": p["most_thrust"]}) * share
    expected = f"at most {most:.4g} N m, which most_thrust carries at held_torque_ratio {share:g}"
    return found + [("load", expected, f"{load:g} N m") for load in loads if abs(load) > most][:1]


def pulley_inert(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Settings of pulleys without effect, each with the setting that makes it so."""
    p = PULLEY_DEFAULTS | dict(parameters)
    controlled = p["driving_axial"] == "ratio", p["clamping"] == "torque_ratio"
    cases = (
        (np.isinf(p["driving_inertia"]), ("drive_slope",), "driving_inertia inf"),
        (p["driving_axial"] != "thrust", ("driving_thrust",), f"driving_axial {p['driving_axial']}"),
        (p["driving_axial"] == "position", ("driving_spring_rate",), "driving_axial position"),
        (not controlled[0], ("ratio_gain", "ratio_rate"), f"driving_axial {p['driving_axial']}"),
        (not controlled[1], ("held_torque_ratio", "clamping_gain", "clamping_rate"), "clamping constant"),
        (not any(controlled), ("least_thrust", "most_thrust"), "no controller"),
        (not p["driving_piston"] and not p["driven_piston"], ("oil_density",), "no piston"),
        (
            not p["shaft_lengths"],
            ("shaft_modulus", "shaft_factor", "bearing_stiffness", "seat_positions", "bearing_positions"),
            "no shaft_lengths",
        ),
    )
    return {key: setting for holds, keys, setting in cases if holds for key in keys}
