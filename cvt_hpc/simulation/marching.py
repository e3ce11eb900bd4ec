"""Batches marched to their ends, and runs marched together until each has its record."""

import time
from collections.abc import Callable, Collection, Sequence
from typing import Any

from cvt_hpc.job import Job
from cvt_hpc.models.contract import Batch, load_model
from cvt_hpc.simulation.batches import in_lanes
from cvt_hpc.simulation.open_run import OpenRun

_BETWEEN_POLLS = 0.05  # [s] of computing between checks whether to stop


class Interrupted(Exception):
    """The run was stopped before its end; the text states the reason."""


def march(
    batch: Batch, until: int | None = None, stop: Callable[[], str | None] | None = None
) -> tuple[float, str | None]:
    """March a batch to its end.

    Parameters
    ----------
    batch : Batch
        Of any model.
    until : int, optional
        Number of samples to march to; by default all.
    stop : callable, optional
        Called every few tens of milliseconds; a text ends the march. Without it the batch is marched in one
        piece, and nothing but the runs is in the time.

    Returns
    -------
    seconds : float
        Processor time [s].
    stopped : str or None
        The text of `stop`, where the batch has not come to its end.
    """
    last = batch.samples if until is None else min(until, batch.samples)
    piece = last if stop is None else 1
    started = before = time.process_time()
    while batch.running and batch.done < last:
        if stop is not None and (why := stop()):
            return time.process_time() - started, why
        batch.advance(min(piece, last - batch.done))
        now = time.process_time()
        piece = 2 * piece if now - before < 0.5 * _BETWEEN_POLLS else piece
        before = now
    return time.process_time() - started, None


def march_runs(
    job: Job,
    points: Sequence[dict[str, Any]],
    interrupt: Callable[[], str | None],
    kept: Collection[int] = (),
) -> list[tuple[Any, dict[str, Any]]]:
    """Do runs to their records.

    All do their first transient, as many together as there are lanes; then the runs that are prolonged or
    done again fill lanes anew, and so on until none is left.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    points : sequence of dict
        Flat parameters of the runs [SI].
    interrupt : callable
        Called every few tens of milliseconds; a text ends all runs.
    kept : collection of int
        Places in `points` whose transient is returned; the others are dropped after their verdict.

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
    model = load_model(job.model)
    while left := [run for run in runs if run.record is None]:
        groups = in_lanes(model, job.stepper, left, lambda run: run.next, lambda run: run.paused is None)
        for group in groups:
            _march_together(job, group, interrupt)
    return [(run.run, run.record) for run in runs]  # type: ignore[misc]  # each has its record now


def _march_together(job: Job, group: Sequence[OpenRun], interrupt: Callable[[], str | None]) -> None:
    """March the next transients of a group to their ends."""
    paused = [run.paused for run in group if run.paused is not None]
    batch = load_model(job.model).batch([run.next for run in group], job.stepper, paused)
    batch.advance(0)  # compiles or loads the kernels, which is no cost of these runs
    seconds, stopped = march(batch, stop=interrupt)
    if stopped:
        raise Interrupted(stopped)
    for run, marched in zip(group, batch.runs, strict=True):
        run.take(marched, seconds / len(group))
