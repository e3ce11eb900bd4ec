"""Descriptions of the sheaves' discs side by side, over the loads of sheave_deformation.toml.

python jobs/sheave_deformation.py [TABLE.csv]; by default jobs/results/sheave_deformation.csv. Of each run:
vibration, axial force, how the contact force is distributed over the driven arc, efficiency, and cost.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from cvt_hpc import simulate
from cvt_hpc.job import load_job
from cvt_hpc.storage.provenance import origin_lines

JOBS = Path(__file__).parent
NO_MODES = {"driving_modes_file": "", "driven_modes_file": ""}
RITZ = {"sheave_deformation": "ritz"}
BENDING = {"sheave_deformation": "bending"} | NO_MODES
W_IJ = {
    "sheave_deformation": "flexibilities",
    "driving_flexibility_file": "sheave/driving.nc",
    "driven_flexibility_file": "sheave/driven.nc",
} | NO_MODES
PARTS = {
    "bending": BENDING,
    "bending x 1.5": BENDING | {"sheave_stiffness": 1.5},
    "rigid": BENDING | {"sheave_stiffness": np.inf},
    # r^2 over what the driven discs' harmonic 1 gives
    "cone": {"sheave_deformation": "cone", "cone_stiffness": "1.2e6 N m/rad"} | NO_MODES,
    "w_ij": W_IJ,
    "w_ij x 1.5": W_IJ | {"sheave_stiffness": 1.5},
    "modes at rest": RITZ | {"ritz_limit": 0.0},
    "ritz": RITZ,
    "ritz 2.3 us": RITZ | {"step": 2.3e-6},
    "ritz, damping 0.05": RITZ | {"disc_damping": 0.05},
    "ritz, 4 modes": RITZ | {"ritz_modes": 4},
    "ritz, 8 modes": RITZ | {"ritz_modes": 8},
    "ritz, 16 modes": RITZ | {"ritz_modes": 16},
    "ritz, 40 modes": RITZ | {"ritz_modes": 40},
}
HEAVY = {"ritz, mass x 4": 4.0, "ritz, mass x 16": 16.0}  # frequencies / 2 and / 4
HEAD = (
    "part", "load [N m]", "vibrates", "amplitude_t1 [um]", "amplitude_t2 [um]", "frequency_t1 [Hz]",
    "frequency_t2 [Hz]", "axial_force_driving [N]", "largest_force_driven [kN/m]",
    "share_of_first_fifth", "share_of_last_fifth", "efficiency", "power_residual", "core_s_per_s",
)  # fmt: skip


def runs():
    """Yield name, load [N m] and dataset of each run."""
    warm = {"duration": 0.06}  # no longer than that
    job = load_job(JOBS / "sheave_deformation.toml")
    for name, part in (PARTS | HEAVY).items():
        if name in HEAVY:
            part = dict(RITZ)
            for pulley in ("driving", "driven"):
                for key in ("harmonic", "flexibility", "mass"):
                    values = job.parameters[f"{pulley}_mode_{key}"]
                    factor = HEAVY[name] if key == "mass" else 1.0
                    part[f"{pulley}_mode_{key}"] = [factor * value for value in values]
                part[f"{pulley}_modes_file"] = ""
        asked = load_job(JOBS / "sheave_deformation.toml", part)
        simulate(asked, warm)  # its machine code is there before time is taken
        for load in asked.axes[0].values:
            yield name, load, simulate(asked, {"load": load})


def row(name, load, run):
    """Return a line of the table."""
    force, place = driven(run)
    cell = np.gradient(place)
    share = (place - place[0]) / (place[-1] - place[0])
    parts = force * cell / (force * cell).sum()
    numbers = [
        float(run[key].sel(strand=strand)) for key in ("amplitude", "frequency") for strand in ("t1", "t2")
    ]
    return [
        name, f"{load:g}", run["vibrates"].attrs["flag_meanings"].split()[int(run["vibrates"])],
        *(f"{1e6 * value:.2f}" for value in numbers[:2]), *(f"{value:.1f}" for value in numbers[2:]),
        f"{float(run['axial_force'].sel(pulley='driving')):.6g}",
        f"{1e-3 * force.max():.4g}",
        f"{parts[share <= 0.2].sum():.4f}", f"{parts[share >= 0.8].sum():.4f}",
        f"{float(run['efficiency']):.5f}", f"{float(run['power_residual']):.5f}",
        f"{float(run['core_seconds']) / float(run['time'][-1]):.3f}",
    ]  # fmt: skip


def driven(run):
    """Mean axial line force [N/m] and place [m] over the driven arc."""
    force = run["contact_force"].values
    closed = np.flatnonzero(np.isfinite(run["wrap_angle"].values))
    arc = np.split(closed, np.flatnonzero(np.diff(closed) > 1) + 1)[1]
    return force[arc], run["position"].values[arc]


if __name__ == "__main__":
    table = Path(sys.argv[1]) if len(sys.argv) > 1 else JOBS / "results" / "sheave_deformation.csv"
    rows = []
    for found in runs():
        rows.append(row(*found))
        print(",".join(rows[-1]), flush=True)
    with table.open("w", encoding="utf-8", newline="") as out:
        out.writelines(origin_lines())
        csv.writer(out, lineterminator="\n").writerows([HEAD, *rows])
