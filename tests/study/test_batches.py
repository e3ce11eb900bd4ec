"""Batches of runs: full where there is enough to do, no idle ranks where there is not, and no trace in the results."""

import logging
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.study import open_results, run
from cvt_hpc.study.batches import batch_cost, share_out
from cvt_hpc.study.forecast.cost_model import CostModel
from cvt_hpc.study.record.log import RECORD, RecordLog
from cvt_hpc.variables import Status
from support.recorded import assert_same_numbers
from support.study_double import Axis, Job, Simulator

RUNS = 20


def chunks(count, lanes):
    return [tuple(range(count)[i : i + lanes]) for i in range(0, count, lanes)]


def shared(groups, ranks, costs=None):
    costs = np.ones(1 + max(index for group in groups for index in group)) if costs is None else costs
    return share_out(groups, np.asarray(costs), ranks)


@pytest.mark.parametrize(
    ("runs", "ranks", "sizes"),
    [
        (160, 2, [16] * 10),  # enough for all: full lanes
        (64, 4, [16] * 4),
        (66, 4, [16] * 4 + [2]),
        (8, 4, [2] * 4),  # full ones would keep one rank busy and three waiting
        (20, 4, [6, 5, 5, 4]),
        (3, 4, [1] * 3),
        (1, 4, [1]),
        (20, 1, [16, 4]),
    ],
)
def test_batches_are_full_or_as_many_as_ranks(runs, ranks, sizes):
    assert [len(batch) for batch in shared(chunks(runs, 16), ranks)] == sizes


@given(st.lists(st.integers(1, 16), max_size=12), st.integers(1, 40))
def test_every_run_is_in_one_batch_and_no_batch_in_two_groups(sizes, ranks):
    ends = np.cumsum(sizes)
    groups = [tuple(range(end - size, end)) for size, end in zip(sizes, ends, strict=True)]
    batches = share_out(groups, np.ones(sum(sizes)), ranks)
    assert sorted(index for batch in batches for index in batch) == list(range(sum(sizes)))
    assert all(any(set(batch) <= set(group) for group in groups) for batch in batches)
    if len(groups) >= ranks:
        assert sorted(batches) == groups
    else:
        # all at once, and no cut further than to runs of which each has its own rank
        assert len(batches) <= ranks
        assert all(len(batch) > 0 for batch in batches)
        largest = max(map(len, batches), default=1)
        finer = sum(-(-size // (largest - 1)) for size in sizes) if largest > 1 else ranks + 1
        assert finer > ranks


def test_the_longest_run_comes_first_and_of_equal_ones_the_fullest_batch():
    groups = [(0, 1), (2,), (3, 4), (5, 6, 7)]
    costs = [1.0, 2.0, 9.0, 2.0, 3.0, 3.0, 1.0, 1.0]
    assert shared(groups, 1, costs) == [(2,), (5, 6, 7), (3, 4), (0, 1)]


def sweep(out, lanes, job=None, simulator=Simulator):
    job = job or Job((Axis("load", tuple(range(RUNS))),))
    return run(job, out, simulator=simulator(lanes=lanes), progress=False)


@pytest.mark.parametrize("lanes", [2, 7, 32])
def test_results_do_not_depend_on_the_batches(tmp_path, lanes):
    sweep(tmp_path / "singles", 1)
    report = sweep(tmp_path / "batches", lanes)
    assert (report.done, report.remaining) == (RUNS, 0)
    with open_results(tmp_path / "singles") as one, open_results(tmp_path / "batches") as other:
        assert_same_numbers(other, one)


def test_runs_of_a_batch_are_recorded_together(tmp_path, monkeypatch):
    written = []
    append = RecordLog.append
    monkeypatch.setattr(
        RecordLog,
        "append",
        lambda log, records: written.append([i for i, _ in records]) or append(log, records),
    )
    sweep(tmp_path, 8)
    assert written == [list(range(8)), list(range(8, 16)), list(range(16, 20))]


class Listening(Simulator):
    """Notes the runs of each batch, by their value on the axis."""

    def __init__(self, **options):
        super().__init__(**options)
        self.batches = []

    def run_points(self, job, points, interrupt):
        self.batches.append([point["load"] for point in points])
        return super().run_points(job, points, interrupt)


def batches_of(out, lanes, job=None, simulator=Listening):
    """Sweep and return the report and the batches that were done."""
    listening = simulator(lanes=lanes)
    report = sweep(out, lanes, job, lambda lanes: listening)
    return report, listening.batches


def test_a_sweep_starts_with_the_batch_that_is_predicted_to_take_longest(tmp_path):
    class Uneven(Listening):
        def run_costs(self, job):
            return np.where(np.arange(12) == 6, 2.0, 1.0)

    _, batches = batches_of(tmp_path, 4, Job((Axis("load", tuple(range(12))),)), Uneven)
    assert batches == [[4, 5, 6, 7], [0, 1, 2, 3], [8, 9, 10, 11]]


def test_a_run_that_raises_costs_its_batch_nothing(tmp_path):
    job = Job((Axis("load", tuple(range(12))),), {"raise_at": 6, "diverge_at": 5})
    report, batches = batches_of(tmp_path, 4, job)
    assert batches == [[0, 1, 2, 3], [4, 5, 6, 7], [4], [5], [6], [7], [8, 9, 10, 11]]
    diverged, raised = report.failed
    assert (diverged.index, diverged.status) == (5, "failed_numerics")
    assert (raised.index, raised.status) == (6, "failed_error")
    assert raised.reason == "ZeroDivisionError: the driven pulley stands still"
    assert report.done == 10


def test_a_batch_that_fails_without_a_culprit_is_pointed_out(tmp_path, caplog):
    class Crossed(Listening):
        def run_points(self, job, points, interrupt):
            records = super().run_points(job, points, interrupt)
            if self.batches[-1] == [0, 1, 2]:
                raise FloatingPointError("lanes are crossed")
            return records

    report, batches = batches_of(tmp_path, 3, simulator=Crossed)
    assert report.done == RUNS
    assert batches[:4] == [[0, 1, 2], [0], [1], [2]]
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert record.message == (
        "runs 0, 1, 2, done together, raised FloatingPointError: lanes are crossed; none of them does alone"
    )


def test_a_culprit_is_reported_as_a_failed_run_and_not_twice(tmp_path, caplog):
    sweep(tmp_path, 4, Job((Axis("load", tuple(range(12))),), {"raise_at": 6}))
    assert caplog.records == []


def test_a_batch_that_is_interrupted_while_it_is_done_one_by_one_keeps_what_is_done(tmp_path, caplog):
    class Stopped(Simulator):
        def run_points(self, job, points, interrupt):
            if len(points) == 1 and points[0]["load"] == 6:
                raise self.Interrupted("SIGTERM")
            return super().run_points(job, points, interrupt)

    job = Job((Axis("load", tuple(range(8))),), {"raise_at": 7})
    report = sweep(tmp_path, 4, job, simulator=Stopped)
    assert (report.done, len(report.failed), report.remaining) == (6, 0, 2)
    assert caplog.records == []  # nobody knows yet whether there is a culprit


def test_a_defective_record_costs_its_own_run_only(tmp_path):
    class Defective(Listening):
        def run_points(self, job, points, interrupt):
            records = super().run_points(job, points, interrupt)
            return [
                r | {"steps": "many"} if p["load"] == 5 else r for r, p in zip(records, points, strict=True)
            ]

    report, batches = batches_of(tmp_path, 10, simulator=Defective)
    assert len(batches) == 2  # nothing is done again
    (failed,) = report.failed
    assert (failed.index, failed.reason[:10]) == (5, "ValueError")
    with open_results(tmp_path) as dataset:
        assert int((dataset["status"] == Status.DONE).sum()) == RUNS - 1


def test_a_batch_with_a_record_too_few_is_no_batch(tmp_path):
    class Forgetful(Listening):
        def run_points(self, *arguments):
            records = super().run_points(*arguments)
            return records[:-1] if len(records) > 1 else records

    report, batches = batches_of(tmp_path, 10, simulator=Forgetful)
    assert report.done == RUNS
    assert len(batches) == 2 + RUNS


def test_runs_are_counted_not_batches(tmp_path, capsys):
    job = Job((Axis("load", tuple(range(12))),), {"raise_at": 6})
    run(job, tmp_path, simulator=Simulator(lanes=5), progress=True)
    assert capsys.readouterr().err.startswith("12/12 runs (100.0%), 1 failed, ")


def test_the_rest_of_a_sweep_is_grouped_anew(tmp_path):
    job = Job((Axis("load", tuple(range(12))),))
    sweep(tmp_path, 5, job)
    (log,) = (tmp_path / "records").iterdir()
    frames = [found.start() for found in re.finditer(RECORD, log.read_bytes())]
    with log.open("r+b") as file:
        for index in (2, 7, 9):
            file.seek(frames[index])
            file.write(b"\0")
    _, batches = batches_of(tmp_path, 5, job)
    assert batches == [[2, 7, 9]]


@pytest.mark.parametrize(
    ("runs", "ranks", "sizes"),
    [
        (512, 1, [256, 256]),  # at most 16 turns of 16 runs
        (512, 4, [64] * 8),  # two batches for each rank
        (190, 1, [95, 95]),
        (190, 3, [32, 32, 32, 32, 31, 31]),
        (190, 12, [16] * 10 + [15] * 2),  # turns are not cut as long as ranks have one each
        (190, 13, [16] * 10 + [15] * 2),
        (190, 24, [8] * 22 + [7] * 2),
    ],
)
def test_batches_have_as_many_turns_as_leave_two_for_each_rank(runs, ranks, sizes):
    groups, turns = chunks(runs, 256), lambda count: -(-count // 16)
    batches = share_out(groups, np.ones(runs), ranks, turns)
    assert sorted(map(len, batches), reverse=True) == sizes
    assert sorted(index for batch in batches for index in batch) == list(range(runs))


def test_a_batch_of_more_turns_is_predicted_to_take_longer():
    turns = lambda count: -(-count // 2)  # noqa: E731
    costs = np.array([1.0, 1.0, 1.0, 0.6, 0.6, 0.6, 1.5])
    assert batch_cost((0, 1), costs, turns) == 1.0 and batch_cost((0, 1, 2), costs, turns) == 2.0
    groups = [(3, 4, 5), (6,), (0, 1, 2)]
    assert share_out(groups, costs, 1, turns) == [(0, 1, 2), (6,), (3, 4, 5)]
    model = CostModel(costs, turns=turns)
    model.learn((0, 1, 2), 6.0)
    assert model.fit.likely() == pytest.approx(3.0)
