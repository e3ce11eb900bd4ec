"""Parameters of free pulleys and of their shafts that a job may set; by default they are as they always were.

No paper gives numbers of these: every default is an assumption, plausible and not measured.
"""

from typing import Any

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters, Substitute, not_negative, positive
from cvt_hpc.physics.shaft import Bearing, Seats, beam_flexibility, free_opening, shaft_compliance
from cvt_hpc.variator.scene import TILT_LAG

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
    def thrust(parameters: Parameters) -> float:
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
        f"{pulley}_piston": not_negative(
            (), "m", f"inner and outer radius of the {pulley} pulley's piston; none: its oil has no weight",
            sensible=LENGTHS
        ),
        f"{pulley}_pressure": not_negative(
            None,
            "Pa",
            f"of the {pulley} pulley's oil, in the place of its thrust, which follows with its spring",
            (1000.0, 1e9),
            gives=_pressed(pulley)
        ),
        f"{pulley}_spring_force": not_negative(
            0.0, "N", f"of the {pulley} pulley's spring where it is not shifted, beside a pressure", FORCES
        ),
        f"{pulley}_spring_rate": not_negative(
            0.0, "N/m", f"stiffness of the {pulley} pulley's spring", (1.0, 1e9)
        ),
    }  # fmt: skip


DRIVEN_INERTIA = positive(
    0.02,
    "kg m^2",
    "moment of inertia of the driven pulley; inf: it keeps the speed that it has without load",
    (1e-5, 100.0),
    allow_infinite=True,
)

PULLEYS: dict[str, Parameter] = {
    "driving_inertia": positive(
        np.inf,
        "kg m^2",
        "moment of inertia of the driving pulley and its drive; inf: its speed is given",
        (1e-5, np.inf),
        allow_infinite=True
    ),
    "drive_slope": not_negative(
        0.0,
        "N m s/rad",
        "torque by which the drive falls off as the driving pulley gets faster than driving_speed",
        (1e-3, 1e5)
    ),
    "driving_axial": Parameter(
        "position",
        "",
        "driving pulley: its opening is given, or its thrust, or a controller holds the ratio by its thrust",
        choices=("position", "thrust", "ratio")
    ),
    "driving_thrust": positive(
        60e3, "N", "axial force on the driving pulley, from rise_time on", (500.0, 2e6)
    ),
    "ratio_gain": not_negative(300e3, "N", "controller: driving thrust per deviation of the ratio", FORCES),
    "ratio_rate": not_negative(
        3e6, "N/s", "controller: rate of the driving thrust per deviation of the ratio", (1.0, 1e9)
    ),
    "clamping": Parameter(
        "constant",
        "",
        "driven pulley: its thrust is constant, or a controller holds the torque ratio by it",
        choices=("constant", "torque_ratio")
    ),
    "held_torque_ratio": Parameter(
        0.6,
        "",
        "torque ratio to be held: load over the load that friction carries at the lesser axial force",
        minimum=-1.0,
        maximum=1.0,
        exclusive=True
    ),
    "clamping_gain": not_negative(0.5, "", "controller: driven thrust per axial force that is lacking"),
    "clamping_rate": not_negative(
        50.0, "1/s", "controller: rate of the driven thrust per axial force that is lacking", (1e-3, 1e5)
    ),
    "least_thrust": not_negative(2000.0, "N", "least thrust that a controller sets", FORCES),
    "most_thrust": positive(100e3, "N", "largest thrust that a controller sets", sensible=FORCES),
    **_of_each(_axial),
    "oil_density": positive(850.0, "kg/m^3", "density of the oil behind the pistons", (100.0, 1e4)),
    **TILT_LAG,
    "collar_clearance": not_negative(
        0.0, "rad", "angle by which the collar of a movable sheave tilts before it bears", (1e-7, 0.1)
    ),
    "bearing_clearance": not_negative(
        0.0, "m", "radial clearance of the shafts' bearings", (1e-8, 0.01)
    ),
}  # fmt: skip

OWN = "driven_"  # before the keys of a shaft that the driven pulley has of its own


def _shaft(prefix: str, of: str, none: str) -> dict[str, Parameter]:
    keys = {
        "shaft_lengths": positive((), "m", f"lengths of a shaft's sections, {of}; none: {none}", LENGTHS),
        "shaft_diameters": positive((), "m", "diameters of these sections", LENGTHS),
        "shaft_modulus": positive(2.1e11, "Pa", "Young's modulus of that shaft", (1e9, 1e13)),
        "shaft_factor": positive(
            1.0, "", "factor on the stiffness of that shaft and its bearings; inf: rigid", allow_infinite=True
        ),
        "seat_positions": not_negative(
            (), "m", "where the fixed and the movable sheave sit along that shaft", LENGTHS
        ),
        "bearing_positions": not_negative((), "m", "where the two bearings sit along that shaft", LENGTHS),
        "bearing_stiffness": positive(
            2e8, "N/m", "radial stiffness of such a bearing", (1e5, 1e12), allow_infinite=True
        ),
    }
    return {f"{prefix}{key}": parameter for key, parameter in keys.items()}


SHAFT = _shaft("", "of each pulley that has none of its own", "tilt_stiffness includes its bending")
DRIVEN_SHAFT = _shaft(OWN, "of the driven pulley alone", "it is as that of the driving one")


def shaft_keys(prefix: str) -> tuple[str, ...]:
    """Keys of a shaft, its sections' lengths first; of both pulleys, or of the driven one (OWN)."""
    return tuple(DRIVEN_SHAFT if prefix else SHAFT)


PULLEY_DEFAULTS = {
    key: parameter.default
    for table in (PULLEYS, SHAFT, DRIVEN_SHAFT)
    for key, parameter in table.items()
    if parameter.gives is None
}


def are_free(p: Parameters) -> bool:
    """Whether pulleys do more than turn by a given speed, or be pressed by a constant thrust.

    Reads no parameter that does not count: the parameters read decide which runs can share a batch.
    """
    return bool(
        np.isfinite(p["driving_inertia"])
        or np.isinf(p["driven_inertia"])
        or p["driving_axial"] != "position"
        or p["clamping"] != "constant"
        or p["driven_spring_rate"] > 0.0
        or p["driven_piston"]
        or p["tilt_lag"] > 0.0
    )


def shaft_deflection(p: Parameters, pulley: str, radius: float) -> tuple[float, float]:
    """Effect of a pulley's shaft on its groove: compliance [m/N], free opening by its bearings [m].

    From flat values of the run [SI] and the pitch radius [m] of the driving or the driven pulley.
    """
    prefix = OWN if pulley == "driven" and p[f"{OWN}shaft_lengths"] else ""
    lengths, diameters, modulus, factor, places, held, stiffness = (p[key] for key in shaft_keys(prefix))
    if not lengths:
        return 0.0, 0.0
    seats, angle = Seats(*places), p["half_wedge_angle"]
    bearings = [Bearing(position, stiffness) for position in held]
    flexibility = beam_flexibility(lengths, diameters, modulus, bearings, seats)
    opening = free_opening(p["bearing_clearance"], held, seats, angle)
    return shaft_compliance(flexibility, seats, radius, angle) / factor, opening
