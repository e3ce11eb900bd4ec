"""Resources to request on a cluster: time limit and space on the disk."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.job import Job
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.forecast.needs import Disk, most_of_results
from cvt_hpc.study.forecast.pilots import find_out
from cvt_hpc.study.forecast.simulate import Forecast, forecast
from cvt_hpc.study.ranks.time_limit import gathering_margin
from cvt_hpc.study.record.frames import HEAD, PLACE, RecordFormat
from cvt_hpc.study.simulator import default_simulator

_START_UP = 60.0  # [s] for MPI, Python and kernels; assumed, with room for slow file systems
_STEP = 300.0  # [s] to which a time limit is rounded up


class Expectation(NamedTuple):
    """Time of a sweep, the source of this forecast, and the space for its results."""

    forecasts: list[Forecast]
    basis: str
    disk: Disk


def expect(job: Job, out: Path, ranks: Sequence[int], pilots: int = 0) -> Expectation:
    """Return the time and space of a sweep of all runs of a job on each of some numbers of ranks.

    Parameters
    ----------
    job : Job
        A validated job.
    out : Path
        The output folder, whose records give the time of batches if no pilots are requested.
    ranks : sequence of int
        Numbers of processes that compute.
    pilots : int
        Number of batches to be done for this.
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
    """Return the time limit [s] to request from Slurm: enough for 39 sweeps in 40, start and end included.

    Parameters
    ----------
    forecast : Forecast
        Of the sweep.
    runs : int
        Number of runs of the study.
    """
    needed = _START_UP + forecast.makespan[2] + gathering_margin(runs)
    return _STEP * math.ceil(needed / _STEP)


def disk_space(study: Study, batches: int, histories: int, history_bytes: float) -> Disk:
    """Return the space that a study takes: the dataset, which is compressed, for no more than its records.

    Parameters
    ----------
    study : Study
        With the layout of its records.
    batches : int
        Number of batches that its runs make.
    histories : int
        Number of histories that are kept.
    history_bytes : float
        Size of one of them [byte].
    """
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    marks = batches * HEAD.size + study.size * PLACE.size
    values = study.size * study.record_dtype.itemsize
    named = len((*study.variables, *study.coordinates, *study.axes, *study.derived))
    return Disk(
        study.size * layout.record_size + marks,
        most_of_results(values, named),
        histories * history_bytes if histories else 0.0,
    )


def slurm_time(seconds: float) -> str:
    """Return a time span [s] as Slurm's [days-]hours:minutes:seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    return f"{f'{days}-' if days else ''}{hours:02d}:{minutes:02d}:{rest:02d}"
