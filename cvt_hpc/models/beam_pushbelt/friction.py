"""Set-valued friction of ring and flanks, by proximal points.

A contact with impulse P and sliding velocity g obeys Coulomb's law with the bound b = mu N dt exactly if

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
from cvt_hpc.models.beam_pushbelt import fields as f
from cvt_hpc.models.beam_pushbelt.forces import rub_flanks
from cvt_hpc.models.pushbelt import fields
from cvt_hpc.multibody.rcm_chain import PER_ELEMENT, PER_NODE, SIZE, add_to_column
from cvt_hpc.solvers.cyclic_blocks import solve

FLANK_CONTACT, RING_CONTACT = fields.CONTACTS.index("flank"), fields.CONTACTS.index("ring")


@kernel
def element_speed(belt, step, j):
    """Speed of an element along the ring's tangent at mid step, after the step [m/s]."""
    free = (step[j, f.FREE_T] + step[j, f.IMPULSE_T] / belt.mass) / step[j, f.COSINE]
    return free + step[j, f.TANGENT] * step[j, f.RING_ACROSS]


@kernel
def saddle_impulse(belt, step, j):
    """Impulse of the bilateral contact on an element, along the ring's normal [N s]."""
    along = step[j, f.TANGENT] * (belt.mass * step[j, f.FREE_T] + step[j, f.IMPULSE_T])
    across = belt.mass * (step[j, f.RING_ACROSS] / step[j, f.COSINE] - step[j, f.FREE_N])
    return across + along - step[j, f.IMPULSE_N]


@kernel
def flank_slip(belt, pulleys, elements, step, j):
    """Sliding velocity of a flank along the meridian and in the direction of rotation [m/s]."""
    c, w = element_speed(belt, step, j), step[j, f.RING_ACROSS]
    t_y, t_z, r_y, r_z = step[j, f.MID_T_Y], step[j, f.MID_T_Z], step[j, f.MID_R_Y], step[j, f.MID_R_Z]
    u_y, u_z = c * t_y - w * t_z, c * t_z + w * t_y
    out = r_y * u_y + r_z * u_z + step[j, f.MID_R_LEVER] * step[j, f.SPIN]
    on = r_y * u_z - r_z * u_y + step[j, f.MID_T_LEVER] * step[j, f.SPIN]
    omega = (
        pulleys[fields.DRIVEN_SPEED] if elements[j, fields.DRIVEN] > 0.0 else pulleys[fields.DRIVING_SPEED]
    )
    return out / belt.cosine, on - omega * step[j, f.MID_RADIUS]


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
            add_to_column(work.columns, lane, work.beams[one], 1.0, work.rows[one, f.ACROSS])
            add_to_column(work.columns, lane + 1, work.beams[one], 1.0, work.rows[one, f.ALONG])
        solve(state.ring.blocks, work.columns, SIZE)
        for e in range(n):
            i, j = work.beams[e], (work.beams[e] + 1) % nodes
            for kind in range(2):
                row, found = work.rows[e, f.MID_ALONG if kind else f.MID_ACROSS], work.coupling[e, kind]
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
    step, t = work.step, work.step[j, f.TANGENT]
    out, on = 2.0 * belt.cosine * along_meridian, 2.0 * around
    y, z = out * step[j, f.R_Y] - on * step[j, f.R_Z], out * step[j, f.R_Z] + on * step[j, f.R_Y]
    on_t, on_n = y * step[j, f.T_Y] + z * step[j, f.T_Z], z * step[j, f.T_Y] - y * step[j, f.T_Z]
    spin = (out * step[j, f.R_LEVER] + on * step[j, f.T_LEVER]) / belt.inertia
    w, _ = _own(work, j, on_n - t * on_t, 0.0)
    c = on_t / (belt.mass * step[j, f.COSINE]) + t * w
    u_y = c * step[j, f.MID_T_Y] - w * step[j, f.MID_T_Z]
    u_z = c * step[j, f.MID_T_Z] + w * step[j, f.MID_T_Y]
    slip_m = step[j, f.MID_R_Y] * u_y + step[j, f.MID_R_Z] * u_z + step[j, f.MID_R_LEVER] * spin
    slip_t = step[j, f.MID_R_Y] * u_z - step[j, f.MID_R_Z] * u_y + step[j, f.MID_T_LEVER] * spin
    if state.elements[j, fields.DRIVEN] > 0.0:
        slip_t += on * step[j, f.MID_RADIUS] ** 2 / belt.driven_inertia
    return slip_m / belt.cosine, slip_t


@kernel
def _proximal_steps(belt, state, work, j):
    """Lengths of the steps of an element's contacts."""
    step, t = work.step, work.step[j, f.TANGENT]
    w, z = _own(work, j, t, 1.0)
    step[j, f.RING_STEP] = 1.0 / (z + 1.0 / (belt.mass * step[j, f.COSINE]) - t * w)
    a, beside_b = _flank_response(belt, state, work, j, 1.0, 0.0)
    beside_a, b = _flank_response(belt, state, work, j, 0.0, 1.0)
    beside_a, beside_b = abs(beside_a), abs(beside_b)
    if a - beside_a >= b - beside_b:
        step[j, f.FLANK_STEP] = (
            2.0 / (a + b + beside_a - beside_b) if a + beside_a >= b + beside_b else 1.0 / b
        )
    else:
        step[j, f.FLANK_STEP] = (
            2.0 / (a + b - beside_a + beside_b) if a + beside_a < b + beside_b else 1.0 / a
        )


@kernel
def _correct_ring(belt, state, work, impulses, j, held, tolerance):
    """A step of the proximal point of ring friction; False where its law held already."""
    step, e = work.step, state.elements
    slip = step[j, f.RING_ALONG] - element_speed(belt, step, j)
    given, r = e[j, f.RING_IMPULSE], step[j, f.RING_STEP]
    bound = belt.ring_friction * (work.free[j, 2] if held else abs(saddle_impulse(belt, step, j)))
    unit = tolerance * r
    if abs(slip) <= tolerance:
        if abs(given) <= bound + unit:
            return False
    elif abs(given + (bound if slip > 0.0 else -bound)) <= unit:
        return False
    change = min(max(given - r * slip, -bound), bound) - given
    e[j, f.RING_IMPULSE] += change
    step[j, f.IMPULSE_T] -= change
    across = step[j, f.TANGENT] * change
    impulses[2 * j] += across
    impulses[2 * j + 1] += change
    w, z = _own(work, j, across, change)
    step[j, f.RING_ACROSS] += w
    step[j, f.RING_ALONG] += z
    return True


@kernel
def _correct_flank(belt, state, work, impulses, j, tolerance):
    """Likewise of both flanks."""
    step, e = work.step, state.elements
    slip_m, slip_t = flank_slip(belt, state.pulleys, e, step, j)
    given_m, given_t, bound = e[j, f.FLANK_IMPULSE_M], e[j, f.FLANK_IMPULSE_T], step[j, f.FLANK_BOUND]
    slip, r = np.hypot(slip_m, slip_t), step[j, f.FLANK_STEP]
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
    before_t, before_n = step[j, f.IMPULSE_T], step[j, f.IMPULSE_N]
    rub_flanks(belt, state, step, j, m - given_m, t - given_t)
    e[j, f.FLANK_IMPULSE_M], e[j, f.FLANK_IMPULSE_T] = m, t
    across = step[j, f.IMPULSE_N] - before_n - step[j, f.TANGENT] * (step[j, f.IMPULSE_T] - before_t)
    impulses[2 * j] += across
    w, z = _own(work, j, across, 0.0)
    step[j, f.RING_ACROSS] += w
    step[j, f.RING_ALONG] += z
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
        counters[fields.ITERATIONS] += 1
        held, solved = sweep >= proximal.free_sweeps, True
        for j in range(n):
            step[j, f.RING_ACROSS] = work.free[j, 0] + _ring_change(work.coupling[j, 0], impulses)
            step[j, f.RING_ALONG] = work.free[j, 1] + _ring_change(work.coupling[j, 1], impulses)
            if belt.ring_friction > 0.0 and _correct_ring(
                belt, state, work, impulses, j, held, proximal.tolerance
            ):
                solved = False
                counters[f.CORRECTIONS] += 1
                counters[fields.FAILED_ELEMENT], counters[fields.FAILED_CONTACT] = j, RING_CONTACT
            if step[j, f.FLANK_BOUND] > 0.0 and _correct_flank(
                belt, state, work, impulses, j, proximal.tolerance
            ):
                solved = False
                counters[f.CORRECTIONS] += 1
                counters[fields.FAILED_ELEMENT], counters[fields.FAILED_CONTACT] = j, FLANK_CONTACT
        if solved:
            break
    columns = state.ring.columns
    columns.data[:] = 0.0
    for j in range(n):
        add_to_column(columns, 0, work.beams[j], impulses[2 * j], work.rows[j, f.ACROSS])
        add_to_column(columns, 0, work.beams[j], impulses[2 * j + 1], work.rows[j, f.ALONG])
    return solved and not held
