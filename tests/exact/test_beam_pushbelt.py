"""The pushbelt on a ring of beams: exact motions of its parts, conserved quantities, the laws of its contacts."""

import numpy as np
import pytest

from cvt_hpc.models.beam_pushbelt import fields as f
from cvt_hpc.models.beam_pushbelt.rcm import RcmBeam, line_point
from cvt_hpc.models.beam_pushbelt.ring import close, relaxed_ring
from cvt_hpc.models.beam_pushbelt.step import advance
from cvt_hpc.models.beam_pushbelt.transient import LAW_TOLERANCE, BeltState, workspace
from cvt_hpc.models.pushbelt import fields
from cvt_hpc.models.pushbelt.belt import Belt
from support.complementarity import solve_lcp
from support.rcm import conserved, equations

MASS, INERTIA = 0.01, 2e-7  # of an element [kg], [kg m^2]
NO_INPUTS = np.zeros((2, fields.INPUTS))


def belt_with(**values):
    """Elements on a ring that touch nothing else, unless `values` say so."""
    none = dict.fromkeys(Belt._fields, 0.0)
    common = {"mass": MASS, "inertia": INERTIA, "sine": 0.19, "cosine": np.sqrt(1.0 - 0.19**2)}
    pulleys = {"centre_distance": 10.0, "driven_inertia": 0.02, "nose_clearance": np.inf}
    modes = {"modal_stiffness": np.zeros((2, 0)), "modal_damping": np.zeros((2, 0)), "flank_law": 0}
    return Belt(**none | common | pulleys | modes | {"thickness": 0.008, "head_height": 0.004} | values)


def under(ring, place):
    """The line at a place of a ring, its rows of coordinates (2, 8), and the first of these coordinates."""
    rows, length = np.empty((2, 8)), ring.beam.length
    i = min(int(place / length), ring.q.size // 5 - 1)
    point = line_point(length, ring.q[5 * i : 5 * i + 8], place - (i + 0.5) * length, *rows)
    return point, rows, 5 * i


def state_of(ring, places, sliding, spin=0.0):
    """Elements that slide along a ring with speeds against it [m/s], upright on it, and work space."""
    e = np.zeros((len(places), f.FIELDS))
    for row, place, slip in zip(e, places, np.broadcast_to(sliding, len(places)), strict=True):
        point, rows, k = under(ring, place)
        along, across = rows @ ring.u[k : k + 8]
        t = np.array([point.cos, point.sin])
        row[f.PLACE], row[f.PLACE_RATE], row[fields.OMEGA] = place, slip / point.stretch, spin
        row[[fields.U_Y, fields.U_Z]] = (along + slip) * t + across * np.array([-t[1], t[0]])
        row[[fields.HEADING_Y, fields.HEADING_Z]] = t
        row[[fields.Y, fields.Z]] = point.x, point.y
    counters = np.zeros(fields.COUNTERS, np.int64)
    state = BeltState(ring, e, np.zeros(4), np.zeros(fields.TOTALS), counters)
    return state, workspace(ring, len(places))


def march(belt, state, work, steps, dt, tolerance=LAW_TOLERANCE):
    found = advance(belt, tolerance, state, work, NO_INPUTS, steps, dt)
    assert found == fields.CONVERGED
    assert state.counters[fields.FAILED_STEPS] == 0


def spinning(sliding=0.0, beams=12, loaded=True, **values):
    """A ring in the stretch with which it turns at 100 rad/s, and elements that slide on it."""
    line_mass, radius = 0.25 + loaded * 36 * MASS / (0.2 * np.pi), 0.1
    beam = RcmBeam(2.0 * np.pi * radius / beams, 0.25, 6e5, 0.02, 1.0 / radius)
    ring = relaxed_ring(beam, beams)
    stretched = 1.0 + line_mass * (100.0 * radius) ** 2 / 6e5
    for k in (0, 1, 3, 4):
        ring.q[k::5] *= stretched
    ring.u[0::5], ring.u[1::5], ring.u[2::5] = -100.0 * ring.q[1::5], 100.0 * ring.q[0::5], 100.0
    close(ring)
    state, work = state_of(ring, (np.arange(36) + 0.3) * beam.length * beams / 36, sliding, 100.0)
    return belt_with(**values), state, work


def test_beads_on_a_turning_ring():
    # beads without mass keep their speed along the ring, and press by m (omega r + v)^2 / r, Coriolis' force in it
    belt, state, work = spinning(beams=24, loaded=False, mass=1e-9)
    ring, start, speed = state.ring, np.array([0.05, 0.28]), np.array([8.0, -25.0])
    state, work = state_of(ring, start, speed)
    pressed = []
    for _ in range(400):
        march(belt, state, work, 1, 5e-6)
        pressed.append(state.elements[:, fields.SADDLE].copy())
    # within what a ring of 24 beams is out of round, and breathes
    np.testing.assert_allclose(state.elements[:, f.PLACE] - start, 2e-3 * speed, rtol=0.005)
    exact = 1e-9 * (10.0 + speed) ** 2 / 0.1
    np.testing.assert_allclose(np.mean(pressed, axis=0), exact, rtol=0.03)


def test_tension_of_a_spinning_ring():
    # m v^2 of ring and elements, in the mean over the swings by which the ring takes up its elements. A beam
    # that turns by 30 degrees has less, as its slopes count as small
    errors, line_mass = [], 0.25 + 36 * MASS / (0.2 * np.pi)
    for beams in (12, 24):
        belt, state, work = spinning(beams=beams)
        pull, squares = [], []
        for _ in range(300):
            march(belt, state, work, 5, 1e-5)
            pull.append(state.elements[:, fields.TENSION].copy())
            squares.append((state.elements[:, [fields.U_Y, fields.U_Z]] ** 2).sum(axis=1))
        errors.append(np.mean(pull, axis=0) / (line_mass * np.mean(squares)) - 1.0)
    assert abs(errors[1]).max() < 0.7 * abs(errors[0]).max() < 0.01


def whole(state):
    """Momentum, angular momentum and energy of ring and elements [N s], [N m s], [J]."""
    e = state.elements
    (y, z), (u, w) = e[:, [fields.Y, fields.Z]].T, e[:, [fields.U_Y, fields.U_Z]].T
    spin = MASS * (y * w - z * u) + INERTIA * e[:, fields.OMEGA]
    energy = 0.5 * (MASS * (u * u + w * w) + INERTIA * e[:, fields.OMEGA] ** 2)
    own = [MASS * u.sum(), MASS * w.sum(), spin.sum(), energy.sum()]
    return conserved(state.ring) + own


def thrown(dt, **values):
    """Change in 1 ms of momenta and energy of a deformed ring on which elements slide at 4 to 6 m/s."""
    belt, state, work = spinning(**values)
    ring = state.ring
    ring.u[:] += 0.5 * np.random.default_rng(3).normal(size=ring.u.size)
    close(ring)
    state, work = state_of(ring, state.elements[:, f.PLACE].copy(), 5.0 + np.cos(np.arange(36)), 0.0)
    before = whole(state)
    march(belt, state, work, round(1e-3 / dt), dt)
    change = whole(state) - before
    losses = state.totals[fields.RING_LOSS] + state.totals[fields.DAMPING_LOSS]
    change[3] += losses
    return before, change, losses


@pytest.mark.parametrize("values", [{}, {"ring_friction": 0.2, "angle_damping": 1e-3}])
def test_free_flight(values, tell):
    # a step of first order errs by its size; momentum is that of some N s, of which single elements have 0.15
    before, coarse, losses = thrown(4e-6, **values)
    _, fine, _ = thrown(2e-6, **values)
    tell("error of energy with half the step over that with the step", abs(fine[3] / coarse[3]))
    tell("change of momenta in a free flight", abs(coarse[:3]).max())
    assert (losses > 0.1) == bool(values)
    assert abs(coarse[:3]).max() < 1e-4
    assert abs(coarse[3]) < 1e-4 * before[3]
    assert abs(fine[3]) < 0.6 * abs(coarse[3])


def test_friction_against_lemke(tell):
    # eight elements, three of which stick; the constrained equations with the contacts' forces as unknowns
    belt, state, work = spinning(ring_friction=0.3)
    ring, dt, mu = state.ring, 1e-5, 0.3
    places, sliding = np.array([1.1, 2.2, 3.5, 5.1, 7.3, 8.2, 8.6, 11.4]) * ring.beam.length, np.zeros(8)
    sliding[[0, 3, 4, 6, 7]] = 1e-3, -0.5, 0.4, 2e-4, -3e-4
    ring.u[:] += 0.02 * np.random.default_rng(5).normal(size=ring.u.size)
    close(ring)
    state, work = state_of(ring, places, sliding, 100.0)
    mass, force = equations(ring, 0.25 * dt * dt)
    size = force.size
    u, old = ring.u[:size].copy(), state.elements[:, [fields.U_Y, fields.U_Z]].copy()
    # directions at the start of the step and at its middle
    frames = []
    for ahead in (0.0, 0.5 * dt):
        ring.q[:] += ahead * ring.u
        at = np.zeros((8, 2, size))
        tangents = np.empty((8, 2))
        for j, place in enumerate(places + ahead * state.elements[:, f.PLACE_RATE]):
            point, rows, k = under(ring, place)
            np.add.at(at[j, 0], np.arange(k, k + 8) % size, rows[0])
            np.add.at(at[j, 1], np.arange(k, k + 8) % size, rows[1])
            tangents[j] = point.cos, point.sin
        ring.q[:] -= ahead * ring.u
        frames.append((at[:, 0], at[:, 1], tangents, np.stack([-tangents[:, 1], tangents[:, 0]], 1)))
    (along, across, t, n), (mid_along, mid_across, mid_t, mid_n) = frames
    unknowns = size + 16 + 8  # speeds of ring and elements, normal impulses
    system, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    by_friction, slip = np.zeros((unknowns, 8)), np.zeros((8, unknowns))
    system[:size, :size], right[:size] = mass, mass @ u + dt * force
    for j in range(8):
        own, normal = slice(size + 2 * j, size + 2 * j + 2), size + 16 + j
        system[:size, normal], by_friction[:size, j] = across[j], along[j]
        system[own, own], right[own] = MASS * np.eye(2), MASS * old[j]
        system[own, normal], by_friction[own, j] = -n[j], -t[j]
        system[normal, own], system[normal, :size] = mid_n[j], -mid_across[j]
        slip[j, :size], slip[j, own] = mid_along[j], -mid_t[j]
    free, response = np.linalg.solve(system, right), np.linalg.solve(system, by_friction)
    g, coupling = slip @ free, slip @ response
    sign = np.sign(free[-8:])  # of the normal impulses N, which friction does not change
    normal, by_impulse = sign * free[-8:], sign[:, None] * response[-8:]
    # P = p - mu N, p >= 0 with slip + s >= 0, and mu N - P >= 0 with s >= 0
    inverse = np.linalg.inv(np.eye(8) + mu * by_impulse)
    p0 = -inverse @ (mu * normal)
    bound = mu * by_impulse @ inverse - inverse
    matrix = np.block([[coupling @ inverse, np.eye(8)], [bound, np.zeros((8, 8))]])
    z = solve_lcp(matrix, np.concatenate([g + coupling @ p0, mu * (normal + by_impulse @ p0) - p0]))
    impulses = inverse @ z[:8] + p0
    assert 2 <= np.sum(abs(g + coupling @ impulses) < 1e-9) <= 6

    march(belt, state, work, 1, dt, tolerance=1e-9)
    tell("impulses of friction by Lemke's algorithm [N s]", state.elements[:, f.RING_IMPULSE], impulses)
    # within the tolerance of the laws, 1e-9 m/s of 10 g
    np.testing.assert_allclose(state.elements[:, f.RING_IMPULSE], impulses, rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        state.elements[:, fields.RING_SLIP], g + coupling @ impulses, rtol=0, atol=1e-8
    )
