"""A strand without net tension: what grows in it, by formula, and when that is the mesh's and no vibration."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State, belt_constants
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, system
from cvt_hpc.models.elastic_belt.validity import slack_doubt
from cvt_hpc.variables import Status
from support.belts import point
from support.equations import slopes

RADIUS = 0.024
CELLS = (12, 24, 48)  # in each half of the path of 0.30 m


def straight(cells, tension, push, speed=0.0, bending=0.0):
    """A straight periodic belt under uniform T and P: the model with its pulleys taken out."""
    path = {"ratio": 1.0, "driven_radius": RADIUS, "centre_distance": np.pi * RADIUS}
    mesh = {"stations": 2 * cells, "end_refinement": 1.0}
    belt = belt_constants(point("imex", **path, **mesh, bending_stiffness=bending, transverse_damping=0.0))
    nothing = np.zeros(2 * cells)
    belt = belt._replace(curvature=nothing, arc_curvature=nothing, touches=nothing, belt_speed=speed)
    fields, scalars = np.zeros((len(f.FIELDS), 2 * cells)), np.zeros(f.SCALARS)
    fields[f.V_ELEMENT] = fields[f.V_RING] = speed
    fields[f.N_RING] = 1.0 / (1.0 + tension / belt.ring_stiffness)
    fields[f.N_ELEMENT] = 1.0 / (1.0 - push / belt.element_stiffness)
    scalars[f.TIME] = belt.rise_time
    return belt, State(fields, scalars)


def fastest_growth(belt, state):
    """Largest real part of an eigenvalue [1/s]."""
    flat = flat_belt(belt)
    return np.linalg.eigvals(slopes(system(flat), 1.0, pack(flat, state))).real.max()


@pytest.mark.parametrize(
    ("tension", "push", "speed"), [(0.0, 500.0, 0.0), (5000.0, 4000.0, 40.0), (5000.0, 0.0, 90.0)]
)
def test_without_bending_the_shortest_wave_grows_fastest_at_any_mesh(tension, push, speed):
    # pushed slack at rest; and past the critical speed sqrt((T - P) / m), 27.7 and 62 m/s
    for cells in CELLS:
        belt, state = straight(cells, tension, push, speed)
        force = tension - push - belt.mass * speed**2
        expected = 2.0 / belt.cell[0] * np.sqrt(-force / belt.mass)
        assert fastest_growth(belt, state) == pytest.approx(expected, rel=1e-3)
        status, reason = slack_doubt(0.0, belt.cell[0], force)
        assert status == Status.FAILED_NUMERICS and "a strand is slack" in reason


@pytest.mark.parametrize(("tension", "push", "speed"), [(5000.0, 0.0, 60.0), (5000.0, 4000.0, 25.0)])
def test_below_the_critical_speed_nothing_grows(tension, push, speed):
    belt, state = straight(24, tension, push, speed)
    assert fastest_growth(belt, state) < 1e-3  # round-off of difference quotients
    assert slack_doubt(0.0, belt.cell[0], tension - push - belt.mass * speed**2) is None


def test_with_bending_the_growth_is_that_of_buckling_and_no_longer_the_mesh_s():
    # -F / (2 sqrt(EI m)) at its fastest; the path of 0.30 m has room for one wave near it
    rates = []
    for cells in CELLS:
        belt, state = straight(cells, 0.0, 500.0, bending=0.5)
        rates.append(fastest_growth(belt, state))
        assert slack_doubt(0.5, belt.cell[0], -500.0) is None
    assert rates == pytest.approx([250.0 / np.sqrt(0.5 * belt.mass)] * 3, rel=0.02)


def test_bending_carries_what_the_mesh_resolves():
    # -F = 2 EI / h^2: the fastest wave takes 2 pi cells
    border = -2.0 * 0.5 / 0.004**2
    assert slack_doubt(0.5, 0.004, 0.99 * border) is None
    assert slack_doubt(0.5, 0.004, 1.01 * border) is not None
