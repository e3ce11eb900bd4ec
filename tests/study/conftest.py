"""The fixture that starts sweeps of the double and leaves no process behind."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import xarray  # noqa: F401 - here, before a test takes away the rights to read it

from support.study_processes import HERE, Sweep, clean_environment, fault_tolerance, find_mpirun


@pytest.fixture
def spawn() -> Iterator[Callable[..., Sweep]]:
    """Start a command, with further variables of the environment."""
    started: list[Sweep] = []

    def start_command(
        command: list[str], environment: dict[str, str] | None = None, stderr: int = subprocess.PIPE
    ) -> Sweep:
        started.append(Sweep(command, {**clean_environment(), **(environment or {})}, stderr))
        return started[-1]

    yield start_command
    for sweep in started:
        if sweep.process.poll() is None:
            sweep.kill()
        sweep.process.communicate()


@pytest.fixture
def start(spawn: Callable[..., Sweep]) -> Callable[..., Sweep]:
    """Start a program under `ranks` ranks of MPI (0: no launcher), with options as JSON; `tolerant` of deaths."""

    def start_program(
        options: dict[str, Any],
        ranks: int = 0,
        program: str = "study_double.py",
        environment: dict[str, str] | None = None,
        tolerant: bool = False,
        stderr: int = subprocess.PIPE,
    ) -> Sweep:
        launcher = [find_mpirun(), "-n", str(ranks)] if ranks else []
        if tolerant:
            launcher[1:1] = fault_tolerance(launcher[0])
        command = [*launcher, sys.executable, str(HERE / program), json.dumps(options, default=str)]
        return spawn(command, environment, stderr)

    return start_program
