"""Who may be at work in an output folder at a time, by locks that die with the process that holds them."""

from __future__ import annotations

import fcntl
import logging
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cvt_hpc.errors import InputError
from cvt_hpc.files import naming_refusals

# A start waits this long [s]: `is_locked` takes the lock for an instant to see whether a run is at work.
_PATIENCE = 1.0
_logger = logging.getLogger(__name__)


@contextmanager
def locked(
    path: Path, what: str = "a folder", *, shared: bool = False, patience: float = _PATIENCE
) -> Iterator[None]:
    """Hold a lock file for the time of a `with`.

    Parameters
    ----------
    path : Path
        The lock file, made where missing; it stays behind, without meaning, when the lock is gone.
    what : str
        What it stands for, for the error.
    shared : bool
        Whether others may hold it as well, who share it too; for this process alone if not.
    patience : float
        Time [s] to wait for those who hold it.

    Raises
    ------
    InputError
        If they still hold it then.
    """
    with naming_refusals(path, "to be able to write"):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        _take(descriptor, path, what, fcntl.LOCK_SH if shared else fcntl.LOCK_EX, patience)
        yield
    finally:
        os.close(descriptor)


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock file."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
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


def _take(descriptor: int, path: Path, what: str, kind: int, patience: float) -> None:
    """Take the lock and leave word of who has it."""
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
            break
        except BlockingIOError:
            if time.monotonic() > deadline:
                holder = os.pread(descriptor, 200, 0).decode(errors="replace").strip() or "another"
                raise InputError(
                    f"{path.parent}: expected {what} that no run is at work in, found {holder}"
                ) from None
            time.sleep(0.02)
        except OSError as error:  # some network file systems have no locks: no reason not to run there
            _logger.warning(
                "%s: cannot be locked (%s): see to it that no second run is started there",
                path,
                error.strerror,
            )
            return
    holder = (
        f"process {os.getpid()} on {platform.node()}, at work since {time.strftime('%Y-%m-%d %H:%M:%S')}\n"
    )
    with naming_refusals(path, "to be able to write"):
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, holder.encode(), 0)
