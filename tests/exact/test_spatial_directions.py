"""Directions of the spatial pushbelt's laws: rates of all gaps, forces without resultant, the linear system."""

import numpy as np
import pytest

from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.pushbelt.ring_bending import bend_rings
from cvt_hpc.models.spatial_pushbelt import fields
from cvt_hpc.models.spatial_pushbelt.assembly import bending_forces, predict_bending
from cvt_hpc.models.spatial_pushbelt.transient import _assemble, _evaluate, _prepare
from support import spatial_chains as chains

STEP = 1e-5
RIGHT = fields.RIGHT


def rate(own, ahead, first, last, x):
    """Rate of a law between neighbours by directions at this element and at the next one, by fields of `step`."""
    return np.sum(own * x[:, first], 1) + np.sum(ahead * np.roll(x, -1, 0)[:, last], 1)


U, W = slice(0, 3), slice(3, 6)


def directions(step, f, x):
    """Rates along x (nodes, 8) of all gaps and strains, by the directions that forces have."""

    def of(first):
        return step[:, first : first + 3]

    xj = np.roll(f[:, 3:6], -1, 0)
    found = {}
    # at mid step
    for p in range(4):
        turning = rate(of(fields.PUSH_LEVER_I + 3 * p), of(fields.PUSH_LEVER_J + 3 * p), W, W, x)
        found[fields.PUSH_MEAN + p] = 0.5 * (rate(-xj, xj, U, U, x) + turning)
    n = of(fields.PIN_NORMAL)
    turning = rate(of(fields.PIN_LEVER_I), -of(fields.PIN_LEVER_J), W, W, x)
    found[fields.PIN_MEAN] = 0.5 * (rate(-n, n, U, U, x) - turning)
    tension = rate(of(fields.TENSION_I), -of(fields.TENSION_J), U, U, x)
    tension += (
        rate(of(fields.TENSION_I + 3), -of(fields.TENSION_J + 3), W, W, x) + x[:, 6] - np.roll(x[:, 6], -1)
    )
    found[fields.START_TENSION] = tension
    ci, cj = of(fields.CHORD_I), of(fields.CHORD_J)
    found[fields.START_MOMENT_I] = rate(-ci, ci, U, U, x) + np.sum(of(fields.TURN_I) * x[:, W], 1)
    found[fields.START_MOMENT_J] = rate(-cj, cj, U, U, x) + np.sum(
        of(fields.TURN_J) * np.roll(x, -1, 0)[:, W], 1
    )
    return found


def test_rates_of_all_gaps_and_strains(tell):
    # what forces take as rates along a direction, against differences of gaps at q + X dt
    belt, state, work, rng = chains.shaken(1, angle_damping=0.0)
    f, x = (
        of_lanes(state.elements).copy(),
        rng.normal(0.0, 1.0, (chains.SHAKEN, 8)) * [1, 1, 1, 100, 100, 100, 1, 0],
    )
    axial = np.cross(f[:, 6:9], f[:, 3:6])
    place, _ = chains.lines(belt, f)
    lengths = np.linalg.norm(np.roll(place, -1, axis=1) - place, axis=2).mean(axis=0)
    f[:, fields.LENGTH] = lengths  # the direction of the tension is its rate at a strain of zero
    state.leans[:] = 0.0
    small, measured, there = 3e-9, {}, {}
    for sign in (0.0, -1.0, 1.0):
        g = f.copy()
        g[:, fields.SPEED : fields.SPEED + 8] = sign * small * x
        state.elements.data[:] = in_lanes(g).data
        _prepare(belt, state, work, 1.0)
        measured[sign] = of_lanes(work.step).copy()
        slip = x[:, 6] - np.sum(measured[0.0][:, fields.RING_LINE : fields.RING_LINE + 6] * x[:, :6], 1)
        g = f.copy()
        g[:, fields.SPEED : fields.SPEED + 8] = 0.0
        g[:, U] += sign * small * x[:, U]
        g[:, fields.LENGTH] += sign * small * (slip - np.roll(slip, -1))
        for first in (fields.HEADING, fields.OUTWARD):
            g[:, first : first + 3] += sign * small * np.cross(x[:, W], f[:, first : first + 3])
        state.elements.data[:] = in_lanes(g).data
        _prepare(belt, state, work, 1.0)
        there[sign] = of_lanes(work.step).copy()
    step = measured[0.0]
    difference = (measured[1.0] - measured[-1.0]) / (2.0 * small)
    # tensions, moments and the radii of flanks are those of the positions at the start
    moved = (there[1.0] - there[-1.0]) / (2.0 * small)
    moments = [fields.START_MOMENT_I, fields.START_MOMENT_J]
    at_start = [fields.START_TENSION, *moments]
    difference[:, at_start] = moved[:, at_start]
    difference[:, moments] *= 2.0 / belt.angle_stiffness
    difference[:, fields.START_TENSION] *= -lengths / belt.ring_stiffness
    for field, expected in directions(step, f, x).items():
        scale = np.abs(expected).max()
        tell("rates of gaps, slips and strains by projections", difference[:, field], expected)
        assert difference[:, field] == pytest.approx(expected, abs=2e-7 * scale), field
    driven = f[:, 0] > 0.5 * belt.centre_distance
    axis = np.where(driven[:, None], belt.axes[1], belt.axes[0])
    for p in range(4):
        side, reach = (-1.0, -1.0, 1.0, 1.0)[p], (-1.0, 1.0)[p % 2] * belt.flank_reach
        width = belt.half_width + reach * belt.sine / belt.cosine
        lever = (reach - belt.pitch_depth) * f[:, 6:9] + side * width * axial
        n = belt.sine * step[:, fields.RADIAL + 3 * p : fields.RADIAL + 3 * p + 3] - side * belt.cosine * axis
        for found, direction in ((moved, n), (difference, -side * belt.cosine * axis)):
            expected = np.sum(direction * (x[:, U] + np.cross(x[:, W], lever)), 1)
            scale = np.abs(expected).max()
            assert found[:, fields.FLANK_GAP + p] == pytest.approx(expected, abs=2e-7 * scale)


def moved(belt, state, work, f, x):
    """Fields of f after a motion x (nodes, 8), turned as the steps turn them."""
    g = f.copy()
    g[:, fields.SPEED : fields.SPEED + 8] = x
    state.elements.data[:] = in_lanes(g).data
    _prepare(belt, state, work, 1.0)
    g[:, : fields.SLOPE] = of_lanes(work.step)[:, : fields.PREDICTED_OUTWARD + 3]
    g[:, fields.SLOPE] += x[:, 7]
    return g


def test_rates_of_lateral_strains_yaw_and_ring_slip():
    # laws whose values at q_k enter a step, against differences between q - X dt and q + X dt
    belt, state, work, rng = chains.shaken(4, yaw_damping=0.0)
    f, x = (
        of_lanes(state.elements).copy(),
        rng.normal(0.0, 1.0, (chains.SHAKEN, 8)) * [1, 1, 1, 100, 100, 100, 1, 100],
    )
    small, found, places = 3e-9, [], []
    for sign in (1.0, -1.0):
        g = moved(belt, state, work, f, sign * small * x)
        places.append(chains.lines(belt, g)[0])
        state.elements.data[:] = in_lanes(g).data
        _prepare(belt, state, work, 1.0)
        found.append(of_lanes(work.step).copy())
    difference = (found[0] - found[1]) / (2.0 * small)
    state.elements.data[:] = in_lanes(f).data
    _prepare(belt, state, work, STEP)
    step = of_lanes(work.step)
    rise, turning = np.roll(x[:, 2], -1) - x[:, 2], np.roll(x[:, 7], -1)
    along = step[:, fields.RING_LINE : fields.RING_LINE + 6]
    expected = {
        fields.SHEAR: rise / belt.pitch - 0.5 * (x[:, 7] + turning),
        fields.BEND: turning - x[:, 7],
        fields.PREDICTED_YAW: np.sum(step[:, fields.YAW : fields.YAW + 3] * x[:, W], 1) - x[:, 7],
    }
    difference[:, fields.PREDICTED_YAW] /= belt.yaw_stiffness
    for field, rates in expected.items():
        assert difference[:, field] == pytest.approx(rates, abs=2e-7 * np.abs(rates).max()), field
    # the ring slips by what its lines' places move along them at an element
    _, t = chains.lines(belt, f)
    rates = 0.5 * np.sum(t * (places[0] - places[1]), axis=(0, 2)) / (2.0 * small)
    assert np.sum(along * x[:, :6], 1) == pytest.approx(rates, abs=2e-7 * np.abs(rates).max())


def test_rings_bend_in_the_plane_as_those_of_the_planar_belt():
    belt, state, work, _ = chains.shaken(6)
    belt, found = belt._replace(flank_kinetic=0.0, ring_friction=0.0), []
    for stiffness in (0.0, 0.5):
        belt = belt._replace(bending_stiffness=stiffness)
        _prepare(belt, state, work, STEP)
        _evaluate(belt, state, work, 0.0, STEP)
        found.append(of_lanes(work.iterate)[:, fields.RESIDUAL : fields.RESIDUAL + 8].copy())
    places = in_lanes(of_lanes(state.elements)[:, :2])
    forces, energy = np.zeros_like(places.data), np.zeros_like(places.data[:, 0])
    bend_rings(belt, state.pulleys, places.data, forces, energy, work.bent, STEP)
    places.data[:] = forces
    assert np.abs(forces).max() > 1.0 and energy.sum() > 0.0
    more = found[1] - found[0]
    assert more[:, :2] == pytest.approx(of_lanes(places), abs=1e-9 * np.abs(found[0]).max())
    assert np.abs(more[:, 2:]).max() < 1e-9 * np.abs(found[0]).max()
    assert of_lanes(state.elements)[:, fields.BENDING].sum() == pytest.approx(energy.sum())


INTERNAL = {
    "tension": {"ring_stiffness": 0.0},
    "pitch": {"angle_stiffness": 0.0, "angle_damping": 0.0},
    "faces": {"contact_stiffness": 0.0},
    "pins": {"pin_clearance": np.inf},
    "lateral bending": {"ring_bending": 0.0, "ring_shear": 0.0},
    "yaw": {"yaw_stiffness": 0.0, "yaw_damping": 0.0},
    "ring friction": {"ring_friction": 0.0},
}


@pytest.mark.parametrize("law", INTERNAL)
def test_internal_forces_have_no_resultant_and_no_moment(law):
    belt, state, work, rng = chains.shaken(2)
    f, forces = of_lanes(state.elements).copy(), 0.0
    f[:, fields.CHANGE : fields.CHANGE + 8] = rng.normal(0.0, 0.01, (chains.SHAKEN, 8))
    none = belt._replace(flank_stiffness=0.0, **{k: v for off in INTERNAL.values() for k, v in off.items()})
    alone = none._replace(**{k: getattr(belt, k) for k in INTERNAL[law]})
    for sign, constants in ((1.0, alone), (-1.0, none)):
        state.elements.data[:] = in_lanes(f).data
        _prepare(constants, state, work, STEP)
        forces = forces + sign * chains.evaluated(constants, state, work, STEP)[: 8 * chains.SHAKEN].reshape(
            chains.SHAKEN, 8
        )
    # Their power is none in a rigid motion, in which the rings' material goes along. Lateral bending takes a scalar
    # slope for the rings' direction: it has no moment about the axial direction, and about others on straight strands.
    about = [0.0, 0.0, 1.0] if law == "lateral bending" else rng.normal(0.0, 1.0, 3)
    motions = [(axis, np.zeros(3)) for axis in np.eye(3)] + [(np.zeros(3), about)]
    place, t = chains.lines(belt, f)
    for shift, spin in motions:
        x = np.zeros((chains.SHAKEN, 8))
        x[:, U], x[:, W] = shift + np.cross(spin, f[:, :3]), spin
        x[:, 6] = 0.5 * np.sum(t * (shift + np.cross(spin, place)), axis=(0, 2))
        x[:, 7] = np.cross(spin, f[:, 3:6])[:, 2]
        power, most = forces * x, np.abs(forces) * np.abs(x).max(axis=0)
        assert abs(power.sum()) <= 1e-12 * most.sum()
    assert np.abs(forces).max() > 0.01


def test_lateral_bending_of_a_straight_strand_has_no_moment():
    belt, state, work, rng = chains.shaken(5)
    f = of_lanes(state.elements).copy()
    f[:, :2], f[:, 3:6] = np.outer(np.arange(chains.SHAKEN), [belt.pitch, 0.0]), [1.0, 0.0, 0.0]
    f[:, fields.CHANGE : fields.CHANGE + 8] = rng.normal(0.0, 0.01, (chains.SHAKEN, 8))
    state.elements.data[:] = in_lanes(f).data
    predict_bending(belt, state.elements, work.step)
    work.iterate.data[:] = 0.0
    bending_forces(belt, state.elements, work.step, work.iterate, STEP)
    forces = of_lanes(work.iterate)
    # a turn about the direction across the strand, by which its slope grows as its ends move; the last pair closes it
    x = np.zeros((chains.SHAKEN, 8))
    x[:, 2], x[:, 7] = f[:, 0], 1.0
    own, ahead = (forces[:-1, k : k + 8] for k in (fields.PAIR_I, fields.PAIR_J))
    power = np.concatenate([own * x[:-1], ahead * x[1:]])
    assert abs(power.sum()) < 1e-12 * np.abs(power).sum()


def test_the_linear_system_is_the_slope_of_the_residuals():
    belt, state, work, rng = chains.shaken(3)
    _prepare(belt, state, work, STEP)
    f = of_lanes(state.elements).copy()
    f[:, fields.CHANGE : fields.CHANGE + 8] = rng.normal(0.0, 0.01, (chains.SHAKEN, 8))
    state.increments[:] = [0.3, *rng.normal(0.0, 1e-7, 6)]
    state.elements.data[:] = in_lanes(f).data
    chains.evaluated(belt, state, work, STEP)
    _assemble(belt, state, work, STEP)
    blocks, iterate = of_lanes(work.blocks), of_lanes(work.iterate)
    shapes, driven = of_lanes(work.shapes), of_lanes(state.elements)[:, fields.DRIVEN]
    size = 8 * chains.SHAKEN
    matrix = np.zeros((size + 7, size + 7))
    for i in range(chains.SHAKEN):
        j, at = (i + 1) % chains.SHAKEN, slice(8 * i, 8 * i + 8)
        matrix[at, at] += blocks[i, :64].reshape(8, 8).T
        link = blocks[i, 64:128].reshape(8, 8).T
        matrix[at, 8 * j : 8 * j + 8] += link
        matrix[8 * j : 8 * j + 8, at] += link.T
        matrix[at, size:] = blocks[i, RIGHT + 8 : RIGHT + 64].reshape(7, 8).T
        matrix[size, 8 * i : 8 * i + 6] = iterate[i, fields.TORQUE_ROW : fields.TORQUE_ROW + 6]
    weights = np.hstack([(1.0 - driven)[:, None] * shapes, driven[:, None] * shapes])  # (nodes, 6)
    matrix[size, size] = iterate[:, fields.TORQUE_OWN].sum() + belt.driven_inertia / STEP
    matrix[size, size + 1 :] = iterate[:, fields.TORQUE_OPENING] @ weights
    for k in range(6):
        row = weights[:, k, None] * iterate[:, fields.NORMAL_ROW : fields.NORMAL_ROW + 6]
        matrix[size + 1 + k, :size] = np.hstack([row, np.zeros((chains.SHAKEN, 2))]).ravel()
        matrix[size + 1 + k, size + 1 :] = (weights[:, k] * iterate[:, fields.NORMAL_YIELD]) @ weights
        matrix[size + 1 + k, size + 1 + k] += belt.modal_stiffness[k // 3, k % 3]
    kinds = {
        "speeds": np.concatenate([rng.normal(0.0, 1.0, size), np.zeros(7)]),
        "driven speed": np.eye(size + 7)[size] * 10.0,
        "openings": np.concatenate([np.zeros(size + 1), rng.normal(0.0, 1e-5, 6)]),
    }
    for what, direction in kinds.items():
        found = []
        for sign in (1.0, -1.0):
            g = f.copy()
            g[:, fields.CHANGE : fields.CHANGE + 8] += (
                sign * 1e-6 * direction[:size].reshape(chains.SHAKEN, 8)
            )
            increments = state.increments.copy()
            state.increments[:] += sign * 1e-6 * direction[size:]
            state.elements.data[:] = in_lanes(g).data
            found.append(chains.evaluated(belt, state, work, STEP))
            state.increments[:] = increments
        slope = -(found[0] - found[1]) / 2e-6
        expected = matrix @ direction
        scale = np.abs(expected).max()
        # few contacts change over between the two
        wrong = np.abs(slope - expected) > 1e-5 * scale
        assert wrong.sum() <= 0, (what, np.flatnonzero(wrong)[:20], slope[wrong][:20], expected[wrong][:20])
