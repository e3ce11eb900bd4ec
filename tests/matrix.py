"""Runs the tests with several versions of Python and of the packages, and prints what passed where.

    python3 tests/matrix.py [PYTEST ARGUMENT ...]      # without arguments: -q -n 3 --dist loadfile -m "not slow"

Every Python from 3.11 to 3.14 that is on the PATH is taken with the lowest versions of all ranges in
pyproject.toml, with those of tests/constraints.txt, and with the newest that the ranges allow. Each pair has an
environment and a cache of machine code of its own, which are removed. Exit status 1: some pair failed.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
EXTRAS = ("mpich", "test", "discs")
SHOWN = ("numba", "numpy", "xarray")  # their versions stand in the table


def lowest_versions():
    """Constraints that hold every package at the lowest version of its range, any patch of it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    ranges = [*project["dependencies"], *(entry for extra in EXTRAS for entry in extras[extra])]
    return [re.sub(r">=(\d+)$", r">=\1.0", text.split(",")[0]).replace(">=", "==") + ".*" for text in ranges]


def outcome(python, constraints, arguments, folder):
    """Versions and last line of a run of the tests in an environment of its own; whether it passed."""
    found = folder / "bin" / "python"
    subprocess.run([python, "-m", "venv", folder], check=True)
    pip = [found, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    limits = ["--constraint", constraints] if constraints else []
    package = f"{ROOT}[{','.join(EXTRAS)}]"
    installed = subprocess.run([*pip, *limits, "--editable", package], capture_output=True, text=True)
    if installed.returncode:
        return "", f"not installed: {installed.stderr.strip().splitlines()[-1]}", False
    ask = f"from importlib.metadata import version; print(*map(version, {SHOWN}))"
    versions = subprocess.run([found, "-c", ask], capture_output=True, text=True, check=True).stdout.strip()
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    env = os.environ | {"NUMBA_CACHE_DIR": str(folder / "machine_code"), "PATH": path}
    tested = subprocess.run(
        [found, "-m", "pytest", *arguments], cwd=ROOT, env=env, capture_output=True, text=True
    )
    lines = tested.stdout.strip().splitlines()
    return versions, lines[-1].strip("= ") if lines else tested.stderr[-200:], tested.returncode == 0


def main():
    """Run every pair that this machine allows."""
    arguments = sys.argv[1:] or ["-q", "-n", "3", "--dist", "loadfile", "-m", "not slow"]
    failed = False
    with tempfile.TemporaryDirectory() as scratch:
        lowest = Path(scratch) / "lowest.txt"
        lowest.write_text("\n".join(lowest_versions()) + "\n")
        kinds = {"lowest": lowest, "pinned": ROOT / "tests" / "constraints.txt", "newest": None}
        print("| Python | packages |", *(f"{name} |" for name in SHOWN), "result |")
        print("|---|---|" + "---|" * (len(SHOWN) + 1))
        for version in PYTHONS:
            python = shutil.which(f"python{version}")
            for kind, constraints in kinds.items():
                versions, text = "", "no such Python here"
                if python:
                    folder = Path(scratch) / f"{version}-{kind}"
                    versions, text, passed = outcome(python, constraints, arguments, folder)
                    failed |= not passed
                    shutil.rmtree(folder)
                shown = versions.split() or ["-"] * len(SHOWN)
                print(f"| {version} | {kind} |", *(f"{entry} |" for entry in shown), f"{text} |", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
