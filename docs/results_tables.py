"""A hook of mkdocs: fills pages with tables of `jobs/results`, whose rows and columns markers choose.

A marker is TOML in a comment `<!-- table ... -->` with the arguments of `table`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cvt_hpc.tables import below_origin

RESULTS = Path(__file__).parents[1] / "jobs" / "results"
NOTHING = "-"
MARKER = re.compile(r"^<!-- table\n(.*?)^-->$", re.MULTILINE | re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return the text of a page with its tables."""
    return MARKER.sub(lambda marker: table(**tomllib.loads(marker[1])), markdown)


def table(
    of: str,
    caption: str,
    columns: Mapping[str, str | list[str]],
    rows: str = "",
    by: Mapping[str, str] | None = None,
    across: str = "",
) -> str:
    """Return a stored table as Markdown, with its caption, its origin, and why it is older than the code.

    Parameters
    ----------
    of : str
        Name of the table in `jobs/results`.
    columns : dict
        Heads and what stands below them: a Python expression of `window` and the stored columns without
        their units, or expressions and a format, in a list. Several values are told by their ends.
    rows : str
        Query for the rows that count, by default all.
    by : dict
        Heads and expressions: there is a line for each set of their values, by default for each row.
    across : str
        Stored column: `columns` are repeated for each of its values, which are filled into heads with braces.

    Raises
    ------
    ValueError
        If no row counts.
    """
    lines = (RESULTS / f"{of}.csv").read_text(encoding="utf-8").splitlines()
    stored = _read(lines)
    kept = stored.query(rows, engine="python") if rows else stored
    if kept.empty:
        raise ValueError(f"{of}: expected rows where {rows}, found none")
    keys = [kept.eval(expression, engine="python") for expression in (by or {}).values()]
    values = kept[across].unique() if across else [None]
    heads = [*(by or ()), *(head.format(_told(value)) for value in values for head in columns)]
    cells = [heads, ["---"] * len(heads)]
    for key, group in kept.groupby(keys or kept.index, sort=False, dropna=False):
        parts = [group[group[across] == value] if across else group for value in values]
        line = [_told(value) for value in key] if by else []
        cells.append([*line, *(_cell(part, content) for part in parts for content in columns.values())])
    body = "\n".join(f"| {' | '.join(line)} |" for line in cells)
    return f"**{caption}**\n\n{body}\n\n*{_origin(of, lines)}*"


def window(place: pd.Series, vibrates: pd.Series) -> str:
    """Return the ranges of a place, such as the load, where runs vibrate; "?" behind those left undecided.

    Runs that were left out are taken to be as their neighbours.
    """
    done = sorted((at, verdict) for at, verdict in zip(place, vibrates, strict=True) if not pd.isna(verdict))
    found = []
    for verdict, members in groupby(done, key=lambda run: run[1]):
        ends = [f"{at:g}" for at, _ in members]
        if verdict != "no":
            mark = {"yes": "", "undecided": "?"}.get(verdict, f" {verdict}")
            found.append(" to ".join(dict.fromkeys([ends[0], ends[-1]])) + mark)
    return ", ".join(found) or "none"


def _read(lines: list[str]) -> pd.DataFrame:
    """Return a stored table; of strands also amplitude and frequency of the one that moves more."""
    stored = pd.read_csv(
        StringIO("\n".join(below_origin(lines))), keep_default_na=False, na_values=["", "nan"]
    )
    stored.columns = [re.sub(r"\W", "_", name.partition(" [")[0]) for name in stored.columns]
    if {"amplitude_t1", "frequency_t1"} <= set(stored.columns):
        first = stored["amplitude_t1"] >= stored["amplitude_t2"]
        for name in ("amplitude", "frequency"):
            stored[name] = stored[f"{name}_t1"].where(first, stored[f"{name}_t2"])
    return stored


def _cell(part: pd.DataFrame, content: str | list[str]) -> str:
    if part.empty:
        return ""
    expression, form = (content, "{}") if isinstance(content, str) else content
    found = eval(expression, {"window": window}, part)  # its columns by their names
    texts = [_range(value) for value in (found if isinstance(found, tuple) else (found,))]
    return NOTHING if set(texts) == {NOTHING} else form.format(*texts)


def _range(found: Any) -> str:
    """Return a value, or the least and the largest of several."""
    known = sorted({value for value in np.atleast_1d(found) if not pd.isna(value)})
    return " to ".join(dict.fromkeys(map(_told, [*known[:1], *known[-1:]]))) or NOTHING


def _told(value: Any) -> str:
    """Return a text as it is, a number to three digits."""
    if isinstance(value, str):
        return value
    return NOTHING if pd.isna(value) else f"{value:.0f}" if 1000 <= abs(value) < np.inf else f"{value:.3g}"


def _origin(of: str, lines: list[str]) -> str:
    told = [line[2:].partition(": ")[::2] for line in lines if line.startswith("# ")]
    first = dict(reversed(told))
    revision = re.search("[0-9a-f]{9}", first["revision"])
    dirty = ", with changes" if "-dirty" in first["revision"] else ""
    older = "; ".join(why for name, why in told if name == "older than the code")
    made = (
        f"`jobs/results/{of}.csv`, revision {revision[0] if revision else 'unknown'}{dirty}, {first['date']}"
    )
    return f"{made}; **older than the code**: {older}" if older else made
