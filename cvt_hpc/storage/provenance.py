"""The origin of numbers: the command, the host, the versions and the revision, for all that is written."""

import hashlib
import json
import os
import platform
import shlex
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import cvt_hpc

_NOT_RECORDED = "not recorded"
_TURNS = 2_000_000  # of a loop that marks the speed of a machine
_PACKAGE = Path(__file__).parent.parent
_LIBRARIES = ("numpy", "numba", "scipy", "xarray", "netCDF4", "mpi4py")


def new_session(ranks: int) -> dict[str, Any]:
    """Return the description of one start of a sweep, as JSON types.

    Parameters
    ----------
    ranks : int
        Number of MPI ranks that compute.
    """
    where = {"command": command(), "host": platform.node(), "ranks": ranks}
    program = {"versions": versions(), "git_revision": git_revision()}
    return {"id": uuid.uuid4().hex, "started": time.time(), **where, **program}


def command() -> str:
    """Return the command line of this process, its program without the folder."""
    program = Path(sys.argv[0])
    started = ["python", "-m", program.parent.name] if program.name == "__main__.py" else [program.name]
    return shlex.join([*started, *sys.argv[1:]])


def history_line(what: str, seconds: float | None = None) -> str:
    """Return an entry of the CF attribute `history`: the action, and its time [s] since the epoch, or now."""
    return f"{time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime(seconds))}: {what}"


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that numbers may depend on."""
    return {"cvt_hpc": cvt_hpc.__version__, "python": platform.python_version()} | _installed()


@cache
def program_identity() -> dict[str, str]:
    """Return what decides whether two processes run the same program: versions, and a digest of sources."""
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.rglob("*.py")):
        digest.update(f"{source.relative_to(_PACKAGE)}\n".encode())
        digest.update(source.read_bytes())
    return {**versions(), "sources": digest.hexdigest()}


@cache
def _installed() -> dict[str, str]:
    """Versions of packages; to read them takes some 10 ms."""
    found = {}
    for package in _LIBRARIES:
        with suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def machine() -> dict[str, str | int | None]:
    """Return the hardware on which times depend: the processor and the number of cores, as JSON types."""
    processor = platform.processor()
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:  # of Linux
        names = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
        processor = names[0] if names else processor
    return {"processor": processor, "architecture": platform.machine(), "cores": os.cpu_count()}


@cache
def _loop_seconds() -> float:
    """Processor time [s] of a loop of Python, by which costs on different machines can be compared."""
    start, s = time.process_time(), 0
    for i in range(_TURNS):
        s += i * i
    return time.process_time() - start


def origin_lines(made: Mapping[str, str] | None = None) -> Iterator[str]:
    """Yield the lines with "#" that stand on top of a table and tell where its numbers come from.

    `cvt_hpc.tables.below_origin` reads what stands below them.

    Parameters
    ----------
    made : mapping, optional
        Attributes of the dataset behind the table, as `netcdf.global_attributes` gives them, and possibly
        `job_fingerprint` and `machine`; by default those of this process, without a job.
    """
    if made is None:
        own = {"git_revision": git_revision(), "versions": json.dumps(versions()), "job_name": "none"}
        made = own | {"command": command(), "history": history_line(command()), "host": platform.node()}
    fingerprint = made.get("job_fingerprint", "")[:16]
    packages = json.loads(made.get("versions", "{}"))
    told = {
        "revision": made.get("git_revision"),
        "job": made.get("job_name", _NOT_RECORDED) + (f", fingerprint {fingerprint}" if fingerprint else ""),
        "command": made.get("command"),
        "versions": ", ".join(f"{package} {version}" for package, version in packages.items()),
        "date": made.get("history", "").rpartition("\n")[2][: len("2026-01-31")],
        "machine": _machine_in_words(made),
    }
    for name, text in told.items():
        yield f"# {name}: {' '.join((text or _NOT_RECORDED).split())}\n"  # a command may have several lines


def _machine_in_words(made: Mapping[str, str]) -> str:
    """The machine of a dataset, and its speed if it is this one; "" where it is not known."""
    here = machine()
    found = json.loads(made["machine"]) if "machine" in made else here
    found = found if isinstance(found, list) else [found]
    if made.get("host") == platform.node() and found == [here]:
        speed = f"{_TURNS:.0e} turns of s += i * i take {_loop_seconds():.2g} s".replace("e+0", "e")
        return f"{here['processor']}, {here['cores']} cores, {speed}"
    if "machine" not in made:
        return ""
    return "; ".join(f"{one['processor']}, {one['cores']} cores" for one in found)


def merge_versions(found: Sequence[dict[str, str]]) -> dict[str, str]:
    """Return the version of each package, several of them as "1.0, 1.1" where sessions differ."""
    merged: dict[str, dict[str, None]] = {}
    for versions_of_session in found:
        for package, version in versions_of_session.items():
            merged.setdefault(package, {})[version] = None
    return {package: ", ".join(different) for package, different in merged.items()}


@cache
def git_revision() -> str:
    """Return the revision of the source that this process runs: of its checkout, or of what was installed.

    A build writes revision.txt, and so does `git archive`; in a checkout it has a place for it alone.
    """
    if found := revision_of(Path(__file__)):
        return found
    with suppress(OSError):
        written = (_PACKAGE / "revision.txt").read_text(encoding="utf-8").strip()
        return "" if written.startswith("$") else written
    return ""


def revision_of(source: Path) -> str:
    """Return the revision of a source file's checkout; "" if git does not keep the file there.

    "-dirty" is appended if anything in the checkout was changed.
    """
    # A package installed below somebody else's checkout must not be given that checkout's revision.
    if _git(source, "ls-files", "--error-unmatch", source.name) is None:
        return ""
    return _git(source, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*") or ""


def _git(source: Path, *arguments: str) -> str | None:
    """Return the output of git in the folder of `source`, None if it is missing or refuses."""
    try:
        command = ["git", "-C", str(source.parent), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None
