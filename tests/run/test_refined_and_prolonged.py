"""Runs done again at half the step, and runs that go on: each is the run that a job would have asked for at once."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cvt_hpc.errors import InputError, NoEffectWarning
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt.general_run import GeneralTransient
from cvt_hpc.models.elastic_belt.transient import Batch, LaneRun
from cvt_hpc.models.marched import BatchOfOne
from cvt_hpc.models.oscillator.transient import Transient as Oscillator
from cvt_hpc.simulation import Interrupted, marching, run_point, run_points, simulate
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration import assessment
from support.marched import CHEAP, assert_same_bits, job, never

T = CHEAP["duration"]
# friction that does not fall leaves runs quiet, so coarse as they are
ALL = {"stations": 24, "friction_gradient": 0.0, "most_refinements": 3, "longest_duration": 4 * T}
STEP, STEPS = 12.5e-6, 4  # the longest that stands, and how many are in a sampling interval


def asked(**values):
    """A job whose runs are refined and prolonged as they are by default."""
    return job(**CHEAP | ALL | {"step": STEP, "load": 60.0} | values)


def point(**values):
    return asked(**values).point(0)


@pytest.fixture
def script(monkeypatch):
    """Tell by seed until when a run is undecided [s], and up to which number of steps it fails."""
    until: dict[int, float] = {}
    fails: dict[int, int] = {}
    doubt, assess = LaneRun.numerical_doubt, assessment.assess

    def scripted_assess(displacement, rate, strands, parameters):
        found = assess(displacement, rate, strands, parameters)
        # at the very instant a run is still decided
        open_ = len(displacement) / rate < until.get(parameters["seed"], 0.0) - 1e-9
        return replace(found, vibrates=Vibrates.UNDECIDED, reason="not yet") if open_ else found

    def scripted_doubt(run, record):
        steps = round(run.interval / run.step)
        wrong = steps <= fails.get(run.parameters["seed"], 0)
        return (Status.FAILED_NUMERICS, "too coarse") if wrong else doubt(run, record)

    monkeypatch.setattr(assessment, "assess", scripted_assess)
    monkeypatch.setattr(LaneRun, "numerical_doubt", scripted_doubt)
    return until, fails


@pytest.mark.parametrize(("step", "refinements"), [(4 * STEP, 2), (2 * STEP, 1), (STEP, 0)])
def test_a_step_that_is_too_long_is_halved_until_the_run_stands(step, refinements):
    found = run_point(asked(), point(step=step, longest_duration=T), never)
    assert (found["status"], found["refinements"]) == (Status.DONE, refinements)
    fine = run_point(asked(), point(longest_duration=T), never)
    assert found["time_step"] == fine["time_step"] == pytest.approx(STEP)
    assert found["core_seconds"] > 0.0
    for name in ("steps", "contact_solves"):
        assert (found[name] > fine[name]) is bool(refinements)  # those of the tries that failed count
    for values in (found, fine):
        values |= dict.fromkeys(("refinements", "steps", "contact_solves"), 0)
    assert_same_bits(found, fine)


def test_without_refinements_the_bare_step_is_seen():
    found = run_point(asked(), point(step=50e-6, most_refinements=0), never)
    assert (found["status"], found["refinements"]) == (Status.FAILED_NUMERICS, 0)
    assert found["time_step"] == pytest.approx(50e-6) and "steps down to" not in found["reason"]


@pytest.mark.parametrize("most", [1, 3])
def test_what_fails_at_every_step_is_recorded_with_a_remedy(script, most):
    script[1][1] = 1000
    found = run_point(asked(), point(most_refinements=most), never)
    assert (found["status"], found["refinements"]) == (Status.FAILED_NUMERICS, most)
    assert found["time_step"] == pytest.approx(T / 800 / STEPS / 2**most)
    assert found["steps"] == 800 * STEPS * (2 ** (most + 1) - 1)
    assert found["simulated_seconds"] == pytest.approx(T)
    assert found["reason"].startswith(f"at 40 ms: too coarse; failed at {most + 1} steps down to ")
    assert f"down to {found['time_step']:.3g} s: try " in found["reason"]
    assert 'try stepper = "explicit" or a finer or coarser mesh (stations)' in found["reason"]


def test_a_long_reason_leaves_room_for_the_remedy(script, monkeypatch):
    monkeypatch.setattr(LaneRun, "numerical_doubt", lambda run, record: (Status.FAILED_NUMERICS, 150 * "x "))
    found = run_point(asked(), point(most_refinements=1), never)
    assert 236 < len(found["reason"]) <= 240 and found["reason"].endswith("mesh (stations)")


@pytest.mark.parametrize(
    ("values", "times"),
    [
        ({"judged_fraction": 0.42}, 4),
        ({"judged_fraction": 0.5}, 4),
        ({"judged_fraction": 0.75}, 4),
        ({"stepper": "explicit", "step": 2.5e-7, "duration": 0.022, "rise_time": 8e-3, "band_low": 500.0}, 2),
    ],
)
def test_a_run_that_goes_on_is_the_longer_run(script, values, times):
    whole = times * values.get("duration", T)
    values = {"judged_fraction": 0.5, "longest_duration": whole} | values
    longer = values | {"duration": whole, "judged_fraction": min(values["judged_fraction"], 0.5)}
    expected = run_point(asked(**values), point(**longer), never)
    script[0][1] = whole
    found = run_point(asked(**values), point(**values), never)
    assert found["simulated_seconds"] == pytest.approx(whole)
    assert expected["status"] == Status.DONE
    assert_same_bits(found, expected)


@pytest.mark.parametrize(
    ("values", "until", "simulated"),
    [
        ({"longest_duration": T}, 1.0, T),
        ({"longest_duration": 1.99 * T}, 1.0, T),
        ({"longest_duration": 2 * T}, 1.0, 2 * T),
        ({"longest_duration": 7.9 * T}, 1.0, 4 * T),
        ({"longest_duration": 0.0}, 1.0, 4 * T),  # the default
        ({}, 2 * T, 2 * T),
        ({"load_history": "ramp"}, 1.0, T),  # the load has come to its end
        ({"speed_history": "ramp", "disturbance": 1e-4}, 1.0, T),  # and so has the speed
    ],
)
def test_how_long_a_run_goes_on(script, values, until, simulated):
    script[0][1] = until
    found = run_point(asked(), point(**values), never)
    assert found["simulated_seconds"] == pytest.approx(simulated)
    assert (found["vibrates"] == Vibrates.UNDECIDED) is (until > simulated)
    assert found["refinements"] == 0


@pytest.mark.parametrize(
    ("shortest", "certain", "simulated"),
    [
        (0.0, 0.0, 2 * T),
        (2 * T, 0.0, 2 * T),
        (T, 0.0, T),
        (1.01 * T, 0.0, 2 * T),  # half is too short
        (T, 2 * T, 2 * T),
    ],
)
def test_a_run_that_ends_early_is_the_shorter_run(monkeypatch, shortest, certain, simulated):
    ends = []

    def scripted(record, parameters, left):
        ends.append((record["simulated_seconds"], left))
        return record["simulated_seconds"] > certain - 1e-9

    monkeypatch.setattr(marching, "is_certain", scripted)
    whole = {"duration": 2 * T, "longest_duration": 2 * T}
    found = run_point(asked(), point(**whole, shortest_duration=shortest), never)
    assert found["simulated_seconds"] == pytest.approx(simulated)
    assert ends == ([pytest.approx((T, T))] if shortest == T else [])
    asked_at_once = whole | {"duration": simulated}
    assert_same_bits(found, run_point(asked(), point(**asked_at_once), never))


@pytest.mark.parametrize(
    ("verdicts", "parts"),  # at one, two and four parts of a run, and how many it takes
    [
        ((Vibrates.NO, Vibrates.YES, Vibrates.YES), 1),
        ((Vibrates.YES, Vibrates.YES, Vibrates.NO), 2),
        ((Vibrates.YES, Vibrates.NO, Vibrates.YES), 2),
        ((Vibrates.UNDECIDED, Vibrates.YES, Vibrates.NO), 4),
    ],
)
def test_a_vibration_ends_a_run_early_only_if_found_twice_in_a_row(monkeypatch, verdicts, parts):
    assess = assessment.assess

    def scripted(displacement, rate, strands, parameters):
        look = round(np.log2(len(displacement) / rate / T))
        return replace(assess(displacement, rate, strands, parameters), vibrates=verdicts[look])

    monkeypatch.setattr(assessment, "assess", scripted)
    is_decided = lambda record, *_: record["vibrates"] != Vibrates.UNDECIDED  # noqa: E731
    monkeypatch.setattr(marching, "is_certain", is_decided)
    found = run_point(asked(), point(duration=4 * T, shortest_duration=T), never)
    assert found["simulated_seconds"] == pytest.approx(parts * T)
    assert found["vibrates"] == verdicts[round(np.log2(parts))]


def test_an_odd_number_of_samples_is_halved_and_met_again(monkeypatch):
    monkeypatch.setattr(marching, "is_certain", lambda *_: False)
    whole = {"duration": 2 * T + 3 / 20e3, "longest_duration": 0.0, "judged_fraction": 0.45}
    found = run_point(asked(), point(**whole, shortest_duration=T), never)
    assert_same_bits(found, run_point(asked(), point(**whole), never))


def test_a_run_without_a_certain_verdict_reaches_its_duration_beyond_a_whole_number_of_samples(monkeypatch):
    monkeypatch.setattr(marching, "is_certain", lambda *_: False)
    whole = 2 * T + 0.4 / 20e3
    found = run_point(asked(), point(duration=whole, longest_duration=whole, shortest_duration=T), never)
    assert found["simulated_seconds"] == pytest.approx(2 * T)


def test_a_run_that_ends_early_has_been_judged_as_long_as_it_takes():
    with pytest.raises(InputError, match=r"shortest_duration: expected 0.0\d+ s or more"):
        asked(duration=4 * T, shortest_duration=0.5 * T)
    with pytest.warns(NoEffectWarning, match=r"shortest_duration \(with a duration below twice of it\)"):
        asked(duration=2 * T, shortest_duration=1.1 * T)


def test_a_history_covers_the_whole_time(script):
    script[0][1] = 2 * T
    lanes = {"precision": "single", "stations": 48}  # which fill a register
    single = asked(**lanes)
    history = simulate(single, {"seed": 1})
    assert history["time"].values[-1] == pytest.approx(2 * T) and history.sizes["time"] == 1600
    longer = simulate(asked(duration=2 * T, **lanes), {"seed": 9})
    assert not np.array_equal(history["displacement"], longer["displacement"])
    script[0].clear()
    longer = simulate(asked(duration=2 * T, **lanes), {"seed": 1})
    assert np.array_equal(history["displacement"], longer["displacement"])
    assert np.array_equal(history["push_force"], longer["push_force"])


# by seed: decided at once; later; never; refined once; always failing; slipping through; refined, then prolonged
UNTIL, FAILS = {2: 2 * T, 3: 9.0, 7: 2 * T}, {4: STEPS, 5: 1000, 7: 2 * STEPS}
POINTS = [{"seed": seed} | ({"load": 330.0} if seed == 6 else {}) for seed in range(1, 8)]


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_neighbours_that_are_refined_or_prolonged_change_nothing(script, precision):
    script[0].update(UNTIL)
    script[1].update(FAILS)
    points = [point(precision=precision, most_refinements=2, **values) for values in POINTS]
    together = run_points(asked(), points, never)
    for values, record in zip(points, together, strict=True):
        assert_same_bits(record, run_point(asked(), values, never))
    assert [record["refinements"] for record in together] == [0, 0, 0, 1, 2, 0, 2]
    times = [record["simulated_seconds"] / T for record in together]
    assert times[:5] + times[6:] == pytest.approx([1, 2, 4, 1, 1, 2])
    assert [record["status"] for record in together[4:6]] == [Status.FAILED_NUMERICS, Status.DONE]
    # other neighbours in the lanes that are filled again
    some = [points[k] for k in (6, 2, 3)]
    for record, place in zip(run_points(asked(), some, never), (6, 2, 3), strict=True):
        assert_same_bits(record, together[place])


def test_runs_that_are_left_share_lanes(script, monkeypatch):
    from cvt_hpc.models.elastic_belt import transient

    own, sizes = transient.Batch, []

    def counted(points, stepper, paused):
        sizes.append((len(points), round(points[0]["duration"] / T), bool(paused)))
        return own(points, stepper, paused)

    monkeypatch.setattr(transient, "Batch", counted)
    script[0].update({2: 2 * T, 9: 4 * T, 10: 4 * T})
    script[1].update({1: STEPS, 3: STEPS, 4: 2 * STEPS})
    run_points(asked(), [point(seed=seed) for seed in range(1, 11)], never)  # 8 lanes in double precision
    assert sizes[:2] == [(8, 1, False), (2, 1, False)]
    assert sorted(sizes[2:4]) == [(3, 1, False), (3, 2, True)]
    assert sorted(sizes[4:]) == [(1, 1, False), (2, 4, True)]


def test_an_interrupt_in_a_later_try_ends_all(script, monkeypatch):
    script[0][1] = 9.0
    begun, begin = [], Batch.__init__

    def noted(batch, *arguments):
        begun.append(batch)
        begin(batch, *arguments)

    monkeypatch.setattr(Batch, "__init__", noted)
    with pytest.raises(Interrupted, match="^SIGTERM$"):
        run_point(asked(), point(), lambda: "SIGTERM" if len(begun) > 1 else None)
    assert len(begun) == 2


def marched(run, samples):
    batch = BatchOfOne(run)
    while batch.running and run.done < samples:
        batch.advance(samples - run.done)
    assert run.failure is None
    return run


def general(duration):
    values = {"stations": 24, "duration": duration, "rise_time": 1e-3, "load": 60.0, "step": 2e-7}
    document = {"name": "test", "model": "elastic_belt", "stepper": "symplectic_euler"}
    checked = build_job(document, "test.toml", values | {"duration": 0.04}).point(0)
    return checked | {"duration": duration}


def oscillator(duration):
    document = {"name": "test", "model": "oscillator", "stepper": "moreau"}
    return build_job(document, "test.toml", {"step": 1e-5}).point(0) | {"duration": duration}


@pytest.mark.parametrize(
    ("transient", "parameters"),
    [
        (partial(GeneralTransient, stepper="symplectic_euler"), general),
        (partial(Oscillator, stepper="moreau"), oscillator),
    ],
)
def test_runs_without_lanes_go_on_as_well(transient, parameters):
    whole = marched(transient(parameters(0.0025)), 50)
    run = marched(transient(parameters(0.00125)), 25).paused()
    run.prolong(parameters(0.0025))
    marched(run, 50)
    # general steppers know no step_ripple
    assert np.array_equal(run.rows, whole.rows, equal_nan=True) and run.steps == whole.steps
    assert run.samples == 50 and np.array_equal(run.displacement, whole.displacement)
    if hasattr(run, "means"):
        for name, values in whole.means.items():
            assert np.array_equal(run.means[name], values) and np.isfinite(values).all(), name


def test_a_run_that_goes_on_and_one_that_begins_anew_share_no_lanes(script):
    # in the second turn both have the same duration and step
    script[0][1], script[1][2] = 2 * T, STEPS
    values = [{"seed": 1, "step": STEP / 2}, {"seed": 2, "duration": 2 * T}]
    points = [point(**asked_for) for asked_for in values]
    together = run_points(asked(), points, never)
    assert [record["simulated_seconds"] for record in together] == pytest.approx([2 * T, 2 * T])
    assert together[0]["time_step"] == together[1]["time_step"]
    for values, record in zip(points, together, strict=True):
        assert_same_bits(record, run_point(asked(), values, never))
