"""What tests of the suite measure for statements of papers: paper_tests.py TABLE.csv TESTS.py ...

A test gives it to the fixture `tell`: a quantity with its unit, what is found, and possibly a reference. Of
all that a case of a test tells of a quantity, of arrays and of random examples too, the table has the worst:
`value` and `reference` where they differ most, and `error`, their difference over the largest reference; else
the largest value. Only tests that tell something run, and where one fails no table is written.
"""

import csv
import sys

import numpy as np
import pytest

from cvt_hpc.storage.provenance import origin_lines

HEAD = "test", "case", "quantity", "value", "reference", "error"


class Told:
    """Plugin of pytest by which only tests that tell something run.

    Attributes
    ----------
    worst : dict
        (Rank, value, reference, error) by test, case and quantity.
    """

    def __init__(self):
        self.worst = {}

    def pytest_collection_modifyitems(self, items):
        """Leave out tests that tell nothing."""
        items[:] = [item for item in items if "tell" in item.fixturenames]

    def pytest_runtest_logreport(self, report):
        """Keep the worst of what a test has told."""
        for quantity, told in report.user_properties if report.when == "call" else ():
            found, reference = np.broadcast_arrays(*told)
            # without a reference the largest is told
            apart = np.abs(found) if np.isnan(reference).all() else np.abs(found - reference)
            at = apart.argmax()  # the first nan, if there is one
            error = apart[at] / (np.abs(reference).max() or 1.0)
            rank = apart[at] if np.isnan(error) else error
            test, _, case = report.nodeid.removesuffix("]").partition("[")
            if not rank <= self.worst.setdefault((test, case, quantity), (-1.0,))[0]:
                self.worst[test, case, quantity] = rank, found[at], reference[at], error


def main(table, *tests):
    """Run tests and write the table, if none fails; return the exit status of pytest."""
    told = Told()
    status = pytest.main(["-q", "-p", "no:cacheprovider", "--hypothesis-seed=0", *tests], plugins=[told])
    if not status:
        with open(table, "w", encoding="utf-8") as out:
            out.writelines(origin_lines())
            lines = csv.writer(out, lineterminator="\n")
            lines.writerow(HEAD)
            for (test, case, quantity), (_, *numbers) in told.worst.items():
                lines.writerow([test, case, quantity, *(f"{number:.6g}" for number in numbers)])
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
