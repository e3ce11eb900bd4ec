"""What somebody else may do to an output folder: change its job file, put links, pipes and odd files in it.

Each is a context in which the folder is damaged; it gives whether gathering is to be refused. What `run` does not
mend, a lock that is a link, is taken away at the end, as the error tells.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

from cvt_hpc.storage.locks import locked

Damage = Callable[[Path, Path, Random], contextlib.AbstractContextManager[bool]]
HELD = 1.0  # [s]


def _job_file(edit: Callable[[dict, Random], None]) -> Damage:
    @contextlib.contextmanager
    def damage(out: Path, outside: Path, chance: Random) -> Iterator[bool]:
        path = out / "job.json"
        entry = json.loads(path.read_text())
        edit(entry, chance)
        path.write_text(json.dumps(entry))
        yield True

    return damage


def _shift(entry: dict, chance: Random) -> None:
    values = entry["axes"][-1]["values"]
    place = chance.randrange(len(values))
    values[place] = entry["job"]["axes"][entry["axes"][-1]["name"]][place] = 0.5


def _mistype(entry: dict, chance: Random) -> None:
    key = chance.choice([key for key in entry if key not in ("format", "fingerprint", "checksum")])
    entry[key] = chance.choice([None, 5, "x", [5], {"x": [[[]]]}])


def _cut(out: Path, outside: Path, chance: Random) -> contextlib.AbstractContextManager[bool]:
    path = out / "job.json"
    data = path.read_bytes()
    path.write_bytes(data[: chance.randrange(len(data) - 1)])
    return contextlib.nullcontext(True)


@contextlib.contextmanager
def _link_lock(out: Path, outside: Path, chance: Random) -> Iterator[bool]:
    path = out / "gather.lock"
    path.unlink(missing_ok=True)
    path.symlink_to(chance.choice([outside, outside.with_name("new"), path]))
    yield True
    path.unlink()


def _link_file(name: str, refused: bool) -> Damage:
    def damage(out: Path, outside: Path, chance: Random) -> contextlib.AbstractContextManager[bool]:
        path = out / name
        path.unlink(missing_ok=True)
        path.symlink_to(outside)
        return contextlib.nullcontext(refused)

    return damage


@contextlib.contextmanager
def _hold_lock(out: Path, outside: Path, chance: Random) -> Iterator[bool]:
    taken = threading.Event()

    def hold() -> None:
        with locked(out / "gather.lock"):
            taken.set()
            time.sleep(HELD)

    holder = threading.Thread(target=hold)
    holder.start()
    taken.wait()
    yield False
    holder.join()


def _odd_log(make: Callable[[Path, Path, Random], None]) -> Damage:
    def damage(out: Path, outside: Path, chance: Random) -> contextlib.AbstractContextManager[bool]:
        make(out / "records" / "rank-7777.log", out / "records", chance)
        return contextlib.nullcontext(False)

    return damage


DAMAGE: dict[str, Damage] = {
    "a value of an axis changed": _job_file(_shift),
    "an entry of another type": _job_file(_mistype),
    "job.json cut short": _cut,
    "gather.lock a link": _link_lock,
    "gather.lock held": _hold_lock,
    "results.nc a link": _link_file("results.nc", False),
    "job.json a link": _link_file("job.json", True),
    "crash.log a link": _link_file("crash.log", False),
    "a pipe among the logs": _odd_log(lambda path, records, chance: os.mkfifo(path)),
    "a device among the logs": _odd_log(lambda path, records, chance: path.symlink_to("/dev/zero")),
}
