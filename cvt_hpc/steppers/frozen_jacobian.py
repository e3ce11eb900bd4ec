"""A Jacobian that is kept, with the inverse of I - shift J that was made of it.

Where friction falls more steeply than 1 / shift, I - shift J is no longer positive in its direction, and an
implicit step has more than one solution. That shows in the sign of the determinant; or, should that have
turned twice, in that of 1 - shift J_vv - shift^2 J_vx of a velocity v and its position x. A method that turns
growth into decay with shorter steps already has this asked of a longer shift (`reach`).
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.facts import FACTORISATIONS, JACOBIANS, NO_VALUE, NOT_FINITE, OK, RATES, SINGULAR
from cvt_hpc.steppers.system import System, all_finite, jacobian

SHIFT, SIGN = range(2)


class Frozen(NamedTuple):
    """A Jacobian, the inverse that was made of it, and work space.

    Attributes
    ----------
    jacobian, inverse : (n, n) arrays
        J, and (I - shift J)^-1.
    memory : (2,) array
        Shift of that inverse [s], 0 where there is none yet; 1 where friction leaves one solution, -1 where
        several.
    reach : float
        Shift with which growth is judged, in those of the inverse [1].
    rates, changed, trial, correction, next_correction : (n,) arrays
        Work space.
    """

    jacobian: np.ndarray
    inverse: np.ndarray
    memory: np.ndarray
    reach: float
    rates: np.ndarray
    changed: np.ndarray
    trial: np.ndarray
    correction: np.ndarray
    next_correction: np.ndarray


def frozen(system: System, reach: float = 1.0) -> Frozen:
    """Work space for a system; holds no matrix yet. `reach` as in `Frozen`."""
    n = system.scale.size
    return Frozen(np.zeros((n, n)), np.zeros((n, n)), np.zeros(2), reach, *(np.zeros(n) for _ in range(5)))


@kernel
def _invert(frozen: Frozen, position_of: np.ndarray, shift: float, counts: np.ndarray) -> int:
    n = frozen.rates.size
    frozen.memory[SHIFT] = 0.0
    for i in range(n):
        if not all_finite(frozen.jacobian[i]):
            return NOT_FINITE
        for j in range(n):
            frozen.inverse[i, j] = (1.0 if i == j else 0.0) - shift * frozen.jacobian[i, j]
    counts[FACTORISATIONS] += 1
    sign, logarithm = np.linalg.slogdet(frozen.inverse)
    if sign == 0.0 or not np.isfinite(logarithm):
        return SINGULAR
    frozen.inverse[:] = np.linalg.inv(frozen.inverse)
    frozen.memory[SHIFT], frozen.memory[SIGN] = shift, sign
    for i in range(n):
        if position_of[i] >= 0:
            stiffness, a = -frozen.jacobian[i, position_of[i]], frozen.reach * shift
            if 1.0 - a * frozen.jacobian[i, i] + a * a * stiffness < 0.0:
                frozen.memory[SIGN] = -1.0
    return OK


@kernel
def renew(
    system: System, frozen: Frozen, t: float, y: np.ndarray, shift: float, anew: bool, counts: np.ndarray
) -> int:
    """Make the inverse of I - shift J, of the Jacobian at hand or of a new one.

    Parameters
    ----------
    system : System
        The equations.
    frozen : Frozen
        Result; its `rates` are those of y.
    t, y
        Time [s] and state (n,).
    shift : float
        Step times the method's coefficient [s].
    anew : bool
        Take the Jacobian at y.
    counts : (6,) int array
        Work counters.

    Returns
    -------
    int
        A `Result`.
    """
    if anew:
        counts[JACOBIANS] += 1
        counts[RATES] += y.size
        if not jacobian(system, t, y, frozen.rates, frozen.changed, frozen.jacobian):
            return NO_VALUE
    return _invert(frozen, system.position_of, shift, counts)
