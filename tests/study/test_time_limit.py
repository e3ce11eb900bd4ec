"""No batch is begun that is not expected to end in time; what is at work when time is up is broken off."""

import json
import math
import time

import numpy as np
import pytest

from cvt_hpc.study import run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.forecast.cost_model import CostModel, Fit, fit_recorded
from cvt_hpc.study.ranks.progress import Counter
from cvt_hpc.study.ranks.stopping import SignalWatch, Stop, TimeLimit, find_time_limit, gathering_margin
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.record.log import RecordFormat, RecordLog
from cvt_hpc.variables import Status
from support.study_double import Axis, Job, Simulator

JOB = Job((Axis("load", tuple(range(12))),))


class Uneven(Simulator):
    """Six long runs and six that are a hundred times as short."""

    def run_costs(self, job):
        return np.repeat([1.0, 0.01], 6)


def sweep(out, **options):
    return run(JOB, out, simulator=options.pop("simulator", Uneven()), progress=False, **options)


def write_history(out, monkeypatch, jump=0.0):
    """Put four long runs on record, at 1000 s each; their kernels took an hour more, and the clock jumps [s]."""
    sweep(out, time_limit=0.0)
    study = StudyFolder(out).load()
    done = study.blank_rows()
    done["status"] = Status.DONE
    now, wrong = 1e9, 0.0
    monkeypatch.setattr("cvt_hpc.study.record.log.time.time", lambda: now + wrong)
    monkeypatch.setattr("cvt_hpc.study.record.log.time.monotonic", lambda: now)
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    session = {"id": "a", "started": now, "versions": {}, "git_revision": "", "command": "", "host": "",
               "ranks": 1}  # fmt: skip
    with RecordLog(out / "records", layout, session, rank=0) as log:
        for index in range(4):
            log.begin((index,))
            now += 1000.0 + 3600.0 * (index == 0)
            wrong = jump * (-1) ** index
            log.append([(index, done)])
    monkeypatch.undo()


@pytest.fixture
def history(tmp_path, monkeypatch):
    """Return a folder in which four long runs are on record."""
    write_history(tmp_path, monkeypatch)
    return tmp_path


@pytest.mark.parametrize("jump", [3600.0, -3600.0])
def test_a_clock_that_is_set_right_changes_no_time_on_record(tmp_path, monkeypatch, jump):
    # Otherwise a batch seems to take hours, and nothing fits into a time limit any more.
    write_history(tmp_path, monkeypatch, jump)
    test_the_time_that_batches_took_is_on_record(tmp_path)


def test_the_time_that_batches_took_is_on_record(history):
    folder = StudyFolder(history)
    assert read_records(folder.records, folder.load()).timings == [((i,), 1000.0) for i in (1, 2, 3)]


def test_a_batch_that_does_not_fit_is_passed_over_and_shorter_ones_are_done(history):
    report = sweep(history, time_limit=900.0)
    assert (report.done, report.remaining, report.exit_status) == (10, 2, 99)
    assert report.stopped.startswith("time limit: 0:1")
    assert report.stopped.endswith("were left, a batch may take 0:29:21")
    folder = StudyFolder(history)
    assert np.flatnonzero(~read_records(folder.records, folder.load()).recorded).tolist() == [4, 5]


def test_batches_that_fit_are_done(history):
    # Three batches that agree leave a margin of a factor of less than two.
    report = sweep(history, time_limit=2000.0)
    assert (report.done, report.remaining, report.stopped) == (12, 0, None)


def test_a_rank_learns_from_what_it_does_itself(tmp_path, monkeypatch):
    class Clocked(Uneven):
        """Runs that take 1000 s for a cost of 1, by a clock of their own."""

        now = 0.0

        def run_point(self, job, point, interrupt):
            interrupt()
            self.now += 1000.0 * self.run_costs(job)[point["load"]]
            interrupt()
            return super().run_point(job, point, interrupt)

    simulator = Clocked()
    monkeypatch.setattr(time, "monotonic", lambda: simulator.now)
    report = sweep(tmp_path, simulator=simulator, time_limit=3900.0)
    monkeypatch.undo()
    # Nothing is known of the first one; two are too few to be sure that a third takes less than twice as long.
    assert report.done == 2 + 6
    assert report.stopped == "time limit: 0:31:40 were left, a batch may take 0:33:20"


def test_a_run_at_work_is_broken_off_when_time_is_up(start, tmp_path):
    options = {"out": tmp_path, "slow": {"from": 3, "pause": 300.0}, "sweep": {"time_limit": 1.0}}
    for ranks, status in ((0, 99), (2, 98)):  # the second start gains nothing
        finished = start(options, ranks).finish()
        assert finished.returncode == status, finished.stderr
        facts = json.loads(finished.stdout)
        assert (facts["done"], facts["remaining"], facts["stopped"]) == (3, 9, "time limit")
    folder = StudyFolder(tmp_path)
    assert read_records(folder.records, folder.load()).died.sum() == 0


def test_time_that_runs_out_when_all_is_done_is_no_early_end():
    stop = Stop(Counter(), SignalWatch(), TimeLimit(-1.0), lambda: None)
    stop.look()
    assert stop.reason is None
    assert not stop.fits(0.0)
    assert not stop.may_claim()
    assert stop.reason.startswith("time limit")


def test_the_end_of_the_slurm_job_is_a_limit(start, tmp_path):
    end = str(int(time.time()) + 20)  # within the margin for gathering
    slurm = {"SLURM_JOB_ID": "17", "SLURM_JOB_END_TIME": end}
    finished = start({"out": tmp_path}, environment=slurm).finish()
    assert finished.returncode == 98, finished.stderr
    facts = json.loads(finished.stdout)
    assert (facts["done"], facts["stopped"]) == (0, "end of the Slurm job")
    # An explicit limit counts before it.
    again = start({"out": tmp_path, "sweep": {"time_limit": 1000.0}}, environment=slurm)
    assert again.finish().returncode == 0


def test_no_limit_without_slurm():
    assert find_time_limit(None, 10, {}).seconds == math.inf
    assert find_time_limit(60.0, 10, {"SLURM_JOB_ID": "1", "SLURM_JOB_END_TIME": "5"}) == (
        59.998,
        "time limit",
    )


def test_the_end_is_read_from_the_environment(monkeypatch):
    monkeypatch.setattr("cvt_hpc.study.ranks.stopping.time.time", lambda: 5000.0)
    limit = find_time_limit(None, 10_000, {"SLURM_JOB_ID": "17", "SLURM_JOB_END_TIME": "8600"})
    assert limit.seconds == 3600.0 - gathering_margin(10_000)
    assert limit.name == "end of the Slurm job"


@pytest.mark.parametrize(
    ("told", "seconds"),
    [
        ("59", 59),
        ("5:30", 330),
        ("2:00:01", 7201),
        ("1-00:00:10", 86410),
        ("UNLIMITED", math.inf),
    ],
)
def test_without_the_variable_squeue_is_asked(tmp_path, monkeypatch, caplog, told, seconds):
    (tmp_path / "squeue").write_text(f'#!/bin/sh\n[ "$3" = --jobs=17 ] && echo "{told}"\n')
    (tmp_path / "squeue").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    found = find_time_limit(None, 10, {"SLURM_JOB_ID": "17"}).seconds
    assert found == (seconds if seconds == math.inf else seconds - gathering_margin(10))
    assert caplog.records == []


@pytest.mark.parametrize("told", ["INVALID", "", None])
def test_an_end_that_nobody_tells_is_said_to_be_unknown(tmp_path, monkeypatch, caplog, told):
    if told is not None:
        (tmp_path / "squeue").write_text(f"#!/bin/sh\necho {told}\n")
        (tmp_path / "squeue").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_time_limit(None, 10, {"SLURM_JOB_ID": "17"}).seconds == math.inf
    assert "the end of Slurm job 17 is not known" in caplog.text
    assert "--time-limit" in caplog.text


def test_nothing_known_is_no_reason_to_wait():
    assert CostModel(np.ones(3)).upper((0, 1)) == 0.0


def test_the_longest_run_of_a_batch_counts():
    model = CostModel(np.array([1.0, 2.0, 4.0]))
    model.learn((0, 1), 20.0)
    assert model.fit.likely() == pytest.approx(10.0)
    assert model.upper((0, 2)) == pytest.approx(4 * model.upper((0,)))


def test_the_fit_is_mean_and_spread_of_the_logarithms():
    ratios = np.random.default_rng(1).lognormal(1.0, 0.3, 40)
    fit = Fit()
    for ratio in ratios:
        fit = fit.with_ratio(ratio)
    assert fit.likely() == pytest.approx(np.exp(np.log(ratios).mean()))
    assert fit.squares == pytest.approx(40 * np.log(ratios).var())


def test_one_batch_in_forty_exceeds_the_margin():
    # The next batch of a machine that is fitted to n others; two standard deviations are 2.3 % on one side. The
    # prior is wider than this spread, so that few batches give a wider margin, and never a narrower one.
    generator = np.random.default_rng(2)
    for batches, most in ((1, 0.023), (5, 0.023), (200, 0.026)):
        logs = generator.normal(0.0, 0.2, (20_000, batches + 1))
        known = logs[:, :-1]
        fits = zip(known.mean(axis=1), batches * known.var(axis=1), strict=True)
        upper = [Fit(batches, mean, squares).upper() for mean, squares in fits]
        beyond = int((np.exp(logs[:, -1]) > upper).sum())
        # three standard deviations of a count
        assert beyond / 20_000 < most + 3 * math.sqrt(most / 20_000)
    assert beyond > 0


def test_an_inherited_fit_soon_gives_way():
    inherited = Fit(10_000, math.log(2.0), 10_000 * 0.01).inherited()
    assert inherited.batches < 20
    assert inherited.likely() == pytest.approx(2.0)
    assert inherited.squares / inherited.batches == pytest.approx(0.01)
    model = CostModel(np.ones(1), inherited)
    for _ in range(50):
        model.learn((0,), 6.0)
    assert model.fit.likely() > 5.0


def test_batches_without_results_tell_nothing():
    done = np.array([True, False, False])
    fit = fit_recorded(np.ones(3), [((0, 1), 2.0), ((1, 2), 1e-3)], done)
    assert (fit.batches, fit.likely()) == (1, pytest.approx(2.0))


@pytest.mark.parametrize("seconds", [math.inf, math.nan, 0.0, -1.0])
def test_a_time_that_no_clock_tells_is_left_out(seconds):
    model = CostModel(np.ones(2))
    model.learn((0,), seconds)
    model.learn((0, 1), 3.0)
    assert (model.fit.batches, model.fit.likely()) == (1, pytest.approx(3.0))
