"""`run`: all runs of a job, and samples of them done again another way."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from cvt_hpc.cli import parts
from cvt_hpc.cli.checking import show_job
from cvt_hpc.cli.results import leave_comparison
from cvt_hpc.errors import mismatch

if TYPE_CHECKING:
    from cvt_hpc.job import Job
    from cvt_hpc.study import RunReport
    from cvt_hpc.study.repeats import Repeat

Options = dict[str, Any]  # of a sweep
_RETRIED = ("timed_out", "failed_error", "failed_numerics")


def add(commands: parts.Commands) -> None:
    """Declare the command."""
    text = "do all runs of a job, or those that an earlier start has left"
    run = parts.add_command(commands, "run", _run, text, "JOB")
    parts.add_folder(run, "earlier results of the folder")
    part = "only the K-th of N parts of the runs; parts may be at work in one folder at the same time"
    run.add_argument("--part", metavar="K/N", help=part)
    run.add_argument("--dry-run", action="store_true", help="validate options, job and folder; runs nothing")
    limit = "time in which the sweep ends, such as 2h30m (default: until the end of the Slurm job, if any)"
    run.add_argument("--time-limit", metavar="TIME", help=limit)
    run.add_argument("--run-limit", metavar="TIME", help="time that one run may take (default: any)")
    retry = "do recorded runs that ended so again, from their start; may be repeated"
    run.add_argument("--retry", action="append", default=[], choices=_RETRIED, help=retry)
    refine = (
        "with --retry failed_numerics: begin at the job's time step over this factor, and halve it from "
        "there as often as most_refinements says (default: the first factor not tried yet, 16 after three "
        "halvings; 1: the job's own step again)"
    )
    run.add_argument("--refine", type=float, metavar="FACTOR", help=refine)
    audit = "repeat this share of the runs that model auto has decided by cheaper models in full, and compare"
    run.add_argument("--audit", type=float, metavar="FRACTION", help=audit)
    check_step = "repeat this share of the runs at half their time step, and compare"
    run.add_argument("--check-step", type=float, metavar="FRACTION", help=check_step)
    check_by = "how --check-step repeats them: at half the step (default), or by the stepper explicit"
    run.add_argument("--check-step-by", choices=("half", "explicit"), help=check_by)
    parts.add_assignments(run, "--set", parts.REPLACE)


def _run(arguments: argparse.Namespace) -> int:
    load = partial(_load, arguments)
    job, options, repeats = load() if arguments.dry_run else parts.alike(arguments, load)

    from cvt_hpc.printing import next_lines, repeat_line, report_lines, trouble_lines
    from cvt_hpc.study import run
    from cvt_hpc.study.ranks.launch import end_process

    if arguments.dry_run:
        show_job(job, arguments.out)
        if parts.speaks():
            for repeat, _ in repeats:
                parts.say(repeat_line(repeat))
        return parts.DONE
    started = time.monotonic()
    report = run(job, arguments.out, part=arguments.part, **options)
    parts.complain(*trouble_lines(report))
    if parts.speaks():
        parts.say(*report_lines(report))
    latest, statuses = report, [report.exit_status]
    for repeat, show in repeats:
        if stopped := latest.status_of_more:
            statuses.append(stopped)
            break
        latest = _repeat(repeat, show, options, started)
        statuses.append(latest.exit_status)
    if parts.speaks():
        parts.say(*next_lines(report))
    return end_process(max(statuses))


def _load(
    arguments: argparse.Namespace,
) -> tuple[Job, Options, list[tuple[Repeat, Callable[[Repeat], None]]]]:
    """Return the job, the options of its sweep, and the samples that are to be done again."""
    from cvt_hpc.job import load_job
    from cvt_hpc.job.units import read_duration
    from cvt_hpc.study import check_start
    from cvt_hpc.study.task import check_refinement
    from cvt_hpc.variables import Status

    asked = ((name, getattr(arguments, name)) for name in ("time_limit", "run_limit"))
    limits = {k: read_duration(v, f"--{k.replace('_', '-')}") for k, v in asked if v is not None}
    retry = [Status[name.upper()] for name in arguments.retry]
    job = load_job(arguments.path, arguments.set)
    options = {"fresh": arguments.fresh, "retry": retry, "raises": False, **limits}
    if arguments.refine is not None:
        check_refinement(job, arguments.refine, retry)
        options["refine"] = arguments.refine
    repeats = _repeats(job, arguments)
    if arguments.dry_run:
        check_start(job, arguments.out, part=arguments.part, fresh=arguments.fresh)
    return job, options, repeats


def _repeats(job: Job, arguments: argparse.Namespace) -> list[tuple[Repeat, Callable[[Repeat], None]]]:
    """Return which samples are to be done again, each with what prints what came of it."""
    if arguments.check_step_by and arguments.check_step is None:
        raise mismatch("--check-step-by", "--check-step FRACTION beside it", "none")
    if arguments.audit is None and arguments.check_step is None:
        return []
    from cvt_hpc.study.audit import audit_of
    from cvt_hpc.study.repeats import check_fraction, step_check

    out = parts.output_folder(arguments.out, job)
    repeats: list[tuple[Repeat, Callable[[Repeat], None]]] = []
    if arguments.audit is not None:
        check_fraction("--audit", arguments.audit, arguments.part)
        repeats.append((audit_of(job, out, arguments.audit), _show_audit))
    if arguments.check_step is not None:
        check_fraction("--check-step", arguments.check_step, arguments.part)
        way = arguments.check_step_by or "half"
        repeats.append((step_check(job, out, arguments.check_step, way), _show_step_check))
    for repeat, _ in repeats:
        repeat.check(arguments.fresh)
    return repeats


def _repeat(repeat: Repeat, show: Callable[[Repeat], None], options: Options, started: float) -> RunReport:
    """Do the runs of a sample again in the time that is left, and print what was found."""
    from cvt_hpc.printing import trouble_lines

    if "time_limit" in options:
        left = options["time_limit"] - (time.monotonic() - started)
        options = {**options, "time_limit": max(left, 0.0)}
    report = repeat.run(**options)
    parts.complain(*(f"{repeat.label}: {line}" for line in trouble_lines(report)))
    if parts.speaks() and not report.remaining:
        show(repeat)
    return report


def _show_audit(audit: Repeat) -> None:
    from cvt_hpc.printing import audit_lines
    from cvt_hpc.study.audit import report_audit

    parts.say(*audit_lines(report_audit(audit)))


def _show_step_check(check: Repeat) -> None:
    from cvt_hpc.analysis.comparison import compare, only
    from cvt_hpc.printing import step_check_lines
    from cvt_hpc.study import open_results

    if not check.sample.any():
        parts.say("step check: none of the runs has taken steps, none is done again")
        return
    sources = str(check.out), str(check.place)
    with open_results(check.out) as a, open_results(check.place) as b:
        found = compare(a, only(b, check.sample), sources)
    parts.say(*step_check_lines(check, found), *leave_comparison(found, check.place, sources))
