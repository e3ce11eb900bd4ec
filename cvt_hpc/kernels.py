"""How the kernels are compiled, and where the machine code is kept: one way for all.

The compiler keeps machine code beside a file's date alone, and would go on with the old code of a kernel when
one that it calls, in another file, has changed. So the code is kept in a folder named by the content of all
kernels' sources: below NUMBA_CACHE_DIR if that is set, else in the package, else in the user's cache. A
folder that no process has asked for in a month goes when another is made.

A kernel may be handed to another as an argument, as a right-hand side to a stepper. The compiler tells
kernels apart by an identity drawn at random, so that it would never find such code again: here it is the
name, and for kernels from outside the package the content of their file, which the folder does not know. The
compiler cannot read an index that names a type of a script that is not at hand: here it skips that entry.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile

_PACKAGE = Path(__file__).parent
_MONTH = 30 * 86400.0  # [s]: longer than any job lasts, so that none loses the folder it works in
_ROOMS_WITH_KERNELS = ("lanes", "physics", "models", "steppers")

# Division by zero gives inf as in numpy, without a test for it. Every operation is rounded once, as written:
# were products contracted with sums, the bits would depend on which kernels the compiler merges, and so on
# whether their code is compiled or found in the folder.
_OPTIONS = {"cache": True, "error_model": "numpy"}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called."""
    return _compiled(function, _OPTIONS)


def merged_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers.

    A call that hands over a tuple of arrays counts references to each, which costs more than a short loop.
    Its call must not be its caller's last statement, nor that of another merged kernel unless it is straight
    lines: the compiler loses such calls (numba 0.68).
    """
    return _compiled(function, {**_OPTIONS, "inline": "always"})


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    users = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _CACHE
    try:
        compiled = numba.njit(**options)(function)
        compiled._set_uuid(_identity(function))
        compiled._cache._cache_file = _ForgivingIndex.of(compiled._cache._cache_file)
        return compiled
    finally:
        numba.config.CACHE_DIR = users


def _identity(function: Callable[..., Any]) -> str:
    name = f"{function.__module__}.{function.__qualname__}"
    source = Path(function.__code__.co_filename)
    if source.is_relative_to(_PACKAGE):
        return name
    code = function.__code__
    try:
        content = source.read_bytes()
    except OSError:  # typed into a shell
        content = repr((code.co_code, code.co_consts, code.co_names)).encode()
    return f"{name}-{hashlib.sha256(content).hexdigest()[:16]}"


class _ForgivingIndex(IndexDataCacheFile):
    """An index of machine code, entry by entry: what cannot be read is kept as it is and matches nothing."""

    @classmethod
    def of(cls, index: IndexDataCacheFile) -> _ForgivingIndex:
        index.__class__ = cls
        return index

    def _load_index(self) -> dict:
        return {_entry(packed): name for packed, name in super()._load_index().items()}

    def _save_index(self, overloads: dict) -> None:
        packed = {key if isinstance(key, bytes) else self._dump(key): name for key, name in overloads.items()}
        super()._save_index(packed)


def _entry(packed: bytes) -> Any:
    try:
        return pickle.loads(packed)
    except (AttributeError, ImportError):
        return packed


def _cache_folder() -> Path:
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for room in _ROOMS_WITH_KERNELS:
        for source in sorted((_PACKAGE / room).rglob("*.py")):
            digest.update(source.read_bytes())
    chosen = numba.config.CACHE_DIR
    if chosen:
        base = Path(chosen)
    elif os.access(_PACKAGE, os.W_OK):
        base = _PACKAGE / "__pycache__"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or _home_or_temporary() / ".cache") / "cvt_hpc"
    return base / f"kernels-{digest.hexdigest()[:16]}"


def _home_or_temporary() -> Path:
    home = Path(os.path.expanduser("~"))
    return home if os.access(home, os.W_OK) else Path(tempfile.gettempdir())


def _asked_for(folder: Path) -> str:
    """The folder, its date set to now; where it had to be made, what nobody has asked for in a month goes.

    All by best effort: what the system refuses, or another process has done, is left.
    """
    try:
        made = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for other in folder.parent.glob("kernels-" + 16 * "[0-9a-f]") if made else ():
            if time.time() - other.stat().st_mtime > _MONTH:
                shutil.rmtree(other, ignore_errors=True)
    except OSError:
        pass
    return str(folder)


_CACHE = _asked_for(_cache_folder())
