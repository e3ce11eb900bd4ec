"""The one error that bad input raises, and the wording that all of them share."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Sequence
from typing import Any

CRASHED = 70  # exit status after a defect of this program; EX_SOFTWARE of sysexits.h
_LONGEST_QUOTE = 60


class InputError(ValueError):
    """Bad input: the text names the place, what was expected, what was found, and the nearest known key.

    The command line prints it and ends with exit status 2.
    """


class UnitWarning(UserWarning):
    """A number without a unit that is far from usual: it may be meant in another unit.

    The command line prints it on stderr.
    """


def mismatch(where: str, expected: str, found: str) -> InputError:
    """Return the error for a value that is not what was expected.

    Parameters
    ----------
    where : str
        File and key, e.g. "jobs/x.toml: [scene] thrust".
    expected, found : str
        What should stand there, and what stands there.

    Returns
    -------
    InputError
        To be raised by the caller.
    """
    return InputError(f"{where}: expected {expected}, found {found}")


def unknown(where: str, what: str, word: str, known: Iterable[str]) -> InputError:
    """Return the error for a name that is not known: with the nearest known one, else with all of them.

    Parameters
    ----------
    where : str
        File and key.
    what : str
        What the name should have been, e.g. "key" or "model".
    word : str
        The name that was found.
    known : iterable of str
        The names that exist.

    Returns
    -------
    InputError
        To be raised by the caller.
    """
    names = list(known)
    hint = did_you_mean(word, names) or f"; known: {', '.join(names)}"
    return InputError(f"{where}: unknown {what}{hint}")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean X?" for the known name nearest to `word`, or "" if none is near."""
    near = nearest(word, known)
    return f"; did you mean {near}?" if near else ""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known name nearest to `word`, whatever its case; None if none is near."""
    lowered = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), lowered, n=1, cutoff=0.6)
    return lowered[near[0]] if near else None


def few_of(texts: Sequence[str], most: int) -> str:
    """Return texts in a row; of more than `most` the first ones and the last."""
    if len(texts) > most:
        texts = [*texts[: most - 1], "...", texts[-1]]
    return ", ".join(texts)


def show(value: Any) -> str:
    """Return a found value in the words of a job file: quoted texts, "a table", "a list", "nothing".

    An array is shown by its shape.
    """
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return "a list" if value else "an empty list"
    if shape := getattr(value, "shape", ()):  # of numpy, which this module need not import
        return f"an array of shape {shape}"
    if isinstance(value, int) and abs(value) >= 10**_LONGEST_QUOTE:
        return "a number of too many digits"
    if isinstance(value, str):
        text = value if len(value) <= _LONGEST_QUOTE else value[: _LONGEST_QUOTE - 3] + "..."
        return json.dumps(text, ensure_ascii=False)
    return str(value)
