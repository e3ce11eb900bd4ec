"""Result of an experiment, for the command that prints it."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

Tell = Callable[..., None]  # takes lines that are to be printed meanwhile


class Outcome(NamedTuple):
    """Result of an experiment.

    Attributes
    ----------
    lines : sequence of str
        The results in words.
    files : sequence of (str, Path)
        What a file is, such as "table", and where; in the order in which the command names them.
    status : int
        Exit status of the command.
    """

    lines: Sequence[str] = ()
    files: Sequence[tuple[str, Path]] = ()
    status: int = 0
