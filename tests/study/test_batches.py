"""Batches of runs: full where there is enough to do, no idle ranks where there is not, and no trace in the results."""

import logging
import re
import time
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.storage.files import StorageError
from cvt_hpc.study import open_results, run
from cvt_hpc.study.batches import batch_cost, share_out
from cvt_hpc.study.description import describe
from cvt_hpc.study.forecast.cost_model import CostModel
from cvt_hpc.study.ranks.launch import RankDied
from cvt_hpc.study.ranks.progress import Counter
from cvt_hpc.study.record.log import RECORD, RecordLog
from cvt_hpc.study.status import find_records
from cvt_hpc.study.sweep import Claims
from cvt_hpc.study.task import Task
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

    def run_points(self, job, points, interrupt, more=None):
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
        def run_points(self, job, points, interrupt, more=None):
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
        def run_points(self, job, points, interrupt, more=None):
            if len(points) == 1 and points[0]["load"] == 6:
                raise self.Interrupted("SIGTERM")
            return super().run_points(job, points, interrupt)

    job = Job((Axis("load", tuple(range(8))),), {"raise_at": 7})
    report = sweep(tmp_path, 4, job, simulator=Stopped)
    assert (report.done, len(report.failed), report.remaining) == (6, 0, 2)
    assert caplog.records == []  # nobody knows yet whether there is a culprit


def test_a_defective_record_costs_its_own_run_only(tmp_path):
    class Defective(Listening):
        def run_points(self, job, points, interrupt, more=None):
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


TURNS = lambda count: -(-count // 16)  # noqa: E731


@pytest.mark.parametrize(
    ("runs", "ranks", "sizes"),
    [
        (512, 1, [256, 128, 64, 32, 16, 16]),  # at most 16 turns of 16 runs
        (512, 4, [64] + [48] * 2 + [32] * 4 + [16] * 14),
        (190, 1, [95, 47, 16, 16, 16]),
        (190, 12, [16] * 10 + [15] * 2),  # turns are not cut as long as ranks have one each
        (190, 13, [16] * 10 + [15] * 2),
        (190, 24, [8] * 22 + [7] * 2),
    ],
)
def test_batches_become_smaller_towards_the_end(runs, ranks, sizes):
    batches = share_out(chunks(runs, 256), np.ones(runs), ranks, TURNS)
    assert list(map(len, batches)) == sizes
    assert sorted(index for batch in batches for index in batch) == list(range(runs))


@given(
    st.lists(st.tuples(st.integers(1, 256), st.floats(0.0, 3.0)), min_size=1, max_size=30),
    st.sampled_from([1, 2, 3, 16, 1000]),
)
def test_no_batch_takes_more_than_its_share_of_the_work_that_is_left(drawn, ranks):
    ends = np.cumsum([size for size, _ in drawn])
    groups = [tuple(range(end - size, end)) for (size, _), end in zip(drawn, ends, strict=True)]
    costs = np.concatenate([np.full(size, np.exp(level)) for size, level in drawn])
    batches = share_out(groups, costs, ranks, TURNS)
    assert sorted(index for batch in batches for index in batch) == list(range(costs.size))
    assert all(any(set(batch) <= set(group) for group in groups) for batch in batches)
    taken = [batch_cost(batch, costs, TURNS) for batch in batches]
    assert taken == sorted(taken, reverse=True)
    for batch, cost in zip(batches, taken, strict=True):
        assert TURNS(len(batch)) == 1 or cost <= 0.5 * sum(taken) / ranks * (1 + 1e-9)


class Joining(Listening):
    """Runs that others join, up to `most` turns of all lanes; notes the batches as they are in the end."""

    def __init__(self, most=3, **options):
        super().__init__(**options)
        self.most = most

    def turns(self, job, runs):
        return -(-runs // self.lanes)

    def may_join(self, job, runs, others):
        return len(runs) + len(others) <= self.most * self.lanes

    def run_points(self, job, points, interrupt, more=lambda: ()):
        points, interrupted = [*points], interrupt()
        while further := more():
            points += further
        return super().run_points(job, points, lambda: interrupted)


@pytest.mark.parametrize(("lanes", "most", "sizes"), [(4, 3, [12, 8]), (3, 16, [20]), (7, 1, [7, 7, 6])])
def test_batches_join_up_to_so_many_turns_and_leave_no_trace_in_the_results(tmp_path, lanes, most, sizes):
    sweep(tmp_path / "singles", 1)
    report, batches = batches_of(tmp_path / "joined", lanes, simulator=partial(Joining, most))
    assert list(map(len, batches)) == sizes
    assert report.done == RUNS
    with open_results(tmp_path / "singles") as one, open_results(tmp_path / "joined") as other:
        assert_same_numbers(other, one)


def test_progress_counts_the_turns_of_a_batch_that_others_join(tmp_path, monkeypatch):
    reports = []
    monkeypatch.setattr(Counter, "report", lambda self, *ended: reports.append(ended))
    batches_of(tmp_path / "sound", 4, simulator=partial(Joining, 3))
    assert reports == [(4, 0)] * 3 + [(0, 0)] + [(4, 0)] * 2 + [(0, 0)]
    reports.clear()
    job = Job((Axis("load", tuple(range(12))),), {"raise_at": 6})
    batches_of(tmp_path / "raising", 4, job, partial(Joining, 3))
    assert np.sum(reports, axis=0).tolist() == [12, 1]


LOADING = 0.5  # [s]


def test_the_time_of_a_batch_that_others_have_joined_is_on_record_from_its_beginning(tmp_path):
    class Ticking(Joining):
        loaded = False

        def run_points(self, job, points, interrupt, more=lambda: ()):
            if not Ticking.loaded:
                time.sleep(LOADING)
                Ticking.loaded = True

            def later():
                time.sleep(0.02)
                return more()

            return super().run_points(job, points, interrupt, later)

    job = Job((Axis("load", tuple(range(RUNS))),))
    sweep(tmp_path, 2, job, lambda lanes: Ticking(4, lanes=lanes))
    timings = find_records(tmp_path, job).timings
    # also of the first batch, which had to wait for its kernels
    assert [timing.batch for timing in timings] == [tuple(range(k, min(k + 8, 20))) for k in (0, 8, 16)]
    for timing, turns in zip(timings, (4, 4, 2), strict=True):
        assert turns * 0.02 - 0.005 < timing.seconds < LOADING


def test_runs_that_have_joined_are_done_one_by_one_with_the_rest_where_one_raises(tmp_path):
    job = Job((Axis("load", tuple(range(12))),), {"raise_at": 6})
    report, batches = batches_of(tmp_path, 4, job, partial(Joining, 2))
    assert batches == [[*range(8)], *([k] for k in range(8)), [8, 9, 10, 11]]
    assert (report.done, [failed.index for failed in report.failed]) == (11, [6])


def test_a_batch_that_is_stopped_after_others_have_joined_leaves_no_mark(tmp_path):
    class Stopped(Joining):
        def run_points(self, job, points, interrupt, more=lambda: ()):
            while more():
                pass
            raise self.Interrupted("SIGTERM")

    report = sweep(tmp_path, 4, simulator=lambda lanes: Stopped(lanes=lanes))
    assert (report.done, report.remaining) == (0, RUNS)
    assert list((tmp_path / "records").iterdir()) == []


def test_nothing_joins_within_a_limit_of_time_before_a_time_is_measured(tmp_path):
    job, joining = Job((Axis("load", tuple(range(RUNS))),)), Joining(16, lanes=4)
    run(job, tmp_path, simulator=joining, progress=False, time_limit=1000.0)
    sizes = list(map(len, joining.batches))
    assert sizes[0] == 4 < sizes[1] and sum(sizes) == RUNS


def test_the_batch_at_work_goes_on_where_a_rank_has_died(tmp_path, monkeypatch):
    def died(claims, may_join):
        raise RankDied("a rank is dead")

    monkeypatch.setattr(Claims, "joining", died)
    _, batches = batches_of(tmp_path, 4, simulator=partial(Joining, 16))
    assert list(map(len, batches)) == [4] * 5


def test_an_error_of_a_claim_is_no_failure_of_the_runs_at_work(tmp_path, monkeypatch):
    def refused(claims, may_join):
        raise StorageError("the disk is full")

    monkeypatch.setattr(Claims, "joining", refused)
    with pytest.raises(StorageError, match="the disk is full"):
        sweep(tmp_path, 4, simulator=lambda lanes: Joining(lanes=lanes))
    assert find_records(tmp_path, Job((Axis("load", tuple(range(RUNS))),))).recorded.sum() == 0


def test_an_error_of_the_question_whether_to_go_on_is_no_failure_of_a_run():
    """Such as that of a rank which is lost."""

    def lost():
        raise OSError("a rank is lost")

    job, simulator = Job((Axis("load", (0, 1)), Axis("pause", (0.01,)))), Simulator()
    task = Task(job, describe(job, simulator), simulator)
    with pytest.raises(OSError, match="a rank is lost"):
        list(task.do((0, 1), lost, lambda runs: None))


def test_a_batch_of_more_turns_is_predicted_to_take_longer():
    turns = lambda count: -(-count // 2)  # noqa: E731
    costs = np.array([1.0, 1.0, 1.0, 0.6, 0.6, 0.6, 1.5])
    assert batch_cost((0, 1), costs, turns) == 1.0 and batch_cost((0, 1, 2), costs, turns) == 2.0
    model = CostModel(costs, turns=turns)
    model.learn((0, 1, 2), 6.0)
    assert model.fit.likely() == pytest.approx(3.0)
