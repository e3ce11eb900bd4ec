"""Runs of the spatial pushbelt whose ratio, thrust, load or speed changes, and between pulleys out of parallel."""

import numpy as np
import pytest

from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.record import judge
from cvt_hpc.models.spatial_pushbelt.transient import Transient
from cvt_hpc.physics.geometry import driven_radius
from cvt_hpc.physics.out_of_plane import axial_offset
from support.spatial_belts import job

# steps and samples as long as the belt of few elements bears
QUICK = {"step": 2e-5, "sampling_rate": 12.5e3, "band_high": 800.0}


def finished(**values):
    """A sound run, its parameters and its record."""
    point = job(**QUICK | values).point(0)
    run = Transient(point, "newton")
    assert run.advance(run.samples) is None
    record = judge(run)
    assert run.numerical_doubt(record) is None
    assert run.counters()["unsolved"] == 0 and abs(record["power_residual"]) < 3e-3
    return run, point, record


def test_profiles_take_ratio_and_axial_offset_along_with_thrust_load_and_speed(tell):
    profiles = {
        "profile_time": (0.012, 0.04),
        "ratio_profile": (1.0, 0.9),
        "thrust_profile": (1.0, 0.8),
        "load_profile": (1.0, 0.5),
        "driving_speed_profile": (1.0, 0.95),
    }
    run, point, record = finished(duration=0.06, judged_fraction=0.3, **profiles)
    half = run.channel("load")[round(0.026 / run.interval) - 1]
    assert half == pytest.approx(45.0) and run.channel("load")[-1] == pytest.approx(30.0)
    assert run.channel("driving_speed")[-1] == pytest.approx(95.0 * np.pi)
    tell("driving speed of a spatial belt [rad/s]", run.channel("driving_speed")[-1], 95.0 * np.pi)
    # what is driven takes the torque that the load is at the ratio of the start
    driven = run.channel("driven_speed")[run.judged].mean()
    assert run.mean_rate(f.WORK_OUT) == pytest.approx(1.35 * 30.0 * driven, rel=1e-3)
    # the loose sheave closes at a finite rate, and still opens after the shift
    pressed = run.channel("sheave_force driven left")
    tell("force of a spatial belt's loose sheave [N]", pressed[-50:].mean(), 0.8 * 20e3)
    assert pressed[-50:].mean() == pytest.approx(0.8 * 20e3, rel=0.03)
    ratio = 0.9 * 1.35
    radius = driven_radius(ratio, run.path.path_length, 0.155)
    tell("driving radius of a spatial belt [m]", run.channel("driving_radius")[-1], radius / ratio)
    assert run.channel("driving_radius")[-1] == pytest.approx(radius / ratio, rel=1e-12)
    assert run.channel("driving_speed")[-1] / run.channel("driven_speed")[-1] == pytest.approx(
        ratio, rel=0.02
    )
    # mid planes go along with the loose sheaves, one on each side
    moved = run.channel("driving_radius") + run.channel("driven_radius")
    moved = np.tan(point["half_wedge_angle"]) * (moved - run.path.driving_radius - run.path.driven_radius)
    offset = run.channel("axial_offset")
    assert offset == pytest.approx(moved, abs=1e-12)
    # and so by the closed form of a belt without strain, but for how deep the thrust takes that of the run: 6 um
    expected = axial_offset({**point, "ratio": ratio, "driven_radius": radius}, 1.35)
    before = offset[round(0.012 / run.interval)]
    assert expected > 6e-5 and offset[-1] - before == pytest.approx(expected, abs=1e-5)


def test_speed_rises_along_a_ramp():
    first, last = 290.0, 100.0 * np.pi
    run, _, record = finished(misalignment=5e-4, speed_history="ramp", speed_start=first, load=30.0)
    values = run.channel("driving_speed")[124:]  # from rise_time on
    assert values[0] == pytest.approx(first, abs=1e-3) and values[-1] == pytest.approx(last, rel=1e-4)
    assert np.diff(values) == pytest.approx((last - first) / (values.size - 1), rel=1e-6)
    # the driven pulley swings on the belt once the ramp begins
    assert run.channel("driven_speed")[-1] == pytest.approx(run.channel("driving_speed")[-1] / 1.35, rel=0.03)
    driving, driven = record["net_axial_force"]
    assert driving > 80.0 and driving == pytest.approx(-driven, rel=0.02)


def test_axial_forces_are_balanced_between_pulleys_out_of_parallel():
    tilt, skew = 4e-3, -2e-3
    # little damping: strands that still move sideways take a part of the balance, 1.6 % at half as long again
    run, point, record = finished(axis_tilt=tilt, axis_skew=skew, duration=0.06, transverse_damping=500.0)
    driving, driven = record["net_axial_force"]
    assert driving > 80.0
    # Along the driven axis lies a part of what the strands pull that pulley with, towards the other one
    speed = point["driving_speed"] * run.path.driving_radius
    centrifugal = (point["element_mass"] + point["ring_mass"]) * speed**2
    t1, t2 = record["mean_ring_tension"] - record["mean_push_force"] - centrifugal
    rise = (run.path.driven_radius - run.path.driving_radius) / point["centre_distance"]
    part = -tilt * np.sqrt(1.0 - rise**2) * (t1 + t2) + skew * rise * (t1 - t2)
    assert part < -15.0
    assert driving == pytest.approx(part - driven, rel=0.03)
