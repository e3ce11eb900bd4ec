"""The equations of the elastic belt at a state, by the kernel that its general steppers march.

A kernel that another one takes in is compiled again where Python calls it; that of `rates` is there.
"""

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State
from cvt_hpc.models.elastic_belt.one_system import FlatBelt, pack, rates
from cvt_hpc.steppers.system import RELATIVE_INCREMENT, System


def evaluate(flat: FlatBelt, state: State) -> np.ndarray:
    """Rates of the unknowns, as they are packed; forces, strains, moments and other rates go into the work space."""
    y = pack(flat, state)
    found = np.empty_like(y)
    assert rates(flat, state.scalars[f.TIME], y, found)
    return found


def slopes(system: System, time: float, y: np.ndarray) -> np.ndarray:
    """Jacobian of the rates, (n, n), a column after the other by a difference quotient."""
    known = called_alike(system.rates)
    before, changed, found = np.empty_like(y), np.empty_like(y), np.empty((y.size, y.size))
    assert known(system.constants, time, y, before)
    for j in range(y.size):
        moved = y.copy()
        moved[j] += RELATIVE_INCREMENT * max(abs(y[j]), system.scale[j])
        assert known(system.constants, time, moved, changed)
        found[:, j] = (changed - before) / (moved[j] - y[j])
    return found
