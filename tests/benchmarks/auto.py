"""Model auto against all transients: classes, one by one, and cost; the table of models/auto/README.md.

python tests/benchmarks/auto.py out/against
python tests/benchmarks/auto.py out/against --table jobs/results/auto.csv

Does jobs/auto.toml four times: in full and by auto, each on the whole grid and along the boundaries alone. Runs of
which the classes differ are done once more, for four times as long, to see who is right. Takes 15 minutes of
an idle core, and goes on where it was broken off.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
import xarray as xr

from cvt_hpc.job import Job, build_job, load_job
from cvt_hpc.job.definition import handed_to
from cvt_hpc.models.auto.rules import Rung
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study import open_results, run
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs

JOB = Path(__file__).parents[2] / "jobs" / "auto.toml"
LONGER = 4.0
QUIET, VIBRATING, UNDECIDED, FAILED, *_ = OccurrenceClass


def jobs() -> dict[str, Job]:
    """The four, and the longer one, by name."""
    traced = load_job(JOB)
    grid = load_job(JOB, ["design.kind=grid"])
    why, longer = "each run in full", {"run.duration": LONGER * grid.parameters["duration"]}
    document = handed_to(grid, "elastic_belt", why)
    full, long = build_job(document, str(JOB)), build_job(document, str(JOB), longer)
    full_traced = build_job(handed_to(traced, "elastic_belt", why), str(JOB))
    return {"full": full, "full traced": full_traced, "auto": grid, "traced": traced, "longer": long}


def classes(dataset: xr.Dataset) -> np.ndarray:
    """Class of each cell, inferred where it was not run."""
    if "inferred_class" in dataset:
        return dataset["inferred_class"].values.ravel()
    return classify_runs(dataset["status"].values, dataset["vibrates"].values).ravel()


def compare(name: str, full: xr.Dataset, other: xr.Dataset) -> np.ndarray:
    """Print costs and how many cells of each class are of which class; return where the classes differ."""
    costs = [float(dataset["core_seconds"].sum()) for dataset in (full, other)]
    print(f"{name}: {costs[1]:.3g} against {costs[0]:.4g} core-s, {costs[1] / costs[0]:.1%}")
    if "rung" in other:
        print("  rungs:", {rung.name.lower(): int((other["rung"] == rung).sum()) for rung in Rung if rung})
    one, two = classes(full), classes(other)
    for asked in (QUIET, VIBRATING, UNDECIDED, FAILED):
        found = {kind.label: int((two[one == asked] == kind).sum()) for kind in OccurrenceClass}
        print(f"  {asked.label} in full: {sum(found.values())}; here {found}")
    decided = np.isin(one, (QUIET, VIBRATING))
    for cells, said in ((decided, "decided in full"), (np.ones_like(decided), "all")):
        wrong = int((one != two)[cells].sum())
        print(f"  of the cells {said} {1 - wrong / cells.sum():.2%} are of the same class ({wrong} are not)")
    return one != two


def main() -> None:
    """Run, compare, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the runs")
    parser.add_argument("--table", type=Path, help="where to write the cells that differ")
    arguments = parser.parse_args()
    asked = jobs()
    names = [name for name in asked if name != "longer"]
    for name in names:
        run(asked[name], arguments.out / name)
    found = {name: open_results(arguments.out / name).load() for name in names}
    compare("full, traced", found["full"], found.pop("full traced"))
    differs = compare("auto", found["full"], found["auto"])
    differs |= compare("auto, traced", found["full"], found["traced"])
    run(asked["longer"], arguments.out / "longer", chosen=lambda: differs)
    found["longer"] = open_results(arguments.out / "longer").load()
    all_classes = {name: classes(dataset) for name, dataset in found.items()}
    rows = []
    for index in np.flatnonzero(differs):
        place = np.unravel_index(index, asked["full"].shape)
        values = [f"{axis.values[k]:g}" for axis, k in zip(asked["full"].axes, place, strict=True)]
        words = [OccurrenceClass(int(all_classes[name][index])).label for name in found]
        auto = found["auto"]
        rung = Rung(int(auto["rung"].values[place])).name.lower()
        rows.append([*values, *words, rung, f"{auto['margin'].values[place]:.3g}"])
    for name in ("auto", "traced"):
        own = all_classes[name] != all_classes["full"]
        decided = own & np.isin(all_classes["longer"], (QUIET, VIBRATING))
        right = (all_classes[name] == all_classes["longer"])[decided].sum()
        print(
            f"{name}: of {own.sum()} that differ the longer run decides {decided.sum()}, {right} as {name} does"
        )
    if arguments.table:
        with arguments.table.open("w", newline="") as file:
            file.writelines(origin_lines())
            writer = csv.writer(file, lineterminator="\n")
            names = [axis.name for axis in asked["full"].axes]
            writer.writerow([*names, *found, "rung of auto", "margin of auto"])
            writer.writerows(rows)


if __name__ == "__main__":
    main()
