"""A common pushbelt by values of its elements, and its start."""

import numpy as np

from cvt_hpc.models.pushbelt import belt
from cvt_hpc.physics.friction_laws import Law
from cvt_hpc.physics.geometry import driven_radius, variator

# Assumptions, but for centre distance, belt length, elements and their mass, which are a public data set's.
ASSUMED = {
    "ratio": 1.35,  # [1]
    "centre_distance": 0.155,  # [m]
    "belt_length": 0.6612,  # of the pitch line, on which the rocking edges lie [m]
    "elements": 432,  # each of the values below; `given` makes super elements of them
    "element_mass": 1.858e-3,  # [kg]
    "element_height": 13e-3,  # [m], of which and of the thickness the inertia is that of a plate
    "pitch_depth": 1.5e-3,  # [m]
    "head_height": 4e-3,  # [m]
    "play": 0.3e-3,  # sum of the gaps between elements [m]
    "ring_mass": 0.165,  # [kg]
    "ring_stiffness": 6.0e6,  # EA [N]
    "ring_strain": 1e-4,  # at the start
    "ring_damping": 4.0,  # [N s]
    "bending_stiffness": 0.0,  # [N m^2]
    "half_wedge_angle": np.radians(11.0),  # [rad]
    "flank_stiffness": 5e7,  # [N/m]
    "local_compliance": 0.0,
    "local_decay": 0.5,
    "contact_stiffness": 1e9,  # [N/m]
    "nose_height": 6e-3,  # [m]
    "nose_clearance": np.inf,  # [m]
    "nose_stiffness": 1e8,  # [N/m]
    "contact_time": 13e-6,  # [s]
    "angle_stiffness": 5.0,  # [N m/rad]
    "angle_damping": 5e-5,  # [N m s]
    "transverse_damping": 500.0,  # [N s/m^2]
    "friction_law": "coulomb",
    "kinetic_friction": 0.09,
    "friction_gradient": 0.0,  # [s/m]
    "stribeck_velocity": 0.1,  # [m/s]
    "friction_memory": 0.0,  # [s]
    "ring_friction": 0.06,
    "friction_speed": 5e-4,  # [m/s]
    "ring_friction_speed": 5e-4,  # [m/s]
    "driven_inertia": 0.01,  # [kg m^2]
    "driving_rate": 0.0,  # [m/(s N)]: position prescribed
    "driven_rate": 5e-6,  # [m/(s N)]
    "modal_stiffness": ((), ()),  # [N/m]
    "tilt_lag": 0.0,  # [s]
    "driving_speed": 100.0 * np.pi,  # [rad/s]
}
NODES = 104  # of 8 lanes; polygon effects in the power balance are below half a percent
SPEED, THRUST = ASSUMED["driving_speed"], 20e3  # [rad/s], [N]


def given(nodes=NODES, **changes):
    """Values for `start`, of so many super elements."""
    group = ASSUMED["elements"] / nodes
    beside = ("element_mass", "flank_stiffness", "angle_stiffness", "angle_damping")
    values = {key: ASSUMED[key] * group for key in beside}
    values["contact_stiffness"] = ASSUMED["contact_stiffness"] / group
    return ASSUMED | values | {"gravity": 0.0, "elements": nodes} | changes


def start(values):
    """Constants and state of a belt by values of `given`, or by a run's parameters."""
    if "thrust" in values:
        return belt.start(belt.outset(values))
    g = values
    radius = driven_radius(g["ratio"], g["belt_length"], g["centre_distance"])
    path = variator(g["ratio"], radius, g["centre_distance"])
    line = belt.pitch_line(path, g["centre_distance"], g["elements"], g["driving_speed"])
    return belt.start(belt.Outset(constants(g, line.chord), line, g["ring_strain"]))


def constants(g, chord):
    """Constants of a belt by such values, and the distance of neighbours [m]."""
    thickness = chord - g["play"] / g["elements"]
    modal_stiffness = np.array(g["modal_stiffness"], dtype=np.float64).reshape(2, -1)
    modal_damping = np.zeros_like(modal_stiffness)
    modal_damping[:, 1:3] = g["tilt_lag"] * modal_stiffness[:, 1:3]
    found = {
        "sine": float(np.sin(g["half_wedge_angle"])),
        "cosine": float(np.cos(g["half_wedge_angle"])),
        "thickness": float(thickness),
        "pitch": float(chord),
        "mass": float(g["element_mass"]),
        "inertia": float(g["element_mass"] * (g["element_height"] ** 2 + thickness**2) / 12.0),
        "ring_mass": float(g["ring_mass"] / g["elements"]),
        "ring_time": float(g["ring_damping"] / g["ring_stiffness"]),
        "transverse_damping": float(g["transverse_damping"] * chord),
        "flank_law": int(Law[g["friction_law"].upper()]),
        "flank_kinetic": float(g["kinetic_friction"]),
        "flank_gradient": float(g["friction_gradient"]),
        "flank_speed": float(g["stribeck_velocity"]),
        "modal_stiffness": modal_stiffness,
        "modal_damping": modal_damping,
    }
    same = {name: float(g[name]) for name in belt.Belt._fields if name not in found}
    return belt.Belt(**same | found)
