"""A spatial pushbelt under its thrust and load, beside the common planar one."""

from functools import cache

import numpy as np

from cvt_hpc.job import build_job
from cvt_hpc.models.pushbelt import fields as pushbelt_fields
from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.transient import advance
from support import spatial_chains as chains
from support.pushbelts import SPEED, THRUST, given, start

NODES, STEP, TORQUE = 104, 1e-5, 60.0
LOAD = 1.35 * TORQUE
RAMP = 1500  # steps
OFFSET = 0.5e-3  # of the driven pulley along its axis [m]
# A belt of few elements between rigid sheaves, clamped and loaded within a quarter of a revolution
COARSE = {
    "elements": NODES,
    "band_high": 1000.0,
    "sheave_stiffness": np.inf,
    "rise_time": 0.01,
    "duration": 0.04,
}


def job(**values):
    """A job of a coarse belt under 60 N m, with other values."""
    short = {"most_refinements": 0, "longest_duration": values.get("duration", 0.04), "load": TORQUE}
    return build_job({"name": "spatial", "model": "spatial_pushbelt"}, "spatial", COARSE | short | values)


def constants(parameters):
    """Constants of the belt of a run, by their names."""
    return b.start(parameters)[0]._asdict()


def inputs(thrusts, loads, fields=spatial_fields.INPUTS, drift=0.0):
    """Inputs of a call: thrust and load at its start and end."""
    found = np.zeros((2, fields))
    found[:, pushbelt_fields.IN_SPEED] = SPEED
    found[:, pushbelt_fields.IN_DRIVEN_THRUST], found[:, pushbelt_fields.IN_LOAD] = thrusts, loads
    found[:, spatial_fields.IN_DRIVEN_DRIFT :] = drift
    return found


@cache
def _scene(**values):
    return scene(**values)


def kept_scene(**values):
    """As `scene`, which marches once for the same values; state and work space are the caller's own."""
    belt, state, _ = _scene(**values)
    own = {name: getattr(state, name).copy() for name in state._fields[1:]}
    state = state._replace(elements=in_lanes(of_lanes(state.elements)), **own)
    return belt, state, b.workspace(belt, len(of_lanes(state.elements)))


def scene(offset=OFFSET, modal=(), nodes=NODES, ramp=RAMP, **constants):
    """Constants, state and work space of a belt under its thrust and load, which come within two ramps of three."""
    planar, planar_state = start(given(nodes, transverse_damping=0.0, modal_stiffness=modal or ((), ())))
    belt, state = chains.beside_planar(planar, planar_state, **constants)
    work = b.workspace(belt, nodes)
    for thrusts, loads, drift, steps in (
        ((500.0, THRUST), (0.0, 0.0), offset / (ramp * STEP), ramp),
        ((THRUST, THRUST), (0.0, LOAD), 0.0, ramp),
        ((THRUST, THRUST), (LOAD, LOAD), 0.0, ramp),
    ):
        assert advance(belt, b.NEWTON, state, work, inputs(thrusts, loads, drift=drift), steps, STEP) == 0
    return belt, state, work


def stored(belt, state):
    """Kinetic energy of belt and driven pulley, and that of rings, flanks and sheaves [J]."""
    energy, _, _ = chains.energy_and_momentum(belt, of_lanes(state.elements))
    pressed = of_lanes(state.elements)[:, spatial_fields.FLANK : spatial_fields.FLANK + 4]
    energy += np.sum(pressed**2) / belt.flank_stiffness
    energy += np.sum(belt.modal_stiffness * (state.openings**2 + state.leans**2))
    return energy + 0.5 * belt.driven_inertia * state.pulleys[pushbelt_fields.DRIVEN_SPEED] ** 2


def moved_back(fields):
    """Positions and directions of elements a step before, and then the speeds of that time."""
    f, omega = fields.copy(), fields[:, spatial_fields.OMEGA : spatial_fields.OMEGA + 3]
    f[:, 0:3] -= STEP * fields[:, spatial_fields.SPEED : spatial_fields.SPEED + 3]
    for first in (spatial_fields.HEADING, spatial_fields.OUTWARD):
        half = fields[:, first : first + 3] - 0.5 * STEP * np.cross(omega, fields[:, first : first + 3])
        f[:, first : first + 3] -= STEP * np.cross(omega, half)
    f[:, spatial_fields.SPEED : spatial_fields.SPEED + 8] -= fields[:, spatial_fields.CHANGE :][:, :8]
    return f


def gaps_between(belt, f):
    """Gaps at the front to the next element by positions, and the offset of the pin, (5, nodes) [m]."""
    r, x, o = f[:, 0:3], f[:, 3:6], f[:, 6:9]
    a = np.cross(o, x)
    rj, xj, oj = (np.roll(v, -1, axis=0) for v in (r, x, o))
    found = []
    for height, width in ((-belt.pitch_depth, belt.edge_width), (belt.head_height, belt.head_width)):
        for side in (-1.0, 1.0):
            front = r + 0.5 * belt.thickness * x + height * o + side * width * a
            found.append(np.sum((rj - front) * xj, axis=1) - 0.5 * belt.thickness)
    offset = r - rj + 0.5 * belt.thickness * (x + xj) + belt.pin_height * (o - oj)
    offset -= np.sum(offset * xj, axis=1)[:, None] * xj
    return np.array([*found, np.linalg.norm(offset, axis=1)])


def gaps(belt, state):
    """Gaps by the geometry of a state, of the contacts `CONTACTS[:9]`, (nodes, 9) [m].

    Elements press on each other by the mean of three positions, of which the state is the last one, and by the
    rate of the last step. Flanks have the mean radius, and the last axial position.
    """
    f = of_lanes(state.elements)
    r, x, o = f[:, 0:3], f[:, 3:6], f[:, 6:9]
    a = np.cross(o, x)
    three = [f, moved_back(f), moved_back(moved_back(f))]
    rate = belt.contact_time / STEP
    weights = 0.25 + rate, 0.5 - rate, 0.25
    found = list(np.tensordot(weights, [gaps_between(belt, g) for g in three], 1))
    found[-1] = belt.pin_clearance - found[-1]
    driven = f[:, spatial_fields.DRIVEN].astype(int)
    axis, centre = belt.axes[driven], driven[:, None] * [belt.centre_distance, 0.0, 0.0]
    groove, middle = (
        state.pulleys[first:][driven]
        for first in (pushbelt_fields.DRIVING_RADIUS, spatial_fields.DRIVING_MIDDLE)
    )
    opening, lean = (sheaves_opening(belt, state, modes) for modes in (state.openings, state.leans))
    for side in (-1.0, 1.0):
        for reach in (-belt.flank_reach, belt.flank_reach):
            width = belt.half_width + reach * belt.sine / belt.cosine
            q = r - centre + (reach - belt.pitch_depth) * o + side * width * a
            along = np.sum(q * axis, axis=1)
            radii = []
            for g in three:
                sideways = np.cross(g[:, 6:9], g[:, 3:6])
                p = g[:, 0:3] - centre + (reach - belt.pitch_depth) * g[:, 6:9] + side * width * sideways
                radii.append(np.linalg.norm(p - np.sum(p * axis, axis=1)[:, None] * axis, axis=1))
            radius = np.average(radii, axis=0, weights=[1, 2, 1])
            apart = belt.half_width - side * (along - middle) + opening + side * lean
            found.append(belt.cosine * apart + belt.sine * (radius - groove))
    return np.stack(found, axis=1)


def sheaves_modes(belt, state):
    """psi_k of either pulley at its elements, 0 at those of the other one, (2, modes, nodes)."""
    f = of_lanes(state.elements)
    driven = f[:, spatial_fields.DRIVEN]
    pitch = f[:, :2] - belt.pitch_depth * f[:, 6:8] - driven[:, None] * [belt.centre_distance, 0.0]
    angle = np.arctan2(pitch[:, 1], pitch[:, 0])
    shapes = [
        np.cos((k + 1) // 2 * angle) if k % 2 else np.sin(k // 2 * angle) if k else np.ones_like(angle)
        for k in range(belt.modal_stiffness.shape[1])
    ]
    return np.stack([1.0 - driven, driven])[:, None] * np.reshape(shapes, (1, len(shapes), len(f)))


def sheaves_opening(belt, state, modes):
    """How far a sheave gives way where each element is, by a_k of both pulleys (2, modes), (nodes,) [m]."""
    return np.einsum("pk,pkn->n", modes, sheaves_modes(belt, state))


def leaning_loads(belt, fields, shapes):
    """Half of what the flanks press the right sheaves more than the left ones, by modes, (2, modes) [N]."""
    sides = fields[:, spatial_fields.FLANK : spatial_fields.FLANK + 4].reshape(-1, 2, 2).sum(axis=2)
    return 0.5 * belt.cosine * shapes @ (sides[:, 1] - sides[:, 0])
