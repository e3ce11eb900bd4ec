"""Runs of the planar pushbelt, as a job asks for them."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.pushbelt.parameters import string_limit
from cvt_hpc.models.pushbelt.transient import Transient
from cvt_hpc.simulation import run_point, simulate
from cvt_hpc.variables import Status, Vibrates

# A belt of few elements between rigid sheaves, clamped and loaded within a quarter of a revolution
BELT = {"elements": 104, "band_high": 1000.0, "sheave_stiffness": np.inf, "rise_time": 0.01, "duration": 0.04}
TORQUES = (0.0, 60.0, 200.0)


def job(**values):
    return build_job(
        {"name": "pushbelt", "model": "pushbelt"},
        "pushbelt",
        {**BELT, "most_refinements": 0, "longest_duration": values.get("duration", 0.04)} | values,
    )


@pytest.fixture(scope="module")
def records():
    """By torque at the driving pulley [N m]."""
    return {load: record(load=load) for load in TORQUES}


def record(**values):
    asked = job(**values)
    return run_point(asked, asked.point(0), lambda: None)


def test_push_changes_strands_with_the_torque(records):
    """Geier and Schindler 2007, fig. 4: low torque in t2, high torque in t1."""
    unloaded, loaded = (records[load]["mean_push_force"] for load in (0.0, 60.0))
    assert unloaded[1] > 300.0 > 50.0 > unloaded[0]
    assert loaded[0] > 300.0 > 50.0 > loaded[1]
    assert records[60.0]["largest_push_force"] >= loaded[0]


def test_forces_of_both_strands_give_the_torque(records):
    """Rings pull at the radius of their line; elements push somewhere between rocking edge and head."""
    found, radius = records[60.0], 0.063896 / 1.35
    (t1, t2), (p1, p2) = found["mean_ring_tension"], found["mean_push_force"]
    torque = found["driving_power"] / (100.0 * np.pi)
    ring = radius + 1.5e-3
    least, most = ((t2 - t1) * ring + (p1 - p2) * height for height in (radius, ring + 4e-3))
    assert least < torque < most
    assert torque == pytest.approx(60.0, rel=0.03)  # the driven pulley is still set right


def test_power_balance_closes_with_falling_friction_and_damping():
    found = record(load=60.0, friction_gradient=-0.4, transverse_damping=1e6)
    assert found["status"] == Status.DONE and found["unsolved_share"] == 0.0
    assert found["belt_loss"] > 0.004 * found["driving_power"]
    assert abs(found["power_residual"]) < 5e-3  # of so few elements, as without damping


def test_more_torque_than_friction_carries_slips_through(records):
    found = records[200.0]
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips" in found["reason"] and found["slip"][0] < -0.05


def test_a_longer_run_goes_on_from_a_shorter_one_bit_by_bit():
    whole, shorter = (Transient(job(load=60.0, duration=t).point(0), "newton") for t in (0.068, 0.034))
    shorter.advance(shorter.samples)
    shorter.prolong(job(load=60.0, duration=0.068).point(0))
    for run in (whole, shorter):
        assert run.advance(run.samples) is None
    assert whole.done == shorter.done == whole.samples
    assert np.array_equal(whole.displacement, shorter.displacement)
    assert np.array_equal(whole.profiles["push_force"], shorter.profiles["push_force"], equal_nan=True)


def test_a_step_that_is_not_solved_fails_with_time_element_and_contact():
    found = record(load=60.0, most_iterations=2, speed_tolerance=1e-12)
    assert found["status"] == Status.FAILED_NUMERICS and found["simulated_seconds"] < 0.01
    assert "not solved, at the " in found["reason"] and " contact of element " in found["reason"]


@pytest.mark.parametrize(
    "ramp", [{"load_history": "ramp"}, {"speed_history": "ramp", "speed_start": 250.0}], ids=str
)
def test_load_and_speed_rise_along_a_ramp(ramp):
    run = Transient(job(load=40.0, duration=0.1, **ramp).point(0), "newton")
    assert run.advance(run.samples) is None
    name, first, last = (
        ("load", 0.0, 40.0) if "load_history" in ramp else ("driving_speed", 250.0, 100.0 * np.pi)
    )
    values = run.channel(name)[199:]  # from rise_time on
    assert values[0] == pytest.approx(first, abs=1e-3) and values[-1] == pytest.approx(last, rel=1e-4)
    assert np.diff(values) == pytest.approx((last - first) / (values.size - 1), rel=1e-6)
    assert run.channel("driven_speed")[-1] == pytest.approx(run.channel("driving_speed")[-1] / 1.35, rel=0.02)


def test_profiles_and_histories_agree_with_the_record(records):
    dataset = simulate(job(load=60.0))
    push, region = dataset["push_force"].values, dataset["region"].values
    for strand, mean in zip(("t1", "t2"), records[60.0]["mean_push_force"], strict=True):
        assert np.nanmean(push[region == strand]) == pytest.approx(mean, abs=30.0)
    gap, force = dataset["gap"].values, dataset["push_force"].values
    assert (gap[force > 600.0] < 1e-6).all() and np.nanmax(gap) > 1e-6
    assert np.nanmin(dataset["contact_force"].values) >= 0.0


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"elements": 60}, "elements"),
        ({"elements": 32, "coarse": True, "ratio": 2.5}, "elements"),
        ({"play": 0.012}, "play"),
        ({"thickness": 0.02}, "thickness"),
        ({"belt_length": 0.3}, "belt_length"),
        ({"element_mass": -1.0}, "element_mass"),
        ({"edge_stiffness": -1.0}, "edge_stiffness"),
        ({"play": -1e-4}, "play"),
        ({"band_high": 1500.0}, "band_high"),
        ({"driving_modal_stiffness": (1e8, -1e8)}, "driving_modal_stiffness"),
        ({"driven_modal_stiffness": (1e8,)}, "driven_modal_stiffness"),
        ({"driven_radius": 0.1}, "driven_radius"),
        ({"sheave_rate": 1e-4}, "sheave_rate"),
        ({"load_start": 1900.0, "load_history": "ramp", "step": 4.9e-5}, "step"),
        ({"step": 4.9e-5, "elements": 432}, "step"),
        ({"friction_law": "table"}, "friction_law"),
        ({"friction_gradient": -0.8, "friction_memory": 0.0}, "step"),
        ({"rise_time": 0.025}, "rise_time"),
    ],
)
def test_what_cannot_be_is_refused(values, key):
    with pytest.raises(InputError, match=key):
        job(load=60.0, **values).point(0)


def test_the_longest_step_is_that_of_the_strand():
    """Beyond pitch / sqrt(T / m) a strand's shortest waves grow; the limit named in errors keeps below that."""
    p = job(load=60.0).point(0)
    tension = record(load=60.0)["mean_ring_tension"].max()
    exact = 0.6612 / 104 * np.sqrt((1.214 + 0.2495) / tension)
    assert 0.6 * exact < string_limit(p) < exact


def test_elements_pass_as_often_as_the_belt_goes_round(records):
    """104 elements on the way around a path of 0.6612 m at the speed of the pitch line."""
    path, radius = 0.6612, 0.063896 / 1.35
    passing = records[60.0]["passing_frequency"]
    assert passing == pytest.approx(104 * 100.0 * np.pi * radius / path, rel=0.01)
