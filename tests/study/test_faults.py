"""A short fault campaign, one sweep for each kind of fault; `tests/benchmarks/faults.py` is the long one."""

import pytest

from support.fault_cases import make_reference
from support.fault_kinds import NEED_MOUNT, NEED_MPI, can_mount, play
from support.study_processes import find_mpirun

# With seeds for which one blow or two come in the middle of the sweep, however fast the machine is.
CASES = {
    "kill -9 of a serial sweep": "7",
    "kill -9 of a rank": "21",
    "kill -9 of a part beside others": "0",
    "kill -9 of gather": "49",
    "kill -9 in mid-write": "6",
    "kill -9 and a log cut short": "6",
    "kill -9 and a folder damaged or made up": "0",
    "full disk": "15",
    "read-only folder": "1",
    "folder turns read-only": "0",
    "clock jumps and kill -9": "3",
}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The undisturbed sweep."""
    return make_reference(tmp_path_factory.mktemp("reference"))


@pytest.mark.parametrize(("kind", "seed"), CASES.items())
def test_a_fault_loses_nothing_changes_nothing_and_hangs_nothing(tmp_path, reference, kind, seed):
    if kind in NEED_MPI:
        find_mpirun()  # or skip
    if kind in NEED_MOUNT and not can_mount(tmp_path):
        pytest.skip("no file system can be mounted here")
    outcome = play(kind, seed, tmp_path / "case", reference)
    assert outcome.is_sound, outcome
    assert outcome.faults > 0 and outcome.acknowledged > 0
