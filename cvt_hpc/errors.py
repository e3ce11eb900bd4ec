"""The one error that bad input raises, and the wording that all of them share."""

import difflib
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

BAD_INPUT = 2  # exit status
INTERRUPTED = 130  # exit status after Ctrl-C, as of shells
CRASHED = 70  # exit status after a defect of this program; EX_SOFTWARE of sysexits.h
LONGEST_KEY = 100  # letters
DEEPEST = 20  # levels of tables and lists; a chart has some six
_LONGEST_QUOTE = 60
_LONGEST_LINE = 4000  # a list of all keys fits
_LINE_END = 500  # letters of a longer one that stay


class InputError(ValueError):
    """Bad input: the text names the place, what was expected, what was found, and the nearest known key.

    The command line prints it and ends with exit status 2. It is one line, whatever the names and texts in it
    hold.

    Attributes
    ----------
    everywhere : bool
        Whether all ranks that were started together raise it.
    """

    everywhere = False

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))


class HeldError(InputError):
    """A folder holds something else than what is to be made in it; `complaint` is the text without advice."""

    def __init__(self, complaint: str, then: str = "") -> None:
        super().__init__("; ".join(filter(None, (complaint, then))))
        self.complaint = complaint


class JobWarning(UserWarning):
    """A value of a job that may not be intended. The command line prints it on stderr."""


class UnitWarning(JobWarning):
    """A number without a unit that is far from usual: it may be meant in another unit."""


class NoEffectWarning(JobWarning):
    """A value of a job that changes none of its runs."""


def mismatch(where: str, expected: str, found: str, then: str = "") -> InputError:
    """Return the error for a value that differs from the expected one.

    Parameters
    ----------
    where : str
        File and key, e.g. "jobs/x.toml: [scene] thrust".
    expected, found : str
        The expected content, and the content that was found.
    then : str
        The next action, such as a command, where the place does not state it.

    Returns
    -------
    InputError
        To be raised by the caller.
    """
    return InputError("; ".join(filter(None, (f"{where}: expected {expected}, found {found}", then))))


def unknown(where: str, what: str, word: str, known: Iterable[str], then: str = "") -> InputError:
    """Return the error for a name that is not known: with the nearest known one, else with all of them.

    Parameters
    ----------
    where : str
        File and key.
    what : str
        The kind of name that was expected, e.g. "key" or "model".
    word : str
        The name that was found.
    known : iterable of str
        The names that exist.
    then : str
        The next action, such as a command, where no known name is near.

    Returns
    -------
    InputError
        To be raised by the caller.
    """
    names = list(known)
    hint = did_you_mean(word, names) or "; ".join(filter(None, (f"; known: {', '.join(names)}", then)))
    return InputError(f"{where}: unknown {what}{hint}")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean X?" for the known name nearest to `word`, or "" if none is near."""
    near = nearest(word, known)
    return f"; did you mean {near}?" if near else ""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known name nearest to `word`, whatever its case; None if none is near."""
    if len(word) > LONGEST_KEY:  # it would be compared letter by letter
        return None
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
        return one_line(json.dumps(text, ensure_ascii=False))
    return str(value)


def one_line(text: str) -> str:
    """Return a text as a line for a terminal: characters that do not print are escaped, a long line is cut.

    Names, keys and descriptions of files may hold anything: line ends, escape sequences, bytes that are no
    text.
    """
    if len(text) > _LONGEST_LINE:
        text = f"{text[: _LONGEST_LINE - _LINE_END]} ... {text[-_LINE_END:]}"
    return escaped(text)


def escaped(text: str, kept: str = "") -> str:
    """Return a text with escapes for characters that do not print, other than those `kept`.

    Among them are those that turn the direction of what follows, so that it reads as something else.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)


def check_keys(entry: Any, where: str, depth: int = DEEPEST) -> None:
    """Raise InputError if a key in nested tables is not a word of printable letters, or they nest too deep.

    Keys stand in errors, tables and pictures as they are.
    """
    if depth < 0:
        raise mismatch(where, f"lists and tables nested at most {DEEPEST} deep", "deeper ones")
    if isinstance(entry, (list, tuple)):
        for item in entry:
            check_keys(item, where, depth - 1)
    elif isinstance(entry, Mapping):
        for key, value in entry.items():
            if len(key) > LONGEST_KEY or not key.isprintable():
                raise mismatch(where, f"keys of at most {LONGEST_KEY} printable characters", show(key))
            check_keys(value, where, depth - 1)
