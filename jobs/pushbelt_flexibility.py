"""The pushbelt with a disc's flexibilities w_ij, by harmonics: pushbelt_flexibility.py TABLE.csv

Flexibilities of a body of revolution depend on the angle between two places alone, w_ij = w(phi_i - phi_j).
So each sheave opens by sum_n c_n cos n(phi_i - phi_j) of the axial force at j. Modes 1, cos, sin, cos 2, ...
with stiffness 1 / c_n do the same: `driving_modal_stiffness` and `driven_modal_stiffness` take such a table
as its harmonics. Those of jobs/sheave are the discs of sheave_deformation.toml, which tilt on their collar
too. The belt is that of pushbelt_vibration.toml with constant friction, at loads at which it does not vibrate
between these soft discs; beside it the continuous belt with the table itself.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import xarray as xr

from cvt_hpc import load_job, simulate
from cvt_hpc.storage.provenance import origin_lines

JOBS = Path(__file__).parent
SHEAVES = 2  # of a groove, by both of which the files' grooves open
MOST = 2, 4, 8  # harmonics
LOADS = 20.0, 60.0  # [N m]
SHORT = {"friction_gradient": 0.0, "duration": 0.15, "longest_duration": 0.15}
TABLES = {f"{pulley}_flexibility_file": f"sheave/{pulley}.nc" for pulley in ("driving", "driven")}
W_IJ = TABLES | {"sheave_deformation": "flexibilities", "driving_modes_file": "", "driven_modes_file": ""}
HEAD = (
    "model", "harmonics", "load", "vibrates", "mean_push_force_t1 [N]", "mean_ring_tension_t1 [N]",
    "mean_ring_tension_t2 [N]", "axial_force_driving [N]", "loss [W]", "power_residual", "core_seconds",
)  # fmt: skip


def stiffness(pulley, most, collar, radius):
    """Stiffness of a sheave's modes of opening [N/m], of a collar [N m/rad] at a pitch radius [m]."""
    with xr.open_dataset(JOBS / "sheave" / f"{pulley}.nc") as discs:
        c = discs["modal_flexibility"].groupby(discs["harmonic"]).sum().to_numpy()[: most + 1] / SHEAVES
    c[1] += radius**2 / (2.0 * collar)
    return [1.0 / c[0], *np.repeat(1.0 / c[1:], 2)]


def runs():
    """Yield model, harmonics, load [N m] and dataset of each run."""
    belt, pushbelt = (
        load_job(JOBS / "sheave_deformation.toml", W_IJ),
        load_job(JOBS / "pushbelt_vibration.toml"),
    )
    for load in LOADS:
        yield "elastic_belt", "", load, simulate(belt, SHORT | {"load": load})
    p = belt.parameters
    radii = {"driving": p["driven_radius"] / p["ratio"], "driven": p["driven_radius"]}
    for most in MOST:
        modes = {
            f"{pulley}_modal_stiffness": stiffness(pulley, most, p["tilt_stiffness"], radius)
            for pulley, radius in radii.items()
        }
        for load in LOADS:
            at = SHORT | modes | {"local_stiffness": np.inf, "load": load}
            yield "pushbelt", most, load, simulate(pushbelt, at)


def row(model, harmonics, load, run):
    """Return a line of the table."""
    numbers = (
        *run["mean_push_force"].values[:1], *run["mean_ring_tension"].values, run["axial_force"].values[0],
        run["loss"], run["power_residual"], run["core_seconds"],
    )  # fmt: skip
    verdict = run["vibrates"].attrs["flag_meanings"].split()[int(run["vibrates"])]
    return [model, harmonics, f"{load:g}", verdict, *(f"{float(number):.6g}" for number in numbers)]


if __name__ == "__main__":
    with open(sys.argv[1], "w", newline="", encoding="utf-8") as file:
        file.writelines(origin_lines())
        csv.writer(file, lineterminator="\n").writerows([HEAD, *(row(*found) for found in runs())])
