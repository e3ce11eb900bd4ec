"""Sweeps: the same numbers on any number of ranks, failures as rows, orderly ends."""

import json
import time

import pytest

from cvt_hpc.job import load_job
from cvt_hpc.study import open_results, run
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.record.index import read_records
from cvt_hpc.variables import Status
from support.recorded import assert_same_numbers
from support.study_double import Axis, Coordinate, Job, Simulator


def sweep(job, out, **options):
    return run(job, out, simulator=options.pop("simulator", Simulator()), progress=False, **options)


def test_a_finished_sweep_repeats_nothing(tmp_path):
    class Counting(Simulator):
        runs = 0

        def run_point(self, *arguments):
            self.runs += 1
            return super().run_point(*arguments)

    simulator = Counting()
    job = Job(parameters={"raise_at": 3, "diverge_at": 5})
    for _ in range(2):  # failed runs are finished as well: they would fail again
        report = sweep(job, tmp_path, simulator=simulator)
        assert (report.done, len(report.failed), report.remaining) == (10, 2, 0)
        assert simulator.runs == 12
    sweep(job, tmp_path, simulator=simulator, fresh=True)
    assert simulator.runs == 24


def test_failed_runs_are_reported_with_reasons(tmp_path):
    report = sweep(Job(parameters={"raise_at": 3, "diverge_at": 5}), tmp_path)
    assert report.exit_status == 1
    raised, diverged = report.failed
    assert (raised.index, raised.at, raised.status) == (3, {"load": 3}, "failed_error")
    assert raised.reason == "ZeroDivisionError: the driven pulley stands still"
    assert (diverged.index, diverged.at, diverged.status) == (5, {"load": 5}, "failed_numerics")
    assert diverged.reason == "step 17: the state is not finite"


def test_all_done_is_exit_status_0(tmp_path):
    assert sweep(Job(), tmp_path).exit_status == 0


@pytest.mark.parametrize(
    ("defect", "complaint"),
    [
        ({"amplitude": [1.0, 2.0, 3.0]}, "ValueError: amplitude: expected shape (2,), found (3,)"),
        ({"amplitude": 1.0}, "ValueError: amplitude: expected shape (2,), found ()"),
        ({"speed": 1.0}, "ValueError: a record needs"),
        ({"steps": "many"}, "ValueError: invalid literal"),
        ({"status": Status.NOT_RUN}, "ValueError: a run that ended has the status not_run"),
    ],
)
def test_a_defective_record_is_a_failed_run(tmp_path, defect, complaint):
    class Defective(Simulator):
        def run_point(self, *arguments):
            return {**super().run_point(*arguments), **defect}

    report = sweep(Job(axes=()), tmp_path, simulator=Defective())
    assert report.failed[0].reason.startswith(complaint)


@pytest.mark.parametrize("lanes", [1, 64])  # one batch would hold all runs, and leave a rank without any
def test_two_ranks_give_the_numbers_of_a_serial_run(start, tmp_path, lanes):
    faults = {"raise_at": 7, "diverge_at": 30}
    options = {"runs": 60, "parameters": {"pause": 0.004, **faults}}
    shared = start({"out": tmp_path / "shared", "lanes": lanes, **options}, ranks=2)
    serial = sweep(Job((Axis("load", tuple(range(60))),), faults), tmp_path / "serial")
    finished = shared.finish()
    assert (serial.exit_status, finished.returncode) == (1, 1), finished.stderr
    assert serial.done == json.loads(finished.stdout)["done"] == 58
    assert len(list((tmp_path / "shared" / "records").iterdir())) == 2  # both ranks have computed
    with open_results(tmp_path / "serial") as one, open_results(tmp_path / "shared") as two:
        assert_same_numbers(two, one)
        assert ", 2 rank(s))" in two.attrs["history"]


@pytest.mark.parametrize("ranks", [0, 2])
def test_a_full_disk_is_one_clear_error_and_loses_nothing(start, tmp_path, ranks):
    options = {"out": tmp_path / "out", "runs": 60, "parameters": {"pause": 0.002}}
    finished = start({**options, "largest_file": 8000}, ranks).finish()
    assert finished.returncode == 2, finished.stderr
    errors = [line for line in finished.stderr.splitlines() if line.startswith("error:")]
    assert len(errors) == 1
    assert (
        "expected to be able to write, found: File too large. The runs recorded so far are kept" in errors[0]
    )
    assert "Traceback" not in finished.stderr
    entry = json.loads((tmp_path / "out" / "job.json").read_text())
    records = read_records(tmp_path / "out" / "records", Study.from_json(entry))
    assert 5 <= records.recorded.sum() < 60
    assert records.warnings == []
    # space again
    sweep(Job((Axis("load", tuple(range(60))),), options["parameters"]), tmp_path / "out")
    sweep(Job((Axis("load", tuple(range(60))),)), tmp_path / "clean")
    with open_results(tmp_path / "out") as one, open_results(tmp_path / "clean") as two:
        assert_same_numbers(one, two)


def test_time_limit_ends_claiming_and_the_rest_comes_later(tmp_path, monkeypatch):
    class Late(Simulator):
        def run_point(self, job, point, interrupt):
            if point["load"] == 4:
                late = time.monotonic() + 2000.0
                monkeypatch.setattr("cvt_hpc.study.ranks.stopping.time.monotonic", lambda: late)
            return super().run_point(job, point, interrupt)

    report = sweep(Job(), tmp_path, simulator=Late(), time_limit=1000.0)
    monkeypatch.undo()
    assert (report.done, report.remaining) == (5, 7)  # the run at work was finished
    assert (report.stopped, report.exit_status) == ("time limit", 99)
    report = sweep(Job(), tmp_path)
    assert (report.done, report.stopped, report.exit_status) == (12, None, 0)


def test_other_versions_are_pointed_out(tmp_path, monkeypatch, caplog):
    sweep(Job(), tmp_path, time_limit=0.0)
    sweep(Job(), tmp_path)
    assert "other versions" not in caplog.text
    monkeypatch.setattr("cvt_hpc.storage.provenance.versions", lambda: {"numpy": "99"})
    sweep(Job(), tmp_path)
    assert "other versions" in caplog.text


def test_a_real_job_fits(write_job, tmp_path):
    path = write_job(
        '[scene]\nthrust = "20 kN"\n[axes]\nload = {from = 0, to = 20, count = 3}\n'
        'sheave_stiffness = [1, inf]\nload_history = ["constant", "ramp"]\nstations = [40, 80]\nrefined = [false, true]\n'
    )
    job = load_job(path)
    report = sweep(job, tmp_path / "out")
    assert (report.total, report.done) == (48, 48)
    with open_results(report.results) as dataset:
        assert dataset["status"].sizes == {
            "load": 3,
            "sheave_stiffness": 2,
            "load_history": 2,
            "stations": 2,
            "refined": 2,
        }
        assert dataset["load"].attrs["units"] == "N m"
        assert dataset["refined"].dtype == bool
        assert json.loads(dataset.attrs["job"]) == job.resolved()
        for index in range(job.size):
            point = job.point(index)
            found = dataset.sel({axis.name: point[axis.name] for axis in job.axes})
            expected = Simulator().run_point(job, point, lambda: None)
            assert found["amplitude"].values.tobytes() == expected["amplitude"].tobytes()


def test_a_study_comes_back_from_its_file():
    class Rigid(Simulator):
        def record_coordinates(self, job):
            return {**super().record_coordinates(job), "layer": Coordinate([1, float("inf")], "1", "layer")}

    axes = (Axis("a", (1, 2)), Axis("b", (0.1, float("inf"))), Axis("c", ("inf", "x")))
    study = describe(Job(axes), Rigid())
    again = Study.from_json(json.loads(json.dumps(study.to_json(), allow_nan=False)))
    assert again.axes == study.axes
    assert again.coordinates == study.coordinates
    assert again.record_dtype == study.record_dtype
    assert again.to_json() == study.to_json()
    assert [again.place(i) for i in range(8)] == [study.place(i) for i in range(8)]
