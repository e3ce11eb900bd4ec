"""Which rung answers, and that no rung says what it does not know."""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.models.auto.rules import Rung, coarse, is_passive, is_settled
from cvt_hpc.models.elastic_belt import transient
from cvt_hpc.models.elastic_belt.transient import LaneRun
from cvt_hpc.printing import outcome_lines
from cvt_hpc.simulation import (
    estimate_cost,
    lane_groups,
    pilot_share,
    record_variables,
    run_points,
    simulate,
    turns,
)
from cvt_hpc.simulation.record import MOST_TURNS
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.assessment import Occurrence
from support.outcomes import outcomes_of
from support.rungs import rung_job

# cells of the scene of the tests by what is known of them: the middle of a window, outside of all, the edge of one
VIBRATING = {"load": 120.0, "friction_gradient": -1.0}
QUIET = {"load": 60.0, "friction_gradient": -0.4}
EDGE = {"load": 90.0, "friction_gradient": -0.8}
CELLS = (VIBRATING, QUIET, EDGE)
SHARED = [variable.name for variable in record_variables(rung_job("elastic_belt"))]
OF_COST = {"core_seconds", "steps", "contact_solves"}
TABLE = {
    "friction_law": "table",
    "table_force": [1e3, 1e5],
    "table_speed": [0.0, 0.1, 1.0],
    "table_mu": [[0.08, 0.09, 0.09], [0.1, 0.1, 0.11]],
}


@cache
def records(model, **values):
    """Of all CELLS, together."""
    job = rung_job(model, duration=0.3, stations=96, step=7.6e-6, **values)
    found = run_points(job, [job.point(0) | cell for cell in CELLS], lambda: None)
    assert len(found) == len(CELLS)
    return found


def same(record, other, names):
    return all(
        np.array_equal(record[name], other[name], equal_nan=_is_number(record[name])) for name in names
    )


def _is_number(value):
    return not isinstance(value, str)


@pytest.mark.parametrize(
    ("values", "passive"),
    [
        ({"friction_gradient": 0.0}, True),
        ({"friction_gradient": 0.0, "friction_law": "coulomb"}, True),
        ({"friction_gradient": -0.01}, False),
        (TABLE, True),
        (TABLE | {"table_mu": [[0.08, 0.09, 0.09], [0.1, 0.11, 0.109]]}, False),
        ({"friction_gradient": 0.0, "question": "amplitude"}, True),
        ({"friction_gradient": 0.0, "question": "forces"}, False),
        # rigid pulleys carry 2 x 0.1 x 50 kN x 29.76 mm / cos 11 deg = 303.2 N m
        ({"friction_gradient": 0.0, "load": 151.0}, True),
        ({"friction_gradient": 0.0, "load": 152.0}, False),
        ({"friction_gradient": 0.0, "load": -152.0}, False),
        ({"friction_gradient": 0.0, "load": 90.0, "kinetic_friction": 0.06}, True),
        ({"friction_gradient": 0.0, "load": 92.0, "kinetic_friction": 0.06}, False),
        ({"friction_gradient": 0.0, "load_history": "ramp", "load_start": 152.0}, False),
        (TABLE | {"load": 121.0}, True),  # by its least coefficient, 0.08
        (TABLE | {"load": 122.0}, False),
        # a course may take the load beyond what its thrust carries
        ({"friction_gradient": 0.0, "profile_time": (0.1, 0.2), "thrust_profile": (0.1, 1.0)}, False),
    ],
)
def test_friction_that_never_falls_needs_no_run(values, passive):
    job = rung_job("auto", **values)
    assert is_passive(job.point(0)) is passive


def test_what_needs_no_run_says_nothing_but_the_class():
    job = rung_job("auto", friction_gradient=0.0)
    (record,) = run_points(job, [job.point(0)], lambda: None)
    assert (record["status"], record["vibrates"], record["rung"]) == (Status.DONE, Vibrates.NO, Rung.PASSIVE)
    assert record["steps"] == 0 and record["simulated_seconds"] == 0.0
    for variable in record_variables(job):
        if variable.dtype == "f8" and variable.name not in ("core_seconds", "simulated_seconds"):
            assert np.isnan(record[variable.name]).all(), variable.name
    alone = simulate(job)
    assert not alone.sizes.get("time")
    lines = list(outcome_lines(outcomes_of(alone)))
    assert "rung               passive" in lines and not any("nan" in line for line in lines)


def test_without_falling_friction_transients_do_not_vibrate():
    loads, stiffnesses, disturbances = (100.0, 140.0), (1.0, 1.5), (1e-6, 3e-4)
    grid = [
        {"load": load, "sheave_stiffness": stiffness, "disturbance": disturbance}
        for load in loads
        for stiffness in stiffnesses
        for disturbance in disturbances
    ]
    job = rung_job("elastic_belt", duration=0.2, stations=96, step=7.6e-6)
    points = [job.point(0) | cell | {"friction_gradient": slope} for slope in (0.0, -1.0) for cell in grid]
    verdicts = [record["vibrates"] for record in run_points(job, points, lambda: None)]
    constant, falling = verdicts[: len(grid)], verdicts[len(grid) :]
    assert set(constant) == {Vibrates.NO}
    assert falling.count(Vibrates.YES) >= 4  # the same cells, so that the first line says something


def test_half_of_what_rigid_pulleys_carry_is_carried():
    scenes = ({}, {"kinetic_friction": 0.06}, {"thrust": 30e3}, {"ratio": 1.2})
    cells = [(share, stiffness) for share in (0.5, 0.9) for stiffness in (1.0, np.inf)]
    job = rung_job("elastic_belt", duration=0.1, friction_gradient=0.0, stations=48, step=7.6e-6)
    points = []
    for scene in scenes:
        p = job.point(0) | scene
        rigid = 2.0 * p["kinetic_friction"] * p["thrust"] * p["driven_radius"] / p["ratio"]
        carried = rigid / np.cos(p["half_wedge_angle"])
        points += [p | {"load": share * carried, "sheave_stiffness": stiffness} for share, stiffness in cells]
    found = run_points(job, points, lambda: None)
    for k, scene in enumerate(scenes):
        records = found[k * len(cells) : (k + 1) * len(cells)]
        assert [record["status"] for record in records[:2]] == [Status.DONE] * 2, scene
        assert [record["vibrates"] for record in records[:2]] == [Vibrates.NO] * 2, scene
        # it is a limit of rigid pulleys, and one that means something: nine tenths of it slip through there
        assert scene == {"ratio": 1.2} or records[3]["vibrates"] == Vibrates.SLIPS, scene


@pytest.mark.slow
def test_each_cell_is_answered_by_the_cheapest_rung_that_can():
    found = records("auto", question="occurrence")
    assert [record["rung"] for record in found] == [Rung.COARSE, Rung.COARSE, Rung.FULL]
    full = records("elastic_belt")
    assert [record["vibrates"] for record in found] == [record["vibrates"] for record in full]
    for record, other in zip(found[:2], full[:2], strict=True):
        assert record["steps"] < 0.2 * other["steps"]
        assert record["margin"] >= 0.7
    assert records("auto", question="forces")[2]["margin"] == 0.0


@pytest.mark.parametrize(
    ("question", "climbed"), [("occurrence", {2}), ("amplitude", {0, 2}), ("forces", set())]
)
def test_what_climbs_is_bit_by_bit_the_full_run(question, climbed):
    found, full = records("auto", question=question), records("elastic_belt")
    names = [name for name in SHARED if name not in OF_COST]
    for k, (record, other) in enumerate(zip(found, full, strict=True)):
        assert (record["rung"] == Rung.FULL) is (k in climbed)
        assert same(record, other, names) is (k in climbed)
        if k in climbed:  # the coarse run counts as well: 90 ms by 12.5 us
            assert record["steps"] == other["steps"] + 7_200
            assert record["contact_solves"] > other["contact_solves"]


def test_coarse_forces_are_those_of_the_full_run():
    for record, other in zip(records("auto", question="forces"), records("elastic_belt"), strict=True):
        strands = other["mean_ring_tension"].max()
        # 0.1 % in the middle of the map; 1 % where the push changes strands
        assert record["mean_push_force"] == pytest.approx(other["mean_push_force"], abs=0.01 * strands)
        assert record["mean_ring_tension"] == pytest.approx(other["mean_ring_tension"], abs=0.01 * strands)
        # a vibration moves axial forces by up to 3 %, and its amplitude is not that of the full run
        assert record["axial_force"] == pytest.approx(other["axial_force"], rel=0.03)


def test_runs_in_company_are_what_they_are_alone():
    job = rung_job("auto", duration=0.3, stations=96, step=7.6e-6)
    (alone,) = run_points(job, [job.point(0) | QUIET], lambda: None)
    names = [variable.name for variable in record_variables(job) if not variable.volatile]
    assert same(records("auto", question="occurrence")[1], alone, names)


@pytest.mark.parametrize(
    "values",
    [
        {"load_history": "ramp"},
        {"speed_history": "ramp"},
        {"profile_time": (0.1, 0.4), "load_profile": (0.5, 1.0)},
        {
            "duration": 0.1
        },  # three tenths of it are over before the load has risen and five periods have passed
        {"stations": 36},  # 0.6 of them are below what a mesh may have
    ],
)
def test_no_coarse_run_where_it_would_tell_nothing(values):
    assert coarse(rung_job("auto", duration=0.4).point(0)) is not None
    assert coarse(rung_job("auto", **{"duration": 0.4} | values).point(0)) is None


def occurrence(vibrates, margin):
    return Occurrence(vibrates, "", (), *[np.zeros(0)] * 8, margin=margin)


@pytest.mark.parametrize(
    ("question", "vibrates", "margin", "settled"),
    [
        ("occurrence", Vibrates.YES, 1.0, True),
        ("occurrence", Vibrates.NO, 1.0, True),
        ("occurrence", Vibrates.NO, 0.5, False),
        ("occurrence", Vibrates.YES, 0.5, False),
        ("occurrence", Vibrates.UNDECIDED, 0.0, False),
        ("amplitude", Vibrates.NO, 1.0, True),
        ("amplitude", Vibrates.YES, 9.0, False),
        ("forces", Vibrates.UNDECIDED, 0.0, True),
    ],
)
def test_what_settles_a_question(question, vibrates, margin, settled):
    point = {"question": question, "least_margin": 0.7}
    assert is_settled(point, occurrence(vibrates, margin)) is settled


def test_a_margin_beyond_reach_settles_nothing():
    assert not is_settled({"question": "occurrence", "least_margin": 50.0}, occurrence(Vibrates.YES, 1.0))


def test_nothing_is_settled_at_the_edge_of_what_undecided_means():
    point = {"question": "occurrence", "least_margin": 0.0}
    assert not is_settled(point, occurrence(Vibrates.UNDECIDED, 0.0))
    # irregular motion is an answer; of how far it goes the full run tells
    assert is_settled(point, occurrence(Vibrates.IRREGULAR, 0.0))
    assert not is_settled(point | {"question": "amplitude"}, occurrence(Vibrates.IRREGULAR, 0.0))


def test_a_coarse_run_that_is_not_to_be_trusted_decides_nothing(monkeypatch):
    job = rung_job("auto", duration=0.2, stations=96, step=7.6e-6)
    doubt = (Status.FAILED_NUMERICS, "the power balance is open")
    own = LaneRun.numerical_doubt

    def doubtful(run, record):
        return doubt if run.parameters["stations"] < 96 else own(run, record)

    monkeypatch.setattr(LaneRun, "numerical_doubt", doubtful)
    (record,) = run_points(job, [job.point(0) | QUIET], lambda: None)
    assert (record["rung"], record["vibrates"]) == (Rung.FULL, Vibrates.NO)


def test_a_full_run_that_slips_through_is_recorded_as_such():
    job = rung_job("auto", duration=0.2)
    (record,) = run_points(job, [job.point(0) | {"load": 450.0}], lambda: None)
    assert (record["status"], record["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert record["rung"] == Rung.FULL and record["slip_margin"] > 0.0
    assert 200.0 < record["slip_load"] <= 500.0
    assert "slips through" in record["reason"]
    assert np.isnan(record["amplitude"]).all() and record["core_seconds"] > 0.0


def test_runs_left_open_share_the_lanes_of_the_next_rung(monkeypatch):
    sizes = []
    own = transient.Batch

    def counted(points, stepper, paused):
        sizes.append((points[0]["stations"], len(points)))
        return own(points, stepper, paused)

    monkeypatch.setattr(transient, "Batch", counted)
    job = rung_job(
        "auto",
        {"seed": list(range(1, 18))},
        duration=0.2,
        longest_duration=0.2,
        stations=80,
        step=7.6e-6,
        **EDGE | {"load": 92.0},
    )
    (batch,) = lane_groups(job, range(17))
    # every other one is settled at once
    found = run_points(
        job, [job.point(index) | (QUIET if index % 2 else {}) for index in batch], lambda: None
    )
    assert [record["rung"] == Rung.FULL for record in found] == [index % 2 == 0 for index in batch]
    assert sizes == [(48, 16), (48, 1), (80, 9)]


def test_what_a_batch_costs_is_expected():
    auto, full = (estimate_cost(rung_job(model, duration=0.4)) for model in ("auto", "elastic_belt"))
    assert 0.1 < auto / full < 0.5  # 0.27 was measured on a whole grid


def test_a_coarse_class_that_is_not_clear_is_none():
    found, full = records("auto", question="forces"), records("elastic_belt")
    assert [record["vibrates"] for record in found[:2]] == [record["vibrates"] for record in full[:2]]
    assert found[2]["vibrates"] == Vibrates.UNDECIDED
    assert found[2]["reason"].startswith("too close for a coarse run: ")


@pytest.mark.parametrize(("runs", "groups"), [(1, 1), (16, 1), (17, 2), (256, 16)])
def test_a_batch_takes_as_many_turns_as_it_has_lanes_full(runs, groups):
    assert turns(rung_job("auto"), runs) == groups
    assert turns(rung_job("elastic_belt"), min(runs, 16)) == 1
    assert pilot_share(rung_job("auto")) == 1.0 and pilot_share(rung_job("elastic_belt")) == 0.25


def test_batches_hold_several_lanes_full():
    job = rung_job("auto", {"seed": list(range(1, 131))})
    lengths = [len(batch) for batch in lane_groups(job, range(130))]
    assert sum(lengths) == 130 and max(lengths) <= 16 * MOST_TURNS
    assert max(lengths) - min(lengths) <= 1
