"""Friction of the belt's contacts, in three treatments.

A contact slides by the speed g of the belt's cord over the pulley, and is pressed by the force p per
length. The friction force per length q acts against g, and all treatments bound it by mu(|g|, p) p.

Regularised: q = mu p tanh(g / friction_speed), with slopes by `cvt_hpc.physics.contact_laws`. A contact that
carries a force creeps.

Set-valued: Coulomb's law. Either g = 0 and |q| <= mu(0, p) p: the contact sticks; or q = mu p g / |g|: it
slides.

Bristles: the layer of rubber between cord and rim shears by z, and q = shear_stiffness z. Either dz/dt = g
and |q| <= mu p: the rim sticks; or |q| = mu p: it slides. z belongs to a material point of the belt, as its
contact does. It is integrated as the belt's positions are, with a return to the bound in each stage and at
the end of each step.

The latter two know in each iterate which contacts slide, and to which side. These have the force of their
bound. The others have

    q = q_0 + grip g.

With bristles q_0 is the force before the stage, and grip = tau shear_stiffness. Set-valued, q_0 is the
force of the iterate before: this is a step of the proximal point method (Rockafellar 1976), by which g -> 0
as q settles, whatever `grip` is. Newton's method solves these equations. Then the contacts whose law does
not hold change: one that sticks beyond its bound slides, one that slides backwards sticks. Where all but
friction is linear, this is block principal pivoting of the linear complementarity problem with bounds
(Judice and Pires 1994). It may go around in circles where contacts lie closer to each other than the belt
has coordinates. A softer grip, which comes when the number of wrong contacts fails to fall, brings it out
of them. The laws hold to `slack`.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.physics.contact_laws import dual_of
from cvt_hpc.physics.contact_laws import friction as smooth_friction
from cvt_hpc.physics.friction import FrictionLaw, friction_coefficient
from cvt_hpc.solvers.generalised_alpha import Scheme, begin, finish

_PATIENCE, _SOFTER = 3, 0.3  # iterates in which no fewer contacts are wrong, until the grip is so much softer
WRONG, LOOSE, FEWEST, LEFT = range(4)  # pivots of a memory


class Treatment(IntEnum):
    """Treatment of friction, as kernels know it; a job names it in lower case."""

    REGULARISED = 0
    SET_VALUED = 1
    BRISTLE = 2


class Friction(NamedTuple):
    """Constants of friction."""

    treatment: int  # one of `Treatment`
    law: FrictionLaw  # mu over speed and normal force per length
    friction_speed: float  # of the regularisation [m/s]
    # grip, slack: set-valued: force per length by speed of a contact that sticks, at first [N s/m^2]; speed
    # that such a one may keep, or up to which one that slides may go backwards [m/s]
    grip: float
    slack: float
    shear_stiffness: float  # of bristles, force per length by shear [N/m^2]


class Memory(NamedTuple):
    """State of the friction in the contacts of P pulleys with k elements of C points."""

    slip: np.ndarray  # sliding speed of the last iterate, (P, k, C) [m/s]
    # (P, k, C). Regularised: dual of the slip's direction [1]. Set-valued: friction force per length [N/m].
    dual: np.ndarray
    side: np.ndarray  # 0 of contacts that stick, 1 or -1 of those that slide, (P, k, C)
    shear: np.ndarray  # of bristles, after the last step, (P, k C) [m]
    shear_rate: np.ndarray  # after the last step, (P, k C) [m/s]
    shear_start: np.ndarray  # at the start of a stage, (P, k C) [m]
    shear_stage: np.ndarray  # in it, (P, k C) [m]
    # contacts that were WRONG in the last iterate, and those that stuck but were not yet still (LOOSE); the
    # FEWEST wrong ones in an iterate of this stage, and how many iterates are LEFT to have fewer
    pivots: np.ndarray
    grip: np.ndarray  # of this iterate, (1,) [N s/m^2]


def empty_memory(pulleys: int, elements: int, points: int) -> Memory:
    """Memory of contacts that touch nothing."""
    shape = pulleys, elements, points
    slip, dual = np.zeros((2, *shape))
    shear, rate, start, stage = np.zeros((4, pulleys, elements * points))
    side, pivots = np.zeros(shape, np.int64), np.zeros(4, np.int64)
    return Memory(slip, dual, side, shear, rate, start, stage, pivots, np.zeros(1))


class Rub(NamedTuple):
    """Friction of a contact per length, against its slip, and its slopes."""

    # force, settled: by this iterate, and the value expected of the solution, which turns with the contact
    # [N/m]
    force: float
    settled: float
    # by_slip, by_pressure: [N s/m^2], [1]
    by_slip: float
    by_pressure: float


@kernel
def begin_friction(friction: Friction, memory: Memory, scheme: Scheme, dt: float) -> None:
    """Begin a step of dt [s]."""
    memory.pivots[FEWEST], memory.pivots[LEFT] = memory.slip.size + 1, _PATIENCE
    memory.grip[0] = friction.grip
    if friction.treatment == Treatment.BRISTLE:
        begin(scheme, dt, memory.shear, memory.shear_rate, memory.shear_start)


@kernel
def begin_iterate(memory: Memory) -> None:
    """Begin an iterate of a stage."""
    memory.pivots[WRONG] = memory.pivots[LOOSE] = 0


@merged_kernel
def rub(
    friction: Friction,
    memory: Memory,
    p: int,
    i: int,
    c: int,
    slip: float,
    pressure: float,
    tau: float,
    is_known: bool,
) -> Rub:
    """Friction of one contact in an iterate of a stage of `tau` [s]: of pulley p, element i and point c.

    The belt slides over the pulley by `slip` [m/s], under a normal force per length above 0 [N/m]. `is_known`
    tells whether `memory` is of an iterate of this stage.
    """
    if friction.treatment == Treatment.REGULARISED:
        found = _rub_smoothly(friction, memory, p, i, c, slip, pressure, is_known)
    else:
        found = _rub_or_stick(friction, memory, p, i, c, slip, pressure, tau, is_known)
    memory.slip[p, i, c] = slip
    return found


@merged_kernel
def _rub_smoothly(friction, memory, p, i, c, slip, pressure, is_known):
    mu, mu_slope = friction_coefficient(friction.law, abs(slip), pressure)
    dual, width = memory.dual[p, i, c], friction.friction_speed
    if is_known:
        dual = dual_of(slip, 0.0, memory.slip[p, i, c], 0.0, dual, 0.0, width)[0]
        memory.dual[p, i, c] = dual
    found = smooth_friction(slip, 0.0, abs(slip), dual, 0.0, mu, mu_slope, width)
    force = pressure * found[0]
    return Rub(force, force, pressure * found[2], found[0])


@merged_kernel
def _rub_or_stick(friction, memory, p, i, c, slip, pressure, tau, is_known):
    side, k = memory.side[p, i, c], i * memory.slip.shape[2] + c
    mu, mu_slope = friction_coefficient(friction.law, abs(slip) if side != 0 else 0.0, pressure)
    bound = mu * pressure
    if friction.treatment == Treatment.BRISTLE:
        grip = friction.shear_stiffness * tau
        before = friction.shear_stiffness * memory.shear_start[p, k]
        settled = before + grip * slip
        is_backwards = side * settled < bound
    else:
        grip, before = memory.grip[0], memory.dual[p, i, c]
        if is_known and side == 0:
            before += grip * slip
        elif side == 0:
            before = min(max(before, -bound), bound)
        settled = before
        is_backwards = side * slip < -friction.slack
    if is_known:
        to = side
        if side == 0 and abs(settled) > bound:
            to = 1 if settled > 0.0 else -1
        elif side != 0 and is_backwards:
            to = 0
        if to != side:
            memory.pivots[WRONG] += 1
            side = memory.side[p, i, c] = to
    force, by_slip, by_pressure = before + grip * slip, grip, 0.0
    if side != 0:
        force = settled = before = side * bound
        by_slip, by_pressure = mu_slope * pressure * (1.0 if side * slip > 0.0 else -1.0), side * mu
    memory.dual[p, i, c] = before
    if friction.treatment == Treatment.BRISTLE:
        memory.shear_stage[p, k] = force / friction.shear_stiffness
    elif side == 0 and abs(slip) > friction.slack:
        memory.pivots[LOOSE] += 1
    return Rub(force, settled, by_slip, by_pressure)


@kernel
def laws_hold(friction: Friction, memory: Memory, is_known: bool) -> bool:
    """Whether the laws of all contacts held in an iterate; known as that of `rub`."""
    if friction.treatment == Treatment.REGULARISED:
        return True
    if not is_known:
        return False
    pivots = memory.pivots
    if pivots[WRONG] < pivots[FEWEST]:
        pivots[FEWEST], pivots[LEFT] = pivots[WRONG], _PATIENCE
    else:
        pivots[LEFT] -= 1
        if pivots[LEFT] < 0:
            pivots[LEFT] = _PATIENCE
            memory.grip[0] *= _SOFTER
    return pivots[WRONG] + pivots[LOOSE] == 0


@kernel
def finish_friction(
    friction: Friction, memory: Memory, normal: np.ndarray, scheme: Scheme, dt: float
) -> None:
    """Finish a step of dt [s]; contacts without a normal force (P, k, C) forget."""
    has_bristles = friction.treatment == Treatment.BRISTLE
    if has_bristles:
        finish(scheme, dt, memory.shear_stage, memory.shear_start, memory.shear, memory.shear_rate)
    pulleys, elements, points = normal.shape
    for p in range(pulleys):
        for i in range(elements):
            for c in range(points):
                k = i * points + c
                if normal[p, i, c] == 0.0:
                    memory.dual[p, i, c], memory.side[p, i, c] = 0.0, 0
                    memory.shear[p, k] = memory.shear_rate[p, k] = 0.0
                elif has_bristles and memory.side[p, i, c] != 0:
                    memory.shear[p, k], memory.shear_rate[p, k] = memory.shear_stage[p, k], 0.0
