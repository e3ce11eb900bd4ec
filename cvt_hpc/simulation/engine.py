"""Runs marched together until each has its record: lanes are filled again with the runs that are left."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from cvt_hpc.models.contract import record_module, transient_module
from cvt_hpc.simulation.open_run import OpenRun

if TYPE_CHECKING:
    from cvt_hpc.job import Job

SAMPLES_BETWEEN_POLLS = 200  # 10 ms of simulated time, some 50 ms of computing


class Interrupted(Exception):
    """The run was asked to stop before its end; the text says why."""


def march(
    job: Job,
    points: Sequence[dict[str, Any]],
    interrupt: Callable[[], str | None],
    kept: Collection[int] = (),
) -> list[tuple[Any, dict[str, Any]]]:
    """Do a batch of runs to their records.

    All do their first transient, as many together as there are lanes; then those that are to go on or to be
    done again fill lanes anew, and so on until none is left.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    points : sequence of dict
        Flat parameters of the runs [SI].
    interrupt : callable
        Asked every few tens of milliseconds; a text ends all runs.
    kept : collection of int
        Places in `points` whose transient is returned; the others are dropped as soon as they are judged.

    Returns
    -------
    list of (object or None, dict)
        In the order of the points: the transient that counts, and the record.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    runs = [OpenRun(job, point, place in kept) for place, point in enumerate(points)]
    while left := [run for run in runs if run.record is None]:
        for group in _in_lanes(job, left):
            _march_together(job, group, interrupt)
    return [(run.run, run.record) for run in runs]


def _in_lanes(job: Job, runs: Iterable[OpenRun]) -> Iterator[list[OpenRun]]:
    """Yield groups of runs whose next transients can advance together, as many as there are lanes."""
    model = record_module(job)
    groups: dict[Any, list[OpenRun]] = {}
    for run in runs:
        groups.setdefault((model.lane_key(run.next), run.paused is None), []).append(run)
    for group in groups.values():
        most = model.lanes(group[0].next, job.stepper)
        for first in range(0, len(group), most):
            yield group[first : first + most]


def _march_together(job: Job, group: Sequence[OpenRun], interrupt: Callable[[], str | None]) -> None:
    """March the next transients of a group to their ends."""
    paused = [run.paused for run in group if run.paused is not None]
    batch = transient_module(job).batch([run.next for run in group], job.stepper, paused)
    batch.advance(0)  # compiles or loads the kernels, which is no cost of these runs
    started = time.process_time()
    while batch.running:
        if stop := interrupt():
            raise Interrupted(stop)
        batch.advance(SAMPLES_BETWEEN_POLLS)
    share = (time.process_time() - started) / len(group)
    for run, marched in zip(group, batch.runs, strict=True):
        run.take(marched, share)
