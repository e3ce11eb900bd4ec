"""Conflicts between the pulleys' settings, and settings without effect."""

import numpy as np

import cvt_hpc.models.elastic_belt.pulley_settings as settings
from cvt_hpc.parameters import Parameters, Problem
from cvt_hpc.physics import capacity
from cvt_hpc.physics.friction_laws import largest_friction
from cvt_hpc.physics.geometry import variator, variator_problems
from cvt_hpc.physics.sheaves import axial_element_stiffness, stiffness_factors
from cvt_hpc.variator import LARGEST_DISPLACEMENT, MOST_SPEED, PULLEYS
from cvt_hpc.variator.profiles import multiple

# Over a bound on the torque by nominal radii and tangential friction. Sliding at an angle adds 4e-4, which is
# 1 / sqrt(1 - mu^2 tan^2 d0) - 1; the rest is for a belt that rides out of its groove by a tenth of a radius.
ABOVE = 1.1


def shaft_problems(p: Parameters) -> list[Problem]:
    """Problems of a shaft, in the form of a model's check."""
    return _problems_of_shaft(p, "") or _problems_of_shaft(p, settings.OWN)


def _problems_of_shaft(p: Parameters, prefix: str) -> list[Problem]:
    lengths, diameters = p[f"{prefix}shaft_lengths"], p[f"{prefix}shaft_diameters"]
    if len(lengths) != len(diameters):
        expected = f"one for each of {len(lengths)} {prefix}shaft_lengths"
        return [(f"{prefix}shaft_diameters", expected, str(len(diameters)))]
    if not lengths:
        return []
    total = sum(lengths)
    for name, what in (("bearing_positions", "bearings"), ("seat_positions", "sheaves")):
        key = f"{prefix}{name}"
        places = p[key]
        found = ", ".join(f"{place:g} m" for place in places) or "none"
        if len(places) != 2 or places[0] == places[1] or max(places) > total * (1.0 + 1e-9):
            expected = f"two {what} at different places of the shaft, 0 to {total:g} m"
            return [(key, expected, found)]
    return []


def pulley_problems(p: Parameters) -> list[Problem]:
    """Problems of the pulleys' freedom, in the form of a model's check."""
    found = _piston_problems(p) + _drive_problems(p)
    if 0.0 < p["tilt_lag"] < (least := _least_tilt_lag(p)):
        expected = f"0, or {least:.2g} s and more at this step: tilting is explicit"
        found.append(("tilt_lag", expected, f"{p['tilt_lag']:g} s"))
    found += _bearing_problems(p) + _controller_problems(p)
    return found or _overload_problems(p)


def steady_pulley_problems(p: Parameters) -> list[Problem]:
    """Problems of pulleys in a steady state: lags count for nothing there, but something has to hold each."""
    found = _piston_problems(p) + _drive_problems(p) + _bearing_problems(p) + _controller_problems(p)
    is_driven, is_held = np.isfinite(p["driving_inertia"]), np.isinf(p["driven_inertia"])
    if is_driven and p["drive_slope"] == 0.0 and not is_held:
        expected = "above 0, or driven_inertia inf: else no speed of the drive is steady"
        found.append(("drive_slope", expected, "0 N m s/rad"))
    if p["driving_axial"] == "ratio" and p["ratio_rate"] == 0.0:
        expected = "above 0: by its gain alone a controller rests where it began"
        found.append(("ratio_rate", expected, "0 N/s"))
    return found or _overload_problems(p)


def slipping_pulley_problems(p: Parameters) -> list[Problem]:
    """Problems of pulleys whose driven one is slowed down until the belt slips, and no other moves freely."""
    found = _piston_problems(p) + _bearing_problems(p)
    if p["driving_axial"] != "position":
        expected = "position: a driving sheave that is free shifts before the belt slips"
        found.append(("driving_axial", expected, p["driving_axial"]))
    if p["clamping"] != "constant":
        found.append(("clamping", "constant: the thrust is given, or sought", p["clamping"]))
    if np.isfinite(p["driving_inertia"]):
        expected = "inf: the speed of the driving pulley is given"
        found.append(("driving_inertia", expected, f"{p['driving_inertia']:g} kg m^2"))
    if np.isinf(p["driven_inertia"]):
        found.append(("driven_inertia", "finite: slip slows the driven pulley down", "inf"))
    return found


def _overload_problems(p: Parameters) -> list[Problem]:
    """Problem of a load that is more than any belt carries under the axial forces that are given.

    By `capacity.torque_limit` with the largest coefficient of friction, and ABOVE: a bound on the moment of
    each pulley's flanks, whatever the belt does. Near it a belt slips through long since, which is a result.
    A ramp or a profile may lead there, and shows where the belt slips; its start may not lie there.
    """
    key = "load_start" if p.get("load_history") == "ramp" else "load"
    load = p[key] * multiple(p, "load", 0.0)
    mu, radius = largest_friction(p), p["driven_radius"] / p["ratio"]
    for pulley, force in _most_axial_force(p).items():
        most = ABOVE * capacity.torque_limit(mu, force, radius, p["half_wedge_angle"])
        if abs(load) > most:
            expected = (
                f"at most {most:.4g} N m in size, {ABOVE:g} times what the {pulley} pulley carries under "
                f"{force * 1e-3:.4g} kN by its largest coefficient of friction, {mu:.3g}"
            )
            return [(key, expected, f"{load:g} N m")]
    return []


def _most_axial_force(p: Parameters) -> dict[str, float]:
    """Largest axial force on those pulleys whose thrust is given, or bounded by a controller [N]."""
    thrusts = {"driven": p["most_thrust"] if p["clamping"] == "torque_ratio" else p["thrust"]}
    if p["driving_axial"] != "position":
        is_held = p["driving_axial"] == "ratio"
        thrusts["driving"] = p["most_thrust"] if is_held else p["driving_thrust"]
    moved = 2.0 * np.tan(p["half_wedge_angle"]) * LARGEST_DISPLACEMENT * p["centre_distance"]
    speeds = {"driving": p["driving_speed"], "driven": p["driving_speed"] / p["ratio"]}
    return {
        pulley: thrust
        + p[f"{pulley}_spring_rate"] * moved
        + settings.oil_factor(p[f"{pulley}_piston"], p["oil_density"]) * (MOST_SPEED * speeds[pulley]) ** 2
        for pulley, thrust in thrusts.items()
    }


def _least_tilt_lag(p: Parameters) -> float:
    """Shortest lag of a tilt [s] that an explicit step follows.

    A belt that stays where it is answers an opening q with forces K q against it, K = c r wrap at most, c the
    stiffness of discs and elements in series: the tilt comes to rest at the rate (1 + kappa K) / T1.
    """
    if not p.get("step") or variator_problems(p):
        return 0.0
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    whole, disc = stiffness_factors(p)
    stiffness = 1.0 / (1.0 / axial_element_stiffness(p) + 1.0 / (whole * disc * p["local_stiffness"]))
    gains = []
    sizes = (path.driving_radius, path.driving_wrap), (path.driven_radius, path.driven_wrap)
    for pulley, (radius, wrap) in zip(PULLEYS, sizes, strict=True):
        tilt = radius * radius / (p["tilt_stiffness"] * p["tilt_factor"] * whole)
        gains.append(
            stiffness * radius * wrap * (tilt + settings.shaft_deflection(p, pulley, radius)[0] / whole)
        )
    return float(p["step"] * (1.0 + max(gains)))


def _bearing_problems(p: Parameters) -> list[Problem]:
    if p["bearing_clearance"] == 0.0 or p["shaft_lengths"] or p[f"{settings.OWN}shaft_lengths"]:
        return []
    return [("bearing_clearance", "0, or shaft_lengths", f"{p['bearing_clearance']:g} m")]


def _piston_problems(p: Parameters) -> list[Problem]:
    found = []
    for pulley in ("driving", "driven"):
        piston = p[f"{pulley}_piston"]
        if piston and (len(piston) != 2 or piston[0] >= piston[1]):
            listed = ", ".join(f"{radius:g} m" for radius in piston)
            found.append((f"{pulley}_piston", "an inner and a larger outer radius", listed))
    return found


def _drive_problems(p: Parameters) -> list[Problem]:
    has_given = [np.isinf(p[f"{pulley}_inertia"]) for pulley in ("driving", "driven")]
    if all(has_given):
        return [("driven_inertia", "finite, or a finite driving_inertia: one speed follows", "both inf")]
    if p.get("speed_history") == "ramp" and has_given != [True, False]:
        return [("speed_history", "constant where the driving pulley's speed is not given", "ramp")]
    if p.get("driving_speed_profile") and has_given != [True, False]:
        return [("driving_speed_profile", "none where the driving pulley's speed is not given", "one")]
    return []


def _controller_problems(p: Parameters) -> list[Problem]:
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


def pulley_inert(p: Parameters) -> dict[str, str]:
    """Settings of pulleys without effect, each with the setting that makes it so."""
    controlled = p["driving_axial"] == "ratio", p["clamping"] == "torque_ratio"
    cases = (
        (np.isinf(p["driving_inertia"]), ("drive_slope",), "driving_inertia inf"),
        (p["driving_axial"] != "thrust", ("driving_thrust",), f"driving_axial {p['driving_axial']}"),
        (p["driving_axial"] == "position", ("driving_spring_rate",), "driving_axial position"),
        (not controlled[0], ("ratio_gain", "ratio_rate"), f"driving_axial {p['driving_axial']}"),
        (not controlled[1], ("held_torque_ratio", "clamping_gain", "clamping_rate"), "clamping constant"),
        (not any(controlled), ("least_thrust", "most_thrust"), "no controller"),
        (not p["driving_piston"] and not p["driven_piston"], ("oil_density",), "no piston"),
        *(
            (not p[f"{prefix}shaft_lengths"], settings.shaft_keys(prefix)[1:], f"no {prefix}shaft_lengths")
            for prefix in ("", settings.OWN)
        ),
    )
    return {key: setting for holds, keys, setting in cases if holds for key in keys}
