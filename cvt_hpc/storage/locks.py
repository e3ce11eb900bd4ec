"""Locks on an output folder, which end with the process that holds them."""

import fcntl
import logging
import os
import platform
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cvt_hpc.errors import InputError
from cvt_hpc.storage.files import naming_refusals, open_regular

# A start waits this long [s]: `is_locked` takes the lock for an instant to see whether a run is at work.
_PATIENCE = 1.0
_SILENCE = 2.0  # [s] of waiting, after which the owner is named
_HOLDER = re.compile(r"process (\d{1,7}) on ([\w.-]{1,100}), at work since [\d :-]{19}\n", re.ASCII)
_logger = logging.getLogger(__name__)


class BusyError(InputError):
    """Another process holds a lock."""


@contextmanager
def locked(
    path: Path,
    what: str = "a folder",
    *,
    shared: bool = False,
    patience: float = _PATIENCE,
    interrupt: Callable[[], str | None] = lambda: None,
) -> Iterator[None]:
    """Hold a lock file for the time of a `with`.

    Parameters
    ----------
    path : Path
        The lock file, made where missing; it stays behind, without meaning, when the lock is gone.
    what : str
        Purpose of the lock, for the error.
    shared : bool
        Whether other processes may share it; if not, it is for this process alone.
    patience : float
        Time [s] to wait for other holders. Their names are logged as a warning if the wait takes longer.
    interrupt : callable
        Returns a reason to end the wait early, None to go on.

    Raises
    ------
    BusyError
        If they still hold it then.
    StorageError
        If the lock is no regular file, or the system refuses.
    """
    with naming_refusals(path, "a file to lock"):
        descriptor = open_regular(path, os.O_RDWR | os.O_CREAT)
    try:
        taken = _take(descriptor, path, what, fcntl.LOCK_SH if shared else fcntl.LOCK_EX, patience, interrupt)
        try:
            yield
        finally:
            if taken and not shared:  # whoever locks it without leaving word is not taken for this process
                with suppress(OSError):
                    os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock file."""
    try:
        descriptor = open_regular(path)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


def refuse_locked(path: Path) -> None:
    """Raise BusyError if a process holds a file that it may write to, as HDF5 does, with the name of it."""
    if is_locked(path):
        raise BusyError(
            f"{path}: expected a file that nobody writes to, found it locked by {_owners(path)}; close it "
            "there, or read a copy of it"
        )


def _owners(path: Path) -> str:
    """Return the processes of this machine that hold locks on a file, as Linux lists them, for people."""
    with suppress(OSError):
        inode = f":{path.stat().st_ino}"
        # such as "1: FLOCK ADVISORY WRITE 18113 fe:00:5564795 0 EOF"
        lines = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
        owners = {int(line[4]) for line in lines if len(line) == 8 and line[5].endswith(inode)} - {-1, 0}
        if owners:
            return ", ".join(f"process {owner}{_program(owner)}" for owner in sorted(owners))
    return "a process, perhaps on another machine"


def _program(process: int) -> str:
    with suppress(OSError):
        return f" ({Path(f'/proc/{process}/comm').read_text().strip()})"
    return ""


def _take(
    descriptor: int, path: Path, what: str, kind: int, patience: float, interrupt: Callable[[], str | None]
) -> bool:
    """Take the lock and record its owner; return whether the file system has locks at all."""
    began = time.monotonic()
    told = False
    while True:
        try:
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
            break
        except BlockingIOError:
            waited = time.monotonic() - began
            if waited > patience or (waited > _PATIENCE and interrupt()):
                expected = f"{what} that no run is at work in"
                raise BusyError(f"{path.parent}: expected {expected}, found {_holder(descriptor)}") from None
            if waited > _SILENCE and not told:
                told = True
                _logger.warning("%s: waits for %s, %.0f s at most", path, _holder(descriptor), patience)
            time.sleep(0.02)
        except OSError as error:  # some network file systems have no locks: no reason not to run there
            text = "%s: cannot be locked (%s): see to it that no second run is started there"
            _logger.warning(text, path, error.strerror)
            return False
    since = time.strftime("%Y-%m-%d %H:%M:%S")
    holder = f"process {os.getpid()} on {platform.node()}, at work since {since}\n"
    with naming_refusals(path, "to be able to write"):
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, holder.encode(), 0)
    return True


def _holder(descriptor: int) -> str:
    """Return the word that the holder has left, unless that process is gone: then it is somebody else."""
    word = _HOLDER.match(os.pread(descriptor, 200, 0).decode(errors="replace"))
    if word is None or (word[2] == platform.node() and not _is_alive(int(word[1]))):
        return "a process that has not left its name"
    return word[0].strip()


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, PermissionError) as error:  # the latter of somebody else's
        return isinstance(error, PermissionError)
    return True
