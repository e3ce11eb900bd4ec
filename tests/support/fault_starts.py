"""Starts of `fault_child`: forked, which takes some ms, or under mpirun; each has an end or counts as hanging."""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil

from support.fault_child import run_child
from support.study_processes import HERE, Sweep, clean_environment, find_mpirun

BOUND = 60.0  # [s] until a start counts as hanging; a sweep takes half a second and mpirun some more
_GRACE = 15.0  # [s] until what outlives its launcher counts as left behind

_MODULES = [
    "support.fault_child",
    "cvt_hpc.study.sweep",
    "cvt_hpc.storage.netcdf",
    "netCDF4",
    "h5py",
    "dask.array",
]
_MODULES += ["cvt_hpc.simulation", "cvt_hpc.models.oscillator.record", "cvt_hpc.models.oscillator.transient"]
_context = multiprocessing.get_context("forkserver")


class Hang(Exception):
    """A start that has not ended within its time."""


class Forked:
    """A start in a process of its own, forked from one that has loaded all modules."""

    def __init__(self, options: dict[str, Any], output: Path) -> None:
        _context.set_forkserver_preload(_MODULES)
        before = os.environ.get("PYTHONPATH", "")
        os.environ["PYTHONPATH"] = os.pathsep.join([str(HERE.parent), str(HERE.parents[1]), before])
        self._process = _context.Process(target=run_child, args=(options, str(output)), daemon=True)
        self.began = time.monotonic()
        self._process.start()
        os.environ["PYTHONPATH"] = before

    def status(self) -> int | None:
        """Return how it has ended, None while it runs; -9 after a kill."""
        return self._process.exitcode

    def send(self, number: int, target: str = "") -> None:
        """Send a signal, if it still runs."""
        if self._process.exitcode is None:
            os.kill(self._process.pid, number)

    def wait(self) -> int:
        """Return how it ended."""
        self._process.join(BOUND)
        if self._process.exitcode is None:
            self._process.kill()
            raise Hang
        return self._process.exitcode

    def left_behind(self) -> int:
        """Return how many of its processes are left: it has only one."""
        return 0


class Launched:
    """A start under mpirun."""

    def __init__(self, options: dict[str, Any], ranks: int) -> None:
        program = [sys.executable, str(HERE / "fault_child.py"), json.dumps(options)]
        self.began = time.monotonic()
        self._out = options["out"]
        self._sweep = Sweep([find_mpirun(), "-n", str(ranks), *program], clean_environment())

    def status(self) -> int | None:
        """Return how mpirun has ended, None while it runs."""
        return self._sweep.process.poll()

    def send(self, number: int, target: str = "rank 0") -> None:
        """Send a signal to "mpirun" or to a rank, if it still runs."""
        try:
            if target == "mpirun":
                self._sweep.process.send_signal(number)
            else:
                self._sweep.ranks()[int(target.split()[1])].send_signal(number)
        except (psutil.NoSuchProcess, IndexError):
            return  # ended, or not yet there

    def wait(self) -> int:
        """Return how mpirun ended."""
        try:
            status = self._sweep.process.wait(BOUND)
        except subprocess.TimeoutExpired:
            self._sweep.kill()
            raise Hang from None
        return status

    def left_behind(self) -> int:
        """Return how many ranks have outlived mpirun, and end them."""
        deadline = time.monotonic() + _GRACE
        while (found := self._ranks()) and time.monotonic() < deadline:
            time.sleep(0.02)
        for process in found:
            process.kill()
        self._sweep.process.communicate()
        return len(found)

    def _ranks(self) -> list[psutil.Process]:
        found = psutil.process_iter(["cmdline"])
        return [p for p in found if any(self._out in word for word in p.info["cmdline"] or ())]
