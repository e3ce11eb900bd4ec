"""The netCDF and HDF5 libraries, which break if two threads use them at a time: one lock for all access."""

import gc
import sys
import threading
from typing import Any, Self


class _Lock:
    """A lock that its thread may take again, and that keeps out values which xarray reads by its own lock.

    Its thread may not take that of xarray again, as datasets that were opened from bytes do once they are
    garbage. So no garbage is collected while it is held.
    """

    def __init__(self) -> None:
        self._threads = threading.RLock()
        self._held: list[Any] = []  # the lock of xarray, or None, for each time that this one is held
        self._collects = False  # whether garbage is collected once the lock is free

    def acquire(self, blocking: bool = True) -> bool:
        """Take the lock; without `blocking` return False where another thread holds it."""
        if not self._threads.acquire(blocking):
            return False
        backend = sys.modules.get("xarray.backends.netCDF4_")  # without it nobody reads through xarray
        theirs = None if self._held else getattr(backend, "NETCDF4_PYTHON_LOCK", None)
        if not self._held:
            self._collects = gc.isenabled()
            gc.disable()
        if theirs is not None and not theirs.acquire(blocking):
            self._let_go()
            return False
        self._held.append(theirs)
        return True

    def release(self) -> None:
        """Give the lock back."""
        theirs = self._held.pop()
        if theirs is not None:
            theirs.release()
        self._let_go()

    def _let_go(self) -> None:
        if not self._held and self._collects:
            gc.enable()
        self._threads.release()

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def __reduce__(self) -> str:
        return "LIBRARIES"  # xarray pickles it with datasets; in another process it is that one's lock


LIBRARIES = _Lock()
