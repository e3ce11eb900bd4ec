"""Sizes of what the spatial pushbelt leaves out: left_out.py TABLE.csv, of its defaults and of stored runs.

A loose sheave on the belt as a mass on a spring: its frequency along the axis. Torsion of the rings' strips
over what the tension of both packages holds against roll. Both are estimates, with the assumptions below.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from cvt_hpc import load_job
from cvt_hpc.models.spatial_pushbelt.parameters import package_arm
from cvt_hpc.physics.geometry import variator
from cvt_hpc.storage.provenance import origin_lines

HERE = Path(__file__).parent
# ASSUMPTION: the inertia of a pulley is that of a disc of this radius, of which a sheave is half the mass
RADIUS = 0.075  # [m]
MODULUS, POISSON = 210e9, 0.3  # [Pa] of steel
LAYER = 0.185e-3  # [m] ASSUMPTION: thickness of a ring layer, which twists by itself


def sheave_frequency(p):
    """Frequency along its axis of the loose driven sheave on elements that stick [Hz]."""
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    elements = p["flank_stiffness"] * path.driven_radius * path.driven_wrap
    stiffness = 1.0 / (1.0 / p["driven_modal_stiffness"][0] + 1.0 / elements)
    return np.sqrt(stiffness * RADIUS**2 / p["driven_inertia"]) / (2.0 * np.pi)


def torsion_share(p, tension):
    """Torsional stiffness of all strips over that of the tension [N] of both packages at their arms."""
    area = p["ring_stiffness"] / MODULUS
    return area * LAYER**2 / 3.0 * MODULUS / (2.0 + 2.0 * POISSON) / (tension * package_arm(p) ** 2)


if __name__ == "__main__":
    parameters = load_job(HERE / "spatial_push_force.toml").point(0)
    runs = pd.read_csv(HERE / "results" / "spatial_push_force.csv", comment="#")
    tension = runs[["mean_ring_tension_t1 [N]", "mean_ring_tension_t2 [N]"]].to_numpy()
    rows = [
        ("axial frequency of a sheave [Hz]", sheave_frequency(parameters)),
        ("torsion of the rings, least tension", torsion_share(parameters, tension.min())),
        ("torsion of the rings, largest tension", torsion_share(parameters, tension.max())),
    ]
    with open(sys.argv[1], "w", newline="", encoding="utf-8") as file:
        file.writelines(origin_lines())
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("part", "size"))
        table.writerows((name, f"{value:.4g}") for name, value in rows)
