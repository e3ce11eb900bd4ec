"""Start-ups of both pushbelts: what they follow from, that runs share them bit by bit, and that they settle."""

import math

import numpy as np
import pytest

from cvt_hpc import simulation
from cvt_hpc.experiments.chart.measuring import march
from cvt_hpc.job import build_job
from cvt_hpc.models.contract import load_model
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import of_lanes
from cvt_hpc.models.pushbelt.run import ElementRun, StartUps, fingerprint
from cvt_hpc.models.spatial_pushbelt import fields
from cvt_hpc.simulation import run_point, run_points
from cvt_hpc.study.forecast.resources import run_pilots
from cvt_hpc.variables import Status
from cvt_hpc.variator import PULLEYS

# A belt of few elements in long steps, clamped within 2 ms, of which the second half of 16 ms is judged
BELT = {"elements": 104, "step": 2e-5, "rise_time": 4e-3, "duration": 16e-3, "longest_duration": 16e-3}
BAND = {"sampling_rate": 12.5e3, "band_low": 700.0, "band_high": 1000.0, "most_refinements": 0}
CLAMPED, ALL = 25, 200  # samples


# Out of the plane, which the planar belt has no keys for
MODELS = {
    "pushbelt": {},
    "spatial_pushbelt": {"misalignment": 5e-4, "axis_tilt": 1e-3, "axis_skew": -5e-4, "disturbance": 1e-6},
}


TENSION = {"pushbelt": f.TENSION, "spatial_pushbelt": fields.TENSION}


@pytest.fixture(params=MODELS)
def model(request):
    return request.param


def job(model, axes=None, **values):
    tables = {"name": "pushbelt", "model": model} | ({"axes": axes} if axes else {})
    return build_job(tables, "pushbelt", BELT | BAND | MODELS[model] | values)


@pytest.fixture(autouse=True)
def forgotten():
    for name in MODELS:
        load_model(name).forget()


@pytest.fixture
def taken(monkeypatch):
    """The samples that runs take by marching, one after the other."""
    samples = []

    def take(self, inputs, original=ElementRun._take_sample):
        samples.append(self.done)
        original(self, inputs)

    monkeypatch.setattr(ElementRun, "_take_sample", take)
    return samples


def started(model, point):
    return load_model(model).batch([point], "newton").runs[0]


def alike(one, other):
    """Whether values are the same to the bit."""
    return fingerprint(one) == fingerprint(other)


def test_records_do_not_tell_whose_start_up_a_run_has(model, taken):
    nose = {"pushbelt": 1e-5, "spatial_pushbelt": 5e-5}[model]
    asked = job(model, {"load": [0.0, 40.0]}, nose_clearance=nose, friction_gradient=-0.2)
    points, own = [asked.point(k) for k in range(2)], []
    for point in points:
        load_model(model).forget()
        own.append(run_point(asked, point, lambda: None))
    assert taken == 2 * list(range(ALL))
    del taken[:]
    load_model(model).forget()
    shared = run_points(asked, points[::-1], lambda: None)[::-1]
    shared.append(run_point(asked, points[1], lambda: None))
    assert taken == [*range(ALL), *2 * list(range(CLAMPED, ALL))]
    for record, other in zip(shared, [*own, own[1]], strict=True):
        assert record["status"] == Status.DONE
        assert alike(*({k: v for k, v in r.items() if k != "core_seconds"} for r in (record, other)))
    assert not alike(own[0]["axial_force"], own[1]["axial_force"])


def test_a_start_up_follows_from_what_its_key_holds(model):
    """Whatever a job may set: with another value the key is another, or the start-up the same to the bit."""
    point = job(model, load=40.0).point(0)
    base = started(model, point)
    base.advance(CLAMPED)
    changes = {
        "ratio": 1.3,
        "step": 1e-5,
        "elements": 112,
        "most_iterations": 3,
        "speed_tolerance": 1e-9,
        "power_tolerance": 1e-9,
        "friction_law": "coulomb",
        "friction_gradient": -0.2,
        "nose_clearance": 1e-6,
        "driving_thrust": 15e3,
        "load_history": "ramp",
        "speed_history": "ramp",
        "sheave_stiffness": math.inf,
        "driving_modal_stiffness": (6e8, 3e8, 3e8, 9e8, 8e8),
        "driven_modal_stiffness": (6e8, 3e8, 3e8, 9e8, 8e8),
        "inner_radius": 0.01,
        "outer_radius": 1.0,
        "seed": 2,
        "driving_loose_side": "both",
        "driven_loose_side": "right",
    }
    shared = set()
    for key, value in point.items():
        if key not in changes:
            if not isinstance(value, int | float):
                continue
            changes[key] = type(value)(1.3 * value if value else 1)
        other = point | {key: changes[key]}
        run = started(model, other)
        if run.done == 0:
            continue
        shared.add(key)
        load_model(model).forget()
        own = started(model, other)
        own.advance(CLAMPED)
        assert alike(own._reached(), base._reached()), key
    assert {"load", "duration", "load_history", "speed_start", "judged_fraction"} <= shared
    entering = {"thrust", "step", "ring_mass", "kinetic_friction", "driving_speed", "strand_probes"}
    entering |= {"nose_clearance", "most_iterations", "speed_tolerance", "power_tolerance", "speed_history"}
    if model == "spatial_pushbelt":
        entering |= set(MODELS[model]) | {"seed", "flank_reach", "lean_lag", "yaw_spring", "strip_width"}
        entering |= {"driving_loose_side", "driven_loose_side", "lateral_bending_stiffness"}
    assert not shared & entering and entering <= set(changes)


@pytest.mark.parametrize(
    "scene",
    [
        {"ratio": 0.45, "thrust": 50e3, "driving_speed": 100.0, "sheave_stiffness": math.inf},
        {"ratio": 1.0, "thrust": 20e3, "driving_speed": 500.0},
        {"ratio": 2.6, "thrust": 5e3, "driving_speed": 300.0},
    ],
    ids=str,
)
@pytest.mark.parametrize(
    ("model", "offset"), [("pushbelt", {}), ("spatial_pushbelt", {"misalignment": 1.5e-3})], ids=str
)
def test_the_belt_is_clamped_at_the_ends_of_what_a_variator_does(model, offset, scene, tell):
    """All steps are solved, the rings are taut, the strands calm, and nothing slides."""
    band = {"band_low": 300.0, "band_high": 400.0}
    times = {"rise_time": 0.03, "duration": 0.12, "longest_duration": 0.12}
    asked = job(model, belt_length=0.6612, **band, **times, **scene, **offset)
    run = started(model, asked.point(0))
    assert run.advance(run._start_up) is None
    assert run.counters()["unsolved"] == 0
    assert of_lanes(run._state.elements)[:, TENSION[model]].min() > 0.0
    assert np.ptp(run.displacement[-13:], axis=0).max() < 0.2e-3  # in the last ms; 0.12 mm found
    tell("motion of strands in the last ms of a start [m]", np.ptp(run.displacement[-13:], axis=0).max())
    # a sheave that closes at a finite rate is behind its thrust; nowhere as long as half of it is missing
    axial = run.channel("axial_force driven")[-1]
    assert 0.5 * scene["thrust"] < axial < scene["thrust"]
    rims = [run.channel(f"{k}_speed")[-1] * run.channel(f"running_radius {k}")[-1] for k in PULLEYS]
    tell("speed of the driven rim over the driving one's after the start", rims[1] / rims[0], 1.0)
    # the pulley swings on the belt; of so few spatial elements by 1.8 %, of 216 by 0.5 %
    assert rims[1] == pytest.approx(rims[0], rel=0.01 if model == "pushbelt" else 0.02)


def test_a_start_up_that_fails_is_not_kept(model):
    point = job(model, most_iterations=2, speed_tolerance=1e-12).point(0)
    for _ in range(2):
        run = started(model, point)
        assert run.done == 0
        status, _ = run.advance(run.samples)
        assert status == Status.FAILED_NUMERICS and run.done < CLAMPED


def test_runs_whose_time_tells_of_others_march_their_own_start_up(model, taken):
    asked = job(model, {"load": [0.0, 40.0]})
    for _ in range(2):
        march(asked, [asked.point(0)], 1, 4e-3)
    assert taken == 2 * list(range(ALL // 4))
    del taken[:]
    run_pilots(asked, simulation, [(0,), (1,)], 2)  # a quarter of each
    assert taken == 2 * list(range(ALL // 4))


def test_the_start_ups_last_used_are_kept_as_far_as_memory_goes():
    arrays = [np.full(10, float(k)) for k in range(4)]
    kept = StartUps(most_bytes=250)
    for k in range(3):
        kept.keep(str(k), [arrays[k]])
    kept.find("0")
    kept.keep("3", [arrays[3]])
    assert kept.find("1") is None
    arrays[0][:] = -1.0  # what is kept is a copy
    assert [kept.find(str(k))[0][0] for k in (0, 2, 3)] == [0.0, 2.0, 3.0]
    kept.keep("large", [np.zeros(40)])
    assert all(kept.find(key) is None for key in ("0", "2", "3", "large"))


def test_fingerprints_tell_values_apart():
    values = [
        0.0,
        -0.0,
        0,
        [0.0],
        [[0.0]],
        np.zeros(2),
        np.zeros((2, 1)),
        np.zeros(2, int),
        "0.0",
        {"0": 0.0},
    ]
    assert len({fingerprint(value) for value in values}) == len(values)
    assert fingerprint(1.0, [2.0]) != fingerprint([1.0], 2.0)
    with pytest.raises(TypeError):
        fingerprint(lambda: 0)
