"""Proves runs bit for bit against plain numba: the same runs without the package's own way to compile.

    .venv/bin/python tests/plain_numba.py

Each run is made by two processes. One takes the machine code that is kept, as every command does. In the other
`kernel` and `merged_kernel` are `numba.njit(cache=True)` with an empty cache, and nothing of `cvt_hpc.kernels`
is imported.
"""

import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import numpy as np
import xarray as xr

JOBS = Path(__file__).parents[1] / "jobs"
RUNS = {
    "elastic belt": ("quickstart.toml", "load=100 N m", ["duration=40 ms", "rise_time=4 ms"]),
    "pushbelt": (
        "push_force.toml",
        "load_share=0.3",
        [
            *("duration=40 ms", "longest_duration=40 ms", "rise_time=4 ms"),
            *("thrust=20 kN", "elements=104", "band_high=1000 Hz"),
        ],
    ),
}
MEASURED = {"core_seconds"}  # differs between any two runs


def take_plain_numba():
    """Give this process another module of kernels."""
    import numba

    plain = ModuleType("cvt_hpc.kernels")
    plain.kernel = plain.merged_kernel = numba.njit(cache=True, error_model="numpy")
    plain.called_alike = lambda compiled: compiled
    sys.modules[plain.__name__] = plain


def simulate(how, run, folder):
    """The history of a run, of a process that compiles in one of two ways."""
    job, at, values = RUNS[run]
    folder = Path(folder) / how / job
    folder.mkdir(parents=True)
    arguments = [str(JOBS / job), "--at", at, "--out", str(folder / "history.nc")]
    for value in values:
        arguments += ["--set", value]
    subprocess.run(
        [sys.executable, __file__, how, "simulate", *arguments],
        env=os.environ | ({"NUMBA_CACHE_DIR": str(folder)} if how == "plain" else {}),
        stdout=subprocess.DEVNULL,
        check=True,
    )
    with xr.open_dataset(folder / "history.nc") as found:
        return found.load()


def differences(one, other):
    """The names of what is not the same in two datasets, bit for bit."""
    names = set(one.variables) | set(other.variables)
    return sorted(name for name in names - MEASURED if not same(one.get(name), other.get(name)))


def same(one, other):
    if one is None or other is None or one.dtype != other.dtype or one.shape != other.shape:
        return False
    if one.dtype.kind == "O":
        return bool((one.values == other.values).all())
    return np.ascontiguousarray(one.values).tobytes() == np.ascontiguousarray(other.values).tobytes()


def main():
    status = 0
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor() as pool:
        made = {run: [pool.submit(simulate, how, run, folder) for how in ("plain", "ours")] for run in RUNS}
        for run, both in made.items():
            plain, ours = (history.result() for history in both)
            found = differences(ours, plain)
            print(
                f"{run}: {len(ours.variables)} variables",
                f"differ in {', '.join(found)}" if found else "are the same",
            )
            status = status or bool(found)
    return int(status)


if __name__ == "__main__":
    if len(sys.argv) == 1:
        sys.exit(main())
    if sys.argv.pop(1) == "plain":
        take_plain_numba()
    from cvt_hpc.cli import main as command

    sys.exit(command())
