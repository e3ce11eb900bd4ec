"""Proves runs bit for bit against plain numba: the same runs without the package's own way to compile.

    .venv/bin/python tests/plain_numba.py

Each run is made by two processes, with an empty cache each. In one `kernel` and `merged_kernel` are
`numba.njit(cache=True)`, and nothing of `cvt_hpc.kernels` is imported.
"""

import os
import subprocess
import sys
import tempfile
from functools import partial
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
    history = Path(folder) / f"{how}.nc"
    arguments = [str(JOBS / job), "--at", at, "--out", str(history)]
    for value in values:
        arguments += ["--set", value]
    with tempfile.TemporaryDirectory() as cache:
        subprocess.run(
            [sys.executable, __file__, how, "simulate", *arguments],
            env=os.environ | {"NUMBA_CACHE_DIR": cache},
            stdout=subprocess.DEVNULL,
            check=True,
        )
    with xr.open_dataset(history) as found:
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
    for run in RUNS:
        with tempfile.TemporaryDirectory() as folder:
            ours, plain = map(partial(simulate, run=run, folder=folder), ("ours", "plain"))
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
