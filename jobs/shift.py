"""Rates of the speed ratio over the ratio of the clamping forces: shift.py TABLE.csv, of cells of shift.toml.

Of each cell: the ratio of the forces of both sheaves at which the ratio of the speeds stays, and the slope of
its rate over the logarithm of the forces' ratio, divided by the driving pulley's speed, with the largest
deviation from that line as a share of the largest rate.
"""

import csv
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from cvt_hpc import simulate
from cvt_hpc.experiments.ladder.loading import pushbelt_jobs
from cvt_hpc.job import Job, load_job
from cvt_hpc.storage.provenance import origin_lines

JOB = Path(__file__).with_suffix(".toml")
FORCES = 0.8, 0.9, 1.1, 1.25  # on the driving sheave, of that which holds the ratio
MIDDLE = {"ratio": [1.0], "driving_speed": ["2000 rpm"]}
CELLS = (  # of the job: at one load; in the middle, between rigid sheaves; there, at the other loads
    {"load_share": [0.3], "sheave_stiffness": [1.0]},
    MIDDLE | {"load_share": [0.3], "sheave_stiffness": [np.inf]},
    MIDDLE | {"thrust": ["20 kN"], "load_share": [0.0, 0.6, 0.9], "sheave_stiffness": [1.0]},
)
HEAD = (
    "model", "ratio", "driving_speed [rpm]", "thrust [kN]", "load_share", "sheave_stiffness", "thrust_ratio",
    "slope_per_driving_speed", "share_off_the_line", "core_s",
)  # fmt: skip
BELTS = {"elastic_belt": {"driving_axial": "thrust"}, "pushbelt": {}}  # what frees the driving sheave of each


def measured(job: Job) -> tuple[float, float, float, float]:
    """Ratio of the forces that holds, slope over the driving speed, largest deviation, and core-seconds."""
    held = simulate(job)
    force, free = float(held["axial_force"][0]), BELTS[job.model]
    runs = [held, *(simulate(job, free | {"driving_thrust": share * force}) for share in FORCES)]
    # of the belt's own forces: without those of the dampers behind the sheaves
    logarithms = np.log([float(run["thrust_ratio"] / held["thrust_ratio"]) for run in runs])
    rates = np.array([float(run["shift_speed"]) for run in runs])
    slope = (logarithms @ rates) / (logarithms @ logarithms)
    off = np.abs(rates - slope * logarithms).max() / np.abs(rates).max()
    cost = sum(float(run["core_seconds"]) for run in runs)
    return float(held["thrust_ratio"]), slope / job.parameters["driving_speed"], off, cost


def rows() -> Iterator[tuple[str, ...]]:
    """Yield the lines of the table."""
    for chosen in CELLS:
        axes = load_job(JOB, chosen).axes
        for place in product(*(axis.values for axis in axes)):
            at = dict(zip([axis.name for axis in axes], map(float, place), strict=True))
            cell = load_job(JOB, at)
            speed, thrust = at["driving_speed"] * 30.0 / np.pi, at["thrust"] * 1e-3
            where = at["ratio"], speed, thrust, at["load_share"], at["sheave_stiffness"]
            for belt in (cell, pushbelt_jobs(cell, {})[0]):
                yield belt.model, *(f"{value:.4g}" for value in (*where, *measured(belt)))


if __name__ == "__main__":
    with open(sys.argv[1], "w", newline="", encoding="utf-8") as file:
        file.writelines(origin_lines())
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEAD)
        for row in rows():
            table.writerow(row)
            file.flush()
