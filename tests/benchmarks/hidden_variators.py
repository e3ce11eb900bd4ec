"""Hidden variators found again: elastic belts whose noise a rig has measured, by `calibrate`.

    OMP_NUM_THREADS=1 python tests/benchmarks/hidden_variators.py OUT > jobs/results/hidden_variators.csv

The uncertain parameters of jobs/uncertain_lebrecht.toml, of which SAMPLES are candidates. HIDDEN others play the
variator: the noise of each is measured at all loads, one cell in twenty wrongly, frequencies with an error of 20 Hz.
A line for each parameter of each: its value, the 95 % band before and after, and whether it lies inside; and one
for the combination of all of which the noise tells most, in standard deviations. Some eight core-minutes; what OUT
has of it is not run again.
"""

import csv
import sys
import warnings
from pathlib import Path

import numpy as np
from scipy.stats import norm

from cvt_hpc import load_job, open_results, run
from cvt_hpc.experiments.calibrate import BAND, STANDARD, load, told_best, weigh
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.variables import Vibrates

JOB = Path(__file__).parents[2] / "jobs" / "uncertain_lebrecht.toml"
SAMPLES, HIDDEN, WRONG, SCATTER = 256, 16, 0.05, 20.0  # candidates, variators, share of cells, [Hz]
HEAD = (
    "load_from [N m],load_to [N m],measured_load_from [N m],measured_load_to [N m],"
    "frequency_from [Hz],frequency_to [Hz]"
)


def measured_by(results, sample: int, rng: np.random.Generator) -> str:
    """Return what a rig tells of one variator, as a measured file: windows of load with their frequency."""
    one = results.isel(sample=sample)
    loads, noisy = one["load"].values, one["vibrates"].values == Vibrates.YES
    frequency = one["frequency"].values[np.arange(loads.size), one["amplitude"].argmax("strand").values]
    rows = [HEAD]
    for k, heard in enumerate(noisy ^ (rng.random(loads.size) < WRONG)):
        told = (frequency[k] if noisy[k] else np.nanmedian(frequency)) + rng.normal(0.0, SCATTER)
        reach = (1.0, 1.0) if heard else (0.0, 0.0)  # a window of no width is silence
        if heard or k == 0:
            ends = loads[k] - reach[0], loads[k] + reach[1], loads[0], loads[-1], told, told
            rows.append(",".join(f"{value:.6g}" for value in ends))
    return "\n".join([*rows, ""])


def main(out: Path) -> None:
    """Run what is not there yet, and print a line for each parameter of each hidden variator."""
    warnings.simplefilter("ignore")
    common = {"uncertain.indices": False}
    run(load_job(JOB, overrides=common | {"uncertain.samples": SAMPLES}), out / "candidates")
    run(load_job(JOB, overrides=common | {"uncertain.samples": 16, "uncertain.seed": 7}), out / "hidden")
    writer, rng = csv.writer(sys.stdout, lineterminator="\n"), np.random.default_rng(1)
    sys.stdout.writelines(origin_lines())
    writer.writerow(["variator", "parameter", "hidden", "before_low", "before_high", "low", "high", "inside"])
    with open_results(out / "candidates") as candidates, open_results(out / "hidden") as hidden:
        for sample in range(HIDDEN):
            rig = out / f"rig_{sample}.csv"
            rig.write_text(measured_by(hidden, sample, rng))
            asked = load(JOB, common | {"uncertain.samples": SAMPLES}, str(rig), scatter=f"{SCATTER} Hz")
            found = weigh(asked, candidates)
            true = [float(hidden[one.key].values[sample]) for one in found.distributions]
            rows = zip(
                [one.key for one in found.distributions], true, *zip(*found.bands(), strict=True), strict=True
            )
            told, pairs = told_best(asked, found), zip(found.distributions, true, strict=True)
            score = told.coefficients @ [norm.ppf(one.shares(np.array(value))) for one, value in pairs]
            together = "together", score, STANDARD.quantiles(BAND), told.after.quantiles(BAND)
            for key, value, before, after in (*rows, together):
                numbers = (f"{v:.5g}" for v in (value, *before[[0, 2]], *after[[0, 2]]))
                writer.writerow([sample, key, *numbers, int(after[0] <= value <= after[2])])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
