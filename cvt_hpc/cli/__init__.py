"""The command line: parse, call, print. Whatever a command needs is imported when it runs.

A module for each group of commands: `add` declares them and their options, and a function does each.
"""

import argparse
import errno
import logging
import os
import re
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from cvt_hpc import __version__
from cvt_hpc.cli import checking, experiments, plots, results, single_run, starting, sweep
from cvt_hpc.cli.parts import DONE, complain, end_all, speaks
from cvt_hpc.errors import (
    BAD_INPUT,
    CRASHED,
    INTERRUPTED,
    InputError,
    JobWarning,
    did_you_mean,
    mismatch,
    one_line,
    show,
)
from cvt_hpc.experiment_kinds import EXPERIMENTS
from cvt_hpc.storage.files import open_missing_streams

__all__ = ["main"]

# Commands whose ranks work together
_JOINT = ("run", *(name for name, experiment in EXPERIMENTS.items() if not experiment.alone))

# How argparse tells of a word that is none of its choices
_UNKNOWN_WORD = re.compile(
    r"(?P<place>.*invalid choice: '(?P<word>[^']*)')(?P<rest> \(choose from (?P<known>.*)\))$"
)

_UNKNOWN_OPTION = re.compile(r"unrecognized arguments: --(?P<option>[\w-]+)")


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
    open_missing_streams()
    told = logging.StreamHandler()
    told.setFormatter(_OneLine("cvt-hpc: %(message)s"))
    logging.basicConfig(handlers=[told])
    words = sys.argv[1:] if arguments is None else arguments
    try:
        _check_readable(words)
        parsed = _parser().parse_args(words)
        with _compiling_told(), _job_warnings_told():
            status = parsed.command(parsed) or DONE
        sys.stdout.flush()
        return status
    except InputError as error:
        if words and words[0] in _JOINT and "--dry-run" not in words:
            from cvt_hpc.study.ranks.launch import agree_on

            error = agree_on(error)
        if not error.everywhere:
            end_all(BAD_INPUT, str(error))
        complain(str(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        end_all(INTERRUPTED, "interrupted")
        complain("interrupted")
        return INTERRUPTED
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        _leave_stdout()
        return DONE
    except Exception as error:
        line = ""
        if isinstance(error, OSError) and error.errno == errno.ENOSPC and error.filename is None:
            _leave_stdout()
            line = "what is printed: expected room for it, found a full disk"
        if isinstance(error, MemoryError) or str(error).startswith("NetCDF: "):
            line = f"a dataset: expected values that can be read, found damaged or too many ones: {error}"
        if line:
            end_all(BAD_INPUT, line)
            complain(line)
            return BAD_INPUT
        traceback.print_exc()
        end_all(CRASHED)
        return CRASHED  # Python's own status for a defect, 1, means here that some runs failed


def _leave_stdout() -> None:
    """Let nothing more be written where nobody reads it, or no room is left."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _compiling_told() -> Iterator[None]:
    """Tell on stderr, by one rank for all, what is being compiled."""
    logger = logging.getLogger("cvt_hpc.kernels")  # by its name: to import it takes long
    before = logger.level
    logger.setLevel(logging.INFO)
    logger.addFilter(_by_one_rank)
    try:
        yield
    finally:
        logger.setLevel(before)
        logger.removeFilter(_by_one_rank)


@contextmanager
def _job_warnings_told() -> Iterator[None]:
    """Print warnings about jobs on stderr, each once."""
    told: set[str] = set()
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
        if not issubclass(category, JobWarning):
            shown(message, category, *rest, **more)
            return
        _, _, text = str(message).rpartition("] ")  # many points of a chart have one value of its job
        if text not in told:
            told.add(text)
            complain(f"warning: {message}")

    with warnings.catch_warnings():
        warnings.simplefilter("always", JobWarning)
        warnings.showwarning = show
        yield


def _by_one_rank(record: logging.LogRecord) -> bool:
    return speaks()


class _OneLine(logging.Formatter):
    """Log lines escaped to one line each, since file names may hold anything."""

    def format(self, record: logging.LogRecord) -> str:
        return one_line(super().format(record))


def _check_readable(arguments: Sequence[str]) -> None:
    """Refuse bytes that are no text: a dataset cannot be written to a file of such a name."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise mismatch("command line", "names and values in UTF-8", show(argument)) from None


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are ours: under MPI one rank prints them, not all."""

    def error(self, message: str) -> NoReturn:
        if match := _UNKNOWN_WORD.match(message):
            word, known = match["word"], re.findall(r"[\w-]+", match["known"])
            message = f"{match['place']}{did_you_mean(word, known) or match['rest']}"
        elif match := _UNKNOWN_OPTION.match(message):
            taking = [name for name, one in EXPERIMENTS.items() if match["option"] in one.options]
            message += "".join(f"; `cvt-hpc {name} JOB` takes --{match['option']}" for name in taking)
        raise InputError(f"{message}; see `{self.prog} --help`")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="cvt-hpc",
        description="Vibration-occurrence maps of metal pushbelt CVTs; speed loss and vibration of rubber "
        "belt drives.",
        epilog="Exit status: 0 done, 1 some runs failed, 2 bad input, 99 stopped early (run again to go on), "
        "98 stopped before any run had ended.",
    )
    parser.add_argument("--version", action="version", version=f"cvt_hpc {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for group in (sweep, results, plots, single_run, experiments, checking, starting):
        group.add(commands)
    parser.set_defaults(parser=parser)
    return parser
