"""Sweeps that are killed, interrupted or damaged go on where they stopped, to the very same numbers."""

import json
import os
import platform
import pty
import random
import signal
import sys
import time

import numpy as np
import pytest

from cvt_hpc.study import open_results, run, sweep
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.ranks import stopping
from cvt_hpc.study.ranks.starting import SIGNALS
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.record.log import PLACE, RECORD
from support.recorded import assert_same_numbers
from support.study_double import Axis, Job, Simulator
from support.study_processes import PATIENCE, find_mpirun, wait_until

RUNS = 60


def sweep_here(out, lanes=1, **parameters):
    job = Job((Axis("load", tuple(range(RUNS))),), parameters)
    return run(job, out, simulator=Simulator(lanes=lanes), progress=False)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Return the dataset of an undisturbed serial sweep."""
    folder = tmp_path_factory.mktemp("reference")
    sweep_here(folder)
    with open_results(folder) as dataset:
        return dataset.load()


def recorded(out):
    folder = StudyFolder(out)
    return read_records(folder.records, folder.load())


def has_records(out, count=1):
    return (out / "job.json").exists() and recorded(out).recorded.sum() >= count


def frames_written(out):
    """Return the number of records in all logs, repeated ones counted each time."""
    study = StudyFolder(out).load()
    paths = out.glob("records/*.log")
    size = PLACE.size + study.record_dtype.itemsize
    return sum(path.read_bytes().count(RECORD + size.to_bytes(4, "little")) for path in paths)


@pytest.mark.parametrize(("ranks", "lanes"), [(0, 1), (2, 4)])
def test_kill_9_at_any_moment_and_resume(start, tmp_path, reference, ranks, lanes):
    options = {"out": tmp_path / "out", "runs": RUNS, "lanes": lanes}
    endless = {"from": 50, "pause": 300.0}  # so that the sweep is at work whenever the blow comes
    sweep = start({**options, "parameters": {"pause": 0.02}, "slow": endless}, ranks)
    wait_until(lambda: has_records(tmp_path / "out"), "the first record")
    time.sleep(random.uniform(0.0, 0.4))
    sweep.kill()
    sweep.process.wait()
    before = recorded(tmp_path / "out").recorded.sum()
    assert 0 < before < RUNS
    finished = start(options, ranks).finish()
    assert finished.returncode == 0, finished.stderr
    assert json.loads(finished.stdout)["done"] == RUNS
    assert frames_written(tmp_path / "out") == RUNS  # none was repeated
    with open_results(tmp_path / "out") as dataset:
        assert_same_numbers(dataset, reference)
        # of both starts
        assert dataset.attrs["history"].count(f"(on {platform.node()}, {max(ranks, 1)} rank(s))") == 2


def test_a_rank_that_dies_takes_the_sweep_down_and_the_rest_is_done_later(start, tmp_path, reference):
    options = {"out": tmp_path / "out", "runs": RUNS}
    finished = start({**options, "parameters": {"pause": 0.01, "crash_at": 20}}, ranks=2).finish()
    assert finished.returncode not in (0, 1, 2, 99)  # those that say how a sweep ended
    assert 0 < recorded(tmp_path / "out").recorded.sum() < RUNS


@pytest.mark.parametrize("name", ["SIGINT", "SIGUSR1"])
def test_a_signal_breaks_off_the_run_and_is_resumed(start, tmp_path, reference, name):
    # The run at work would take minutes: it has to be broken off, not waited for.
    options = {"out": tmp_path / "out", "runs": RUNS, "parameters": {"pause": 0.01}}
    sweep = start({**options, "slow": {"from": 25, "pause": 300.0}})
    wait_until(lambda: has_records(tmp_path / "out", 25), "25 records")
    sweep.process.send_signal(getattr(signal, name))
    finished = sweep.finish()
    assert finished.returncode == 99, finished.stderr
    facts = json.loads(finished.stdout)
    assert (facts["done"], facts["remaining"], facts["stopped"]) == (25, RUNS - 25, name)
    with open_results(tmp_path / "out") as dataset:
        assert int((dataset["status"] == 0).sum()) == RUNS - 25
    sweep_here(tmp_path / "out", pause=0.01)
    with open_results(tmp_path / "out") as dataset:
        assert_same_numbers(dataset, reference)


def test_a_batch_that_is_broken_off_leaves_no_record(start, tmp_path, reference):
    # Batches of seven: of the fourth, runs 21 to 24 are fast, and are at their end when the signal comes.
    options = {"out": tmp_path / "out", "runs": RUNS, "lanes": 7}
    sweep = start({**options, "slow": {"from": 25, "pause": 300.0}})
    wait_until(lambda: has_records(tmp_path / "out", 21), "three batches")
    time.sleep(0.1)
    sweep.process.send_signal(signal.SIGUSR1)
    finished = sweep.finish()
    assert finished.returncode == 99, finished.stderr
    assert json.loads(finished.stdout)["done"] == 21
    sweep_here(tmp_path / "out", lanes=5)  # in other batches
    assert frames_written(tmp_path / "out") == RUNS
    with open_results(tmp_path / "out") as dataset:
        assert_same_numbers(dataset, reference)


@pytest.mark.parametrize("target", ["rank 0", "mpirun"])
def test_a_signal_to_one_rank_stops_all(start, tmp_path, target):
    options = {"out": tmp_path / "out", "runs": RUNS, "parameters": {"pause": 0.01}}
    sweep = start({**options, "slow": {"from": 25, "pause": 300.0}}, ranks=2)
    wait_until(lambda: has_records(tmp_path / "out", 25), "25 records")  # both are at a slow run then
    if target == "mpirun":
        sweep.process.send_signal(signal.SIGUSR1)
    else:
        sweep.ranks()[int(target[-1])].send_signal(signal.SIGUSR1)
    finished = sweep.finish()
    assert finished.returncode == 99, finished.stderr
    facts = json.loads(finished.stdout)
    assert facts["stopped"] == "SIGUSR1"
    assert (facts["done"], facts["remaining"]) == (25, RUNS - 25)


class Signalling(Simulator):
    """A simulator whose third run gets a signal."""

    def __init__(self, number):
        super().__init__()
        self.number = number

    def run_point(self, job, point, interrupt):
        if point["load"] == 2:
            signal.raise_signal(self.number)
        return super().run_point(job, {**point, "pause": 0.01}, interrupt)


@pytest.mark.parametrize(
    ("number", "raised"),
    [(number, SystemExit) for number in SIGNALS[1:]] + [(signal.SIGINT, KeyboardInterrupt)],
)
def test_a_signal_reaches_the_script_once_the_study_is_gathered(tmp_path, number, raised):
    before = signal.getsignal(number)
    with pytest.raises(raised) as caught:
        for study in ("first", "second"):
            run(Job(), tmp_path / study, simulator=Signalling(number), progress=False)
    assert raised is KeyboardInterrupt or caught.value.code == 99
    with open_results(tmp_path / "first") as dataset:
        assert int((dataset["status"] == 1).sum()) == 2
    assert not (tmp_path / "second").exists()
    assert signal.getsignal(number) == before


def test_a_signal_that_comes_as_the_last_run_ends_reaches_the_script(tmp_path):
    job = Job((Axis("load", (0, 1, 2)),))
    simulator = Signalling(signal.SIGTERM)
    simulator.run_point = lambda job, point, interrupt: Signalling.run_point(
        simulator, job, point, lambda: None
    )
    with pytest.raises(SystemExit) as caught:
        run(job, tmp_path, simulator=simulator, progress=False)
    assert caught.value.code == 99
    with open_results(tmp_path) as dataset:
        assert (dataset["status"] == 1).all()


def test_a_hangup_that_is_ignored_stays_ignored(tmp_path):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        report = run(Job(), tmp_path, simulator=Signalling(signal.SIGHUP), progress=False)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert report.done == 12


def test_a_terminal_that_closes_ends_the_sweep_with_its_dataset(start, tmp_path):
    leader, terminal = pty.openpty()
    options = {"out": tmp_path / "out", "runs": RUNS, "slow": {"from": 25, "pause": 300.0}}
    sweep = start(options, stderr=terminal)
    os.close(terminal)
    wait_until(lambda: has_records(tmp_path / "out", 25), "25 records")
    os.close(leader)  # what is written to the terminal fails from here on
    sweep.process.send_signal(signal.SIGHUP)
    assert sweep.process.wait(PATIENCE) == 99
    assert (tmp_path / "out" / "results.nc").exists()


def test_a_signal_to_one_rank_ends_the_script_on_all(start, tmp_path):
    options = {"out": tmp_path / "out", "runs": RUNS, "sweep": {"raises": True}}
    sweep = start({**options, "slow": {"from": 25, "pause": 300.0}}, ranks=2)
    wait_until(lambda: has_records(tmp_path / "out", 25), "25 records")
    sweep.ranks()[1].send_signal(signal.SIGTERM)
    finished = sweep.finish()
    assert finished.returncode == 99
    assert "Traceback" not in finished.stderr
    assert (tmp_path / "out" / "results.nc").exists()


# The signal comes to one rank when all have agreed that there was none.
LATE = """
import signal
from cvt_hpc.study import process_rank, run
from cvt_hpc.study.ranks.stopping import SignalWatch
from support.study_double import Job, Simulator

leave = SignalWatch.__exit__

def leave_late(self, *error):
    if process_rank() == 1:
        signal.raise_signal(signal.SIGTERM)
    leave(self, *error)

SignalWatch.__exit__ = leave_late
for study in ("first", "second"):
    report = run(Job(), study, simulator=Simulator(), progress=False, raises={raises})
"""


@pytest.mark.parametrize("raises", [True, False])
def test_a_signal_that_comes_to_one_rank_after_a_study_ends_all(spawn, tmp_path, monkeypatch, raises):
    monkeypatch.chdir(tmp_path)
    program = LATE.format(raises=raises)
    finished = spawn([find_mpirun(), "-n", "2", sys.executable, "-c", program]).finish()
    assert finished.returncode == 99
    assert (tmp_path / "first" / "results.nc").exists()
    assert not (tmp_path / "second").exists()


def test_a_late_signal_to_a_rank_that_sweeps_alone_ends_no_other(tmp_path, monkeypatch):
    """Others of the same launcher may sweep for themselves."""
    leave, ended = stopping.SignalWatch.__exit__, []

    def leave_late(self, *error):
        signal.raise_signal(signal.SIGTERM)
        leave(self, *error)

    monkeypatch.setattr(stopping.SignalWatch, "__exit__", leave_late)
    monkeypatch.setattr(sweep, "end_all", lambda *told: ended.append(told))
    report = run(Job(), tmp_path / "out", simulator=Simulator(), progress=False, raises=False, comm=None)
    assert report.stopped == "SIGTERM" and not ended


EARLY = """
import signal
from cvt_hpc.study import process_rank, run
from support.study_double import Job, Simulator

class Interrupted(Simulator):
    def record_variables(self, job):
        interrupt()
        return super().record_variables(job)

def interrupt():
    if process_rank() == 1:
        signal.raise_signal(signal.SIGINT)

run(Job(), "first", simulator={simulator}(), progress=False)
interrupt()
run(Job(), "second", simulator=Simulator(), progress=False)
"""


@pytest.mark.parametrize("simulator", ["Interrupted", "Simulator"])
def test_ctrl_c_before_or_between_sweeps_ends_all_ranks_with_a_line(spawn, tmp_path, monkeypatch, simulator):
    monkeypatch.chdir(tmp_path)
    program = EARLY.format(simulator=simulator)
    finished = spawn([find_mpirun(), "-n", "2", sys.executable, "-c", program]).finish()
    assert finished.returncode == 130
    assert finished.stderr.startswith(f"cvt-hpc: rank 1 on {platform.node()}: interrupted\n")
    assert "Traceback" not in finished.stderr
    assert not list(tmp_path.glob("*/crash.log")) and not (tmp_path / "second").exists()


def test_damage_costs_only_the_runs_it_struck(start, tmp_path, reference, caplog):
    sweep_here(tmp_path)
    (log,) = (tmp_path / "records").iterdir()
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 1
    log.write_bytes(data[:-5])
    (tmp_path / "records" / "core.123").write_bytes(b"foreign")
    left = np.flatnonzero(~recorded(tmp_path).recorded)
    assert len(left) == 2
    assert sweep_here(tmp_path).done == RUNS
    assert frames_written(tmp_path) == RUNS + 2
    for complaint in ("are damaged", "unfinished record", "core.123: left out: not a record log"):
        assert complaint in caplog.text
    with open_results(tmp_path) as dataset:
        assert_same_numbers(dataset, reference)
