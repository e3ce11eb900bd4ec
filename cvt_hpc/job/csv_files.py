"""CSV files that give parameters of a job, as spreadsheets, programs and measuring machines write them.

A file is read where its meaning is certain; where it is no plain CSV file, a warning states how. All else is
one error, which names the line and states what to write: `1,234` is never guessed to be 1234 or 1.234.
"""

import codecs
import csv
import math
import re
import warnings
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, count, islice, repeat
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.errors import InputError, JobWarning, did_you_mean, few_of, mismatch, show
from cvt_hpc.job.units import factor_to, from_si
from cvt_hpc.job.values import Point
from cvt_hpc.parameters import Column, FromFile, RowError
from cvt_hpc.storage.files import read_regular
from cvt_hpc.variator.profiles import MOST_TIMES, TIME

MOST_BYTES = 2**26  # of a file of any kind
_BLOCK = 2**18  # rows that are taken apart at a time: cells take ten times the memory of their text
_MOST_ABOVE = 10_000  # lines among which that of the names is looked for
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
_ANY_SEPARATOR = "commas, semicolons or tabs"
_BINARY = re.compile(r"[\x00-\x08\x0b\x0e-\x1f\x7f]")
_HEAD = re.compile(r"(?P<name>[^[(]*)(?:\[(?P<square>[^]]*)\]|\((?P<round>.*)\))?")
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_AMBIGUOUS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)  # a fraction, or a thousand and more
_GROUPED = re.compile(r"[+-]?[0-9][0-9.,'\u2019 \u00a0\u202f]*")
_PLAINLY = "write numbers with decimal points, without separators of thousands"
_NUMBERED = "no column for the numbers of the rows"
BARE = ("", "1", "-")  # units of dimensionless numbers
_LINES = "a line of column names and lines of numbers"
_MOST_NAMED = 8
_PER_MINUTE = ("1/min", "u/min", "min-1", "rev/min", "r/min", "rpm", "tr/min")

Row = tuple[int, list[str]]  # number of the line, and its cells up to the last one that is not empty


class _Column(NamedTuple):
    """Place of a column in its rows, its name, its unit, and the SI unit of this one."""

    place: int
    name: str
    unit: str
    si: str


class FileValues(NamedTuple):
    """Values that a file gives."""

    values: Point  # raw values by key
    units: Mapping[str, str]  # in which it has them, by column
    told: Mapping[str, str]  # by key in words what it has, where `values` have averages of that
    columns: Mapping[str, Column]  # of a course, whose rows are to be checked
    named: Callable[[int], str]  # file and row, for the error


def read_csv(file: FromFile, name: str, source: str, where: str) -> FileValues:
    """Return the raw values of the parameters that a file gives.

    One line has the names of the columns, each with its unit in brackets, such as "speed [mm/s]", or with the
    units in the line below; a column without a unit is dimensionless. Empty lines, lines that begin with #,
    and lines above the names do not count. What else a rig measured over time beside a course is not read, as
    a warning states; other files have columns that are known alone.

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
        If the file is missing, a link, no regular file, too large or no text, or if a line, which is then
        named, is not legal or may mean two things.
    """
    path = Path(source).parent / name
    place = f"{where}: {path}"
    text, encoding = _text(path, place)
    split = re.split(r"\r\n|\r|\n", text)
    numbers = array("q", (n for n, line in enumerate(split, 1) if line.strip()[:1] not in ("", "#")))
    lines = [split[n - 1] for n in numbers]
    if len(lines) < 2:
        raise mismatch(place, _LINES, "fewer lines")
    above, separator = _find_names(file, lines, place)
    below = zip(numbers[above:], lines[above:], strict=True)
    cells_of = ((n, _cells(line, separator, f"{place}: line {n}")) for n, line in below)
    of_names, rows = next(cells_of), (row for row in cells_of if row[1])
    first = list(islice(rows, 1))
    of_units = first.pop() if first and _are_units(first[0][1]) else (of_names[0], [])
    columns, others = _columns(file, of_names, of_units, place)
    read = _read_rows(of_names, chain(first, rows), columns, separator, place)
    how = [
        encoding,
        f"names in line {of_names[0]}" if above else "",
        f"units in line {of_units[0]}" if of_units[1] else "",
        "" if separator == "," else f"{_SEPARATORS[separator]} between columns",
        "empty columns" if any(line.rstrip(" ").endswith(separator) for line in lines) else "",
        read.left_out,
        "decimal commas" if read.mark == "," else "",
        *(f"{show(told)} as {c.name}" for c in columns if _plain(told := of_names[1][c.place]) != c.name),
    ]
    found = {c.name: Column(c.si, tuple(read.values[c.name])) for c in columns}
    units = {c.name: c.unit for c in columns}
    given = arranged(file, found, place, lambda row: f"line {read.lines[row]}", units)
    if any(how) or others:
        begun = (f"{key} {_as_written(column, 0, units[key])}" for key, column in found.items())
        start = f"line {read.lines[0]} is {', '.join(begun)}"
        told = f"{place}: read with {', '.join(filter(None, how))}; {start}{not_read(others)}"
        warnings.warn(told, JobWarning, stacklevel=2)
    return given


class _Read(NamedTuple):
    """Numbers of the lines that hold rows, values [SI] by column, and how the rows were read."""

    lines: Sequence[int]
    values: Mapping[str, Sequence[float]]
    left_out: str
    mark: str


def _read_rows(
    of_names: Row, rows: Iterator[Row], columns: Sequence[_Column], separator: str, place: str
) -> _Read:
    lines, values = array("q"), {column.name: array("d") for column in columns}
    marks: dict[str, _Mark] = {}
    left_out = first = ""
    while block := list(islice(rows, _BLOCK)):
        first = first or block[0][1][0]
        left_out = _left_out(of_names, block, columns, separator, place, len(lines), first)
        _note_marks(block, columns, marks)
        if len(marks) > 1:
            _decimal_mark(marks, separator, place)
        for column in columns:
            values[column.name].extend(_numbers(block, column, place))
        lines.extend(n for n, _ in block)
    if not lines:
        raise mismatch(place, _LINES, "fewer lines")
    return _Read(lines, values, left_out, _decimal_mark(marks, separator, place))


def _as_written(column: Column, row: int, unit: str) -> str:
    """Return a value of a column in the unit that the file has for it, if any."""
    unit = column.unit if unit in BARE else unit
    return f"{from_si(column.values[row], column.unit, unit):g} {unit}".rstrip()


def arranged(
    file: FromFile,
    columns: dict[str, Column],
    place: str,
    named: Callable[[int], str],
    units: Mapping[str, str],
) -> FileValues:
    """Return the raw values that columns of a file give; an error names one of its rows, or all of it.

    What it has found there, and in the row before, is told in the file's `units` by column.

    Multiples of a quantity over time are those of its greatest one, also where a long file is averaged: an
    axis over the quantity gives the greatest value with which a run is driven.
    """
    try:
        raw = file.arrange(columns)
    except RowError as error:
        found = _found_in(error, columns, units)
        raise mismatch(f"{place}: {named(error.row)}", _expected_in(error, columns, units), found) from None
    except ValueError as error:
        raise InputError(f"{place}: {error}") from None
    averaged = {}
    if len(raw.get(TIME, ())) < len(times := columns["time"].values if TIME in raw else ()):
        first, last = (_as_written(columns["time"], row, units.get("time", "")) for row in (0, -1))
        averaged[TIME] = f"{len(times)} times from {first} to {last}, averaged over {MOST_TIMES} parts"
        warnings.warn(f"{place}: {averaged[TIME]}", JobWarning, stacklevel=3)
    for key in [key for key in raw if f"{key}_profile" in raw]:
        multiples = raw[f"{key}_profile"]
        if (most := max(multiples, key=abs)) not in (0.0, 1.0):
            raw |= {key: raw[key] * most, f"{key}_profile": [value / most for value in multiples]}
    rows = columns if TIME in raw else {}
    return FileValues(raw, units, averaged, rows, lambda row: f"{place}: {named(row)}")


def _expected_in(error: RowError, columns: Mapping[str, Column], units: Mapping[str, str]) -> str:
    """Return what an error has expected, with numbers of the row before in the units of the file."""
    text = error.expected
    for key, column in columns.items() if error.row else ():
        before = f"{column.values[error.row - 1]:g} {column.unit}"
        written = _as_written(column, error.row - 1, units.get(key, ""))
        text = re.sub(rf"(?<![\w.-]){re.escape(before)}(?!\w)", written, text) if column.unit else text
    return text


def _found_in(error: RowError, columns: Mapping[str, Column], units: Mapping[str, str]) -> str:
    """Return what an error has found in a row, with numbers of the row in the units of the file."""
    meant: dict[str, set[str]] = {}
    for key, column in columns.items():
        number = f"{column.values[error.row]:g}"
        for text in (number, f"{number} {column.unit}"):
            meant.setdefault(text, set()).add(_as_written(column, error.row, units.get(key, "")))
    # a number that several columns have stays as it is, if they have other units
    parts = ((text, meant.get(text, ())) for text in error.found.split(" and "))
    return " and ".join(min(written) if len(written) == 1 else text for text, written in parts)


def content_of(path: Path, limit: int, place: str, what: str, suffix: str) -> bytes:
    """Return the content of a file beside a job, or raise InputError, which says `what` was expected."""
    try:
        return read_regular(path, limit)
    except FileNotFoundError:
        near = did_you_mean(str(path), sorted(map(str, path.parent.glob(f"*{suffix}"))))
        raise mismatch(place, what, f"nothing{near}") from None
    except (OSError, ValueError) as error:  # a NUL in the path
        raise mismatch(place, what, getattr(error, "strerror", None) or str(error)) from None


def _text(path: Path, place: str) -> tuple[str, str]:
    """Return the content of a file, and its encoding where that is not UTF-8."""
    content = content_of(path, MOST_BYTES, place, "a CSV file", ".csv")
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    # the letters of units that are not ASCII stand in Latin-1 where Windows has them
    encodings = {"utf-16": "UTF-16 letters"} if wide else {"utf-8-sig": "", "cp1252": "Latin-1 letters"}
    for encoding, told in encodings.items():
        try:
            text = content.decode(encoding)
        except ValueError:
            continue
        if not _BINARY.search(text):
            return text, told
    raise mismatch(place, "a text file (CSV in UTF-8)", "binary data")


def _cells(line: str, separator: str, place: str) -> list[str]:
    try:
        (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
    except csv.Error as error:
        raise mismatch(place, "each quoted text closed in its line", f"{show(line)} ({error})") from None
    while cells and not cells[-1].strip():
        cells.pop()
    return [cell.strip() for cell in cells]


def _find_names(file: FromFile, lines: Sequence[str], place: str) -> tuple[int, str]:
    """Return the place of the line that names all columns that have to be there, and its separator.

    Where there is none, those of the line that names most of them, or of the first one.
    """
    most, best = (-1, 0), (0, ",")
    for above, line in enumerate(lines[:_MOST_ABOVE]):
        for separator in _SEPARATORS:
            try:
                cells = _cells(line, separator, "")
            except InputError:
                continue
            known = {named_column(file, cell) for cell in cells} - {None}
            if known >= set(file.required):
                return above, separator
            if (count := (len(known), len(cells))) > most and (known or not above):
                most, best = count, (above, separator)
    if not most[0] and len(lines) > _MOST_ABOVE:
        found = f"none among the first {_MOST_ABOVE}"
        raise mismatch(place, f"a line that names columns, such as {told(file.required[0], file)}", found)
    return best


def _split(cell: str) -> tuple[str, str]:
    """Return name and unit in a cell such as "speed [mm/s]" or "speed (mm/s)"."""
    match = _HEAD.fullmatch(cell)
    if match is None:
        return cell, ""
    return match["name"].strip(), (match["square"] or match["round"] or "").strip()


def _plain(cell: str) -> str:
    return re.sub(r"[\s_]+", "_", _split(cell)[0].casefold())


def named_column(file: FromFile, cell: str) -> str | None:
    """Return the column that a cell, or the name of a signal, names, whatever its case."""
    name = _plain(cell)
    return name if name in file.columns else file.other_names.get(name)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether no cell but "1" is a number, be it with separators of thousands."""
    others = [cell for cell in cells if cell != "1"]
    return bool(others) and not any(_NUMBER.fullmatch(cell) or _GROUPED.fullmatch(cell) for cell in others)


def _columns(file: FromFile, of_names: Row, of_units: Row, place: str) -> tuple[list[_Column], list[str]]:
    """Return the columns that have a known name, and the other names."""
    line, names = of_names
    where, legal = f"{place}: line {line}", ", ".join(told(name, file) for name in file.columns)
    unknown = [cell for cell in names if cell and named_column(file, cell) is None]
    is_log = "time" in file.required and {named_column(file, cell) for cell in names} > {None, "time"}
    if unknown and not is_log:
        near = did_you_mean(_split(unknown[0])[0], file.columns)
        found = few_of([show(cell) for cell in unknown], _MOST_NAMED) + near
        then = (
            "name them so, or delete them"
            if len(names) > 1
            else f"name them so, separated by {_ANY_SEPARATOR}"
        )
        raise mismatch(where, f"columns among {legal}", found, then)
    columns: list[_Column] = []
    for i, cell in enumerate(names):
        unit, key = _split(cell)[1], named_column(file, cell)
        if key is None:
            continue
        if key in [column.name for column in columns]:
            raise mismatch(where, "distinct columns", f"{key} twice")
        below = (of_units[1][i : i + 1] or [""])[0].strip("[]()").strip()
        if unit and below and unit != below:
            raise mismatch(f"{place}: line {of_units[0]}, {key}", f"no other unit than {unit}", show(below))
        unit = unit_of(file, key, (unit or below).removeprefix("-"))
        columns.append(_Column(i, key, unit, _si_unit(file, key, unit, f"{place}: line {of_units[0]}")))
    for name in file.required:
        if name not in [column.name for column in columns]:
            found = ", ".join(column.name for column in columns)
            raise mismatch(where, f"a column {told(name, file)}", f"none among {found}")
    return columns, unknown


def not_read(others: Sequence[str]) -> str:
    """Return the end of a warning that names columns or signals which do not count."""
    return f"; not read: {few_of([show(name) for name in others], _MOST_NAMED)}" if others else ""


def unit_of(file: FromFile, key: str, unit: str) -> str:
    """Return the unit of a column as it is written here: turns a minute are rpm where a speed is meant.

    Levels are dB, whatever their reference and weighting are.
    """
    if "dB" in file.columns[key] and re.match(r"dB\b", unit):
        return "dB"
    is_rotation = "rad/s" in file.columns[key] and re.sub(r"[\s^{}]", "", unit).casefold() in _PER_MINUTE
    return "rpm" if is_rotation else unit


def _si_unit(file: FromFile, name: str, unit: str, place: str) -> str:
    for si in file.columns[name]:
        # a bare number is legal to `to_si`, but a column states its unit
        if (unit or not si) and factor_to(unit, si):
            return si
    weighs = any(factor_to(f"{unit}f", si) for si in file.columns[name])
    then = f'write "{unit}f" for the weight of this mass' if unit and weighs else ""
    raise mismatch(place, told(name, file), show(f"{name} [{unit}]" if unit else name), then)


def told(name: str, file: FromFile) -> str:
    """Return a column with the units that it may have, for an error."""
    return " or ".join(f"{name} [{unit}]" if unit else name for unit in file.columns[name])


def _left_out(
    of_names: Row,
    rows: Sequence[Row],
    columns: Sequence[_Column],
    separator: str,
    place: str,
    before: int,
    first: str,
) -> str:
    """Return what is not read beside the columns; InputError if it may be anything of meaning.

    There are so many rows before these; `first` is the first cell of all, where a column may number the rows.
    """
    line, names = of_names
    for n, cells in rows:
        cells += [""] * (len(names) - len(cells))  # empty: what is read is missed where it is
        if len(cells) != len(names):
            where, expected = f"{place}: line {n}", f"{len(names)} columns, as in line {line}"
            may_be_decimal = separator == "," and len(cells) > len(names)
            then = "separate columns by semicolons where commas are decimal" if may_be_decimal else ""
            raise mismatch(where, expected, str(len(cells)), then)
    found = ""
    for i in (i for i, name in enumerate(names) if not name):
        wanted: Iterator[str] = repeat("")
        if i == 0 and first in ("0", "1"):
            wanted, found = map(str, count(int(first) + before)), _NUMBERED
        for (n, cells), number in zip(rows, wanted, strict=False):
            if cells[i] != number:
                where = f"{place}: line {n}, column {i + 1}"
                expected = "the number of the row" if number else "nothing"
                raise mismatch(where, f"{expected}, as it has no name in line {line}", show(cells[i]))
    return found


class _Mark(NamedTuple):
    """The first number with a decimal mark, and whether a number shows that it is no separator."""

    line: int  # of the first
    cell: str
    is_certain: bool

    def __str__(self) -> str:
        return f"{show(self.cell)} in line {self.line}"


def _note_marks(rows: Sequence[Row], columns: Sequence[_Column], marks: dict[str, _Mark]) -> None:
    """Note the marks within numbers, "." and ",", of which a number has one."""
    for mark in ".,":
        read = ((n, cells[column.place]) for n, cells in rows for column in columns)
        having = ((n, cell) for n, cell in read if mark in cell)
        for n, cell in having:
            known = marks.get(mark)
            if known and known.is_certain:
                break
            if _NUMBER.fullmatch(cell):
                first = known or _Mark(n, cell, False)
                marks[mark] = first._replace(is_certain=not _AMBIGUOUS.fullmatch(cell))


def _decimal_mark(marks: Mapping[str, _Mark], separator: str, place: str) -> str:
    """Return the decimal mark of all numbers; InputError if it is not certain."""
    if len(marks) > 1:
        raise mismatch(place, "one decimal mark", " and ".join(map(str, sorted(marks.values()))), _PLAINLY)
    mark, told = next(iter(marks.items()), (".", _Mark(0, "", True)))
    # a program that writes decimal commas separates by others
    if not told.is_certain and (mark, separator) != (".", ","):
        expected = "a number that shows whether the mark is decimal or separates thousands"
        raise mismatch(place, expected, f"only such as {told}", _PLAINLY)
    return mark


def _numbers(rows: Sequence[Row], column: _Column, place: str) -> list[float]:
    """Return the values [SI] of a column; each cell that occurs is read once."""
    cells = [cells[column.place] for _, cells in rows]
    known = {}
    for cell in dict.fromkeys(cells):
        expected, then = "a number such as 1500 or 0.13", _PLAINLY if _GROUPED.fullmatch(cell) else ""
        if _NUMBER.fullmatch(cell):
            known[cell] = from_si(float(cell.replace(",", ".")), column.unit or column.si, column.si)
            if math.isfinite(known[cell]):
                continue
            expected, then = "a finite number", ""
        line = rows[cells.index(cell)][0]
        found = show(cell) if cell else "nothing"
        raise mismatch(f"{place}: line {line}, {column.name}", expected, found, then)
    return [known[cell] for cell in cells]
