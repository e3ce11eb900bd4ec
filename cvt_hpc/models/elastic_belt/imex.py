"""The fast step of the elastic belt: explicit in the strands, implicit in friction and longitudinal waves.

Staggered in time: w, n_i, v_f at t_k; u, v_i, omega at t_k-1/2. Transverse forces are explicit (leapfrog, no
numerical damping of the strands). Flank and ring friction enter with their slopes, the stresses T and P by
backward Euler, so neither the regularisation of friction nor the longitudinal waves (5-6 km/s) limit the
step. Eliminating u and the content leaves one cyclic block-tridiagonal system, 2x2 blocks (v_element,
v_ring), symmetric positive definite; the content then follows from the fluxes, so that each layer's total is
kept to round-off.

The rings' stress is centred in time and damps nothing; the elements' is taken at the end of the step, since
a centred one rings where they meet and part: it damps them like EA dt [N s], in first order. The set of
separated elements is frozen during a step: those that are apart and, with the old speeds, stay apart. What
limits the step is accuracy, c dt / h about 5, and the transverse contact and bending.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import (
    LaneArray,
    absolute,
    anywhere,
    decay,
    fma,
    like,
    maximum,
    minimum,
    reciprocals,
    select,
    sqrt,
    with_sign_of,
)
from cvt_hpc.models.elastic_belt.belt import (
    N_ELEMENT,
    N_RING,
    START_DAMPING,
    V_ELEMENT,
    V_FILTERED,
    V_RING,
    U,
    W,
)
from cvt_hpc.models.elastic_belt.lane_belt import (
    AXIAL_DAMPING,
    BELT_SPEED,
    BENDING_STIFFNESS,
    COSINE,
    DRIVEN_CARRY,
    DRIVEN_INERTIA,
    DRIVEN_RADIUS,
    DRIVING_CARRY,
    DRIVING_POSITION,
    DRIVING_RADIUS,
    DRIVING_SPEED,
    ELEMENT_DAMPING,
    ELEMENT_MASS,
    ELEMENT_STIFFNESS,
    FORGET,
    FRICTION_GRADIENT,
    FRICTION_SPEED,
    KINETIC_FRICTION,
    LAW_SPEED,
    LAYER_WORK,
    LOAD,
    LOAD_START,
    MASS,
    POSITION,
    RATIO,
    REPEATS,
    RING_DAMPING,
    RING_FRICTION,
    RING_FRICTION_SPEED,
    RING_MASS,
    RING_OFFSET,
    RING_RELIEF,
    RING_STIFFNESS,
    SINE,
    SPEED,
    THRUST,
    TRANSVERSE_DAMPING,
    WEDGE,
    LaneBelt,
    LaneState,
)
from cvt_hpc.physics.lane_compliance import CLOSED, GAP, solve_lane_contact
from cvt_hpc.physics.lane_compliance import PUSH as PUSHED
from cvt_hpc.physics.lane_friction import (
    lane_coefficient,
    lane_law,
    lane_table,
)
from cvt_hpc.physics.lane_gauss_seidel import sweep_lane_contact

MOST_PASSES = 3  # one, unless friction turns sliding about; a third where the second turns others
MOST_CONTACT_ROUNDS = 200
LEAST_SHARE_OF_WIDTH = 1e-3  # of friction_speed: below it friction is linear to 1e-6, and has no direction

# Share of the speeds' change in a step that the rings' stress feels. From 1/4 on it is stable for any step
# and damps nothing (Newmark); the rest keeps changing contact from exciting the shortest waves at long steps.
CENTRED = 0.35
FADED = 0.1  # [N s/m]: couplings of stations are 1e3 and more

# fields of ImexWork.stations
FORCE, LAST_U, EPS_0, EPS_1, SHORT_0, SHORT_1, PER_CONTENT_0, PER_CONTENT_1 = range(8)
PUSH, LAG, SLOPE, FLANK, FLANK_SLOPE, FLANK_CROSS, SLIDING_R, SLIDING_T, REVERSING = range(8, 17)
D_00, D_01, D_11, Y_0, Y_1 = range(17, 22)
I_00, I_01, I_11, DV_0, DV_1, G_00, G_01, G_10, G_11, LINK_0, LINK_1 = range(22, 33)
COEFFICIENT, FACTOR, PER_SPEED, RING_FACTOR = range(33, 37)
FIELDS_OF_WORK = 37


class ImexWork(NamedTuple):
    """Work space of the step.

    Attributes
    ----------
    stations : (N, 37) LaneArray
        Of the present state: axial line force, u one step earlier, the cells' strains, 1 / (1 + strain) and 1
        / content. Of the step: pending increment of u, its sensitivity to v_element's, slope w_s, the flanks'
        tangential force and its slopes, sliding speeds, whether (1) the linearised friction would throw the
        station back; the blocks of the system and its right side; the eliminated system: inverse pivots, the
        increments of v_element and v_ring, the border, the stresses' slopes with the speeds' differences; the
        law's coefficient, tanh of sliding speed over regularisation, 1 / that speed, the same of rings.
    """

    stations: LaneArray


def imex_work(state: LaneState) -> ImexWork:
    """Work space for a state; `derive` has to be called before the first step."""
    rows, _, lanes = state.fields.data.shape
    stations = LaneArray(rows, FIELDS_OF_WORK, lanes, state.fields.data.dtype)
    stations.data[:, LAST_U] = state.fields.data[:, U]
    return ImexWork(stations)


@merged_kernel
def implicit_shares(one, other, inertia):
    """Two slopes, weighted by 1/2 (time-centred) where slow, 1 where stiff; inertia = mass / dt.

    The linearised step then multiplies the velocity by an approximation of exp(-slope / inertia) that never
    changes sign.
    """
    per_one, per_other = reciprocals(fma(2.0, one, 12.0 * inertia), fma(2.0, other, 12.0 * inertia))
    return one * fma(one, per_one, 0.5), other * fma(other, per_other, 0.5)


@kernel
def step_imex(belt: LaneBelt, state: LaneState, work: ImexWork, step: float) -> None:
    """One step.

    Parameters
    ----------
    belt, state, work
        Constants, state (advanced in place), work space, that holds what `derive` finds of this state.
    step : float
        Step [s].
    """
    stations, scalars = work.stations, state.scalars
    _sliding(belt, state, stations)
    for attempt in range(MOST_PASSES):
        _stations(belt, state, work, step, attempt > 0)
        _eliminate(belt, state, work, step)
        if not _substitute(belt, work, scalars):
            break
    moment = _advance(belt, state, work, step)
    c = belt.constants
    speed = scalars[0, SPEED]
    load = like(c[0, RATIO], speed) * lane_load(belt, state.time[0], speed)
    scalars[0, SPEED] = speed + step * (moment - load) / like(c[0, DRIVEN_INERTIA], speed)
    axial = like(lane_thrust(belt, state, stations), speed)
    scalars[0, POSITION] = scalars[0, POSITION] + step * (axial - like(c[0, THRUST], speed)) / like(
        c[0, AXIAL_DAMPING], speed
    )
    state.time[0] += step
    derive(belt, state, stations)


@kernel
def derive(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Contact forces and strains of the present state."""
    lane_contact_forces(belt, state, stations)
    lane_strains(belt, state, stations)


@merged_kernel
def lane_load(belt: LaneBelt, time: float, pattern):
    """Torque at the driving pulley [N m], as `rhs.load_at` has it, in lanes like `pattern`."""
    c = belt.constants
    load, start = like(c[0, LOAD], pattern), like(c[0, LOAD_START], pattern)
    if time < belt.rise_time:
        return start * (0.5 * (1.0 - np.cos(np.pi * time / belt.rise_time)))
    if time < belt.ramp_end:
        return start + (load - start) * ((time - belt.rise_time) / (belt.ramp_end - belt.rise_time))
    return load


@merged_kernel
def start_damping(belt: LaneBelt, time: float) -> float:
    """What the start-up adds to the transverse damping [N s/m^2]."""
    left = max(1.0 - time / belt.rise_time, 0.0)
    return START_DAMPING * left * left


@kernel
def lane_thrust(belt: LaneBelt, state: LaneState, stations: LaneArray):
    """Axial force of the belt on the driven sheave [N]."""
    weight = state.contacts[1].weight
    total = like(0.0, stations[0, FORCE])
    for k in range(weight.size):
        total = fma(weight[k], stations[belt.driven_start + k, FORCE], total)
    return total


@kernel
def lane_contact_forces(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Axial line forces of both wraps into FORCE [N/m]; on the strands it stays 0."""
    fields, c = state.fields, belt.constants
    wedge = c[0, WEDGE]
    for wrap in range(2):
        contact = state.contacts[1] if wrap else state.contacts[0]
        opening = like(state.scalars[0, POSITION], wedge) if wrap else c[0, DRIVING_POSITION]
        first = belt.driven_start if wrap else 0
        wrap_stations = contact.stations
        for k in range(contact.weight.size):
            wrap_stations[k, GAP] = fma(wedge, fields[first + k, W], opening)
        if contact.sweeps > 0:
            sweep_lane_contact(contact)
        else:
            solve_lane_contact(contact, MOST_CONTACT_ROUNDS)
        for k in range(contact.weight.size):
            push = maximum(wrap_stations[k, PUSHED], 0.0)
            stations[first + k, FORCE] = select(wrap_stations[k, CLOSED] > 0.5, push, 0.0)


@kernel
def lane_strains(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Strains of elements and rings in the cells, with 1 / (1 + strain) and 1 / content."""
    n, fields = belt.cell.size, state.fields
    offset = belt.constants[0, RING_OFFSET]
    w_b = fields[0, W]
    for k in range(n - 1, -1, -1):
        kappa = belt.curvature[k]
        w = fields[k, W]
        more_0, more_1 = fields[k, N_ELEMENT], fields[k, N_RING]
        content_0, content_1 = more_0 + 1.0, fma(offset, kappa, more_1 + 1.0)
        per_0, per_1 = reciprocals(content_0, content_1)
        if kappa > 0.0:
            bent = (w + w_b) * (0.5 * kappa)
            length_0, length_1 = bent + 1.0, fma(offset, kappa, bent + 1.0)
            per_length_0, per_length_1 = reciprocals(length_0, length_1)
            stations[k, EPS_0], stations[k, EPS_1] = (bent - more_0) * per_0, (bent - more_1) * per_1
            stations[k, SHORT_0] = content_0 * per_length_0
            stations[k, SHORT_1] = content_1 * per_length_1
        else:
            stations[k, EPS_0], stations[k, EPS_1] = -more_0 * per_0, -more_1 * per_1
            stations[k, SHORT_0], stations[k, SHORT_1] = content_0, content_1
        stations[k, PER_CONTENT_0], stations[k, PER_CONTENT_1] = per_0, per_1
        w_b = w


@kernel
def _sliding(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Sliding speeds on the arcs, and what friction does of them alone.

    A loop of its own: the chain of operations from a speed to the system's rows is longer than what a
    processor looks ahead, so that it would not begin a station before the last one is nearly done.
    """
    n, fields, c = belt.cell.size, state.fields, belt.constants
    kind, memory = belt.law.kind, belt.memory
    table = belt.law.table_force, belt.law.table_speed, belt.law.table_mu
    kinetic, fall, per_scale = lane_law(
        kind, c[0, KINETIC_FRICTION], c[0, FRICTION_GRADIENT], c[0, LAW_SPEED]
    )
    per_cosine, belt_speed, offset = 1.0 / c[0, COSINE], c[0, BELT_SPEED], c[0, RING_OFFSET]
    least = LEAST_SHARE_OF_WIDTH * c[0, FRICTION_SPEED]
    per_width, per_ring_width = 1.0 / c[0, FRICTION_SPEED], 1.0 / c[0, RING_FRICTION_SPEED]
    driven_speed = state.scalars[0, SPEED]
    driven_base = driven_speed * like(c[0, DRIVEN_RADIUS], driven_speed) - like(belt_speed, driven_speed)
    turning = c[0, DRIVING_SPEED]
    surface = turning * c[0, DRIVING_RADIUS] - belt_speed
    for j in range(n):
        if j == belt.driven_start:
            surface, turning = like(driven_base, least), like(driven_speed, least)
        if belt.arc_share[j] == 0.0:
            continue
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        full_speed = belt_speed + fields[j, V_ELEMENT]
        slope = (fields[b, W] - fields[a, W]) * belt.per_span[j]
        v_radial = fma(full_speed, slope, fields[j, U])
        v_tangential = fields[j, V_ELEMENT] - fma(turning, fields[j, W], surface)
        meridian = v_radial * per_cosine
        speed = sqrt(fma(meridian, meridian, v_tangential * v_tangential))
        v_law = fields[j, V_FILTERED] if memory else speed
        if kind == 5:
            coefficient = lane_table(table, v_law, stations[j, FORCE] * per_cosine)
        else:
            coefficient = lane_coefficient(kind, kinetic, fall, per_scale, v_law)
        # tanh(x) = (1 - e^-2x) / (1 + e^-2x) for flanks and rings
        speed = maximum(speed, least)
        saddle = fma(fma(offset, belt.arc_curvature[j], 1.0), full_speed, -(belt_speed + fields[j, V_RING]))
        rest, ring_rest = decay(speed * (2.0 * per_width)), decay(absolute(saddle) * (2.0 * per_ring_width))
        per_flank = 1.0 / (speed * (1.0 + rest))
        stations[j, SLIDING_R], stations[j, SLIDING_T] = v_radial, v_tangential
        stations[j, COEFFICIENT] = coefficient
        stations[j, FACTOR], stations[j, PER_SPEED] = (
            (1.0 - rest) * (speed * per_flank),
            (1.0 + rest) * per_flank,
        )
        stations[j, RING_FACTOR] = with_sign_of((1.0 - ring_rest) / (1.0 + ring_rest), saddle)


@kernel
def _stations(belt: LaneBelt, state: LaneState, work: ImexWork, step: float, again: bool) -> None:
    """Forces and slopes at the stations, but for the stresses T and P: the system's blocks and right side.

    `again` looks at stations alone that some lane's friction would throw back.
    """
    n, fields, stations, c = belt.cell.size, state.fields, work.stations, belt.constants
    per_step = 1.0 / step
    sine, cosine, width = c[0, SINE], c[0, COSINE], c[0, FRICTION_SPEED]
    per_cosine, per_width = 1.0 / cosine, 1.0 / width
    element_stiffness, ring_stiffness = c[0, ELEMENT_STIFFNESS], c[0, RING_STIFFNESS]
    element_mass, ring_mass, mass, offset = c[0, ELEMENT_MASS], c[0, RING_MASS], c[0, MASS], c[0, RING_OFFSET]
    belt_speed, bending = c[0, BELT_SPEED], c[0, BENDING_STIFFNESS]
    ring_friction, per_ring_width = c[0, RING_FRICTION], 1.0 / c[0, RING_FRICTION_SPEED]
    ring_relief = c[0, RING_RELIEF]
    centrifugal, gyroscopic = mass * belt_speed * belt_speed, 2.0 * mass * belt_speed
    damping = c[0, TRANSVERSE_DAMPING] + start_damping(belt, state.time[0])
    base_mass = fma(mass, per_step, 0.5 * damping)
    element_rate = element_mass * per_step
    zero = like(0.0, sine)
    for j in range(n):
        share = belt.arc_share[j]
        if again and (share == 0.0 or not anywhere(stations[j, REVERSING] > 0.5)):
            continue
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        aa, bb = a - 1 if a > 0 else n - 1, b + 1 if b < n - 1 else 0
        left, right, dual = belt.cell[a], belt.cell[j], belt.dual[j]
        per_left, span = belt.per_cell[a], belt.per_span[j]
        w, u, v0, v1 = fields[j, W], fields[j, U], fields[j, V_ELEMENT], fields[j, V_RING]
        w_a, w_b = fields[a, W], fields[b, W]
        ring_left, ring_right = ring_stiffness * stations[a, EPS_1], ring_stiffness * stations[j, EPS_1]
        net_left = fma(element_stiffness, minimum(stations[a, EPS_0], 0.0), ring_left - centrifugal)
        net_right = fma(element_stiffness, minimum(stations[j, EPS_0], 0.0), ring_right - centrifugal)
        slope = (w_b - w_a) * span
        # u at t_k, extrapolated: the gyroscopic term then neither damps nor feeds
        change = 1.5 * (fields[b, U] - fields[a, U]) - 0.5 * (stations[b, LAST_U] - stations[a, LAST_U])
        bent = fma(
            belt.bending[j, 0],
            fields[aa, W],
            fma(belt.bending[j, 4], fields[bb, W], belt.bending[j, 2] * w),
        )
        bent = fma(belt.bending[j, 1], w_a, fma(belt.bending[j, 3], w_b, bent))
        tension = net_right * ((w_b - w) * belt.per_cell[j]) - net_left * ((w - w_a) * per_left)
        inward = net_right * (0.5 * right * belt.curvature[j]) + net_left * (0.5 * left * belt.curvature[a])
        transverse = fma(tension - inward, belt.per_dual[j], bending * bent)
        transverse = fma(-gyroscopic, change * span, transverse)
        full_speed = belt_speed + v0
        v_radial = fma(full_speed, slope, u)
        outward = -damping * v_radial
        longer = fma(offset, belt.ring_curvature[j], 1.0)
        ring_here = ring_mass * longer
        element, ring, coupling = element_rate, ring_here * per_step, zero
        along_element = -full_speed * ((v0 - fields[a, V_ELEMENT]) * per_left) * element_mass
        along_ring = -(belt_speed + v1) * ((v1 - fields[a, V_RING]) * per_left) * ring_here
        radial_mass, cross = base_mass, zero
        if share > 0.0:
            lever = fma(offset, belt.arc_curvature[j], 1.0)
            v_tangential, coefficient = stations[j, SLIDING_T], stations[j, COEFFICIENT]
            per_speed, factor = stations[j, PER_SPEED], stations[j, FACTOR]
            ring_factor, meridian, force = stations[j, RING_FACTOR], v_radial * per_cosine, stations[j, FORCE]

            relief = ring_relief * longer
            pressure = maximum(ring_right - relief, 0.0) * (right * belt.curvature[j])
            pressure += maximum(ring_left - relief, 0.0) * (left * belt.curvature[a])
            grip = ring_friction * (0.5 * belt.per_dual[j]) * pressure
            drag = grip * ring_factor
            stiff = grip * (fma(-ring_factor, ring_factor, 1.0) * per_ring_width)

            # Bullinger et al. 2005, eqs 37-39, with the slopes of friction along and across the sliding
            mu = coefficient * factor
            climb, run = meridian * per_speed, v_tangential * per_speed
            upward = mu * climb
            per_normal, per_stiff = reciprocals(fma(upward, sine, cosine), fma(2.0, stiff, 12.0 * ring))
            twice_normal = (2.0 * share) * force * per_normal
            outward += twice_normal * fma(-upward, cosine, sine)
            friction = twice_normal * mu
            tangential = -friction * run
            across = friction * per_speed
            # by the secant friction stops, and never throws back
            thrown = stations[j, REVERSING] > 0.5 if again else share < zero
            along = twice_normal * coefficient * (fma(-factor, factor, 1.0) * per_width)
            along, across = implicit_shares(select(thrown, across, along), across, element_rate)
            excess = along - across
            radial_mass = fma(fma(excess, climb * climb, across), per_cosine * per_cosine, radial_mass)
            cross = excess * climb * run * per_cosine
            flank_slope = fma(excess, run * run, across)
            stiff *= fma(stiff, per_stiff, 0.5)
            along_element += fma(-lever, drag, tangential)
            along_ring += drag
            element += fma(lever * lever, stiff, flank_slope)
            ring += stiff
            coupling = -lever * stiff
            stations[j, FLANK], stations[j, FLANK_SLOPE] = tangential, flank_slope
            stations[j, FLANK_CROSS] = cross
            if not again:
                stations[j, REVERSING] = zero
        along_element = fma(outward, slope, along_element)
        mobility = 1.0 / radial_mass
        push, lag = (transverse + outward) * mobility, cross * mobility
        stations[j, PUSH], stations[j, LAG], stations[j, SLOPE] = push, lag, slope
        stations[j, D_00] = dual * fma(-cross, lag, element)
        stations[j, D_01] = dual * coupling
        stations[j, D_11] = dual * ring
        stations[j, Y_0] = dual * fma(-cross, push, along_element)
        stations[j, Y_1] = dual * along_ring


@merged_kernel
def _element_stress(stiffness, grip, eps, closing, ahead, per_length):
    """-P in a cell [N] with the speeds that the step begins with, and its slope with their change.

    Parameters
    ----------
    stiffness, grip
        EA [N], damping over the cell's length [N s/m].
    eps, closing
        Strain and difference of the speeds at both ends [m/s].
    ahead, per_length
        Strain at the end of the step with these speeds, and its slope with the difference [s/m].
    """
    viscous = grip * closing
    # elements never pull: their damper ends where it would outweigh the push force
    pulls = viscous > -stiffness * eps
    viscous, grip = select(pulls, -stiffness * minimum(eps, 0.0), viscous), select(pulls, 0.0, grip)
    apart = (eps >= 0.0) & (ahead >= 0.0)
    stress = select(apart, 0.0, fma(stiffness, ahead, viscous))
    return stress, select(apart, 0.0, fma(stiffness, per_length, grip))


@kernel
def _eliminate(belt: LaneBelt, state: LaneState, work: ImexWork, step: float) -> None:
    """Stresses into the rows, and forward elimination; the last station, that closes the cycle, is solved."""
    fields, stations, c = state.fields, work.stations, belt.constants
    n = belt.cell.size
    last = n - 1
    belt_speed = c[0, BELT_SPEED]
    element_stiffness, ring_stiffness = c[0, ELEMENT_STIFFNESS], c[0, RING_STIFFNESS]
    element_damping, ring_damping = c[0, ELEMENT_DAMPING], c[0, RING_DAMPING]
    zero = like(0.0, belt_speed)
    p = q = r = f0 = f1 = c00 = c01 = c10 = c11 = t00 = t01 = t11 = s0 = s1 = zero
    for k in range(-1, last):
        # the last cell first, which is behind station 0
        j = k if k >= 0 else last
        a, b = j - 1 if j > 0 else last, j + 1 if j < last else 0
        per_cell = belt.per_cell[j]
        v0, v1 = fields[j, V_ELEMENT], fields[j, V_RING]
        closing_0, closing_1 = fields[b, V_ELEMENT] - v0, fields[b, V_RING] - v1
        eps = stations[j, EPS_0]
        # what leaves ahead less what enters behind, per (1 + eps): v[b] - v[j] (1 + eps) / (1 + eps_a)
        outflow = fma(-(belt_speed + v0), (eps - stations[a, EPS_0]) * stations[a, SHORT_0], closing_0)
        kappa = belt.curvature[j]
        if kappa > 0.0:
            lifts = fields[j, U] + stations[j, PUSH] + fields[b, U] + stations[b, PUSH]
            outflow = fma(0.5 * kappa * belt.cell[j], lifts, outflow)
        per_length = (step * per_cell) * stations[j, PER_CONTENT_0]
        stress_0, e0 = _element_stress(
            element_stiffness,
            element_damping * per_cell,
            eps,
            closing_0,
            fma(per_length, outflow, eps),
            per_length,
        )
        grip = ring_damping * per_cell
        stress_1 = fma(ring_stiffness, stations[j, EPS_1], grip * closing_1)
        e1 = fma(CENTRED * ring_stiffness, (step * per_cell) * stations[j, PER_CONTENT_1], grip)
        stations[j, LINK_0], stations[j, LINK_1] = e0, e1
        if k < 0:
            # Schur complement of the last station; coupling of the present row to it (00, 01, 10, 11); what
            # the row before leaves to the present one
            p, q, r = stations[last, D_00] + e0, stations[last, D_01], stations[last, D_11] + e1
            f0, f1 = stations[last, Y_0] + stress_0, stations[last, Y_1] + stress_1
            c00, c11 = -e0, -e1
            t00, t11, s0, s1 = e0, e1, -stress_0, -stress_1
            continue
        d00, d01 = stations[j, D_00] + (e0 + t00), stations[j, D_01] + t01
        d11 = stations[j, D_11] + (e1 + t11)
        y0, y1 = stations[j, Y_0] + (stress_0 + s0), stations[j, Y_1] + (stress_1 + s1)
        if j == last - 1:
            c00 -= e0
            c11 -= e1
            # the last row holds its own link behind
            p += e0
            r += e1
            f0 -= stress_0
            f1 -= stress_1
        per_determinant = 1.0 / fma(d00, d11, -d01 * d01)
        i00, i01, i11 = d11 * per_determinant, -d01 * per_determinant, d00 * per_determinant
        z0, z1 = fma(i00, y0, i01 * y1), fma(i01, y0, i11 * y1)
        g00, g01 = fma(i00, c00, i01 * c10), fma(i00, c01, i01 * c11)
        g10, g11 = fma(i01, c00, i11 * c10), fma(i01, c01, i11 * c11)
        p = fma(-c00, g00, fma(-c10, g10, p))
        q = fma(-c00, g01, fma(-c10, g11, q))
        r = fma(-c01, g01, fma(-c11, g11, r))
        f0 = fma(-c00, z0, fma(-c10, z1, f0))
        f1 = fma(-c01, z0, fma(-c11, z1, f1))
        stations[j, I_00], stations[j, I_01], stations[j, I_11] = i00, i01, i11
        stations[j, DV_0], stations[j, DV_1] = z0, z1
        stations[j, G_00], stations[j, G_01], stations[j, G_10], stations[j, G_11] = g00, g01, g10, g11
        t00, t01, t11 = fma(-e0 * e0, i00, e0), -e0 * e1 * i01, fma(-e1 * e1, i11, e1)
        s0, s1 = fma(e0, z0, -stress_0), fma(e1, z1, -stress_1)
        # it fades along the belt, beyond all need: kept from numbers so small that the processor slows down
        c00, c01 = (e0 * g00 + FADED) - FADED, (e0 * g01 + FADED) - FADED
        c10, c11 = (e1 * g10 + FADED) - FADED, (e1 * g11 + FADED) - FADED
    per_determinant = 1.0 / fma(p, r, -q * q)
    stations[last, DV_0] = fma(r, f0, -q * f1) * per_determinant
    stations[last, DV_1] = fma(p, f1, -q * f0) * per_determinant


@kernel
def _substitute(belt: LaneBelt, work: ImexWork, scalars: LaneArray) -> bool:
    """Back substitution: DV become the increments of v_element and v_ring. Whether friction has to be redone.

    It has where a station slid in the saturated range and would now slide back. There the tangent of friction
    is flat, the step all but explicit, and a large friction force turns the sliding about within a step: it
    chatters, and takes energy out of nothing. Such stations are marked.
    """
    stations = work.stations
    last = belt.cell.size - 1
    x0, x1 = stations[last, DV_0], stations[last, DV_1]
    width = belt.constants[0, FRICTION_SPEED]
    saturated = width * width
    n0, n1 = x0, x1
    found = width < 0.0
    for j in range(last, -1, -1):
        if j < last:
            z0 = fma(-stations[j, G_01], x1, fma(-stations[j, G_00], x0, stations[j, DV_0]))
            z1 = fma(-stations[j, G_11], x1, fma(-stations[j, G_10], x0, stations[j, DV_1]))
            if j < last - 1:
                # behind the last but one comes the border, whose share is in G
                e0, e1 = stations[j, LINK_0] * n0, stations[j, LINK_1] * n1
                i01 = stations[j, I_01]
                z0 = fma(stations[j, I_00], e0, fma(i01, e1, z0))
                z1 = fma(i01, e0, fma(stations[j, I_11], e1, z1))
            n0, n1 = z0, z1
            stations[j, DV_0], stations[j, DV_1] = n0, n1
        if belt.arc_share[j] > 0.0:
            v_radial, v_tangential = stations[j, SLIDING_R], stations[j, SLIDING_T]
            rise = fma(stations[j, SLOPE] - stations[j, LAG], n0, stations[j, PUSH])
            turn = fma(v_radial, rise, v_tangential * n0)
            speed_squared = fma(v_radial, v_radial, v_tangential * v_tangential)
            back = (speed_squared > saturated) & (turn < -speed_squared)
            back &= stations[j, REVERSING] < 0.5
            found |= back
            stations[j, REVERSING] = select(back, 1.0, stations[j, REVERSING])
    scalars[0, REPEATS] = scalars[0, REPEATS] + select(found, like(1.0, scalars[0, REPEATS]), 0.0)
    return anywhere(found)


@kernel
def _advance(belt: LaneBelt, state: LaneState, work: ImexWork, step: float):
    """Apply the increments; returns the moment of the flanks on the driven pulley [N m], in doubles."""
    n, fields, stations, c = belt.cell.size, state.fields, work.stations, belt.constants
    per_cosine = 1.0 / c[0, COSINE]
    belt_speed, forget = c[0, BELT_SPEED], c[0, FORGET]
    driven_speed = state.scalars[0, SPEED]
    driven_base = driven_speed * like(c[0, DRIVEN_RADIUS], driven_speed) - like(belt_speed, driven_speed)
    zero = like(0.0, forget)
    surface, turning, radius = like(driven_base, zero), like(driven_speed, zero), c[0, DRIVEN_RADIUS]
    carry = c[0, DRIVEN_CARRY]
    per_rate = 1.0 / (carry + forget)
    keep = decay((carry + forget) * step)
    moment = like(0.0, driven_speed)
    work_done = zero
    for layer in range(2):
        stiffness, damper = c[0, ELEMENT_STIFFNESS + layer], c[0, ELEMENT_DAMPING + layer]
        v_row, dv_row, eps_row, n_row = V_ELEMENT + layer, DV_0 + layer, EPS_0 + layer, N_ELEMENT + layer
        # at the station ahead of a cell: speed, its increment, and the flux of content less the belt speed
        v_b, dv_b = fields[0, v_row], stations[0, dv_row]
        shorter = stations[n - 1, SHORT_0 + layer]
        flux_b = first_flux = fma(-belt_speed, stations[n - 1, eps_row], v_b + dv_b) * shorter
        for j in range(n - 1, -1, -1):
            v, dv, eps = fields[j, v_row], stations[j, dv_row], stations[j, eps_row]
            new = v + dv
            flux = first_flux
            if j > 0:
                flux = fma(-belt_speed, stations[j - 1, eps_row], new) * stations[j - 1, SHORT_0 + layer]
            per_cell = belt.per_cell[j]
            closing, change = v_b - v, dv_b - dv
            viscous = damper * per_cell * closing
            damped = fma(damper * per_cell, change, viscous)
            if layer == 0:
                damped = select(viscous > -stiffness * eps, -stiffness * minimum(eps, 0.0), damped)
                damped = select(stations[j, LINK_0] > 0.0, damped, 0.0)
            work_done = fma(damped, fma(0.5, change, closing), work_done)
            fields[j, n_row] = fma(step * per_cell, flux - flux_b, fields[j, n_row])
            fields[j, v_row] = new
            v_b, dv_b, flux_b = v, dv, flux
    for j in range(n - 1, -1, -1):
        dv = stations[j, DV_0]
        u = fields[j, U]
        du = fma(-stations[j, LAG], dv, stations[j, PUSH])
        stations[j, LAST_U] = u
        u = u + du
        fields[j, U] = u
        w = fields[j, W]
        if belt.arc_share[j] > 0.0:
            if j < belt.driven_start:
                surface = c[0, DRIVING_SPEED] * c[0, DRIVING_RADIUS] - belt_speed
                turning = c[0, DRIVING_SPEED]
                carry = c[0, DRIVING_CARRY]
                per_rate = 1.0 / (carry + forget)
                keep = decay((carry + forget) * step)
            else:
                slopes = fma(stations[j, FLANK_SLOPE], dv, stations[j, FLANK_CROSS] * du)
                tangential = (stations[j, FLANK] - slopes) * (belt.dual[j] * (radius + w))
                moment = moment - like(tangential, moment)
            if belt.memory:
                v0 = fields[j, V_ELEMENT]
                v_tangential = v0 - fma(turning, w, surface)
                meridian = fma(belt_speed + v0, stations[j, SLOPE], u) * per_cosine
                speed = sqrt(fma(meridian, meridian, v_tangential * v_tangential))
                if j == 0 or j == belt.driven_start:
                    fields[j, V_FILTERED] = speed
                else:
                    target = fma(carry, fields[j - 1, V_FILTERED], forget * speed) * per_rate
                    fields[j, V_FILTERED] = fma(fields[j, V_FILTERED] - target, keep, target)
        fields[j, W] = fma(step, u, w)
    state.scalars[0, LAYER_WORK] = state.scalars[0, LAYER_WORK] + like(work_done, moment) * step
    return moment
