"""The belt on its pulleys: contact forces at points along the belt, and the step in time.

Each element has points at equal distances that may touch each pulley. A point of the belt at distance
d < R from the pulley's axis is pressed by R - d into the pulley's rim of radius R, with the normal force per
length

    p = max(stiffness (R - d) + damping d/dt (R - d), 0).

The rubber between the belt's cord and the rim turns with the pulley, so that the cord slides by the speed
v = t . dr/dt - w d over it, and friction -mu(|v|, p) p tanh(|v| / friction_speed) v / |v| acts at the radius
d: its moment turns the pulley.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.multibody.ancf_beam import PER_NODE, AncfBeam, assemble, shapes
from cvt_hpc.multibody.ancf_chain import SIZE, Chain, begin_stage, chain, correct, finish_stage, place
from cvt_hpc.physics.friction import FrictionLaw, friction_coefficient
from cvt_hpc.physics.primal_dual import dual_of, friction
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER, empty_corner, factor, solve_bordered
from cvt_hpc.solvers.generalised_alpha import Scheme, begin, finish, stage_length

# counters of a state, and its totals [J]
STEPS, ITERATIONS, UNSOLVED = range(3)
WORK_IN, WORK_OUT, CONTACT_LOSS, BELT_LOSS, FRICTION_LOSS = range(5)  # of each pulley from the last one on


class Drive(NamedTuple):
    """Constants of a belt of k elements and of P pulleys, the first of which has a prescribed speed.

    Attributes
    ----------
    beam : AncfBeam
        Of the belt.
    centre : (P, 2) array
        Axes of the pulleys [m].
    radius, inertia : (P,) arrays
        Of the pulleys [m], [kg m^2]; the inertia of the first is not read.
    shape : (C, 4) array
        Shapes at the C points of an element of length 1.
    stiffness, damping : float
        Of the contact per length [N/m^2], [N s/m^2].
    law : FrictionLaw
        mu over speed and normal force per length.
    friction_speed : float
        Of the regularisation [m/s].
    """

    beam: AncfBeam
    centre: np.ndarray
    radius: np.ndarray
    inertia: np.ndarray
    shape: np.ndarray
    stiffness: float
    damping: float
    law: FrictionLaw
    friction_speed: float


class State(NamedTuple):
    """Motion of a drive, and the work space of its steps.

    Attributes
    ----------
    chain : Chain
        Of the belt's n = k nodes.
    speed, acceleration, stage_speed, start_speed : (1, P) arrays
        Of the pulleys, counter-clockwise [rad/s], [rad/s^2], as those of the chain.
    slip, dual : (P, k, C) arrays
        Sliding speed of the last iterate [m/s], and the dual of friction.
    normal, tangential : (P, k, C) arrays
        Forces on the belt in the last stage, outwards and counter-clockwise [N].
    power : (4 + P,) array
        Of the last stage, in the order of the totals [W].
    rows, corner : (n, P - 1, 4) array, (1, P - 1) LaneArray
        Border of the equations: the pulleys but the first.
    counters, totals : (3,) int array, (4 + P,) array
        Work done [J].
    """

    chain: Chain
    speed: np.ndarray
    acceleration: np.ndarray
    stage_speed: np.ndarray
    start_speed: np.ndarray
    slip: np.ndarray
    dual: np.ndarray
    normal: np.ndarray
    tangential: np.ndarray
    power: np.ndarray
    rows: np.ndarray
    corner: LaneArray
    counters: np.ndarray
    totals: np.ndarray


def contact_shapes(points: int) -> np.ndarray:
    """Shapes (C, 4) at C points, each in the middle of its share of an element."""
    return shapes((np.arange(points) + 0.5) / points)[0]


def state(drive: Drive, q: np.ndarray, v: np.ndarray, speeds: np.ndarray) -> State:
    """Begin with positions and speeds (n, 4) of the belt and speeds (P,) of the pulleys [rad/s]."""
    pulleys, n, points = len(speeds), len(q), len(drive.shape)
    speed, acceleration, stage_speed, start_speed = np.zeros((4, 1, pulleys))
    speed[0] = speeds
    slip, dual, normal, tangential = np.zeros((4, pulleys, n, points))
    return State(
        chain(q, v, columns=pulleys),
        speed,
        acceleration,
        stage_speed,
        start_speed,
        slip,
        dual,
        normal,
        tangential,
        np.zeros(FRICTION_LOSS + pulleys),
        np.zeros((n, pulleys - 1, PER_NODE)),
        empty_corner(pulleys - 1, pulleys),
        np.zeros(3, np.int64),
        np.zeros(FRICTION_LOSS + pulleys),
    )


@kernel
def advance(
    drive: Drive,
    state: State,
    scheme: Scheme,
    inputs: np.ndarray,
    dt: float,
    steps: int,
    tolerance: float,
    most: int,
) -> bool:
    """Advance by some steps.

    Parameters
    ----------
    drive, state : Drive, State
        What moves, and its motion.
    scheme : Scheme
        Of the step.
    inputs : (2, P) array
        At the begin and at the end of all steps, linear between: speed of the first pulley [rad/s], and
        torques that act on the others [N m].
    dt : float
        Step [s].
    steps : int
        How many.
    tolerance : float
        Largest correction of a speed of the belt with which a stage counts as solved [m/s].
    most : int
        Corrections of a stage; after them it is counted as not solved, and the step is taken.

    Returns
    -------
    bool
        Whether the state is of numbers.
    """
    belt, tau, last = state.chain, stage_length(scheme, dt), drive.radius.size - 1
    for step in range(steps):
        begin_stage(belt, scheme, dt)
        begin(scheme, dt, state.speed, state.acceleration, state.start_speed)
        share = (step + scheme.alpha_f) / steps
        for p in range(1, last + 1):
            state.stage_speed[0, p] = state.speed[0, p]
        state.stage_speed[0, 0] = inputs[0, 0] + share * (inputs[1, 0] - inputs[0, 0])
        largest = np.inf
        for iteration in range(most):
            place(belt, tau)
            lost = assemble(
                drive.beam, belt.stage_q, belt.stage_v, belt.start_v, tau, belt.blocks, belt.columns, last
            )
            state.power[:] = 0.0
            state.power[BELT_LOSS] = lost
            add_pulleys(drive, state, inputs, share, tau)
            add_contacts(drive, state, tau, iteration > 0)
            state.counters[ITERATIONS] += 1
            if not factor(belt.blocks, SIZE):
                return False
            if not solve_bordered(belt.blocks, belt.columns, state.rows, state.corner, SIZE):
                return False
            largest = correct(belt, last)
            for p in range(last):
                state.stage_speed[0, p + 1] += state.corner.data[0, p, last]
            if not np.isfinite(largest):
                return False
            if largest <= tolerance:
                break
        finish_stage(belt, scheme, dt)
        finish(scheme, dt, state.stage_speed, state.start_speed, state.speed, state.acceleration)
        for k in range(state.totals.size):
            state.totals[k] += dt * state.power[k]
        state.counters[STEPS] += 1
        if largest > tolerance:
            state.counters[UNSOLVED] += 1
    return True


@kernel
def add_pulleys(drive: Drive, state: State, inputs: np.ndarray, share: float, tau: float) -> None:
    """Put the inertia of the pulleys and the torques that act on them into the border."""
    state.rows[:] = 0.0
    state.corner.data[:] = 0.0
    last = drive.radius.size - 1
    for p in range(last):
        torque = inputs[0, p + 1] + share * (inputs[1, p + 1] - inputs[0, p + 1])
        speed, inertia = state.stage_speed[0, p + 1], drive.inertia[p + 1]
        state.corner.data[0, p, p] = inertia / tau
        state.corner.data[0, p, last] = torque - inertia * (speed - state.start_speed[0, p + 1]) / tau
        state.power[WORK_OUT] -= torque * speed


@kernel
def add_contacts(drive: Drive, state: State, tau: float, is_known: bool) -> None:
    """Add the forces of contacts, and their slopes, to the equations of a stage.

    Parameters
    ----------
    drive, state : Drive, State
        What moves, and its motion.
    tau : float
        [s]
    is_known : bool
        Whether slip and dual are those of an iterate of this stage; else the slip of this one is taken.
    """
    q, u, n = state.chain.stage_q, state.chain.stage_v, state.chain.q.shape[0]
    blocks, columns = state.chain.blocks.data, state.chain.columns.data
    last, points = drive.radius.size - 1, drive.shape.shape[0]
    state.normal[:] = 0.0
    state.tangential[:] = 0.0
    for i in range(n):
        j = (i + 1) % n
        l0 = drive.beam.lengths[i]
        weight = l0 / points
        for c in range(points):
            s0, s1, s2, s3 = (
                drive.shape[c, 0],
                l0 * drive.shape[c, 1],
                drive.shape[c, 2],
                l0 * drive.shape[c, 3],
            )
            x = s0 * q[i, 0] + s1 * q[i, 2] + s2 * q[j, 0] + s3 * q[j, 2]
            y = s0 * q[i, 1] + s1 * q[i, 3] + s2 * q[j, 1] + s3 * q[j, 3]
            for p in range(last + 1):
                away_x, away_y, radius = x - drive.centre[p, 0], y - drive.centre[p, 1], drive.radius[p]
                if away_x * away_x + away_y * away_y >= radius * radius:
                    continue
                vx = s0 * u[i, 0] + s1 * u[i, 2] + s2 * u[j, 0] + s3 * u[j, 2]
                vy = s0 * u[i, 1] + s1 * u[i, 3] + s2 * u[j, 1] + s3 * u[j, 3]
                distance = np.sqrt(away_x * away_x + away_y * away_y)
                nx, ny = away_x / distance, away_y / distance
                outward, around = nx * vx + ny * vy, nx * vy - ny * vx
                depth = radius - distance
                pressure = drive.stiffness * depth - drive.damping * outward
                if pressure <= 0.0:
                    continue
                slip = around - state.stage_speed[0, p] * distance
                mu, mu_slope = friction_coefficient(drive.law, abs(slip), pressure)
                dual = state.dual[p, i, c]
                if is_known:
                    dual = dual_of(slip, 0.0, state.slip[p, i, c], 0.0, dual, 0.0, drive.friction_speed)[0]
                    state.dual[p, i, c] = dual
                state.slip[p, i, c] = slip
                found = friction(slip, 0.0, abs(slip), dual, 0.0, mu, mu_slope, drive.friction_speed)
                force, traction = weight * pressure, -weight * pressure * found[0]
                state.normal[p, i, c], state.tangential[p, i, c] = force, traction
                state.power[FRICTION_LOSS + p] -= traction * slip
                state.power[CONTACT_LOSS] += weight * drive.damping * outward * outward
                if p == 0:
                    state.power[WORK_IN] += traction * distance * state.stage_speed[0, 0]
                # slopes by speeds of the belt: of the force, of the slip, of traction and its moment
                steep = -weight * pressure * found[2]
                of_normal = -weight * (drive.stiffness * tau + drive.damping)
                of_around = -weight * drive.damping * tau * around / distance
                by_normal = steep * -tau * state.stage_speed[0, p] - found[0] * of_normal
                by_around = steep * (1.0 - tau * outward / distance) - found[0] * of_around
                turn = tau / distance  # of the normal
                nn, nt = of_normal, of_around - traction * turn
                tn, tt = by_normal, by_around + force * turn
                # with tangent (-ny, nx)
                xx = -(nx * nx * nn - nx * ny * (nt + tn) + ny * ny * tt)
                xy = -(nx * ny * (nn - tt) + nx * nx * nt - ny * ny * tn)
                yx = -(nx * ny * (nn - tt) + nx * nx * tn - ny * ny * nt)
                yy = -(ny * ny * nn + nx * ny * (nt + tn) + nx * nx * tt)
                fx, fy = force * nx - traction * ny, force * ny + traction * nx
                moment_n = distance * by_normal + tau * traction
                moment_t = distance * by_around
                mx, my = moment_n * nx - moment_t * ny, moment_n * ny + moment_t * nx
                if p > 0:
                    corner = state.corner.data
                    corner[0, p - 1, p - 1] -= steep * distance * distance
                    corner[0, p - 1, last] -= traction * distance
                lever = steep * distance
                for node in range(2):
                    at = i if node == 0 else j
                    for kind in range(2):
                        s = (s0 if kind == 0 else s1) if node == 0 else (s2 if kind == 0 else s3)
                        k = 2 * kind
                        columns[at, k, last] += s * fx
                        columns[at, k + 1, last] += s * fy
                        if p > 0:
                            columns[at, k, p - 1] -= s * lever * ny
                            columns[at, k + 1, p - 1] += s * lever * nx
                            state.rows[at, p - 1, k] += s * mx
                            state.rows[at, p - 1, k + 1] += s * my
                        for other in range(2):
                            block = DIAGONAL
                            if other != node:
                                block = UPPER if node == 0 else LOWER
                            row = block * PER_NODE + k
                            a = s * (s0 if other == 0 else s2)
                            b = s * (s1 if other == 0 else s3)
                            blocks[at, row, 0] += a * xx
                            blocks[at, row, 1] += a * xy
                            blocks[at, row, 2] += b * xx
                            blocks[at, row, 3] += b * xy
                            blocks[at, row + 1, 0] += a * yx
                            blocks[at, row + 1, 1] += a * yy
                            blocks[at, row + 1, 2] += b * yx
                            blocks[at, row + 1, 3] += b * yy
