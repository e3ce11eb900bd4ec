"""Where the belt begins to slip: by formula and by states, for a thrust and for a torque; states without push."""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.elastic_belt.pulley_settings import oil_factor
from cvt_hpc.models.steady_variator.record import quantities
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from cvt_hpc.variables import Status
from cvt_hpc.variator import GROSS_SLIP
from support.rungs import rung_job, rung_record

STATIONS = 32


@cache
def limit(**values):
    """The record of a search on a coarse belt."""
    return rung_record("slip_limit", stations=STATIONS, **values)


def test_formula_is_that_of_bullinger():
    most = 2 * 0.1 * 50e3 * 0.075 / 2.52 / np.cos(np.deg2rad(11))
    found = rung_record("slip_limit", method="formula", safety=1.25)
    assert found["limit_torque"] == pytest.approx(most, rel=1e-12)
    assert found["working_torque"] == pytest.approx(most / 1.25, rel=1e-12)
    back = rung_record("slip_limit", method="formula", safety=1.25, sought="thrust", load=-most)
    assert back["limit_thrust"] == pytest.approx(50e3, rel=1e-12)
    assert back["axial_force"][1] == pytest.approx(62.5e3, rel=1e-12)


def test_least_thrust_of_a_limit_torque_is_the_thrust():
    found = limit()
    assert found["status"] == Status.DONE, found["reason"]
    # at the limit a pulley slips by 5 %, or the load turns back before
    assert np.abs(found["limit_slip"]).max() <= GROSS_SLIP * 1.001
    assert np.abs(found["slip"]).max() < 0.5 * GROSS_SLIP
    assert abs(found["power_residual"]) < 5e-3 and 0.9 < found["efficiency"] < 1.0
    back = limit(sought="thrust", load=found["limit_torque"])
    assert back["limit_thrust"] == pytest.approx(50e3, rel=5e-3)
    assert back["axial_force"][1] == pytest.approx(1.3 * back["limit_thrust"], rel=1e-8)


def test_free_pulleys_slip_where_held_ones_do_under_the_same_axial_force():
    """Oil presses like so much more thrust; slip slows it by some per cent more at the limit than at work."""
    found = limit(driven_piston=(0.02, 0.08))
    speed = found["load_power"] / (2.52 * found["working_torque"])
    oil = oil_factor((0.02, 0.08), 850.0) * speed**2
    assert found["axial_force"][1] == pytest.approx(50e3 + oil, rel=1e-9)
    held = limit(thrust=50e3 + oil)
    assert found["limit_torque"] == pytest.approx(held["limit_torque"], rel=0.15 * oil / 50e3)
    assert oil > 100.0 and abs(found["power_residual"]) < 5e-3


def test_a_clearance_that_goes_to_none_leaves_the_limit():
    none = limit()
    limits = [limit(collar_clearance=clearance)["limit_torque"] for clearance in (1e-8, 5e-4)]
    assert limits[0] == pytest.approx(none["limit_torque"], rel=1e-5)
    # a loose collar opens the groove in the middle of the arc: a little less is carried
    assert -1e-2 < limits[1] / none["limit_torque"] - 1.0 < -1e-4


def test_a_thrust_for_no_load_and_a_torque_ratio_of_one_are_refused():
    with pytest.raises(InputError, match='load: expected other than 0 where sought = "thrust"'):
        rung_job("slip_limit", sought="thrust").point(0)
    with pytest.raises(InputError, match="load_share"):
        rung_job("steady_variator", load_share=1.0)


def test_where_neither_strand_pushes_the_curve_has_states():
    # default belt: below 38 N m t2 pushes, above 40 N m t1; between, the play moves at nearly one load
    point = rung_job("steady_variator", stations=28, load=60.0).point(0)
    belt = SteadyBelt(point)
    first = belt.at(50.0)
    loads, pushes = [], []
    for state in belt.along_curve(first, 1.0):
        numbers = quantities(state, mesh(point))
        assert state.load == pytest.approx(
            numbers["load_power"] / point["ratio"] / state.state.scalars[1], 1e-9
        )
        # but for pushes that rest on a damper
        pushes.append(numbers["mean_push_force"])
        loads.append(state.load)
        if pushes[-1][1] > 50.0:
            break
    free = np.max(pushes, axis=1) < 1.0
    assert np.count_nonzero(free) > 3
    assert 30.0 < min(np.array(loads)[free]) < max(np.array(loads)[free]) < 45.0
    # a load between is found from either side
    for start in (first, belt.at(20.0)):
        found = belt.at(float(np.median(np.array(loads)[free])), start)
        assert quantities(found, mesh(point))["mean_push_force"].max() < 1.0
