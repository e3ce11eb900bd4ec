"""The free chain of the spatial pushbelt: a spinning ring, lateral vibration, buckling and an offset strand."""

from functools import cache, partial

import numpy as np
import pytest
from scipy.linalg import eigh

from cvt_hpc.models.pushbelt import fields as pushbelt_fields
from cvt_hpc.models.pushbelt.belt import of_lanes
from cvt_hpc.models.pushbelt.stepping import correct, solve_bordered
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.transient import (
    _accept,
    _assemble,
    _evaluate,
    _prepare,
    advance,
)
from support import spatial_chains as chains
from support.spatial_chains import EQUATIONS

NODES, RADIUS, SPIN = 216, 0.1082, 250.0  # [m], [rad/s]
STEP = 1e-5  # [s]


ring = partial(chains.free_ring, NODES, RADIUS, SPIN)


def marched(constants, fields, steps, dt):
    """Fields after so many steps, and counters."""
    state = chains.state(fields)
    assert (
        advance(
            constants,
            b.NEWTON,
            state,
            b.workspace(constants, NODES),
            np.zeros((2, spatial_fields.INPUTS)),
            steps,
            dt,
        )
        == 0
    )
    return of_lanes(state.elements).copy(), state.counters


def test_a_free_ring_spins_on():
    constants, tension, fields = ring()
    energy, momentum, moment = chains.energy_and_momentum(constants, fields)
    left = {}
    for dt in (STEP, 0.5 * STEP):
        found, counters = marched(constants, fields, round(0.02 / dt), dt)
        assert counters[pushbelt_fields.FAILED_STEPS] == 0
        # T = m' v^2, on a polygon m omega^2 R / (2 sin(pi / n)); the step's own error is 1.6e-6
        assert found[:, spatial_fields.TENSION] == pytest.approx(tension, rel=1e-5)
        assert np.hypot(found[:, 0], found[:, 1]) == pytest.approx(RADIUS, abs=1e-9)
        assert np.abs(found[:, 2]).max() < 1e-18
        energy_now, momentum_now, moment_now = chains.energy_and_momentum(constants, found)
        assert momentum_now == pytest.approx(momentum, abs=1e-12)
        assert moment_now == pytest.approx(moment, rel=1e-8, abs=1e-12)
        left[dt] = energy_now / energy - 1.0
    # the energy's error falls with the step
    assert abs(left[STEP]) < 2e-6
    assert abs(left[0.5 * STEP]) < 0.6 * abs(left[STEP])


def test_a_ring_that_moves_out_of_its_plane_keeps_its_energy_and_momentum():
    constants, _, fields = ring(lateral=0.2)
    energy, momentum, moment = chains.energy_and_momentum(constants, fields)
    found, _ = marched(constants, fields, 2000, STEP)
    energy_now, momentum_now, moment_now = chains.energy_and_momentum(constants, found)
    assert np.abs(found[:, 2]).max() > 1e-5
    assert momentum_now == pytest.approx(momentum, abs=1e-12)
    assert moment_now[2] == pytest.approx(moment[2], rel=1e-8)
    assert energy_now == pytest.approx(energy, rel=4e-6)


def test_no_constraint_drifts(tell):
    # Schindler et al. 2008, sec. 3, corrects drifts after each step; here none is left after 2000 of them
    constants, _, fields = ring(lateral=0.2)
    found, _ = marched(constants, fields, 2000, STEP)
    x, o = found[:, spatial_fields.HEADING :][:, :3], found[:, spatial_fields.OUTWARD :][:, :3]
    axes = np.stack([x, o], 1)
    tell("products of elements' axes", axes @ axes.transpose(0, 2, 1), np.tile(np.eye(2), (NODES, 1, 1)))
    assert axes @ axes.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(2), (NODES, 1, 1)), abs=1e-14)
    # rings lie on their saddles: of all their material none is lost along the line through the elements
    content = fields[:, spatial_fields.LENGTH].sum()
    tell("content of the rings after 2000 steps [m]", found[:, spatial_fields.LENGTH].sum(), content)
    assert found[:, spatial_fields.LENGTH].sum() == pytest.approx(content, rel=1e-14)
    assert np.abs(found[:, spatial_fields.LENGTH] - fields[:, spatial_fields.LENGTH]).max() > 1e-9


def test_a_ring_at_rest_falls_freely(tell):
    # by g t (t + dt) / 2 after t, with the speed g t
    constants, _, fields = chains.free_ring(NODES, RADIUS, 0.0)
    constants, state, time = constants._replace(gravity=9.81), chains.state(fields), 300 * STEP
    inputs = np.zeros((2, spatial_fields.INPUTS))
    assert advance(constants, b.NEWTON, state, b.workspace(constants, NODES), inputs, 300, STEP) == 0
    found, kinetic = of_lanes(state.elements), 0.5 * (9.81 * time) ** 2
    kinetic *= NODES * (constants.mass + constants.ring_mass)
    assert fields[:, 1] - found[:, 1] == pytest.approx(0.5 * 9.81 * time * (time + STEP), rel=1e-9)
    tell("fall of a spatial belt [m]", fields[:, 1] - found[:, 1], 0.5 * 9.81 * time * (time + STEP))
    assert np.abs(found[:, spatial_fields.TENSION]).max() < 1e-5
    assert state.totals[pushbelt_fields.GRAVITY_WORK] == pytest.approx(kinetic, rel=1e-9)


def test_free_elements_turn_as_rigid_bodies(tell):
    # nothing acts on them, so that R J R' omega of each stays; speeds are half a step early, of first order
    nodes = 16
    constants = chains.belt(
        pitch=0.02,
        thickness=1.5e-3,
        ring_mass=1e-12,
        ring_stiffness=1e-9,
        contact_stiffness=0.0,
        ring_shear=0.0,
    )
    rng = np.random.default_rng(4)
    fields = chains.spinning_ring(nodes, 0.02 * nodes / (2.0 * np.pi), 0.0)
    fields[:, spatial_fields.LENGTH] = 0.02
    fields[:, spatial_fields.OMEGA : spatial_fields.OMEGA + 3] = rng.normal(0.0, 200.0, (nodes, 3))

    def spin(f):
        x, o = f[:, 3:6], f[:, 6:9]
        omega, parts = (
            f[:, spatial_fields.OMEGA : spatial_fields.OMEGA + 3],
            zip((x, o, np.cross(o, x)), inertias, strict=True),
        )
        return sum(k * d * np.sum(d * omega, 1)[:, None] for d, k in parts)

    inertias = constants.roll_inertia, constants.yaw_inertia, constants.pitch_inertia
    size, errors = np.linalg.norm(spin(fields), axis=1), []
    for steps, dt in ((1000, STEP), (2000, 0.5 * STEP)):
        state, work = chains.state(fields), b.workspace(constants, nodes)
        assert advance(constants, b.NEWTON, state, work, np.zeros((2, spatial_fields.INPUTS)), steps, dt) == 0
        found = of_lanes(state.elements)
        assert np.abs(np.sum(found[:, 3:6] * found[:, 6:9], 1)).max() < 1e-15
        errors.append((np.linalg.norm(spin(found) - spin(fields), axis=1) / size).max())
    tell("change of the angular momentum of free elements over it", errors[0])
    tell("change of the angular momentum with half the step over that with the step", errors[1] / errors[0])
    assert errors[0] < 5e-3
    assert errors[1] < 0.6 * errors[0]


SEGMENTS, LENGTH_OF_STRAND = 100, 0.15411
PER_LENGTH = 1.4639  # [kg/m]


def strand(tension, **given):
    """A straight strand of elements along y between its two ends; three more beside these fill the lanes."""
    h = LENGTH_OF_STRAND / SEGMENTS
    nodes = 104
    constants = chains.belt(
        pitch=h,
        thickness=0.5 * h,
        mass=(PER_LENGTH - 0.25) * h,
        ring_mass=0.25 * h,
        **{"ring_rotary_inertia": 1e-9} | given,
    )
    fields = np.zeros((nodes, spatial_fields.STATE_FIELDS))
    fields[:, 0], fields[:, 1] = h * np.arange(nodes), 1.0  # far from the pulleys
    fields[:, 3], fields[:, 7] = 1.0, -1.0
    fields[:, spatial_fields.LENGTH] = h / (1.0 + tension / constants.ring_stiffness)
    return constants, fields


def held_steps(constants, fields, steps, seen, held=(0, 1, 3, 4, 5, 6)):
    """What `seen` reads after each step of the model, in which all but the strand is held, and unknowns of that.

    A strand in compression would buckle in its plane at once, where the rings have no stiffness here.
    """
    state, work = chains.state(fields), b.workspace(constants, len(fields))
    rows = len(work.blocks.data)
    inputs = np.zeros(spatial_fields.INPUTS)
    readings = []
    for _ in range(steps):
        _prepare(constants, state, work, STEP)
        for _ in range(2):
            _evaluate(constants, state, work, 0.0, STEP)
            _assemble(constants, state, work, STEP)
            work.blocks.data[:, 9 * np.array(held)] += 1e15
            for element in (0, *range(SEGMENTS, len(fields))):
                work.blocks.data[element % rows, : 9 * spatial_fields.SIZE : 9, element // rows] += 1e15
            solve_bordered(EQUATIONS[1], constants, state, work, b.NEWTON.weights, STEP)
            correct(state, work, b.NEWTON.weights, spatial_fields.CHANGE, 1.0)
        _evaluate(constants, state, work, 0.0, STEP)
        _accept(constants, state, work, inputs, STEP)
        readings.append(seen(of_lanes(state.elements)))
    return np.array(readings)


def clamped_mode(tension, bending):
    """(2 pi f)^2 and amplitudes of position and slope of the first mode of the clamped strand."""
    h, shear, mass = LENGTH_OF_STRAND / SEGMENTS, 2.4e6, PER_LENGTH * LENGTH_OF_STRAND / SEGMENTS
    size = SEGMENTS + 1
    stiffness, inertia = np.zeros((2 * size, 2 * size)), np.repeat([mass, 1e-9], size)
    for i in range(SEGMENTS):
        places = np.ix_([i, i + 1, size + i, size + i + 1], [i, i + 1, size + i, size + i + 1])
        for k, w in (
            (tension / h, [-1.0, 1.0, 0.0, 0.0]),
            (shear * h, [-1.0 / h, 1.0 / h, -0.5, -0.5]),
            (bending / h, [0.0, 0.0, -1.0, 1.0]),
        ):
            stiffness[places] += k * np.outer(w, w)
    free = np.r_[1:SEGMENTS, size + 1 : size + SEGMENTS]
    values, vectors = eigh(stiffness[np.ix_(free, free)], np.diag(inertia[free]))
    mode = np.zeros(2 * size)
    mode[free] = vectors[:, 0] / np.abs(vectors[: SEGMENTS - 1, 0]).max()
    return values[0], mode[:size], mode[size:]


@cache
def clamped_motion(tension, bending=47.6):
    """Amplitudes of the first mode of the clamped strand, step by step."""
    constants, fields = strand(tension, ring_bending=bending)
    _, shape, slope = clamped_mode(tension, bending)
    fields[: SEGMENTS + 1, 2], fields[: SEGMENTS + 1, spatial_fields.SLOPE] = 1e-5 * shape, 1e-5 * slope
    return held_steps(constants, fields, 400, lambda f: shape @ f[: SEGMENTS + 1, 2]) / (shape @ shape)


def frequency_squared(amplitudes, stride, dt=STEP):
    """(2 pi f)^2 of amplitudes of one mode, of either sign, by q+ + q- = 2 q cos(omega dt) of every so many."""
    middle, outer = amplitudes[stride:-stride], amplitudes[2 * stride :] + amplitudes[: -2 * stride]
    cosine = 0.5 * (middle @ outer) / (middle @ middle)
    angle = np.arccos(cosine) ** 2 if cosine < 1.0 else -(np.arccosh(cosine) ** 2)
    return angle / (stride * dt) ** 2


def test_frequency_of_a_clamped_strand():
    squared, _, _ = clamped_mode(4000.0, 47.6)
    exact = np.sqrt(squared) / (2.0 * np.pi)
    assert exact == pytest.approx(858.57, rel=1e-3)  # of the continuous strand
    amplitudes = clamped_motion(4000.0)
    # the step's own errors are -(2 pi f dt)^2 / 12 = -2.4e-4 of bending, half of it and positive of tension
    found = np.sqrt(frequency_squared(amplitudes, 10)) / (2.0 * np.pi)
    assert found == pytest.approx(exact, rel=3e-4)
    # undamped: the same motion in the first and in the last of 3.4 periods
    phase = 2.0 * np.pi * found * STEP * np.arange(1, 401)
    sizes = []
    for part in (slice(0, 117), slice(-117, None)):
        basis = np.stack([np.cos(phase[part]), np.sin(phase[part])], 1)
        sizes.append(np.linalg.norm(np.linalg.lstsq(basis, amplitudes[part], rcond=None)[0]))
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-4)


def test_a_pressed_strand_buckles_at_its_load():
    # clamped: 4 pi^2 EI / l^2, less shear; the square of the frequency falls through zero there
    wave = 2.0 * np.pi / LENGTH_OF_STRAND
    load = 0.5 * wave**2 / (1.0 + 0.5 * wave**2 / 2.4e6)
    assert load == pytest.approx(4 * 208.0, rel=2e-3)
    below, above = (frequency_squared(clamped_motion(-share * load, 0.5), 60) for share in (0.95, 1.05))
    assert below > 0.0 > above
    assert 0.95 + 0.1 * below / (below - above) == pytest.approx(1.0, abs=0.01)


def test_a_pressed_chain_buckles_by_its_closed_edges():
    """Elements that turn with rings that hardly bend: EI = 2 (c / 2) b^2 h of the edges holds the strand."""
    h, contact, yaw, soft = LENGTH_OF_STRAND / SEGMENTS, 3.2e6, 1e5, 1e-3  # [m], [N/m], [N m/rad], [N m^2]
    bending = contact * 10e-3**2 * h + soft
    # An element pushes the next one along that one's direction, not along the strand: as the rings' shear, which
    # the yaw springs are in series with, that resists by the load itself: P = EI k^2 / (1 + EI k^2 / (GA + P)), of
    # which the last P may be EI k^2.
    load = bending * (2.0 * np.pi / LENGTH_OF_STRAND) ** 2
    load /= 1.0 + load / (1.0 / (1.0 / 2.4e6 + h / yaw) + load)
    _, shape, slope = clamped_mode(0.0, bending)
    # heads lie in the middle of the edges, so that they take half of the push, and no moment
    heads = {"pitch_depth": 1.5e-3, "head_height": -1.5e-3, "head_width": 0.0}
    found = []
    for share in (0.95, 1.05):
        constants, fields = strand(
            0.0, ring_bending=soft, yaw_stiffness=yaw, contact_stiffness=contact, **heads
        )
        constants = constants._replace(thickness=h + 0.5 * share * load / contact)
        fields[: SEGMENTS + 1, 2] = 1e-5 * shape
        for field in (spatial_fields.SLOPE, spatial_fields.HEADING + 2):
            fields[: SEGMENTS + 1, field] = 1e-5 * slope
        amplitudes = held_steps(
            constants, fields, 400, lambda f: shape @ f[: SEGMENTS + 1, 2], held=(0, 1, 3, 5, 6)
        )
        found.append(frequency_squared(amplitudes, 60))
    below, above = found
    assert below > 0.0 > above
    # points that meet half a thickness off the saddles' line take P t / 2 h off EI, 0.2 %
    assert 0.95 + 0.1 * below / (below - above) == pytest.approx(1.0, abs=0.01)


def lateral_wave(half_wave, tension, dt, damping=0.0):
    """Amplitudes of eight half waves [m] around a ring that spins as fast as that tension asks, each 10 steps.

    Half a wave has 50 elements, which a damping [N s/m^2] brakes.
    """
    nodes, circumference = 400, 8 * half_wave
    h, radius = circumference / nodes, circumference / (2.0 * np.pi)
    mass = PER_LENGTH * h
    spin = np.sqrt(tension / PER_LENGTH) / radius
    constants = chains.belt(
        pitch=h, thickness=0.5 * h, mass=0.8 * mass, ring_mass=0.2 * mass, ring_rotary_inertia=1e-12
    )
    constants = constants._replace(lateral_damping=damping * h)
    fields = chains.spinning_ring(nodes, radius, spin)
    chord = 2.0 * radius * np.sin(np.pi / nodes)
    fields[:, spatial_fields.LENGTH] = chord / (
        1.0 + mass * spin**2 * radius / (2.0 * np.sin(np.pi / nodes)) / 6.0e6
    )
    place = h * np.arange(nodes)
    wave = np.pi / half_wave
    shape = np.sin(wave * place)
    fields[:, 2] = 1e-5 * shape
    fields[:, spatial_fields.SLOPE] = 1e-5 * wave / (1.0 + 47.6 * wave**2 / 2.4e6) * np.cos(wave * place)
    state, work = chains.state(fields), b.workspace(constants, nodes)
    amplitudes = []
    for _ in range(40):
        assert advance(constants, b.NEWTON, state, work, np.zeros((2, spatial_fields.INPUTS)), 10, dt) == 0
        amplitudes.append(shape @ of_lanes(state.elements)[:, 2])
    return np.array(amplitudes)


@pytest.mark.parametrize(("mode", "golden"), [(1, 412.10), (2, 1522.50), (3, 3314.13)])
def test_frequency_of_a_pinned_strand(mode, golden):
    # half a wave of a large ring is a pinned strand: f = 1 / (2 l) sqrt((T + EI_s (pi / l)^2) / m')
    wave = mode * np.pi / LENGTH_OF_STRAND
    stiff = 47.6 / (1.0 + 47.6 * wave**2 / 2.4e6)
    exact = wave / (2.0 * np.pi) * np.sqrt((4000.0 + stiff * wave**2) / PER_LENGTH)
    assert exact == pytest.approx(golden, rel=1e-4)
    # The step errs by -(2 pi f dt)^2 / 12: by 6e-5 of the first mode, 5e-5 and 4e-5 of the others in steps that
    # fall with the square of the mode. So few elements err by 1e-4. Rotary inertia of the rings, which the formula
    # has not, would lower the third mode by 2e-3.
    dt = STEP / mode**2
    squared = frequency_squared(lateral_wave(LENGTH_OF_STRAND / mode, 4000.0, dt), 1, 10.0 * dt)
    assert np.sqrt(squared) / (2.0 * np.pi) == pytest.approx(exact, rel=3e-4)


def test_a_strand_decays_by_the_lateral_damping(tell):
    # q+ + exp(-2 a dt) q- = 2 exp(-a dt) cos(omega dt) q, with a = d / (2 m')
    q = lateral_wave(LENGTH_OF_STRAND, 4000.0, STEP, damping=200.0)
    _, fall = np.linalg.lstsq(np.stack([q[1:-1], -q[:-2]], 1), q[2:])[0]
    rate = -0.5 * np.log(fall) / (10.0 * STEP)
    tell("rate at which a strand decays out of the plane [1/s]", rate, 200.0 / (2.0 * PER_LENGTH))
    assert rate == pytest.approx(200.0 / (2.0 * PER_LENGTH), rel=1e-2)


@pytest.mark.parametrize(("tension", "force"), [(0.0, 78.025), (4000.0, 93.562)])
def test_lateral_force_of_an_offset_strand(tension, force):
    # V = T e / l / (1 - 2 tanh(kl/2) / (kl)), k = sqrt(T / EI); shear makes it softer by 12 EI / (kGA l^2), 1e-3
    constants, fields = strand(tension, ring_shear=2.4e7, lateral_damping=20.0, yaw_damping=0.05)
    s = np.arange(SEGMENTS + 1) / SEGMENTS
    fields[: SEGMENTS + 1, 2] = 5e-4 * s * s * (3.0 - 2.0 * s)
    fields[: SEGMENTS + 1, spatial_fields.SLOPE] = 5e-4 * 6.0 * s * (1.0 - s) / LENGTH_OF_STRAND
    fields[SEGMENTS + 1 :, 2] = 5e-4

    def across(f):
        place = slice(40, 60)
        rise = (f[41:61, 2] - f[place, 2]) / constants.pitch
        shear = rise - 0.5 * (f[41:61, spatial_fields.SLOPE] + f[place, spatial_fields.SLOPE])
        return np.mean(constants.ring_shear * shear + f[place, spatial_fields.TENSION] * rise)

    readings = held_steps(constants, fields, 300, across)
    assert readings[-1] == pytest.approx(readings[-50], rel=1e-3)
    assert readings[-1] == pytest.approx(force, rel=0.01)
