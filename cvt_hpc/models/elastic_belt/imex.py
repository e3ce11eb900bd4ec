"""The fast step of the elastic belt: explicit in the strands, implicit in friction and longitudinal waves.

Staggered in time: w, n_i, v_f at t_k; u, v_i, omega at t_k-1/2. Transverse forces are explicit (leapfrog, no
numerical damping of the strands). Flank and ring friction enter with their slopes, the stresses T and P by
backward Euler, so neither the regularisation of friction nor the longitudinal waves (5-6 km/s) limit the
step. Eliminating u and the content leaves one cyclic block-tridiagonal system, 2x2 blocks (v_element,
v_ring), symmetric positive definite; the content then follows from the fluxes, so that each layer's total is
kept to round-off.

The rings' stress is centred in time and damps nothing; the elements' is taken at the end of the step, since
a centred one rings where they meet and part: it damps them like EA dt [N s], in first order. The set of
separated elements is frozen during a step: those that are apart and, with the old speeds, stay apart.
Elements meet where their gap closes and part where their push, damper included, has ended: were it where
they reach their length at rest, the cell in which gaps run into pressed elements would be neither, and rattle
from step to step with pushes in proportion to the step (`EDGES.md`). What limits the step is accuracy,
c dt / h about 5, and the transverse contact and bending.
"""

from __future__ import annotations

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import decay, fma, like, minimum, select, sqrt
from cvt_hpc.models.elastic_belt.belt import N_ELEMENT, V_ELEMENT, V_FILTERED, U, W
from cvt_hpc.models.elastic_belt.imex_stations import assemble
from cvt_hpc.models.elastic_belt.imex_system import eliminate, substitute
from cvt_hpc.models.elastic_belt.imex_work import (
    DV_0,
    FLANK,
    FLANK_CROSS,
    FLANK_SLOPE,
    LAG,
    LINK_0,
    PUSH,
    SLOPE,
    ImexWork,
)
from cvt_hpc.models.elastic_belt.lane_belt import (
    BELT_SPEED,
    COSINE,
    DRIVEN_CARRY,
    DRIVEN_RADIUS,
    DRIVING_CARRY,
    DRIVING_SPEED,
    ELEMENT_DAMPING,
    ELEMENT_STIFFNESS,
    FORGET,
    LAYER_WORK,
    SPEED,
    LaneBelt,
    LaneState,
)
from cvt_hpc.models.elastic_belt.lane_forces import (
    EPS_0,
    SHORT_0,
    advance_pulley,
    derive,
    driving_surface,
    lane_carry,
    lane_sliding,
    lane_speed_share,
)

# One, unless friction turns sliding about or elements meet; then each closes the cells beside the last ones,
# and a push goes through c dt / h of them in a step.
MOST_PASSES = 9


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
    lane_sliding(belt, state, stations)
    for attempt in range(MOST_PASSES):
        assemble(belt, state, work, step, attempt > 0)
        eliminate(belt, state, work, step)
        if not substitute(belt, work, scalars, step):
            break
    moment = _advance(belt, state, work, step)
    advance_pulley(belt, state, stations, moment, step)
    state.time[0] += step
    derive(belt, state, stations)


@kernel
def _advance(belt: LaneBelt, state: LaneState, work: ImexWork, step: float):
    """Apply the increments; returns the moment of the flanks on the driven pulley [N m], in doubles."""
    n, fields, stations, c = belt.cell.size, state.fields, work.stations, belt.constants
    per_cosine = 1.0 / c[0, COSINE]
    share = lane_speed_share(belt, state.time[0], c[0, BELT_SPEED])
    belt_speed, forget = share * c[0, BELT_SPEED], c[0, FORGET]
    driven_speed = state.scalars[0, SPEED]
    driven_base = driven_speed * like(c[0, DRIVEN_RADIUS], driven_speed) - like(belt_speed, driven_speed)
    zero = like(0.0, forget)
    surface, turning, radius = like(driven_base, zero), like(driven_speed, zero), c[0, DRIVEN_RADIUS]
    carry = lane_carry(belt, belt.driven_start, DRIVEN_CARRY, belt_speed)
    driving_carry = lane_carry(belt, 0, DRIVING_CARRY, belt_speed)
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
                # what is left of the push beyond the length at rest stores nothing: all of it is damping
                damped = select(eps > 0.0, minimum(fma(stiffness, eps, damped), 0.0), damped)
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
        u = u + du
        fields[j, U] = u
        w = fields[j, W]
        if belt.arc_share[j] > 0.0:
            if j < belt.driven_start:
                surface, turning = driving_surface(belt, share), share * c[0, DRIVING_SPEED]
                carry = driving_carry
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
