"""What a run of the spatial pushbelt keeps in memory, and that its steps take no more."""

import numpy as np
import pytest
from numba import njit
from numba.core.runtime import _nrt_python as counting
from numba.core.runtime import rtsys

from cvt_hpc.job import build_job
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.spatial_pushbelt.transient import Transient


def size(value):
    """Bytes of all arrays in a value, its parts and attributes."""
    value = value.data if isinstance(value, LaneArray) else value
    if isinstance(value, np.ndarray):
        return value.nbytes
    parts = value.values() if isinstance(value, dict) else value
    if isinstance(parts, str | bytes) or not hasattr(parts, "__iter__"):
        return size(vars(parts)) if hasattr(parts, "__dict__") else 0
    return sum(map(size, parts))


@pytest.fixture
def run():
    """432 elements between sheaves of five modes."""
    asked = build_job({"name": "memory", "model": "spatial_pushbelt"}, "memory", {"elements": 432})
    found = Transient(asked.point(0), "newton")
    assert found._belt.modal_stiffness.shape == (2, 5)
    return found


def test_a_run_takes_less_than_ten_megabytes(run):
    kept = {name: size(getattr(run, name)) for name in ("_state", "_work", "_rows", "_totals", "_sums")}
    assert min(kept.values()) > 1e4
    assert sum(kept.values()) <= size(vars(run)) < 10e6  # 5.8e6 found, of which 3.2e6 are histories of 0.3 s


@njit
def _room(count):
    return np.empty(count)


def test_steps_allocate_nothing(run):
    # kernels of lanes are compiled without an allocator, so that one that asks for room does not compile either
    counting.memsys_enable_stats()
    try:
        allocated = [rtsys.get_allocation_stats().alloc]
        for act in (lambda: _room(8), lambda: run._march(run._inputs_along(0), 20)):
            act()
            allocated.append(rtsys.get_allocation_stats().alloc)
    finally:
        counting.memsys_disable_stats()
    assert run.counters()["steps"] == 20
    assert allocated[1] > allocated[0]  # an array is counted
    assert allocated[2] == allocated[1]
