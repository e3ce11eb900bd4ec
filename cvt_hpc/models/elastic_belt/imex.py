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

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import (
    LaneArray,
    anywhere,
    decay,
    fma,
    like,
    minimum,
    reciprocals,
    select,
    sqrt,
)
from cvt_hpc.models.elastic_belt.belt import (
    N_ELEMENT,
    V_ELEMENT,
    V_FILTERED,
    V_RING,
    U,
    W,
)
from cvt_hpc.models.elastic_belt.lane_belt import (
    BELT_SPEED,
    BENDING_STIFFNESS,
    COSINE,
    DRIVEN_CARRY,
    DRIVEN_RADIUS,
    DRIVING_CARRY,
    DRIVING_RADIUS,
    DRIVING_SPEED,
    ELEMENT_DAMPING,
    ELEMENT_MASS,
    ELEMENT_STIFFNESS,
    FORGET,
    FRICTION_SPEED,
    LAYER_WORK,
    MASS,
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
    TRANSVERSE_DAMPING,
    LaneBelt,
    LaneState,
)
from cvt_hpc.models.elastic_belt.lane_forces import (
    COEFFICIENT,
    EPS_0,
    EPS_1,
    FACTOR,
    FIELDS_OF_FORCES,
    FORCE,
    PER_CONTENT_0,
    PER_CONTENT_1,
    PER_SPEED,
    RING_FACTOR,
    SHORT_0,
    SLIDING_R,
    SLIDING_T,
    advance_pulley,
    derive,
    lane_sliding,
    lane_transverse,
    ring_grip,
    start_damping,
)

MOST_PASSES = 3  # one, unless friction turns sliding about; a third where the second turns others

# Share of the speeds' change in a step that the rings' stress feels. From 1/4 on it is stable for any step
# and damps nothing (Newmark); the rest keeps changing contact from exciting the shortest waves at long steps.
CENTRED = 0.35
FADED = 0.1  # [N s/m]: couplings of stations are 1e3 and more

# fields of ImexWork.stations, after those of `lane_forces`
LAST_U, PUSH, LAG, SLOPE, FLANK, FLANK_SLOPE, FLANK_CROSS, REVERSING = range(FIELDS_OF_FORCES, 21)
D_00, D_01, D_11, Y_0, Y_1 = range(21, 26)
I_00, I_01, I_11, DV_0, DV_1, G_00, G_01, G_10, G_11, LINK_0, LINK_1 = range(26, 37)
FIELDS_OF_WORK = 37


class ImexWork(NamedTuple):
    """Work space of the step.

    Attributes
    ----------
    stations : (N, 37) LaneArray
        The fields of `lane_forces`; u one step earlier. Of the step: pending increment of u, its sensitivity
        to v_element's, slope w_s, the flanks' tangential force and its slopes, whether (1) the linearised
        friction would throw the station back; the blocks of the system and its right side; the eliminated
        system: inverse pivots, the increments of v_element and v_ring, the border, the stresses' slopes with
        the speeds' differences.
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
    stations = work.stations
    lane_sliding(belt, state, stations)
    for attempt in range(MOST_PASSES):
        _stations(belt, state, work, step, attempt > 0)
        _eliminate(belt, state, work, step)
        if not _substitute(belt, work, state.scalars):
            break
    moment = _advance(belt, state, work, step)
    advance_pulley(belt, state, stations, moment, step)
    state.time[0] += step
    derive(belt, state, stations)


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
        dual, per_left, span = belt.dual[j], belt.per_cell[a], belt.per_span[j]
        u, v0, v1 = fields[j, U], fields[j, V_ELEMENT], fields[j, V_RING]
        ring_left, ring_right = ring_stiffness * stations[a, EPS_1], ring_stiffness * stations[j, EPS_1]
        net_left = fma(element_stiffness, minimum(stations[a, EPS_0], 0.0), ring_left - centrifugal)
        net_right = fma(element_stiffness, minimum(stations[j, EPS_0], 0.0), ring_right - centrifugal)
        slope = (fields[b, W] - fields[a, W]) * span
        # u at t_k, extrapolated: the gyroscopic term then neither damps nor feeds
        change = 1.5 * (fields[b, U] - fields[a, U]) - 0.5 * (stations[b, LAST_U] - stations[a, LAST_U])
        transverse = lane_transverse(belt, fields, j, net_left, net_right, bending)
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

            grip = ring_grip(belt, j, ring_left, ring_right, ring_relief * longer, ring_friction)
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
