"""Runs that cannot be trusted, or do not exist, never count as quiet nor as vibrating."""

from types import SimpleNamespace

import numpy as np
import pytest

from cvt_hpc import simulation
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.transient import Batch
from cvt_hpc.models.elastic_belt.validity import FAILURES, LARGEST_POWER_RESIDUAL
from cvt_hpc.physics import compliance
from cvt_hpc.simulation import record_variables, run_point
from cvt_hpc.simulation.record import record_of
from cvt_hpc.study.description import describe
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator import GROSS_SLIP, LEAST_SPEED, MOST_SPEED
from cvt_hpc.vibration import ramp
from support.marched import CHEAP, Together, job, record

# mu_k x thrust, two flanks each, on the driven pulley's radius: 2 x 0.1 x 50 kN / cos 11 deg x 75 mm / 2.52
CARRIED = 2 * 0.1 * 50e3 / np.cos(np.deg2rad(11)) * 0.075 / 2.52
LONG_STEPS = [(0.0, 10e-6), (40.0, 10e-6), (120.0, 10e-6), (120.0, 12.5e-6)]
NARROW = [{"load": load, "friction_speed": 0.3e-3} for load in (0.0, 40.0)]
LOADS = (0.0, 40.0, 120.0, -400.0, 0.6 * CARRIED, 1.2 * CARRIED)
RUNS = Together(
    *({"load": load, "duration": 0.06} for load in LOADS),
    *(values | {"duration": 0.06} for values in NARROW),
)


def assert_no_numbers(found):
    assert found["vibrates"] == Vibrates.UNDECIDED
    for variable in record_variables(job()):
        if variable.dtype == "f8" and variable.name not in ("core_seconds", "simulated_seconds", "time_step"):
            assert np.all(np.isnan(found[variable.name])), variable.name


def test_a_run_that_failed_on_its_way_is_as_blank_as_one_that_never_computed():
    asked = build_job({"name": "test", "model": "auto", "axes": {}}, "test.toml")
    numbers = {"time": 0.0, "step": np.nan, "steps": 0, "contact_solves": 0}
    run = SimpleNamespace(failure=(Status.FAILED_ERROR, "why"), **numbers)
    study = describe(asked, simulation)
    found, never = study.pack(record_of(asked, run, 0.0)), study.pack_failure("why")
    known = {"reason", "core_seconds", "simulated_seconds"}
    for name in set(never.dtype.names) - known:
        assert found[name].tobytes() == never[name].tobytes(), name


@pytest.mark.parametrize("stations", [48, 160])
def test_a_step_far_too_long_diverges_and_says_when(stations):
    found = record(load=20.0, step=50e-6, duration=0.06, stations=stations)
    assert found["status"] == Status.FAILED_NUMERICS
    when = f"{found['simulated_seconds'] * 1e3:.4g} ms"
    assert found["reason"].startswith(
        (f"at {when}: the belt is off its path", f"at {when}: strain is beyond 5%")
    )
    # long before the end: little is computed in vain
    assert found["simulated_seconds"] < 0.01
    assert_no_numbers(found)


@pytest.mark.parametrize(("load", "step"), LONG_STEPS)
def test_a_step_that_is_too_long_fails_or_does_no_harm(load, step):
    found, trusted = record(load=load, duration=0.06, step=step), RUNS.record(load=load, duration=0.06)
    assert trusted["status"] == Status.DONE
    if found["status"] == Status.DONE:
        # of first order in the step: 0.3 % are seen
        assert found["mean_ring_tension"] == pytest.approx(trusted["mean_ring_tension"], rel=0.01)
        assert (found["vibrates"] == Vibrates.YES) == (trusted["vibrates"] == Vibrates.YES)
    else:
        assert found["status"] == Status.FAILED_NUMERICS
        assert_no_numbers(found)


def test_the_power_balance_catches_steps_that_do_not_diverge():
    # friction regularised over 0.3 mm/s: what the default step makes of it stays within bounds, and is no motion of
    # this belt
    found = [RUNS.record(**values, duration=0.06) for values in NARROW]
    caught = [f for f in found if "the power balance is open by" in f["reason"]]
    assert caught
    for f in caught:
        assert f["status"] == Status.FAILED_NUMERICS
        assert f["simulated_seconds"] == pytest.approx(0.06)
        assert float(f["reason"].split("open by ")[1].split()[0]) > LARGEST_POWER_RESIDUAL


def test_a_sound_run_without_load_passes_the_power_balance():
    # one cell closes in step with the samples: were its damper sampled, 4 % of the power would be missing
    found = record(load=0.0, step=2.5e-6, duration=0.06, band_low=300.0)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.NO)
    assert abs(found["power_residual"]) < 0.015


def test_more_torque_than_friction_carries_slips_through():
    found = RUNS.record(load=1.2 * CARRIED, duration=0.06)
    assert_slips(found)
    assert "the belt slips through: the driven pulley has lost 50% of its speed" in found["reason"]
    # physics, not numerics: half the step slips at the same time
    half = record(load=1.2 * CARRIED, duration=0.06, step=1.25e-6)
    assert_slips(half)
    assert half["simulated_seconds"] == pytest.approx(found["simulated_seconds"], rel=0.02)


def test_all_the_play_in_one_short_cell_is_slip_and_no_failure():
    # a third of a cell of 0.9 mm: no share of a cell bounds it
    found = record(load=210.0, duration=0.06, stations=96, stiffness_of="sheave", sheave_stiffness=np.inf)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)


def test_torque_that_friction_just_carries_does_not():
    below = RUNS.record(load=0.6 * CARRIED, duration=0.06)
    assert below["status"] == Status.DONE and below["vibrates"] != Vibrates.SLIPS
    # the same with the smaller axial force in place of the thrust; at 0.47 m/s friction has fallen to mu_k
    largest = CARRIED * below["axial_force"].min() / 50e3
    assert below["slip_margin"] == pytest.approx(0.6 * CARRIED / largest - 1.0, abs=1e-4)
    assert np.abs(below["slip"]).max() < 0.03


def test_a_load_that_drives_beyond_what_friction_carries_slips_through():
    found = RUNS.record(load=-400.0, duration=0.06)
    assert_slips(found)
    assert "the belt slips through: the driven pulley has gained 50% of its speed" in found["reason"]
    assert found["slip"][0] > GROSS_SLIP and found["speed_loss"] < -GROSS_SLIP


def test_gross_slip_to_the_end_of_a_run_is_found_by_its_size():
    # a window of some 4 N m below the largest torque, 212 N m, in which the belt slides on steadily on rigid sheaves
    values = {
        "sheave_stiffness": np.inf,
        "stiffness_of": "sheave",
        "stations": 96,
        "step": 7.6e-6,
        "precision": "single",
    }
    found = record(load=208.0, duration=0.3, **values)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert found["reason"].startswith("the driving pulley slips by 0.0")
    assert found["simulated_seconds"] == pytest.approx(0.3) and abs(found["power_residual"]) < 0.02
    assert -found["slip"][0] > GROSS_SLIP and -0.15 < found["slip_margin"] < 0.0


def assert_slips(found):
    """A run that ended early: the slide is told, and no vibration."""
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert found["simulated_seconds"] < 0.06 and np.isnan(found["amplitude"]).all()
    assert found["slip_margin"] > 0.0 and np.abs(found["slip"]).max() > GROSS_SLIP
    assert (found["axial_force"] > 1e4).all() and abs(found["speed_loss"]) > GROSS_SLIP


def poisoned(monkeypatch, spoil, when=100, **values):
    """The record of a run whose state is spoiled after some samples."""
    advance = Batch.advance

    def spoiling(batch, samples):
        if batch.done >= when:
            spoil(batch)
        return advance(batch, min(samples, 50))  # however fast the machine is

    monkeypatch.setattr(Batch, "advance", spoiling)
    asked = job(**CHEAP, load=60.0, **values)
    return run_point(asked, asked.point(0), lambda: None)


def set_field(row, value, station=5, lane=0):
    def spoil(batch):
        batch.state.fields.data[station, row, lane] = value

    return spoil


def set_scalar(index, value):
    def spoil(batch):
        batch.state.scalars.data[0, index] = value

    return spoil


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("row", range(7))
def test_a_state_that_is_not_a_number_never_reaches_a_done_record(monkeypatch, row, value):
    found = poisoned(monkeypatch, set_field(row, value))
    assert found["status"] == Status.FAILED_NUMERICS
    assert found["simulated_seconds"] < 0.011  # spoiled within 10 ms: found at the next sample
    assert_no_numbers(found)


@pytest.mark.parametrize("index", [lf.SPEED, lf.POSITION])
def test_nor_does_a_pulley_that_is_nowhere(monkeypatch, index):
    found = poisoned(monkeypatch, set_scalar(index, np.nan))
    assert found["status"] == Status.FAILED_NUMERICS
    assert_no_numbers(found)


@pytest.mark.parametrize(("stepper", "step"), [("imex", 4.6e-6), ("explicit", 2e-7)])
def test_a_search_for_the_closed_stations_that_does_not_end_ends_the_run(monkeypatch, stepper, step):
    # forces below no round-off: there is no station on whose side the search can settle
    def spoil(batch):
        batch.state.contacts[1].scalars.data[0, compliance.ROUND_OFF] = -np.inf

    found = poisoned(monkeypatch, spoil, stepper=stepper, step=step)
    assert found["status"] == Status.FAILED_NUMERICS
    assert "the search for the closed stations of belt and sheaves did not end" in found["reason"]
    assert found["simulated_seconds"] < 0.011
    assert_no_numbers(found)


def test_a_power_balance_that_is_not_a_number_is_no_balance(monkeypatch):
    # the judged part is complete, and one of its powers is spoiled
    def spoil(batch):
        batch.rows.data[500, -3] = np.nan  # before the stored energy and step_ripple

    found = poisoned(monkeypatch, spoil, when=600)
    assert found["status"] == Status.FAILED_NUMERICS
    assert_no_numbers(found)


def test_done_records_are_numbers_throughout():
    for load in (0.0, 60.0, 120.0):
        found = record(**CHEAP, load=load)
        assert found["status"] == Status.DONE
        along_ramps = {"slip_load"} | {variable.name for variable in ramp.VARIABLES}
        for variable in record_variables(job()):
            if variable.dtype == "f8" and variable.name not in along_ramps:
                assert np.all(np.isfinite(found[variable.name])), variable.name


def test_every_outcome_of_a_march_has_a_status_and_a_reason():
    assert set(FAILURES) == set(Outcome) - {Outcome.OK}
    for status, reason in FAILURES.values():
        assert status in (Status.FAILED_NUMERICS, Status.DONE)
        assert reason.isascii() and len(reason) < 200
    assert 0 < LEAST_SPEED < 1 < MOST_SPEED
