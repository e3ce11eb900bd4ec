"""`check`: what a job of any command would do, and what that costs."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from cvt_hpc.cli import parts
from cvt_hpc.errors import mismatch
from cvt_hpc.experiment_kinds import EXPERIMENTS, with_table

if TYPE_CHECKING:
    from cvt_hpc.job import Job

RUN = "run"


def add(commands: parts.Commands) -> None:
    """Declare the command."""
    text = "validate a job, show its defaults and estimate its cost"
    check = parts.add_command(commands, "check", _check, text, "JOB")
    ranks = "forecast the sweep on so many ranks: makespan, efficiency, core-hours, disk and Slurm's --time"
    check.add_argument("--ranks", type=int, nargs="+", default=[], metavar="N", help=ranks)
    pilots = "forecast by K batches that are done for it, shortened (default: by records, else by prediction)"
    check.add_argument("--pilots", type=int, default=0, metavar="K", help=pilots)
    check.add_argument("--plot", type=Path, metavar="PNG", help="picture of the forecast, 1 to 10 000 ranks")
    command = f"command that is to take the job (default: {' or '.join(with_table())} by its table, else run)"
    check.add_argument("--for", dest="command_for", choices=(RUN, *EXPERIMENTS), help=command)
    parts.add_assignments(check, "--set", parts.REPLACE)


def _check(arguments: argparse.Namespace) -> None:
    from cvt_hpc.job import load_job
    from cvt_hpc.job.document import read_document

    tables = read_document(arguments.path)
    command = arguments.command_for or next((name for name in with_table() if name in tables), RUN)
    if command != RUN:
        if arguments.ranks or arguments.pilots or arguments.plot:
            found = f"one of `cvt-hpc {command}`"
            raise mismatch("--ranks, --pilots, --plot", "a job of `cvt-hpc run`", found)
        experiment = import_module(EXPERIMENTS[command].module)
        asked = experiment.load(arguments.path, arguments.set)
        lines = list(experiment.plan_lines(asked, parts.output_folder(None, asked.job)))
        if parts.speaks():
            print(*lines, sep="\n")
        return
    _check_ranks(arguments.ranks)
    if arguments.pilots < 0:
        raise mismatch("--pilots", "a number of batches", str(arguments.pilots))
    if (arguments.pilots or arguments.plot) and not arguments.ranks:
        raise mismatch("--pilots" if arguments.pilots else "--plot", "--ranks beside it", "none")
    parts.check_output(arguments.plot, parts.PICTURES)
    job = load_job(arguments.path, arguments.set)
    show_job(job, None)
    if arguments.ranks and parts.speaks():
        from cvt_hpc.printing import disk_line, forecast_lines
        from cvt_hpc.study.forecast.cost_model import CURVE
        from cvt_hpc.study.forecast.resources import expect

        ranks = [*arguments.ranks, *(CURVE if arguments.plot else ())]
        expected = expect(job, parts.output_folder(None, job), ranks, arguments.pilots)
        asked, curve = expected.forecasts[: len(arguments.ranks)], expected.forecasts[len(arguments.ranks) :]
        parts.say("", *forecast_lines(asked, job, expected.basis))
        parts.say(disk_line(expected.disk, len(job.histories)))
        if arguments.plot is not None:
            from cvt_hpc.analysis.efficiency import draw_efficiency

            title = f"{job.name}: {job.size} runs"
            parts.say(f"picture: {draw_efficiency(curve, title, expected.basis, arguments.plot)}")


def show_job(job: Job, out: Path | None) -> None:
    """Print what a job runs."""
    from cvt_hpc.job.summary import summarize
    from cvt_hpc.printing import needs_line
    from cvt_hpc.study.description import check_names
    from cvt_hpc.study.forecast.resources import refuse_too_large
    from cvt_hpc.study.simulator import default_simulator

    check_names(job, default_simulator())
    needed = refuse_too_large(job, default_simulator(), parts.output_folder(out, job))
    if parts.speaks():
        from cvt_hpc.study.status import expected_cost

        parts.say(*summarize(job, *expected_cost(job, parts.output_folder(out, job))).split("\n"))
        parts.say(needs_line(needed, len(job.histories)))


def _check_ranks(ranks: list[int]) -> None:
    from cvt_hpc.study.forecast.cost_model import MOST_RANKS

    for number in ranks:
        if not 1 <= number <= MOST_RANKS:
            raise mismatch("--ranks", f"numbers of ranks from 1 to {MOST_RANKS}", str(number))
