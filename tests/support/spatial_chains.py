"""Scenes of the spatial pushbelt's kernels, made from arrays."""

import numpy as np

from cvt_hpc.models.pushbelt import fields as pushbelt_fields
from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.transient import EQUATIONS as OF_ANY
from cvt_hpc.models.spatial_pushbelt.transient import _evaluate
from cvt_hpc.physics.friction_laws import Law
from support.pushbelts import given, start

EQUATIONS = {1: OF_ANY, 2: OF_ANY}  # by how many flows of ring material there are
WEDGE = np.deg2rad(11.0)
SHAKEN = 64  # elements of `shaken`


def belt(**given):
    """Constants of 432 elements of 1.53 mm as the design has them; without pins, dampers and modes."""
    mass, thickness = 1.858e-3, 1.53e-3
    square = mass / 12.0
    constants = {
        "centre_distance": 0.155,
        "axes": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]),
        "loose_side": np.zeros(2),
        "sine": np.sin(WEDGE),
        "cosine": np.cos(WEDGE),
        "half_width": 12e-3,
        "flank_reach": 3e-3,
        "thickness": thickness,
        "pitch": 661.2e-3 / 432,
        "pitch_depth": 1.5e-3,
        "head_height": 4e-3,
        "edge_width": 10e-3,
        "head_width": 5e-3,
        "package_distance": 7.5e-3,
        "pin_height": 2.5e-3,
        "pin_clearance": np.inf,
        "pin_stiffness": 1e8,
        "mass": mass,
        "roll_inertia": square * (24e-3**2 + 13e-3**2),
        "yaw_inertia": square * (24e-3**2 + thickness**2),
        "pitch_inertia": square * (13e-3**2 + thickness**2),
        "ring_mass": 0.165 / 432,
        "ring_rotary_inertia": 0.165 / 432 * 9.75e-3**2 / 12.0,
        "ring_stiffness": 6.0e6,
        "ring_time": 4.0 / 6.0e6,
        "bending_stiffness": 0.0,
        "ring_bending": 47.6,
        "ring_shear": 2.4e6,
        "flank_stiffness": 5e7,
        "local_compliance": 0.0,
        "local_decay": 0.5,
        "contact_stiffness": 1e9,
        "contact_time": 13e-6,
        "angle_stiffness": 0.0,
        "angle_damping": 0.0,
        "yaw_stiffness": 0.0,
        "yaw_damping": 0.0,
        "transverse_damping": 0.0,
        "lateral_damping": 0.0,
        "flank_law": int(Law.COULOMB),
        "flank_kinetic": 0.0,
        "flank_gradient": 0.0,
        "flank_speed": 0.1,
        "friction_memory": 0.0,
        "ring_friction": 0.0,
        "friction_speed": 5e-4,
        "ring_friction_speed": 5e-4,
        "driven_inertia": 0.01,
        "driving_rate": 0.0,
        "driven_rate": 0.0,
        "modal_stiffness": np.zeros((2, 0)),
        "modal_damping": np.zeros((2, 0)),
        "lean_lag": 1e-3,
    }
    return b.Belt(**constants | given)


def state(fields, pulleys=(0.0, 0.0, 1e-6, 1e-6, 0.0, 0.0), modes=0):
    """A state of elements (nodes, STATE_FIELDS) beside pulleys too small to be touched."""
    return b.BeltState(
        in_lanes(fields),
        np.array(pulleys, dtype=float),
        np.zeros((2, modes)),
        np.zeros((2, modes)),
        np.zeros(1 + 2 * modes),
        np.zeros(spatial_fields.LOADS),
        np.zeros(pushbelt_fields.TOTALS),
        np.zeros(pushbelt_fields.COUNTERS, np.int64),
    )


def spinning_ring(nodes, radius, speed):
    """Fields of a free ring that spins in equilibrium, counter-clockwise [m], [rad/s]."""
    angle = 2.0 * np.pi * np.arange(nodes) / nodes
    none = np.zeros(nodes)
    fields = np.zeros((nodes, spatial_fields.STATE_FIELDS))
    fields[:, :3] = radius * np.stack([np.cos(angle), np.sin(angle), none], 1)
    fields[:, 3:6] = np.stack([-np.sin(angle), np.cos(angle), none], 1)
    fields[:, 6:9] = np.stack([np.cos(angle), np.sin(angle), none], 1)
    fields[:, spatial_fields.SPEED : spatial_fields.SPEED + 3] = speed * radius * fields[:, 3:6]
    fields[:, spatial_fields.OMEGA + 2] = speed
    fields[:, spatial_fields.V] = speed * radius
    return fields


def free_ring(nodes, radius, spin, lateral=0.0):
    """Constants, tension and fields of a free ring in equilibrium with its rotation [m], [rad/s].

    It has speeds lateral cos 2 phi out of its plane [m/s].
    """
    chord = 2.0 * radius * np.sin(np.pi / nodes)
    constants = belt(
        thickness=0.9 * chord,
        pitch=chord,
        mass=2 * 1.858e-3,
        ring_mass=0.165 / nodes,
        ring_rotary_inertia=0.165 / nodes * 9.75e-3**2 / 12.0,
        ring_time=1e-5,  # it settles on the circle of its steps, half a step from where it starts
    )
    tension = (constants.mass + constants.ring_mass) * spin**2 * radius / (2.0 * np.sin(np.pi / nodes))
    fields = spinning_ring(nodes, radius, spin)
    fields[:, spatial_fields.LENGTH] = chord / (1.0 + tension / constants.ring_stiffness)
    fields[:, spatial_fields.TENSION] = tension
    angle = 2.0 * np.pi * np.arange(nodes) / nodes
    fields[:, spatial_fields.SPEED + 2] = lateral * np.cos(2.0 * angle)
    fields[:, spatial_fields.SLOPE_RATE] = -2.0 * lateral / radius * np.sin(2.0 * angle)
    return constants, tension, fields


def mirrored(f):
    """Fields (n, STATE_FIELDS) of the mirror image, left against right."""
    odd = (
        2,
        5,
        8,
        spatial_fields.SLOPE,
        spatial_fields.SPEED + 2,
        spatial_fields.OMEGA,
        spatial_fields.OMEGA + 1,
        spatial_fields.SLOPE_RATE,
    )
    g = f.copy()
    g[
        :,
        [
            *odd,
            spatial_fields.CHANGE + 2,
            spatial_fields.CHANGE + 3,
            spatial_fields.CHANGE + 4,
            spatial_fields.CHANGE + 7,
        ],
    ] *= -1.0
    g[:, spatial_fields.PUSH : spatial_fields.PUSH + 4] = f[:, spatial_fields.PUSH + np.array([1, 0, 3, 2])]
    for first in range(spatial_fields.FLANK, spatial_fields.RING_SLIP, spatial_fields.POINTS):
        g[:, first : first + 4] = f[:, first + np.array([2, 3, 0, 1])]
    return g


def energy_and_momentum(constants, fields):
    """Kinetic energy, with that of lateral bending and stretching [J], momentum and its moment about 0."""
    r, x, o = fields[:, 0:3], fields[:, 3:6], fields[:, 6:9]
    a = np.cross(o, x)
    u, w = (
        fields[:, spatial_fields.SPEED : spatial_fields.SPEED + 3],
        fields[:, spatial_fields.OMEGA : spatial_fields.OMEGA + 3],
    )
    v, rate = fields[:, spatial_fields.V], fields[:, spatial_fields.SLOPE_RATE]
    inertias = constants.roll_inertia, constants.yaw_inertia, constants.pitch_inertia
    spin = sum(k * d * np.sum(d * w, 1)[:, None] for k, d in zip(inertias, (x, o, a), strict=True))
    momentum, moment = constants.mass * u, constants.mass * np.cross(r, u) + spin
    energy = 0.5 * np.sum(u * momentum) + 0.5 * np.sum(w * spin)
    energy += 0.5 * constants.ring_rotary_inertia * np.sum(rate**2)
    for side in (1.0, -1.0):
        p = r + side * constants.package_distance * a
        t = np.roll(p, -1, 0) - np.roll(p, 1, 0)
        t /= np.linalg.norm(t, axis=1)[:, None]
        q = u + side * constants.package_distance * np.cross(w, a)
        q = q + (v - np.sum(t * q, 1))[:, None] * t
        momentum = momentum + 0.5 * constants.ring_mass * q
        moment = moment + 0.5 * constants.ring_mass * np.cross(p, q)
        energy += 0.25 * constants.ring_mass * np.sum(q**2)
    h = constants.pitch
    slope = fields[:, spatial_fields.SLOPE]
    shear = (np.roll(r[:, 2], -1) - r[:, 2]) / h - 0.5 * (slope + np.roll(slope, -1))
    energy += 0.5 * constants.ring_shear * h * np.sum(shear**2)
    energy += 0.5 * constants.ring_bending / h * np.sum((np.roll(slope, -1) - slope) ** 2)
    stretched = fields[:, spatial_fields.TENSION] ** 2 * fields[:, spatial_fields.LENGTH]
    if fields.shape[1] > spatial_fields.STATE_FIELDS:  # two flows
        apart, half = fields[:, spatial_fields.TENSION_DIFFERENCE], fields[:, spatial_fields.HALF_LENGTH]
        stretched += apart * (
            apart * fields[:, spatial_fields.LENGTH] + 2.0 * fields[:, spatial_fields.TENSION] * half
        )
        energy += 0.5 * constants.ring_mass * np.sum(fields[:, spatial_fields.HALF_SPEED] ** 2)
    energy += 0.5 * np.sum(stretched) / constants.ring_stiffness
    return energy, momentum.sum(0), moment.sum(0)


__all__ = ["belt", "energy_and_momentum", "mirrored", "of_lanes", "spinning_ring", "state"]


def beside_planar(planar, planar_state, **given):
    """Constants and state of the spatial belt that is the planar one where it stays in its plane."""
    nodes = of_lanes(planar_state.elements).shape[0]
    group = 432.0 / nodes
    shared = {name: getattr(planar, name) for name in b.Belt._fields if hasattr(planar, name)}
    f = of_lanes(planar_state.elements)
    first, last = f[0, [pushbelt_fields.Y, pushbelt_fields.Z]], f[1, [pushbelt_fields.Y, pushbelt_fields.Z]]
    thickness, square = planar.thickness, planar.mass / 12.0
    constants = belt(
        **shared
        | {
            "pitch": float(np.linalg.norm(last - first)),
            "roll_inertia": square * (24e-3**2 + 13e-3**2),
            "yaw_inertia": square * (24e-3**2 + thickness**2),
            "pitch_inertia": planar.inertia,
            "ring_rotary_inertia": planar.ring_mass * 9.75e-3**2 / 12.0,
            "yaw_stiffness": 2.0 * group,
            "yaw_damping": 5e-5 * group,
        }
        | given
    )
    fields = np.zeros((nodes, spatial_fields.STATE_FIELDS))
    fields[:, 0:2], fields[:, 3:5] = (
        f[:, [pushbelt_fields.Y, pushbelt_fields.Z]],
        f[:, [pushbelt_fields.HEADING_Y, pushbelt_fields.HEADING_Z]],
    )
    fields[:, 6:8] = np.stack([f[:, pushbelt_fields.HEADING_Z], -f[:, pushbelt_fields.HEADING_Y]], 1)
    fields[:, spatial_fields.SPEED : spatial_fields.SPEED + 2] = f[
        :, [pushbelt_fields.U_Y, pushbelt_fields.U_Z]
    ]
    fields[:, spatial_fields.OMEGA + 2], fields[:, spatial_fields.V] = (
        f[:, pushbelt_fields.OMEGA],
        f[:, pushbelt_fields.V],
    )
    fields[:, spatial_fields.LENGTH], fields[:, spatial_fields.TENSION] = (
        f[:, pushbelt_fields.LENGTH],
        f[:, pushbelt_fields.TENSION],
    )
    fields[:, spatial_fields.DRIVEN] = f[:, pushbelt_fields.DRIVEN]
    modes = constants.modal_stiffness.shape[1]
    return constants, state(fields, [*planar_state.pulleys, 0.0, 0.0], modes)


def shaken(seed, **changes):
    """A pressed belt with gaps, slips, rotations and modes out of order, beside tilted pulleys."""
    stiffness = ((6e8, 3e8, 3e8), (9e8, 2e8, 1e8))
    planar, planar_state = start(given(nodes=SHAKEN, modal_stiffness=stiffness, friction_speed=0.05))
    axes = np.array([[3e-3, -2e-3, 1.0], [-1e-3, 4e-3, 1.0]])
    constants = {
        "axes": axes / np.linalg.norm(axes, axis=1)[:, None],
        "loose_side": np.array([1.0, -1.0]),
        "pin_clearance": 2e-5,
        "thickness": planar.thickness + 2e-5,
        "ring_friction_speed": 0.02,
        "lateral_damping": 3.0,
        "flank_law": int(Law.STRIBECK),
        "flank_gradient": -0.3,
        "friction_memory": 3e-4,
    }
    belt, state = beside_planar(planar, planar_state, **constants | changes)
    rng = np.random.default_rng(seed)
    f = of_lanes(state.elements).copy()
    f[:, :3] += rng.normal(0.0, 2e-5, (SHAKEN, 3))
    f[:, 3:6] += rng.normal(0.0, 2e-3, (SHAKEN, 3))
    f[:, 3:6] /= np.linalg.norm(f[:, 3:6], axis=1)[:, None]
    f[:, 6:9] += rng.normal(0.0, 2e-3, (SHAKEN, 3))
    f[:, 6:9] -= np.sum(f[:, 6:9] * f[:, 3:6], 1)[:, None] * f[:, 3:6]
    f[:, 6:9] /= np.linalg.norm(f[:, 6:9], axis=1)[:, None]
    f[:, spatial_fields.SLOPE] = rng.normal(0.0, 2e-3, SHAKEN)
    f[:, spatial_fields.SPEED : spatial_fields.SPEED + 8] += rng.normal(0.0, 0.05, (SHAKEN, 8))
    f[:, spatial_fields.SADDLE] = rng.uniform(20.0, 80.0, SHAKEN)
    f[:, spatial_fields.V_FILTERED : spatial_fields.V_FILTERED + 4] = rng.uniform(0.0, 0.2, (SHAKEN, 4))
    state.elements.data[:] = in_lanes(f).data
    state.openings[:] = rng.normal(0.0, 1e-6, state.openings.shape)
    state.leans[:] = rng.normal(0.0, 1e-6, state.openings.shape)
    state.pulleys[[pushbelt_fields.DRIVING_RADIUS, pushbelt_fields.DRIVEN_RADIUS]] += 1e-4
    state.pulleys[[spatial_fields.DRIVING_MIDDLE, spatial_fields.DRIVEN_MIDDLE]] = 3e-5, -2e-5
    return belt, state, b.workspace(belt, SHAKEN), rng


def lines(belt, f):
    """Places of both ring packages at the elements, (2, nodes, 3), and their directions there."""
    place = f[:, :3] + belt.package_distance * np.multiply.outer((1.0, -1.0), np.cross(f[:, 6:9], f[:, 3:6]))
    t = np.roll(place, -1, axis=1) - np.roll(place, 1, axis=1)
    return place, t / np.linalg.norm(t, axis=2)[..., None]


def evaluated(belt, state, work, dt):
    """Residuals of elements and border, of an iterate evaluated twice, so that duals are those of its slips."""
    for _ in range(2):
        _evaluate(belt, state, work, 1.35 * 60.0, dt)
    own = of_lanes(work.iterate)[:, spatial_fields.RESIDUAL : spatial_fields.RESIDUAL + 8]
    return np.concatenate([own.ravel(), work.border[:, -1]])
