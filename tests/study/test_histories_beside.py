"""Histories of chosen runs: files beside the records, of the very runs that are recorded."""

import signal

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.study import open_results, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.log import RECORD
from cvt_hpc.variables import Status
from support.study_double import Axis, Job, Simulator, logistic_numbers
from support.study_processes import wait_until

RUNS = 12
AXES = (Axis("load", tuple(range(RUNS))),)


def sweep(out, histories, lanes=4, simulator=None, **options):
    job = Job(AXES, histories=histories, **options)
    return run(job, out, simulator=simulator or Simulator(lanes=lanes), progress=False)


def kept(out):
    return sorted(path.name for path in (out / "histories").iterdir())


def test_chosen_runs_leave_their_history_and_are_done_once(tmp_path):
    report = sweep(tmp_path, (2, 3, 9))
    assert (report.done, report.remaining) == (RUNS, 0)
    assert kept(tmp_path) == ["run-000002.nc", "run-000003.nc", "run-000009.nc"]
    with open_results(tmp_path) as results:
        for index in (2, 3, 9):
            with xr.open_dataset(StudyFolder(tmp_path).history(index)) as history:
                numbers = history["x"].values
            assert np.array_equal(numbers, logistic_numbers({"load": index}, Job(AXES)))
            assert np.array_equal(results["amplitude"].values[index], numbers[:2])
    assert sum(path.read_bytes().count(RECORD) for path in (tmp_path / "records").iterdir()) == RUNS


def test_a_history_names_the_files_that_give_parameters(tmp_path):
    sweep(tmp_path, (5,), files={"profile_file": "rig.csv"})
    with xr.open_dataset(StudyFolder(tmp_path).history(5)) as history:
        assert history.attrs["job_files"] == '{"profile_file": "rig.csv"}'


def test_no_history_where_none_is_asked_for(tmp_path):
    sweep(tmp_path, ())
    assert not (tmp_path / "histories").exists()


def test_a_history_that_is_asked_for_later_is_made_later(tmp_path):
    sweep(tmp_path, (2,))
    before = StudyFolder(tmp_path).history(2).stat().st_mtime_ns
    report = sweep(tmp_path, (2, 7))
    assert (report.done, report.remaining) == (RUNS, 0)
    assert kept(tmp_path) == ["run-000002.nc", "run-000007.nc"]
    assert StudyFolder(tmp_path).history(2).stat().st_mtime_ns == before


def test_a_failed_run_is_not_repeated_for_its_history(tmp_path):
    class Counting(Simulator):
        runs = 0

        def run_point(self, *arguments):
            self.runs += 1
            return super().run_point(*arguments)

    simulator = Counting()
    for _ in range(2):
        report = sweep(tmp_path, (3,), simulator=simulator, parameters={"raise_at": 3})
        assert [failed.index for failed in report.failed] == [3]
    assert simulator.runs == RUNS


@pytest.mark.slow
def test_a_system_that_refuses_a_history_ends_the_sweep_with_one_error(start, tmp_path):
    (tmp_path / "histories").write_text("in the way")
    options = {"out": tmp_path, "runs": RUNS, "histories": [5], "parameters": {"pause": 0.02}}
    finished = start(options, 2).finish()
    assert finished.returncode == 2, finished.stderr
    assert finished.stderr.count("error:") == 1
    assert "Traceback" not in finished.stderr
    (tmp_path / "histories").unlink()
    assert sweep(tmp_path, (5,)).done == RUNS


def test_a_kill_leaves_no_half_history(start, tmp_path):
    options = {"out": tmp_path, "runs": RUNS, "histories": list(range(RUNS))}
    sweep = start({**options, "parameters": {"pause": 0.02}, "slow": {"from": 8, "pause": 300.0}})
    wait_until(lambda: (tmp_path / "histories").is_dir() and len(kept(tmp_path)) > 2, "some histories")
    sweep.process.send_signal(signal.SIGKILL)
    sweep.finish()
    (tmp_path / "histories" / ".run-000011.nc.somewhere-1.part").write_text("half")
    run(Job(AXES, histories=tuple(range(RUNS))), tmp_path, simulator=Simulator(), progress=False)
    assert kept(tmp_path) == [f"run-{index:06d}.nc" for index in range(RUNS)]
    with open_results(tmp_path) as results:
        assert (results["status"] == Status.DONE).all()


def test_fresh_removes_histories(tmp_path):
    sweep(tmp_path, (2,))
    (tmp_path / "histories" / "mine.nc").write_text("mine")
    run(Job(AXES), tmp_path, simulator=Simulator(), progress=False, fresh=True)
    assert kept(tmp_path) == ["mine.nc"]


def test_runs_whose_histories_were_removed_are_left_and_not_failed(tmp_path, capfd):
    sweep(tmp_path, (2, 3, 9))
    for index in (2, 3):
        StudyFolder(tmp_path).history(index).unlink()
    job = Job(AXES, histories=(2, 3, 9))
    stopped = run(job, tmp_path, simulator=Simulator(lanes=4), time_limit=0.0)
    assert (stopped.done, stopped.remaining, stopped.slipping) == (RUNS - 2, 2, 0)
    assert "10/12 runs (83.3%), 0 failed" in capfd.readouterr().err
    report = run(job, tmp_path, simulator=Simulator(lanes=4))
    assert (report.done, report.remaining, report.failed) == (RUNS, 0, ())
    assert "12/12 runs (100.0%), 0 failed" in capfd.readouterr().err
