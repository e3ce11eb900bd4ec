"""Kinematics of elements that slide on the ring, and the forces that are functions of the state.

The saddle point of an element is a material point of the ring, r(s; q). With the tangent t and the normal n
of the ring there and J = dr/dq, its velocity is n (n.J u) + t v for any speed v along the ring, since n.dr/ds
= 0; and s' = (v - t.J u) / |dr/ds|.

Set-valued friction of ring and flanks is solved by proximal points. A contact with impulse P and sliding
velocity g obeys Coulomb's law with the bound b = mu N dt exactly if

    P = prox(P - r g),    prox(x) = x where |x| <= b, else b x / |x|,

for any r > 0 (Alart and Curnier 1991). The contacts take this step one after the other, each with the speeds
that the earlier ones have left, until all laws hold. The bound of ring friction follows the normal force of
its bilateral contact, which the impulses of friction change as well. That can run away; then bounds are held
as they were with the impulses of the last step, and such a step counts as unsolved.

Impulses on the elements change the speeds of all others by way of the ring: at an element e

    (n.J u, t.J u)_e = (...)_e before + sum_f coupling[e, f] (impulse across, impulse along)_f.

r is by the response of a contact to its own impulse: 1 / G of a scalar contact; of the two directions of a
flank, which couple, by how far their rows are dominant (Foerg 2007).
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.chain import contact_gap, contact_levers, radial, turned
from cvt_hpc.multibody.rcm_beam import line_point
from cvt_hpc.multibody.rcm_chain import PER_ELEMENT, PER_NODE, SIZE, add_to_column
from cvt_hpc.physics.contact_laws import coefficient
from cvt_hpc.solvers.cyclic_blocks import solve

FLANK_CONTACT, RING_CONTACT = planar.CONTACTS.index("flank"), planar.CONTACTS.index("ring")


@kernel
def dot(row: np.ndarray, values: np.ndarray, first: int) -> float:
    """Product of a row (8,) with the values of an element from `first` on."""
    total = 0.0
    for k in range(8):
        total += row[k] * values[first + k]
    return total


@kernel
def locate(belt, state, work, dt):
    """Where elements are at the start of a step and, by their speeds, at its middle."""
    ring, e, step, rows = state.ring, state.elements, work.step, work.rows
    length = ring.beam.length
    for k in range(ring.q.size):
        work.middle[k] = ring.q[k] + 0.5 * dt * ring.u[k]
    for j in range(e.shape[0]):
        beam = min(int(e[j, b.PLACE] / length), ring.q.size // PER_ELEMENT - 1)
        first = beam * PER_ELEMENT
        work.beams[j] = beam
        s = e[j, b.PLACE] - (beam + 0.5) * length
        q = ring.q[first : first + 8]
        at = line_point(length, q, s, rows[j, b.ALONG], rows[j, b.ACROSS])
        q = work.middle[first : first + 8]
        s += 0.5 * dt * e[j, b.PLACE_RATE]
        mid = line_point(length, q, s, rows[j, b.MID_ALONG], rows[j, b.MID_ACROSS])
        e[j, planar.Y], e[j, planar.Z] = at.x, at.y
        step[j, b.T_Y], step[j, b.T_Z] = at.cos, at.sin
        step[j, b.MID_T_Y], step[j, b.MID_T_Z], step[j, b.MID_STRETCH] = mid.cos, mid.sin, mid.stretch
        cosine = at.cos * mid.cos + at.sin * mid.sin
        step[j, b.COSINE] = cosine
        step[j, b.TANGENT] = (at.cos * mid.sin - at.sin * mid.cos) / cosine
        step[j, b.FREE_T] = at.cos * e[j, planar.U_Y] + at.sin * e[j, planar.U_Z]
        step[j, b.FREE_N] = at.cos * e[j, planar.U_Z] - at.sin * e[j, planar.U_Y]
        step[j, b.IMPULSE_T] = step[j, b.IMPULSE_N] = 0.0
        step[j, b.SPIN] = e[j, planar.OMEGA]

        x = e[j, planar.HEADING_Y], e[j, planar.HEADING_Z]
        driven = at.x > 0.5 * belt.centre_distance
        e[j, planar.DRIVEN] = 1.0 if driven else 0.0
        centre = belt.centre_distance if driven else 0.0
        r_y, r_z, radius, r_lever, t_lever = radial((at.x, at.y), x, centre, belt.pitch_depth)
        step[j, b.R_Y], step[j, b.R_Z], step[j, b.R_LEVER], step[j, b.T_LEVER] = r_y, r_z, r_lever, t_lever
        groove = state.pulleys[planar.DRIVEN_RADIUS if driven else planar.DRIVING_RADIUS]
        e[j, planar.FLANK] = max(belt.flank_stiffness * (groove - radius) * belt.sine, 0.0)
        x = turned(x[0], x[1], 0.5 * dt * e[j, planar.OMEGA])
        r_y, r_z, radius, r_lever, t_lever = radial((mid.x, mid.y), x, centre, belt.pitch_depth)
        step[j, b.MID_R_Y], step[j, b.MID_R_Z], step[j, b.MID_RADIUS] = r_y, r_z, radius
        step[j, b.MID_R_LEVER], step[j, b.MID_T_LEVER] = r_lever, t_lever


@kernel
def push(belt, step, j, y, z, moment):
    """Give an element an impulse at its saddle [N s] and one of rotation [N m s]."""
    step[j, b.IMPULSE_T] += step[j, b.T_Y] * y + step[j, b.T_Z] * z
    step[j, b.IMPULSE_N] += step[j, b.T_Y] * z - step[j, b.T_Z] * y
    step[j, b.SPIN] += moment / belt.inertia


@kernel
def rub_flanks(belt, state, step, j, along_meridian, around):
    """Give an element impulses at each flank, and the driven pulley their reaction [N s]."""
    out, on = 2.0 * belt.cosine * along_meridian, 2.0 * around
    y, z = step[j, b.R_Y], step[j, b.R_Z]
    moment = out * step[j, b.R_LEVER] + on * step[j, b.T_LEVER]
    push(belt, step, j, out * y - on * z, out * z + on * y, moment)
    if state.elements[j, planar.DRIVEN] > 0.0:
        state.pulleys[planar.DRIVEN_SPEED] -= on * step[j, b.MID_RADIUS] / belt.driven_inertia


@kernel
def tilt(belt, state, step, i, j, dt):
    """Impulses by the angles of two neighbours to the segment between their saddles; law of `pushbelt`."""
    e = state.elements
    e_y, e_z = e[j, planar.Y] - e[i, planar.Y], e[j, planar.Z] - e[i, planar.Z]
    per_length = 1.0 / np.sqrt(e_y * e_y + e_z * e_z)
    e_y, e_z = e_y * per_length, e_z * per_length
    turn = (
        e_y * (e[j, planar.U_Z] - e[i, planar.U_Z]) - e_z * (e[j, planar.U_Y] - e[i, planar.U_Y])
    ) * per_length
    both = 0.0
    for k in (i, j):
        cosine = e_y * e[k, planar.HEADING_Y] + e_z * e[k, planar.HEADING_Z]
        rate = cosine * (e[k, planar.OMEGA] - turn)
        state.totals[planar.DAMPING_LOSS] += 0.5 * dt * belt.angle_damping * rate * rate
        sine = e_y * e[k, planar.HEADING_Z] - e_z * e[k, planar.HEADING_Y]
        moment = 0.5 * dt * cosine * (belt.angle_stiffness * sine + belt.angle_damping * rate)
        push(belt, step, k, 0.0, 0.0, -moment)
        both += moment * per_length
    push(belt, step, i, both * e_z, -both * e_y, 0.0)
    push(belt, step, j, -both * e_z, both * e_y, 0.0)


@kernel
def apply_forces(belt, state, work, dt):
    """Impulses of contact between elements, of tilt, of flanks, and of friction as in the last step.

    Those on the ring go into its right-hand side.
    """
    ring, e, step = state.ring, state.elements, work.step
    for i in range(e.shape[0]):
        j = (i + 1) % e.shape[0]
        ri, xi = (e[i, planar.Y], e[i, planar.Z]), (e[i, planar.HEADING_Y], e[i, planar.HEADING_Z])
        rj, xj = (e[j, planar.Y], e[j, planar.Z]), (e[j, planar.HEADING_Y], e[j, planar.HEADING_Z])
        for head in range(2):
            height = belt.head_height if head else -belt.pitch_depth
            gap = contact_gap(ri, xi, rj, xj, belt.thickness, height)
            force = max(-belt.contact_stiffness * gap, 0.0)
            e[i, planar.HEAD if head else planar.EDGE] = force
            if force > 0.0:
                lever_i, lever_j = contact_levers(ri, xi, rj, xj, belt.thickness, height)
                given = dt * force
                push(belt, step, i, -given * xj[0], -given * xj[1], given * lever_i)
                push(belt, step, j, given * xj[0], given * xj[1], given * lever_j)
        tilt(belt, state, step, i, j, dt)
    for j in range(e.shape[0]):
        pressed = 2.0 * dt * e[j, planar.FLANK] * belt.sine
        push(belt, step, j, pressed * step[j, b.R_Y], pressed * step[j, b.R_Z], pressed * step[j, b.R_LEVER])

        mu, _ = coefficient(
            belt.flank_law, belt.flank_kinetic, belt.flank_gradient, belt.flank_speed, e[j, planar.V_FILTERED]
        )
        bound = dt * mu * e[j, planar.FLANK]
        step[j, b.FLANK_BOUND] = bound
        size = np.hypot(e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T])
        if size > bound:
            e[j, b.FLANK_IMPULSE_M] *= bound / size
            e[j, b.FLANK_IMPULSE_T] *= bound / size
        rub_flanks(belt, state, step, j, e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T])
        step[j, b.IMPULSE_T] -= e[j, b.RING_IMPULSE]
        add_to_column(ring.columns, 0, work.beams[j], e[j, b.RING_IMPULSE], work.rows[j, b.ALONG])


@kernel
def element_speed(belt, step, j):
    """Speed of an element along the ring's tangent at mid step, after the step [m/s]."""
    free = (step[j, b.FREE_T] + step[j, b.IMPULSE_T] / belt.mass) / step[j, b.COSINE]
    return free + step[j, b.TANGENT] * step[j, b.RING_ACROSS]


@kernel
def saddle_impulse(belt, step, j):
    """Impulse of the bilateral contact on an element, along the ring's normal [N s]."""
    along = step[j, b.TANGENT] * (belt.mass * step[j, b.FREE_T] + step[j, b.IMPULSE_T])
    across = belt.mass * (step[j, b.RING_ACROSS] / step[j, b.COSINE] - step[j, b.FREE_N])
    return across + along - step[j, b.IMPULSE_N]


@kernel
def flank_slip(belt, pulleys, elements, step, j):
    """Sliding velocity of a flank along the meridian and in the direction of rotation [m/s]."""
    c, w = element_speed(belt, step, j), step[j, b.RING_ACROSS]
    t_y, t_z, r_y, r_z = step[j, b.MID_T_Y], step[j, b.MID_T_Z], step[j, b.MID_R_Y], step[j, b.MID_R_Z]
    u_y, u_z = c * t_y - w * t_z, c * t_z + w * t_y
    out = r_y * u_y + r_z * u_z + step[j, b.MID_R_LEVER] * step[j, b.SPIN]
    on = r_y * u_z - r_z * u_y + step[j, b.MID_T_LEVER] * step[j, b.SPIN]
    omega = (
        pulleys[planar.DRIVEN_SPEED] if elements[j, planar.DRIVEN] > 0.0 else pulleys[planar.DRIVING_SPEED]
    )
    return out / belt.cosine, on - omega * step[j, b.MID_RADIUS]


@kernel
def couple(state, work):
    """Find `coupling` of all elements, by unit impulses on the ring, whose matrix has been factored."""
    n, lanes = state.elements.shape[0], work.columns.data.shape[2]
    nodes = state.ring.blocks.rows - 1
    data = work.columns.data
    for batch in range(0, 2 * n, lanes):
        data[:] = 0.0
        for lane in range(0, min(lanes, 2 * n - batch), 2):
            one = (batch + lane) // 2
            add_to_column(work.columns, lane, work.beams[one], 1.0, work.rows[one, b.ACROSS])
            add_to_column(work.columns, lane + 1, work.beams[one], 1.0, work.rows[one, b.ALONG])
        solve(state.ring.blocks, work.columns, SIZE)
        for e in range(n):
            i, j = work.beams[e], (work.beams[e] + 1) % nodes
            for kind in range(2):
                row, found = work.rows[e, b.MID_ALONG if kind else b.MID_ACROSS], work.coupling[e, kind]
                for lane in range(lanes):
                    found[batch + lane] = 0.0
                for r in range(PER_ELEMENT):
                    for lane in range(lanes):
                        found[batch + lane] += row[r] * data[i, r, lane]
                for r in range(PER_NODE):
                    for lane in range(lanes):
                        found[batch + lane] += row[PER_ELEMENT + r] * data[j, r, lane]


@kernel
def _ring_change(row, impulses):
    """Change of a speed of the ring by all impulses so far."""
    a = b = c = d = 0.0
    for k in range(0, impulses.size, 4):
        a += row[k] * impulses[k]
        b += row[k + 1] * impulses[k + 1]
        c += row[k + 2] * impulses[k + 2]
        d += row[k + 3] * impulses[k + 3]
    return (a + b) + (c + d)


@kernel
def _own(work, j, across, along):
    """Change of both speeds of the ring at an element by impulses there."""
    both = work.coupling[j]
    k = 2 * j
    return (
        both[0, k] * across + both[0, k + 1] * along,
        both[1, k] * across + both[1, k + 1] * along,
    )


@kernel
def _flank_response(belt, state, work, j, along_meridian, around):
    """Change of `flank_slip` by impulses on both flanks, where nothing else changes [m/s]."""
    step, t = work.step, work.step[j, b.TANGENT]
    out, on = 2.0 * belt.cosine * along_meridian, 2.0 * around
    y, z = out * step[j, b.R_Y] - on * step[j, b.R_Z], out * step[j, b.R_Z] + on * step[j, b.R_Y]
    on_t, on_n = y * step[j, b.T_Y] + z * step[j, b.T_Z], z * step[j, b.T_Y] - y * step[j, b.T_Z]
    spin = (out * step[j, b.R_LEVER] + on * step[j, b.T_LEVER]) / belt.inertia
    w, _ = _own(work, j, on_n - t * on_t, 0.0)
    c = on_t / (belt.mass * step[j, b.COSINE]) + t * w
    u_y = c * step[j, b.MID_T_Y] - w * step[j, b.MID_T_Z]
    u_z = c * step[j, b.MID_T_Z] + w * step[j, b.MID_T_Y]
    slip_m = step[j, b.MID_R_Y] * u_y + step[j, b.MID_R_Z] * u_z + step[j, b.MID_R_LEVER] * spin
    slip_t = step[j, b.MID_R_Y] * u_z - step[j, b.MID_R_Z] * u_y + step[j, b.MID_T_LEVER] * spin
    if state.elements[j, planar.DRIVEN] > 0.0:
        slip_t += on * step[j, b.MID_RADIUS] ** 2 / belt.driven_inertia
    return slip_m / belt.cosine, slip_t


@kernel
def _proximal_steps(belt, state, work, j):
    """Lengths of the steps of an element's contacts."""
    step, t = work.step, work.step[j, b.TANGENT]
    w, z = _own(work, j, t, 1.0)
    step[j, b.RING_STEP] = 1.0 / (z + 1.0 / (belt.mass * step[j, b.COSINE]) - t * w)
    a, beside_c = _flank_response(belt, state, work, j, 1.0, 0.0)
    beside_a, c = _flank_response(belt, state, work, j, 0.0, 1.0)
    beside_a, beside_c = abs(beside_a), abs(beside_c)
    if a - beside_a >= c - beside_c:
        step[j, b.FLANK_STEP] = (
            2.0 / (a + c + beside_a - beside_c) if a + beside_a >= c + beside_c else 1.0 / c
        )
    else:
        step[j, b.FLANK_STEP] = (
            2.0 / (a + c - beside_a + beside_c) if a + beside_a < c + beside_c else 1.0 / a
        )


@kernel
def _correct_ring(belt, state, work, impulses, j, held, tolerance):
    """A step of the proximal point of ring friction; False where its law held already."""
    step, e = work.step, state.elements
    slip = step[j, b.RING_ALONG] - element_speed(belt, step, j)
    given, r = e[j, b.RING_IMPULSE], step[j, b.RING_STEP]
    bound = belt.ring_friction * (work.free[j, 2] if held else abs(saddle_impulse(belt, step, j)))
    unit = tolerance * r
    if abs(slip) <= tolerance:
        if abs(given) <= bound + unit:
            return False
    elif abs(given + (bound if slip > 0.0 else -bound)) <= unit:
        return False
    change = min(max(given - r * slip, -bound), bound) - given
    e[j, b.RING_IMPULSE] += change
    step[j, b.IMPULSE_T] -= change
    across = step[j, b.TANGENT] * change
    impulses[2 * j] += across
    impulses[2 * j + 1] += change
    w, z = _own(work, j, across, change)
    step[j, b.RING_ACROSS] += w
    step[j, b.RING_ALONG] += z
    return True


@kernel
def _correct_flank(belt, state, work, impulses, j, tolerance):
    """Likewise of both flanks."""
    step, e = work.step, state.elements
    slip_m, slip_t = flank_slip(belt, state.pulleys, e, step, j)
    given_m, given_t, bound = e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T], step[j, b.FLANK_BOUND]
    slip, r = np.hypot(slip_m, slip_t), step[j, b.FLANK_STEP]
    unit = tolerance * r
    if slip <= tolerance:
        if np.hypot(given_m, given_t) <= bound + unit:
            return False
    elif np.hypot(given_m + bound * slip_m / slip, given_t + bound * slip_t / slip) <= unit:
        return False
    m, t = given_m - r * slip_m, given_t - r * slip_t
    size = np.hypot(m, t)
    if size > bound:
        m, t = m * bound / size, t * bound / size
    before_t, before_n = step[j, b.IMPULSE_T], step[j, b.IMPULSE_N]
    rub_flanks(belt, state, step, j, m - given_m, t - given_t)
    e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T] = m, t
    across = step[j, b.IMPULSE_N] - before_n - step[j, b.TANGENT] * (step[j, b.IMPULSE_T] - before_t)
    impulses[2 * j] += across
    w, z = _own(work, j, across, 0.0)
    step[j, b.RING_ACROSS] += w
    step[j, b.RING_ALONG] += z
    return True


@kernel
def rub(belt, proximal, state, work):
    """Find the impulses of friction of a step; whether all laws hold.

    The speeds of the ring at the elements, in `free`, are those with the impulses of the last step. The
    change of these is left in column 0 of the ring's right-hand side.
    """
    step, e, counters = work.step, state.elements, state.counters
    n, impulses = e.shape[0], work.impulses
    impulses[:] = 0.0
    for j in range(n):
        _proximal_steps(belt, state, work, j)
        work.free[j, 2] = abs(saddle_impulse(belt, step, j))
    held = solved = False
    for sweep in range(proximal.most_sweeps):
        counters[planar.ITERATIONS] += 1
        held, solved = sweep >= proximal.free_sweeps, True
        for j in range(n):
            step[j, b.RING_ACROSS] = work.free[j, 0] + _ring_change(work.coupling[j, 0], impulses)
            step[j, b.RING_ALONG] = work.free[j, 1] + _ring_change(work.coupling[j, 1], impulses)
            if belt.ring_friction > 0.0 and _correct_ring(
                belt, state, work, impulses, j, held, proximal.tolerance
            ):
                solved = False
                counters[b.CORRECTIONS] += 1
                counters[planar.FAILED_ELEMENT], counters[planar.FAILED_CONTACT] = j, RING_CONTACT
            if step[j, b.FLANK_BOUND] > 0.0 and _correct_flank(
                belt, state, work, impulses, j, proximal.tolerance
            ):
                solved = False
                counters[b.CORRECTIONS] += 1
                counters[planar.FAILED_ELEMENT], counters[planar.FAILED_CONTACT] = j, FLANK_CONTACT
        if solved:
            break
    columns = state.ring.columns
    columns.data[:] = 0.0
    for j in range(n):
        add_to_column(columns, 0, work.beams[j], impulses[2 * j], work.rows[j, b.ACROSS])
        add_to_column(columns, 0, work.beams[j], impulses[2 * j + 1], work.rows[j, b.ALONG])
    return solved and not held
