"""`chart`, `ladder`, `growth`, `branch` and `fit`: many runs, with tables and pictures of their own."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvt_hpc.cli import parts

if TYPE_CHECKING:
    from cvt_hpc.experiments.ladder.loading import Rung


def add(commands: Any) -> None:
    """Declare the commands."""
    chart = parts.add_command(commands, "chart", _chart, "measure speed against accuracy, and draw it", "JOB")
    parts.add_folder(chart, "earlier results of the folder")
    parts.add_assignments(chart, "--set", "replace a value of the job and of all its scenes")
    text = "do the runs of a job with every model of the ladder, and compare them"
    ladder = parts.add_command(commands, "ladder", _ladder, text, "JOB")
    parts.add_folder(ladder, "earlier results of all models")
    parts.add_assignments(ladder, "--set", f"{parts.REPLACE}; ladder.KEY replaces a key of [ladder]")
    text = "growth rates and frequencies of a job's modes, by runs with and without a kick"
    growth = parts.add_command(commands, "growth", _growth, text, "JOB")
    parts.add_folder(growth, "earlier runs")
    parts.add_assignments(growth, "--set", parts.REPLACE)
    growth.add_argument(
        "--kick", metavar="VALUE", help="size of the kick with its unit (default: the model's)"
    )
    text = "follow steady states along the load, to their Hopf points"
    branch = parts.add_command(commands, "branch", _branch, text, "JOB")
    parts.add_folder(branch, "an earlier diagram of the folder")
    parts.add_assignments(branch, "--set", parts.REPLACE)
    text = "look for the parameters that meet the targets of a job best"
    fit = parts.add_command(commands, "fit", _fit, text, "JOB")
    parts.add_folder(fit, "earlier studies of the folder")
    parts.add_assignments(fit, "--set", f"{parts.REPLACE}; fit.KEY replaces a number of [fit]")


def _chart(arguments: argparse.Namespace) -> int:
    from cvt_hpc.experiments.chart import load_chart, make_chart
    from cvt_hpc.experiments.chart.making import table_lines

    parts.refuse_ranks("chart", "measures times")
    chart = load_chart(arguments.path, arguments.set)
    report = make_chart(chart, arguments.out, fresh=arguments.fresh, tell=parts.complain)
    for comparison in report.comparisons:
        parts.say(*table_lines(comparison), "")
    parts.say(f"table: {report.table}", f"dataset: {report.dataset}")
    parts.say(*(f"picture: {picture}" for picture in report.pictures))
    return parts.DONE


def _ladder(arguments: argparse.Namespace) -> int:
    from cvt_hpc.experiments.ladder.loading import load_ladder
    from cvt_hpc.experiments.ladder.making import ladder_lines, report_ladder
    from cvt_hpc.study.ranks.launch import end_process
    from cvt_hpc.study.status import STALLED

    job, rungs, refusals = parts.alike(arguments, lambda: load_ladder(arguments.path, arguments.set))
    out = parts.output_folder(arguments.out, job)
    status = _run_rungs(rungs, refusals, out, arguments.fresh)
    if status < STALLED and parts.speaks():
        report = report_ladder(job, rungs, out)
        parts.say(*ladder_lines(job, report.findings))
        parts.say(f"table: {report.table}", f"dataset: {report.dataset}", f"picture: {report.picture}")
    return end_process(status)


def _run_rungs(rungs: Sequence[Rung], refusals: Mapping[str, str], out: Path, fresh: bool) -> int:
    """Do the runs of models one after another, and return the exit status."""
    from cvt_hpc.experiments.ladder.making import run_ladder
    from cvt_hpc.printing import trouble_lines

    parts.complain(*(f"{name} left out: {why}" for name, why in refusals.items()))
    return run_ladder(
        rungs,
        out,
        fresh=fresh,
        tell=lambda rung, report: parts.complain(*(f"{rung.name}: {line}" for line in trouble_lines(report))),
        announce=parts.complain,
    )


def _growth(arguments: argparse.Namespace) -> int:
    from cvt_hpc.experiments.growth import find_growth, growth_lines, load_growth, report_growth
    from cvt_hpc.study.ranks.launch import end_process
    from cvt_hpc.study.status import STALLED

    asked = parts.alike(arguments, lambda: load_growth(arguments.path, arguments.set, arguments.kick))
    out = parts.output_folder(arguments.out, asked.job)
    status = _run_rungs(asked.rungs, asked.refusals, out, arguments.fresh)
    if status < STALLED and parts.speaks():
        dataset, files = report_growth(asked, find_growth(asked, out), out)
        parts.say(*growth_lines(asked, dataset), *(f"written: {path}" for path in files))
    return end_process(status)


def _branch(arguments: argparse.Namespace) -> int:
    from cvt_hpc.experiments.branch import load_diagram, make_diagram
    from cvt_hpc.experiments.branch.diagram import DATASET
    from cvt_hpc.experiments.branch.table import branch_lines, failure_lines

    parts.refuse_ranks("branch", "walks along the load")
    diagram = load_diagram(arguments.path, arguments.set)
    folder = parts.output_folder(arguments.out, diagram.job)
    parts.check_output(folder / DATASET, (".nc",))
    report = make_diagram(diagram, folder, fresh=arguments.fresh, tell=parts.complain)
    failures = [line for followed in report.followed for line in failure_lines(diagram, followed)]
    parts.complain(*failures)
    for followed in report.followed:
        parts.say(*branch_lines(diagram, followed), "")
    parts.say(f"dataset: {report.dataset}", *(f"picture: {picture}" for picture in report.pictures))
    return parts.SOME_FAILED if failures else parts.DONE


def _fit(arguments: argparse.Namespace) -> int:
    from cvt_hpc.experiments.fit.evaluating import Stopped
    from cvt_hpc.experiments.fit.loading import load_fit
    from cvt_hpc.experiments.fit.making import make_fit
    from cvt_hpc.study.ranks.launch import end_process

    fit = parts.alike(arguments, lambda: load_fit(arguments.path, arguments.set))
    folder = parts.output_folder(arguments.out, fit.job)
    try:
        report = make_fit(fit, folder, fresh=arguments.fresh, tell=parts.complain)
    except Stopped as stopped:
        return end_process(stopped.status)
    if parts.speaks():
        parts.say(*report.lines, *(f"table: {table}" for table in report.tables))
    return end_process(parts.DONE)
