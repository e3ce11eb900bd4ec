"""Resources to request on a cluster: time limit and space on the disk.

Before a sweep the times of its runs are known by records, by a few short batches, or by prediction. Sweeps
that need too much memory or disk are refused.
"""

import math
import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Job
from cvt_hpc.study.batches import Batch, in_parts
from cvt_hpc.study.description import Study, describe, record_layout, record_type
from cvt_hpc.study.forecast.cost_model import CostModel, Fit, Forecast, forecast
from cvt_hpc.study.planning import predicted_costs
from cvt_hpc.study.ranks.stopping import gathering_margin
from cvt_hpc.study.record.log import HEAD, PLACE
from cvt_hpc.study.simulator import Simulator, default_simulator
from cvt_hpc.study.status import find_records
from cvt_hpc.study.task import Task, refined_steps

# [byte] of rank 0 for each run, for the plan and the index of the records: 207 were measured with 10^6 runs
# on one rank, and about as much again is assumed for sending the plan.
_MEMORY_PER_RUN = 400
# [byte] of results.nc for each quantity and coordinate, beside its values: 4700 at most were measured
_NAMES_AND_CHUNKS = 5000
_PREFIXES = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"))

_START_UP = 60.0  # [s] for MPI, Python and kernels; assumed, with room for slow file systems
_STEP = 300.0  # [s] to which a time limit is rounded up


class Disk(NamedTuple):
    """Space on the disk [byte], of `results` at most; `histories` NaN where it is not known."""

    records: float
    results: float
    histories: float


class Needs(NamedTuple):
    """Needs of a sweep."""

    memory: int  # of rank 0, for the plan [byte]
    disk: Disk  # space on the disk
    # memory of a rank, and disk at most, for a kept history's values along the belt at each sample [byte]
    profiles: int = 0


def needs(job: Job, simulator: Simulator) -> Needs:
    """Return the needs of a sweep of all runs of a job, without the marks of its batches."""
    variables, coordinates = record_layout(job, simulator)
    record = record_type(variables, coordinates).itemsize
    named = len(variables) + len(coordinates) + len(job.axes) + len(job.rules)
    disk = _disk(job.size, record, named, math.nan if job.histories else 0.0)
    return Needs(_MEMORY_PER_RUN * job.size, disk, simulator.profile_bytes(job))


def _disk(runs: int, record: int, named: int, histories: float) -> Disk:
    """Return the space that runs take without the marks of their batches, by the bytes of a record.

    The dataset is compressed. It takes no more than its records, and something for each quantity `named`.
    """
    return Disk(
        (HEAD.size + PLACE.size + record) * runs, record * runs + _NAMES_AND_CHUNKS * named, histories
    )


def refuse_too_large(job: Job, simulator: Simulator, out: Path) -> Needs:
    """Return the needs of a sweep of all runs of a job; what is in its folder need not be written again.

    Raises
    ------
    InputError
        If this machine has less memory, or less disk is free. Of a trace it is not known how many cells it
        runs, and disk is no reason.
    """
    needed, where = needs(job, simulator), f"{job.source}: {job.size} runs"
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for size, what in ((needed.memory, "their plan"), (needed.profiles, "profiles over time")):
        if size > memory:
            expected = f"{size_in_words(size)} of memory for {what}"
            raise mismatch(where, expected, f"{size_in_words(memory)} in this machine")
    if not job.in_rounds:
        free = _free(out) + _held(out)
        profiles = needed.profiles * len(job.histories)
        if (disk := needed.disk.records + needed.disk.results + profiles) > free:
            expected = f"{size_in_words(disk)} on the disk for their records and results.nc"
            expected += ", and for profiles over time" if profiles else ""
            raise mismatch(where, expected, f"{size_in_words(free)} at {out}")
    return needed


def size_in_words(size: float) -> str:
    """Return a size [byte] in words, to three digits."""
    factor, prefix = next((pair for pair in _PREFIXES if size >= 0.9995 * pair[0]), _PREFIXES[-1])
    return f"{size / factor:.3g} {prefix}B"


def _free(out: Path) -> int:
    """Return the space [byte] on the disk where a folder is, or will be made."""
    try:
        return shutil.disk_usage(next(p for p in (out, *out.absolute().parents) if p.is_dir())).free
    except OSError:  # the start itself names it, in its own words
        return 1 << 62


def _held(out: Path) -> int:
    """Return the size [byte] of the records in an output folder."""
    try:
        return sum(path.stat().st_size for path in (out / "records").iterdir())
    except OSError:
        return 0


class Expectation(NamedTuple):
    """Time of a sweep, the source of this forecast, and the space for its results."""

    forecasts: list[Forecast]
    basis: str
    disk: Disk


def expect(job: Job, out: Path, ranks: Sequence[int], pilots: int = 0) -> Expectation:
    """Return the time and space of a sweep of all runs of a job on each of some numbers of ranks.

    Records in the output folder give the time of batches, or as many pilots, done for this, as are requested.
    """
    simulator = default_simulator()
    study, costs = describe(job, simulator), simulator.run_costs(job)
    groups = simulator.lane_groups(job, range(study.size))
    known = find_out(job, simulator, groups, out, pilots)
    turns = partial(simulator.turns, job)
    forecasts = [forecast(groups, costs, known.fit, number, turns=turns) for number in ranks]
    most = max(expected.batches for expected in forecasts)
    disk = disk_space(study, most, len(job.histories), known.history_bytes)
    return Expectation(forecasts, known.basis, disk)


def suggested_time(forecast: Forecast, runs: int) -> float:
    """Return the time limit [s] to request from Slurm: enough for 39 sweeps in 40, start and end included."""
    return _STEP * math.ceil((_START_UP + forecast.makespan[2] + gathering_margin(runs)) / _STEP)


def disk_space(study: Study, batches: int, histories: int, history_bytes: float) -> Disk:
    """Return the space that a study takes in some batches, and with kept histories of a size [byte] each."""
    marks = batches * HEAD.size + study.size * PLACE.size
    named = len((*study.variables, *study.coordinates, *study.axes, *study.derived))
    kept = histories * history_bytes if histories else 0.0
    disk = _disk(study.size, study.record_dtype.itemsize, named, kept)
    return disk._replace(records=disk.records + marks)


def slurm_time(seconds: float) -> str:
    """Return a time span [s] as Slurm's [days-]hours:minutes:seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    return f"{f'{days}-' if days else ''}{hours:02d}:{minutes:02d}:{rest:02d}"


class Knowledge(NamedTuple):
    """The times of a job's batches, as far as they are known."""

    fit: Fit  # time [s] of a batch over its predicted cost
    basis: str  # where it is from, in words
    # size of the history of a run in memory [byte]; NaN where it is not known
    history_bytes: float = math.nan


def find_out(job: Job, simulator: Simulator, groups: Sequence[Batch], out: Path, pilots: int) -> Knowledge:
    """Return the known times of a job's batches, of which `groups` are full ones.

    By records in the output folder, or by so many `pilots`: batches, shortened and without a trace in the
    folder.
    """
    if pilots:
        found = run_pilots(job, simulator, groups, pilots)
        if found.fit.batches:
            return found
    elif (records := find_records(out, job)) is not None:
        costs = predicted_costs(job, simulator, refined_steps(job, records, {}))
        fit = Task(job, records.study, simulator).fit(records, costs)
        if fit.batches:
            return Knowledge(fit, f"batches on record ({fit.batches})")
    # The cost of a run is its share of a full batch.
    lanes = max(len(group) / simulator.turns(job, len(group)) for group in groups)
    failed = "; no pilot batch came to its end" if pilots else ""
    return Knowledge(Fit(mean=math.log(lanes)), f"predicted costs, right within a factor of two{failed}")


def run_pilots(job: Job, simulator: Simulator, groups: Sequence[Batch], count: int) -> Knowledge:
    """Do batches from all over the grid for a part of their duration, and compare with their predicted cost.

    A shortened run does not end early, is neither refined nor prolonged, and its batch fills the lanes once;
    what refining and prolonging take is in the predicted costs alone.
    """
    short, share = job, simulator.pilot_share(job)
    # Where the duration is an axis or follows from others, its values count, and without a transient there is
    # none: done in full.
    fixed = {axis.name for axis in job.axes} | {rule.key for rule in job.rules}
    if share < 1.0 and "duration" in job.parameters and "duration" not in fixed:
        duration = share * job.parameters["duration"]
        bare = {"duration": duration, "longest_duration": duration, "shortest_duration": 0.0}
        bare |= {"most_refinements": 0}
        short = replace(job, parameters={key: bare.get(key, old) for key, old in job.parameters.items()})
    else:
        share = 1.0
    turns = partial(simulator.turns, job)
    if share < 1.0:
        groups = [part for group in groups for part in in_parts(group, turns(len(group)))]
    chosen = [groups[place] for place in sorted({int((k + 0.5) * len(groups) / count) for k in range(count)})]
    if job.histories:
        short = replace(short, histories=(chosen[0][0],))
    task = Task(short, describe(short, simulator), simulator)
    model, history_bytes = CostModel(simulator.run_costs(short), turns=turns), math.nan
    for batch in chosen:
        simulator.forget(job)
        for result in task.do(batch, lambda: None, lambda batch: None):
            if result.failed < len(result.records):
                model.learn(result.batch, result.seconds)
            for _, history in result.histories:
                history_bytes = history.nbytes / share
    noun = "pilot batch" if model.fit.batches == 1 else "pilot batches"
    basis = f"{model.fit.batches} {noun} of {share:.0%} of the simulated time"
    return Knowledge(model.fit, basis, history_bytes)
