"""Runs that failed by numerics are done again at a shorter step, in the same folder."""

import os
import signal
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.study import open_results, run
from cvt_hpc.study.description import describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.planning import prepare
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.task import Task, untried_factor
from cvt_hpc.variables import Status
from support.recorded import assert_same_numbers, frames_written
from support.study_double import Axis, Job, Simulator

RUNS = 12
STEP = 1e-6
STABLE = {3: 0.6e-6, 7: 0.6e-6, 8: 0.3e-6, 10: 0.1e-6}  # [s] by load: longer steps diverge
JOB = Job((Axis("load", tuple(range(RUNS))),), {"step": STEP})
AGAIN = {"retry": [Status.FAILED_NUMERICS], "refine": 2.0}


class Diverging(Simulator):
    """Runs that diverge where their step is too long for them."""

    def run_point(self, job, point, interrupt):
        stable = STABLE.get(point["load"], STEP)
        return super().run_point(
            job, {**point, "diverge_at": point["load"], "stable_step": stable}, interrupt
        )


class Stopped(Diverging):
    """The same, ended by a signal when the run at a load is done."""

    def __init__(self, load):
        super().__init__()
        self.load = load

    def run_point(self, job, point, interrupt):
        if point["load"] == self.load:
            os.kill(os.getpid(), signal.SIGTERM)
        return super().run_point(job, point, interrupt)


def sweep(out, simulator=None, lanes=1, **options):
    return run(
        JOB, out, simulator=simulator or Diverging(lanes=lanes), progress=False, raises=False, **options
    )


def recorded(out):
    folder = StudyFolder(out)
    return read_records(folder.records, folder.load())


def numbers(out):
    with open_results(out) as dataset:
        return dataset.load()


@pytest.mark.parametrize("lanes", [1, 4])
def test_failed_runs_are_done_again_at_a_shorter_step(tmp_path, lanes):
    assert [failed.index for failed in sweep(tmp_path, lanes=lanes).failed] == [3, 7, 8, 10]
    before = numbers(tmp_path)
    report = sweep(tmp_path, lanes=lanes, **AGAIN)
    assert [failed.index for failed in report.failed] == [8, 10]
    after = numbers(tmp_path)
    assert after.attrs["job_fingerprint"] == before.attrs["job_fingerprint"]
    steps = np.where(np.isin(np.arange(RUNS), list(STABLE)), 2000, 1000)  # 1 ms in steps of 1 us, and of half
    assert after["steps"].values.tolist() == steps.tolist()
    untouched = ~np.isin(np.arange(RUNS), list(STABLE))
    assert_same_numbers(after.isel(load=untouched), before.isel(load=untouched))
    assert recorded(tmp_path).warnings == []
    # the factor is that to the step of the job, whatever was tried before
    report = sweep(tmp_path, lanes=lanes, **{**AGAIN, "refine": 4.0})
    assert [failed.index for failed in report.failed] == [10]
    assert numbers(tmp_path)["steps"].values[[7, 8, 10]].tolist() == [2000, 4000, 4000]


def test_a_retry_without_a_factor_goes_on_at_half_of_the_shortest_step_tried(tmp_path):
    sweep(tmp_path)
    for steps in ([2000, 2000, 2000, 2000], [2000, 2000, 4000, 4000], [2000, 2000, 4000, 8000]):
        sweep(tmp_path, retry=[Status.FAILED_NUMERICS])
        assert numbers(tmp_path)["steps"].values[[3, 7, 8, 10]].tolist() == steps
    # asked for, or beside runs that no shorter step helps, it is the step of the job
    for options in ({"refine": 1.0}, {"retry": [Status.FAILED_NUMERICS, Status.TIMED_OUT]}):
        sweep(tmp_path / "other")
        sweep(tmp_path / "other", **{"retry": [Status.FAILED_NUMERICS]} | options)
        assert numbers(tmp_path / "other")["steps"].values[10] == 1000


@pytest.mark.parametrize(
    ("most", "earlier", "factor"), [(3, 1.0, 16.0), (0, 1.0, 2.0), (3, 16.0, 256.0), (3, 256.0, 1000.0)]
)
def test_the_first_factor_that_is_not_tried(most, earlier, factor):
    job = Job(JOB.axes, {"step": STEP, "most_refinements": most})
    records = SimpleNamespace(refinements=np.array([1.0, earlier]))
    found = untried_factor(job, records, np.array([0, 1]), [Status.FAILED_NUMERICS])
    assert found == factor


def test_lanes_and_interruptions_change_no_number(tmp_path):
    sweep(tmp_path / "whole", lanes=4)
    sweep(tmp_path / "whole", lanes=4, **AGAIN)
    sweep(tmp_path / "cut")
    report = sweep(tmp_path / "cut", Stopped(7), **AGAIN)
    assert report.remaining == 2 and report.exit_status == 99
    # whoever goes on does so at the step of the retry that was begun, with its options or without any
    report = sweep(tmp_path / "cut", Stopped(8))
    assert report.remaining == 1
    sweep(tmp_path / "cut", **{**AGAIN, "refine": 4.0})
    assert_same_numbers(numbers(tmp_path / "cut"), numbers(tmp_path / "whole"))
    assert frames_written(tmp_path / "cut") == RUNS + len(STABLE)


def test_two_ranks_find_the_same(start, tmp_path):
    parameters = {"step": STEP, "diverge_at": 5, "stable_step": 0.6e-6}
    options = {"out": tmp_path / "two", "runs": RUNS, "lanes": 4, "parameters": parameters}
    for again, status in (({}, 1), (AGAIN, 0)):
        finished = start({**options, "sweep": again}, ranks=2).finish()
        assert finished.returncode == status, finished.stderr
        run(
            Job(JOB.axes, parameters), tmp_path / "one", simulator=Simulator(lanes=4), progress=False, **again
        )
    assert numbers(tmp_path / "two")["steps"].values.tolist() == [1000] * 5 + [2000] + [1000] * 6
    assert_same_numbers(numbers(tmp_path / "two"), numbers(tmp_path / "one"))


def test_a_shortened_run_is_expected_to_take_longer(tmp_path):
    asked = []

    class Timed(Diverging):
        def run_point(self, job, point, interrupt):
            asked.append(point["load"])
            return super().run_point(job, point, interrupt)

        def run_costs(self, job):
            return np.where(np.arange(RUNS) == 11, 3.0, 2.0)  # longest first: 11, but for refined ones

    sweep(tmp_path, Stopped(9))  # 10 and 11 are left
    sweep(tmp_path, time_limit=0.0, **AGAIN)  # 3, 7, 8 are asked for again at half the step, none is done
    sweep(tmp_path, Timed())
    assert asked == [3, 7, 8, 11, 10]


def test_runs_of_different_steps_share_no_batch(tmp_path):
    batches = []

    class Watched(Diverging):
        def run_points(self, job, points, interrupt, more=None):
            batches.append([(point["load"], point["step"]) for point in points])
            return super().run_points(job, points, interrupt)

    sweep(tmp_path, Stopped(9))  # 10 and 11 are left
    sweep(tmp_path, time_limit=0.0, **AGAIN)
    sweep(tmp_path, Watched(lanes=8))
    assert sorted(batches) == [[(3, STEP / 2), (7, STEP / 2), (8, STEP / 2)], [(10, STEP), (11, STEP)]]


def test_runs_at_steps_of_their_own_are_priced_by_these(tmp_path):
    sweep(tmp_path)
    sweep(tmp_path, time_limit=0.0, **AGAIN)  # 3, 7, 8, 10 are asked for again, none is done
    simulator = Simulator()
    task = Task(JOB, describe(JOB, simulator), simulator, asked_steps=lambda: {0: STEP / 4, 3: STEP / 4})
    with ExitStack() as held:
        plan = prepare(StudyFolder(tmp_path), task, None, False, (), 1, held)
    assert plan.costs == pytest.approx([4, 1, 1, 8, 1, 1, 1, 2, 2, 1, 2, 1])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"refine": 2.0}, "expected --retry failed_numerics beside it, and no other, found no --retry"),
        ({"refine": 2.0, "retry": [Status.TIMED_OUT]}, "and no other, found timed_out"),
        ({**AGAIN, "refine": 0.5}, "--refine: expected a factor of 1 or more, at most 1000, found 0.5"),
        ({**AGAIN, "refine": float("nan")}, "--refine: expected a factor of 1 or more"),
    ],
)
def test_what_cannot_be_refined_is_refused(tmp_path, options, message):
    with pytest.raises(InputError) as caught:
        sweep(tmp_path, **options)
    assert message in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_job_without_a_step_cannot_be_refined(tmp_path):
    with pytest.raises(InputError, match="^--refine: expected a job whose stepper has a fixed step, found"):
        run(Job(), tmp_path, simulator=Simulator(), progress=False, **AGAIN)
