"""The material of each layer: whatever the belt does, none is lost."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from support.fast_runs import march
from support.settled import STEP, start


@pytest.mark.parametrize(
    ("stepper", "step", "steps"),
    [("imex", STEP, 6000), ("explicit", 0.04e-6, 15000)],
    ids=["imex", "explicit"],
)
@pytest.mark.parametrize("memory", [0.3e-3, 0.0])
def test_content_of_both_layers_is_kept(stepper, step, steps, memory):
    # falling friction and load, risen within a tenth of the run: elements press, separate and slip
    belt, state = start(load=150.0, rise_time=0.1 * steps * step, friction_memory=memory, disturbance=1e-4)
    before = state.fields[f.N_ELEMENT :].copy()
    state = march(stepper, belt, state, step, steps)
    moved = np.abs(state.fields[f.N_ELEMENT :] - before).max(axis=1)
    assert moved.min() > 1e-5  # the content has flowed, 1e-5 of a cell at least
    assert np.abs(state.fields[f.U]).max() > 1e-2
    # What leaves a cell enters the next; each step rounds every cell once, by eps / 2 of its content.
    change = state.fields[f.N_ELEMENT :] @ belt.cell / (before @ belt.cell) - 1.0
    assert np.abs(change).max() <= steps * np.finfo(float).eps
