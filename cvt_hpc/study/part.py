"""Parts of a study, for starts that work side by side in one folder, such as the tasks of a job array."""

import re
from typing import NamedTuple

import numpy as np

from cvt_hpc.errors import mismatch


class Part(NamedTuple):
    """One of several parts of a study; every run belongs to exactly one of them.

    Attributes
    ----------
    number : int
        Which one, from 1.
    parts : int
        How many there are.
    """

    number: int
    parts: int

    def __str__(self) -> str:
        return f"{self.number}/{self.parts}"

    def holds(self, index: np.ndarray) -> np.ndarray:
        """Return whether runs belong to this part, by their index alone, without communication.

        The runs are dealt out in turn, and each round begins one part further: otherwise an axis with as many
        values as there are parts would give all runs at its costliest value to one of them.
        """
        return (index + index // self.parts) % self.parts == self.number - 1


def read_part(text: str) -> Part:
    """Return the part that is written as "K/N".

    Parameters
    ----------
    text : str
        Such as "3/16".

    Raises
    ------
    InputError
        If it is none.
    """
    numbers = re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", text, re.ASCII)
    if numbers is None or int(numbers[1]) > int(numbers[2]):
        raise mismatch("part", "K/N with K from 1 to N, such as 3/16", f'"{text}"')
    return Part(int(numbers[1]), int(numbers[2]))
