"""Files that are there whole or not at all, and the one error for a system that refuses to keep them."""

from __future__ import annotations

import contextlib
import errno
import os
import platform
from collections.abc import Iterator
from pathlib import Path

from cvt_hpc.errors import InputError


class StorageError(InputError):
    """Results cannot be stored or read: no space, no permission, a file where a folder should be."""


def storage_error(path: Path, error: Exception, advice: str = "") -> StorageError:
    """Return the error to raise when the system refuses to write `path`; `advice` is added to its text."""
    found = getattr(error, "strerror", None) or error
    return StorageError(f"{path}: expected to be able to write, found: {found}{advice and f'. {advice}'}")


@contextlib.contextmanager
def naming_refusals(path: Path, expected: str) -> Iterator[None]:
    """Turn what the system refuses within a `with` into an error that says what was expected of `path`."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path}: expected {expected}, found: {error.strerror or error}") from error


@contextlib.contextmanager
def written_aside(path: Path, *, parents: bool = False, advice: str = "") -> Iterator[Path]:
    """Give a path beside `path` to write to, and put what stands there in the end in its place in one step.

    Parameters
    ----------
    path : Path
        The file to be written or replaced.
    parents : bool
        Whether to make its folder, where there is none.
    advice : str
        What a user should know if the system refuses.

    Raises
    ------
    StorageError
        If the system refuses; what stood at `path` is then untouched.
    """
    # A name that no other process uses; `StudyFolder.leftovers` knows it.
    aside = path.with_name(f".{path.name}.{platform.node()}-{os.getpid()}.part")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield aside
        _sync(aside)
        os.replace(aside, path)
        sync_folder(path.parent)
    except (OSError, RuntimeError) as error:  # RuntimeError: what the netCDF library makes of a full disk
        raise storage_error(path, error, advice) from error
    finally:
        discard(aside)


def sync_folder(folder: Path) -> None:
    """Bring a folder's own entries to the disk, so that a new or renamed file survives a power failure."""
    try:
        _sync(folder)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems cannot, and need not
            raise


def discard(path: Path) -> None:
    """Remove a file that was not finished, if it is there and the system lets us."""
    with contextlib.suppress(OSError):
        path.unlink()


def _sync(path: Path) -> None:
    """Bring a file or a folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
