"""`simulate`: one run with its history."""

import argparse
from pathlib import Path
from typing import Any

from cvt_hpc.cli import parts
from cvt_hpc.errors import mismatch


def add(commands: Any) -> None:
    """Declare the command."""
    simulate = parts.add_command(commands, "simulate", _simulate, "one run with its full history", "JOB")
    simulate.add_argument("--out", type=Path, metavar="FILE.nc", help="dataset of the history")
    simulate.add_argument("--plot", type=Path, metavar="PNG", help="picture of the history")
    text = "print all numbers of the run, not only those that matter most"
    simulate.add_argument("--all", action="store_true", help=text)
    parts.add_assignments(simulate, "--set", parts.REPLACE)
    at = "where to run; an axis that is not named takes the value of its table, or else its first one"
    parts.add_assignments(simulate, "--at", at)


def _simulate(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job import load_job
    from cvt_hpc.job.assignments import read_assignments

    job = load_job(arguments.path, arguments.set).with_units_of(arguments.at, "--at")
    at = read_assignments(arguments.at, job.schema, job.source, "--at")
    job.point_at(at, "--at")
    parts.check_output(arguments.out, (".nc",))
    parts.check_output(arguments.plot, parts.PICTURES)
    from cvt_hpc.printing import MOST_OUTCOMES, outcome_lines, point_lines, units_of
    from cvt_hpc.simulation import alone
    from cvt_hpc.storage.netcdf import is_history, write_history
    from cvt_hpc.variables import Status

    if arguments.out is not None and arguments.out.exists() and not is_history(arguments.out):
        raise mismatch(str(arguments.out), "a new file, or a history written by cvt_hpc", "another file")
    run = alone(job, arguments.at)
    # files first: whoever reads the lines may close the pipe
    written: list[str] = []
    if arguments.out is not None or arguments.plot is not None:
        dataset = run.history()  # it takes as long as a short run
    if arguments.out is not None:
        written.append(f"history: {write_history(dataset, arguments.out)}")
    if arguments.plot is not None and dataset.sizes.get("time", 0) > 1:
        from cvt_hpc.analysis.histories import draw_history  # takes longer than a short run

        written.append(f"picture: {draw_history(dataset, arguments.plot)}")
    elif arguments.plot is not None:
        written.append("picture: none, the run has no history")
    most = None if arguments.all else MOST_OUTCOMES
    parts.say(*point_lines(job, at), *outcome_lines(run.outcomes(), units_of(job), most), *written)
    status = Status(int(run.record["status"]))
    if status != Status.DONE:
        parts.complain(f"the run failed: {status.name.lower()}: {run.record['reason']}")
        return parts.SOME_FAILED
    return parts.DONE
