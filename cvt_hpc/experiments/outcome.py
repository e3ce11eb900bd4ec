"""Result of an experiment, for the command that prints it."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

Tell = Callable[..., None]  # takes lines that are to be printed meanwhile


class Outcome(NamedTuple):
    """Result of an experiment."""

    lines: Sequence[str] = ()  # the results in words
    # what a file is, such as "table", and where; in the order in which the command names them
    files: Sequence[tuple[str, Path]] = ()
    status: int = 0  # exit status of the command
