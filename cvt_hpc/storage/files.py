"""Files that are written whole or not at all, never through a link, and one error for all failures.

A folder may come from somebody else. A file that is opened in it by a fixed name has to be regular: a link
would lead elsewhere, and a pipe or a device may never answer.
"""

import contextlib
import csv
import errno
import os
import pwd
import secrets
import stat
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from cvt_hpc.errors import InputError

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_KINDS = {
    stat.S_IFLNK: "a link", stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFREG: "a file",
}  # fmt: skip
_FULL = (errno.ENOSPC, errno.EDQUOT)
_PROBE = bytes(1 << 20)


class StorageError(InputError):
    """Results cannot be stored or read: no space, no permission, a file where a folder should be."""


def storage_error(path: Path, error: Exception, advice: str = "") -> StorageError:
    """Return the error to raise when the system refuses to write `path`; `advice` is added to its text."""
    found = f"{_reason(error)}{_of_whom(path, error)}"
    return StorageError(f"{path}: expected to be able to write, found: {found}{advice and f'. {advice}'}")


def _reason(error: Exception) -> str:
    """Return the system's message, without the text that HDF5 adds."""
    text = getattr(error, "strerror", None) or str(error)
    if isinstance(error, OSError) and error.errno and "errno = " in text:
        return os.strerror(error.errno)
    return text


def _of_whom(path: Path, error: Exception) -> str:
    """Return, where the system refuses a right, who can grant it, and what else to do; else nothing."""
    if getattr(error, "errno", None) not in (errno.EACCES, errno.EPERM):
        return ""
    place = Path(path).absolute()
    while not os.path.lexists(place):  # what is missing was refused by the first folder above
        place = place.parent
    with contextlib.suppress(OSError, KeyError):
        owner = pwd.getpwuid(os.lstat(place).st_uid).pw_name
        return f" ({place} belongs to {owner}, who can grant the right; or choose another --out, or copy it)"
    return ""


@contextlib.contextmanager
def naming_refusals(path: Path, expected: str) -> Iterator[None]:
    """Turn a refusal of the system within a `with` into an error that states what was expected of `path`."""
    try:
        yield
    except OSError as error:
        if error.errno in _FULL:
            raise storage_error(path, error) from error
        found = f"{_reason(error)}{_of_whom(path, error)}"
        raise StorageError(f"{path}: expected {expected}, found: {found}") from error


def kind_of(path: Path, *, follow: bool = False) -> str | None:
    """Return the kind of object at a path, such as "a file", or "a link", unless it is followed, or None."""
    try:
        return _kind(os.stat(path, follow_symlinks=follow).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return None


def refuse_link(path: Path) -> None:
    """Raise InputError where a link stands in the place of a folder within an output folder."""
    if kind_of(path) == "a link":
        raise InputError(f"{path}: expected a folder of its own, found a link, which may lead anywhere")


def open_regular(path: Path, flags: int = os.O_RDONLY, *, follow: bool = False) -> int:
    """Return the descriptor of a regular file, which is neither a link nor, for writing, linked twice.

    Parameters
    ----------
    flags : int
        As of `os.open`.
    follow : bool
        Whether a link may lead to the file, since the user named it herself.

    Raises
    ------
    OSError
        If something else stands there, or the system refuses. Nothing is waited for.
    """
    # Before it is opened, since that alone may move a device; and after, for an object put there meanwhile.
    if (found := kind_of(path, follow=follow)) not in (None, "a file"):
        number = errno.EISDIR if found == "a folder" else errno.EINVAL
        raise OSError(number, f"{found} in the place of a file")
    flags |= os.O_NONBLOCK | os.O_CLOEXEC | (0 if follow else os.O_NOFOLLOW)
    descriptor = os.open(path, flags, 0o666)
    opened = os.fstat(descriptor)
    if not stat.S_ISREG(opened.st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, f"{_kind(opened.st_mode)} in the place of a file")
    if opened.st_nlink > 1 and flags & (os.O_WRONLY | os.O_RDWR):
        os.close(descriptor)
        raise OSError(errno.EMLINK, "a file that has a second name elsewhere")
    return descriptor


def read_regular(path: Path, limit: int, *, follow: bool = False) -> bytes:
    """Return the content of a regular file of at most `limit` bytes; OSError as of `open_regular`."""
    with os.fdopen(open_regular(path, follow=follow), "rb") as file:
        if (size := os.fstat(file.fileno()).st_size) > limit:
            raise OSError(errno.EFBIG, f"a file of more than {limit >> 20} MiB")
        return file.read(size)


def append_text(path: Path, text: str) -> None:
    """Append to a regular file, which is made where there is none; OSError as of `open_regular`."""
    with os.fdopen(open_regular(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT), "a") as file:
        file.write(text)


def make_own_folder(path: Path) -> None:
    """Make a folder within an output folder, or see that it is one: a link would lead out of it.

    Raises
    ------
    OSError
        If something else stands there, or the system refuses.
    """
    with contextlib.suppress(FileExistsError):
        path.mkdir()
    if (found := kind_of(path)) != "a folder":
        raise OSError(errno.ENOTDIR, f"{found} in the place of a folder")


def remove_own(path: Path) -> None:
    """Remove a file or a link (not its target), or an empty folder; OSError if the system refuses."""
    if kind_of(path) == "a folder":
        path.rmdir()
    else:
        path.unlink(missing_ok=True)


def try_to_write(folder: Path) -> None:
    """Write a file to a folder and remove it; OSError if the system refuses."""
    with probed(folder):
        pass


@contextlib.contextmanager
def probed(folder: Path) -> Iterator[Path]:
    """Write a new file to a folder, give its path, and remove it; OSError if the system refuses."""
    probe = folder / f".probe-{secrets.token_hex(8)}"
    descriptor = os.open(probe, _NEW, 0o666)
    try:
        try:
            os.write(descriptor, b"x")
        finally:
            os.close(descriptor)
        yield probe
    finally:
        discard(probe)


@contextlib.contextmanager
def written_aside(path: Path, *, parents: bool = False, advice: str = "") -> Iterator[Path]:
    """Give a path beside `path` to write to; at the end the new file replaces the old one in one step.

    Parameters
    ----------
    path : Path
        The file to be written or replaced; a link is replaced, and its target is left alone.
    parents : bool
        Whether to make its folder, where there is none.
    advice : str
        Advice for the user if the system refuses.

    Raises
    ------
    StorageError
        If the system refuses; the object at `path` is then untouched.
    """
    # A name that nobody can guess, and a file that is new: `OutputFolder.leftovers` knows such names.
    aside = path.with_name(f".{path.name}.{secrets.token_hex(8)}.part")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(aside, _NEW, 0o666))
        yield aside
        _sync(aside)
        os.replace(aside, path)
        sync_folder(path.parent)
    except (OSError, RuntimeError) as error:
        raise storage_error(path, _refusal(aside, error), advice) from error
    finally:
        discard(aside)


def write_rows(
    path: Path, head: Sequence[str], rows: Iterable[Sequence[object]], origin: Iterable[str] = ()
) -> Path:
    """Write a table of comma-separated values below lines of its origin, and return its path.

    Its folder is made, where there is none; errors are those of `written_aside`.
    """
    with written_aside(path, parents=True) as aside, aside.open("w", encoding="utf-8", newline="") as file:
        file.writelines(origin)
        csv.writer(file, lineterminator="\n").writerows([head, *rows])
    return path


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


def open_missing_streams() -> None:
    """Lead standard streams that are closed to nowhere.

    The system would give their numbers to files that are opened next, and what libraries print there would be
    written into these.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is not None:
            continue
        try:
            os.fstat(number)
        except OSError:
            descriptor = os.open(os.devnull, os.O_RDWR)
            if descriptor != number:
                os.dup2(descriptor, number)
                os.close(descriptor)
        setattr(sys, name, open(os.devnull, mode))


def _kind(mode: int) -> str:
    return _KINDS.get(stat.S_IFMT(mode), "something that is no file")


def _refusal(aside: Path, error: Exception) -> Exception:
    """Return why a file could not be written: libraries for netCDF do not always pass on the system's reason.

    The system is asked once more, by writing some bytes to the part of the file that exists.
    """
    if getattr(error, "errno", None):
        return error
    try:
        with aside.open("ab", buffering=0) as file:
            if file.write(_PROBE) < len(_PROBE):
                file.write(_PROBE)
            os.fsync(file.fileno())
    except OSError as refusal:
        return refusal
    return error


def _sync(path: Path) -> None:
    """Bring a file or a folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
