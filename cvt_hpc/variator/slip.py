"""Gross slip: distance of the load from the load that friction carries, and when a run counts as slipping.

The largest torque at the driving pulley is, by Bullinger et al. 2005, eq. 2,

    M* = r (2 mu / cos delta_0) min(Q_dr, Q_dn),

r being the driving pulley's radius, Q the axial forces of the belt on the sheaves and mu friction's
coefficient at the sliding speed of gross slip. Under the axial forces that runs find they begin to slip
grossly at 0.9 to 1.05 M*: ratios 0.5, 1 and 2.52, rigid and elastic sheaves, either sign of the load, mu_k
0.06 and 0.1, gradients 0 to -1.2 s/m (96 stations, 0.8 s).

Where the belt only creeps on a pulley, its mean sliding is up to 3 % of the belt's speed. Towards the largest
torque that slip rises from 4 to 8 % within 1 % of the load; beyond, there are states in which a pulley slips
by 8 to 40 % all the time, and then none. So a run slips grossly if a pulley's mean slip over the last half of
the judged part is beyond GROSS_SLIP, or if the driven pulley loses or gains half of its speed before the
run's end.

A run is whatever has `parameters`, `channel(name)`, `samples`, `done`, `judged`, `path` and
`mean_driving_speed(samples)`, with the channels load, driven_speed, and those of slip and axial_force of both
pulleys.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cvt_hpc.physics.capacity import torque_limit
from cvt_hpc.physics.friction import FrictionLaw, friction_coefficients, given_law
from cvt_hpc.physics.friction_laws import TABLE_PARAMETERS
from cvt_hpc.physics.geometry import Variator
from cvt_hpc.variables import Variable, Vibrates, shortened, together
from cvt_hpc.variator import GROSS_SLIP, LEAST_SPEED, MOST_SPEED, PULLEYS
from cvt_hpc.variator.variables import Measured
from cvt_hpc.vibration.assessment import Occurrence

LOST = f"the belt slips through: the driven pulley has lost {1 - LEAST_SPEED:.0%} of its speed"
GAINED = f"the belt slips through: the driven pulley has gained {MOST_SPEED - 1:.0%} of its speed"


def largest_torque(
    law: FrictionLaw, half_wedge_angle: float, path: Variator, belt_speed: float, axial_force: np.ndarray
) -> float:
    """Largest torque at the driving pulley that friction carries [N m].

    By the law of the flanks at the sliding speed of gross slip, with the half wedge angle [rad], radii and
    arcs of the path, the belt speed [m/s] and the axial force (2,) of the belt on a sheave of the driving and
    of the driven pulley [N].
    """
    arcs = np.array([path.lengths[0], path.lengths[2]])
    normal_force = axial_force / (arcs * np.cos(half_wedge_angle))
    mu = friction_coefficients(law, np.full(2, GROSS_SLIP * belt_speed), normal_force)
    return float(torque_limit(mu, axial_force, path.driving_radius, half_wedge_angle).min())


def against_slip(load: float, carried: float) -> tuple[float, float, float]:
    """Values of AGAINST_SLIP, from torque at the driving pulley and the largest that friction carries [N m].

    Without any friction ratio and margin are infinite, or without load either not numbers.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = float(np.divide(load, carried))
    return carried, ratio, abs(ratio) - 1.0


def capacity(measured: Measured) -> tuple[float, float, float]:
    """Values of AGAINST_SLIP of a part of a run."""
    p, path = measured.parameters, measured.path
    # a run may slip through before a constant load has risen to its value
    is_constant = p["load_history"] == "constant" and not p.get("load_profile")
    load = p["load"] if is_constant else measured.mean("load")
    carried = largest_torque(
        given_law(dict.fromkeys(TABLE_PARAMETERS, ()) | p),  # not every model has tables
        p["half_wedge_angle"],
        path,
        measured.mean_driving_speed(measured.samples) * path.driving_radius,
        measured.each("axial_force {}"),
    )
    return against_slip(load, carried)


AGAINST_SLIP = together(
    capacity,
    Variable(
        "carried_torque",
        "N m",
        "at the driving pulley, torque that friction carries at nominal radii under these axial forces",
    ),
    Variable("torque_ratio", "1", "load over carried_torque, with the load's sign"),
    Variable("slip_margin", "1", "size of torque_ratio, less 1; slips from about 0"),
    early=True,
)


def with_slip(run: Any, found: Occurrence, pulleys: Sequence[str] = PULLEYS) -> Occurrence:
    """The verdict on the vibration of a run that reached its end, with gross slip where there is some.

    The margin is that to gross slip, where this is nearer than the one of the amplitude.
    """
    late = slice((run.judged.start + run.samples) // 2, run.samples)
    slips = np.array([run.channel(f"slip {pulley}")[late].mean() for pulley in pulleys])
    k = int(np.argmax(np.abs(slips)))
    with np.errstate(divide="ignore"):
        beyond = float(np.log(abs(slips[k]) / GROSS_SLIP))
    if beyond <= 0.0:
        return replace(found, margin=min(found.margin, -beyond))
    reason = f"the {pulleys[k]} pulley slips by {abs(slips[k]):.3g} of the belt's speed; {found.reason}"
    return replace(found, vibrates=Vibrates.SLIPS, reason=shortened(reason), margin=beyond)


def slide(run: Any) -> slice:
    """Samples of a run that has slipped through from where a pulley began to slip grossly for good."""
    slips = np.abs([run.channel(f"slip {pulley}") for pulley in PULLEYS]).max(axis=0)
    gripping = np.flatnonzero(slips <= GROSS_SLIP)
    first = gripping[-1] + 1 if gripping.size else 0
    return slice(min(int(first), max(run.done - 1, 0)), run.done)
