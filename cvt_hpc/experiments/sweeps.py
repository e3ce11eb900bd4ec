"""Sweeps of an experiment: runs of its job on several models, each a study in a folder of its own.

`sweep_lines` states their cost, `run_sweeps` does what is left of them, `load_sweep` reads their results.
"""

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from cvt_hpc.experiments.outcome import Tell
from cvt_hpc.job import Job, known_keys, rebuild_job
from cvt_hpc.job.axes import SAMPLE, SWAPPED
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.printing import trouble_lines
from cvt_hpc.simulation import run_costs, simulate
from cvt_hpc.storage.files import refuse_link
from cvt_hpc.study import check_start, open_results, run
from cvt_hpc.study.ranks.launch import detect_launch
from cvt_hpc.study.ranks.progress import show_duration
from cvt_hpc.study.status import find_records
from cvt_hpc.tables import columns, short


class Sweep(NamedTuple):
    """A sweep of an experiment."""

    name: str  # of its folder, and in tables
    answers: tuple[str, ...]  # questions that it answers, in words
    job: Job


def handed(job: Job, model: str, table: Mapping[str, Any]) -> Job:
    """Return the same runs on another model with a table of its own, without the axes that it does not know.

    Raises
    ------
    InputError
        If the model cannot take them.
    """
    known = {*known_keys(model), SAMPLE, SWAPPED}
    fewer = replace(job, axes=tuple(axis for axis in job.axes if axis.name in known))
    document = handed_to(fewer, model, "a model of its ladder")
    if table:
        document[model] = dict(table)
    return rebuild_job(document, job.source, job.units)


def cost_left(sweep: Sweep, out: Path | None) -> tuple[int, float]:
    """Return how many runs of a sweep are not on record in its folder below `out`, and their core-seconds."""
    records = None if out is None else find_records(out / sweep.name, sweep.job)
    left = np.ones(sweep.job.size, bool) if records is None else ~records.recorded
    return int(left.sum()), float(run_costs(sweep.job)[left].sum())


def sweep_lines(sweeps: Sequence[Sweep], refusals: Mapping[str, str], out: Path) -> Iterator[str]:
    """Yield the lines that state the runs of sweeps, the models left out, and the cost of what is left.

    Refusals are reasons by the name of a model; the sweeps' folders lie in `out`.
    """
    rows = [["name", "model", "runs", "left", "core-s left", "answers"]]
    total = 0.0
    for sweep in sweeps:
        runs, cost = cost_left(sweep, out)
        numbers = [str(sweep.job.size), str(runs), short(cost)]
        rows.append([sweep.name, sweep.job.model, *numbers, ", ".join(sweep.answers)])
        total += cost
    yield from columns(rows)
    yield from _left_out(refusals)
    yield f"estimated cost of what is left: {core_time_in_words(total)}, shared by all ranks"


def _left_out(refusals: Mapping[str, str]) -> Iterator[str]:
    return (f"{name} left out: {why}" for name, why in refusals.items())


def run_sweeps(
    sweeps: Sequence[Sweep],
    refusals: Mapping[str, str],
    out: Path,
    *,
    fresh: bool,
    tell: Tell,
) -> int:
    """Do the runs of sweeps that are left, one sweep after the other; on all ranks.

    A line is told before each sweep that has runs left, with the time to go, and lines on failed runs.
    Returns the largest exit status of a sweep; later ones do not start after one that stopped early.

    Raises
    ------
    InputError
        If a folder holds another job or cannot be written to; before anything is computed.
    """
    status = 0
    tell(*_left_out(refusals))
    begins = {sweep.name: fresh or not (out / sweep.name).exists() for sweep in sweeps}
    for sweep in sweeps:
        refuse_link(out / sweep.name)
        check_start(sweep.job, out / sweep.name, fresh=fresh)
    left = {sweep.name: cost_left(sweep, None if fresh else out) for sweep in sweeps}
    done, spent = 0.0, 0.0
    predicted = sum(cost for _, cost in left.values())
    for place, sweep in enumerate(sweeps, 1):
        runs, cost = left[sweep.name]
        if runs:
            to_go = sum(left[later.name][1] for later in sweeps[place - 1 :])
            # by the time of earlier sweeps, as far as they count beside all; at first by prediction alone
            to_go *= (spent + predicted / detect_launch().size) / (done + predicted)
            expected = f"{runs} runs, {show_duration(to_go)} to go in all"
            tell(f"model {place}/{len(sweeps)} {sweep.name}: {expected}")
        started = time.monotonic()
        # threads of the linear algebra wait for each other in loops, which would count as a model's own time
        with one_thread():
            if sweep.job.stepper is None and begins[sweep.name]:
                simulate(sweep.job)  # loading and compiling would count as time of a first run
            report = run(sweep.job, out / sweep.name, fresh=fresh, raises=False)
        tell(*(f"{sweep.name}: {line}" for line in trouble_lines(report)))
        done, spent = done + cost, spent + (time.monotonic() - started if runs else 0.0)
        status = max(status, report.status_of_more or report.exit_status)
        if report.status_of_more:
            break
    return status


def load_sweep(name: str, out: Path) -> xr.Dataset:
    """Return the results of a sweep, in memory; InputError where they cannot be read."""
    with open_results(out / name) as dataset:
        return dataset.load()


def maker_of(dataset: xr.Dataset) -> dict[str, Any]:
    """Return versions and revision by which results were computed, as `global_attributes` takes them."""
    return {
        "versions": json.loads(dataset.attrs["versions"]),
        "git_revision": dataset.attrs["git_revision"],
    }
