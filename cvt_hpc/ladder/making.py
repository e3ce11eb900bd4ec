"""A ladder chart made: the same runs done with every model, compared, written and drawn."""

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.files import refuse_link, written_aside
from cvt_hpc.job import Job
from cvt_hpc.ladder.comparing import Finding, compare
from cvt_hpc.ladder.costs import cost_left
from cvt_hpc.ladder.drawing import draw_ladder
from cvt_hpc.ladder.rungs import Rung
from cvt_hpc.ladder.table import ladder_dataset, write_ladder
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.netcdf import write_netcdf
from cvt_hpc.simulation import simulate
from cvt_hpc.study import RunReport, check_start, open_results, run
from cvt_hpc.study.ranks.launch import detect_launch
from cvt_hpc.study.ranks.progress import show_duration


class LadderReport(NamedTuple):
    """Results of a ladder chart.

    Attributes
    ----------
    findings : tuple of Finding
        Each model's answer to each question, compared.
    table, dataset, picture : Path
        The files that hold them.
    """

    findings: tuple[Finding, ...]
    table: Path
    dataset: Path
    picture: Path


def run_ladder(
    rungs: Sequence[Rung],
    out: Path,
    *,
    fresh: bool = False,
    tell: Callable[[Rung, RunReport], None],
    announce: Callable[[str], None] = lambda line: None,
) -> int:
    """Do the runs of each model, a study in a folder of its own; on all ranks.

    Parameters
    ----------
    rungs : sequence of Rung
        The ladder of a job.
    out : Path
        The folder of these folders.
    fresh : bool
        Throw earlier results away.
    tell : callable
        Called with each model whose runs have ended, and how.
    announce : callable
        Called with a line before each model that has runs left, with the time to go.

    Returns
    -------
    int
        The largest exit status of a model; later ones do not start after one that stopped early.

    Raises
    ------
    InputError
        If the folder of a model holds another job or cannot be written to; before anything is computed.
    """
    status = 0
    begins = {rung.name: fresh or not (out / rung.name).exists() for rung in rungs}
    for rung in rungs:
        refuse_link(out / rung.name)
        check_start(rung.job, out / rung.name, fresh=fresh)
    left = {rung.name: cost_left(rung, None if fresh else out) for rung in rungs}
    done, spent = 0.0, 0.0
    predicted = sum(cost for _, cost in left.values())
    for number, rung in enumerate(rungs, 1):
        runs, cost = left[rung.name]
        if runs:
            to_go = sum(left[later.name][1] for later in rungs[number - 1 :])
            # by the time of earlier models, as far as they count beside all; at first by prediction alone
            to_go *= (spent + predicted / detect_launch().size) / (done + predicted)
            expected = f"{runs} runs, {show_duration(to_go)} to go in all"
            announce(f"model {number}/{len(rungs)} {rung.name}: {expected}")
        started = time.monotonic()
        # threads of the linear algebra wait for each other in loops, which would count as a model's own time
        with one_thread():
            if rung.job.stepper is None and begins[rung.name]:
                simulate(rung.job)  # libraries loaded and kernels compiled would count as time of a first run
            report = run(rung.job, out / rung.name, fresh=fresh, raises=False)
        tell(rung, report)
        done, spent = done + cost, spent + (time.monotonic() - started if runs else 0.0)
        status = max(status, report.status_of_more or report.exit_status)
        if report.status_of_more:
            break
    return status


def report_ladder(job: Job, rungs: Sequence[Rung], out: Path) -> LadderReport:
    """Compare the results of the models, and write table, dataset and picture; on one rank.

    Parameters
    ----------
    job : Job
        The job of the ladder.
    rungs, out
        As of `run_ladder`, which has come to its end.

    Raises
    ------
    InputError
        If the system refuses to read or write a file.
    """
    results = {}
    for rung in rungs:
        with open_results(out / rung.name) as dataset:
            results[rung.name] = dataset.load()
    findings = tuple(compare(rungs, results))
    report = LadderReport(findings, *(out / f"ladder.{suffix}" for suffix in ("csv", "nc", "png")))
    makers = [
        {"versions": json.loads(found.attrs["versions"]), "git_revision": found.attrs["git_revision"]}
        for found in results.values()
    ]
    dataset = ladder_dataset(job, rungs, findings, makers)
    write_ladder(job, findings, dataset.attrs | {"job_fingerprint": job.fingerprint()}, report.table)
    with written_aside(report.dataset) as aside:
        write_netcdf(dataset, aside)
    draw_ladder(job, findings, report.picture)
    return report
