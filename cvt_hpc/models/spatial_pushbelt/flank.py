"""Flanks of the elements on the frustums of the sheaves, in lanes: two heights on each side, with friction.

A point Q on side s of an element, +1 right and -1 left, at the distance rho from the axis k of its pulley
and at axial position z along it, has with the mid plane C and pitch radius R the gap

    g = (B + (rho - R) tan d0) cos d0 - s (z - C) cos d0,    n = sin d0 e_r - s cos d0 k = grad g.

B is half the width of an element on its pitch line. The meridian of the sheave is m = cos d0 e_r + s sin d0
k, and the direction of rotation e_t = k x e_r. The force on the element is N n less friction along m and
e_t, against the speeds of Q over the sheave in these directions. Slip speeds take directions and the lever
of Q at mid step: at either end of a step they would add false sliding of v phi' dt / 2 and of lever times
omega^2 dt / 2.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import fma, like, sqrt
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.border import of_pulley
from cvt_hpc.models.pushbelt.chain import BETA
from cvt_hpc.models.pushbelt.friction import flank_friction
from cvt_hpc.models.pushbelt.local_bending import axial_excess, spread_bending
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.models.spatial_pushbelt.chain import motion
from cvt_hpc.physics.contact_laws import pressed


@register_jitable
def flank_point(belt, p):
    """Side, height above the saddle and half width of a point: left low, left high, right low, right high."""
    side = 1.0 if p >= 2 else -1.0
    reach = (2.0 * (p % 2) - 1.0) * belt.flank_reach
    return side, reach - belt.pitch_depth, belt.half_width + reach * belt.sine / belt.cosine


@register_jitable
def lever_of(o, a, side, height, width):
    """Q - r."""
    return vec.moved(vec.times(height, o), side * width, a)


@register_jitable
def frustum(q, centre, axis):
    """e_r, rho and axial position of a point."""
    d = q[0] - centre, q[1], q[2]
    along = vec.dot(d, axis)
    radial, radius = vec.unit(vec.moved(d, -along, axis))
    return radial, radius, along


@register_jitable
def frustum_gap(belt, side, radius, along, groove, middle):
    """Gap [m] between a sheave and a point."""
    return belt.cosine * (belt.half_width - side * (along - middle)) + belt.sine * (radius - groove)


@register_jitable
def pulley_axis(belt, driven):
    """Axis of the pulley of an element."""
    one, other = vec.at(belt.axes, 0, 0), vec.at(belt.axes, 1, 0)
    return vec.plus(one, vec.times(driven, vec.minus(other, one)))


@register_jitable
def flank_directions(belt, radial, axis, side):
    """n, m and e_t from e_r."""
    n = vec.moved(vec.times(belt.sine, radial), -side * belt.cosine, axis)
    m = vec.moved(vec.times(belt.cosine, radial), side * belt.sine, axis)
    return n, m, vec.cross(axis, radial)


@register_jitable
def mean_normal(belt, n, axis, side):
    """Change of a gap by that of the speed in a step, over the step.

    In the plane it is that of the mean position, which damps nothing (`pushbelt.chain.BETA`). Along the axis
    elements vibrate on their flanks faster than steps are, and the position that is reached damps that.
    """
    return vec.moved(vec.times(BETA, n), -(1.0 - BETA) * side * belt.cosine, axis)


@register_jitable
def along_arc(belt, state, j):
    """Cosine and sine of the angle at which the pitch line of an element stands about its pulley."""
    r, o = vec.at(state, j, f.POSITION), vec.at(state, j, f.OUTWARD)
    y = r[0] - belt.pitch_depth * o[0] - state[j, f.DRIVEN] * belt.centre_distance
    z = r[1] - belt.pitch_depth * o[1]
    per_radius = 1.0 / sqrt(y * y + z * z)
    return y * per_radius, z * per_radius


@kernel
def predict_flanks(belt, state, pulleys, step, dt):
    """Directions at q_k and at mid step; gaps with the radius at q_k and the place along the axis at q*."""
    for j in range(state.rows):
        driven = state[j, f.DRIVEN]
        centre, axis = driven * belt.centre_distance, pulley_axis(belt, driven)
        groove = of_pulley(pulleys[planar.DRIVING_RADIUS], pulleys[planar.DRIVEN_RADIUS], driven)
        middle = of_pulley(pulleys[f.DRIVING_MIDDLE], pulleys[f.DRIVEN_MIDDLE], driven)
        for sheave in (f.ON_LEFT, f.ON_RIGHT):
            if belt.local_compliance == 0.0:
                state[j, f.SPREAD + sheave] = 0.0
            step[j, f.LAST_SPREAD + sheave] = state[j, f.SPREAD + sheave]
        r, o = vec.at(state, j, f.POSITION), vec.at(state, j, f.OUTWARD)
        a = vec.cross(o, vec.at(state, j, f.HEADING))
        half = vec.moved(r, 0.5 * dt, vec.at(state, j, f.SPEED))
        half_o, half_a = vec.at(step, j, f.MID_OUTWARD), vec.at(step, j, f.MID_AXIAL)
        s, po = vec.at(step, j, f.PREDICTED_POSITION), vec.at(step, j, f.PREDICTED_OUTWARD)
        pa = vec.cross(po, vec.at(step, j, f.PREDICTED_HEADING))
        for p in range(f.POINTS):
            side, height, width = flank_point(belt, p)
            radial, start, _ = frustum(vec.plus(r, lever_of(o, a, side, height, width)), centre, axis)
            vec.store(step, j, f.RADIAL + 3 * p, radial)
            at_half = vec.plus(half, lever_of(half_o, half_a, side, height, width))
            radial, radius, _ = frustum(at_half, centre, axis)
            vec.store(step, j, f.MID_RADIAL + 3 * p, radial)
            step[j, f.MID_RADIUS + p] = radius
            _, _, along = frustum(vec.plus(s, lever_of(po, pa, side, height, width)), centre, axis)
            step[j, f.FLANK_GAP + p] = frustum_gap(belt, side, start, along, groove, middle)


@register_jitable
def _opening(belt, increments, openings, shapes, driven, j):
    """Opening of both sheaves at an element in an iterate, along the normal of a flank [m]."""
    modes, opening = belt.modal_stiffness.shape[1], like(0.0, driven)
    for k in range(modes):
        driving = openings[0, k] + increments[1 + k]
        driven_one = openings[1, k] + increments[1 + modes + k]
        opening = opening + of_pulley(driving, driven_one, driven) * shapes[j, k]
    return belt.cosine * opening


@register_jitable
def _reached_gap(belt, step, j, p, axis, lever, opening, change, dt):
    """Gap of a point in an iterate without spread [m], and n, m and e_t at q_k."""
    (du, dw), (side, _, _) = change, flank_point(belt, p)
    n, m, t = flank_directions(belt, vec.at(step, j, f.RADIAL + 3 * p), axis, side)
    rate = vec.dot(mean_normal(belt, n, axis, side), vec.plus(du, vec.cross(dw, lever)))
    return fma(dt, rate, step[j, f.FLANK_GAP + p] + opening), n, m, t


@kernel
def bend_sheaves(belt, state, work, dt):
    """Set what local bending spreads on both sides."""
    elements, step, iterate = state.elements, work.step, work.iterate
    increments, openings, shapes = state.increments, state.openings, work.shapes
    if belt.local_compliance == 0.0:
        return
    for j in range(step.rows):
        driven = elements[j, f.DRIVEN]
        axis, opening = pulley_axis(belt, driven), _opening(belt, increments, openings, shapes, driven, j)
        change = vec.screw(elements, j, f.CHANGE)
        o = vec.at(elements, j, f.OUTWARD)
        a = vec.cross(o, vec.at(elements, j, f.HEADING))
        for p in range(f.POINTS):
            lever = lever_of(o, a, *flank_point(belt, p))
            gap, _, _, _ = _reached_gap(belt, step, j, p, axis, lever, opening, change, dt)
            iterate[j, f.FLANK_REACHED + p] = -gap
    bend = belt.local_compliance, 0.5 * belt.flank_stiffness, belt.local_decay
    depths = iterate.data[:, f.FLANK_REACHED : f.FLANK_REACHED + f.POINTS]
    on_driven = elements.data[:, f.DRIVEN]
    left, right = elements.data[:, f.SPREAD + f.ON_LEFT], elements.data[:, f.SPREAD + f.ON_RIGHT]
    spread_bending(on_driven, depths[:, : f.RIGHT_LOW], left, work.bent, *bend)
    spread_bending(on_driven, depths[:, f.RIGHT_LOW :], right, work.bent, *bend)


@kernel
def flank_forces(belt, state, pulleys, increments, openings, shapes, step, iterate, dt):
    """Normal and friction forces of an iterate with their slopes; sets the residuals.

    `increments` are the changes of the border's unknowns since the last step: of the driven pulley's speed,
    and of the openings of the driving and the driven sheaves.
    """
    stiffness = 0.5 * belt.flank_stiffness
    driving_speed, driven_speed = pulleys[planar.DRIVING_SPEED], pulleys[planar.DRIVEN_SPEED] + increments[0]
    for j in range(step.rows):
        driven = state[j, f.DRIVEN]
        axis = pulley_axis(belt, driven)
        rotation = of_pulley(driving_speed, driven_speed, driven)
        opening = _opening(belt, increments, openings, shapes, driven, j)
        change = vec.screw(state, j, f.CHANGE)
        u, omega = motion(state, j, 1.0)
        o = vec.at(state, j, f.OUTWARD)
        a = vec.cross(o, vec.at(state, j, f.HEADING))
        half_o, half_a = vec.at(step, j, f.MID_OUTWARD), vec.at(step, j, f.MID_AXIAL)
        none = like(0.0, driven)
        nothing = (none, none, none), (none, none, none)
        left = force = nothing
        for p in range(f.POINTS):
            if p == f.RIGHT_LOW:
                left, force = force, nothing
            side, height, half_width = flank_point(belt, p)
            lever = lever_of(o, a, side, height, half_width)
            gap, n, m, t = _reached_gap(belt, step, j, p, axis, lever, opening, change, dt)
            gap = gap + state[j, f.SPREAD + p // 2]
            normal, stiff = pressed(gap, stiffness)
            iterate[j, f.FLANK_REACHED + p], iterate[j, f.YIELD + p] = gap, stiff

            half = lever_of(half_o, half_a, side, height, half_width)
            _, half_m, half_t = flank_directions(belt, vec.at(step, j, f.MID_RADIAL + 3 * p), axis, side)
            q = vec.plus(u, vec.cross(omega, half))
            along, around_it = vec.dot(half_m, q), vec.dot(half_t, q)
            around_it = fma(-step[j, f.MID_RADIUS + p], rotation, around_it)
            earlier = state[j, f.FLANK_SLIP_M + p], state[j, f.FLANK_SLIP_T + p]
            dual = state[j, f.FLANK_DUAL_M + p], state[j, f.FLANK_DUAL_T + p]
            slip = along, around_it
            dual, forces = flank_friction(belt, slip, earlier, dual, state[j, f.V_FILTERED + p], dt)
            state[j, f.FLANK_DUAL_M + p], state[j, f.FLANK_DUAL_T + p] = dual
            state[j, f.FLANK_SLIP_M + p], state[j, f.FLANK_SLIP_T + p] = slip
            grip_m, grip_t, mm, mt, tm, tt = forces
            state[j, f.FLANK + p] = normal
            state[j, f.FLANK_FRICTION_M + p] = normal * grip_m
            state[j, f.FLANK_FRICTION_T + p] = normal * grip_t
            iterate[j, f.SLOPE_MM + p], iterate[j, f.SLOPE_MT + p] = normal * mm, normal * mt
            iterate[j, f.SLOPE_TM + p], iterate[j, f.SLOPE_TT + p] = normal * tm, normal * tt
            by_normal = vec.moved(vec.moved(n, -grip_m, m), -grip_t, t)
            vec.store(iterate, j, f.BY_NORMAL + 3 * p, by_normal)
            force = vec.both_moved(force, normal, (by_normal, vec.cross(lever, by_normal)))
        vec.store_screw(iterate, j, f.RESIDUAL, vec.both_plus(left, force))
        iterate[j, f.RESIDUAL + f.ROW_V] = 0.0
        iterate[j, f.RESIDUAL + f.ROW_P] = 0.0


@register_jitable
def _point_slopes(belt, step, iterate, j, p, axes, dt):
    """Slopes of the force of a point: three forces, and their rows by velocity and by turning.

    The forces are those for each unit of the gap's rate and of both slips; then the lever, and t.
    """
    axis, o, a, half_o, half_a = axes
    side, height, half_width = flank_point(belt, p)
    lever = lever_of(o, a, side, height, half_width)
    n, m, t = flank_directions(belt, vec.at(step, j, f.RADIAL + 3 * p), axis, side)
    half = lever_of(half_o, half_a, side, height, half_width)
    _, half_m, half_t = flank_directions(belt, vec.at(step, j, f.MID_RADIAL + 3 * p), axis, side)
    by_gap = vec.times(dt * iterate[j, f.YIELD + p], vec.at(iterate, j, f.BY_NORMAL + 3 * p))
    by_m = vec.moved(vec.times(iterate[j, f.SLOPE_MM + p], m), iterate[j, f.SLOPE_TM + p], t)
    by_t = vec.moved(vec.times(iterate[j, f.SLOPE_MT + p], m), iterate[j, f.SLOPE_TT + p], t)
    mean = mean_normal(belt, n, axis, side)
    turns = vec.cross(lever, mean), vec.cross(half, half_m), vec.cross(half, half_t)
    return (by_gap, by_m, by_t), (mean, half_m, half_t), turns, lever, t


@register_jitable
def _by(forces, rows, k):
    """The forces times entry k of their rows; k is a plain number of the source."""
    two = vec.moved(vec.times(rows[0][k], forces[0]), rows[1][k], forces[1])
    return vec.moved(two, rows[2][k], forces[2])


@register_jitable
def _columns(points, k):
    """Forces of the two points of a side and their moments, by entry k of the velocity and of turning."""
    (forces, rows, turns, lever, _), (more, more_rows, more_turns, more_lever, _) = points
    low, high = _by(forces, rows, k), _by(more, more_rows, k)
    moving = vec.plus(low, high), vec.plus_cross(vec.cross(lever, low), more_lever, high)
    low, high = _by(forces, turns, k), _by(more, more_turns, k)
    return moving, (vec.plus(low, high), vec.plus_cross(vec.cross(lever, low), more_lever, high))


@register_jitable
def _add_columns(blocks, j, k, left, right):
    """Add what both sides have by entry k of the velocity and of turning to an element's block."""
    (left, left_turning), (right, right_turning) = _columns(left, k), _columns(right, k)
    vec.add_screw(blocks, j, f.UU + f.SIZE * k, vec.both_plus(left, right))
    vec.add_screw(blocks, j, f.UW + f.SIZE * k, vec.both_plus(left_turning, right_turning))


@register_jitable
def _excess_of_side(belt, iterate, j, low, high):
    """Slope along the axis of the two points of a side, beyond that of the bedding [N/m]."""
    pressing = iterate[j, f.YIELD + low] + iterate[j, f.YIELD + high]
    return belt.cosine * belt.cosine * axial_excess(belt.local_compliance, pressing)


@register_jitable
def _with_force(total, lever, g):
    """A force and a moment, and another force at a lever."""
    return vec.plus(total[0], g), vec.plus_cross(total[1], lever, g)


@register_jitable
def _border_of_side(belt, step, iterate, j, p, points, driven, dt):
    """Entries of the two points from p on in the border.

    First their forces and moments by the driven pulley's speed and by an opening. Then the decrease of their
    axial force, and of the driven torque, by velocity and by turning. Last that of the torque by the pulley's
    own speed and by an opening, and of the axial force by an opening.
    """
    none = like(0.0, driven)
    drive = give = torque = press = (none, none, none), (none, none, none)
    own = by_opening = yielding = none
    (forces, rows, turns, lever, t), high = points
    for q in range(2):
        if q == 1:
            forces, rows, turns, lever, t = high
        by_normal = vec.at(iterate, j, f.BY_NORMAL + 3 * (p + q))
        stiff, radius = iterate[j, f.YIELD + p + q], step[j, f.MID_RADIUS + p + q]
        tm, tt = iterate[j, f.SLOPE_TM + p + q], iterate[j, f.SLOPE_TT + p + q]
        drive = _with_force(drive, lever, vec.times(-radius * driven, forces[2]))
        if belt.modal_stiffness.shape[1] > 0:
            give = _with_force(give, lever, vec.times(belt.cosine * stiff, by_normal))
            press = vec.both_moved(press, 0.5 * belt.cosine * dt * stiff, (rows[0], turns[0]))
            yielding += 0.5 * belt.cosine * belt.cosine * stiff
        # decrease of the torque by the speeds of the element
        grip, weight = -vec.dot(t, by_normal), radius * driven
        held = weight * grip * dt * stiff
        slide, swing = -weight * tm, -weight * tt
        torque = vec.both_moved(torque, held, (rows[0], turns[0]))
        torque = vec.both_moved(torque, slide, (rows[1], turns[1]))
        torque = vec.both_moved(torque, swing, (rows[2], turns[2]))
        own += weight * radius * tt
        by_opening += weight * grip * belt.cosine * stiff
    return (drive, give), (press, torque), (own, by_opening, yielding)


@kernel
def add_flank_blocks(belt, state, work, dt):
    """Add the slopes to the blocks, set the right sides of the border's unknowns and its rows."""
    elements, step, iterate = state.elements, work.step, work.iterate
    blocks, shapes = work.narrow, work.shapes
    modes = belt.modal_stiffness.shape[1]
    for j in range(step.rows):
        driven = elements[j, f.DRIVEN]
        o = vec.at(elements, j, f.OUTWARD)
        a = vec.cross(o, vec.at(elements, j, f.HEADING))
        axes = pulley_axis(belt, driven), o, a, vec.at(step, j, f.MID_OUTWARD), vec.at(step, j, f.MID_AXIAL)
        low = _point_slopes(belt, step, iterate, j, f.LEFT_LOW, axes, dt)
        left = low, _point_slopes(belt, step, iterate, j, f.LEFT_HIGH, axes, dt)
        low = _point_slopes(belt, step, iterate, j, f.RIGHT_LOW, axes, dt)
        right = low, _point_slopes(belt, step, iterate, j, f.RIGHT_HIGH, axes, dt)
        _add_columns(blocks, j, 0, left, right)
        _add_columns(blocks, j, 1, left, right)
        _add_columns(blocks, j, 2, left, right)
        if belt.local_compliance > 0.0:
            excess = _excess_of_side(belt, iterate, j, f.LEFT_LOW, f.LEFT_HIGH)
            excess = excess + _excess_of_side(belt, iterate, j, f.RIGHT_LOW, f.RIGHT_HIGH)
            blocks[j, f.UU + f.AXIAL + f.SIZE * f.AXIAL] += dt * excess
        by_border, rows, own = _border_of_side(belt, step, iterate, j, f.LEFT_LOW, left, driven, dt)
        more, more_rows, more_own = _border_of_side(belt, step, iterate, j, f.RIGHT_LOW, right, driven, dt)
        drive, give = vec.both_plus(by_border[0], more[0]), vec.both_plus(by_border[1], more[1])
        vec.store_screw(iterate, j, f.NORMAL_ROW, vec.both_plus(rows[0], more_rows[0]))
        vec.store_screw(iterate, j, f.TORQUE_ROW, vec.both_plus(rows[1], more_rows[1]))
        iterate[j, f.TORQUE_OWN], iterate[j, f.TORQUE_OPENING] = own[0] + more_own[0], own[1] + more_own[1]
        iterate[j, f.NORMAL_YIELD] = own[2] + more_own[2]
        vec.store_screw(blocks, j, f.RIGHT_SPEED, drive)
        blocks[j, f.RIGHT_SPEED + f.ROW_V] = 0.0
        blocks[j, f.RIGHT_SPEED + f.ROW_P] = 0.0
        for k in range(2 * modes):
            pulley = driven if k >= modes else 1.0 - driven
            right_side = f.RIGHT_OPENINGS + f.SIZE * k
            vec.store_screw(blocks, j, right_side, vec.both_times(pulley * shapes[j, k % modes], give))
            blocks[j, right_side + f.ROW_V] = 0.0
            blocks[j, right_side + f.ROW_P] = 0.0
