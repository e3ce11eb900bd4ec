"""Damages files of machine code at random, and runs on: no run may fail, crash or compute another number.

    .venv/bin/python tests/benchmarks/kernel_damages.py [COUNT]

Each run is a process of its own, which finds the machine code of some small kernels, one of which calls others
and is handed one, in a folder where one file has been cut, filled, exchanged or replaced.
"""

import logging
import os
import random
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numba
import numpy as np

from cvt_hpc.kernels import kernel, store


def kernels():
    """Kernels that this process has not called yet."""

    @kernel
    def rate(c, y):
        return -c * np.sin(y)

    @kernel
    def march(rate, c, y, n):
        for _ in range(n):
            y = y + 0.01 * rate(c, y)
        return y

    @kernel
    def refused(x):
        if x > 1.0:
            raise ValueError("above", x)
        return x

    return rate, march, refused


def result():
    """Numbers that the kernels give, all bits of them."""
    rate, march, refused = kernels()
    try:
        refused(2.0)
    except ValueError as error:
        text = str(error)
    return repr((march(rate, 0.5, np.linspace(0.0, 1.0, 7), 100).tobytes(), rate(2.0, 1.0), text))


def in_a_process(name):
    """What `result` gives in a process of its own, and what that logs; or how the process ended."""
    reading, writing = os.pipe()
    if (child := os.fork()) == 0:
        os.dup2(writing, 2)
        logging.basicConfig(level=logging.WARNING, format="%(message)s", force=True)
        numba.config.CACHE_DIR = name
        try:
            os.write(writing, f"{result()}\n".encode())
        finally:
            os._exit(0)
    os.close(writing)
    with open(reading) as output:
        said = output.read().splitlines()
    status = os.waitpid(child, 0)[1]
    return (said[-1], said[:-1]) if status == 0 and said else (f"ended with {status}", said)


def damage(entries, chance):
    """Damage one of some files in one of many ways, and name the way."""
    path, other = chance.sample(entries, 2)
    content = bytearray(path.read_bytes())
    at = chance.randrange(len(content))
    way = chance.choice(["bit"] * 8 + ["cut"] * 4 + ["block"] * 4 + list(_WAYS))
    if way == "bit":
        content[at] ^= 1 << chance.randrange(8)
    elif way == "cut":
        del content[at:]
    elif way == "block":
        content[at : at + 4096] = chance.randbytes(len(content[at : at + 4096]))
    if way in _WAYS:
        _WAYS[way](path, other)
    else:
        path.write_bytes(content)
    return way


def _instead(make):
    def replace(path, other):
        path.unlink()
        make(path, other)

    return replace


_WAYS = {
    "empty": lambda path, other: path.write_bytes(b""),
    "longer": lambda path, other: path.write_bytes(path.read_bytes() + b"\0"),
    "exchanged": lambda path, other: shutil.copy(other, path),
    "open to others": lambda path, other: path.chmod(0o666),
    "unreadable": lambda path, other: path.chmod(0),
    "gone": _instead(lambda path, other: None),
    "link": _instead(lambda path, other: path.symlink_to(other)),
    "hard link": _instead(lambda path, other: os.link(other, path)),
    "loop": _instead(lambda path, other: path.symlink_to(path)),
    "pipe": _instead(lambda path, other: os.mkfifo(path)),
    "folder": _instead(lambda path, other: path.mkdir()),
}


def damaged_runs(count, seed=0):
    """Count runs by what became of them: "right", "failed" or "wrong", and by the way of the damage."""
    chance, found = random.Random(seed), Counter()
    with tempfile.TemporaryDirectory() as folder:
        right, _ = in_a_process(folder)
        place = Path(folder) / store._FOLDER
        for _ in range(count):
            entries = sorted(path for path in place.iterdir() if path.name != "claims")
            way = damage(entries, chance)
            outcome, said = in_a_process(folder)
            became = "right" if outcome == right else "failed" if outcome.startswith("ended") else "wrong"
            found[became] += 1
            found[way] += 1
            if became != "right":
                print(way, outcome, *said, sep="\n", file=sys.stderr)
    return found


if __name__ == "__main__":
    counts = damaged_runs(int(sys.argv[1]) if len(sys.argv) > 1 else 120)
    print(dict(counts))
    sys.exit(counts["failed"] + counts["wrong"] > 0)
