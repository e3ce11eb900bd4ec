"""A straight periodic belt: the model with its pulleys taken out.

A path of equal pulleys at a centre distance of pi r has equal cells all around; its curvature is taken out,
so that the strains, and with them T and P, do not depend on w, and the flanks with it.
"""

import numpy as np

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants
from support.scene import VALUES

MASS = VALUES["element_mass"] + VALUES["ring_mass"]
RADIUS = 0.024
LENGTH = 2.0 * np.pi * RADIUS  # half the path [m]: 0.151, as long as a strand
TENSION = 5000.0  # net tension F = T - P [N]
WAVE = np.sqrt(TENSION / MASS)


def straight_belt(
    cells: int, speed: float = 0.0, bending: float = 0.0, damping: float = 0.0, refinement: float = 1.0
) -> Belt:
    """A straight belt of 2 LENGTH, `cells` cells (an even number) in each half."""
    belt = belt_constants(
        VALUES
        | {
            "duration": 1.0,
            "ratio": 1.0,
            "driven_radius": RADIUS,
            "centre_distance": np.pi * RADIUS,
            "stations": 2 * cells,
            "end_refinement": refinement,
            "bending_stiffness": bending,
            "transverse_damping": damping,
        }
    )
    assert refinement > 1.0 or np.ptp(belt.cell) < 1e-15
    nothing = np.zeros(2 * cells)
    return belt._replace(curvature=nothing, arc_curvature=nothing, touches=nothing, belt_speed=speed)


def moving_straight(belt: Belt, tension: float = TENSION, push: float = 0.0) -> State:
    """The undisturbed state under uniform T and P (negative P: gaps, by that much over EA_e)."""
    fields, scalars = np.zeros((len(f.FIELDS), belt.cell.size)), np.zeros(f.SCALARS)
    fields[f.V_ELEMENT] = fields[f.V_RING] = belt.belt_speed
    fields[f.N_RING] = 1.0 / (1.0 + tension / belt.ring_stiffness)
    fields[f.N_ELEMENT] = 1.0 / (1.0 - push / belt.element_stiffness)
    scalars[f.TIME] = belt.rise_time  # the start-up's damping is over
    scalars[f.DRIVEN_SPEED] = (
        belt.driving_speed / belt.ratio
    )  # and the pulley, of which the belt is free, turns
    return State(fields, scalars)
