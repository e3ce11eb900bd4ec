"""A program for each scheduler that does the tasks of `peer_tasks.py`; `peers.py` starts it, under mpirun or alone.

python peer_programs.py '{"peer": ..., "kind": ..., "count": ..., "folder": ..., "processes": ..., "together": ...}'
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from peer_tasks import NUMBERS, Tasks, simulate_one

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.study_double import Axis, Job, Simulator  # noqa: E402

SAVED_EVERY = 10  # tasks, where libEnsemble is asked to save its history


class TaskSimulator(Simulator):
    """Does tasks in the place of runs."""

    def __init__(self, tasks: Tasks, together: int) -> None:
        super().__init__(lanes=together)
        self.tasks = tasks

    def run_costs(self, job: Job) -> np.ndarray:
        return np.maximum(self.tasks.durations(), 1e-6)

    def run_point(self, job: Job, point: dict[str, Any], interrupt: Any) -> dict[str, Any]:
        self.tasks.do(point["load"])
        return {
            "status": 1,
            "vibrates": 1,
            "reason": "",
            "amplitude": NUMBERS[:2],
            "spectrum": NUMBERS[2:].reshape(2, 11),
            "steps": 1,
            "core_seconds": 0.0,
        }


def by_cvt_hpc(tasks: Tasks, options: dict[str, Any]) -> int:
    from cvt_hpc.study import run

    tasks.warm_up()
    job = Job((Axis("load", tuple(range(tasks.count))),))
    simulator = TaskSimulator(tasks, options["together"])
    report = run(job, Path(tasks.folder) / "study", simulator=simulator, progress=False)
    return report.exit_status


def by_mpi4py_futures(tasks: Tasks, options: dict[str, Any]) -> int:
    from mpi4py.futures import MPIPoolExecutor

    with MPIPoolExecutor(initializer=tasks.warm_up) as pool:
        order = tasks.longest_first()
        results = pool.map(tasks.do, order, chunksize=options["together"], unordered=True)
        done = {index for index, _ in results}
    return int(len(done) < tasks.count)


def by_libensemble(tasks: Tasks, options: dict[str, Any]) -> int:
    from libensemble.alloc_funcs.give_pregenerated_work import give_pregenerated_sim_work
    from libensemble.libE import libE
    from mpi4py import MPI

    tasks.warm_up()
    order = tasks.longest_first()
    for path in Path(tasks.folder).glob("libE_history_after_sim_*.npy"):
        saved = np.load(path)
        ended = set(saved["task"][saved["sim_ended"]].tolist())
        order = [index for index in order if index not in ended]
    # Rows without these marks count as done.
    marks = ("sim_started", "sim_ended", "gen_informed", "cancel_requested")
    rows = np.zeros(len(order), dtype=[("task", int), ("sim_id", int), *((mark, bool) for mark in marks)])
    rows["task"], rows["sim_id"] = order, range(len(order))
    MPI.COMM_WORLD.Barrier()
    _, _, flag = libE(
        sim_specs={
            "sim_f": simulate_one,
            "in": ["task"],
            "out": [("numbers", float, (NUMBERS.size,))],
            "user": {"tasks": tasks},
        },
        gen_specs={},
        exit_criteria={"sim_max": len(order)},
        alloc_specs={"alloc_f": give_pregenerated_sim_work},
        libE_specs={
            "comms": "mpi",
            "mpi_comm": MPI.COMM_WORLD,
            "disable_log_files": True,
            "save_every_k_sims": SAVED_EVERY if options["saves"] else 0,
        },
        H0=rows,
    )
    return flag or 0  # workers get an empty list


def by_dask(tasks: Tasks, options: dict[str, Any]) -> int:
    from distributed import Client, LocalCluster, as_completed

    workers = options["processes"] - 1
    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        client.run(tasks.warm_up)
        # Futures are let go as they come in: of those that are held, results of a dead worker are done again.
        results = as_completed(client.map(tasks.do, tasks.longest_first(), pure=False), with_results=True)
        done = {index for _, (index, _) in results}
    return int(len(done) < tasks.count)


PROGRAMS = {
    "cvt_hpc": by_cvt_hpc,
    "mpi4py.futures": by_mpi4py_futures,
    "libEnsemble": by_libensemble,
    "dask.distributed": by_dask,
}


def main(options: dict[str, Any]) -> int:
    """Do all tasks; return the exit status."""
    tasks = Tasks(options["kind"], options["count"], options["folder"])
    return PROGRAMS[options["peer"]](tasks, options)


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))
