"""Random scenes of the steady variator: which have a state, and what it costs.

    PYTHONPATH=tests python tests/benchmarks/steady_scenes.py [scenes] > jobs/results/steady_scenes.csv

Ratios 0.4-2.6, speeds to 500 rad/s (one in seven at rest), thrusts 5-80 kN, loads to 0.95 of what friction carries
of either sign (one in seven none), sheaves from half as stiff to rigid, gradients to -1.2 s/m; 96 stations.
"""

import csv
import sys

import numpy as np
from scipy.stats import qmc

from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.variables import Status, Vibrates
from support.rungs import rung_record

BELT = {"belt_length": 0.6612, "centre_distance": 0.155, "stations": 96, "stiffness_of": "sheave"}


def scenes() -> list[dict[str, float]]:
    """Parameters [SI] of 128 scenes."""
    found = []
    for x in qmc.Sobol(8, seed=11).random_base2(7):
        scene = {
            "ratio": 0.4 * 6.5 ** x[0],
            "driving_speed": 500.0 ** x[1] if x[1] > 0.15 else 0.01,
            "thrust": 5e3 * 16.0 ** x[2],
            "load_share": -0.95 + 1.9 * x[3] if x[7] > 0.15 else 0.0,
            "sheave_stiffness": np.inf if x[4] > 0.9 else 0.5 * 10.0 ** (x[4] / 0.9),
            "friction_gradient": -1.2 * x[5],
            "kinetic_friction": 0.06 + 0.06 * x[6],
        }
        found.append({key: float(value) for key, value in scene.items()})
    return found


def outcome(record: dict) -> str:
    """What became of a scene, in a word."""
    if record["status"] != Status.DONE:
        return "none found"
    return "slips" if record["vibrates"] == Vibrates.SLIPS else "state"


if __name__ == "__main__":
    sys.stdout.writelines(origin_lines())
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["scene", *scenes()[0], "outcome", "slip_margin", "core_seconds", "reason"])
    for k, scene in enumerate(scenes()[: int(sys.argv[1]) if len(sys.argv) > 1 else None]):
        record = rung_record("steady_variator", **BELT, **scene)
        given = [f"{value:.4g}" for value in scene.values()]
        margin = record.get("slip_margin", np.nan)
        seen = [outcome(record), f"{margin:.3f}", f"{record['core_seconds']:.2f}", record["reason"]]
        rows.writerow([k, *given, *seen])
        sys.stdout.flush()
