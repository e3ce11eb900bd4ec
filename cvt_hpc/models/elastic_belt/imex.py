"""The fast step of the elastic belt: explicit in the strands, implicit in friction, bending and layer waves.

Staggered in time: w, n_i, v_f at t_k; u, v_i, omega at t_k-1/2. Tension and contact act explicitly across the
belt (leapfrog, no numerical damping of the strands), bending implicitly (`imex_stations`). Flank and ring
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

The system comes from `imex_stations`; here stresses are put into its rows, it is eliminated along the belt,
and substituted back.
"""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes.functions import absolute, anywhere, fma, like, minimum, select
from cvt_hpc.lanes.kinds import LaneArray
from cvt_hpc.lanes.rings import ahead, around, behind, from_ahead, from_behind, ring_solution
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt import lane_tilt as tilting
from cvt_hpc.models.elastic_belt.imex_stations import assemble, damp_across, move_across, move_with_layers
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState, Work
from cvt_hpc.models.elastic_belt.lane_column import foresee_column, lane_column
from cvt_hpc.models.elastic_belt.lane_forces import lane_belt_speed
from cvt_hpc.models.elastic_belt.pulley_step import advance_pulleys
from cvt_hpc.physics.flank import flank_sliding

# Share of the speeds' change in a step that the rings' stress feels. From 1/4 on it is stable for any step
# and damps nothing (Newmark); the rest keeps changing contact from exciting the shortest waves at long steps.
CENTRED = 0.35
# Overlap of elements, in strain, from which a cell that a step has taken as apart is closed in it: 500 N of
# the default belt, a tenth of its rings' tension.
LARGEST_OVERLAP = 1.25e-5
TURNS_BACK, MEETS = 1, 2  # why a step has to be done again


@merged_kernel
def element_stress(stiffness, grip, eps, closing, ahead, per_length, last, meet):
    """-P in a cell [N] with the speeds that the step begins with, and its slope with their change.

    From EA [N] and the damping over the cell's length [N s/m]; strain and speed at which the cell lengthens
    [m/s]; the strain at the end of the step with these speeds, and its slope with their difference [s/m]; the
    slope of -P in the step before [N s/m], 0 where the elements were apart; `meet`, 1 where the step was
    found to press elements together that it had taken as apart.
    """
    viscous = grip * closing
    # elements never pull: their damper ends where it would outweigh the push force
    pulls = viscous > -stiffness * eps
    viscous, grip = select(pulls, -stiffness * minimum(eps, 0.0), viscous), select(pulls, 0.0, grip)
    apart = (eps >= 0.0) & (ahead >= 0.0) & (pulls | (last <= 0.0)) & (meet < 0.5)
    stress = select(apart, 0.0, fma(stiffness, ahead, viscous))
    return stress, select(apart, 0.0, fma(stiffness, per_length, grip))


@kernel
def eliminate(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float, again: bool) -> None:
    """Stresses into the rows, and forward elimination; the last row, that closes the ring, is solved.

    `again` takes those elements as closed that a pass before has found to meet.
    """
    fields, c = state.fields, belt.constants
    last, faded = fields.rows - 1, belt.faded
    belt_speed = lane_belt_speed(belt, state.time[0])
    element_stiffness, ring_stiffness = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.RING_STIFFNESS]
    element_damping, ring_damping = c[0, lf.ELEMENT_DAMPING], c[0, lf.RING_DAMPING]
    zero = like(0.0, belt_speed)
    # of the last row: its own block and right side, and the results for the last row behind
    p = q = r = f0 = f1 = p_b = q_b = r_b = f0_b = f1_b = zero
    # the present row's coupling to the last one behind; the remainder of the row before for the present one
    c00 = c01 = c10 = c11 = t00 = t01 = t11 = s0 = s1 = zero
    for k in range(-1, last):
        # the last cell first, which is behind row 0
        j = k if k >= 0 else last
        per_cell = belt.per_cell[j]
        v0, v1 = fields[j, f.V_ELEMENT], fields[j, f.V_RING]
        closing_0, closing_1 = ahead(fields, j, f.V_ELEMENT) - v0, ahead(fields, j, f.V_RING) - v1
        eps = stations[j, lf.EPS_0]
        # flow out ahead less flow in behind, per (1 + eps): v[b] - v[j] (1 + eps) / (1 + eps_a)
        entering = (eps - behind(stations, j, lf.EPS_0)) * behind(stations, j, lf.SHORT_0)
        outflow = fma(-(belt_speed + v0), entering, closing_0)
        kappa = belt.curvature[j]
        if anywhere(kappa > 0.0):
            lifts = lifting(fields, stations, j, 0.5 * kappa * belt.cell[j])
            outflow, closing_0, closing_1 = outflow + lifts, closing_0 + lifts, closing_1 + lifts
        per_length = (step * per_cell) * stations[j, lf.PER_CONTENT_0]
        at_end = fma(per_length, outflow, eps)
        if belt.has_column:
            strained, eps = at_end - eps, state.column[j, lf.PRESSED]
            at_end = fma(state.column[j, lf.GIVE], strained, eps + state.column[j, lf.SHIFT])
            per_length *= state.column[j, lf.GIVE]
        grip, link, meet = element_damping * per_cell, stations[j, lf.LINK_0], zero
        if again:
            meet = stations[j, lf.MEETING]
        stress_0, e0 = element_stress(element_stiffness, grip, eps, closing_0, at_end, per_length, link, meet)
        if anywhere(e0 <= 0.0):
            stations[j, lf.AHEAD] = at_end
        grip = ring_damping * per_cell
        stress_1 = fma(ring_stiffness, stations[j, lf.EPS_1], grip * closing_1)
        e1 = fma(CENTRED * ring_stiffness, (step * per_cell) * stations[j, lf.PER_CONTENT_1], grip)
        stations[j, lf.LINK_0], stations[j, lf.LINK_1] = e0, e1
        if k < 0:
            p, q, r = stations[last, lf.D_00] + e0, stations[last, lf.D_01], stations[last, lf.D_11] + e1
            f0, f1 = stations[last, lf.Y_0] + stress_0, stations[last, lf.Y_1] + stress_1
            t00, t11 = from_behind(e0), from_behind(e1)
            c00, c11 = -t00, -t11
            s0, s1 = -from_behind(stress_0), -from_behind(stress_1)
            continue
        d00, d01 = stations[j, lf.D_00] + (e0 + t00), stations[j, lf.D_01] + t01
        d11 = stations[j, lf.D_11] + (e1 + t11)
        y0, y1 = stations[j, lf.Y_0] + (stress_0 + s0), stations[j, lf.Y_1] + (stress_1 + s1)
        per_determinant = 1.0 / fma(d00, d11, -d01 * d01)
        i00, i01, i11 = d11 * per_determinant, -d01 * per_determinant, d00 * per_determinant
        z0, z1 = fma(i00, y0, i01 * y1), fma(i01, y0, i11 * y1)
        g00, g01 = fma(i00, c00, i01 * c10), fma(i00, c01, i01 * c11)
        g10, g11 = fma(i01, c00, i11 * c10), fma(i01, c01, i11 * c11)
        p_b = fma(-c00, g00, fma(-c10, g10, p_b))
        q_b = fma(-c00, g01, fma(-c10, g11, q_b))
        r_b = fma(-c01, g01, fma(-c11, g11, r_b))
        f0_b = fma(-c00, z0, fma(-c10, z1, f0_b))
        f1_b = fma(-c01, z0, fma(-c11, z1, f1_b))
        stations[j, lf.I_00], stations[j, lf.I_01], stations[j, lf.I_11] = i00, i01, i11
        stations[j, lf.DV_0], stations[j, lf.DV_1] = z0, z1
        stations[j, lf.G_00], stations[j, lf.G_01], stations[j, lf.G_10] = g00, g01, g10
        stations[j, lf.G_11] = g11
        t00, t01, t11 = fma(-e0 * e0, i00, e0), -e0 * e1 * i01, fma(-e1 * e1, i11, e1)
        s0, s1 = fma(e0, z0, -stress_0), fma(e1, z1, -stress_1)
        # it fades along the belt, beyond all need: kept from numbers so small that the processor slows down
        c00, c01 = (e0 * g00 + faded) - faded, (e0 * g01 + faded) - faded
        c10, c11 = (e1 * g10 + faded) - faded, (e1 * g11 + faded) - faded
    p, q, r = (p + t00) + from_ahead(p_b), (q + t01) + from_ahead(q_b), (r + t11) + from_ahead(r_b)
    f0, f1 = (f0 + s0) + from_ahead(f0_b), (f1 + s1) + from_ahead(f1_b)
    x0, x1 = ring_solution(p, q, r, f0, f1, c00, c01, c10, c11, faded)
    stations[last, lf.DV_0], stations[last, lf.DV_1] = x0, x1


@merged_kernel
def lifting(fields: LaneArray, stations: LaneArray, j: int, half):
    """Speed at which cell j of an arc lengthens by moving outwards [m/s], `half` being kappa h / 2.

    At the end of the step, without the part of its increments due to the layers' speeds.
    """
    here, beyond = fields[j, f.U] + stations[j, lf.PUSH], ahead(fields, j, f.U) + ahead(stations, j, lf.PUSH)
    return half * (here + beyond)


@kernel
def substitute(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float) -> int:
    """Back substitution: DV become the increments of v_element and v_ring. Why the step has to be done again.

    0: it has not. Else it marks the places and returns the sum of its reasons:

    - TURNS_BACK: flanks or saddles that slid in the saturated range would now slide back. There the tangent
      of friction is flat, the step all but explicit, and a large friction force turns it about within a step:
      it chatters from step to step, and takes energy out of nothing.
    - MEETS: elements that the step has taken as apart would be pressed together. Their push would set in a
      step late, advance by one cell a step instead of at the speed of waves, and pile up.
    """
    scalars, c = state.scalars, belt.constants
    last = stations.rows - 1
    n0, n1 = stations[last, lf.DV_0], stations[last, lf.DV_1]
    # of the last row behind, the ring's last one where a lane is a ring
    x0, x1 = from_behind(n0), from_behind(n1)
    width, ring_width, offset = c[0, lf.FRICTION_SPEED], c[0, lf.RING_FRICTION_SPEED], c[0, lf.RING_OFFSET]
    saturated = width * width
    turned = met = width < 0.0
    for j in range(last, -1, -1):
        if j < last:
            z0 = fma(-stations[j, lf.G_01], x1, fma(-stations[j, lf.G_00], x0, stations[j, lf.DV_0]))
            z1 = fma(-stations[j, lf.G_11], x1, fma(-stations[j, lf.G_10], x0, stations[j, lf.DV_1]))
            link = stations[j, lf.LINK_0]
            e0, e1 = link * n0, stations[j, lf.LINK_1] * n1
            i01 = stations[j, lf.I_01]
            z0 = fma(stations[j, lf.I_00], e0, fma(i01, e1, z0))
            z1 = fma(i01, e0, fma(stations[j, lf.I_11], e1, z1))
            if anywhere(link <= 0.0):
                met |= _meeting(belt, state, stations, j, n0 - z0, step)
            n0, n1 = z0, z1
            stations[j, lf.DV_0], stations[j, lf.DV_1] = n0, n1
        touches = belt.touches[j]
        if anywhere(touches > 0.0):
            v_radial, v_tangential = stations[j, lf.SLIDING_R], stations[j, lf.SLIDING_T]
            # changes of both sliding speeds
            across = fma(stations[j, lf.SLOPE] - stations[j, lf.LAG], n0, stations[j, lf.PUSH])
            upright, lean = belt.upright[j], belt.lean[j]
            climb, run = fma(upright, across, lean * n0), fma(upright, n0, -lean * across)
            turn = select(stations[j, lf.FORCE] > 0.0, fma(v_radial, climb, v_tangential * run), 0.0)
            speed_squared = fma(v_radial, v_radial, v_tangential * v_tangential)
            back = (speed_squared > saturated) & (turn < -speed_squared)
            if anywhere(back):
                turned |= _mark(stations, j, lf.REVERSING, back)
            saddle = stations[j, lf.SADDLE]
            change = fma(fma(offset, belt.arc_curvature[j], 1.0), n0, -n1)
            after = select(belt.arc_curvature[j] > 0.0, saddle * (saddle + change), 0.0)
            back = (absolute(saddle) > ring_width) & (after < 0.0)
            if anywhere(back):
                turned |= _mark(stations, j, lf.RING_REVERSING, back)
    if anywhere(stations[last, lf.LINK_0] <= 0.0):
        met |= _meeting(belt, state, stations, last, from_ahead(n0) - stations[last, lf.DV_0], step)
    reasons = TURNS_BACK * anywhere(turned) + MEETS * anywhere(met)
    if reasons:
        repeats = scalars[0, lf.REPEATS]
        scalars[0, lf.REPEATS] = repeats + select(around(turned | met), like(1.0, repeats), 0.0)
    return reasons


@merged_kernel
def _meeting(belt: LaneBelt, state: LaneState, stations: LaneArray, j: int, opening, step: float):
    """Return whether elements of cell j, taken as apart, newly overlap as `opening` [m/s] changes."""
    per_length = (step * belt.per_cell[j]) * stations[j, lf.PER_CONTENT_0]
    if belt.has_column:
        per_length *= state.column[j, lf.GIVE]
    overlap = fma(per_length, opening, stations[j, lf.AHEAD]) < -LARGEST_OVERLAP
    overlap &= stations[j, lf.LINK_0] <= 0.0
    if anywhere(overlap):
        overlap = _mark(stations, j, lf.MEETING, overlap)
    return overlap


@merged_kernel
def _mark(stations: LaneArray, j: int, field: int, mask):
    """Mark the lanes of a mask; returns the newly marked ones."""
    before = stations[j, field]
    stations[j, field] = select(mask, 1.0, before)
    return mask & (before < 0.5)


# One, unless friction turns sliding about or elements meet; then each closes the cells beside the last ones,
# and a push goes through c dt / h of them in a step.
MOST_PASSES = 9


@kernel
def step_imex(belt: LaneBelt, state: LaneState, work: Work, step: float) -> None:
    """Advance the state by a step [s], with the results of `derive` for it in the work space."""
    stations = work.stations
    forces.lane_sliding(belt, state, stations)
    if belt.tilts:
        tilting.carry_tilt(belt, state, step)
        tilting.lane_tilt(belt, state, stations, step)
    damp_across(belt, state, stations)
    assemble(belt, state, stations, step, False)
    coupled = move_across(belt, state, stations, step)
    if belt.has_column:
        foresee_column(belt, state, stations, lf.PUSH, step)
    for attempt in range(MOST_PASSES):
        eliminate(belt, state, stations, step, attempt > 0)
        found = substitute(belt, state, stations, step)
        if found == 0 and attempt == 0:
            break
        if found == 0 or attempt == MOST_PASSES - 1:
            forget(stations)
            break
        if found & TURNS_BACK:
            assemble(belt, state, stations, step, True)
            coupled = move_across(belt, state, stations, step)
            if belt.has_column:
                foresee_column(belt, state, stations, lf.PUSH, step)
    move_with_layers(belt, state, stations, coupled)
    if belt.tilts:
        tilting.follow_layers(belt, state, stations)
        tilting.turn_elements(belt, state, step)
        tilting.add_turn(state, step)
    taken, moment = advance_belt(belt, state, stations, step)
    advance_pulleys(belt, state, taken, moment, step)
    state.time[0] += step
    forces.advance_discs(belt, state, step)
    forces.lane_contact_forces(belt, state, stations)
    if belt.has_column:
        lane_column(belt, state, stations, lf.EPS_0)


@kernel
def forget(stations: LaneArray) -> None:
    """Clear the marks of repeated parts of a step."""
    for j in range(stations.rows):
        stations[j, lf.REVERSING] = stations[j, lf.RING_REVERSING] = stations[j, lf.MEETING] = 0.0


@kernel
def advance_belt(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float):
    """Apply the increments, and find the new strains; the flanks' torques on both pulleys [N m].

    That taken from the driving pulley, where that is free, and the moment on the driven one.
    """
    n, fields, c = state.fields.rows, state.fields, belt.constants
    per_cosine = 1.0 / c[0, lf.COSINE]
    speed_share = forces.lane_speed_share(belt, state.time[0], c[0, lf.BELT_SPEED])
    belt_speed, offset = speed_share * c[0, lf.BELT_SPEED], c[0, lf.RING_OFFSET]
    driven_speed = state.scalars[0, lf.SPEED]
    radius, driving_radius = c[0, lf.DRIVEN_RADIUS], c[0, lf.DRIVING_RADIUS]
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
