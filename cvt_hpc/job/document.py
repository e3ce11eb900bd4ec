"""The job file as it stands on the disk: one clear error for whatever is not readable TOML.

Tables of a command beside the job's own, such as [chart], are checked key by key against their declaration.
"""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from cvt_hpc.errors import InputError, check_keys, did_you_mean, mismatch, show
from cvt_hpc.job.definition import HEADER
from cvt_hpc.job.values import (
    SEPARATE,
    Document,
    Point,
    Table,
    expectation,
    read_value,
    refuse_unknown,
    warn_of_bare_numbers,
)
from cvt_hpc.parameters import Parameter
from cvt_hpc.storage.files import read_regular

MOST_BYTES = 2**26
_POSITION = re.compile(r"(?P<what>.*?) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)")

# By what a line has up to the place from which on it is no TOML
_ADVICE = (
    (re.compile(r"\d\s*;$|=\s*[-+]?\d+,\s*\d*[,} ]*$"), SEPARATE),
    (re.compile(r"=\s*[-+]?[\d.]+\s*[^\W\d_]$"), '; a value with its unit is a text, as "10 mm/s"'),
)


def read_document(path: Path) -> Document:
    """Return the contents of a TOML file.

    Raises
    ------
    InputError
        If the file is missing, not regular, too large, not a text, or not TOML (then with line and column).
    """
    try:
        text = read_regular(path, MOST_BYTES, follow=True).decode("utf-8-sig")
    except FileNotFoundError:
        beside = sorted(str(file) for file in path.parent.glob("*.toml"))
        hint = did_you_mean(str(path), beside) or "; `cvt-hpc init NAME` writes one to begin with"
        raise InputError(f"{path}: expected a job file, found nothing{hint}") from None
    except IsADirectoryError:
        raise mismatch(str(path), "a job file", "a folder") from None
    except OSError as error:
        raise mismatch(str(path), "a job file", str(error.strerror)) from None
    except ValueError:  # bytes that are no UTF-8, or a NUL in the path
        found = "another encoding or binary data"
        raise mismatch(str(path), "a text in UTF-8", found, "save it in UTF-8") from None
    document = _parse(text, str(path))
    check_keys(document, str(path))
    return document


def _parse(text: str, source: str) -> Document:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise mismatch(source, "TOML", "lists or tables nested too deep") from None
    except ValueError as error:  # TOMLDecodeError, and the plain ValueError of a number with too many digits
        match = _POSITION.fullmatch(str(error))
        if match is None:
            raise InputError(f"{source}: expected TOML, found: {error}") from None
        lines = text.split("\n")
        line, column = match["line"] or len(lines), match["column"] or len(lines[-1]) + 1
        what = match["what"][:1].lower() + match["what"][1:]
        start = lines[int(line) - 1][: int(column)]
        what += next((advice for end, advice in _ADVICE if end.search(start)), "")
        raise InputError(f"{source}: line {line}, column {column}: expected TOML, found: {what}") from None


def read_table(
    declared: Mapping[str, Parameter], raw: object, where: str, tables: tuple[str, ...] = ()
) -> Point:
    """Return the values of a table by key, defaults included.

    Parameters
    ----------
    declared : mapping
        Declared keys of the table.
    raw : object
        Content of the file.
    where : str
        File and table, for the errors.
    tables : tuple of str
        Further keys that are legal and read elsewhere.

    Raises
    ------
    InputError
        If it is no table, or a key is unknown, missing or not legal.
    """
    if not isinstance(raw, Mapping):
        raise mismatch(where, "a table", show(raw))
    refuse_unknown(raw, (*declared, *tables), f"{where} ")
    values = {}
    for key, parameter in declared.items():
        if key in raw:
            values[key] = read_value(_typed(parameter), raw[key], f"{where} {key}")
            warn_of_bare_numbers(parameter, raw[key], f"{where} {key}")
        elif parameter.default is None:
            raise mismatch(f"{where} {key}", expectation(_typed(parameter)), "nothing")
        else:
            values[key] = parameter.default
    return values


def read_tables(raw: object, where: str, what: str) -> Table:
    """Return a table of tables.

    Raises
    ------
    InputError
        If it is none, or empty.
    """
    if not isinstance(raw, Mapping) or not raw:
        found = "an empty one" if isinstance(raw, Mapping) else show(raw)
        raise mismatch(where, f"a table of {what}", found)
    return raw


def read_set(raw: Table, where: str) -> Point:
    """Return the values that the table `set` of a table gives to parameters.

    Raises
    ------
    InputError
        If it is no table, or names something of the job's head.
    """
    values = raw.get("set", {})
    if not isinstance(values, Mapping):
        raise mismatch(f"{where} set", "a table", show(values))
    for key in values:
        if key in HEADER:
            raise mismatch(f"{where} set {key}", "a parameter", f"the job's {key}")
    return dict(values)


def _typed(parameter: Parameter) -> Parameter:
    """Return a declaration without a default as that of a text, where it has no unit."""
    if parameter.default is None and not parameter.unit:
        return Parameter("", "", parameter.description)
    return parameter
