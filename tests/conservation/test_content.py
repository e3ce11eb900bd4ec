"""The material of each layer: whatever the belt does, none is lost."""

import numpy as np
import pytest
from fast_runs import march_fast
from settled import STEP, fresh_contacts, start

from cvt_hpc.models.elastic_belt.belt import N_ELEMENT, U
from cvt_hpc.models.elastic_belt.explicit import step_explicit


@pytest.mark.parametrize(
    ("stepper", "step", "steps"), [("imex", STEP, 6000), ("explicit", 0.1e-6, 6000)], ids=["imex", "explicit"]
)
@pytest.mark.parametrize("memory", [0.3e-3, 0.0])
def test_content_of_both_layers_is_kept(stepper, step, steps, memory):
    # falling friction and load, risen within a tenth of the run: elements press, separate and slip
    belt, state = start(load=150.0, rise_time=0.1 * steps * step, friction_memory=memory, disturbance=1e-4)
    before = state.fields[N_ELEMENT:].copy()
    if stepper == "imex":
        state = march_fast(belt, state, step, steps)
    else:
        contacts, work = fresh_contacts(belt), np.zeros((10, belt.cell.size))
        for _ in range(steps):
            assert step_explicit(belt, state, contacts, work, step) > 0
    moved = np.abs(state.fields[N_ELEMENT:] - before).max(axis=1)
    assert moved.min() > 1e-5  # the content has flowed, 1e-5 of a cell at least
    assert np.abs(state.fields[U]).max() > 1e-2
    # What leaves a cell enters the next; each step rounds every cell once, by eps / 2 of its content.
    change = state.fields[N_ELEMENT:] @ belt.cell / (before @ belt.cell) - 1.0
    assert np.abs(change).max() <= steps * np.finfo(float).eps
