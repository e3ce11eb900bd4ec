"""Flank forces: balance of forces in the groove, dissipation."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State, belt_constants
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts
from cvt_hpc.physics.flank import flank_forces, flank_sliding
from support.scene import VALUES

speeds = st.floats(-1.0, 1.0)
coefficients = st.floats(0.01, 0.3)
widths = st.floats(1e-3, 0.1)
angles = st.floats(0.05, 0.5)  # half wedge angle [rad]
AXIAL = 1.3e5  # [N/m]


def forces(mu, width, angle, v_radial, v_tangential):
    return flank_forces(mu, width, np.sin(angle), np.cos(angle), AXIAL, v_radial, v_tangential)


@given(coefficients, widths, angles, speeds, speeds)
def test_forces_are_those_of_a_sliding_body_in_a_groove(tell, mu, width, angle, v_radial, v_tangential):
    # One flank in (radial outward, tangential, axial away from the belt's middle). The groove opens outwards:
    # the flank's meridian is (cos, 0, sin), its normal, from the sheave to the belt, (sin, 0, -cos).
    meridian = np.array([np.cos(angle), 0.0, np.sin(angle)])
    normal = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    velocity = v_radial / np.cos(angle) * meridian + v_tangential * np.array([0.0, 1.0, 0.0])
    speed = np.linalg.norm(velocity)
    assume(speed > 1e-6)
    assert velocity[0] == pytest.approx(v_radial, abs=1e-15)
    assert velocity @ normal == pytest.approx(0.0, abs=1e-15)
    assert flank_sliding(v_radial, v_tangential, 1.0 / np.cos(angle)) == pytest.approx(
        (speed, v_radial / np.cos(angle))
    )

    effective = mu * np.tanh(speed / width)
    unit = normal - effective * velocity / speed  # normal force 1 and its friction
    one_flank = unit * (-AXIAL / unit[2])  # scaled to the axial force that presses the belt together
    radial, tangential = forces(mu, width, angle, v_radial, v_tangential)
    tell("force of sliding flanks by a body in a groove [N/m]", (radial, tangential), 2.0 * one_flank[:2])
    # a few roundings of forces below 1e6 N/m
    assert radial == pytest.approx(2.0 * one_flank[0], abs=1e-8)
    assert tangential == pytest.approx(2.0 * one_flank[1], abs=1e-8)


def test_no_sliding_no_friction():
    radial, tangential = forces(0.1, 0.02, 0.2, 0.0, 0.0)
    assert (radial, tangential) == pytest.approx((2.0 * AXIAL * np.tan(0.2), 0.0))


def test_overlap_in_rigid_grooves():
    # Bullinger et al. 2005, eq. 33: the gap is z + 2 w tan(d0), z driven by the driven sheave, prescribed at
    # the driver; rigid sheaves leave the elements' c_e alone
    parameters = VALUES | {
        "duration": 1.0,
        "sheave_stiffness": np.inf,
        "stiffness_of": "sheave",
        "driving_position": 3e-5,
    }
    belt = belt_constants(parameters)
    n, angle = belt.cell.size, np.deg2rad(11.0)
    fields, scalars, force = np.zeros((7, n)), np.zeros(f.SCALARS), np.empty(n)
    fields[f.W] = 1e-4 * np.sin(np.arange(n))
    scalars[f.DRIVEN_POSITION] = -2e-5
    assert contact_forces(belt, State(fields, scalars), fresh_contacts(belt), force) > 0

    opening = np.full(n, np.inf)
    for held, wrap, position in (
        (belt.driving_stations, belt.driving, 3e-5),
        (belt.driven_stations, belt.driven, -2e-5),
    ):
        opening[held] = position + 2.0 * np.tan(angle) * (wrap.rise + wrap.upright * fields[f.W, held])
    overlap = np.maximum(-opening, 0.0)
    assert np.maximum(force, 0.0) == pytest.approx(3e10 * overlap, rel=1e-12)
    assert 0 < np.count_nonzero(force > 0.0) < np.count_nonzero(np.isfinite(opening))
