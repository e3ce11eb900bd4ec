"""The rate of the fastest motion of a system, which limits the step of an explicit method.

Beyond its limit an explicit step need not diverge. Where friction saturates it hums from step to step
instead, and slow motions are wrong by no visible cause: so the limit is looked at, and not the result.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.system import System

INCREMENT = 1e-6  # of the largest unknown against its typical size: the quotient is good to some digits
_PASSES, _LAST = 60, 10

# Largest step times rate of methods with a fixed step: on both axes for the first, the lesser of 2.785 for
# decay and 2.828 for vibration for the other
STABLE = {"symplectic_euler": 2.0, "runge_kutta_4": 2.785}


@kernel
def fastest_rate(system: System, t: float, y: np.ndarray, direction: np.ndarray) -> float:
    """Largest eigenvalue of the Jacobian by magnitude [1/s], by the power method on difference quotients.

    Parameters
    ----------
    system : System
        Of n unknowns.
    t : float
        Time [s].
    y : (n,) array
        State.
    direction : (n,) array
        Where to start, not 0; then the direction of the fastest motion, in typical sizes.

    Returns
    -------
    float
        Geometric mean of the last passes' growth, since pairs of complex eigenvalues beat; nan where rates
        have no value. From below: a few per cent are left where eigenvalues lie close.
    """
    base, changed, moved = np.empty_like(y), np.empty_like(y), np.empty_like(y)
    if not system.rates(system.constants, t, y, base):
        return np.nan
    total = 0.0
    for k in range(_PASSES):
        largest = np.max(np.abs(direction))
        for i in range(y.size):
            moved[i] = y[i] + INCREMENT * direction[i] / largest * system.scale[i]
        if not system.rates(system.constants, t, moved, changed):
            return np.nan
        before = after = 0.0
        for i in range(y.size):
            before += ((moved[i] - y[i]) / system.scale[i]) ** 2
            direction[i] = (changed[i] - base[i]) / system.scale[i]
            after += direction[i] ** 2
        if after == 0.0 or not np.isfinite(after):
            return 0.0 if after == 0.0 else np.nan
        if k >= _PASSES - _LAST:
            total += 0.5 * np.log(after / before) / _LAST
    return np.exp(total)
