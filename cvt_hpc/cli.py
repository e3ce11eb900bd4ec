"""The command line: parse, call, print. Whatever a command needs is imported when it runs."""

from __future__ import annotations

import argparse
import logging
import os
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from cvt_hpc import __version__
from cvt_hpc.errors import CRASHED, InputError, mismatch

if TYPE_CHECKING:
    from cvt_hpc.analysis.comparison import Comparison
    from cvt_hpc.job import Job
    from cvt_hpc.study.repeats import Repeat

DONE, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
CONTRADICTING = 1  # of `compare`: some cells are quiet in one study and vibrate in the other
RETRIED = ("timed_out", "failed_error", "failed_numerics")
_SUBJECTS = {
    "JOB": "job file (TOML)",
    "DIR": "output folder of a run",
    "RESULTS": "output folder of a run, or a dataset (.nc)",
}


def main(arguments: list[str] | None = None) -> int:
    """Run a command line.

    Parameters
    ----------
    arguments : list of str, optional
        Those of the process by default.

    Returns
    -------
    int
        Exit status: 0 done, 1 some runs failed, 2 bad input, 70 a defect of this program, 99 stopped early
        and to be gone on with, 98 the same without any gain.
    """
    logging.basicConfig(format="cvt-hpc: %(message)s")
    try:
        parsed = _parser().parse_args(arguments)
        status = parsed.command(parsed)
        sys.stdout.flush()
        return status
    except InputError as error:
        _complain(str(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        _complain("interrupted")
        return INTERRUPTED
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except Exception:  # Python's own status for a defect, 1, means here that some runs failed
        traceback.print_exc()
        return CRASHED


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are ours: under MPI one rank prints them, not all."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see `{self.prog} --help`")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="cvt-hpc",
        description="Vibration-occurrence maps of metal pushbelt CVTs.",
        epilog="Exit status: 0 done, 1 some runs failed, 2 bad input, 99 stopped early (run again to go on), "
        "98 stopped before any run had ended.",
    )
    parser.add_argument("--version", action="version", version=f"cvt_hpc {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    run = _add(commands, "run", _run, "do all runs of a job, or those that an earlier start has left", "JOB")
    run.add_argument("--out", type=Path, metavar="DIR", help="output folder (default: out/<job name>)")
    run.add_argument(
        "--part",
        metavar="K/N",
        help="only the K-th of N parts of the runs; parts may be at work in one folder at the same time",
    )
    run.add_argument("--dry-run", action="store_true", help="validate options, job and folder; runs nothing")
    run.add_argument("--fresh", action="store_true", help="throw earlier results of the folder away")
    limit = (
        "time after which no run computes, such as 2h30m (default: until the end of the Slurm job, if any)"
    )
    run.add_argument("--time-limit", metavar="TIME", help=limit)
    run.add_argument("--run-limit", metavar="TIME", help="time that one run may take (default: any)")
    run.add_argument(
        "--retry",
        action="append",
        default=[],
        choices=RETRIED,
        help="do recorded runs that ended so again; may be repeated",
    )
    run.add_argument(
        "--refine",
        type=float,
        metavar="FACTOR",
        help="with --retry failed_numerics: at a time step shorter by this factor",
    )
    audit = "do so large a part of the runs that lower rungs of model auto have answered in full, and compare"
    run.add_argument("--audit", type=float, metavar="FRACTION", help=audit)
    check_step = "do so large a part of the runs again at half their time step, and compare"
    run.add_argument("--check-step", type=float, metavar="FRACTION", help=check_step)
    check_by = "how --check-step does them: at half the step (default), or by the stepper explicit"
    run.add_argument("--check-step-by", choices=("half", "explicit"), help=check_by)
    _add(commands, "status", _status, "how far a study is", "DIR")
    _add(commands, "gather", _gather, "write DIR/results.nc again, from the records", "DIR")
    picture = _add(commands, "map", _map, "draw where vibration occurs", "RESULTS")
    picture.add_argument("--out", type=Path, metavar="PNG", help="default: map.png beside the dataset")
    compare = _add(
        commands,
        "compare",
        _compare,
        "compare two studies, cell by cell; exit status 1: some contradict",
        "RESULTS",
    )
    compare.add_argument("other", type=Path, metavar="RESULTS", help="the one to compare with it")
    folder = "folder of compare.csv and compare.png (default: that of the second study)"
    compare.add_argument("--out", type=Path, metavar="DIR", help=folder)
    simulate = _add(commands, "simulate", _simulate, "one run with its full history", "JOB")
    simulate.add_argument("--out", type=Path, metavar="FILE.nc", help="dataset of the history")
    simulate.add_argument("--plot", type=Path, metavar="PNG", help="picture of the history")
    chart = _add(commands, "chart", _chart, "measure speed against accuracy, and draw it", "JOB")
    chart.add_argument("--out", type=Path, metavar="DIR", help="output folder (default: out/<job name>)")
    chart.add_argument("--fresh", action="store_true", help="throw earlier results of the folder away")
    ladder = _add(commands, "ladder", _ladder, "do the runs of a job on every rung, and compare them", "JOB")
    ladder.add_argument("--out", type=Path, metavar="DIR", help="output folder (default: out/<job name>)")
    ladder.add_argument("--fresh", action="store_true", help="throw earlier results of all rungs away")
    branch = _add(
        commands, "branch", _branch, "follow steady states along the load, to their Hopf points", "JOB"
    )
    branch.add_argument("--out", type=Path, metavar="DIR", help="output folder (default: out/<job name>)")
    branch.add_argument("--fresh", action="store_true", help="throw an earlier diagram of the folder away")
    check = _add(commands, "check", _check, "validate a job, show its defaults and estimate its cost", "JOB")
    ranks = "forecast the sweep on so many ranks: makespan, efficiency, core-hours, disk and Slurm's --time"
    check.add_argument("--ranks", type=int, nargs="+", default=[], metavar="N", help=ranks)
    pilots = "forecast by K batches that are done for it, shortened (default: by records, else by prediction)"
    check.add_argument("--pilots", type=int, default=0, metavar="K", help=pilots)
    check.add_argument("--plot", type=Path, metavar="PNG", help="picture of the forecast, 1 to 10 000 ranks")
    for command in (run, simulate, ladder, branch, check):
        _add_assignments(command, "--set", "replace a value of the job, or an axis by one value")
    _add_assignments(chart, "--set", "replace a value of the job and of all its scenes")
    _add_assignments(
        simulate,
        "--at",
        "where to run; an axis that is not named takes the value of its table, or else its first one",
    )
    _add_assignments(picture, "--at", "fix an axis at a value")
    return parser


def _add(
    commands: Any, name: str, call: Callable[[Any], int], text: str, subject: str
) -> argparse.ArgumentParser:
    command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    command.add_argument("path", type=Path, metavar=subject, help=_SUBJECTS[subject])
    command.set_defaults(command=call)
    return command


def _add_assignments(command: argparse.ArgumentParser, flag: str, text: str) -> None:
    text = f"{text}; may be repeated"
    command.add_argument(flag, action="append", default=[], metavar="KEY=VALUE", help=text)


def _run(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job import load_job
    from cvt_hpc.job.durations import read_duration
    from cvt_hpc.printing import repeat_line, report_lines, trouble_lines
    from cvt_hpc.study import check_start, run
    from cvt_hpc.study.launch import end_process
    from cvt_hpc.study.steps import check_refinement
    from cvt_hpc.variables import Status

    limits = {
        name: read_duration(getattr(arguments, name), f"--{name.replace('_', '-')}")
        for name in ("time_limit", "run_limit")
        if getattr(arguments, name) is not None
    }
    retry = [Status[name.upper()] for name in arguments.retry]
    job = load_job(arguments.path, arguments.set)
    options = {"fresh": arguments.fresh, "retry": retry, **limits}
    if arguments.refine is not None:
        check_refinement(job, arguments.refine, retry)
        options["refine"] = arguments.refine
    repeats = _repeats(job, arguments)
    if arguments.dry_run:
        check_start(job, arguments.out, part=arguments.part, fresh=arguments.fresh)
        _show(job, arguments.out)
        if _speaks():
            for repeat, _ in repeats:
                print(repeat_line(repeat))
        return DONE
    started = time.monotonic()
    report = run(job, arguments.out, part=arguments.part, **options)
    _complain(*trouble_lines(report))
    if _speaks():
        print(*report_lines(report), sep="\n")
    statuses = [report.exit_status]
    for repeat, show in repeats:
        if not report.remaining:
            statuses.append(_repeat(repeat, show, options, started))
    return end_process(max(statuses))


def _repeats(job: Job, arguments: argparse.Namespace) -> list[tuple[Repeat, Callable[[Repeat], None]]]:
    """Return which samples are to be done again, each with what prints what came of it."""
    if arguments.check_step_by and arguments.check_step is None:
        raise mismatch("--check-step-by", "--check-step FRACTION beside it", "none")
    if arguments.audit is None and arguments.check_step is None:
        return []
    from cvt_hpc.study.audit import audit_of
    from cvt_hpc.study.repeats import check_fraction
    from cvt_hpc.study.step_check import step_check

    out, repeats = arguments.out or Path("out") / job.name, []
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


def _repeat(repeat: Repeat, show: Callable[[Repeat], None], options: dict[str, Any], started: float) -> int:
    """Do the runs of a sample again in the time that is left, and print what was found."""
    from cvt_hpc.printing import trouble_lines

    if "time_limit" in options:
        left = options["time_limit"] - (time.monotonic() - started)
        options = {**options, "time_limit": max(left, 0.0)}
    report = repeat.run(**options)
    _complain(*(f"{repeat.label}: {line}" for line in trouble_lines(report)))
    if _speaks() and not report.remaining:
        show(repeat)
    return report.exit_status


def _show_audit(audit: Repeat) -> None:
    from cvt_hpc.printing import audit_lines
    from cvt_hpc.study.audit import report_audit

    print(*audit_lines(report_audit(audit)), sep="\n")


def _show_step_check(check: Repeat) -> None:
    from cvt_hpc.analysis.comparison import compare, only
    from cvt_hpc.printing import step_check_lines
    from cvt_hpc.study import open_results

    sources = str(check.out), str(check.place)
    with open_results(check.out) as a, open_results(check.place) as b:
        found = compare(a, only(b, check.sample), sources)
    written = _write_comparison(found, check.place, sources)
    print(*step_check_lines(check, found), *written, sep="\n")


def _status(arguments: argparse.Namespace) -> int:
    from cvt_hpc.printing import status_lines
    from cvt_hpc.study import read_status

    status = read_status(arguments.path)
    _complain(*status.warnings)
    print(*status_lines(status), sep="\n")
    return DONE


def _gather(arguments: argparse.Namespace) -> int:
    from cvt_hpc.study import gather

    print(f"results: {gather(arguments.path)}")
    return DONE


def _map(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job.assignments import read_coordinates
    from cvt_hpc.study import open_results

    folder = arguments.path if arguments.path.is_dir() else arguments.path.parent
    with open_results(arguments.path) as dataset:
        units = {str(name): array.attrs.get("units") for name, array in dataset.coords.items()}
        at = read_coordinates(arguments.at, units, str(arguments.path), "--at")
        from cvt_hpc.analysis.maps import draw_map
        from cvt_hpc.analysis.starts import has_starts, start_line

        picture = draw_map(dataset, arguments.out or folder / "map.png", at, str(arguments.path))
        if has_starts(dataset, at):
            print(start_line(dataset, at, str(arguments.path)))
        print(f"map: {picture}")
    return DONE


def _compare(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.comparison import compare
    from cvt_hpc.printing import comparison_lines
    from cvt_hpc.study import open_results

    sources = str(arguments.path), str(arguments.other)
    with open_results(arguments.path) as a, open_results(arguments.other) as b:
        found = compare(a, b, sources)
    folder = arguments.other if arguments.other.is_dir() else arguments.other.parent
    written = _write_comparison(found, arguments.out or folder, sources)
    print(*comparison_lines(found, sources), *written, sep="\n")
    return CONTRADICTING if found.contradicts.any() else DONE


def _write_comparison(found: Comparison, folder: Path, sources: tuple[str, str]) -> list[str]:
    """Leave table and picture of a comparison, and return the lines that say where."""
    from cvt_hpc.analysis.comparison import write_comparison
    from cvt_hpc.analysis.comparison_drawing import draw_comparison

    return [
        f"picture: {draw_comparison(found, folder / 'compare.png', sources)}",
        f"table: {write_comparison(found, folder / 'compare.csv')}",
    ]


def _simulate(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job import load_job
    from cvt_hpc.job.assignments import read_assignments

    job = load_job(arguments.path, arguments.set)
    at = read_assignments(arguments.at, job.schema, job.source, "--at")
    job.point_at(at, "--at")
    _check_output(arguments.out, (".nc",))
    _check_output(arguments.plot, (".png", ".svg", ".pdf"))
    from cvt_hpc.analysis.histories import draw_history
    from cvt_hpc.history_files import is_history, write_history
    from cvt_hpc.printing import outcome_lines, point_lines
    from cvt_hpc.simulation import simulate
    from cvt_hpc.study.provenance import command, history_line
    from cvt_hpc.variables import Status

    if arguments.out is not None and arguments.out.exists() and not is_history(arguments.out):
        raise mismatch(str(arguments.out), "a new file, or a history written by cvt_hpc", "another file")
    dataset = simulate(job, at).assign_attrs(history=history_line(command()))
    # files first: whoever reads the lines may close the pipe
    written = []
    if arguments.out is not None:
        written.append(f"history: {write_history(dataset, arguments.out)}")
    if arguments.plot is not None and dataset.sizes.get("time", 0) > 1:
        written.append(f"picture: {draw_history(dataset, arguments.plot)}")
    elif arguments.plot is not None:
        written.append("picture: none, the run has no history")
    print(*point_lines(job, at), *outcome_lines(dataset), *written, sep="\n")
    status = Status(int(dataset["status"]))
    if status != Status.DONE:
        _complain(f"the run failed: {status.name.lower()}: {dataset['reason'].item()}")
        return SOME_FAILED
    return DONE


def _chart(arguments: argparse.Namespace) -> int:
    from cvt_hpc.chart import load_chart, make_chart
    from cvt_hpc.chart.table import table_lines
    from cvt_hpc.study.launch import detect_launch

    if detect_launch().size > 1:
        raise mismatch("chart", "one process, because it measures times", f"{detect_launch().size} started")
    chart = load_chart(arguments.path, arguments.set)
    report = make_chart(chart, arguments.out, fresh=arguments.fresh, tell=_complain)
    for comparison in report.comparisons:
        print(*table_lines(comparison), "", sep="\n")
    print(f"table: {report.table}", f"dataset: {report.dataset}", sep="\n")
    print(*(f"picture: {picture}" for picture in report.pictures), sep="\n")
    return DONE


def _ladder(arguments: argparse.Namespace) -> int:
    from cvt_hpc.chart.ladder import report_ladder, run_ladder
    from cvt_hpc.chart.ladder_rungs import ladder
    from cvt_hpc.chart.ladder_table import ladder_lines
    from cvt_hpc.job import load_job
    from cvt_hpc.printing import trouble_lines
    from cvt_hpc.study.launch import end_process
    from cvt_hpc.study.report import STALLED

    job = load_job(arguments.path, arguments.set)
    out = arguments.out or Path("out") / job.name
    rungs, refusals = ladder(job)
    _complain(*(f"{name} left out: {why}" for name, why in refusals.items()))
    status = run_ladder(
        rungs,
        out,
        fresh=arguments.fresh,
        tell=lambda rung, report: _complain(*(f"{rung.name}: {line}" for line in trouble_lines(report))),
    )
    if status < STALLED and _speaks():
        report = report_ladder(job, rungs, out)
        print(*ladder_lines(report.findings), sep="\n")
        print(f"table: {report.table}", f"dataset: {report.dataset}", f"picture: {report.picture}", sep="\n")
    return end_process(status)


def _branch(arguments: argparse.Namespace) -> int:
    from cvt_hpc.bifurcation import load_diagram, make_diagram
    from cvt_hpc.bifurcation.folder import DATASET
    from cvt_hpc.bifurcation.table import branch_lines, failure_lines
    from cvt_hpc.study.launch import detect_launch

    if detect_launch().size > 1:
        started = f"{detect_launch().size} started"
        raise mismatch("branch", "one process, because it walks along the load", started)
    diagram = load_diagram(arguments.path, arguments.set)
    folder = arguments.out or Path("out") / diagram.job.name
    _check_output(folder / DATASET, (".nc",))
    report = make_diagram(diagram, folder, fresh=arguments.fresh, tell=_complain)
    failures = [line for followed in report.followed for line in failure_lines(diagram, followed)]
    _complain(*failures)
    for followed in report.followed:
        print(*branch_lines(diagram, followed), "", sep="\n")
    print(f"dataset: {report.dataset}", *(f"picture: {picture}" for picture in report.pictures), sep="\n")
    return SOME_FAILED if failures else DONE


def _check(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job import load_job

    _check_ranks(arguments.ranks)
    if arguments.pilots < 0:
        raise mismatch("--pilots", "a number of batches", str(arguments.pilots))
    if (arguments.pilots or arguments.plot) and not arguments.ranks:
        raise mismatch("--pilots" if arguments.pilots else "--plot", "--ranks beside it", "none")
    _check_output(arguments.plot, (".png", ".svg", ".pdf"))
    job = load_job(arguments.path, arguments.set)
    _show(job, None)
    if arguments.ranks and _speaks():
        from cvt_hpc.printing import disk_line, forecast_lines
        from cvt_hpc.study.forecast import CURVE
        from cvt_hpc.study.resources import expect

        ranks = [*arguments.ranks, *(CURVE if arguments.plot else ())]
        expected = expect(job, Path("out") / job.name, ranks, arguments.pilots)
        asked, curve = expected.forecasts[: len(arguments.ranks)], expected.forecasts[len(arguments.ranks) :]
        print("", *forecast_lines(asked, job, expected.basis), sep="\n")
        print(disk_line(expected.disk, len(job.histories)))
        if arguments.plot is not None:
            from cvt_hpc.analysis.efficiency import draw_efficiency

            title = f"{job.name}: {job.size} runs"
            print(f"picture: {draw_efficiency(curve, title, expected.basis, arguments.plot)}")
    return DONE


def _show(job: Job, out: Path | None) -> None:
    """Print what a job runs."""
    from cvt_hpc.job.summary import summarize
    from cvt_hpc.study.description import describe
    from cvt_hpc.study.simulator import default_simulator

    describe(job, default_simulator())  # refuses axes that the dataset of a run could not hold
    if _speaks():
        from cvt_hpc.study.status import expected_cost

        print(summarize(job, *expected_cost(job, out or Path("out") / job.name)))


def _check_ranks(ranks: list[int]) -> None:
    from cvt_hpc.study.forecast import MOST_RANKS

    for number in ranks:
        if not 1 <= number <= MOST_RANKS:
            raise mismatch("--ranks", f"numbers of ranks from 1 to {MOST_RANKS}", str(number))


def _check_output(path: Path | None, suffixes: tuple[str, ...]) -> None:
    """Refuse a file that could not be written, before anything is computed for it."""
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise mismatch(str(path), f"a file name in {', '.join(suffixes)}", path.suffix or "no suffix")
    nearest = next(parent for parent in path.absolute().parents if parent.exists())
    if path.is_dir():
        found = "a folder of this name"
    elif not nearest.is_dir():
        found = f"the file {nearest} in the place of a folder"
    elif not os.access(nearest, os.W_OK):
        found = f"no permission to write to {nearest}"
    else:
        return
    raise mismatch(str(path), "a file that can be written", found)


def _complain(*lines: str) -> None:
    if _speaks():
        for line in lines:
            print(f"cvt-hpc: {line}", file=sys.stderr)


def _speaks() -> bool:
    """Return whether this process is the one of those started together that talks to the user."""
    from cvt_hpc.study import process_rank

    return process_rank() == 0
