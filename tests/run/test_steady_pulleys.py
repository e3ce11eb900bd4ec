"""Steady states of free pulleys: the ends of calm transients, and what thrusts, springs and clearances do to them."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.elastic_belt.pulley_settings import oil_factor
from cvt_hpc.models.steady_variator.record import quantities
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from support.fast_runs import FastRuns
from support.marched import Together, mean
from support.rungs import rung_job, rung_record

CALM = {"stations": 48, "end_refinement": 1.0, "load": 60.0, "friction_gradient": 0.0}
SCENES = {
    "lag": {"tilt_lag": 1e-3},
    "clearance": {"tilt_lag": 1e-3, "collar_clearance": 5e-4},
    "clearance without lag": {"collar_clearance": 5e-4},
    "spring and oil": {"driven_spring_rate": 5e6, "driven_piston": (0.02, 0.08)},
    "drive": {"driving_inertia": 0.05, "drive_slope": 5.0},
    "given driven speed": {"driving_inertia": 0.05, "driven_inertia": np.inf},
    "clamping": {"clamping": "torque_ratio", "held_torque_ratio": 0.3},
}
# Not among them, as the belt's creep takes seconds to shift it
THRUST = {"driving_axial": "thrust", "driving_thrust": 43.2e3}
TRANSIENT = CALM | {"duration": 0.3, "rise_time": 0.02, "disturbance": 0.0, "judged_fraction": 0.1}
LEFT = 2e-4


def transient(name):
    """Parameters of a run; without states of the pulleys it shares its lanes with no other."""
    alone = {"lanes": "stations"} if name == "clearance without lag" else {}
    return TRANSIENT | SCENES[name] | alone


RUNS = Together(*map(transient, SCENES))


def state(**values):
    point = rung_job("steady_variator", **CALM | values).point(0)
    steady = SteadyBelt(point).at(CALM["load"])
    return steady, quantities(steady, mesh(point))


@pytest.mark.parametrize("name", SCENES)
def test_it_is_the_end_of_a_calm_transient(name):
    steady, found = state(**SCENES[name])
    run = RUNS.finished(**transient(name))

    def last(channel):
        return mean(run, channel)

    # what 0.3 s leave of the way, most of it by the controller and by the speeds of a drive with inertia
    for k, pulley in enumerate(("driving", "driven")):
        assert found["axial_force"][k] == pytest.approx(last(f"axial_force {pulley}"), rel=LEFT)
    assert found["driven_position"] == pytest.approx(last("driven_position"), abs=LEFT * 1e-3)
    course = run.parameters["driving_speed"]
    excess = steady.state.scalars[f.FIRST_STATE + f.EXCESS]
    assert excess == pytest.approx(last("driving_speed") - course, abs=LEFT * course)
    assert steady.state.scalars[f.DRIVEN_SPEED] == pytest.approx(last("driven_speed"), rel=LEFT)


@pytest.mark.parametrize("name", ["thrust", "all"])
def test_a_transient_that_begins_there_stays(name):
    every = {"driving_axial": "ratio", **SCENES["clearance"], **SCENES["spring and oil"], **SCENES["drive"]}
    steady, _ = state(**(THRUST if name == "thrust" else every | SCENES["clamping"]))
    run = FastRuns([steady.belt], [steady.state.copy()])
    run.advance(200, 4e-6)
    moved = run.state().scalars, steady.state.scalars
    # what Newton's iteration leaves, 10 pm of w, and the sums of controllers that see it
    assert np.abs(run.state().fields[0] - steady.state.fields[0]).max() < 1e-9
    for places in (slice(f.DRIVEN_SPEED, f.LAYER_WORK), slice(f.FIRST_STATE, None)):
        assert moved[0][places] == pytest.approx(moved[1][places], rel=1e-5, abs=1e-8)


def test_thrusts_are_those_that_are_given():
    steady, found = state(**THRUST)
    assert found["axial_force"] == pytest.approx([43.2e3, 50e3], rel=1e-9)
    assert abs(steady.state.scalars[f.FIRST_STATE + f.SHIFT]) > 1e-5
    # the same opening, given: the same state
    plain, same = state(driving_position=steady.state.scalars[f.FIRST_STATE + f.SHIFT])
    assert same["axial_force"] == pytest.approx(found["axial_force"], rel=1e-7)
    assert plain.state.fields[0] == pytest.approx(steady.state.fields[0], abs=1e-10)


def test_springs_and_oil_press_beside_the_thrust():
    steady, found = state(**SCENES["spring and oil"])
    oil = oil_factor((0.02, 0.08), 850.0) * steady.state.scalars[f.DRIVEN_SPEED] ** 2
    assert found["axial_force"][1] == pytest.approx(50e3 + 5e6 * found["driven_position"] + oil, rel=1e-9)


def test_a_lag_changes_no_steady_state_and_a_clearance_needs_none():
    plain, _ = state()
    lagging, _ = state(tilt_lag=1e-3)
    assert lagging.state.fields[0] == pytest.approx(plain.state.fields[0], abs=1e-10)
    clear, found = state(tilt_lag=1e-3, collar_clearance=5e-4)
    without, same = state(collar_clearance=5e-4)
    assert without.state.fields[0] == pytest.approx(clear.state.fields[0], abs=1e-10)
    assert same["axial_force"] == pytest.approx(found["axial_force"], rel=1e-8)
    radii = clear.belt.driving_radius, clear.belt.driven_radius
    for place, radius in zip((f.DRIVING_COS, f.DRIVEN_COS), radii, strict=True):
        tilts = [
            one.state.scalars[f.FIRST_STATE + place : f.FIRST_STATE + place + 2] for one in (lagging, clear)
        ]
        assert np.linalg.norm(tilts[1]) > 0.8 * 5e-4 * radius + 0.5 * np.linalg.norm(tilts[0])


def test_controllers_hold_what_they_are_to_hold():
    steady, _ = state(driving_axial="ratio")
    speeds = steady.belt.driving_speed / steady.state.scalars[f.DRIVEN_SPEED]
    assert speeds == pytest.approx(2.52, rel=1e-9)
    _, found = state(**SCENES["clamping"])
    assert found["torque_ratio"] == pytest.approx(0.3, rel=1e-3)  # by the coefficient at gross slip, not mu_k


def test_a_walk_along_the_load_goes_on_from_the_last_state():
    point = rung_job("steady_variator", **CALM | SCENES["clearance"]).point(0)
    belt = SteadyBelt(point)
    loads = (60.0, 65.0)
    states = list(belt.along(loads))
    assert [one.load for one in states] == list(loads)
    again = belt.known(65.0, states[1].unknowns)
    assert np.array_equal(again.state.fields, states[1].state.fields)
    with pytest.raises(ValueError, match="unknowns of a belt"):
        belt.known(65.0, states[1].unknowns[:-4])


def test_a_thrust_that_no_opening_meets_has_no_state():
    """The axial force that the driving sheave needs has a maximum over its opening, 43.56 kN by the default law."""
    with pytest.raises(NoSteadyState, match="pulleys let go at 60 N m, the walk ends at"):
        state(friction_gradient=-0.8, driving_axial="thrust", driving_thrust=44e3)


@pytest.mark.parametrize(
    ("model", "values", "message"),
    [
        (
            "steady_variator",
            {"driving_inertia": 0.05},
            "drive_slope: expected above 0, or driven_inertia inf",
        ),
        ("steady_variator", {"driving_axial": "ratio", "ratio_rate": 0.0}, "ratio_rate: expected above 0"),
        ("steady_variator", {"collar_clearance": -1e-4}, "collar_clearance: expected >= 0 rad"),
        ("steady_variator", {"bearing_clearance": 1e-5}, "bearing_clearance: expected 0, or shaft_lengths"),
        ("linear_stability", {"collar_clearance": 1e-4}, "collar_clearance: expected 0, or a tilt_lag"),
        ("slip_limit", {"driving_axial": "thrust"}, "driving_axial: expected position"),
        ("slip_limit", {"clamping": "torque_ratio"}, "clamping: expected constant"),
        ("slip_limit", {"driving_inertia": 0.05}, "driving_inertia: expected inf"),
        ("slip_limit", {"driven_inertia": np.inf}, "driven_inertia: expected finite"),
        ("slip_limit", {"driven_piston": (0.08, 0.02)}, "driven_piston: expected an inner"),
    ],
)
def test_what_cannot_be_is_refused(model, values, message):
    with pytest.raises(InputError, match=message):
        rung_job(model, **values)


def test_record():
    record = rung_record("steady_variator", **CALM | SCENES["drive"])
    steady, found = state(**SCENES["drive"])
    speed = steady.belt.driving_speed + steady.state.scalars[f.FIRST_STATE + f.EXCESS]
    assert record["speed_loss"] == pytest.approx(
        1.0 - 2.52 * steady.state.scalars[f.DRIVEN_SPEED] / speed, rel=1e-9
    )
    torque = 60.0 - 5.0 * steady.state.scalars[f.FIRST_STATE + f.EXCESS]
    assert record["driving_power"] == pytest.approx(torque * speed, rel=1e-6)
    assert abs(record["power_residual"]) < 1e-3
