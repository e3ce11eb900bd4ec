"""Common parts of several commands: their declaration, whom they talk to, and which files they may write."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from cvt_hpc.errors import mismatch, one_line

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.analysis.arrangement import Sides
    from cvt_hpc.job import Job
    from cvt_hpc.job.values import Point

Result = TypeVar("Result")
Command = Callable[[argparse.Namespace], int | None]  # does one, and returns the exit status, if not 0
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"

DONE, SOME_FAILED = 0, 1
PICTURES = (".png", ".svg", ".pdf")
LONGEST_NAME, _LONGEST_NAMES = 100, 60  # letters of a picture's name, and of the files' names within it
# what --set does
REPLACE = (
    "replace a value of the job, or an axis by one value, a list [40, 60] or a range {from=, to=, step=}"
)
_SUBJECTS = {
    "JOB": "job file (TOML)",
    "DIR": "output folder of a run",
    "RESULTS": "output folder of a run, or a dataset (.nc)",
    "CSV": "measured points: columns speed and mu, and, if there are any, force and specimen",
    "HISTORY": "dataset of one run (.nc)",
    "HISTORIES": "dataset of one run (.nc), or the folder of a study: all runs whose histories it keeps",
}


def add_command(
    commands: Commands, name: str, call: Command, text: str, subject: str = "", end: str = "."
) -> argparse.ArgumentParser:
    """Return a new command; `subject`, what it is about, is one of the keys of _SUBJECTS, if there is any."""
    command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}{end}")
    if subject:
        command.add_argument("path", type=Path, metavar=subject, help=_SUBJECTS[subject])
    command.set_defaults(command=call)
    return command


def add_assignments(command: argparse.ArgumentParser, flag: str, text: str) -> None:
    """Add an option that sets values, KEY=VALUE."""
    text = f"{text}; may be repeated"
    command.add_argument(flag, action="append", default=[], metavar="KEY=VALUE", help=text)


def add_sides(command: argparse.ArgumentParser, sides: Sequence[str] = ("x", "y", "panel")) -> None:
    """Add the options that lay axes of a study out; `sides_of` reads them."""
    places = {"x": "along x", "y": "along y", "panel": "over the panels"}
    for side in sides:
        command.add_argument(f"--{side}", metavar="AXIS", help=f"axis of the study that runs {places[side]}")


def sides_of(arguments: argparse.Namespace) -> Sides:
    """Return which axes are to run where."""
    from cvt_hpc.analysis.arrangement import Sides

    return Sides(*(getattr(arguments, side, None) for side in Sides._fields))


def colour_end(text: str | None, unit: str, *, fits: bool = True) -> Any:
    """Return where colours end [SI], of a quantity of this SI unit; `fits`: they fit by default."""
    from cvt_hpc.analysis.cells import FIT
    from cvt_hpc.job.units import unit_in
    from cvt_hpc.job.values import read_value
    from cvt_hpc.parameters import positive

    if text is None or text == FIT:
        return None if fits else text
    unit = unit.removeprefix("1")
    if unit and not unit_in(text):  # 20 would be 20 m
        raise mismatch("--vmax", f"a value with its unit, of {unit}", text)
    return read_value(positive(1.0, unit, ""), text, "--vmax")


def add_folder(command: argparse.ArgumentParser, earlier: str) -> None:
    """Add the options of a command that fills an output folder; `earlier` is what --fresh throws away."""
    command.add_argument("--out", type=Path, metavar="DIR", help="output folder (default: out/<job name>)")
    command.add_argument("--fresh", action="store_true", help=f"throw {earlier} away")


def output_folder(out: Path | None, job: Job) -> Path:
    """Return the output folder of a job: the one asked for, or that of its name."""
    return out or Path("out") / job.name


def folder_of(results: Path) -> Path:
    """Return the folder of results that are given as a folder or as a dataset in it."""
    return results if results.is_dir() else results.parent


@contextmanager
def opened_results(path: Path) -> Iterator[xr.Dataset]:
    """Results of a study in the form in which this program writes them, open within."""
    from cvt_hpc.analysis.conversion import standard
    from cvt_hpc.study import open_results

    with open_results(path) as opened:
        yield standard(opened, str(path))


@contextmanager
def opened_histories(files: Sequence[Path]) -> Iterator[list[xr.Dataset]]:
    """Histories of runs in the form in which this program writes them, open within."""
    from cvt_hpc.analysis.conversion import standard
    from cvt_hpc.storage.netcdf import open_netcdf

    with ExitStack() as stack:
        opened = [stack.enter_context(open_netcdf(file, follow=True)) for file in files]
        yield [standard(history, str(file)) for history, file in zip(opened, files, strict=True)]


def fixed_axes(arguments: argparse.Namespace, dataset: xr.Dataset, source: str) -> Point:
    """Return the values [SI] at which --at fixes axes of results."""
    from cvt_hpc.job.assignments import read_coordinates

    units = {str(name): array.attrs.get("units") for name, array in dataset.coords.items()}
    return read_coordinates(arguments.at, units, source, "--at")


def alike(arguments: argparse.Namespace, load: Callable[[], Result]) -> Result:
    """Return what `load` returns, once it has succeeded on all ranks, and all have the same options."""
    from cvt_hpc.study.ranks.launch import assembled_team

    def options(_: Result) -> dict[str, dict[str, str]]:
        given = vars(arguments).items()
        words = {name: str(value) for name, value in given if name not in ("path", "command", "parser")}
        return {"options": {"command": arguments.command.__name__.strip("_"), **words}}

    with assembled_team() as team:
        return team.agreed(load, options)


def end_all(status: int, line: str = "") -> None:
    """End all ranks with a line of this one, if there are several."""
    if launch := sys.modules.get("cvt_hpc.study.ranks.launch"):  # else they are not connected
        launch.end_all(status, line)


def files_of(results: Path) -> list[Path]:
    """Return the dataset by whose name a picture of results is called; of a folder there is none."""
    return [] if results.is_dir() else [results]


def refuse_ranks(command: str, why: str) -> None:
    """Raise InputError if several processes were started together for a command that one does."""
    from cvt_hpc.study.ranks.launch import detect_launch

    if (size := detect_launch().size) > 1:
        raise mismatch(command, f"one process, because it {why}", f"{size} started")


def picture_beside(path: Path, files: Sequence[Path], *words: str) -> Path:
    """The picture of datasets beside the first one, or in a folder: NAME_KIND_WHAT_AXIS=VALUE.png.

    NAME is that of the files; `results`, which each study has, is left out. Of many it is that of the first.
    """
    names = [name for file in files if (name := file.stem) != "results"]
    if len("_".join(names)) > _LONGEST_NAMES:
        names = [names[0][:_LONGEST_NAMES], f"and_{len(names) - 1}_more"]
    name = "_".join(re.sub(r"[^\w.=+-]+", "_", word) for word in (*names, *words))
    return folder_of(path) / f"{name[:LONGEST_NAME]}.png"


def check_output(path: Path | None, suffixes: tuple[str, ...]) -> None:
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


def complain(*lines: str) -> None:
    """Print lines on stderr, on the rank that talks to the user."""
    if speaks():
        for line in lines:
            print(f"cvt-hpc: {one_line(line)}", file=sys.stderr)


def say(*lines: str) -> None:
    """Print lines on stdout."""
    for line in lines:
        print(one_line(line))


def speaks() -> bool:
    """Return whether this process is the one of those started together that talks to the user."""
    from cvt_hpc.study import process_rank

    return process_rank() == 0
