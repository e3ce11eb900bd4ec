"""Forecasts: schedules that can be drawn by hand, limits that hold for all, and what is known beforehand."""

import math
import struct
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.printing import disk_line
from cvt_hpc.study import run
from cvt_hpc.study.description import describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.forecast.cost_model import (
    NETWORK,
    ClaimTimes,
    Fit,
    Forecast,
    forecast,
    least_makespan,
    simulate_schedule,
)
from cvt_hpc.study.forecast.resources import Disk, disk_space, find_out, slurm_time, suggested_time
from cvt_hpc.study.record.log import PREAMBLE
from support.study_double import Axis, Job, Simulator

AT_ONCE = ClaimTimes(0.0, 0.0, 0.0)
MANY = 10**8
EXACT = Fit(MANY, 0.0, 0.0)  # what the prior adds to its spread is 5e-5
RUNS = 12


def makespan(seconds, ranks, claims=AT_ONCE):
    return simulate_schedule(np.array(seconds, float), ranks, claims, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("seconds", "ranks", "expected"),
    [
        ([3, 2, 2, 1], 2, 4),  # 3 + 1 and 2 + 2
        ([5, 4, 3, 3, 3], 3, 7),  # 5; 4 + 3; 3 + 3
        ([1, 1, 5], 2, 6),  # claimed in the order of the plan, not by what they take
        ([2, 1], 5, 2),
        ([3, 2, 2, 1], 1, 8),
    ],
)
def test_schedules_that_can_be_drawn_by_hand(seconds, ranks, expected):
    assert makespan(seconds, ranks) == expected


def test_each_batch_waits_for_its_own_claim():
    # Powers of two, so that sums are exact. One rank: way, service and batch, thrice.
    claims = ClaimTimes(service=0.25, latency=0.5, scatter=0.0)
    assert makespan([4, 2, 1], 1, claims) == 7 + 3 * 0.75


def test_the_counter_serves_one_claim_at_a_time():
    claims = ClaimTimes(service=0.25, latency=0.0, scatter=0.0)
    assert makespan([1.0] * 16, 16, claims) == 16 * 0.25 + 1.0  # the last waits for fifteen others
    assert makespan([0.0] * 400, 16, claims) == 400 * 0.25  # runs without work: the counter is the limit


@given(st.lists(st.floats(1e-6, 1e3), min_size=1, max_size=40), st.integers(1, 50), st.integers(0, 2**31))
def test_no_schedule_beats_the_bound_nor_is_twice_as_long(seconds, ranks, seed):
    seconds = np.array(seconds)
    bound = least_makespan(seconds, ranks)
    found = simulate_schedule(seconds, ranks, AT_ONCE, np.random.default_rng(seed))
    assert bound * (1 - 1e-12) <= found <= seconds.sum() / ranks + seconds.max() * (1 + 1e-12)  # Graham 1966
    assert simulate_schedule(seconds, ranks, NETWORK, np.random.default_rng(seed)) > bound * (1 - 1e-12)


def test_latencies_are_those_measured():
    latencies = NETWORK.draw_latencies(np.random.default_rng(0), 10**6)
    # medians of 10^6 numbers scatter by 0.2 % here, counts of 100 by 10: three of these
    assert np.median(latencies) == pytest.approx(65e-6, rel=0.006)
    assert (latencies > 11e-3).sum() == pytest.approx(108, abs=33)  # 3.7 deviations: 1.08 in 10^4


def test_small_batches_cost_what_empty_lanes_cost():
    groups, costs = [tuple(range(16))], np.full(16, 3.0)
    alone, four = (forecast(groups, costs, EXACT, ranks, AT_ONCE) for ranks in (1, 4))
    assert (alone.batches, four.batches) == (1, 4)
    assert alone.efficiency[0] == pytest.approx(1.0)
    # A small batch takes as long as the full one: four ranks gain nothing. 1e-3: twenty times the fit's spread.
    assert four.makespan[0] == pytest.approx(3.0, rel=1e-3)
    assert four.efficiency[0] == pytest.approx(0.25, rel=1e-3)
    assert four.core_seconds == pytest.approx(12.0, rel=1e-3)


def test_an_idle_rank_costs_its_share():
    found = forecast([(0,), (1,), (2,)], np.ones(3), EXACT, 2, AT_ONCE)
    assert found.makespan == pytest.approx((2.0, 2.0, 2.0), rel=1e-3)
    assert found.bound == pytest.approx(1.5, rel=1e-3)
    assert found.efficiency[0] == pytest.approx(0.75, rel=1e-3)


def test_sweeps_scatter_as_the_fit_does():
    # Of one batch the logarithm has the spread of the batches and that of the mean.
    fit = Fit(9, math.log(5.0), 9 * 0.3**2)
    logs = np.array([np.log(fit.draw(np.random.default_rng(seed), 2)) for seed in range(4000)])
    spread = fit.spread()
    # standard deviations of 4000 numbers scatter by 1.1 %: four of these, as for the mean
    assert logs.std() == pytest.approx(spread * math.sqrt(1 + 1 / 9), rel=0.045)
    assert logs.mean() == pytest.approx(math.log(5.0), abs=4 * spread / math.sqrt(4000))
    assert np.corrcoef(logs.T)[0, 1] == pytest.approx(0.1, abs=4 / math.sqrt(4000))
    ratios = [Fit(n, 0.0, 0.01 * n) for n in (1, 10, 1000)]
    widths = [np.divide(*forecast([(0,)], np.ones(1), fit, 1).makespan[:0:-1]) for fit in ratios]
    assert widths[0] > widths[1] > widths[2]


@dataclass
class Clock:
    """A clock that runs take forward, instead of time that passes."""

    now: float = 0.0
    done: list = field(default_factory=list)

    def monotonic(self):
        return self.now


class Timed(Simulator):
    """Runs that take three seconds for each simulated one, and up to `lanes` together as long as one."""

    def __init__(self, clock, lanes=2):
        super().__init__(lanes=lanes)
        self.clock = clock

    def run_costs(self, job):
        return super().run_costs(job) * job.parameters["duration"]

    def run_points(self, job, points, interrupt, more=None):
        interrupt()
        self.clock.now += 3.0 * points[0]["duration"]
        self.clock.done.append(tuple(point[job.axes[0].name] for point in points))
        return super().run_points(job, points, interrupt)


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr("cvt_hpc.study.task.time", SimpleNamespace(monotonic=clock.monotonic))
    return clock


def knowledge(folder, simulator, pilots, axis="load", histories=(), **parameters):
    job = Job((Axis(axis, tuple(range(RUNS))),), {"duration": 8.0, **parameters}, histories=histories)
    groups = simulator.lane_groups(job, range(RUNS))
    return find_out(job, simulator, groups, folder, pilots)


def test_pilots_are_short_and_spread_over_the_grid(tmp_path, clock):
    known = knowledge(tmp_path, Timed(clock), 2)
    assert clock.done == [(2, 3), (8, 9)]
    assert clock.now == 2 * 3.0 * 2.0  # a quarter of the duration each
    assert (known.fit.batches, known.fit.likely()) == (2, pytest.approx(3.0))
    assert known.basis == "2 pilot batches of 25% of the simulated time"
    assert list(tmp_path.iterdir()) == []


def test_more_pilots_than_batches_are_all_batches(tmp_path, clock):
    assert knowledge(tmp_path, Timed(clock), 50).fit.batches == RUNS / 2


def test_a_duration_that_is_an_axis_is_not_shortened(tmp_path, clock):
    known = knowledge(tmp_path, Timed(clock), 1, axis="duration")
    assert clock.done == [(6, 7)]
    assert known.fit.likely() == pytest.approx(18.0 / 8.0)
    assert known.basis == "1 pilot batch of 100% of the simulated time"


def test_a_duration_that_follows_from_others_is_not_shortened(tmp_path, clock):
    job = Job(
        (Axis("load", tuple(range(RUNS))),), {"duration": 8.0}, rules=(SimpleNamespace(key="duration"),)
    )
    simulator = Timed(clock)
    known = find_out(job, simulator, simulator.lane_groups(job, range(RUNS)), tmp_path, 1)
    assert known.basis == "1 pilot batch of 100% of the simulated time"


def test_a_pilot_tells_the_size_of_a_history(tmp_path, clock):
    known = knowledge(tmp_path, Timed(clock), 1, histories=(0, 3))
    assert known.history_bytes == 4 * 24 * 8  # the double's history has 24 numbers


def test_pilots_that_fail_leave_the_prediction(tmp_path, clock):
    known = knowledge(tmp_path, Timed(clock), 1, diverge_at=6, raise_at=7)
    assert (known.fit.batches, known.fit.likely()) == (0, pytest.approx(2.0))  # a full batch of two
    assert known.basis == "predicted costs, right within a factor of two; no pilot batch came to its end"


def test_records_tell_unless_pilots_are_asked_for(tmp_path):
    job = Job((Axis("load", tuple(range(RUNS))),), {"duration": 8.0, "pause": 0.01})
    simulator = Simulator(lanes=2)
    groups = simulator.lane_groups(job, range(RUNS))
    assert find_out(job, simulator, groups, tmp_path / "none", 0).fit.batches == 0
    run(job, tmp_path, simulator=simulator, progress=False)
    known = find_out(job, simulator, groups, tmp_path, 0)
    assert known.basis == "batches on record (6)"  # the first one from when its kernels are loaded
    assert known.fit.likely() > 2 * 0.01
    assert find_out(job, simulator, groups, tmp_path, 1).basis.startswith("1 pilot")


def test_the_space_on_the_disk_is_that_of_the_logs(tmp_path):
    job, simulator = Job((Axis("load", tuple(range(RUNS))),)), Simulator(lanes=4)
    run(job, tmp_path, simulator=simulator, progress=False)
    (log,) = StudyFolder(tmp_path).records.iterdir()
    header = struct.unpack_from(PREAMBLE.format, log.read_bytes())[2]
    found = disk_space(describe(job, simulator), 3, 2, 1000.0)
    assert found.records == log.stat().st_size - PREAMBLE.size - header
    values = RUNS * describe(job, simulator).record_dtype.itemsize
    assert values < (tmp_path / "results.nc").stat().st_size < found.results
    assert found.histories == 2000.0
    assert disk_space(describe(job, simulator), 3, 0, math.nan).histories == 0.0


@pytest.mark.parametrize(("histories", "words"), [(1, "1 history 2 kB"), (3, "3 histories 2 kB")])
def test_histories_are_counted_in_words(histories, words):
    assert disk_line(Disk(1e6, 1e6, 2e3), histories).endswith(f", {words}")


def test_the_time_asked_for_covers_start_and_gathering():
    expected = Forecast(4, 10, (500.0, 400.0, 700.0), 450.0, (0.9, 0.8, 1.0))
    assert suggested_time(expected, 100) == 900.0  # 60 + 700 + 90
    assert suggested_time(expected, 10**6) == 1200.0  # 60 + 700 + 290
    assert slurm_time(900.0) == "00:15:00"
    assert slurm_time(2 * 86400 + 3 * 3600 + 300) == "2-03:05:00"
