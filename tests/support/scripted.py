"""Systems made up for tests, behind one kernel, so that each method is compiled for all of them once."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.system import System

ENDS, STOP, TWO_MASSES = range(3)


class Script(NamedTuple):
    """Which system, and its three numbers.

    ENDS: y' = 1 + growth y^2, without a value after `first` [s] and no number after `second` [s]; `third` is
    the growth. STOP: a unit mass pressed by `third` [N] on a stop of damping `first` [N s/m] and stiffness
    `second` [N/m] that never pulls. TWO_MASSES: each on a unit spring, driven by its own speed at the rate `first` [1/s] and by the
    other's at `second`.
    """

    kind: int
    first: float
    second: float = 0.0
    third: float = 0.0


@kernel
def scripted(script, t, y, out):
    if script.kind == ENDS:
        out[0] = np.nan if t > script.second else 1.0 + script.third * y[0] * y[0]
        return t <= script.first
    if script.kind == STOP:
        force = max(-script.second * y[0] - script.first * y[1], 0.0) if y[0] < 0.0 else 0.0
        out[0], out[1] = y[1], force - script.third
        return True
    for i in range(2):
        out[i] = y[2 + i]
        out[2 + i] = script.first * y[2 + i] + script.second * y[3 - i] - y[i]
    return True


def system(script, scale):
    """Equations: a single velocity, or positions followed by their velocities."""
    n = len(scale)
    velocities, position_of = np.arange(n) >= n // 2, np.full(n, -1)
    if n > 1:
        position_of[n // 2 :] = np.arange(n // 2)
    return System(scripted, script, velocities, position_of, np.array(scale, dtype=np.float64))
