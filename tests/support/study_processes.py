"""Sweeps of the double in processes of their own, serial or under a real mpirun, and what tests ask of them."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

HERE = Path(__file__).parent
PATIENCE = 40.0  # [s] until a process that should end counts as hanging


class Sweep:
    """A process that sweeps the double."""

    def __init__(
        self, command: list[str], environment: dict[str, str], stderr: int = subprocess.PIPE
    ) -> None:
        self.process = subprocess.Popen(
            command, env=environment, text=True, stdout=subprocess.PIPE, stderr=stderr
        )

    def finish(self) -> subprocess.CompletedProcess:
        try:
            out, err = self.process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.kill()
            pytest.fail(f"the sweep hangs; its stderr: {self.process.communicate()[1]}")
        return subprocess.CompletedProcess(self.process.args, self.process.returncode, out, err)

    def ranks(self) -> list[psutil.Process]:
        """Return the computing processes, in order of rank."""
        every = [psutil.Process(self.process.pid)]
        every += every[0].children(recursive=True)
        ours = [p for p in every if p.name().startswith("python")]
        return sorted(ours, key=rank_of)

    def kill(self) -> None:
        """Kill -9 all of its processes, the ranks first."""
        root = psutil.Process(self.process.pid)
        for process in [*root.children(recursive=True)[::-1], root]:
            try:
                process.kill()
            except psutil.NoSuchProcess:
                continue


def rank_of(process: psutil.Process) -> int:
    environment = process.environ()
    return int(environment.get("PMI_RANK") or environment.get("OMPI_COMM_WORLD_RANK") or 0)


def clean_environment() -> dict[str, str]:
    """Return this environment without traces of a launcher, with what Open MPI wants in a container."""
    launchers = ("SLURM_", "PMI", "OMPI_", "MPI_")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(launchers)}
    return {
        **kept,
        "PYTHONPATH": os.pathsep.join(
            [str(HERE.parents[1]), str(HERE.parent), *filter(None, [kept.get("PYTHONPATH")])]
        ),
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        "OMPI_MCA_pml": "ob1",  # without a search for fast networks, which takes a second
        "OMPI_MCA_btl": "self,sm",
        "OMPI_MCA_osc": "sm,rdma",
    }


def find_mpirun() -> str:
    if importlib.util.find_spec("mpi4py") is None:
        pytest.skip("mpi4py is not installed")
    mpirun = shutil.which("mpirun", path=str(Path(sys.executable).parent)) or shutil.which("mpirun")
    if mpirun is None:
        pytest.skip("no mpirun beside the Python interpreter nor on the path")
    return mpirun


def fault_tolerance(mpirun: str) -> list[str]:
    """Return the options with which a launcher leaves ranks alive when another one dies."""
    version = subprocess.run([mpirun, "--version"], capture_output=True, text=True).stdout
    if "Open MPI" not in version:
        pytest.skip("this mpirun ends all ranks when one dies")
    return ["--with-ft", "ulfm"]


def wait_until(condition: Callable[[], Any], what: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail(f"waited in vain for {what}")
        time.sleep(0.01)
