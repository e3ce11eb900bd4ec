"""Start-ups that runs of this process have marched, from which runs with the same beginning continue.

A start-up is known by a key of all values that determine it. It stays in the memory of its process: on a disk
it would have to be trusted, to save each process a march of its own.
"""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any

import numpy as np

MOST_BYTES = 2**24  # of a process: some 80 start-ups of 432 elements and 15 ms at 20 kHz


class StartUps:
    """Start-ups as copies of arrays; the least recently used goes first.

    Parameters
    ----------
    most_bytes : int
        Limit of their total size [byte].
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._kept: OrderedDict[str, tuple[np.ndarray, ...]] = OrderedDict()

    def find(self, key: str) -> tuple[np.ndarray, ...] | None:
        """The start-up that is kept under a key, to be copied; None where there is none."""
        if key in self._kept:
            self._kept.move_to_end(key)
        return self._kept.get(key)

    def keep(self, key: str, arrays: Sequence[np.ndarray]) -> None:
        """Keep copies of arrays under a key."""
        self._kept[key] = tuple(array.copy() for array in arrays)
        while sum(array.nbytes for kept in self._kept.values() for array in kept) > self._most_bytes:
            self._kept.popitem(last=False)

    def forget(self) -> None:
        """Drop all of them."""
        self._kept.clear()


def fingerprint(*values: Any) -> str:
    """A key of values that differs where any of them does, by a bit of a number or by its type.

    Parameters
    ----------
    *values
        Numbers, texts, arrays, and sequences, mappings and objects of such.
    """
    digest = sha256()

    def take(value: Any) -> None:
        if isinstance(value, int | float | str | np.generic | np.ndarray):
            array = np.asarray(value)
            digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
        elif isinstance(value, tuple | list):
            digest.update(f"({len(value)}".encode())
            for part in value:
                take(part)
        elif isinstance(value, Mapping):
            take(tuple(value.items()))
        elif parts := vars(value):
            take(parts)
        else:
            raise TypeError(f"a {type(value).__name__} has no values to tell it by")

    take(values)
    return digest.hexdigest()
