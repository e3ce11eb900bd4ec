"""The fast step of the elastic belt: explicit in the strands, implicit in friction and longitudinal waves.

Staggered in time: w, n_i, v_f at t_k; u, v_i, omega at t_k-1/2. Transverse forces are explicit (leapfrog, no
numerical damping of the strands). Flank and ring friction enter with their slopes, the stresses T and P by
backward Euler, so neither the regularisation of friction nor the longitudinal waves (5-6 km/s) limit the
step. Eliminating u and the content leaves one cyclic block-tridiagonal system, 2x2 blocks (v_element,
v_ring), symmetric positive definite; the content then follows from the fluxes, so that each layer's total is
kept to round-off.

First order in the longitudinal part: it damps pressed elements like EA dt / 2 [N s]. The set of separated
elements is frozen during a step: those that are apart and, with the old speeds, stay apart. What limits the
step is accuracy, c dt / h about 5, and the transverse contact and bending.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import lane_kernel, merged_lane_kernel
from cvt_hpc.lanes import LaneArray, anywhere, exp, fma, like, maximum, minimum, select, sqrt
from cvt_hpc.models.elastic_belt.belt import (
    N_ELEMENT,
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
    RING_FRICTION,
    RING_FRICTION_SPEED,
    RING_MASS,
    RING_OFFSET,
    RING_STIFFNESS,
    SINE,
    SPEED,
    THRUST,
    TRANSVERSE_DAMPING,
    WEDGE,
    LaneBelt,
    LaneState,
)
from cvt_hpc.physics.lane_compliance import GAP, closed_force, solve_lane_contact
from cvt_hpc.physics.lane_friction import lane_coefficient, lane_saturation, lane_table

MOST_PASSES = 3  # one, unless friction turns sliding about; a third where the second turns others
MOST_CONTACT_ROUNDS = 200
LEAST_SHARE_OF_WIDTH = 1e-3  # of friction_speed: below it friction is linear to 1e-6, and has no direction

# fields of ImexWork.stations
FORCE, LAST_U, EPS_0, EPS_1 = range(4)
PUSH, LAG, SLOPE, FLANK, FLANK_SLOPE, FLANK_CROSS, SLIDING_R, SLIDING_T, REVERSING = range(4, 13)
D_00, D_01, D_11, Y_0, Y_1, G_00, G_01, G_10, G_11 = range(13, 22)
LINK_0, LINK_1 = 22, 23


class ImexWork(NamedTuple):
    """Work space of the step.

    Attributes
    ----------
    stations : (N, 24) LaneArray
        Axial line force, u one step earlier, the cells' strains; pending increment of u, its sensitivity to
        v_element's, slope w_s, the flanks' tangential force and its slopes, sliding speeds, whether (1) the
        linearised friction of this step would throw the station back; the blocks of the system, its right
        side and solution, its border, the stresses' slopes with the difference of the speeds.
    """

    stations: LaneArray


def imex_work(state: LaneState) -> ImexWork:
    """Work space for a state."""
    rows, _, lanes = state.fields.data.shape
    stations = LaneArray(rows, 24, lanes, state.fields.data.dtype)
    stations.data[:, LAST_U] = state.fields.data[:, U]
    return ImexWork(stations)


@merged_lane_kernel
def implicit_share(rate):
    """Weight of a slope in the step: 1/2 (time-centred) where slow, 1 where stiff; rate = dt x slope / mass.

    The linearised step then multiplies the velocity by an approximation of exp(-rate) that never changes
    sign.
    """
    return 0.5 + rate / (12.0 + 2.0 * rate)


@lane_kernel
def step_imex(belt: LaneBelt, state: LaneState, work: ImexWork, step: float) -> None:
    """One step.

    Parameters
    ----------
    belt, state, work
        Constants, state (advanced in place), work space.
    step : float
        Step [s].
    """
    lane_contact_forces(belt, state, work.stations)
    lane_strains(belt, state, work.stations)
    stations, scalars = work.stations, state.scalars
    n = belt.cell.size
    for j in range(n):
        stations[j, REVERSING] = 0.0
    for _ in range(MOST_PASSES):
        _stations(belt, state, work, step)
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


@merged_lane_kernel
def lane_load(belt: LaneBelt, time: float, pattern):
    """Torque at the driving pulley [N m], as `rhs.load_at` has it, in lanes like `pattern`."""
    c = belt.constants
    load, start = like(c[0, LOAD], pattern), like(c[0, LOAD_START], pattern)
    if time < belt.rise_time:
        return start * (0.5 * (1.0 - np.cos(np.pi * time / belt.rise_time)))
    if time < belt.ramp_end:
        return start + (load - start) * ((time - belt.rise_time) / (belt.ramp_end - belt.rise_time))
    return load


@merged_lane_kernel
def start_damping(belt: LaneBelt, time: float) -> float:
    """What the start-up adds to the transverse damping [N s/m^2]."""
    left = max(1.0 - time / belt.rise_time, 0.0)
    return START_DAMPING * left * left


@merged_lane_kernel
def coefficient_of_law(belt: LaneBelt, speed, normal):
    """Coefficient of friction in steady sliding at a speed [m/s] under a normal line force [N/m]."""
    law, c = belt.law, belt.constants
    if law.kind == 5:
        mu = lane_table(law.table_force, law.table_speed, law.table_mu, speed, normal)
    else:
        mu = lane_coefficient(
            law.kind, c[0, KINETIC_FRICTION], c[0, FRICTION_GRADIENT], c[0, LAW_SPEED], speed
        )
    return mu


@lane_kernel
def lane_thrust(belt: LaneBelt, state: LaneState, stations: LaneArray):
    """Axial force of the belt on the driven sheave [N]."""
    weight = state.contacts[1].weight
    total = like(0.0, stations[0, FORCE])
    for k in range(weight.size):
        total = fma(weight[k], stations[belt.driven_start + k, FORCE], total)
    return total


@lane_kernel
def lane_contact_forces(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Axial line forces of both wraps into FORCE [N/m]; on the strands it stays 0."""
    fields, c = state.fields, belt.constants
    wedge = c[0, WEDGE]
    for wrap in range(2):
        contact = state.contacts[1] if wrap else state.contacts[0]
        opening = like(state.scalars[0, POSITION], wedge) if wrap else c[0, DRIVING_POSITION]
        first = belt.driven_start if wrap else 0
        for k in range(contact.weight.size):
            contact.stations[k, GAP] = fma(wedge, fields[first + k, W], opening)
        solve_lane_contact(contact, MOST_CONTACT_ROUNDS)
        for k in range(contact.weight.size):
            stations[first + k, FORCE] = closed_force(contact.stations, k)


@lane_kernel
def lane_strains(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Strains of elements and rings in the cells."""
    n, fields = belt.cell.size, state.fields
    offset = belt.constants[0, RING_OFFSET]
    for k in range(n):
        kappa = belt.curvature[k]
        bent = (fields[k, W] + fields[k + 1 if k < n - 1 else 0, W]) * (0.5 * kappa)
        element, ring = fields[k, N_ELEMENT], fields[k, N_ELEMENT + 1]
        stations[k, EPS_0] = (bent - element) / (element + 1.0)
        stations[k, EPS_1] = (bent - ring) / (ring + 1.0 + kappa * offset)


@lane_kernel
def _stations(belt: LaneBelt, state: LaneState, work: ImexWork, step: float) -> None:
    """Forces and slopes at the stations, but for the stresses T and P: the system's blocks and right side."""
    n, fields, stations, c = belt.cell.size, state.fields, work.stations, belt.constants
    memory, per_step = belt.memory, 1.0 / step
    sine, cosine, width = c[0, SINE], c[0, COSINE], c[0, FRICTION_SPEED]
    per_cosine = 1.0 / cosine
    element_stiffness, ring_stiffness = c[0, ELEMENT_STIFFNESS], c[0, RING_STIFFNESS]
    element_mass, ring_mass, mass, offset = c[0, ELEMENT_MASS], c[0, RING_MASS], c[0, MASS], c[0, RING_OFFSET]
    belt_speed, bending = c[0, BELT_SPEED], c[0, BENDING_STIFFNESS]
    ring_friction, ring_width = c[0, RING_FRICTION], c[0, RING_FRICTION_SPEED]
    centrifugal, gyroscopic = mass * belt_speed * belt_speed, 2.0 * mass * belt_speed
    damping = c[0, TRANSVERSE_DAMPING] + start_damping(belt, state.time[0])
    base_mass = fma(mass, per_step, 0.5 * damping)
    element_rate, per_element_mass = element_mass * per_step, step / element_mass
    driven_speed = state.scalars[0, SPEED]
    driven_base = driven_speed * like(c[0, DRIVEN_RADIUS], driven_speed) - like(belt_speed, driven_speed)
    driving_base = c[0, DRIVING_SPEED] * c[0, DRIVING_RADIUS] - belt_speed
    surface, turning = driving_base, c[0, DRIVING_SPEED]
    least = LEAST_SHARE_OF_WIDTH * width
    zero = like(0.0, sine)
    for j in range(n):
        if j == belt.driven_start:
            surface, turning = like(driven_base, zero), like(driven_speed, zero)
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
        transverse = (tension - inward) * belt.per_dual[j] - gyroscopic * (change * span) + bending * bent
        full_speed = belt_speed + v0
        v_radial = fma(full_speed, slope, u)
        outward = -damping * v_radial
        ring_here = ring_mass * fma(offset, belt.ring_curvature[j], 1.0)
        element, ring, coupling = element_rate, ring_here * per_step, zero
        along_element = -full_speed * ((v0 - fields[a, V_ELEMENT]) * per_left) * element_mass
        along_ring = -(belt_speed + v1) * ((v1 - fields[a, V_RING]) * per_left) * ring_here
        radial_mass, cross = base_mass, zero
        share = belt.arc_share[j]
        if share > 0.0:
            v_tangential = v0 - fma(turning, w, surface)
            meridian = v_radial * per_cosine
            speed = sqrt(fma(meridian, meridian, v_tangential * v_tangential))
            force = stations[j, FORCE]
            v_law = fields[j, V_FILTERED] if memory else speed
            coefficient = coefficient_of_law(belt, v_law, force * per_cosine)
            # Bullinger et al. 2005, eqs 37-39, with the slopes of friction along and across the sliding
            per_speed = 1.0 / maximum(speed, least)
            factor, steepness = lane_saturation(maximum(speed, least), width)
            mu = coefficient * factor
            climb, run = meridian * per_speed, v_tangential * per_speed
            upward = mu * climb
            twice_normal = (2.0 * share) * force / fma(upward, sine, cosine)
            outward += twice_normal * (sine - upward * cosine)
            tangential = -twice_normal * mu * run
            along_element += tangential
            across = twice_normal * mu * per_speed
            # by the secant friction stops, and never throws back
            along = select(stations[j, REVERSING] > 0.5, across, twice_normal * coefficient * steepness)
            along *= implicit_share(per_element_mass * along)
            across *= implicit_share(per_element_mass * across)
            excess = along - across
            radial_mass = fma(fma(excess, climb * climb, across), per_cosine * per_cosine, radial_mass)
            cross = excess * climb * run * per_cosine
            flank_slope = fma(excess, run * run, across)
            element += flank_slope
            stations[j, SLIDING_R], stations[j, SLIDING_T] = v_radial, v_tangential
            stations[j, FLANK], stations[j, FLANK_SLOPE] = tangential, flank_slope
            stations[j, FLANK_CROSS] = cross

            lever = fma(offset, belt.arc_curvature[j], 1.0)
            saddle = fma(lever, full_speed, -(belt_speed + v1))
            ring_factor, stiff = lane_saturation(saddle, ring_width)
            relief = ring_here * belt_speed * belt_speed
            pressure = maximum(ring_right - relief, 0.0) * (right * belt.curvature[j])
            pressure += maximum(ring_left - relief, 0.0) * (left * belt.curvature[a])
            grip = ring_friction * (0.5 * belt.per_dual[j]) * pressure
            drag = grip * ring_factor
            along_ring += drag
            along_element -= lever * drag
            stiff *= grip
            stiff *= implicit_share(step * stiff / ring_here)
            ring += stiff
            element += lever * lever * stiff
            coupling = -lever * stiff
        along_element = fma(outward, slope, along_element)
        mobility = 1.0 / radial_mass
        push, lag = (transverse + outward) * mobility, cross * mobility
        stations[j, PUSH], stations[j, LAG], stations[j, SLOPE] = push, lag, slope
        stations[j, D_00] = dual * fma(-cross, lag, element)
        stations[j, D_01] = dual * coupling
        stations[j, D_11] = dual * ring
        stations[j, Y_0] = dual * fma(-cross, push, along_element)
        stations[j, Y_1] = dual * along_ring


@merged_lane_kernel
def _cell(belt: LaneBelt, state: LaneState, work: ImexWork, step: float, k: int, layer: int):
    """Stress in a cell at the end of the step, predicted with the old speeds, and its slope with dv.

    The stress is the resultant T of the rings, or -P of the elements [N].
    """
    n, fields, stations, c = belt.cell.size, state.fields, work.stations, belt.constants
    a, b = k - 1 if k > 0 else n - 1, k + 1 if k < n - 1 else 0
    eps, eps_a = stations[k, EPS_0 + layer], stations[a, EPS_0 + layer]
    v, v_b = fields[k, V_ELEMENT + layer], fields[b, V_ELEMENT + layer]
    stiffness, damper = c[0, ELEMENT_STIFFNESS + layer], c[0, ELEMENT_DAMPING + layer]
    whole = fields[k, N_ELEMENT + layer] + 1.0
    if layer == 1:
        whole += belt.curvature[k] * c[0, RING_OFFSET]
    per_length = step * belt.per_cell[k] / whole
    lifts = fields[k, U] + stations[k, PUSH] + fields[b, U] + stations[b, PUSH]
    # what leaves ahead less what enters behind, per (1 + eps): v[b] - v[k] (1 + eps) / (1 + eps_a)
    more = (eps - eps_a) / (1.0 + eps_a)
    outflow = v_b - v - (c[0, BELT_SPEED] + v) * more
    ahead = fma(per_length, fma(0.5 * belt.curvature[k] * belt.cell[k], lifts, outflow), eps)
    per_cell = belt.per_cell[k]
    viscous, grip = damper * ((v_b - v) * per_cell), damper * per_cell
    if layer == 0:
        # elements never pull: their damper ends where it would outweigh the push force
        most = -stiffness * minimum(eps, 0.0)
        pulls = viscous > -stiffness * eps
        viscous, grip = select(pulls, most, viscous), select(pulls, 0.0, grip)
        apart = (eps >= 0.0) & (ahead >= 0.0)
        stress = select(apart, 0.0, fma(stiffness, ahead, viscous))
        return stress, select(apart, 0.0, fma(stiffness, per_length, grip))
    return fma(stiffness, ahead, viscous), fma(stiffness, per_length, grip)


@lane_kernel
def _eliminate(belt: LaneBelt, state: LaneState, work: ImexWork, step: float) -> None:
    """Stresses into the rows, and forward elimination; solves for the last station, which closes the cycle."""
    stations = work.stations
    n = belt.cell.size
    last = n - 1
    behind_0, link_0 = _cell(belt, state, work, step, last, 0)
    behind_1, link_1 = _cell(belt, state, work, step, last, 1)
    stations[last, LINK_0], stations[last, LINK_1] = link_0, link_1
    zero = like(0.0, link_0)
    # Schur complement of the last station
    p, q, r = stations[last, D_00] + link_0, stations[last, D_01], stations[last, D_11] + link_1
    f0, f1 = stations[last, Y_0] + behind_0, stations[last, Y_1] + behind_1
    # coupling of the present row to the last station (00, 01, 10, 11)
    c00, c01, c10, c11 = -link_0, zero, zero, -link_1
    # what the row before leaves to the present one
    t00, t01, t11, s0, s1 = link_0, zero, link_1, -behind_0, -behind_1
    for j in range(last):
        stress_0, e0 = _cell(belt, state, work, step, j, 0)
        stress_1, e1 = _cell(belt, state, work, step, j, 1)
        stations[j, LINK_0], stations[j, LINK_1] = e0, e1
        d00, d01 = stations[j, D_00] + (e0 + t00), stations[j, D_01] + t01
        d11 = stations[j, D_11] + (e1 + t11)
        y0, y1 = stations[j, Y_0] + (stress_0 + s0), stations[j, Y_1] + (stress_1 + s1)
        if j == last - 1:
            c00 -= e0
            c11 -= e1
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
        stations[j, D_00], stations[j, D_01], stations[j, D_11] = i00, i01, i11
        stations[j, Y_0], stations[j, Y_1] = z0, z1
        stations[j, G_00], stations[j, G_01], stations[j, G_10], stations[j, G_11] = g00, g01, g10, g11
        t00, t01, t11 = fma(-e0 * e0, i00, e0), -e0 * e1 * i01, fma(-e1 * e1, i11, e1)
        s0, s1 = fma(e0, z0, -stress_0), fma(e1, z1, -stress_1)
        c00, c01, c10, c11 = e0 * g00, e0 * g01, e1 * g10, e1 * g11
    # the last row holds its own link ahead; behind it is what elimination has left
    p += e0
    r += e1
    f0 -= stress_0
    f1 -= stress_1
    per_determinant = 1.0 / fma(p, r, -q * q)
    stations[last, Y_0] = fma(r, f0, -q * f1) * per_determinant
    stations[last, Y_1] = fma(p, f1, -q * f0) * per_determinant


@lane_kernel
def _substitute(belt: LaneBelt, work: ImexWork, scalars: LaneArray) -> bool:
    """Back substitution: Y becomes the increments of v_element and v_ring. Whether friction has to be redone.

    It has where a station slid in the saturated range and would now slide back. There the tangent of friction
    is flat, the step all but explicit, and a large friction force turns the sliding about within a step: it
    chatters, and takes energy out of nothing. Such stations are marked.
    """
    stations = work.stations
    last = belt.cell.size - 1
    x0, x1 = stations[last, Y_0], stations[last, Y_1]
    width = belt.constants[0, FRICTION_SPEED]
    saturated = width * width
    n0 = n1 = like(0.0, x0)
    found = width < 0.0
    for j in range(last, -1, -1):
        if j == last:
            n0, n1 = x0, x1
        else:
            e0, e1 = stations[j, LINK_0], stations[j, LINK_1]
            if j == last - 1:
                # the next station is the border, whose share is in G
                e0, e1 = 0.0 * e0, 0.0 * e1
            e0, e1 = e0 * n0, e1 * n1
            n0 = fma(-stations[j, G_01], x1, fma(-stations[j, G_00], x0, stations[j, Y_0]))
            n0 = fma(stations[j, D_00], e0, fma(stations[j, D_01], e1, n0))
            n1 = n1_of(stations, j, x0, x1, e0, e1)
            stations[j, Y_0], stations[j, Y_1] = n0, n1
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


@merged_lane_kernel
def n1_of(stations, j, x0, x1, e0, e1):
    """Increment of v_ring."""
    n1 = fma(-stations[j, G_11], x1, fma(-stations[j, G_10], x0, stations[j, Y_1]))
    return fma(stations[j, D_01], e0, fma(stations[j, D_11], e1, n1))


@lane_kernel
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
    decay = exp((carry + forget) * -step)
    moment = like(0.0, driven_speed)
    work_done = zero
    # speeds at station j + 1, old and new, and the flux there
    for layer in range(2):
        stiffness, damper = c[0, ELEMENT_STIFFNESS + layer], c[0, ELEMENT_DAMPING + layer]
        v_row, y_row, eps_row, n_row = V_ELEMENT + layer, Y_0 + layer, EPS_0 + layer, N_ELEMENT + layer
        old_b = fields[0, v_row]
        new_b = old_b + stations[0, y_row]
        eps_last = stations[n - 1, eps_row]
        flux_b = first_flux = (new_b - belt_speed * eps_last) / (1.0 + eps_last)
        for j in range(n - 1, -1, -1):
            old = fields[j, v_row]
            new = old + stations[j, y_row]
            eps = stations[j, eps_row]
            eps_a = stations[j - 1 if j > 0 else n - 1, eps_row]
            flux = first_flux if j == 0 else (new - belt_speed * eps_a) / (1.0 + eps_a)
            per_cell = belt.per_cell[j]
            closing = old_b - old
            viscous = damper * (closing * per_cell)
            change = (new_b - old_b) - (new - old)
            damped = fma(damper * per_cell, change, viscous)
            if layer == 0:
                damped = select(viscous > -stiffness * eps, -stiffness * minimum(eps, 0.0), damped)
                damped = select(stations[j, LINK_0] > 0.0, damped, 0.0)
            work_done = fma(damped, fma(0.5, change, closing), work_done)
            fields[j, n_row] = fma(step * per_cell, flux - flux_b, fields[j, n_row])
            fields[j, v_row] = new
            old_b, new_b, flux_b = old, new, flux
    for j in range(n - 1, -1, -1):
        dv = stations[j, Y_0]
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
                decay = exp((carry + forget) * -step)
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
                    fields[j, V_FILTERED] = fma(fields[j, V_FILTERED] - target, decay, target)
        fields[j, W] = fma(step, u, w)
    state.scalars[0, LAYER_WORK] = state.scalars[0, LAYER_WORK] + like(work_done, moment) * step
    return moment
