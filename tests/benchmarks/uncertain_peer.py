"""A study of uncertain parameters beside OpenTURNS, which draws its own samples and calls `simulate` for each.

    pip install -e ".[peers]"
    OMP_NUM_THREADS=1 python tests/benchmarks/uncertain_peer.py [--samples 512] [--table FILE.csv]

Four cells of jobs/uncertain_criterion.toml: probability of vibration with its interval, total-order indices of the
energy balance, and processor time of all runs. The distributions are stated twice, in the job and below.
"""

import argparse
import csv
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import openturns as ot

from cvt_hpc import load_job, open_results, run, simulate
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.variables import Vibrates

JOB = Path(__file__).parents[2] / "jobs" / "uncertain_criterion.toml"
CELLS = {"friction_gradient": [-1.4, -0.8], "radial_speed": [0.05, 0.19]}
SCATTER = {  # as in the job
    "stribeck_velocity": ot.TruncatedDistribution(
        ot.Normal(0.05, 0.01), 0.02, ot.TruncatedDistribution.LOWER
    ),
    "friction_memory": ot.ParametrizedDistribution(ot.LogNormalMuSigma(3e-4, 1e-4)),
    "transverse_damping": ot.Uniform(300.0, 700.0),
}
QUANTITY = "energy_balance"


def of_package(samples: int) -> tuple[dict[str, np.ndarray], float]:
    """Return results by name, over the cells, of a sweep with [uncertain], and its core-seconds."""
    changed = CELLS | {"uncertain.samples": samples, "uncertain.indices": True}
    job = load_job(JOB, overrides=changed)
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        run(job, Path(folder) / "out")
        with open_results(Path(folder) / "out") as results:
            told, indices = results.cvt.probability(), results.cvt.indices(QUANTITY)
            found = {key: told[f"vibration_probability{key}"].values.ravel() for key in ("", "_low", "_high")}
            for key in ("", "_low", "_high"):
                over = indices[f"total_order{key}"].transpose(*CELLS, ...).sel(parameter=list(SCATTER))
                found["total" + key] = over.values.reshape(-1, len(SCATTER))
        return found, time.process_time() - began


def of_openturns(samples: int) -> tuple[dict[str, np.ndarray], float]:
    """Return the same of samples by OpenTURNS."""
    job = load_job(JOB, overrides=[f"{key}={values[0]}" for key, values in CELLS.items()])
    began, found = time.process_time(), {"": [], "total": []}
    together = ot.JointDistribution(list(SCATTER.values()))
    drawn = np.array(ot.SobolIndicesExperiment(together, samples, False).generate())
    for gradient in CELLS["friction_gradient"]:
        for speed in CELLS["radial_speed"]:
            cell = {"friction_gradient": gradient, "radial_speed": speed}
            told = [simulate(job, cell | dict(zip(SCATTER, row.tolist(), strict=True))) for row in drawn]
            balance = np.array([[float(one[QUANTITY])] for one in told])
            verdicts = [int(one["vibrates"]) for one in told[:samples]]
            sides = verdicts.count(Vibrates.YES), verdicts.count(Vibrates.NO)
            found[""].append(sides[0] / sum(sides))
            indices = ot.JansenSensitivityAlgorithm(ot.Sample(drawn), ot.Sample(balance), samples)
            found["total"].append(np.array(indices.getTotalOrderIndices()))
    return {key: np.array(values) for key, values in found.items()}, time.process_time() - began


def main() -> None:
    """Do both studies and print what they found."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--samples", type=int, default=512, help="of each cell, a power of 2")
    options.add_argument("--table", type=Path)
    given = options.parse_args()
    warnings.simplefilter("ignore")
    for study in (of_package, of_openturns):  # compiles, before time is taken
        study(8)
    own, own_time = of_package(given.samples)
    peer, peer_time = of_openturns(given.samples)
    names = [f"total order of {name}" for name in SCATTER]
    rows: list[list[object]] = [["cell", "result", "here", "low", "high", "OpenTURNS"]]
    cells = [f"{g} s/m, {v} m/s" for g in CELLS["friction_gradient"] for v in CELLS["radial_speed"]]
    for k, cell in enumerate(cells):
        ends = [round(float(own[key][k]), 4) for key in ("", "_low", "_high")]
        rows.append([cell, "probability of vibration", *ends, round(float(peer[""][k]), 4)])
        for j, name in enumerate(names):
            ends = [round(float(own["total" + key][k, j]), 4) for key in ("", "_low", "_high")]
            rows.append([cell, name, *ends, round(float(peer["total"][k, j]), 4)])
    rows.append(["all", "core-seconds", round(own_time, 1), "", "", round(peer_time, 1)])
    with given.table.open("w", newline="") if given.table else sys.stdout as out:
        out.writelines(origin_lines())
        csv.writer(out, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
