"""Losses of a pushbelt over a driving cycle: losses.py TABLE.csv, of losses.toml and driving_cycle.csv.

Each phase is a run of its own, with the thrust that holds the torque ratio, load over the torque that
friction carries, at each of HELD; the higher, the nearer to slip. The last row of each is the mean over the
cycle. Bearings of both shafts have the frictional moment 0.5 mu F d, the estimate of bearing makers'
catalogues, by the radial force F of both strands and the bore d.
"""

import csv
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from cvt_hpc import load_job, simulate
from cvt_hpc.physics.geometry import variator
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.tables import below_origin

JOB = Path(__file__).with_suffix(".toml")
CYCLE = Path(__file__).with_name("driving_cycle.csv")
HELD = 0.3, 0.45, 0.6  # at 0.7 the belt slips through in the first phase, at its driving pulley
BEARING_FRICTION, BORE = 0.0015, 0.04  # ASSUMPTION: ball bearings with a bore of 40 mm
RPM = math.pi / 30.0
LOSSES = ("flanks", "rings", "between_elements", "inside_belt", "bearings")
HEAD = (
    "torque_ratio", "phase", "duration [s]", "thrust [kN]", *(f"{name} [W]" for name in LOSSES), "loss [W]",
    "driving_power [W]", "efficiency", "core_s",
)  # fmt: skip


def bearing_loss(run: xr.Dataset, p: dict[str, float]) -> float:
    """Friction power of the bearings of both shafts [W], of a run with these parameters [SI]."""
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    speeds = np.array([p["driving_speed"], p["driving_speed"] / p["ratio"]])
    flux = (p["element_mass"] + p["ring_mass"]) * (path.driving_radius * speeds[0]) ** 2
    t1, t2 = (run["mean_ring_tension"] - run["mean_push_force"]).values - flux
    tilt = 0.5 * (path.driven_wrap - math.pi)  # of either strand against the line of the centres
    force = math.hypot((t1 + t2) * math.cos(tilt), (t2 - t1) * math.sin(tilt))
    return float(0.5 * BEARING_FRICTION * BORE * force * speeds.sum())


def of_phase(phase: dict[str, str], held: float) -> np.ndarray:
    """Thrust [N], losses in the order of LOSSES [W], driving power [W] and core-seconds of a phase."""
    at = {"ratio": float(phase["ratio"]), "driving_speed": float(phase["driving_speed [rpm]"]) * RPM}
    job = load_job(JOB)
    p = job.point_at(at | {"load_share": held, "thrust": 1e4})
    thrust = 1e4 * float(phase["load [N m]"]) / p["load"]  # friction carries in proportion to it
    run = simulate(job, at | {"load_share": held, "thrust": thrust})
    losses = (
        run["flank_loss"].sum(), run["ring_loss"], run["element_loss"] + run["tilt_loss"],
        run["belt_loss"] + run["stretch_loss"] + run["lag_loss"],
    )  # fmt: skip
    bearings = bearing_loss(run, p | {"thrust": thrust})
    return np.array(
        [thrust, *map(float, losses), bearings, float(run["driving_power"]), float(run["core_seconds"])]
    )


def rows() -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table."""
    with CYCLE.open(encoding="utf-8") as source:
        phases = list(csv.DictReader(below_origin(source)))
    weights = np.array([float(phase["duration [s]"]) for phase in phases])
    for held in HELD:
        found = np.array([of_phase(phase, held) for phase in phases])
        mean = np.average(found, axis=0, weights=weights)
        mean[-1] = found[:, -1].sum()
        names = [phase["phase"] for phase in phases] + ["cycle"]
        for name, time, (thrust, *losses, power, cost) in zip(
            names, [*weights, weights.sum()], [*found, mean], strict=True
        ):
            numbers = thrust * 1e-3, *losses, sum(losses), power, 1.0 - sum(losses) / power, cost
            yield f"{held:g}", name, f"{time:g}", *(f"{value:.4g}" for value in numbers)


if __name__ == "__main__":
    with open(sys.argv[1], "w", newline="", encoding="utf-8") as file:
        file.writelines(origin_lines())
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEAD)
        table.writerows(rows())
