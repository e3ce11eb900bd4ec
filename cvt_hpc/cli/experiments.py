"""Experiments, such as `chart` and `fit`: many runs, with tables and pictures of their own."""

import argparse
from importlib import import_module
from pathlib import Path
from typing import Any

from cvt_hpc.cli import parts
from cvt_hpc.errors import mismatch
from cvt_hpc.experiment_kinds import EXPERIMENTS


def add(commands: parts.Commands) -> None:
    """Declare the commands."""
    for name, experiment in EXPERIMENTS.items():
        command = parts.add_command(commands, name, _do, experiment.text, "JOB")
        parts.add_folder(command, experiment.earlier)
        parts.add_assignments(command, "--set", experiment.settings.format(parts.REPLACE))
        for option, text in experiment.options.items():
            command.add_argument(f"--{option}", metavar="VALUE", help=text)
        command.set_defaults(experiment=name)


def _do(arguments: argparse.Namespace) -> int:
    from cvt_hpc.study.ranks.launch import end_process

    name, experiment = arguments.experiment, EXPERIMENTS[arguments.experiment]
    module = import_module(experiment.module)
    options = {option: getattr(arguments, option) for option in experiment.options}

    def load() -> Any:
        _refuse_jobs_of_others(name, arguments.path)
        return module.load(arguments.path, arguments.set, **options)

    if experiment.alone:
        parts.refuse_ranks(name, experiment.alone)
        asked = load()
    else:
        asked = parts.alike(arguments, load)
    out = parts.output_folder(arguments.out, asked.job)
    outcome = module.make(asked, out, fresh=arguments.fresh, tell=parts.complain)
    if parts.speaks():
        parts.say(*outcome.lines, *(f"{what}: {path}" for what, path in outcome.files))
    return end_process(outcome.status)


def _refuse_jobs_of_others(name: str, path: Path) -> None:
    """Raise InputError for a job that has a table of another command alone."""
    from cvt_hpc.job.document import read_document

    instead = EXPERIMENTS[name].instead
    tables = read_document(path).keys() if instead else {}
    if name not in tables:
        for table in instead.keys() & tables:
            raise mismatch(f"{path}: [{table}]", f"a table [{name}]", f"[{table}] alone", instead[table])
