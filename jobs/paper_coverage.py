"""Write what holds of five papers: paper_coverage.py PAGE.md, by docs/coverage.toml and stored tables."""

import csv
import sys
import tomllib
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd

from cvt_hpc.tables import below_origin

HERE = Path(__file__).parent
RESULTS = HERE / "results"
FIGURES = RESULTS / "figures"
PAPERS = {
    "L": "Lebrecht, Pfeiffer, Ulbrich 2004",
    "B": "Bullinger, Funk, Pfeiffer 2005",
    "G": "Geier, Schindler et al. 2007",
    "C": "Cepon, Boltezar 2011",
    "S": "Schindler et al. 2008",
}
HEAD = """# Five papers, statement by statement

What five papers state, the command, key or test that shows it here, what it gives, and whether that is what
they state: first all of each paper, then each figure whose statements are kept as a table.

- Lebrecht, Pfeiffer, Ulbrich 2004 (04CVT-32): vibration of the pushbelt
- Bullinger, Funk, Pfeiffer 2005: forces in the pushbelt as a continuum
- Geier, Schindler et al. 2007, "Dynamics of Pushbelt CVTs": the pushbelt of rigid elements in its plane
- Cepon, Boltezar 2011, "Validation of a flexible multibody belt-drive model": rubber belts
- Schindler et al. 2008, "Pushbelt CVTs - a non-smooth challenge": the pushbelt in space; it prints no result

Made by `python jobs/paper_coverage.py docs/coverage.md` from `docs/coverage.toml` and from the tables in
`jobs/results`. A row is measured where columns of these tables, or statements of a figure, decide at
least a part of it, and all are; `paper_tests` has what the tests that rows name measure, and an error
there is relative to the largest value of reference. A row is reproduced where all parts hold, partly
where some do, not where the model gives something else, and missing where it has no counterpart or the
text no number; where the statement itself is one of the latter three, numbers beside it do not change
that. Numbers are "older" where their table is older than the code,
by its first lines. "Figure `NAME`" is `cvt-hpc run JOB && cvt-hpc figure out/NAME`, where JOB is
`jobs/figures/NAME.toml` or `jobs/NAME.toml`; it leaves `figure.png` and `statements.csv`. The papers'
pictures have no data here: "reproduced" means every number and shape that the text states. What they do
not give is assumed, as each job says. All figures of Lebrecht et al. are of one set, that of
`jobs/lebrecht_2004.toml`, seven values of which were fitted to what they state.
"""
REPRODUCED, PARTLY, NOT, MISSING = WORSE = "reproduced", "partly", "not", "missing"
OLDER = " (older)"
MANY = 6  # numbers, of which the least and the largest are told


def age(path):
    """What is told of the numbers of a stored table: that they are older than the code, or nothing."""
    with path.open(encoding="utf-8") as source:
        return OLDER if any(line.startswith("# older than the code") for line in source) else ""


@cache
def statements(job):
    """Rows of the table of a figure, by its job."""
    with (FIGURES / f"{job}.csv").open(encoding="utf-8") as source:
        return list(csv.DictReader(below_origin(source)))


@cache
def stored(name):
    """A table of jobs/results, its columns without their units."""
    with (RESULTS / f"{name}.csv").open(encoding="utf-8") as source:
        table = pd.read_csv(StringIO("".join(below_origin(source))))
    return table.rename(columns=lambda column: column.partition(" [")[0])


def of_tests(part):
    """A part with a `quantity` of `paper_tests`, as `measured` takes it; its error is at most `error`."""
    quantity = part["quantity"]
    rows = {"table": "paper_tests", "rows": f"quantity == {quantity!r}", "value": "value", "tell": quantity}
    if "error" in part:
        tell = f"{quantity.partition(' [')[0]}, relative error"
        rows |= {"value": "error", "most": part["error"], "tell": tell}
    return rows | part


def measured(part):
    """Whether a part of a row holds by a stored table, and the numbers that tell it.

    Parameters
    ----------
    part : dict
        `table`; `value`, an expression of its columns; `rows`, those for which it is told, by default all;
        `beside`, the rows by whose value it is divided; what has to hold of it, `least`, `most` or `course`,
        which "rises" or "falls"; `tell`, the words before the numbers. Or a `quantity` and its bounds.

    Raises
    ------
    ValueError
        If there are no such rows, or one of them has no number.
    """
    part = of_tests(part) if "quantity" in part else part
    table = stored(part["table"])

    def found(rows):
        return (
            (table.query(rows, engine="python") if rows else table)
            .eval(part["value"], engine="python")
            .to_numpy(float)
        )

    values = found(part.get("rows"))
    if "beside" in part:
        values = values / found(part["beside"])
    if not values.size or not np.isfinite(values).all():
        numbers = np.isfinite(values).sum()
        raise ValueError(f"{part}: expected rows with numbers, found {numbers} in {values.size} rows")
    if "course" in part:
        holds = (np.diff(values) * {"rises": 1.0, "falls": -1.0}[part["course"]] > 0.0).all()
        told = values[[0, -1]]
    else:
        holds = ((values >= part.get("least", -np.inf)) & (values <= part.get("most", np.inf))).all()
        told = values if values.size < MANY else values[[values.argmin(), values.argmax()]]
    numbers = [f"{value:.4g}" for value in told]
    link = ", " if told is values else " to "
    row = link.join(numbers) if len(set(numbers)) > 1 else numbers[0]
    return bool(holds), f"{part['tell']}: {row}{age(RESULTS / (part['table'] + '.csv'))}"


def joined(verdicts):
    """The verdict on a row of several statements."""
    if all(verdict == REPRODUCED for verdict in verdicts):
        return REPRODUCED
    unlike = set(verdicts) - {NOT}
    return NOT if not unlike else MISSING if unlike == {MISSING} else PARTLY


def settled(row):
    """What a row gives, its verdict and the reason where it is not reproduced."""
    verdicts, numbers, why = [], [], []
    for job, place in (name.split() for name in row.get("measured", [])):
        entry = statements(job)[int(place) - 1]
        verdicts.append(entry["verdict"])
        numbers.append(entry["measured"] + age(FIGURES / f"{job}.csv"))
        why.append(entry["why"])
    for holds, told in map(measured, row.get("measures", [])):
        verdicts.append(REPRODUCED if holds else NOT)
        numbers.append(told)
    own = [row[key] for key in ("verdict",) if key in row]  # which no measure beside it lifts
    verdict = max([joined(verdicts + own), *own], key=WORSE.index)
    if verdict != REPRODUCED:
        why.append(row.get("why", ""))
    numbers += [row[key] for key in ("gives",) if key in row]
    return "; ".join(numbers), verdict, "; ".join(dict.fromkeys(filter(None, why)))


def is_measured(row):
    """Whether a stored table decides at least a part of a row."""
    return "measured" in row or "measures" in row


def counted(name, verdicts, of_tables):
    """A line of the table of counts, `of_tables` by stored tables."""
    numbers = [verdicts.count(verdict) for verdict in (REPRODUCED, PARTLY, NOT, MISSING)]
    return f"| {' | '.join(map(str, [name, len(verdicts), *numbers, of_tables]))} |"


def lines():
    """Yield the lines of the page."""
    with (HERE.parent / "docs" / "coverage.toml").open("rb") as source:
        rows = tomllib.load(source)["row"]
    yield HEAD
    parts, verdicts = {}, {}
    for row in rows:
        letter = row["id"][0]
        gives, verdict, why = settled(row)
        verdicts.setdefault(letter, []).append(verdict)
        reason = f"{verdict}: {why}" if why else verdict
        cells = row["id"], row["at"], row["states"], row["command"], gives, reason
        parts.setdefault(letter, []).append(f"| {' | '.join(cells)} |")
    figures = {path.stem: statements(path.stem) for path in sorted(FIGURES.glob("*.csv"))}
    yield "| paper | rows | reproduced | partly | not | missing | measured |\n" + "|---" * 7 + "|"
    for letter, paper in PAPERS.items():
        yield counted(
            paper, verdicts[letter], sum(is_measured(row) for row in rows if row["id"][0] == letter)
        )
    yield counted("all", sum(verdicts.values(), []), sum(map(is_measured, rows)))
    each = [entry["verdict"] for entries in figures.values() for entry in entries]
    yield counted(f"statements of {len(figures)} figures", each, len(each)) + "\n"
    for letter, paper in PAPERS.items():
        yield f"## {paper}\n"
        yield "| | where | states | shown by | gives | verdict |\n|---|---|---|---|---|---|"
        yield from parts[letter]
        yield ""
    for job, entries in figures.items():
        yield f"## {entries[0]['figure']} (`{job}`){age(FIGURES / f'{job}.csv')}\n"
        yield "| | statement | verdict | measured |\n|---|---|---|---|"
        for k, entry in enumerate(entries, 1):
            numbers = entry["measured"] + (f"; {entry['why']}" if entry["why"] else "")
            yield f"| {k} | {entry['statement']} | {entry['verdict']} | {numbers} |"
        yield ""


if __name__ == "__main__":
    Path(sys.argv[1]).write_text("\n".join(lines()), encoding="utf-8")
