"""Runs that advance together: each is bit by bit what it is alone, and what becomes of one is no other's business."""

import weakref
from functools import cache

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import PARAMETERS
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state
from cvt_hpc.models.elastic_belt.grouping import ALONE_SHARE, SHARED, cost, lane_key
from cvt_hpc.models.elastic_belt.lane_belt import parts_of
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.transient import Batch
from cvt_hpc.physics import compliance
from cvt_hpc.simulation import lane_groups, run_point, run_points
from cvt_hpc.simulation.record import MOST_TURNS
from cvt_hpc.variables import Status, Vibrates
from support.fast_runs import FastRuns
from support.marched import CHEAP, assert_same_bits, job, never

WIDTHS = {"double": 8, "single": 16}
METHODS = {
    "double": {"stepper": "imex", "precision": "double"},
    "single": {"stepper": "imex", "precision": "single"},
    "explicit": {"stepper": "explicit", "precision": "double", "step": 2.5e-7, "stations": 24}
    | {"duration": 0.022, "rise_time": 8e-3, "band_low": 500.0},
}
SHORT = CHEAP | {"stations": 40}
# Of all that may differ between the lanes of a batch, and of all endings.
DIFFERENT = [
    {"load": 120.0},
    {"load": 60.0, "seed": 3},
    {"load": 450.0},  # slips through
    {"load": 100.0, "sheave_stiffness": np.inf, "stiffness_of": "sheave"},
    {"load": 100.0, "friction_gradient": -1.2, "friction_speed": 0.02},
    {"load": 80.0, "half_wedge_angle": 0.21, "thrust": 40e3, "element_damping": 30.0},
    {"load": -60.0, "driving_speed": 250.0, "ring_friction": 0.05},
    {"load": 40.0, "bending_stiffness": 0.5, "element_mass": 1.2, "friction_memory": 1e-4},
]


def of(method):
    """A job by that method."""
    return job(**SHORT | METHODS[method])


def points(method):
    """As many as a batch takes."""
    settings = METHODS[method]
    rounds = WIDTHS[settings["precision"]] // len(DIFFERENT)
    return [
        job(**SHORT | values | settings | {"disturbance": 1e-6 * (1 + k)}).point(0)
        for k in range(rounds)
        for values in DIFFERENT
    ]


@cache
def together(method):
    """Records of the batch."""
    return run_points(of(method), points(method), never)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_records_are_those_of_the_runs_alone(method):
    records, asked = together(method), points(method)
    # each of the different scenes once, in all places of a register
    for k, values in enumerate(DIFFERENT):
        place = (k % 2) * 8 % len(asked) + k
        assert asked[place]["load"] == values["load"]
        assert_same_bits(records[place], run_point(of(method), asked[place], never))
    ends = [record["status"] for record in records]
    slips = [record["vibrates"] == Vibrates.SLIPS for record in records]
    assert slips.count(True) == len(records) // 8 and ends.count(Status.DONE) >= 7
    assert len({float(record["driving_power"]) for record in records if record["status"] == Status.DONE}) >= 6


@pytest.mark.parametrize("method", ["double", "explicit"])
def test_a_batch_that_is_not_full_gives_the_same_in_the_order_of_its_points(method):
    chosen = [6, 2, 0]
    records = run_points(of(method), [points(method)[k] for k in chosen], never)
    for k, record in zip(chosen, records, strict=True):
        assert_same_bits(record, together(method)[k])


@pytest.mark.parametrize(("method", "value"), [("double", np.nan), ("double", np.inf), ("explicit", np.nan)])
def test_a_run_that_is_not_a_number_fails_alone(monkeypatch, method, value):
    advance, spoiled = Batch.advance, 4

    def spoiling(batch, samples):
        if batch.done >= 300:
            batch.state.fields.data[5, f.W, spoiled] = value
        return advance(batch, samples)

    monkeypatch.setattr(Batch, "advance", spoiling)
    records = run_points(of(method), points(method), never)
    assert len(records) == len(points(method)) > spoiled
    for k, record in enumerate(records):
        if k == spoiled:
            assert record["status"] == Status.FAILED_NUMERICS
            assert "off its path" in record["reason"] or "not a number" in record["reason"]
            assert 0.015 < record["simulated_seconds"] < 0.021
            assert np.isnan(record["amplitude"]).all()
        else:
            assert_same_bits(record, together(method)[k])


def spoiled_lanes(lanes):
    """Eight runs of which five are given a state out of bounds, each in its own way."""
    parameters = job(**SHORT, load=60.0).point(0)
    belt = belt_constants(parameters)
    states = [initial_state(parameters, belt) for _ in range(lanes)]
    states[1].fields[f.W, 30] = np.nan
    states[2].fields[f.W, 30] = 0.011
    states[3].fields[f.N_RING, 7] *= 0.9
    states[4].scalars[f.DRIVEN_SPEED] *= 0.4
    states[6].scalars[f.DRIVEN_SPEED] *= 1.6
    runs = FastRuns([belt] * lanes, states)
    runs.lanes.contacts[1].scalars.data[0, compliance.UNSOLVED, 5] = 1.0
    return runs


def test_an_outcome_is_that_of_the_lane_concerned():
    runs = spoiled_lanes(8)
    runs.advance(0, 1e-6)
    assert [runs.outcome(lane) for lane in range(8)] == [
        Outcome.OK,
        Outcome.NOT_FINITE,
        Outcome.LEFT_THE_GROOVES,
        Outcome.OVERSTRAINED,
        Outcome.SLIPPED_THROUGH,
        Outcome.NO_CONTACT_SOLUTION,
        Outcome.RAN_AWAY,
        Outcome.OK,
    ]


def test_the_first_outcome_counts():
    runs = spoiled_lanes(8)
    runs.advance(0, 1e-6)
    before = [runs.outcome(lane) for lane in range(8)]
    runs.lanes.fields.data[3, f.W] = np.nan
    runs.advance(0, 1e-6)
    after = [runs.outcome(lane) for lane in range(8)]
    assert after[1:7] == before[1:7]
    assert {after[k] for k in (0, 7)} == {Outcome.NOT_FINITE}


@pytest.mark.parametrize("method", ["double", "explicit"])
def test_work_is_counted_until_the_run_ends(method):
    values = METHODS[method] | {"friction_speed": 0.01}
    batch = Batch(
        [job(**SHORT | values | {"load": load}).point(0) for load in (120.0, 450.0)], values["stepper"]
    )
    while batch.running:
        batch.advance(1000)
    through, slipped = batch.runs
    assert slipped.failure is not None and slipped.steps < through.steps == round(through.time / batch.step)
    for run in batch.runs:
        assert run.counters()["steps"] == run.steps
        assert run.counters()["contact_solves"] == run.contact_solves > run.steps
    repeats = batch.state.scalars.data[0, lf.REPEATS]
    if method == "explicit":
        assert set(through.counters()) == {"steps", "contact_solves"}
    else:
        assert through.counters()["repeats"] == repeats[0] > 0
        assert 0 < slipped.counters()["repeats"] < repeats[1]


def test_parts_are_as_many_as_divide_the_stations_and_long_enough_for_bending():
    found = {stations: parts_of(stations, 16) for stations in (160, 48, 40, 32, 100, 161)}
    assert found == {160: 16, 48: 16, 40: 8, 32: 8, 100: 4, 161: 1}


def test_a_run_in_parts_goes_on_bit_by_bit():
    settings = SHORT | METHODS["single"] | {"stations": 48, "load": 120.0, "lanes": "stations"}
    whole, short = (
        Batch([job(**settings | {"duration": duration}).point(0)], "imex")
        for duration in (2 * SHORT["duration"], SHORT["duration"])
    )
    for batch in (whole, short):
        while batch.running:
            batch.advance(333)
    going_on = Batch(whole.points, "imex", [short.runs[0].paused()])
    while going_on.running:
        going_on.advance(200)
    assert np.array_equal(going_on.runs[0].rows, whole.runs[0].rows)


def test_the_cost_follows_from_what_the_lanes_hold():
    parameters = points("single")[0] | {"lanes": np.array(["runs", "stations"])}
    for stepper, share in ALONE_SHARE.items():
        runs, stations = cost(parameters, stepper)
        assert stations == pytest.approx(share * runs) and share < 1.0


def test_a_batch_goes_with_the_last_of_its_runs():
    batch = Batch(points("double"), "imex")
    kept, runs = weakref.ref(batch), batch.runs
    del batch
    assert kept() is runs[0].batch
    del runs  # at once, without waiting for the collector of circles: a batch holds megabytes
    assert kept() is None


def test_a_batch_takes_no_more_than_a_register():
    for method in ("double", "explicit"):
        with pytest.raises(ValueError, match="1 to 8 runs"):
            Batch(points(method)[:1] * 9, METHODS[method]["stepper"])


def test_stations_in_lanes_make_the_same_steps():
    settings = SHORT | METHODS["single"] | {"stations": 48, "load": 120.0}
    several = Batch([job(**settings).point(0)] * WIDTHS["single"], "imex")
    alone = Batch([job(**settings, lanes="stations").point(0)], "imex")
    # with 48 stations a part begins at the second station of the driven arc, whose memory the first one feeds
    for batch in (several, alone):
        batch.advance(1)
    round_off = 2e-5  # of 11 steps
    for field in range(7):
        values = several.state.fields.data[:, field, 0]
        seen = alone.state.fields.data[:, field, 0]
        assert np.abs(seen - values).max() <= round_off * np.abs(values).max(), field
    for samples in (3, 1):
        for batch in (several, alone):
            batch.advance(samples)
            batch.state.fields.data[20:24, f.U] += 0.05  # on the strand, a wave that opens gaps
    for field in range(7):
        values = several.state.fields.data[:, field, 0]
        seen = alone.state.fields.data[:, field, 0]
        # elements that meet multiply round-off, the more without damping; a wrong neighbour changes the first digit
        tolerance = 2e-3
        assert np.abs(seen - values).max() <= tolerance * np.abs(values).max(), field
    last, other = several.runs[0].rows[-1], alone.runs[0].rows[-1]
    np.testing.assert_allclose(other, last, rtol=0, atol=tolerance * np.abs(last).max())
    assert alone.runs[0].counters()["contact_solves"] == several.runs[0].counters()["contact_solves"]


AXES = {
    "friction_law": ["stribeck", "coulomb"],
    "friction_memory": [0.0, 0.3e-3, 1e-3],
    "load": [0.0, 40.0, 80.0, 120.0, 160.0],
    "precision": ["double", "single"],
    "stations": [48, 64],
}


@pytest.mark.parametrize("stepper", ["imex", "explicit"])
def test_groups_hold_each_run_once_and_only_what_is_alike(stepper):
    axes = {k: v for k, v in AXES.items() if k != "precision" or stepper == "imex"}
    # explicit runs of a longer step than their own: so long that no group is cut for its cost
    step = {"step": 1e-7} if stepper == "explicit" else {}
    asked = job(stepper=stepper, axes=axes, friction_gradient=0.0, **step)
    indices = np.random.default_rng(0).permutation(asked.size).tolist()
    groups = lane_groups(asked, indices)
    assert sorted(index for group in groups for index in group) == sorted(indices)
    for group in groups:
        all_points = [asked.point(index) for index in group]
        assert len({lane_key(point) for point in all_points}) == 1
        for key in ("friction_law", "stations", "precision"):
            assert len({point[key] for point in all_points}) == 1, key
        assert len({point["friction_memory"] > 0 for point in all_points}) == 1
        assert len(group) <= MOST_TURNS * WIDTHS[all_points[0]["precision"]]
        # in the order in which they were given
        places = [indices.index(index) for index in group]
        assert places == sorted(places)
    # as few as can be: those without memory and with, of each law, mesh and precision
    assert len(groups) == 2 * 2 * 2 * {"imex": 2, "explicit": 1}[stepper]
    assert lane_groups(asked, indices) == groups


def test_single_precision_gives_the_same_vibration():
    coarse = {"stations": 64, "duration": 0.16}
    found = {
        precision: run_points(
            job(),
            [job(**coarse, load=load, precision=precision).point(0) for load in (0.0, 60.0, 120.0)],
            never,
        )
        for precision in WIDTHS
    }
    for one, other in zip(found["double"], found["single"], strict=True):
        assert (one["status"], other["status"]) == (Status.DONE, Status.DONE)
        assert other["vibrates"] == one["vibrates"]
        # a hundredth of what closes the balance of a loaded belt, a tenth of the mesh's part: 2e-5 are seen
        assert other["power_residual"] == pytest.approx(one["power_residual"], abs=1e-4)
    # round-off rings the strands of a quiet belt by some nm, where nothing is left of the start in double precision
    silent, quiet, vibrating = found["single"]
    assert np.all(found["double"][0]["amplitude"] < 1e-10) and np.all(silent["amplitude"] < 1e-8)
    assert quiet["amplitude"] == pytest.approx(found["double"][1]["amplitude"], abs=1e-8)
    # the same limit cycle, out of phase: windows scatter by 2-7 %
    assert vibrating["vibrates"] == Vibrates.YES
    assert vibrating["amplitude"] == pytest.approx(found["double"][2]["amplitude"], rel=0.05)
    assert vibrating["frequency"] == pytest.approx(found["double"][2]["frequency"], rel=0.01)


def test_runs_of_a_batch_share_their_mesh():
    assert set(PARAMETERS["mesh"]) <= set(SHARED)
