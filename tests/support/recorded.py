"""What a sweep has left in its output folder: records and numbers."""

from pathlib import Path

import numpy as np

from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.record.log import RECORD


def recorded_runs(out: Path) -> np.ndarray:
    """Indices of the runs that an output folder has on record so far."""
    folder = StudyFolder(out)
    if not folder.job_file.exists():
        return np.array([], int)
    return np.flatnonzero(read_records(folder.records, folder.load()).recorded)


def records(out: Path) -> int:
    """How many runs an output folder has on record so far."""
    return len(recorded_runs(out))


def frames_written(out: Path) -> int:
    """Number of records in all logs, repeated ones counted each time."""
    return sum(path.read_bytes().count(RECORD) for path in (out / "records").glob("*.log"))


def assert_same_numbers(found, expected) -> None:
    """Assert that all variables of two datasets agree bitwise, but those that depend on the hour."""
    assert list(found.variables) == list(expected.variables)
    for name, variable in expected.variables.items():
        if variable.attrs.get("volatile") != "yes":
            one, other = found[name].values, variable.values
            assert one.dtype == other.dtype, name
            same = (
                one.tolist() == other.tolist() if one.dtype.kind in "OU" else one.tobytes() == other.tobytes()
            )
            assert same, name
