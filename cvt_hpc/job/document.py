"""The job file as it stands on the disk: one clear error for whatever is not readable TOML."""

import re
import tomllib
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError, check_keys, did_you_mean, mismatch
from cvt_hpc.files import read_regular

MOST_BYTES = 2**26
_POSITION = re.compile(r"(?P<what>.*?) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)")


def read_document(path: Path) -> dict[str, Any]:
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


def _parse(text: str, source: str) -> dict[str, Any]:
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
        raise InputError(f"{source}: line {line}, column {column}: expected TOML, found: {what}") from None
