"""Rings on the saddles of the spatial pushbelt: friction along the belt, and the ring held from both sides."""

import numpy as np
import pytest

from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.chain import saddle_forces
from cvt_hpc.models.spatial_pushbelt.transient import _prepare, advance
from support import spatial_chains as chains

STEP = 1e-5  # [s]


def friction(belt, state, work, fields):
    """Force against the ring's slip (nodes,), its slope, and what it does to elements and rings (nodes, 8)."""
    state.elements.data[:] = in_lanes(fields).data
    work.iterate.data[:] = 0.0
    for _ in range(2):  # so that duals are those of these slips
        work.iterate.data[:, spatial_fields.RESIDUAL : spatial_fields.RESIDUAL + 8] = 0.0
        saddle_forces(belt, state.elements, work.step, work.iterate)
    iterate = of_lanes(work.iterate)
    own = iterate[:, spatial_fields.RESIDUAL : spatial_fields.RESIDUAL + 8].copy()
    return (
        of_lanes(state.elements)[:, spatial_fields.RING_FRICTION].copy(),
        iterate[:, spatial_fields.RING_SLOPE].copy(),
        own,
    )


def test_friction_of_the_rings_has_its_law_direction_and_slope():
    belt, state, work, rng = chains.shaken(6)
    _prepare(belt, state, work, STEP)
    f = of_lanes(state.elements).copy()
    f[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 8] = rng.normal(0.0, 0.01, (chains.SHAKEN, 8))
    f[:5, spatial_fields.SADDLE] = 0.0  # rings that are off
    # one slip for both packages: of the material over the mean of what their lines' places do along them
    place, t = chains.lines(belt, f)
    x, arm = (
        f[:, spatial_fields.SPEED : spatial_fields.SPEED + 8]
        + f[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 8],
        place - f[:, :3],
    )
    slip = x[:, 6] - 0.5 * np.sum(t * (x[:, :3] + np.cross(x[:, 3:6], arm)), axis=(0, 2))
    # from rings that stick to rings that slide
    share = rng.permutation(np.linspace(-4.0, 4.0, chains.SHAKEN))
    f[:, spatial_fields.V] += share * belt.ring_friction_speed - slip
    force, slope, own = friction(belt, state, work, f)
    most = belt.ring_friction * f[:, spatial_fields.SADDLE]
    assert not force[:5].any()
    assert force == pytest.approx(most * np.tanh(share), abs=1e-12 * most.max())
    assert own[:, 6].tolist() == (-force).tolist() and not own[:, 7].any()
    assert own[:, :3] == pytest.approx(force[:, None] * t.mean(axis=0), abs=1e-12 * most.max())
    turn = np.cross(arm, t).mean(axis=0)
    assert own[:, 3:6] == pytest.approx(force[:, None] * turn, abs=1e-12 * np.abs(turn).max() * most.max())
    # the slope by differences in the ring's own speed, and in the others by what they do to the slip
    for column in range(7):
        d = 1e-6 * np.eye(8)[column] / (100.0 if 3 <= column < 6 else 1.0)
        forces = []
        for sign in (1.0, -1.0):
            g = f.copy()
            g[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 8] += sign * d
            forces.append(friction(belt, state, work, g)[0])
        by = 1.0 if column == 6 else -np.column_stack([t.mean(axis=0), turn])[:, column]
        expected = slope * by
        assert (forces[0] - forces[1]) / (2.0 * d[column]) == pytest.approx(
            expected, abs=1e-7 * np.abs(slope).max()
        )


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["on the saddle", "on the pillar"])
def test_rings_are_held_by_the_saddle_and_by_the_pillar(side, tell):
    """An element out of a taut strand is pulled back to either side, and the rings' normal force is the same."""
    nodes, pitch, pull, rise = 16, 0.02, 1000.0, 1e-4
    belt = chains.belt(pitch=pitch, thickness=0.9 * pitch, contact_stiffness=0.0, ring_friction=0.06)
    # a straight line, closed upon itself, far from the pulleys
    fields = np.zeros((nodes, spatial_fields.STATE_FIELDS))
    fields[:, 0], fields[:, 1] = pitch * np.arange(nodes), 1.0
    fields[:, 3], fields[:, 7] = 1.0, -1.0
    fields[:, spatial_fields.LENGTH] = pitch / (1.0 + pull / belt.ring_stiffness)
    fields[-1, spatial_fields.LENGTH] *= nodes - 1
    fields[5] += side * rise * (np.arange(spatial_fields.STATE_FIELDS) == 1) * -1.0  # outwards is -z
    fields[5, spatial_fields.V] = 1e-6  # the ring slips a little
    state, work = chains.state(fields), b.workspace(belt, nodes)
    newton = b.NEWTON._replace(tolerance=1e-12)
    assert advance(belt, newton, state, work, np.zeros((2, spatial_fields.INPUTS)), 1, 1e-6) == 0
    f = of_lanes(state.elements).copy()
    # ring and element go together across the strand, so that the ring hands over the element's share of the pull
    back = f[[4, 5], spatial_fields.TENSION].sum() * rise / np.hypot(pitch, rise)
    assert back > 9.0
    outward = -side * back / (belt.mass + belt.ring_mass)
    assert -f[5, spatial_fields.SPEED + 1] / 1e-6 == pytest.approx(outward, rel=1e-6)
    assert f[5, spatial_fields.SADDLE] == pytest.approx(belt.mass * abs(outward), rel=1e-6)
    tell("normal force of rings at an element [N]", f[5, spatial_fields.SADDLE], belt.mass * abs(outward))
    # which friction of the next step has
    assert advance(belt, newton, state, work, np.zeros((2, spatial_fields.INPUTS)), 1, 1e-6) == 0
    g = of_lanes(state.elements)
    limit = 0.06 * f[5, spatial_fields.SADDLE]
    assert g[5, spatial_fields.RING_FRICTION] == pytest.approx(
        limit * np.tanh(g[5, spatial_fields.RING_SLIP] / belt.ring_friction_speed), rel=1e-9
    )
    assert g[5, spatial_fields.RING_FRICTION] != 0.0
