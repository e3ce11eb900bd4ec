"""A statement of a paper about one of its figures, and what measuring it in a study gives."""

from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from typing import Any, NamedTuple

from cvt_hpc.analysis.statements.kept import Kept
from cvt_hpc.errors import InputError


class Verdict(Enum):
    """Whether what a paper states is found."""

    REPRODUCED = "reproduced"
    PARTLY = "partly"
    NOT = "not"
    UNKNOWN = "not measured"


class Measured(NamedTuple):
    """Whether each part of a statement holds, and the numbers by which that is told."""

    holds: Sequence[Any]
    numbers: str


class Statement(NamedTuple):
    """What a paper says of a figure.

    Attributes
    ----------
    text : str
        In the paper's words, shortened.
    measure : callable
        Of the study.
    why : str
        What is known of the reason where it does not hold.
    """

    text: str
    measure: Callable[[Kept], Measured]
    why: str = ""


class Finding(NamedTuple):
    """What became of a statement."""

    text: str
    verdict: Verdict
    numbers: str
    why: str


def judged(statement: Statement, kept: Kept) -> Finding:
    """Measure a statement: reproduced where all of its parts hold, partly where some do."""
    try:
        measured = statement.measure(kept)
    except InputError as error:  # a run has failed
        return Finding(statement.text, Verdict.UNKNOWN, str(error), statement.why)
    holds = [bool(part) for part in measured.holds]
    verdict = Verdict.REPRODUCED if holds and all(holds) else Verdict.PARTLY if any(holds) else Verdict.NOT
    why = "" if verdict is Verdict.REPRODUCED else statement.why
    return Finding(statement.text, verdict, measured.numbers, why)


def listed(values: Iterable[float], digits: str = ".3g") -> str:
    """Numbers in a row."""
    return ", ".join(format(float(value), digits) for value in values)
