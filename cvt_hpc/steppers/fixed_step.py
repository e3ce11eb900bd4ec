"""The march of every method with a fixed step: so many equal steps in each sampling interval."""

from typing import Any

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.facts import NOT_FINITE, OK, STEPS
from cvt_hpc.steppers.system import all_finite


@kernel
def march_in_equal_steps(
    advance: Any,
    system: Any,
    control: Any,
    interval: float,
    rows: np.ndarray,
    clock: np.ndarray,
    y: np.ndarray,
    work: Any,
    counts: np.ndarray,
) -> int:
    """March by `advance`, a kernel that takes one step.

    Parameters
    ----------
    advance : kernel
        advance(system, control, step, t, y, work, counts) -> Result: takes y from t to t + step.
    system, control, interval, rows, clock, y, work, counts
        As in every `march` of this package: see `cvt_hpc.steppers`.

    Returns
    -------
    int
        A `Result`.
    """
    steps = max(int(np.ceil(interval / control.step - 1e-9)), 1)
    step = interval / steps
    for k in range(rows.shape[0]):
        start = clock[0]
        for i in range(steps):
            outcome = advance(system, control, step, start + i * step, y, work, counts)
            counts[STEPS] += 1
            if outcome == OK and not all_finite(y):
                outcome = NOT_FINITE
            if outcome != OK:
                clock[0] = start + i * step
                return outcome
        clock[0] = start + interval
        copy(y, rows[k])
    return OK
