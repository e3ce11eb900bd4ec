"""The record of one run: what is declared is there, says how the run ended, and counts what it took."""

from dataclasses import replace

import numpy as np
import pytest

from cvt_hpc import simulation
from cvt_hpc.errors import InputError
from cvt_hpc.models.elastic_belt.record import MODES, VARIABLES
from cvt_hpc.simulation import Interrupted, estimate_cost, record_coordinates, record_variables, run_point
from cvt_hpc.study.description import describe
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator import judging
from cvt_hpc.vibration import ramp
from support.marched import CHEAP, finished, fresh_record, job, record

LOADED = CHEAP | {"load": 120.0}
ENDINGS = {
    "done": (LOADED, Status.DONE),
    "diverged": (LOADED | {"step": 50e-6}, Status.FAILED_NUMERICS),
    "slipped through": (CHEAP | {"load": 450.0}, Status.DONE),
}
ALONG_RAMPS = {variable.name for variable in ramp.VARIABLES}
# known of a run that has slipped through before its end
OF_THE_SLIDE = {"slip", "axial_force", "open_share", "thrust_ratio", "speed_loss"}
OF_THE_SLIDE |= {"carried_torque", "torque_ratio", "slip_margin", "slip_load"}
COST = {"core_seconds", "simulated_seconds", "time_step", "steps", "contact_solves"}


@pytest.fixture(params=ENDINGS)
def ending(request):
    """The job, the record and the expected status of a run that ends in its own way."""
    values, status = ENDINGS[request.param]
    return job(**values), record(**values), status


def test_the_verdict_comes_first_and_costs_are_volatile_where_they_must():
    variables = record_variables(job())
    names = [variable.name for variable in variables]
    assert names[:3] == ["status", "vibrates", "reason"]
    assert len(set(names)) == len(names)
    assert {v.name for v in variables if v.volatile} == {"core_seconds"}
    assert COST <= set(names)


def test_no_quantity_has_the_name_of_a_parameter():
    # every parameter may be an axis, and a dataset cannot hold both under one name
    asked = job()
    taken = {variable.name for variable in record_variables(asked)} | set(record_coordinates(asked))
    assert taken & set(asked.parameters) == set()


def test_a_record_has_what_is_declared(ending):
    asked, found, _ = ending
    sizes = {name: len(c.values) for name, c in record_coordinates(asked).items()}
    assert list(found) == [variable.name for variable in record_variables(asked)]
    for variable in record_variables(asked):
        value = np.asarray(found[variable.name])
        assert value.shape == tuple(sizes[dim] for dim in variable.dims), variable.name
        if variable.dtype.startswith("S"):
            assert len(found[variable.name].encode("ascii")) <= 240
        else:
            # nothing is lost in the type that is stored
            stored = value.astype(variable.dtype)
            assert np.array_equal(stored, value, equal_nan=variable.dtype == "f8"), variable.name


def test_a_sweep_stores_the_record(ending):
    asked, found, status = ending
    row = describe(asked, simulation).pack(found)
    assert row["status"] == status
    assert row["reason"].item().decode() == found["reason"]
    assert np.array_equal(row["spectrum"], found["spectrum"], equal_nan=True)


def test_coordinates_name_the_strands_and_reach_to_the_end_of_the_band():
    coordinates = record_coordinates(job(band_high=1000.0, spectrum_step=20.0))
    assert list(coordinates["strand"].values) == ["t1", "t2"]
    assert list(coordinates["pulley"].values) == ["driving", "driven"]
    assert list(coordinates["half_waves"].values) == list(range(1, MODES + 1))
    assert coordinates["frequency_bin"].values == pytest.approx(20.0 * np.arange(51))


def test_numbers_are_missing_only_where_a_run_failed(ending):
    asked, found, status = ending
    assert (found["status"], bool(found["reason"])) == (status, True)
    for variable in record_variables(asked):
        if variable.dtype != "f8":
            continue
        slipped = found["vibrates"] == Vibrates.SLIPS
        known = variable.name in (COST | OF_THE_SLIDE if slipped else COST)
        if status == Status.DONE and not slipped:
            known = variable.name not in {*ALONG_RAMPS, "slip_load"}
        assert np.all(np.isfinite(found[variable.name]) == known), variable.name
    if status != Status.DONE:
        assert Vibrates(int(found["vibrates"])) is not Vibrates.YES
        assert np.all(found["mode"] == 0)


def test_done_runs_have_a_verdict_of_their_own():
    assert record(**LOADED)["vibrates"] == Vibrates.YES
    assert record(**CHEAP, friction_gradient=0.0, disturbance=0.0, load=60.0)["vibrates"] != Vibrates.YES


def test_costs_are_consistent(ending):
    _, found, status = ending
    # time is a sum of steps, each rounded: 1e-16 of the whole per step, 1e5 steps at most
    assert found["steps"] * found["time_step"] == pytest.approx(found["simulated_seconds"], rel=1e-11)
    # each step solves the contact of two wraps
    assert found["contact_solves"] >= 2 * found["steps"] > 0
    assert found["core_seconds"] > 0
    if status == Status.DONE and found["vibrates"] != Vibrates.SLIPS:
        assert found["simulated_seconds"] == pytest.approx(0.04, rel=1e-11)
        default = job().parameters["step"]
        assert found["steps"] == 0.04 * 20e3 * np.ceil(1 / 20e3 / default)
    else:
        assert found["simulated_seconds"] < 0.04


@pytest.mark.parametrize(
    ("asked", "rate", "taken"),
    [
        (2.5e-6, 20e3, 20),  # 20 steps in 50 us: as asked
        (2.4e-6, 20e3, 21),
        (3e-6, 20e3, 17),
        (2.5e-6, 44.1e3, 10),  # 22.7 us: 9 steps would be 2.52 us long
        (1 / 3 * 1e-5, 20e3, 15),  # a quotient that is a whole number but for its rounding
        (4e-4, 20e3, 1),  # never more than a sampling interval
    ],
)
def test_the_step_divides_the_sampling_interval_and_is_not_longer_than_asked(asked, rate, taken):
    # a single sample of a coarse belt: nothing is judged here
    found = record(stations=24, duration=0.04, rise_time=0.01, step=asked, sampling_rate=rate, load=0.0)
    assert found["time_step"] == pytest.approx(1 / rate / taken, rel=1e-12)
    assert found["time_step"] <= asked * (1 + 1e-9)
    assert found["steps"] % taken == 0 or found["status"] != Status.DONE


@pytest.mark.parametrize("polls", [1, 3])
def test_an_interrupt_ends_a_run_with_its_text(polls):
    asked = job(**LOADED)
    answers = iter([None] * (polls - 1) + ["SIGTERM"])
    with pytest.raises(Interrupted, match="^SIGTERM$"):
        run_point(asked, asked.point(0), lambda: next(answers))
    assert next(answers, "exhausted") == "exhausted"


def test_a_run_asks_every_ten_milliseconds_of_its_time():
    asked, polls = job(**LOADED), []
    run_point(asked, asked.point(0), lambda: polls.append(None))
    # start-up, disturbance and judged part begin a new slice each
    assert len(polls) >= asked.parameters["duration"] / 0.01


@pytest.mark.parametrize("name", ENDINGS)
def test_the_same_point_gives_the_same_bits(name):
    values, _ = ENDINGS[name]
    first, second = record(**values), fresh_record(**values)
    for variable in record_variables(job()):
        if not variable.volatile:
            one, other = np.asarray(first[variable.name]), np.asarray(second[variable.name])
            assert one.tobytes() == other.tobytes(), variable.name


def test_the_explicit_stepper_gives_the_same_run():
    # without vibration, which would not stay in phase. The fast step is of first order: 0.3 % are seen while the load settles
    values = CHEAP | {"stations": 24, "load": 60.0, "friction_gradient": 0.0, "disturbance": 0.0}
    values |= {"duration": 0.022, "rise_time": 8e-3, "band_low": 500.0}
    fast, plain = record(**values), record(stepper="explicit", step=2e-7, **values)
    for name in ("mean_ring_tension", "axial_force", "driving_power", "thrust_ratio"):
        assert plain[name] == pytest.approx(fast[name], rel=0.01), name


def test_the_explicit_stepper_is_double_and_has_a_step_of_its_own():
    assert job(stepper="explicit", precision="double").parameters == job(stepper="explicit").parameters
    assert job(stepper="explicit").parameters["step"] == 4e-8
    with pytest.raises(InputError, match='precision: expected one of double, found "single"'):
        job(stepper="explicit", precision="single")


def test_the_estimated_cost_is_the_mean_over_the_grid():
    axes = {"step": [2.5e-6, 1e-6], "stations": [64, 128, 256], "load": [0.0, 50.0]}
    swept = job(axes=axes)
    each = []
    for index in range(swept.size):
        point = swept.point(index)
        each.append(estimate_cost(job(**{key: point[key] for key in axes})))
    assert estimate_cost(swept) == pytest.approx(np.mean(each))
    assert estimate_cost(job(duration=0.6)) == pytest.approx(2 * estimate_cost(job(duration=0.3)))


def test_another_seed_gives_other_numbers():
    assert np.all(record(**LOADED)["amplitude"] != record(**LOADED, seed=2)["amplitude"])


def test_modes_and_spectrum_are_those_of_the_displacement():
    # a finished run whose samples are replaced: t1 in mode 2 at 500 Hz, t2 in mode 1 at 800 Hz below a louder 100 Hz
    run = finished(**CHEAP | {"duration": 0.08}, load=100.0)
    time = (1 + np.arange(run.samples)) * run.interval
    kept = run.rows.copy()
    modes = np.zeros((run.samples, 2, MODES))
    modes[:, 0, 1] = 12e-6 * np.sin(2 * np.pi * 500 * time)
    modes[:, 0, 0] = 3e-6 * np.sin(2 * np.pi * 700 * time)
    modes[:, 1, 0] = 7e-6 * np.sin(2 * np.pi * 800 * time)
    modes[:, 1, 3] = 50e-6 * np.sin(2 * np.pi * 100 * time)
    try:
        run.rows[:, len(run.probes) : len(run.probes) + 2 * MODES] = modes.reshape(run.samples, -1)
        run.rows[:, 2] = 12e-6 * np.sin(2 * np.pi * 500 * time)
        run.rows[:, 7] = 7e-6 * np.sin(2 * np.pi * 800 * time)
        verdict = replace(judging.assess(run), strongest_probe=np.array([2, 7]))
        found = judging.finished(run, VARIABLES, verdict)
    finally:
        run.rows[:] = kept
    assert found["mode"].tolist() == [2, 1]
    # 40 ms of judged time: sines 200 Hz apart are told apart within 1 %, and the band's edges are soft over 50 Hz
    assert found["modal_amplitude"][0, :3] == pytest.approx([3e-6, 12e-6, 0.0], rel=0.01, abs=1e-12)
    assert found["modal_amplitude"][1, [0, 3]] == pytest.approx([7e-6, 0.0], rel=0.01, abs=0.02e-6)
    bins = record_coordinates(job())["frequency_bin"].values
    assert bins[found["spectrum"].argmax(axis=1)].tolist() == [500.0, 800.0]
    assert found["spectrum"].max(axis=1) == pytest.approx([12e-6, 7e-6], rel=0.01)
