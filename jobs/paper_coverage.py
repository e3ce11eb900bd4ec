"""Write what holds of two papers: paper_coverage.py PAGE.md, by docs/coverage.toml and results/figures."""

import csv
import sys
import tomllib
from pathlib import Path

from cvt_hpc.tables import below_origin

HERE = Path(__file__).parent
TABLES = HERE / "results" / "figures"
PAPERS = {
    "L": "Lebrecht, Pfeiffer, Ulbrich 2004",
    "B": "Bullinger, Funk, Pfeiffer 2005",
}
HEAD = """# Two papers, statement by statement

What W. Lebrecht, F. Pfeiffer and H. Ulbrich (04CVT-32, 2004) and M. Bullinger, K. Funk and F. Pfeiffer
(2005) state, the command that shows it here, what it gives, and whether that is what they state. First all
of both papers, then each figure.

Made by `python jobs/paper_coverage.py docs/coverage.md` from `docs/coverage.toml` and from the tables in
`jobs/results/figures`. Each of these is that of a job, below "figure `NAME`":
`cvt-hpc run jobs/figures/NAME.toml && cvt-hpc figure out/NAME` leaves `figure.png` and `statements.csv`. A
statement is reproduced where all parts of its measure hold, partly where some do. The papers' pictures have
no data here: "reproduced" means every number and shape that the text states. What they do not give is
assumed, as each job says.
"""
REPRODUCED, PARTLY, NOT = "reproduced", "partly", "not"


def tables():
    """Rows of each figure's table, by its job."""
    found = {}
    for table in sorted(TABLES.glob("*.csv")):
        with table.open(encoding="utf-8") as source:
            found[table.stem] = list(csv.DictReader(below_origin(source)))
    return found


def joined(verdicts):
    """The verdict on a row of several statements."""
    if all(verdict == REPRODUCED for verdict in verdicts):
        return REPRODUCED
    return NOT if all(verdict == NOT for verdict in verdicts) else PARTLY


def settled(row, figures):
    """What a row gives, its verdict and the reason, of what is measured where it names statements."""
    names = [name.split() for name in row.get("measured", [])]
    found = [figures[job][int(place) - 1] for job, place in names]
    if not found:
        return row["gives"], row["verdict"], row.get("why", "")
    numbers = [entry["measured"] for entry in found] + [row[key] for key in ("gives",) if key in row]
    why = dict.fromkeys(entry["why"] for entry in found if entry["why"])
    return "; ".join(numbers), joined([entry["verdict"] for entry in found]), "; ".join(why)


def lines():
    """Yield the lines of the page."""
    with (HERE.parent / "docs" / "coverage.toml").open("rb") as source:
        rows = tomllib.load(source)["row"]
    figures = tables()
    yield HEAD
    counts = dict.fromkeys((REPRODUCED, PARTLY, NOT), 0)
    parts = {}
    for row in rows:
        gives, verdict, why = settled(row, figures)
        counts[verdict] += 1
        reason = f"{verdict}: {why}" if why else verdict
        cells = row["id"], row["at"], row["states"], row["command"], gives, reason
        parts.setdefault(row["id"][0], []).append(f"| {' | '.join(cells)} |")
    measured = [entry["verdict"] for entries in figures.values() for entry in entries]
    told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    each = ", ".join(f"{measured.count(verdict)} {verdict}" for verdict in counts)
    of_figures = f"Of {len(measured)} statements measured in {len(figures)} figures: {each}."
    yield f"**{len(rows)} rows: {told}.** {of_figures}\n"
    for letter, paper in PAPERS.items():
        yield f"## {paper}\n"
        yield "| | where | states | shown by | gives | verdict |\n|---|---|---|---|---|---|"
        yield from parts[letter]
        yield ""
    for job, entries in figures.items():
        yield f"## {entries[0]['figure']} (`{job}`)\n"
        yield "| | statement | verdict | measured |\n|---|---|---|---|"
        for k, entry in enumerate(entries, 1):
            numbers = entry["measured"] + (f"; {entry['why']}" if entry["why"] else "")
            yield f"| {k} | {entry['statement']} | {entry['verdict']} | {numbers} |"
        yield ""


if __name__ == "__main__":
    Path(sys.argv[1]).write_text("\n".join(lines()), encoding="utf-8")
