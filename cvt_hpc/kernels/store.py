"""Machine code on the disk: a file for each entry, whole or absent, in a folder that nobody else can change.

The name of a file is a digest of all that decides the code. It begins with a digest of its name and content,
without which nothing in it is used: machine code with a changed bit may compute anything. What is damaged, or
cannot be had for whatever reason, is compiled again; what cannot be written is not kept. Whoever can write to
the folder can run any code as the user. So the folder, and all above it up to the root, is looked at whenever
an entry is read or written, and without a safe folder nothing is.

The folder lies below NUMBA_CACHE_DIR if that is set; else in the package where it is the user's own, else in
the user's cache. An entry that no process has used for a month is removed when another is made.

Of processes that need the same code at a time one compiles it, and the others wait for it.
"""

import errno
import fcntl
import grp
import hashlib
import logging
import os
import pwd
import secrets
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba

_PACKAGE = Path(__file__).parent.parent
_FOLDER = "cvt_hpc-kernels"
_MONTH = 30 * 86400.0  # [s]: longer than any job lasts, so that none loses the code it has begun with
_LONG = 3.0  # [s]: faster compiling is not logged
_PATIENCE = 600.0  # [s] with a process that compiles the same; any kernel takes less, on a busy machine too
_NO_LINK = os.O_NOFOLLOW | os.O_CLOEXEC
_DIGEST = hashlib.sha256().digest_size
_LARGEST = 1 << 28  # [bytes] of an entry; those of this program have 2 MB at most

_logger = logging.getLogger("cvt_hpc.kernels")


def folder() -> Path | None:
    """Return the folder of machine code, made if needed, or log once that there is no safe one."""
    if chosen := numba.config.CACHE_DIR:
        bases = [Path(chosen).absolute()]
    else:
        own = _PACKAGE.stat().st_uid == os.getuid() and os.access(_PACKAGE, os.W_OK)
        users = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
        bases = [_PACKAGE / "__pycache__"] * own + [users] * users.is_absolute()
    refusals = ["there is no home folder"]
    for base in bases:
        try:
            return _made_safe(base / _FOLDER)
        except OSError as error:
            refusals.append(str(error))
    not_kept(refusals[-1])
    return None


def read(name: str, what: str) -> bytes | None:
    """Return the content of an entry, or None where there is none, or none that is whole.

    Parameters
    ----------
    name : str
        Digest of all that decides the content.
    what : str
        The kernel, for the log.
    """
    place = folder()
    if place is None:
        return None
    try:
        return _content(place / name)
    except FileNotFoundError:
        return None
    except (OSError, MemoryError) as error:
        return tell_damaged(what, str(error))


def _content(path: Path) -> bytes:
    """Return the content of a file that nobody else can have written, if it is whole.

    Raises
    ------
    OSError
        If it is not, or cannot be read.
    """
    # a pipe is opened without waiting for anybody who writes to it
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | _NO_LINK)
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
            raise PermissionError(f"{path} is not a file that only you can write to")
        if found.st_size > _LARGEST:
            raise OSError(f"{path} is damaged")
        with open(descriptor, "rb", closefd=False) as file:
            content = file.read()
        with suppress(OSError):
            os.utime(descriptor)  # it is in use
    finally:
        os.close(descriptor)
    if content[:_DIGEST] != _digest(path.name, content[_DIGEST:]):
        raise OSError(f"{path} is damaged")
    return content[_DIGEST:]


def write(name: str, content: bytes) -> None:
    """Keep an entry, by best effort: written beside, synced and renamed."""
    place = folder()
    if place is None:
        return
    aside = place / f"{name}.{secrets.token_hex(4)}"
    try:
        _remove_forgotten(place)
        descriptor = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK, 0o600)
        try:
            with open(descriptor, "wb") as file:
                file.write(_digest(name, content) + content)
                file.flush()
                os.fsync(descriptor)
            _replace(aside, place / name)
        except BaseException:
            with suppress(OSError):
                aside.unlink()
            raise
    except OSError as error:
        not_kept(str(error))


def _replace(aside: Path, path: Path) -> None:
    if path.is_dir() and not path.is_symlink():  # somebody's mistake
        shutil.rmtree(path)
    os.replace(aside, path)


def _digest(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + content).digest()


@cache
def tell_damaged(what: str, why: str) -> Any:
    """Log, once, why machine code is compiled again."""
    _logger.warning("machine code of %s cannot be used and is compiled again: %s", what, why)


@cache
def not_kept(why: str) -> None:
    """Log, once, why machine code is not kept."""
    _logger.warning(
        "machine code is not kept, and every process compiles for minutes: %s; "
        "NUMBA_CACHE_DIR can name a folder of your own",
        why,
    )


@cache
def _remove_forgotten(place: Path) -> None:
    for entry in os.scandir(place):
        with suppress(OSError):
            # not the file of claims: opening and closing it would drop the claims of this process
            if entry.name != "claims" and time.time() - entry.stat(follow_symlinks=False).st_mtime > _MONTH:
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path)
                else:
                    os.unlink(entry.path)


# Safety


def _made_safe(place: Path) -> Path:
    """Return a folder in which nobody else can put code; made if needed.

    Raises
    ------
    OSError
        If there is none to be had.
    """
    if not os.path.isdir(place):
        place.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
        with suppress(FileExistsError):
            place.mkdir(mode=0o700)
    itself = place.lstat()
    if not stat.S_ISDIR(itself.st_mode):
        raise PermissionError(f"{place} is no folder")
    if itself.st_uid != os.getuid():
        raise PermissionError(f"{place} belongs to somebody else")
    if itself.st_mode & 0o022:
        raise PermissionError(f"others can write to {place}")
    real = Path(os.path.realpath(place))
    for above in {*place.parents, *real.parents}:
        found = above.lstat()
        if stat.S_ISLNK(found.st_mode):
            if found.st_uid != 0:  # of the system's links only the ends are looked at
                raise PermissionError(f"{above} is a link: name the folder that it leads to")
        elif found.st_uid not in (0, os.getuid()) or _open_to_others(found):
            raise PermissionError(f"others can replace {above}")
    if not os.access(place, os.W_OK):
        raise PermissionError(f"no permission to write to {place}")
    return place


def _open_to_others(found: os.stat_result) -> bool:
    """Whether others than the owner can replace what lies in a folder."""
    if found.st_mode & stat.S_ISVTX:  # only the owners of what lies in it
        return False
    return bool(found.st_mode & stat.S_IWOTH or found.st_mode & stat.S_IWGRP and not _is_alone(found.st_gid))


@cache
def _is_alone(gid: int) -> bool:
    """Whether a group is that of the user alone, which many systems give to each user."""
    try:
        group, user = grp.getgrgid(gid), pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return False
    return group.gr_name == user and set(group.gr_mem) <= {user}


# Claims


@contextmanager
def claimed(name: str, what: str) -> Iterator[None]:
    """Wait until no other process compiles the same, and claim it; a claim dies with its process.

    After `_PATIENCE`, or where files cannot be locked, it goes on without; only time is lost then.
    """
    place = int.from_bytes(hashlib.sha256(name.encode()).digest()[:7], "big")  # a byte; the file stays empty
    began, told = time.monotonic(), False
    with suppress(OSError):
        while not _locks(_claims_file(), place):
            if time.monotonic() - began > _PATIENCE:
                break
            if not told and time.monotonic() - began > _LONG:
                told = True
                _logger.info("waiting for another process that compiles %s ...", what)
            time.sleep(0.05)
    try:
        yield
    finally:
        with suppress(OSError):
            fcntl.lockf(_claims_file(), fcntl.LOCK_UN, 1, place)


@cache
def _claims_file() -> int:
    """Return the descriptor of the file whose bytes stand for claims; open as long as the process lives.

    Raises
    ------
    OSError
        If there is none to be had.
    """
    place = folder()
    if place is None:
        raise FileNotFoundError("no folder for machine code")
    return os.open(place / "claims", os.O_RDWR | os.O_CREAT | _NO_LINK, 0o600)


def _locks(descriptor: int, place: int) -> bool:
    """Lock a byte of a file, unless another process has done so."""
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            return False
        raise
    return True
