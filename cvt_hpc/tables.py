"""Tables for people, as aligned lines of text, and the lines of stored tables."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import dropwhile


def below_origin(lines: Iterable[str]) -> Iterator[str]:
    """Return head and rows of a stored table, which stand below the lines of `provenance.origin_lines`."""
    return dropwhile(lambda line: line.startswith("#"), lines)


def columns(rows: Sequence[Sequence[str]], indent: str = "  ") -> Iterator[str]:
    """Yield rows as lines, their cells below each other; the last one is not padded."""
    widths = [max(map(len, column)) for column in zip(*(row[:-1] for row in rows), strict=True)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row[:-1], widths, strict=True)]
        yield f"{indent}{'  '.join([*cells, row[-1]])}".rstrip()


def short(value: float) -> str:
    """Return a number to two digits, "" where it is none."""
    return "" if math.isnan(value) else f"{value:.2g}"


def number(value: float, digits: int = 10) -> str:
    """Return a number to so many digits, "" where it is none."""
    return "" if math.isnan(value) else f"{value:.{digits}g}"
