"""How well ranks share a sweep: measured on a few, simulated on thousands.

    python tests/benchmarks/scheduling.py [--runs 400]

Measured under mpirun: what a claim takes, and the makespan of runs that sleep for heavy-tailed times, which
are predicted within a factor of two; beside it what the forecast says. Simulated: 10^6 such runs on 10 000 ranks, alone
and in batches of 16. Takes some three minutes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

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
CASES = (  # runs in a batch, tail and spread of the batches, ranks
    (1, TAIL, SPREAD, 10_000),
    (16, TAIL, SPREAD, 1_000),
    (16, TAIL, SPREAD, 10_000),
    (16, 0.0, SPREAD, 10_000),
    (16, 0.0, 0.1, 10_000),
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


def simulate_many(lanes: int, tail: float, spread: float, ranks: int) -> Forecast:
    """Return the forecast of 10^6 runs in batches of `lanes`, all runs of a batch alike."""
    generator = np.random.default_rng(0)
    batches = np.exp(tail * generator.standard_normal(MANY // lanes))
    groups = [tuple(range(first, first + lanes)) for first in range(0, MANY, lanes)]
    return forecast(groups, np.repeat(batches, lanes), known_fit(spread), ranks)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--stage", choices=STAGES, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.stage:
        STAGES[arguments.stage](arguments.folder, arguments.runs)
        return
    for ranks in RANKS:
        compare(ranks, arguments.runs)
    for case in CASES:
        started = time.perf_counter()
        found = simulate_many(*case)
        median, low, high = found.efficiency
        lanes, tail, spread, ranks = case
        print(f"10^6 runs in batches of {lanes} on {ranks} ranks, tail {tail:g}, spread {spread:g}:")
        print(
            f"  makespan {found.makespan[0] / found.bound:.4f} of the bound, efficiency {median:.3f}, ",
            end="",
        )
        print(f"95 % {low:.3f} to {high:.3f} ({time.perf_counter() - started:.0f} s)")


if __name__ == "__main__":
    main()
