"""A study of more values or further axes goes on from the runs of the smaller one, and loses none of them."""

import json
import os
from functools import partial

import numpy as np
import pytest
import xarray as xr

from cvt_hpc import build_job
from cvt_hpc.errors import InputError
from cvt_hpc.storage.locks import locked
from cvt_hpc.study import gather, open_results, read_status, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.job_difference import places_in
from cvt_hpc.variables import Status
from support.recorded import assert_same_numbers
from support.study_double import Axis, Job, Simulator, logistic_numbers

SMALL = Job((Axis("load", (1, 2, 5)), Axis("ratio", (0.5, 2.0))), histories=(0, 5))
# values before, between and behind those that were, which lie in another order
LARGE = Job((Axis("load", (0, 5, 2, 3, 1, 9)), Axis("ratio", (0.5, 1.0, 2.0))), histories=(5, 12))
OSCILLATOR = {"name": "grows", "model": "oscillator", "run": {"duration": 0.2}}


class Counting(Simulator):
    """Keeps the points that it is asked for."""

    def __init__(self):
        super().__init__(lanes=4)
        self.points = []

    def run_points(self, job, points, interrupt, more=None):
        self.points += points
        return super().run_points(job, points, interrupt)


def sweep(job, out, **options):
    return run(job, out, simulator=options.pop("simulator", None) or Counting(), progress=False, **options)


def results(out):
    with open_results(out) as dataset:
        return dataset.load()


def assert_whole(out, job):
    """Assert that all runs of a job are on record and in the dataset, and chosen histories are of their runs."""
    found = results(out)
    for index in range(len(found["status"].values.ravel())):
        point = job.point(index)
        expected = logistic_numbers(point, job)[:2]
        assert np.array_equal(found["amplitude"].sel(point).values, expected), point
    for index in job.histories:
        with xr.open_dataset(StudyFolder(out).history(index)) as history:
            assert np.array_equal(history["x"].values, logistic_numbers(job.point(index), job))


def test_more_values_in_any_place_keep_all_runs(tmp_path, caplog):
    sweep(SMALL, tmp_path)
    simulator = Counting()
    report = sweep(LARGE, tmp_path, simulator=simulator)
    assert (report.done, report.gained, report.remaining) == (18, 12, 0)
    old = [SMALL.point(index) for index in range(6)]
    assert len(simulator.points) == 12 and not [point for point in simulator.points if point in old]
    assert "the study grows from 6 to 18 runs, which have new numbers" in caplog.text
    assert_whole(tmp_path, LARGE)
    assert sorted(path.name for path in (tmp_path / "histories").iterdir()) == [
        "run-000005.nc",
        "run-000012.nc",
    ]
    status = read_status(tmp_path)
    assert (status.total, status.done, status.left, status.warnings) == (18, 18, 0, ())
    assert sweep(LARGE, tmp_path, simulator=simulator).gained == 0 and len(simulator.points) == 12
    (tmp_path / "results.nc").unlink()
    gather(tmp_path)
    assert_whole(tmp_path, LARGE)


def test_a_study_grows_twice_and_its_retries_count(tmp_path):
    steered = {"raise_at": 2}
    sweep(Job(SMALL.axes, steered), tmp_path)
    sweep(Job(SMALL.axes, steered), tmp_path, retry=[Status.FAILED_ERROR])
    sweep(Job((Axis("load", (1, 2, 3, 5)), SMALL.axes[1]), steered), tmp_path)
    job = Job(LARGE.axes, steered)
    assert sweep(job, tmp_path).gained == 10
    records = StudyFolder(tmp_path).read_records(StudyFolder(tmp_path).load())
    assert records.attempts.reshape(6, 3).tolist() == [[1, 1, 1]] * 2 + [[2, 1, 2]] + [[1, 1, 1]] * 3
    assert not records.warnings
    assert len(sweep(job, tmp_path, retry=[Status.FAILED_ERROR]).failed) == 3


@pytest.mark.slow
def test_a_kill_at_any_moment_loses_no_run(tmp_path):
    """Kill at each file that is renamed, and go on with the old job as long as the new one is not there."""
    kills = 0
    for place in range(1, 30):
        out = tmp_path / str(place)
        sweep(SMALL, out)
        if not _is_killed(partial(sweep, LARGE, out), place):
            break
        kills += 1
        grown = json.loads((out / "job.json").read_text())["fingerprint"] == LARGE.fingerprint()
        if not grown:
            simulator = Counting()
            sweep(SMALL, out, simulator=simulator)
            assert simulator.points == []
            assert_whole(out, SMALL)
        simulator = Counting()
        assert sweep(LARGE, out, simulator=simulator).remaining == 0
        assert not [point for point in simulator.points if point in map(SMALL.point, range(6))]
        assert_whole(out, LARGE)
    # of the old job, 2 histories aside, of the new job, 2 histories with new numbers, and the dataset
    assert kills == 7


def _is_killed(action, place):
    """Do something in a process that dies before it renames a file for the n-th time."""
    child = os.fork()
    if not child:
        replace, count = os.replace, 0

        def dying(*arguments, **options):
            nonlocal count
            count += 1
            if count == place:
                os._exit(9)
            return replace(*arguments, **options)

        os.replace = dying
        try:
            action()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9


def test_parts_grow_a_study_together_but_not_beside_the_smaller_one(tmp_path):
    sweep(SMALL, tmp_path)
    with locked(tmp_path / "run.lock", shared=True):  # a part of the smaller one is at work
        with pytest.raises(InputError, match="expected a folder that no run is at work in"):
            sweep(LARGE, tmp_path, part="1/2")
    assert json.loads((tmp_path / "job.json").read_text())["fingerprint"] == SMALL.fingerprint()
    gained = [sweep(LARGE, tmp_path, part=part).gained for part in ("1/2", "2/2")]
    assert sum(gained) == 12
    assert_whole(tmp_path, LARGE)


def test_a_trace_grows_and_finds_the_same_boundaries(tmp_path):
    steered, design = {"window": [9, 25]}, {"kind": "trace", "first_spacing": {"load": 8}}
    small, large = (
        Job((Axis("load", tuple(range(0, 40, step))),), steered, design=design) for step in (2, 1)
    )
    sweep(small, tmp_path)
    first = int((results(tmp_path)["status"] == Status.DONE).sum())
    report = sweep(large, tmp_path)
    assert report.gained == report.done - first and report.unneeded > 10
    inferred = results(tmp_path)["inferred_class"]
    vibrates = inferred.sel(load=slice(9, 25)).values
    assert (vibrates == vibrates[0]).all() and int((inferred == vibrates[0]).sum()) == 17


def test_fresh_leaves_nothing_of_the_smaller_study(tmp_path):
    for job in (SMALL, LARGE):
        sweep(job, tmp_path)
    (tmp_path / "job-notes.json").write_text("mine")
    assert sweep(SMALL, tmp_path, fresh=True).gained == 6
    assert [path.name for path in tmp_path.glob("job-*")] == ["job-notes.json"]


def test_a_smaller_study_and_another_constant_are_refused(tmp_path):
    sweep(LARGE, tmp_path)
    with pytest.raises(InputError) as caught:
        sweep(SMALL, tmp_path)
    assert "axes.load is [0, 5, 2, 3, 1, 9] there, [1, 2, 5] here" in str(caught.value)
    assert "choose another name or --out, or --fresh to throw its results away" in str(caught.value)
    larger = Job((Axis("load", (*LARGE.axes[0].values, 10)), LARGE.axes[1]), {"thrust": 1.0})
    with pytest.raises(InputError, match=r"scene.thrust is not set there, 1.0 here"):
        sweep(larger, tmp_path)


@pytest.mark.parametrize("damage", ["cut", "gone"])
def test_a_damaged_earlier_job_is_named_and_the_dataset_stays(tmp_path, damage):
    for job in (SMALL, LARGE):
        sweep(job, tmp_path)
    (earlier,) = tmp_path.glob("job-*.json")
    if damage == "cut":
        earlier.write_text(earlier.read_text()[:-50])
        assert f"{earlier}: expected the job of a run, found damage" in " ".join(
            read_status(tmp_path).warnings
        )
    else:
        earlier.unlink()
    assert "a record log of another job" in " ".join(read_status(tmp_path).warnings)
    before = (tmp_path / "results.nc").read_bytes()
    with pytest.raises(
        InputError, match="expected all of its 18 runs on record, found 6 of them missing; it"
    ):
        gather(tmp_path)
    assert (tmp_path / "results.nc").read_bytes() == before
    assert sweep(LARGE, tmp_path).gained == 6
    assert_whole(tmp_path, LARGE)


@pytest.mark.parametrize(
    ("small", "large", "runs"),
    [
        ({"axes": {"mass": [1.0, 2.0]}}, {"axes": {"belt_speed": [0.1, 0.3], "mass": [3.0, 1.0, 2.0]}}, 2),
        ({}, {"axes": {"mass": [1.0, 2.0]}}, 1),
    ],
    ids=["a further axis", "a first axis"],
)
def test_constants_become_axes(tmp_path, small, large, runs):
    base = build_job(OSCILLATOR)
    fixed = {key: base.parameters[key] for key in large["axes"]}
    large = {name: sorted({*values, fixed[name]}) for name, values in large["axes"].items()}
    run(build_job({**OSCILLATOR, **small}), tmp_path / "grown", progress=False)
    job = build_job({**OSCILLATOR, "axes": large})
    assert run(job, tmp_path / "grown", progress=False).gained == job.size - runs
    run(job, tmp_path / "once", progress=False)
    assert_same_numbers(results(tmp_path / "grown"), results(tmp_path / "once"))


def test_samples_and_linked_values_are_found_by_all_that_varies():
    drawn = {"mass": {"from": 1.0, "to": 2.0}}
    few, many = (
        build_job({**OSCILLATOR, "axes": drawn, "design": {"kind": "sobol", "runs": runs}}).resolved()
        for runs in (4, 8)
    )
    assert places_in(few, many).tolist() == [0, 1, 2, 3] and places_in(many, few) is None
    listed = [
        build_job(
            {**OSCILLATOR, "axes": {"mass": masses}, "design": {"kind": "listed", "runs": len(masses)}}
        ).resolved()
        for masses in ([2.0, 1.0, 2.0], [1.0, 2.0, 3.0, 2.0], [1.0, 2.0, 3.0, 4.0])
    ]
    assert places_in(listed[0], listed[1]).tolist() == [1, 0, 3]
    assert places_in(listed[0], listed[2]) is None
    linked = [
        build_job(
            {**OSCILLATOR, "axes": {"mass": masses}, "linked": {"mass": {"belt_speed": speeds}}}
        ).resolved()
        for masses, speeds in (
            ([1.0, 2.0], [0.1, 0.2]),
            ([1.0, 3.0, 2.0], [0.1, 0.3, 0.2]),
            ([2.0, 1.0], [0.1, 0.2]),
        )
    ]
    assert places_in(linked[0], linked[1]).tolist() == [0, 2]
    assert places_in(linked[0], linked[2]) is None


@pytest.mark.parametrize("odd", [{}, {"axes": 3}, {"axes": {"load": 5}}, {"axes": {"load": [[1], 2]}}, []])
def test_a_document_that_is_no_job_has_no_runs(odd):
    assert places_in(odd, SMALL.resolved()) is None
    assert places_in({**SMALL.resolved(), "linked": 4}, LARGE.resolved()) is None
