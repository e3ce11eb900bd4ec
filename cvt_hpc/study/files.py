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


def storage_error(path: Path, error: Exception) -> StorageError:
    """Return the error to raise when the system refuses to write `path`."""
    found = getattr(error, "strerror", None) or error
    return StorageError(
        f"{path}: expected to be able to write, found: {found}. The runs recorded so far are kept, and the "
        "same command goes on from them"
    )


@contextlib.contextmanager
def naming_refusals(path: Path, expected: str) -> Iterator[None]:
    """Turn what the system refuses within a `with` into an error that says what was expected of `path`."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path}: expected {expected}, found: {error.strerror or error}") from error


def replace_file(path: Path, data: bytes) -> None:
    """Write a file aside, bring it to the disk, and put it in its place in one step.

    Raises
    ------
    StorageError
        If the system refuses; what stood at `path` is then untouched.
    """
    aside = aside_of(path)
    try:
        aside.write_bytes(data)
        put_in_place(aside, path)
    except OSError as error:
        discard(aside)
        raise storage_error(path, error) from error


def aside_of(path: Path) -> Path:
    """Return a name beside `path` that no other process uses, for a file in the making."""
    return path.with_name(f".{path.name}.{platform.node()}-{os.getpid()}.part")


def put_in_place(aside: Path, path: Path) -> None:
    """Bring a finished file to the disk and rename it to `path`."""
    descriptor = os.open(aside, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    os.replace(aside, path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Bring a folder's own entries to the disk, so that a new or renamed file survives a power failure."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems cannot, and need not
            raise
    finally:
        os.close(descriptor)


def discard(path: Path) -> None:
    """Remove a file that was not finished, if the system lets us."""
    with contextlib.suppress(OSError):
        path.unlink()
