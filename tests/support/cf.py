"""What the IOOS compliance checker finds in a netCDF file, and whether it says where it is from."""

from functools import cache
from pathlib import Path
from unittest import mock

import netCDF4

from cvt_hpc import __version__

CONVENTIONS = "cf:1.11"
# The checker asks them again for each variable, which takes most of its time; a file does not change meanwhile.
ASKED_OFTEN = (
    "get_geophysical_variables",
    "get_auxiliary_coordinate_variables",
    "get_axis_variables",
    "get_time_variables",
)
TOLD = ("Conventions", "title", "source", "history", "command", "host", "job_name", "job", "versions")


def cf_findings(path: Path) -> list[str]:
    """Return the complaints about a file, those of lowest weight too, and checks that broke down over it."""
    from compliance_checker.cf import util
    from compliance_checker.cf.cf import CF1_11Check
    from compliance_checker.suite import CheckSuite

    CheckSuite.checkers = {CONVENTIONS: CF1_11Check}
    suite = CheckSuite()
    dataset = suite.load_dataset(str(path))
    with mock.patch.multiple(util, **{name: cache(getattr(util, name)) for name in ASKED_OFTEN}):
        results, errors = suite.run_all(dataset, [CONVENTIONS])[CONVENTIONS]
    dataset.close()
    assert len(results) > 20  # it has looked
    broken = [f"{check}: {error[0]}" for check, error in errors.items()]
    failed = (result for result in results if result.value[0] < result.value[1])  # points of how many
    with netCDF4.Dataset(path) as file:
        missing = [f"{name} is not told" for name in TOLD if not getattr(file, name, "").strip()]
        broken += missing + ([] if __version__ in file.source else ["source has no version"])
    return broken + [f"{result.name}: {text}" for result in failed for text in result.msgs]
