"""The sweep side by side with mpi4py.futures, libEnsemble and dask.distributed, on the same tasks.

    pip install -e ".[mpich,test,peers]"
    python tests/benchmarks/peers.py [--repeats 3] [--table FILE.csv]

Overhead of a task that does nothing, makespan over the ideal for heavy-tailed tasks, and what a kill -9 of a
process that computes costs. All have the same number of processes, a manager or scheduler among them, and
begin the longest tasks first. A witness on the disk, the same for all, tells what was done and when: importing,
starting and gathering are not in these times. Takes some minutes; the machine ought to be idle.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from peer_tasks import read_witness

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
from cvt_hpc.storage.provenance import origin_lines  # noqa: E402
from support.study_processes import clean_environment, find_mpirun  # noqa: E402

PEERS = ("cvt_hpc", "mpi4py.futures", "libEnsemble", "dask.distributed")
IN_BATCHES = ("cvt_hpc", "mpi4py.futures")  # those that take several tasks at a time if asked
BATCH = 16
COUNTS = {"trivial": 500, "sleep": 300, "kernel": 300}
PATIENCE = 60.0  # [s] until a process that should end counts as hanging
HANGS = "hangs"
COLUMNS = (
    *("peer", "kind", "processes", "computing", "together", "tasks", "repeats"),
    *("overhead [us]", "makespan [s]", "over ideal", "over ideal of computing", "longest [s]"),
    *("killed after", "first end", "until it [s]", "starts", "done twice"),
)


def start(
    peer: str, kind: str, processes: int, folder: Path, together: int = 1, saves: bool = False
) -> subprocess.Popen:
    """Start a scheduler on all tasks of a kind; what it prints is in the folder."""
    options = {"peer": peer, "kind": kind, "count": COUNTS[kind], "folder": str(folder)}
    options |= {"processes": processes, "together": together, "saves": saves}
    launch = [] if peer == "dask.distributed" else [find_mpirun(), "-n", str(processes)]
    module = ["-m", "mpi4py.futures"] if peer == "mpi4py.futures" else []
    command = [*launch, sys.executable, *module, str(HERE / "peer_programs.py"), json.dumps(options)]
    environment = clean_environment()
    environment["PYTHONPATH"] += os.pathsep + str(HERE)
    with (folder / "output").open("ab") as output:
        return subprocess.Popen(command, cwd=folder, env=environment, stdout=output, stderr=output)


def end(process: subprocess.Popen) -> int | str:
    """Return the exit status; end what hangs."""
    try:
        return process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        root = psutil.Process(process.pid)
        for member in [*root.children(recursive=True), root]:
            try:
                member.kill()
            except psutil.NoSuchProcess:
                continue
        process.wait()
        return HANGS


def computing(peer: str, processes: int) -> int:
    """Return how many of the processes do tasks."""
    return processes if peer == "cvt_hpc" else processes - 1


def figures(done: np.ndarray, processes: int, workers: int) -> dict[str, float]:
    """Return what a sweep took.

    Parameters
    ----------
    done : numpy.ndarray of ENTRY, shape (tasks,)
        The witness.
    processes, workers : int
        How many there were, and how many of them do tasks.
    """
    took = done["ended"] - done["started"]
    makespan = done["ended"].max() - done["started"].min()
    return {
        "overhead [us]": 1e6 * (makespan * processes - took.sum()) / done.size,
        "makespan [s]": makespan,
        "over ideal": makespan * processes / took.sum(),
        "over ideal of computing": makespan * workers / took.sum(),
        "longest [s]": took.max(),
    }


def time_sweeps(peer: str, kind: str, processes: int, together: int, repeats: int) -> dict[str, object]:
    """Return the row of a scheduler without trouble: the sweep that others on the machine disturbed least."""
    found = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            status = end(start(peer, kind, processes, folder, together))
            done = read_witness(folder)
            if status != 0 or not np.array_equal(np.sort(done["task"]), np.arange(COUNTS[kind])):
                words = (folder / "output").read_text(errors="replace")
                raise RuntimeError(f"{peer}: status {status}, {done.size} tasks done\n{words}")
            found.append(figures(done, processes, computing(peer, processes)))
    row = {"peer": peer, "kind": kind, "processes": processes, "computing": computing(peer, processes)}
    row |= {"together": together, "tasks": COUNTS[kind], "repeats": repeats}
    least = min(found, key=lambda one: one["makespan [s]"])
    row |= {name: round(float(value), 3) for name, value in least.items()}
    if kind == "trivial":  # nothing is ideal for no work
        row |= {"over ideal": "", "over ideal of computing": ""}
    return row


def kill_one(peer: str, processes: int) -> dict[str, object]:
    """Return the row of a scheduler of which a process is killed that computes, when half is done.

    It is started again until it ends well: the second start finds what the first has kept.
    """
    with tempfile.TemporaryDirectory() as name:
        folder, count = Path(name), COUNTS["sleep"]
        process = start(peer, "sleep", processes, folder, saves=True)
        while (done := read_witness(folder)).size < count // 2:
            if process.poll() is not None:
                raise RuntimeError(f"{peer}: ended before half was done\n{(folder / 'output').read_text()}")
            time.sleep(0.005)
        os.kill(int(done["process"][-1]), signal.SIGKILL)
        killed = time.monotonic()
        first = status = end(process)
        until = time.monotonic() - killed
        starts = 1
        while status != 0 and starts < 3:
            status, starts = end(start(peer, "sleep", processes, folder, saves=True)), starts + 1
        witness = read_witness(folder)
        if np.unique(witness["task"]).size < count:
            raise RuntimeError(f"{peer}: not all is done after {starts} starts")
    row = {"peer": peer, "kind": "kill", "processes": processes, "computing": computing(peer, processes)}
    row |= {"together": 1, "tasks": count, "repeats": 1, "killed after": done.size, "first end": first}
    return row | {"until it [s]": round(until, 1), "starts": starts, "done twice": witness.size - count}


def measure(repeats: int) -> list[dict[str, object]]:
    """Return all rows."""
    rows = []
    for kind, counts in {"trivial": (2, 4), "sleep": (2, 4), "kernel": (2,)}.items():
        for processes in counts:
            for peer in PEERS:
                for together in (1, BATCH) if kind == "trivial" and peer in IN_BATCHES else (1,):
                    rows.append(time_sweeps(peer, kind, processes, together, repeats))
                    print(rows[-1], file=sys.stderr)
    for peer in PEERS:
        rows.append(kill_one(peer, processes=4))
        print(rows[-1], file=sys.stderr)
    return rows


def markdown(rows: list[dict[str, object]], columns: tuple[str, ...]) -> str:
    """Return some columns of rows as a table."""
    lines = [columns, ["---"] * len(columns), *([row.get(c, "") for c in columns] for row in rows)]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def main() -> None:
    """Measure, print, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="sweeps of which the fastest counts")
    parser.add_argument("--table", type=Path, help="where to write the rows")
    options = parser.parse_args()
    rows = measure(options.repeats)
    timed = [row for row in rows if row["kind"] != "kill"]
    print(markdown(timed, (*COLUMNS[:5], *COLUMNS[7:12])))
    print()
    print(markdown([row for row in rows if row["kind"] == "kill"], ("peer", *COLUMNS[12:])))
    if options.table:
        with options.table.open("w", newline="", encoding="utf-8") as file:
            file.writelines(origin_lines())
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
