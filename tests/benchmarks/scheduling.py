"""How well ranks share a sweep: measured on a few, simulated on thousands.

    python tests/benchmarks/scheduling.py [--runs 400] [--simulated]

Measured under mpirun: what a claim takes, and the makespan of runs that sleep for heavy-tailed times, which
are predicted within a factor of two; beside it what the forecast says. Simulated: 10^6 such runs alone on 10 000
ranks, and sweeps in lanes, whose runs end early or are prolonged as they are in a map (--simulated: these alone).
Takes some three minutes.

In lanes a filling takes as long as its longest run. A lone run takes `ALONE` of that. Runs that go on fill lanes
with those that go on elsewhere in their batch. Ideal is a sweep in which all batches have 16 fillings and all
ranks end together.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from heapq import heapreplace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS))

from cvt_hpc.study import process_rank, run  # noqa: E402
from cvt_hpc.study.batches import share_out  # noqa: E402
from cvt_hpc.study.forecast.cost_model import (  # noqa: E402
    ClaimTimes,
    Fit,  # noqa: E402
    Forecast,
    forecast,
    least_makespan,
    simulate_schedule,
)
from cvt_hpc.study.ranks.launch import assembled_team  # noqa: E402
from cvt_hpc.study.status import find_records  # noqa: E402
from cvt_hpc.study.sweep import open_counter  # noqa: E402
from support.study_double import Axis, Job, Simulator  # noqa: E402
from support.study_processes import clean_environment, find_mpirun  # noqa: E402

SHARED_MEMORY = ClaimTimes(2e-6, 0.0, 0.0)
RANKS = (2, 4)
ROWS, CLAIMS = 400, 50  # of each rank: rows of claims
MEAN = 0.06  # [s] of a run's predicted duration
TAIL = 1.0  # standard deviation of its logarithm: the longest of 400 takes twelve times the mean
SPREAD = 0.35  # of the logarithm of the duration about the predicted one
MANY = 10**6
LANES, MOST_TURNS = 16, 16
ALONE = 0.45  # time of a lone run over that of full lanes: elastic belt, single precision, an EPYC with AVX2
MACHINE = 0.1  # spread of the logarithm of the time of a filling
LENGTHS = {  # of runs, over the first transient's: of 380 runs of jobs/lebrecht_2004.toml so many each
    "alike": {1.0: 1},
    "prolonged": {1.0: 354, 2.0: 15, 4.0: 11},
    "early ends, prolonged": {0.25: 79, 0.5: 230, 1.0: 45, 2.0: 15, 4.0: 11},
}
SWEEPS = (  # runs, ranks
    (380, 1),
    (380, 2),
    (380, 4),
    (1_600, 2),
    (1_600, 16),
    (10**4, 16),
    (10**5, 16),
    (10**6, 1_000),
    (10**6, 10_000),
    (3 * 10**6, 10_000),
    (10**7, 10_000),
)


class Sleepers(Simulator):
    """Runs that sleep for heavy-tailed times, roughly as predicted."""

    def __init__(self, runs: int) -> None:
        super().__init__()
        generator = np.random.default_rng(1)
        self.costs = heavy_tailed(generator, runs)
        self.pauses = self.costs * np.exp(SPREAD * generator.standard_normal(runs))

    def run_costs(self, job: Job) -> np.ndarray:
        """Return the predicted durations [s]."""
        return self.costs

    def run_point(self, job: Job, point: dict[str, Any], interrupt) -> dict[str, Any]:
        """Sleep, and record for how long."""
        interrupt()  # starts the clock of the run
        started = time.perf_counter()
        time.sleep(self.pauses[point["load"]])
        return super().run_point(job, point, interrupt) | {"core_seconds": time.perf_counter() - started}


def heavy_tailed(generator: np.random.Generator, count: int) -> np.ndarray:
    """Return durations [s], log-normal."""
    return MEAN * np.exp(TAIL * generator.standard_normal(count) - TAIL**2 / 2)


def make_job(runs: int) -> Job:
    """Return the job of the sleepers."""
    return Job((Axis("load", tuple(range(runs))),))


def claim_in_a_row(folder: Path, runs: int) -> None:
    """Claim from all ranks at once; print how long a claim takes [us]: in the median row, and in the mean."""
    with assembled_team(folder / "crash.log") as team, open_counter(team) as counter:
        team.collect(None)
        rows = []
        for _ in range(ROWS):
            started = time.perf_counter()
            for _ in range(CLAIMS):
                counter.claim()
            rows.append((time.perf_counter() - started) / CLAIMS)
        taken = 1e6 * np.array(team.collect(rows))
        if team.rank == 0:
            print(json.dumps([np.median(taken), np.mean(taken)]))


def sweep(folder: Path, runs: int) -> None:
    """Do the sleepers, and print the makespan, the time that runs took in all, and the longest of them [s]."""
    job = make_job(runs)
    run(job, folder, simulator=Sleepers(runs), progress=False)
    if process_rank() == 0:
        records = find_records(folder, job)
        seconds = records.read(np.arange(runs), "core_seconds")
        makespan = records.written.max() - (records.written - seconds).min()
        print(json.dumps([makespan, seconds.sum(), seconds.max()]))


STAGES = {"claim": claim_in_a_row, "sweep": sweep}


def measure(stage: str, ranks: int, runs: int) -> Any:
    """Return what a stage prints under mpirun."""
    with tempfile.TemporaryDirectory() as folder:
        command = [find_mpirun(), "-n", str(ranks), sys.executable, __file__, "--runs", str(runs)]
        command += ["--stage", stage, "--folder", str(Path(folder) / "out")]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=clean_environment())
    return json.loads(done.stdout.splitlines()[-1])


def compare(ranks: int, runs: int) -> None:
    """Print what was measured on some ranks, and what had been predicted."""
    sleepers, groups = Sleepers(runs), [(index,) for index in range(runs)]
    order = [batch[0] for batch in share_out(groups, sleepers.costs, ranks)]
    generator = np.random.default_rng(0)
    simulated = simulate_schedule(sleepers.pauses[order], ranks, SHARED_MEMORY, generator)
    blind = forecast(groups, sleepers.costs, known_fit(SPREAD), ranks, SHARED_MEMORY)
    makespan, work, longest = measure("sweep", ranks, runs)
    median, mean = measure("claim", ranks, runs)
    print(f"{ranks} ranks, {runs} runs: a claim takes {median:.2f} us, with waiting for a core {mean:.2f} us")
    print(f"  measured  {makespan:.3f} s = {makespan / max(work / ranks, longest):.4f} of the bound")
    print(
        f"  simulated {simulated:.3f} s = {simulated / least_makespan(sleepers.pauses, ranks):.4f} of the bound"
    )
    print(f"  forecast  {blind.makespan[0]:.3f} s, 95 % {blind.makespan[1]:.3f} to {blind.makespan[2]:.3f} s")


def known_fit(spread: float) -> Fit:
    """Return the fit to many batches."""
    return Fit(MANY, 0.0, MANY * spread**2)


def simulate_singles(ranks: int) -> Forecast:
    """Return the forecast of 10^6 heavy-tailed runs that are done alone."""
    costs = np.exp(TAIL * np.random.default_rng(0).standard_normal(MANY))
    return forecast([(index,) for index in range(MANY)], costs, known_fit(SPREAD), ranks)


def turns(runs: int) -> int:
    """Return how many times so many runs fill the lanes."""
    return -(-runs // LANES)


def register_time(runs: np.ndarray) -> np.ndarray:
    """Return how long so many runs of one length take in lanes, over the time of one filling."""
    rest = runs % LANES
    return runs // LANES + np.select([rest == 0, rest == 1], [0.0, ALONE], 1.0)


class Lanes(NamedTuple):
    """How well lanes and ranks are used: makespan, and time of all ranks at work, over the ideal."""

    makespan: float
    work: float


def simulate_lanes(lengths: dict[float, int], runs: int, ranks: int, joins: bool = True) -> Lanes:
    """Simulate a sweep in lanes, batch by batch as ranks claim them.

    Parameters
    ----------
    lengths : dict
        Relative number of runs by length.
    runs, ranks : int
        Of the sweep.
    joins : bool
        Whether batches join, as long as they fill the lanes no more than `MOST_TURNS` times.
    """
    generator = np.random.default_rng(0)
    ends, share = np.array(list(lengths)), np.array(list(lengths.values()), float)
    drawn = generator.choice(ends, runs, p=share / share.sum())
    parts = np.diff(ends, prepend=0.0)
    # runs that do each part, up to each run
    going = np.concatenate([np.zeros((1, ends.size), int), np.cumsum(drawn[:, None] >= ends, axis=0)])
    bounds = np.linspace(0, runs, -(-runs // (LANES * MOST_TURNS)) + 1).astype(int)
    groups = [tuple(range(first, last)) for first, last in pairwise(bounds.tolist())]
    ideal = float((register_time(np.diff(going[bounds], axis=0)) @ parts).sum()) / ranks
    batches = share_out(groups, np.ones(runs), ranks, turns)
    plan = [going[batch[-1] + 1] - going[batch[0]] for batch in batches]
    plan.reverse()  # the next is the last

    clock = [(0.0, rank) for rank in range(ranks)]
    held: dict[int, np.ndarray] = {}  # by rank: runs whose first parts are done, and which others may join
    end = work = 0.0
    while plan or held:
        now, rank = clock[0]
        counts = held.pop(rank, np.zeros(ends.size, int))
        most = np.inf if not counts[0] else LANES * MOST_TURNS if joins else 0
        if plan and counts[0] + plan[-1][0] <= most:
            joining = plan.pop()
            time, held[rank] = register_time(joining[0]) * parts[0], counts + joining
        elif counts[0]:
            time = register_time(counts[1:]) @ parts[1:]
        else:  # nothing left for it
            time = np.inf
        if np.isfinite(time):
            time *= np.exp(MACHINE * generator.standard_normal())
            work, end = work + time, max(end, now + time)
        heapreplace(clock, (now + time, rank))
    return Lanes(end / ideal, work / ranks / ideal)


def print_simulated() -> None:
    """Print the sweeps that are simulated."""
    found = simulate_singles(10_000)
    median, low, high = found.efficiency
    print(
        f"10^6 heavy-tailed runs alone on 10000 ranks: makespan {found.makespan[0] / found.bound:.4f} of the "
    )
    print(f"  bound, efficiency {median:.3f}, 95 % {low:.3f} to {high:.3f}")
    for name, lengths in LENGTHS.items():
        for runs, ranks in SWEEPS:
            joined, apart = (simulate_lanes(lengths, runs, ranks, joins) for joins in (True, False))
            print(
                f"{name}, {runs} runs, {ranks} ranks: makespan {joined.makespan:.2f} of the ideal, ", end=""
            )
            print(f"at work {joined.work:.2f}; where none join {apart.makespan:.2f}, {apart.work:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--simulated", action="store_true", help="measure nothing")
    parser.add_argument("--stage", choices=STAGES, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.stage:
        STAGES[arguments.stage](arguments.folder, arguments.runs)
        return
    for ranks in () if arguments.simulated else RANKS:
        compare(ranks, arguments.runs)
    print_simulated()


if __name__ == "__main__":
    main()
