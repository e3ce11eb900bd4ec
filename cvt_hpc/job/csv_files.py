"""CSV files that give parameters of a job: columns with units in the header, one error for all faults."""

from __future__ import annotations

import math
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError, did_you_mean, mismatch, show
from cvt_hpc.job.units import UnitError, to_si
from cvt_hpc.parameters import Column, FromFile, RowError

MOST_BYTES = 2**20
_HEAD = re.compile(r"\s*(?P<name>\w+)\s*(?:\[\s*(?P<unit>[^\]]*?)\s*\]\s*)?")


def read_csv(file: FromFile, name: str, source: str, where: str) -> dict[str, Any]:
    """Return the raw values of the parameters that a file gives, by key.

    The first line has the names of the columns, each with its unit in brackets, such as "speed [mm/s]"; a
    column without a unit is dimensionless. Empty lines and lines that begin with # do not count.

    Parameters
    ----------
    file : FromFile
        Declaration of the key.
    name : str
        Path of the file; a relative one starts at the folder of the job file.
    source : str
        The job file.
    where : str
        Job file and key, for the error.

    Raises
    ------
    InputError
        If the file is missing, no regular file, too large or no text, or if a line, which is then named, is
        not legal.
    """
    path = Path(source).parent / name
    numbered = enumerate(_text(path, where).splitlines(), 1)
    told = ((number, line.split(",")) for number, line in numbered if not line.lstrip().startswith("#"))
    rows = [(number, row) for number, row in told if "".join(row).strip()]
    if len(rows) < 2:
        raise mismatch(f"{where}: {path}", "a line of column names and lines of numbers", "fewer lines")
    (first, names), *lines = rows
    head = _read_head(file, names, f"{where}: {path}: line {first}")
    columns: dict[str, list[float]] = {column: [] for column, _, _ in head}
    for number, cells in lines:
        place = f"{where}: {path}: line {number}"
        if len(cells) != len(head):
            raise mismatch(place, f"{len(head)} columns, as in line {first}", str(len(cells)))
        for (column, unit, si), cell in zip(head, cells, strict=True):
            columns[column].append(_number(cell, unit, si, f"{place}, {column}"))
    try:
        return file.arrange({column: Column(si, tuple(columns[column])) for column, _, si in head})
    except RowError as error:
        raise mismatch(f"{where}: {path}: line {lines[error.row][0]}", error.expected, error.found) from None
    except ValueError as error:
        raise InputError(f"{where}: {path}: {error}") from None


def _text(path: Path, where: str) -> str:
    place = f"{where}: {path}"
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # to open a pipe would wait for a writer
            raise mismatch(place, "a CSV file", "a folder" if path.is_dir() else "no regular file")
        if status.st_size > MOST_BYTES:
            raise mismatch(place, f"at most {MOST_BYTES} bytes", str(status.st_size))
        with path.open("rb") as opened:
            # the size that was told: a file of the kernel's, which has none, may never answer
            return opened.read(status.st_size).decode("utf-8-sig")
    except InputError:
        raise
    except FileNotFoundError:
        near = did_you_mean(str(path), sorted(map(str, path.parent.glob("*.csv"))))
        raise mismatch(place, "a CSV file", f"nothing{near}") from None
    except OSError as error:
        raise mismatch(place, "a CSV file", str(error.strerror)) from None
    except ValueError:  # bytes that are no UTF-8, or a NUL in the path
        raise mismatch(place, "a text file (CSV in UTF-8)", "binary data") from None


def _read_head(file: FromFile, cells: list[str], place: str) -> list[tuple[str, str, str]]:
    """Return name, unit and SI unit of each column."""
    head = [_column(file.columns, cell, place) for cell in cells]
    names = [name for name, _, _ in head]
    for name in names:
        if names.count(name) > 1:
            raise mismatch(place, "distinct columns", f"{name} twice")
    for name in file.required:
        if name not in names:
            raise mismatch(place, f"a column {_told(name, file.columns)}", f"none among {', '.join(names)}")
    return head


def _column(columns: Mapping[str, tuple[str, ...]], cell: str, place: str) -> tuple[str, str, str]:
    told = ", ".join(_told(name, columns) for name in columns)
    match = _HEAD.fullmatch(cell)
    if match is None or match["name"] not in columns:
        near = did_you_mean(match["name"], columns) if match else ""
        raise mismatch(place, f"columns among {told}", f"{show(cell)}{near}")
    name, unit = match["name"], (match["unit"] or "").removeprefix("-")
    for si in columns[name]:
        try:
            to_si(f"1 {unit}", si)
        except UnitError:
            continue
        if unit or not si:  # a bare number is legal to `to_si`, but a column states its unit
            return name, unit, si
    raise mismatch(place, _told(name, columns), show(cell))


def _told(name: str, columns: Mapping[str, tuple[str, ...]]) -> str:
    return " or ".join(f"{name} [{unit}]" if unit else name for unit in columns[name])


def _number(cell: str, unit: str, si: str, place: str) -> float:
    try:
        value = to_si(f"{float(cell)!r} {unit}", si)
    except (ValueError, UnitError):
        raise mismatch(place, "a number", show(cell.strip())) from None
    if not math.isfinite(value):
        raise mismatch(place, "a finite number", show(cell.strip()))
    return value
