"""Set-valued friction of elements on a ring of beams and on their flanks, by proximal points.

A contact with impulse P and sliding velocity g obeys Coulomb's law with the bound b = mu N dt exactly if

    P = prox(P - r g),    prox(x) = x where |x| <= b, else b x / |x|,

for any r > 0 (Alart and Curnier 1991). The contacts take this step one after the other, each with the speeds
that the earlier ones have left, until all laws hold. Impulses on the elements change the speeds of all others
by way of the ring: at an element e

    (n.J u, t.J u)_e = (...)_e before + sum_f coupling[e, f] (impulse across, impulse along)_f.

r is 1 / G of a scalar contact with the response G to its own impulse; of the two directions of a flank, which
couple, it follows from how far their rows are dominant (Foerg 2007). The bound of ring friction follows the
normal force of its bilateral contact, which the impulses change as well. That can run away; then bounds are
held as they were with the impulses of the last step, and such a step counts as unsolved.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt.ring import PER_BEAM, SIZE, add_to_column, along_row
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.solvers.cyclic_blocks import solve

_MOST_SWEEPS = 500  # over all contacts in a step
_FREE_SWEEPS = 200  # in which the bounds of ring friction follow its normal forces
_FLANK_CONTACT, _RING_CONTACT = f.CONTACTS.index("flank"), f.CONTACTS.index("ring")


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
    if state.elements[j, f.DRIVEN] > 0.0:
        state.pulleys[f.DRIVEN_SPEED] -= on * step[j, b.MID_RADIUS] / belt.driven_inertia


@kernel
def take(state, work):
    """Take the ring's speeds, and those of its points under the elements, on by a solution."""
    ring, step = state.ring, work.step
    solve(ring.blocks, ring.columns, SIZE)
    for k in range(ring.u.size):
        ring.u[k] += ring.columns.data[k // PER_BEAM % (ring.blocks.rows - 1), k % PER_BEAM, 0]
    for j in range(step.shape[0]):
        beam, rows = work.beams[j], work.rows[j]
        step[j, b.RING_ACROSS] += along_row(ring.columns, 0, beam, rows[b.MID_ACROSS])
        step[j, b.RING_ALONG] += along_row(ring.columns, 0, beam, rows[b.MID_ALONG])


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
def _at_flank(step, j, along, across, spin):
    """Radial and circumferential speed of flanks at mid step, by the element's along and across the ring."""
    t_y, t_z, r_y, r_z = step[j, b.MID_T_Y], step[j, b.MID_T_Z], step[j, b.MID_R_Y], step[j, b.MID_R_Z]
    u_y, u_z = along * t_y - across * t_z, along * t_z + across * t_y
    out = r_y * u_y + r_z * u_z + step[j, b.MID_R_LEVER] * spin
    return out, r_y * u_z - r_z * u_y + step[j, b.MID_T_LEVER] * spin


@kernel
def flank_slip(belt, state, step, j):
    """Sliding velocity of a flank along the meridian and in the direction of rotation [m/s]."""
    out, on = _at_flank(step, j, element_speed(belt, step, j), step[j, b.RING_ACROSS], step[j, b.SPIN])
    omega = state.pulleys[f.DRIVEN_SPEED if state.elements[j, f.DRIVEN] > 0.0 else f.DRIVING_SPEED]
    return out / belt.cosine, on - omega * step[j, b.MID_RADIUS]


@kernel
def _couple(state, work):
    """Find `coupling` of all elements, by unit impulses on the ring, whose matrix has been factored."""
    n, lanes, nodes = state.elements.shape[0], work.columns.data.shape[2], state.ring.blocks.rows - 1
    data = work.columns.data
    for batch in range(0, 2 * n, lanes):
        data[:] = 0.0
        for lane in range(0, min(lanes, 2 * n - batch), 2):
            one = (batch + lane) // 2
            add_to_column(work.columns, lane, work.beams[one], 1.0, work.rows[one, b.ACROSS])
            add_to_column(work.columns, lane + 1, work.beams[one], 1.0, work.rows[one, b.ALONG])
        solve(state.ring.blocks, work.columns, SIZE)
        for e in range(n):
            for kind, mid in ((0, b.MID_ACROSS), (1, b.MID_ALONG)):
                found, row = work.coupling[e, kind, batch : batch + lanes], work.rows[e, mid]
                found[:] = 0.0
                for r in range(8):
                    node = (work.beams[e] + r // PER_BEAM) % nodes
                    for lane in range(lanes):
                        found[lane] += row[r] * data[node, r % PER_BEAM, lane]


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
    g, k = work.coupling[j], 2 * j
    return g[0, k] * across + g[0, k + 1] * along, g[1, k] * across + g[1, k + 1] * along


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
    slip_m, slip_t = _at_flank(step, j, c, w, spin)
    if state.elements[j, f.DRIVEN] > 0.0:
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
        r = 2.0 / (a + c + beside_a - beside_c) if a + beside_a >= c + beside_c else 1.0 / c
    else:
        r = 2.0 / (a + c - beside_a + beside_c) if a + beside_a < c + beside_c else 1.0 / a
    step[j, b.FLANK_STEP] = r


@kernel
def _respond(work, j, across, along):
    """Take the speeds of the ring at an element on by impulses there; those at others follow in `rub`."""
    work.impulses[2 * j] += across
    work.impulses[2 * j + 1] += along
    w, z = _own(work, j, across, along)
    work.step[j, b.RING_ACROSS] += w
    work.step[j, b.RING_ALONG] += z


@kernel
def _correct_ring(belt, state, work, j, held, tolerance):
    """A step of the proximal point of ring friction; False where its law held already."""
    step, e = work.step, state.elements
    slip = step[j, b.RING_ALONG] - element_speed(belt, step, j)
    given, r = e[j, b.RING_IMPULSE], step[j, b.RING_STEP]
    bound = belt.ring_friction * (step[j, b.FREE_SADDLE] if held else abs(saddle_impulse(belt, step, j)))
    if abs(slip) <= tolerance:
        if abs(given) <= bound + tolerance * r:
            return False
    elif abs(given + (bound if slip > 0.0 else -bound)) <= tolerance * r:
        return False
    change = min(max(given - r * slip, -bound), bound) - given
    e[j, b.RING_IMPULSE] += change
    step[j, b.IMPULSE_T] -= change
    _respond(work, j, step[j, b.TANGENT] * change, change)
    return True


@kernel
def _correct_flank(belt, state, work, j, tolerance):
    """Likewise of both flanks."""
    step, e = work.step, state.elements
    slip_m, slip_t = flank_slip(belt, state, step, j)
    given_m, given_t, bound = e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T], step[j, b.FLANK_BOUND]
    slip, r = np.hypot(slip_m, slip_t), step[j, b.FLANK_STEP]
    if slip <= tolerance:
        if np.hypot(given_m, given_t) <= bound + tolerance * r:
            return False
    elif np.hypot(given_m + bound * slip_m / slip, given_t + bound * slip_t / slip) <= tolerance * r:
        return False
    m, t = given_m - r * slip_m, given_t - r * slip_t
    size = np.hypot(m, t)
    if size > bound:
        m, t = m * bound / size, t * bound / size
    before_t, before_n = step[j, b.IMPULSE_T], step[j, b.IMPULSE_N]
    rub_flanks(belt, state, step, j, m - given_m, t - given_t)
    e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T] = m, t
    across = step[j, b.IMPULSE_N] - before_n - step[j, b.TANGENT] * (step[j, b.IMPULSE_T] - before_t)
    _respond(work, j, across, 0.0)
    return True


@kernel
def rub(belt, tolerance, state, work):
    """Find the impulses of friction of a step; whether all laws hold."""
    step, counters, columns, impulses = work.step, state.counters, state.ring.columns, work.impulses
    n = step.shape[0]
    _couple(state, work)
    impulses[:] = 0.0
    for j in range(n):
        _proximal_steps(belt, state, work, j)
        step[j, b.FREE_ACROSS], step[j, b.FREE_ALONG] = step[j, b.RING_ACROSS], step[j, b.RING_ALONG]
        step[j, b.FREE_SADDLE] = abs(saddle_impulse(belt, step, j))
    held = solved = False
    for sweep in range(_MOST_SWEEPS):
        counters[f.ITERATIONS] += 1
        held, solved = sweep >= _FREE_SWEEPS, True
        for j in range(n):
            step[j, b.RING_ACROSS] = step[j, b.FREE_ACROSS] + _ring_change(work.coupling[j, 0], impulses)
            step[j, b.RING_ALONG] = step[j, b.FREE_ALONG] + _ring_change(work.coupling[j, 1], impulses)
            if belt.ring_friction > 0.0 and _correct_ring(belt, state, work, j, held, tolerance):
                solved = False
                counters[f.FAILED_ELEMENT], counters[f.FAILED_CONTACT] = j, _RING_CONTACT
            if step[j, b.FLANK_BOUND] > 0.0 and _correct_flank(belt, state, work, j, tolerance):
                solved = False
                counters[f.FAILED_ELEMENT], counters[f.FAILED_CONTACT] = j, _FLANK_CONTACT
        if solved:
            break
    columns.data[:] = 0.0
    for j in range(n):
        add_to_column(columns, 0, work.beams[j], impulses[2 * j], work.rows[j, b.ACROSS])
        add_to_column(columns, 0, work.beams[j], impulses[2 * j + 1], work.rows[j, b.ALONG])
        step[j, b.RING_ACROSS], step[j, b.RING_ALONG] = step[j, b.FREE_ACROSS], step[j, b.FREE_ALONG]
    take(state, work)
    return solved and not held
