"""What the elastic belt costs with ring layers, shafts, lagging tilts and w_ij, beside the lumped belt.

    python tests/benchmarks/full_variator.py [--turns 3] [--duration 0.2]

Core-seconds per simulated second at 160 stations and the default step: of a run alone, as `simulate` does it,
and of each of 16 in lanes, as a sweep does them; the least of a few turns. Prints a table. Takes a minute, and
three more where the kernels are not compiled; the machine ought to be idle.
"""

import argparse
from pathlib import Path

import numpy as np

from cvt_hpc import simulate
from cvt_hpc.job import Job, load_job
from cvt_hpc.simulation import run_points

JOB = Path(__file__).parents[2] / "jobs" / "sheave_deformation.toml"
MARKS = 4.0, 0.6  # of the full variator, alone and in lanes
LOAD, LOADS = 120.0, np.linspace(75.0, 150.0, 16)  # [N m]
LAYERS = {"ring_layers": 9}
# the shaft of jobs/pulleys.sh and its collar, which leave the driven pulley as stiff as it is by default
SHAFT = {
    "shaft_lengths": [0.03, 0.05, 0.06, 0.05, 0.03],
    "shaft_diameters": [0.03, 0.04, 0.045, 0.04, 0.03],
    "bearing_positions": [0.015, 0.205],
    "seat_positions": [0.085, 0.135],
    "tilt_stiffness": 3.94e5,
    "tilt_lag": 2e-3,
}
PARTS = {
    "lumped belt": {},
    "9 ring layers": LAYERS,
    "9 ring layers, shaft, tilt": LAYERS | SHAFT,
    "9 ring layers, shaft, tilt, w_ij": LAYERS | SHAFT | {"sheave_deformation": "flexibilities"},
}


def job(part: dict, duration: float) -> Job:
    """A job whose runs take one transient each."""
    once = {"duration": duration, "longest_duration": duration, "most_refinements": 0, "stations": 160}
    return load_job(JOB, {"sheave_deformation": "bending"} | once | part)


def costs(asked: Job) -> tuple[float, float]:
    """Core-seconds per simulated second: alone, and of a run in lanes."""
    alone = simulate(asked, {"load": LOAD})
    points = [asked.point_at({"load": load}) for load in LOADS]
    records = run_points(asked, points, lambda: None)
    spent, simulated = (
        sum(record[f"{kind}_seconds"] for record in records) for kind in ("core", "simulated")
    )
    return float(alone["core_seconds"] / alone["simulated_seconds"]), spent / simulated


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--turns", type=int, default=3, help="of which the least counts (3)")
    parser.add_argument("--duration", type=float, default=0.2, help="of a run [s] (0.2)")
    arguments = parser.parse_args()
    jobs = {name: job(part, arguments.duration) for name, part in PARTS.items()}
    # parts take turns, so that other work on the machine meets all of them
    turns = [[costs(asked) for asked in jobs.values()] for _ in range(arguments.turns)]
    found = np.min(turns, axis=0)
    print("| core-s per simulated s | alone | in 16 lanes, per run | in lanes, multiple of lumped |")
    print("|---|---|---|---|")
    for name, (alone, in_lanes) in zip(jobs, found, strict=True):
        print(f"| {name} | {alone:.2f} | {in_lanes:.2f} | {in_lanes / found[0, 1]:.1f} |")
    print(f"| mark of the last row | {MARKS[0]:g} | {MARKS[1]:g} | |")


if __name__ == "__main__":
    main()
