"""Runs at which processes die are done last, then alone, then given up; failed ones can be asked for again."""

import json
import os
import signal
import time

import numpy as np
import pytest

from cvt_hpc.study import open_results, read_status, run
from cvt_hpc.study.batches import Assignment
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.planning import given_up, plan_runs, runs_to_repeat
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.record.log import RecordFormat, RecordLog
from cvt_hpc.variables import Status
from support.study_double import Axis, Job, Simulator
from support.study_processes import wait_until

RUNS = 12
JOB = Job((Axis("load", tuple(range(RUNS))),))
ALL = np.ones(RUNS, bool)


def recorded(out):
    folder = StudyFolder(out)
    return read_records(folder.records, folder.load())


def sweep(out, job=JOB, lanes=1, slow=None, **options):
    return run(job, out, simulator=Simulator(slow, lanes=lanes), progress=False, **options)


def reason_of(out, index):
    return recorded(out).read(index, "reason").item().decode()


def test_a_run_that_kills_its_process_is_found_and_given_up(start, tmp_path):
    options = {"out": tmp_path, "runs": RUNS, "lanes": 4, "parameters": {"crash_at": 5}}
    counts, finished = [], None
    while finished is None or finished.returncode == -9:
        assert len(counts) < 9, "it is done again for ever"
        finished = start(options).finish()
        counts.append(int(recorded(tmp_path).recorded.sum()))
    # Thrice in its batch, in the end after all others; then alone after run 4, and alone after 6 and 7.
    assert counts == [4, 8, 8, 9, 11, 12]
    assert finished.returncode == 1, finished.stderr
    assert json.loads(finished.stdout)["done"] == RUNS - 1
    assert reason_of(tmp_path, 5) == "its process died 5 times, the last 2 while it did this run alone"
    with open_results(tmp_path) as dataset:
        assert dataset["status"].values[5] == Status.FAILED_ERROR
    # Asked for again, it has its attempts anew.
    finished = start({**options, "sweep": {"retry": [int(Status.FAILED_ERROR)]}}).finish()
    assert finished.returncode == -9
    records = recorded(tmp_path)
    assert (records.recorded.sum(), records.attempts[5], records.died[5]) == (RUNS - 1, 2, 1)


def test_no_innocent_run_is_given_up_with_the_one_that_kills_all_ranks(start, tmp_path):
    options = {"out": tmp_path, "runs": RUNS, "parameters": {"crash_at": 5, "pause": 0.05}}
    starts = 0
    while not (tmp_path / "results.nc").exists():
        assert starts < 9, "it is done again for ever"
        starts += 1
        finished = start(options, ranks=2).finish()
    assert finished.returncode == 1, finished.stderr
    status = recorded(tmp_path).status
    assert np.flatnonzero(status != Status.DONE).tolist() == [5]
    assert "its process died" in reason_of(tmp_path, 5)


@pytest.mark.parametrize(("name", "deaths"), [("SIGKILL", 1), ("SIGTERM", 0), ("SIGUSR1", 0)])
def test_only_a_death_counts_as_one(start, tmp_path, name, deaths):
    slow = {"from": 4, "pause": 300.0}
    at_work = start({"out": tmp_path, "runs": RUNS, "lanes": 4, "slow": slow})
    wait_until(
        lambda: (tmp_path / "job.json").exists() and recorded(tmp_path).died[4:8].sum(), "the second batch"
    )
    at_work.process.send_signal(getattr(signal, name))
    at_work.finish()
    assert recorded(tmp_path).died.tolist() == [0] * 4 + [deaths] * 4 + [0] * 4


def test_a_batch_that_ends_before_the_first_record_leaves_no_file(tmp_path):
    class Stopped(Simulator):
        def run_points(self, job, points, interrupt, more=None):
            os.kill(os.getpid(), signal.SIGTERM)
            raise self.Interrupted(interrupt())

    assert run(JOB, tmp_path, simulator=Stopped(), progress=False, raises=False).stopped == "SIGTERM"
    assert list((tmp_path / "records").iterdir()) == []


def marked(out, *marks, records=()):
    """Return the records of a folder in which processes have died at some batches."""
    sweep(out, time_limit=0.0)
    study = StudyFolder(out).load()
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    for number, (batch, alone) in enumerate(marks):
        session = {"id": str(number), "started": 1.0 + number, "versions": {}, "git_revision": ""}
        log = RecordLog(out / "records", layout, session, rank=0)
        log.begin(batch, alone=alone)  # and never closed
        if batch in records:
            log.append([(index, study.pack_failure("x")) for index in batch])
    return recorded(out)


def test_the_plan_puts_the_suspicious_last(tmp_path):
    together, alone = False, True
    records = marked(
        tmp_path,
        ((0, 1, 2, 3), together),
        *[((4, 5), together)] * 3,
        *[((7, 8, 9), together)] * 3,
        ((8,), alone),
        ((10,), together),
        records=[(10,)],
    )
    assert records.died.tolist() == [1, 1, 1, 1, 3, 3, 0, 3, 4, 3, 0, 0]
    assert records.died_alone.tolist() == [0] * 8 + [1] + [0] * 3
    assert plan_runs(JOB, Simulator(lanes=4), records, ALL, ranks=1) == [
        Assignment((6, 11), joins=True),
        Assignment((0, 1, 2, 3)),
        *[Assignment((index,), alone=True) for index in (4, 5, 7, 9)],
        Assignment((8,), alone=True),
    ]


def test_runs_that_have_killed_alone_are_claimed_as_one(tmp_path):
    marks = [((1, 2, 3), False)] * 3 + [((1,), True), ((3,), True)]
    plan = plan_runs(JOB, Simulator(), marked(tmp_path, *marks), ALL, ranks=4)
    assert plan[-2:] == [Assignment((2,), alone=True), Assignment((1, 3), alone=True)]
    assert plan[-1].parts() == [Assignment((1,), alone=True), Assignment((3,), alone=True)]


def test_only_the_runs_asked_for_are_planned_retried_and_given_up(tmp_path):
    marks = [((1, 2), False)] * 3 + [((1,), True), ((2,), True)] * 2 + [((4, 5), False)]
    records = marked(tmp_path, *marks, records=[(4, 5)])
    asked = np.isin(np.arange(12), (1, 4, 6))
    plan = plan_runs(JOB, Simulator(), records, asked, 1)
    planned = [index for assignment in plan for index in assignment.runs]
    assert sorted(planned) == [1, 6]
    assert list(given_up(records, asked)) == [1]
    assert runs_to_repeat(records, asked, [Status.FAILED_ERROR]).tolist() == [4]


def test_a_copied_log_is_no_further_death(tmp_path):
    marked(tmp_path, ((1,), False))
    (log,) = (tmp_path / "records").iterdir()
    log.with_name("copy.log").write_bytes(log.read_bytes())
    assert recorded(tmp_path).died[1] == 1


def test_a_run_beyond_its_limit_is_timed_out_and_costs_its_batch_nothing(tmp_path, caplog):
    slow = {"from": 11, "pause": 300.0}
    report = sweep(tmp_path, lanes=4, slow=slow, run_limit=0.05)
    assert (report.done, report.remaining, report.exit_status) == (11, 0, 1)
    (failed,) = report.failed
    assert (failed.index, failed.status) == (11, "timed_out")
    assert failed.reason == "took longer than the limit of 0.05 s for a run"
    assert caplog.records == []
    with open_results(tmp_path) as dataset:
        assert dataset["status"].values[11] == Status.TIMED_OUT
    # It is on record, and not done again until asked for.
    assert len(sweep(tmp_path).failed) == 1


def test_compiling_kernels_is_no_part_of_a_run(tmp_path, monkeypatch):
    class Compiling(Simulator):
        """Takes an hour before it asks for the first time, and a second after it."""

        now = 0.0

        def run_point(self, job, point, interrupt):
            for seconds in (3600.0, 1.0):
                self.now += seconds
                if reason := interrupt():
                    raise self.Interrupted(reason)
            return super().run_point(job, point, interrupt)

    simulator = Compiling()
    monkeypatch.setattr(time, "monotonic", lambda: simulator.now)
    for out, limit, done in (("ample", 2.0, RUNS), ("scarce", 0.5, 0)):
        report = run(JOB, tmp_path / out, simulator=simulator, progress=False, run_limit=limit)
        assert (report.done, len(report.failed)) == (done, RUNS - done)


def test_groups_that_a_batch_does_one_after_the_other_have_the_limit_each(tmp_path, monkeypatch, caplog):
    class InTurn(Simulator):
        """Two seconds for each pair of runs."""

        now = 0.0

        def turns(self, job, runs):
            return -(-runs // 2)

        def run_points(self, job, points, interrupt, more=None):
            for _ in range(-(-len(points) // 2)):
                interrupt()
                self.now += 2.0
                if reason := interrupt():
                    raise self.Interrupted(reason)
            return super().run_points(job, points, interrupt)

    simulator = InTurn(lanes=RUNS)
    monkeypatch.setattr(time, "monotonic", lambda: simulator.now)
    for out, limit, done in (("ample", 2.1, RUNS), ("scarce", 1.9, 0)):
        report = run(JOB, tmp_path / out, simulator=simulator, progress=False, run_limit=limit)
        assert report.done == done
        assert not caplog.records


def test_a_batch_beyond_the_limit_whose_runs_are_not_is_pointed_out(tmp_path, caplog):
    class Crowded(Simulator):
        def run_points(self, job, points, interrupt, more=None):
            while len(points) > 1 and not (reason := interrupt()):
                pass
            if len(points) > 1:
                raise self.Interrupted(reason)
            return super().run_points(job, points, interrupt)

    report = run(JOB, tmp_path, simulator=Crowded(lanes=RUNS), progress=False, run_limit=0.01)
    assert report.done == RUNS
    assert "done together, took longer than the limit of 0.01 s for a run; none of them does" in caplog.text


def test_retry_does_runs_of_a_status_again_and_the_later_record_counts(tmp_path):
    job = Job((Axis("load", tuple(range(RUNS))),), {"raise_at": 3, "diverge_at": 5})
    sweep(tmp_path, job, slow={"from": 11, "pause": 300.0}, run_limit=0.05)
    report = sweep(tmp_path, job, retry=[Status.TIMED_OUT])
    assert [failed.index for failed in report.failed] == [3, 5]
    records = recorded(tmp_path)
    assert records.warnings == []  # that the numbers are others is what was wanted
    assert records.attempts.tolist() == [1] * 11 + [2]
    with open_results(tmp_path) as dataset:
        assert dataset["status"].values[11] == Status.DONE
        assert dataset["reason"].values[11] == ""
    sweep(tmp_path, job, retry=[Status.FAILED_ERROR, Status.FAILED_NUMERICS])
    assert recorded(tmp_path).attempts.tolist() == [1, 1, 1, 2, 1, 2] + [1] * 5 + [2]


def test_a_retry_that_was_stopped_goes_on_with_the_same_command(tmp_path):
    sweep(tmp_path, slow={"from": 10, "pause": 300.0}, run_limit=0.02)
    report = sweep(tmp_path, retry=[Status.TIMED_OUT], time_limit=0.0)
    assert (report.done, report.remaining, report.exit_status) == (10, 2, 98)
    assert read_status(tmp_path).left == 2
    with open_results(tmp_path) as dataset:
        assert (dataset["status"].values[10:] == Status.NOT_RUN).all()
    report = sweep(tmp_path, retry=[Status.TIMED_OUT])
    assert (report.done, report.remaining) == (RUNS, 0)
    assert recorded(tmp_path).attempts.max() == 2


def test_a_retry_that_goes_on_does_not_begin_again(tmp_path):
    class Ended(Simulator):
        def run_point(self, job, point, interrupt):
            if point["load"] == 11:
                os.kill(os.getpid(), signal.SIGTERM)
            return super().run_point(job, point, interrupt)

    slow = {"from": 10, "pause": 300.0}
    again = {"retry": [Status.TIMED_OUT], "run_limit": 0.02}
    sweep(tmp_path, slow=slow, run_limit=0.02)
    report = run(JOB, tmp_path, simulator=Ended(slow), progress=False, raises=False, **again)
    assert (report.remaining, report.stopped) == (1, "SIGTERM")
    sweep(tmp_path, **again)
    records = recorded(tmp_path)
    assert records.attempts[10:].tolist() == [2, 2]
    assert records.status[10:].tolist() == [Status.TIMED_OUT, Status.DONE]
    sweep(tmp_path, **again)  # and once all are on record, it does
    assert recorded(tmp_path).attempts[10:].tolist() == [3, 2]


def test_a_retry_on_two_ranks(start, tmp_path):
    sweep(tmp_path, Job(JOB.axes, {"raise_at": 3}))
    again = {"parameters": {"raise_at": 3}, "sweep": {"retry": [int(Status.FAILED_ERROR)]}}
    assert start({"out": tmp_path, "runs": RUNS, **again}, ranks=2).finish().returncode == 1
    records = recorded(tmp_path)
    assert records.recorded.all()
    assert records.attempts.tolist() == [1] * 3 + [2] + [1] * 8


@pytest.mark.parametrize("rank", [0, 1])
def test_survivors_of_a_dead_rank_finish_the_sweep(start, tmp_path, rank):
    options = {"out": tmp_path, "runs": 60, "parameters": {"pause": 0.05}}
    sweep = start(options, ranks=3, tolerant=True)
    wait_until(
        lambda: (tmp_path / "job.json").exists() and recorded(tmp_path).recorded.sum() > 5, "some runs"
    )
    sweep.ranks()[rank].kill()
    finished = sweep.finish()
    assert json.loads(finished.stdout)["done"] == 60, finished.stderr
    assert "a rank has died; 2 go on" in finished.stderr
    records = recorded(tmp_path)
    assert records.recorded.all()
    assert [session["ranks"] for session in records.sessions] == [3, 2]


def test_survivors_give_up_a_run_that_keeps_killing(start, tmp_path):
    options = {"out": tmp_path, "runs": RUNS, "parameters": {"pause": 0.05, "crash_at": 5}}
    finished = start(options, ranks=7, tolerant=True).finish()
    assert json.loads(finished.stdout)["failed"] == 1, finished.stderr
    assert "its process died 5 times" in reason_of(tmp_path, 5)
