"""The fast step of the elastic belt: explicit in the strands, implicit in friction, bending and layer waves.

Staggered in time: w, n_i, v_f at t_k; u, v_i, omega at t_k-1/2. Tension and contact act explicitly across the
belt (leapfrog, no numerical damping of the strands), bending implicitly (`imex_bending`). Flank and ring
friction enter with their slopes, the stresses T and P by backward Euler, so neither the regularisation of
friction nor the longitudinal waves (5-6 km/s) limit the step. Eliminating u and the content leaves one cyclic
block-tridiagonal system, 2x2 blocks (v_element, v_ring), symmetric positive definite; the content then
follows from the fluxes, so that each layer's total is kept to round-off.

The rings' stress is centred in time and damps nothing; the elements' is taken at the end of the step, since a
centred one rings where they meet and part: it damps them like EA dt [N s], in first order. The set of
separated elements is frozen during a step: those that are apart and, with the old speeds, stay apart.
Elements meet where their gap closes and part where their push, damper included, has ended: were it where they
reach their length at rest, the cell in which gaps run into pressed elements would be neither, and rattle from
step to step with pushes in proportion to the step (`EDGES.md`). The step is limited by accuracy, and by
tension and contact across the belt.
"""

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import anywhere, around, behind, fma, from_ahead, like, minimum, select
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt.imex_bending import move_across, move_with_layers
from cvt_hpc.models.elastic_belt.imex_stations import assemble, damp_across
from cvt_hpc.models.elastic_belt.imex_system import TURNS_BACK, eliminate, substitute
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState, Work
from cvt_hpc.models.elastic_belt.lane_column import foresee_column, lane_column
from cvt_hpc.models.elastic_belt.lane_tilt import (
    add_turn,
    carry_tilt,
    follow_layers,
    lane_tilt,
    turn_elements,
)
from cvt_hpc.models.elastic_belt.pulley_step import advance_pulleys
from cvt_hpc.physics.flank import flank_sliding

# One, unless friction turns sliding about or elements meet; then each closes the cells beside the last ones,
# and a push goes through c dt / h of them in a step.
MOST_PASSES = 9


@kernel
def step_imex(belt: LaneBelt, state: LaneState, work: Work, step: float) -> None:
    """Advance the state by a step [s], with the results of `derive` for it in the work space."""
    stations = work.stations
    forces.lane_sliding(belt, state, stations)
    if belt.tilts:
        carry_tilt(belt, state, step)
        lane_tilt(belt, state, stations, step)
    damp_across(belt, state, work)
    assemble(belt, state, work, step, False)
    coupled = move_across(belt, state, work, step)
    if belt.has_column:
        foresee_column(belt, state, stations, lf.PUSH, step)
    for attempt in range(MOST_PASSES):
        eliminate(belt, state, work, step, attempt > 0)
        found = substitute(belt, state, work, step)
        if found == 0 and attempt == 0:
            break
        if found == 0 or attempt == MOST_PASSES - 1:
            forget(work)
            break
        if found & TURNS_BACK:
            assemble(belt, state, work, step, True)
            coupled = move_across(belt, state, work, step)
            if belt.has_column:
                foresee_column(belt, state, stations, lf.PUSH, step)
    move_with_layers(belt, state, work, coupled)
    if belt.tilts:
        follow_layers(belt, state, stations)
        turn_elements(belt, state, step)
        add_turn(state, step)
    taken, moment = advance_belt(belt, state, work, step)
    advance_pulleys(belt, state, taken, moment, step)
    state.time[0] += step
    forces.advance_discs(belt, state, step)
    forces.lane_contact_forces(belt, state, stations)
    if belt.has_column:
        lane_column(belt, state, stations, lf.EPS_0)


@kernel
def forget(work: Work) -> None:
    """Clear the marks of repeated parts of a step."""
    stations = work.stations
    for j in range(stations.rows):
        stations[j, lf.REVERSING] = stations[j, lf.RING_REVERSING] = stations[j, lf.MEETING] = 0.0


@kernel
def advance_belt(belt: LaneBelt, state: LaneState, work: Work, step: float):
    """Apply the increments, and find the new strains; the flanks' torques on both pulleys [N m].

    That taken from the driving pulley, where that is free, and the moment on the driven one.
    """
    n, fields, stations, c = state.fields.rows, state.fields, work.stations, belt.constants
    per_cosine = 1.0 / c[0, lf.COSINE]
    speed_share = forces.lane_speed_share(belt, state.time[0], c[0, lf.BELT_SPEED])
    belt_speed, offset = speed_share * c[0, lf.BELT_SPEED], c[0, lf.RING_OFFSET]
    driven_speed, radius, driving_radius = (
        state.scalars[0, lf.SPEED],
        c[0, lf.DRIVEN_RADIUS],
        c[0, lf.DRIVING_RADIUS],
    )
    stiffness, damper_0 = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.ELEMENT_DAMPING]
    damper_1 = c[0, lf.RING_DAMPING]
    pulleys = forces.lane_pulleys(belt, speed_share, state.scalars)
    zero, moment, taken = like(0.0, offset), like(0.0, driven_speed), like(0.0, driven_speed)
    last_filtered = behind(fields, 0, f.V_FILTERED)
    # at the station ahead of a cell: speeds, increments, fluxes of content less the belt speed, displacement
    v0_b, dv0_b = fields[0, f.V_ELEMENT], stations[0, lf.DV_0]
    v1_b, dv1_b = fields[0, f.V_RING], stations[0, lf.DV_1]
    first_0 = fma(-belt_speed, behind(stations, 0, lf.EPS_0), v0_b + dv0_b) * behind(stations, 0, lf.SHORT_0)
    first_1 = fma(-belt_speed, behind(stations, 0, lf.EPS_1), v1_b + dv1_b) * behind(stations, 0, lf.SHORT_1)
    w_b = fma(step, fields[0, f.U] + stations[0, lf.PUSH], fields[0, f.W])
    v0_b, dv0_b, flux0_b = from_ahead(v0_b), from_ahead(dv0_b), from_ahead(first_0)
    v1_b, dv1_b, flux1_b = from_ahead(v1_b), from_ahead(dv1_b), from_ahead(first_1)
    w_b, du_b = from_ahead(w_b), from_ahead(stations[0, lf.PUSH])
    u_b = from_ahead(fields[0, f.U]) + du_b
    work_done = zero
    for j in range(n - 1, -1, -1):
        per_cell = belt.per_cell[j]
        v0, dv0 = fields[j, f.V_ELEMENT], stations[j, lf.DV_0]
        v1, dv1 = fields[j, f.V_RING], stations[j, lf.DV_1]
        new_0, new_1 = v0 + dv0, v1 + dv1
        flux_0, flux_1 = first_0, first_1
        if j > 0:
            flux_0 = fma(-belt_speed, stations[j - 1, lf.EPS_0], new_0) * stations[j - 1, lf.SHORT_0]
            flux_1 = fma(-belt_speed, stations[j - 1, lf.EPS_1], new_1) * stations[j - 1, lf.SHORT_1]
        du, w, eps = stations[j, lf.PUSH], fields[j, f.W], forces.pressed_strain(belt, state, stations, j)
        u = fields[j, f.U] + du
        lifts = (0.5 * belt.curvature[j] * belt.cell[j]) * (u + u_b)
        closing, change = v0_b - v0, dv0_b - dv0
        viscous = damper_0 * per_cell * (closing + lifts)
        damped = fma(damper_0 * per_cell, change, viscous)
        # the remaining push beyond the length at rest stores nothing: all of it is damping
        damped = select(eps > 0.0, minimum(fma(stiffness, eps, damped), 0.0), damped)
        damped = select(viscous > -stiffness * eps, -stiffness * minimum(eps, 0.0), damped)
        damped = select(stations[j, lf.LINK_0] > 0.0, damped, 0.0)
        work_done = fma(damped, fma(0.5, change, closing), work_done)
        closing, change = v1_b - v1, dv1_b - dv1
        damped = damper_1 * per_cell * (closing + change + lifts)
        work_done = fma(damped, fma(0.5, change, closing), work_done)
        work_done = fma(stations[j, lf.BENT], fma(-0.5, du + du_b, u + u_b), work_done)
        more_0 = fma(step * per_cell, flux_0 - flux0_b, fields[j, f.N_ELEMENT])
        more_1 = fma(step * per_cell, flux_1 - flux1_b, fields[j, f.N_RING])
        fields[j, f.V_ELEMENT], fields[j, f.V_RING] = new_0, new_1
        fields[j, f.N_ELEMENT], fields[j, f.N_RING] = more_0, more_1
        v0_b, dv0_b, flux0_b, v1_b, dv1_b, flux1_b = v0, dv0, flux_0, v1, dv1, flux_1

        touches = belt.touches[j]
        if anywhere(touches > 0.0):
            is_driven = belt.on_driven[j] > 0.5
            if belt.is_free or anywhere(is_driven):
                slopes = fma(stations[j, lf.FLANK_SLOPE], dv0, stations[j, lf.FLANK_CROSS] * du)
                distance = select(is_driven, radius, driving_radius) + fma(belt.upright[j], w, belt.rise[j])
                tangential = (stations[j, lf.FLANK] - slopes) * (belt.dual[j] * distance)
                # where no groove can hold the belt the values are of an earlier step
                tangential = select(touches > 0.0, tangential, zero)
                moment = moment - like(select(is_driven, tangential, zero), moment)
                if belt.is_free:
                    taken = taken + like(select(is_driven, zero, tangential), taken)
            if belt.memory:
                v_across = fma(belt_speed + new_0, stations[j, lf.SLOPE], u)
                v_radial, along = forces.groove_sliding(belt, j, pulleys, belt_speed, v_across, new_0, w)
                speed, _ = flank_sliding(v_radial, along, per_cosine)
                before = fields[j - 1, f.V_FILTERED] if j > 0 else last_filtered
                old, way = fields[j, f.V_FILTERED], stations[j, lf.WAY]
                filtered = forces.remembered(belt, j, way, belt_speed, step, speed, old, before)
                filtered = select(stations[j, lf.FORCE] > 0.0, filtered, speed)
                fields[j, f.V_FILTERED] = select(touches > 0.0, filtered, 0.0)
        w = fma(step, u, w)
        fields[j, f.U], fields[j, f.W] = u, w
        forces.cell_strains(belt, stations, j, w, w_b, more_0, more_1, offset)
        w_b, u_b, du_b = w, u, du
    state.scalars[0, lf.LAYER_WORK] = state.scalars[0, lf.LAYER_WORK] + around(like(work_done, moment)) * step
    return around(taken), around(moment)
