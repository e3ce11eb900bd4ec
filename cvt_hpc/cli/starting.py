"""`init`, `models`, `variables`, `examples`, `friction`, `doctor`, `completion`: for somebody who begins."""

import argparse
from pathlib import Path

from cvt_hpc.cli import parts

_SHELLS = ("bash", "zsh", "tcsh")


def add(commands: parts.Commands) -> None:
    """Declare the commands."""
    text = "write NAME.toml, a job in which each key of a model stands with its default and meaning"
    init = parts.add_command(commands, "init", _init, text)
    init.add_argument("name", metavar="NAME", help="of the job, and of its file in this folder")
    one = "one of `cvt-hpc models` (default: %(default)s)"
    init.add_argument("--model", default="elastic_belt", help=one)
    text = "list the models, or of one its keys with defaults, units and choices"
    models = parts.add_command(commands, "models", _models, text)
    models.add_argument("model", nargs="?", metavar="MODEL", help="a model, for its keys")
    text = "list the variables that the runs of a model leave in the dataset: names, units and meaning"
    variables = parts.add_command(commands, "variables", _variables, text)
    variables.add_argument("model", metavar="MODEL", help="one of `cvt-hpc models`")
    text = "list the jobs, notebooks and batch files that come with the program, or copy some"
    examples = parts.add_command(commands, "examples", _examples, text)
    text = "an example or a folder of them, such as quickstart, notebooks or slurm, to be copied"
    examples.add_argument("names", nargs="*", metavar="NAME", help=text)
    text = "folder below which the copies go (default: this one)"
    examples.add_argument("--out", type=Path, default=Path(), metavar="DIR", help=text)
    text = (
        "fit the laws of friction to measured coefficients; write the best as a part of a job, and a picture"
    )
    friction = parts.add_command(commands, "friction", _friction, text, "CSV")
    text = "the part of a job (default: friction.toml in this folder; the picture beside it)"
    friction.add_argument("--out", type=Path, default=Path("friction.toml"), metavar="TOML", help=text)
    text = "law of friction to be written, such as stribeck (default: the best)"
    friction.add_argument("--law", metavar="NAME", help=text)
    text = "look at MPI, cores, cache, disk and Slurm of this machine, and say what to do"
    parts.add_command(commands, "doctor", _doctor, text)
    text = "print what completes commands and options in a shell"
    end = ': eval "$(cvt-hpc completion bash)" in ~/.bashrc.'
    completion = parts.add_command(commands, "completion", _completion, text, end=end)
    completion.add_argument("shell", choices=_SHELLS)


def _init(arguments: argparse.Namespace) -> None:
    from cvt_hpc.job.template import write_template

    path = write_template(arguments.name, arguments.model)
    then = f"cvt-hpc check {path}; cvt-hpc run {path}; cvt-hpc map out/{arguments.name}"
    parts.say(f"job: {path}", f"next: {then}")


def _models(arguments: argparse.Namespace) -> None:
    from cvt_hpc.job.template import key_lines, model_lines

    if arguments.model:
        parts.say(*key_lines(arguments.model))
    else:
        parts.say(*model_lines(), "", "keys: cvt-hpc models MODEL; a job: cvt-hpc init NAME --model MODEL")


def _variables(arguments: argparse.Namespace) -> None:
    from cvt_hpc.simulation import declared_record
    from cvt_hpc.tables import columns

    declared, coordinates = declared_record(arguments.model, "variables")
    rows = [(v.name, ", ".join(v.dims), v.units, v.meaning) for v in declared]
    along = [(name, coordinate.units, coordinate.meaning) for name, coordinate in coordinates.items()]
    parts.say(*columns([("variable", "along", "unit", "meaning"), *rows], indent=""), "")
    parts.say(*columns([("dimension", "unit", "meaning"), *along], indent=""))


def _examples(arguments: argparse.Namespace) -> None:
    from cvt_hpc.job.template import copy_examples, example_lines

    if arguments.names:
        parts.say(*(f"example: {path}" for path in copy_examples(arguments.names, arguments.out)))
    else:
        parts.say(*example_lines(), "", "copies: cvt-hpc examples NAME")


def _friction(arguments: argparse.Namespace) -> None:
    from cvt_hpc.experiments.measured_friction import write_fit

    parts.check_output(arguments.out, (".toml",))
    lines, files = write_fit(arguments.path, arguments.out, arguments.law)
    parts.say(*lines, *(f"{what}: {path}" for what, path in files))


def _doctor(arguments: argparse.Namespace) -> int:
    from cvt_hpc.study.doctor import examine

    status = parts.DONE
    for finding in examine(Path()):
        parts.say(f"{'ok     ' if finding.fine else 'trouble'}  {finding.what}: {finding.found}")
        if finding.advice:
            parts.say(f"         {finding.advice}")
        status = status if finding.fine else parts.SOME_FAILED
    return status


def _completion(arguments: argparse.Namespace) -> None:
    import shtab

    print(shtab.complete(arguments.parser, arguments.shell))
