"""Write what holds of the papers' figures, by the tables in jobs/results/figures: coverage.py PAGE.md"""

import csv
import sys
from pathlib import Path

TABLES = Path(__file__).parent / "results" / "figures"
HEAD = """# The papers' figures, statement by statement

Made by `python jobs/coverage.py cvt_hpc/models/elastic_belt/FIGURES.md` from the tables in
`jobs/results/figures`. Each is that of a job: `cvt-hpc run jobs/figures/NAME.toml && cvt-hpc figure out/NAME`
leaves `figure.png` and `statements.csv`. A statement is reproduced where all parts of its measure hold,
partly where some do.
"""


def lines():
    """Yield the lines of the page."""
    yield HEAD
    for table in sorted(TABLES.glob("*.csv")):
        with table.open(encoding="utf-8") as source:
            rows = list(csv.DictReader(source))
        yield f"## {rows[0]['figure']} (`{table.stem}`)\n"
        yield "| statement | verdict | measured |\n|---|---|---|"
        for row in rows:
            measured = row["measured"] + (f"; {row['why']}" if row["why"] else "")
            yield f"| {row['statement']} | {row['verdict']} | {measured} |"
        yield ""


if __name__ == "__main__":
    Path(sys.argv[1]).write_text("\n".join(lines()), encoding="utf-8")
