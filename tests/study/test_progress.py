"""What one can see of a sweep: its bar or lines, and its status from the folder alone."""

import contextlib
import json
import logging
import math
import os
import pty
import re
import termios
import time

import numpy as np
import pytest

from cvt_hpc.storage.locks import locked
from cvt_hpc.storage.provenance import new_session
from cvt_hpc.study import read_status, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.ranks.progress import Counter, Progress, Steps, show_duration
from cvt_hpc.study.record.log import RecordFormat, RecordLog
from cvt_hpc.variables import Vibrates
from support.study_double import Job, Simulator
from support.study_processes import wait_until


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0:00:00"), (59.6, "0:01:00"), (3599, "0:59:59"), (90061, "25:01:01")]
)
def test_durations(seconds, text):
    assert show_duration(seconds) == text


def test_status_of_a_finished_study(tmp_path):
    run(Job(parameters={"raise_at": 3}), tmp_path, simulator=Simulator(), progress=False)
    status = read_status(tmp_path)
    assert (status.name, status.total, status.done, status.failed, status.left) == ("double", 12, 11, 1, 0)
    assert not status.running
    assert status.rate > 0
    assert status.time_to_go == 0
    assert status.warnings == ()


def test_status_before_the_first_record(tmp_path):
    run(Job(), tmp_path, simulator=Simulator(), progress=False, time_limit=0.0)
    status = read_status(tmp_path)
    assert (status.done, status.left, status.rate, status.time_to_go) == (0, 12, None, None)


def test_status_of_a_running_sweep(start, tmp_path):
    sweep = start({"out": tmp_path, "runs": 10_000, "parameters": {"pause": 0.02}}, ranks=2)
    wait_until(lambda: (tmp_path / "job.json").exists() and read_status(tmp_path).done >= 20, "20 runs")
    status = read_status(tmp_path)
    assert status.running
    assert status.done + status.left == 10_000
    assert 0 < status.rate <= 100  # two ranks, at least 20 ms a run
    assert status.time_to_go == pytest.approx(status.left / status.rate)
    assert sweep.process.poll() is None


def test_rate_is_that_of_the_latest_session(tmp_path):
    run(Job(), tmp_path, simulator=Simulator(), progress=False, time_limit=0.0)
    study = StudyFolder(tmp_path).load()
    now = time.time()
    for started, indices in ((now - 1e6, range(3)), (now - 1.0, range(3, 9))):
        session = new_session(1) | {"started": started}
        layout = RecordFormat(study.fingerprint, study.record_dtype)
        with RecordLog(tmp_path / "records", layout, session, rank=0) as log:
            for index in indices:
                log.append([(index, study.pack_failure("none"))])
    # All records are of now: nine of them since the latest start, a second ago.
    status = read_status(tmp_path)
    assert 0.01 < status.rate <= 9
    assert status.left == 3


def test_a_finished_study_says_when_and_how_long_it_was_at_work(tmp_path):
    run(Job(), tmp_path, simulator=Simulator(), progress=False, time_limit=0.0)
    assert read_status(tmp_path).finished is None
    study, now = StudyFolder(tmp_path).load(), time.time()
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    undecided = Simulator().run_point(Job(), Job().point(0), lambda: None) | {"vibrates": Vibrates.UNDECIDED}
    # records take the time at which their log begins, and what has passed since then
    for began, indices in ((now - 5000.0, range(5)), (now - 100.0, range(5, 12))):
        session = new_session(1) | {"started": began - 60.0}
        with pytest.MonkeyPatch.context() as clock:
            clock.setattr("cvt_hpc.study.record.log.time.time", lambda began=began: began)
            with RecordLog(tmp_path / "records", layout, session, rank=0) as log:
                log.append([(index, study.pack(undecided)) for index in indices])
    status = read_status(tmp_path)
    assert (status.done, status.failed, status.left, status.undecided) == (12, 0, 0, 12)
    assert status.finished == pytest.approx(now - 100.0, abs=5.0)
    assert status.time_at_work == pytest.approx(2 * 60.0, abs=10.0)  # a loaded machine writes late
    with locked(StudyFolder(tmp_path).lock_file):
        assert read_status(tmp_path).finished is None


def test_time_left_is_by_predicted_costs(tmp_path, monkeypatch):
    run(Job(), tmp_path, simulator=Simulator(), progress=False, time_limit=0.0)
    study = StudyFolder(tmp_path).load()
    session = new_session(1) | {"started": time.time() - 100.0}
    with RecordLog(
        tmp_path / "records", RecordFormat(study.fingerprint, study.record_dtype), session, rank=0
    ) as log:
        log.append([(0, study.pack_failure("none"))])
    monkeypatch.setattr("cvt_hpc.study.status.rebuild_job", lambda document, source, overrides: Job())
    simulator = Simulator()
    simulator.run_costs = lambda job: np.array([2.0] + [1.0] * 11)
    monkeypatch.setattr("cvt_hpc.study.status.default_simulator", lambda: simulator)
    status = read_status(tmp_path)
    assert status.time_to_go == pytest.approx(100.0 * 11 / 2, rel=0.05)  # a loaded machine writes late
    # without a prediction all runs count the same
    monkeypatch.undo()
    assert read_status(tmp_path).time_to_go == pytest.approx(100.0 * 11, rel=0.05)


def test_status_names_damage(tmp_path):
    run(Job(), tmp_path, simulator=Simulator(), progress=False)
    (tmp_path / "records" / "notes").write_text("mine")
    (warning,) = read_status(tmp_path).warnings
    assert "notes: left out" in warning


def test_lines_where_there_is_no_terminal(start, tmp_path):
    options = {"out": tmp_path / "out", "runs": 10, "parameters": {"raise_at": 4}}
    output = start(options, ranks=2).finish().stderr.splitlines()
    lines = [line for line in output if "runs" in line]  # MPI libraries have things to say as well
    assert len(lines) == 1  # of one rank, at the end
    assert lines[0].startswith("10/10 runs (100.0%), 1 failed, ")
    assert lines[0].endswith(" runs/s")  # without a time for nothing


def test_progress_counts_all_ranks_and_earlier_sessions(capsys):
    counter = Counter()
    progress = Progress(counter, total=100, recorded=40, failed=2, visible=True, costs=np.ones(60))
    counter.report(8, failed=0)
    counter.report(3, failed=1)
    progress.show()
    assert capsys.readouterr().err == ""  # too soon after the start
    progress.close()
    assert capsys.readouterr().err.startswith("51/100 runs (51.0%), 3 failed, ")


def test_time_to_go_is_by_cost_not_by_number(capsys, monkeypatch):
    now = 1000.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    counter = Counter()
    progress = Progress(
        counter, total=5, recorded=1, failed=0, visible=True, costs=np.array([6.0, 2.0, 1.0, 1.0])
    )
    counter.report(1, failed=0)
    now += 60.0
    progress.close()
    assert capsys.readouterr().err == "2/5 runs (40.0%), 0 failed, 0.0167 runs/s, 0:00:40 to go\n"


def test_no_progress_if_not_wanted(start, tmp_path):
    options = {"out": tmp_path / "out", "sweep": {"progress": False}}
    assert start(options).finish().stderr == ""


def test_a_bar_on_a_terminal(monkeypatch):
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (25, 80))
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr("sys.stderr", terminal)
        counter = Counter()
        progress = Progress(counter, total=10, recorded=2, failed=0, visible=True, costs=np.ones(8))
        logging.getLogger("cvt_hpc.kernels").warning("compiling")
        counter.report(5, failed=5)
        progress.close()
    shown = read_terminal(ours)
    assert "\rcompiling\r\n" in shown  # on a line of its own
    assert "7/10 [" in shown
    assert re.search(r"run/s, 5 failed, 0:00:\d\d to go\]", shown)


def test_steps_tell_what_is_left_by_their_costs(monkeypatch):
    now, told = 1000.0, []
    monkeypatch.setattr(time, "monotonic", lambda: now)
    steps = Steps([6.0, math.nan, 2.0], 1, "point", told.append)  # one that is not known counts as 4
    now += 60.0
    steps.ended("first: failed", failed=True)
    now += 60.0
    steps.ended("second")
    assert told == ["2/4 first: failed, 0:01:00 to go", "3/4 second, 0:00:24 to go"]


def test_steps_stand_above_a_bar_on_a_terminal(monkeypatch):
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (25, 80))
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr("sys.stderr", terminal)
        steps = Steps([1.0, 1.0], 0, "branch", lambda line: print(line, file=terminal))
        steps.ended("one: fine")
        steps.close()
    shown = read_terminal(ours)
    assert re.search(r"\r1/2 one: fine, 0:00:\d\d to go\r\n", shown)
    assert re.search(r"1/2 \[00:\d\d, .*0 failed, 0:00:\d\d to go\]", shown)


def read_terminal(descriptor):
    """Return all that was written to a pseudo-terminal whose other end is closed."""
    parts = []
    with contextlib.suppress(OSError):  # Linux's end of file
        while part := os.read(descriptor, 100_000):
            parts.append(part)
    os.close(descriptor)
    return b"".join(parts).decode()


def test_report_is_printed_once(start, tmp_path):
    finished = start({"out": tmp_path / "out"}, ranks=2).finish()
    assert json.loads(finished.stdout)["done"] == 12
