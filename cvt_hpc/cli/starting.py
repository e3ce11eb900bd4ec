"""`init`, `models`, `variables`, `examples`, `doctor`, `completion`: what somebody needs who begins."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from cvt_hpc.cli.parts import DONE, SOME_FAILED, say

SHELLS = ("bash", "zsh", "tcsh")


def add(commands: Any) -> None:
    """Declare the commands."""
    text = "write NAME.toml, a job in which each key of a model stands with its default and meaning"
    init = commands.add_parser("init", help=text, description=f"{text[0].upper()}{text[1:]}.")
    init.add_argument("name", metavar="NAME", help="of the job, and of its file in this folder")
    init.add_argument(
        "--model", default="elastic_belt", help="one of `cvt-hpc models` (default: %(default)s)"
    )
    init.set_defaults(command=_init)
    text = "list the models, or of one its keys with defaults, units and choices"
    models = commands.add_parser("models", help=text, description=f"{text[0].upper()}{text[1:]}.")
    models.add_argument("model", nargs="?", metavar="MODEL", help="a model, for its keys")
    models.set_defaults(command=_models)
    text = "list the variables that the runs of a model leave in the dataset: names, units and meaning"
    variables = commands.add_parser("variables", help=text, description=f"{text[0].upper()}{text[1:]}.")
    variables.add_argument("model", metavar="MODEL", help="one of `cvt-hpc models`")
    variables.set_defaults(command=_variables)
    text = "list the jobs, notebooks and batch files that come with the program, or copy some"
    examples = commands.add_parser("examples", help=text, description=f"{text[0].upper()}{text[1:]}.")
    text = "an example or a folder of them, such as quickstart, notebooks or slurm, to be copied"
    examples.add_argument("names", nargs="*", metavar="NAME", help=text)
    text = "folder below which the copies go (default: this one)"
    examples.add_argument("--out", type=Path, default=Path(), metavar="DIR", help=text)
    examples.set_defaults(command=_examples)
    text = "look at MPI, cores, cache, disk and Slurm of this machine, and say what to do"
    doctor = commands.add_parser("doctor", help=text, description=f"{text[0].upper()}{text[1:]}.")
    doctor.set_defaults(command=_doctor)
    text = "print what completes commands and options in a shell"
    completion = commands.add_parser(
        "completion",
        help=text,
        description=f'{text[0].upper()}{text[1:]}: eval "$(cvt-hpc completion bash)" in ~/.bashrc.',
    )
    completion.add_argument("shell", choices=SHELLS)
    completion.set_defaults(command=_completion)


def _init(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job.template import write_template

    path = write_template(arguments.name, arguments.model)
    say(f"job: {path}", f"next: cvt-hpc check {path}; cvt-hpc run {path}; cvt-hpc map out/{arguments.name}")
    return DONE


def _models(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job.template import key_lines, model_lines

    if arguments.model:
        say(*key_lines(arguments.model))
    else:
        say(
            *model_lines(),
            "",
            "keys: cvt-hpc models MODEL; a job: cvt-hpc init NAME --model MODEL",
        )
    return DONE


def _variables(arguments: argparse.Namespace) -> int:
    from cvt_hpc.simulation import declared_record
    from cvt_hpc.tables import columns

    declared, coordinates = declared_record(arguments.model, "variables")
    rows = [(v.name, ", ".join(v.dims), v.units, v.meaning) for v in declared]
    along = [(name, coordinate.units, coordinate.meaning) for name, coordinate in coordinates.items()]
    say(*columns([("variable", "along", "unit", "meaning"), *rows], indent=""), "")
    say(*columns([("dimension", "unit", "meaning"), *along], indent=""))
    return DONE


def _examples(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job.examples import copy_examples, example_lines

    if arguments.names:
        say(*(f"example: {path}" for path in copy_examples(arguments.names, arguments.out)))
    else:
        say(*example_lines(), "", "copies: cvt-hpc examples NAME")
    return DONE


def _doctor(arguments: argparse.Namespace) -> int:
    from cvt_hpc.study.doctor import examine

    status = DONE
    for finding in examine(Path()):
        say(f"{'ok     ' if finding.fine else 'trouble'}  {finding.what}: {finding.found}")
        if finding.advice:
            say(f"         {finding.advice}")
        status = status if finding.fine else SOME_FAILED
    return status


def _completion(arguments: argparse.Namespace) -> int:
    import shtab

    print(shtab.complete(arguments.parser, arguments.shell))
    return DONE
