"""Pulleys with four degrees of freedom each: rotation, axial position, and two tilts of the movable sheave.

    rotation   J omega' = M - sum (r_i x f_i)_z                 (Bullinger et al. 2005, eq. 7)
    position   T_1 k z' = sum f - A p - F_c - F_omega           (eq. 8)
    tilt       T_1 q' = kappa s - q (1 - c / |q|)+              (eq. 9), s = sum (cos phi, sin phi) h f

M is the drive's torque, the load's course less `drive_slope` times the excess of the driving pulley's speed
over its course, or the load; a speed that is given has an infinite inertia. `thrust` is A p and the spring's
force at its reference together, the spring's change c z and F_omega = C omega^2 come to it. q is the opening
of the groove, the same for both axes of the collar and the shaft (`physics/shaft.py`), c its part that is
free: a collar within its clearance moves against the oil alone. A sheave without a lag is no state: its q is
part of the contact (`physics/compliance.py`, with clearance `physics/clearance.py`), to which T_1 -> 0 leads.

Two controllers, both PI with limits, whose gains are assumptions:

    ratio          Q_dr = Q_0 + k_P (i - i_0) + k_I integral (i - i_0),   i = omega_dr / omega_dn
    torque ratio   Q_dn = Q_1 + k_P lack + k_I integral lack,   lack = |M| Q / (M*(Q) r) - min(F_dr, F_dn)

M* by eq. 2. Until `rise_time` the driving sheave keeps its position; Q_0 follows, within T_1, the thrust that
it needs there.

All of this stands for plain numbers as for lanes. Layers' speeds are counted from the course of the driving
speed, also where the pulley deviates from it, and so is m v^2: it is off by twice that deviation.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import merged_kernel
from cvt_hpc.lanes import fma, like, maximum, minimum, select, sqrt
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.pulley_settings import are_free, oil_factor, shaft_deflection
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics import capacity
from cvt_hpc.physics.sheaves import Sheaves
from cvt_hpc.variator import PULLEYS


class Pulleys(NamedTuple):
    """Constants of both pulleys."""

    laws: np.ndarray  # LAWS, (1, 22)
    # whether any pulley does more than turn by a given speed, or be pressed by a constant thrust
    are_free: bool


def with_pulleys(
    p: Parameters, wraps: Sequence[Sheaves], radii: tuple[float, float]
) -> tuple[list[Sheaves], Pulleys]:
    """Sheaves as the contact takes them, on their shafts, and the constants of both pulleys.

    From flat values of the run [SI], and of the driving and of the driven pulley the wraps, on rigid shafts,
    and the pitch radii [m].
    """
    shafts = [shaft_deflection(p, pulley, radius) for pulley, radius in zip(PULLEYS, radii, strict=True)]
    bent = [
        wrap._replace(tilt_compliance=wrap.tilt_compliance + compliance)
        for wrap, (compliance, _) in zip(wraps, shafts, strict=True)
    ]
    tilts = [wrap.compliance * wrap.tilt_compliance for wrap in bent]
    free = [radius * p["collar_clearance"] + shaft[1] for radius, shaft in zip(radii, shafts, strict=True)]
    lag = p["tilt_lag"]
    sets_ratio, sets_clamping = p["driving_axial"] == "ratio", p["clamping"] == "torque_ratio"
    limits = (p["least_thrust"], p["most_thrust"]) if sets_ratio or sets_clamping else (-np.inf, np.inf)
    need = 0.0
    if sets_clamping:
        need = 1.0 / (capacity.carried_torque({**p, "thrust": 1.0}) * abs(p["held_torque_ratio"]))
    named = {
        "driving_mobility": 1.0 / p["driving_inertia"],
        "driven_mobility": 1.0 / p["driven_inertia"],
        "driving_axial_mobility": (
            0.0 if p["driving_axial"] == "position" else 1.0 / (p["sheave_lag"] * p["lag_stiffness"])
        ),
        "driving_thrust": 0.0 if sets_ratio else p["driving_thrust"],
        "driving_oil": oil_factor(p["driving_piston"], p["oil_density"]),
        "driven_oil": oil_factor(p["driven_piston"], p["oil_density"]),
        "tracking": 1.0 / p["sheave_lag"] if sets_ratio else 0.0,
        "ratio_gain": p["ratio_gain"] if sets_ratio else 0.0,
        "ratio_rate": p["ratio_rate"] if sets_ratio else 0.0,
        "need": need,
        "clamping_gain": p["clamping_gain"] if sets_clamping else 0.0,
        "clamping_rate": p["clamping_rate"] if sets_clamping else 0.0,
        "least_thrust": limits[0],
        "most_thrust": limits[1],
        "tilt_rate": 1.0 / lag if lag else 0.0,
        "driving_tilt": tilts[0] if lag else 0.0,
        "driven_tilt": tilts[1] if lag else 0.0,
        "driving_free": free[0],
        "driven_free": free[1],
    }
    laws = np.array([[named[key] if key in named else p[key] for key in f.LAWS]])
    if lag:
        bent = [wrap._replace(tilt_compliance=0.0) for wrap in bent]
    else:
        bent = [wrap._replace(clearance=opening) for wrap, opening in zip(bent, free, strict=True)]
    return bent, Pulleys(laws, are_free(p))


def moving_states(pulleys: Pulleys) -> np.ndarray:
    """Places in STATES of the states that can change: other states have no rate, and stay at 0."""
    laws = pulleys.laws[0]
    by = {
        f.EXCESS: laws[f.DRIVING_MOBILITY],
        f.SHIFT: laws[f.DRIVING_AXIAL_MOBILITY],
        f.RATIO_SUM: laws[f.RATIO_RATE],
        f.CLAMPING_SUM: laws[f.CLAMPING_RATE],
        **dict.fromkeys(range(f.DRIVING_COS, f.DRIVEN_SIN + 1), laws[f.TILT_RATE]),
    }
    return np.array([state for state in range(f.STATES) if by[state] > 0.0], dtype=int)


def settled_tilt(pulleys: Pulleys, first: int, tilting: np.ndarray) -> np.ndarray:
    """Opening q of a groove at rest [m], (2,), under s = `tilting` (2,) [N], where it is a state; else 0.

    `first` is DRIVING_COS or DRIVEN_COS.
    """
    laws, which = pulleys.laws[0], int(first == f.DRIVEN_COS)
    if laws[f.TILT_RATE] == 0.0:
        return np.zeros(2)
    return laws[f.DRIVING_TILT + which] * tilting + laws[f.DRIVING_FREE + which] * tilting / np.linalg.norm(
        tilting
    )


@merged_kernel
def beyond_clearance(one, other, free):
    """Elastic part of a groove's opening [m]: (one, other) less the free part, in its direction."""
    size = sqrt(fma(one, one, other * other))
    share = maximum(size - free, 0.0) / maximum(size, 1e-30)
    return share * one, share * other


@merged_kernel
def thrusts(laws, first: int, scalars, going: float, turning, position, axial, given):
    """Axial forces on the movable sheaves [N], and how fast the controllers' integrals change [N/s].

    The forces of both pulleys are with springs and oil; the rates are those of ratio and clamping. From
    `laws`, LAWS from field `first` on, `scalars`, STATES from field FIRST_STATE on, `going`, 1 once the
    controllers go and 0 before, speeds of both pulleys [rad/s] and axial forces of the belt on them [N], the
    opening of the driven pulley [m], and as `given` the load at the driving pulley [N m], speed ratio [1] and
    thrust on the driven pulley [N].
    """
    torque, ratio, thrust = given
    least, most = like(laws[0, first + f.LEAST_THRUST], thrust), like(laws[0, first + f.MOST_THRUST], thrust)
    deviation = going * (turning[0] / turning[1] - ratio)
    asked = like(laws[0, first + f.DRIVING_THRUST], thrust) + scalars[0, f.FIRST_STATE + f.RATIO_SUM]
    asked = fma(like(laws[0, first + f.RATIO_GAIN], thrust), deviation, asked)
    driving = minimum(maximum(asked, least), most)
    ratio_rate = like(laws[0, first + f.RATIO_RATE], thrust) * deviation
    # at a limit an integral does not grow beyond it
    ratio_rate = select(asked > most, minimum(ratio_rate, 0.0), ratio_rate)
    ratio_rate = select(asked < least, maximum(ratio_rate, 0.0), ratio_rate)
    needed = like(laws[0, first + f.NEED], thrust) * maximum(torque, -torque)
    lack = going * (needed - minimum(axial[0], axial[1]))
    asked = fma(
        like(laws[0, first + f.CLAMPING_GAIN], thrust),
        lack,
        thrust + scalars[0, f.FIRST_STATE + f.CLAMPING_SUM],
    )
    driven = minimum(maximum(asked, least), most)
    clamping_rate = like(laws[0, first + f.CLAMPING_RATE], thrust) * lack
    clamping_rate = select(asked > most, minimum(clamping_rate, 0.0), clamping_rate)
    clamping_rate = select(asked < least, maximum(clamping_rate, 0.0), clamping_rate)
    driving = fma(
        like(laws[0, first + f.DRIVING_SPRING_RATE], thrust), scalars[0, f.FIRST_STATE + f.SHIFT], driving
    )
    driving = fma(like(laws[0, first + f.DRIVING_OIL], thrust), turning[0] * turning[0], driving)
    driven = fma(like(laws[0, first + f.DRIVEN_SPRING_RATE], thrust), position, driven)
    driven = fma(like(laws[0, first + f.DRIVEN_OIL], thrust), turning[1] * turning[1], driven)
    ratio_rate += (1.0 - going) * like(laws[0, first + f.TRACKING], thrust) * (axial[0] - driving)
    return driving, driven, ratio_rate, clamping_rate


@merged_kernel
def _tilt_rates(laws, first: int, scalars, tilting):
    """Rates of the grooves' openings [m/s], four, by the tilting forces s of both pulleys [N], four."""
    pattern = tilting[0]
    rate = like(laws[0, first + f.TILT_RATE], pattern)
    one, other = beyond_clearance(
        scalars[0, f.FIRST_STATE + f.DRIVING_COS],
        scalars[0, f.FIRST_STATE + f.DRIVING_SIN],
        like(laws[0, first + f.DRIVING_FREE], pattern),
    )
    three, four = beyond_clearance(
        scalars[0, f.FIRST_STATE + f.DRIVEN_COS],
        scalars[0, f.FIRST_STATE + f.DRIVEN_SIN],
        like(laws[0, first + f.DRIVEN_FREE], pattern),
    )
    driving = like(laws[0, first + f.DRIVING_TILT], pattern)
    driven = like(laws[0, first + f.DRIVEN_TILT], pattern)
    return (
        rate * fma(driving, tilting[0], -one),
        rate * fma(driving, tilting[1], -other),
        rate * fma(driven, tilting[2], -three),
        rate * fma(driven, tilting[3], -four),
    )


@merged_kernel
def drive_torque(laws, first: int, excess, load):
    """Torque of the drive [N m] at a speed above its course [rad/s]."""
    return load - like(laws[0, first + f.DRIVE_SLOPE], excess) * excess


@merged_kernel
def pulley_rates(laws, first: int, scalars, going: float, turning, position, pulled, given):
    """Rates of all states of both pulleys: driven speed [rad/s^2], driven position [m/s], and STATES.

    Arguments as of `thrusts`; but `pulled` is the action of the belt on both pulleys: the torque that it
    takes from the driving one, that on the driven one [N m], its axial forces (2) and the tilting forces on
    the sheaves (4) [N]; and `given` has T_1 k of the driven sheave [N s/m] as well.
    """
    taken, moment, axial, tilting = pulled
    load, ratio, thrust, damping = given
    driving, driven, ratio_rate, clamping_rate = thrusts(
        laws, first, scalars, going, turning, position, axial, (load, ratio, thrust)
    )
    torque = drive_torque(laws, first, scalars[0, f.FIRST_STATE + f.EXCESS], load)
    tilts = _tilt_rates(laws, first, scalars, tilting)
    excess_rate = like(laws[0, first + f.DRIVING_MOBILITY], load) * (torque - taken)
    shift_rate = going * like(laws[0, first + f.DRIVING_AXIAL_MOBILITY], load) * (axial[0] - driving)
    speed_rate = like(laws[0, first + f.DRIVEN_MOBILITY], load) * (moment - ratio * load)
    found = (speed_rate, (axial[1] - driven) / damping, excess_rate, shift_rate)
    return found + tilts + (ratio_rate, clamping_rate)
