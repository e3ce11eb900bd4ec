"""What it takes to draw large studies: `map` of 10^5 cells in one panel and in twelve, `report` of 10^4 runs.

    python tests/benchmarks/pictures.py [--table jobs/results/pictures.csv]

Each is a command line of its own, from its start to its end, and the fastest of REPEATS: the time on the clock, the
processor time and the peak memory. The results are made up, a window of vibration in load.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from cvt_hpc.storage.provenance import origin_lines  # noqa: E402
from support.studies import study  # noqa: E402

REPEATS = 3
MEGA = 1e6
# command, and how many gradients, stiffnesses and loads its study has
TASKS = {
    "map, 1 panel": ("map", (250, 1, 400)),
    "map, 12 panels": ("map", (84, 12, 100)),
    "report": ("report", (50, 4, 50)),
}


def measure(command: str, results: Path) -> tuple[float, float, float]:
    """Time on the clock [s], processor time [s] and peak memory [MB] of a command about results."""
    began = time.perf_counter()
    arguments = [sys.executable, "-m", "cvt_hpc", command, str(results)]
    child = os.posix_spawn(
        sys.executable,
        arguments,
        os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
    )
    _, status, used = os.wait4(child, 0)
    if status:
        raise SystemExit(f"{command} ended with status {os.waitstatus_to_exitcode(status)}")
    return time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / MEGA


def main() -> None:
    """Measure all tasks, print a table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--table", type=Path, help="file for the table, .csv")
    table = parser.parse_args().table
    rows = [["task", "runs", "clock [s]", "processor [s]", "peak memory [MB]"]]
    with tempfile.TemporaryDirectory() as folder:
        for task, (command, (gradients, stiffnesses, loads)) in TASKS.items():
            made = study(
                np.linspace(-2.4, -0.4, gradients),
                tuple(np.linspace(1.0, 3.0, stiffnesses)),
                np.linspace(20.0, 200.0, loads),
            )
            made.to_netcdf(results := Path(folder) / "results.nc")
            clock, processor, memory = map(
                min, zip(*(measure(command, results) for _ in range(REPEATS)), strict=True)
            )
            rows.append([task, str(made["status"].size), f"{clock:.1f}", f"{processor:.1f}", f"{memory:.0f}"])
    for row in rows:
        print("  ".join(f"{cell:>16}" for cell in row))
    if table:
        with table.open("w", newline="") as file:
            file.writelines(origin_lines())
            csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
