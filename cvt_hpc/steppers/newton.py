"""The equations of an implicit stage, z = base + shift f(t, z), by Newton's method with a frozen inverse.

The inverse of I - shift J is kept as long as each pass reduces the correction to half or less, and ends in
fewer passes than a new Jacobian costs evaluations; else J is taken anew where the iteration stands. Should
that not suffice, the way along the correction is bisected until the remainder shrinks (natural monotonicity
test, Deuflhard 2004, sec. 3.3). So the sharp bends of regularised friction are found from far off. Where
nothing shrinks it, the iteration leaps by the whole correction: so it gets away from sticking when the pull
has just grown too large for it, and only the slip far off is a solution.

Where friction falls too steeply, the equations have several solutions, and the one found is not that to which
the motion leads. A Newton iteration with one matrix that converges does so where the determinant of I - shift
J has that matrix's sign, so that it is checked once for each matrix.

A Jacobian is kept together with the inverse of I - shift J that was made of it. Where friction falls more
steeply than 1 / shift, I - shift J is no longer positive in its direction, and an implicit step has more than
one solution. That shows in the sign of the determinant; or, should that have turned twice, in that of 1 -
shift J_vv - shift^2 J_vx of a velocity v and its position x. A method that turns growth into decay with
shorter steps already has this asked of a longer shift (`reach`).
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers import facts
from cvt_hpc.steppers.system import System, all_finite, jacobian, size

SHIFT, SIGN = range(2)

_ENOUGH = 0.5  # reduction of the correction in a pass with which a frozen matrix is kept
LEAST_SHARE = 1e-9  # of the correction: the interval at which the search along it ends
_MOST_LEAPS = 5  # without descent, away from where a solution has just vanished
MOST_PASSES = 200


class Frozen(NamedTuple):
    """A Jacobian, the inverse that was made of it, and work space."""

    # jacobian, inverse, shape (n, n): J, and (I - shift J)^-1
    jacobian: np.ndarray
    inverse: np.ndarray
    # shape (2,): shift of that inverse [s], 0 where there is none yet; 1 where friction leaves one solution,
    # -1 where several
    memory: np.ndarray
    reach: float  # shift with which growth is judged, in those of the inverse [1]
    # rates, changed, trial, correction, next_correction, shape (n,): work space
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
            return facts.NOT_FINITE
        for j in range(n):
            frozen.inverse[i, j] = (1.0 if i == j else 0.0) - shift * frozen.jacobian[i, j]
    counts[facts.FACTORISATIONS] += 1
    sign, logarithm = np.linalg.slogdet(frozen.inverse)
    if sign == 0.0 or not np.isfinite(logarithm):
        return facts.SINGULAR
    inverse = np.linalg.inv(frozen.inverse)
    for i in range(n):
        copy(inverse[i], frozen.inverse[i])
    frozen.memory[SHIFT], frozen.memory[SIGN] = shift, sign
    for i in range(n):
        if position_of[i] >= 0:
            stiffness, a = -frozen.jacobian[i, position_of[i]], frozen.reach * shift
            if 1.0 - a * frozen.jacobian[i, i] + a * a * stiffness < 0.0:
                frozen.memory[SIGN] = -1.0
    return facts.OK


@kernel
def renew(
    system: System, frozen: Frozen, t: float, y: np.ndarray, shift: float, anew: bool, counts: np.ndarray
) -> int:
    """Make the inverse of I - shift J, of the Jacobian at hand or of a new one.

    Parameters
    ----------
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
        counts[facts.JACOBIANS] += 1
        counts[facts.RATES] += y.size
        if not jacobian(system, t, y, frozen.rates, frozen.changed, frozen.jacobian):
            return facts.NO_VALUE
    return _invert(frozen, system.position_of, shift, counts)


@kernel
def _correct(
    system: System,
    frozen: Frozen,
    base: np.ndarray,
    shift: float,
    z: np.ndarray,
    correction: np.ndarray,
    counts: np.ndarray,
) -> float:
    """Newton's correction of z, whose rates are known, by the present inverse; returns its size."""
    for i in range(z.size):
        frozen.changed[i] = base[i] + shift * frozen.rates[i] - z[i]
    np.dot(frozen.inverse, frozen.changed, correction)
    counts[facts.SOLVES] += 1
    return size(correction, system.scale)


@kernel
def _overshot(system: System, frozen: Frozen) -> bool:
    """Whether the correction at the trial points back."""
    along = 0.0
    for i in range(system.scale.size):
        along += frozen.correction[i] * frozen.next_correction[i] / system.scale[i] ** 2
    return along < 0.0


@kernel
def _rates(system: System, frozen: Frozen, t: float, z: np.ndarray, counts: np.ndarray) -> bool:
    counts[facts.RATES] += 1
    return system.rates(system.constants, t, z, frozen.rates)


@kernel
def solve_stage(
    system: System,
    frozen: Frozen,
    t: float,
    base: np.ndarray,
    shift: float,
    tolerance: float,
    z: np.ndarray,
    counts: np.ndarray,
) -> int:
    """Solve z = base + shift f(t, z).

    Parameters
    ----------
    frozen : Frozen
        The last matrix; renewed where it does not serve.
    t : float
        Time of the stage [s].
    base : (n,) array
        Known part.
    shift : float
        Step times the method's coefficient [s].
    tolerance : float
        Largest correction that is left, against each unknown's typical size [1].
    z : (n,) array
        The guess; then the solution.
    counts : (6,) int array
        Work counters.

    Returns
    -------
    int
        A `Result`; NOT_UNIQUE where the solution found is one of several.
    """
    if not _rates(system, frozen, t, z, counts):
        return facts.NO_VALUE
    anew = frozen.memory[SIGN] == 0.0
    begin, fresh, bracketed, crossed, leaps = True, anew, False, False, 0
    left, share, near, far = 0.0, 1.0, 0.0, 1.0
    for _ in range(MOST_PASSES):
        if begin:
            if anew or frozen.memory[SHIFT] != shift:
                outcome = renew(system, frozen, t, z, shift, anew, counts)
                if outcome != facts.OK:
                    return outcome
            left = _correct(system, frozen, base, shift, z, frozen.correction, counts)
            crossed |= frozen.memory[SIGN] < 0.0
            begin, fresh, bracketed, anew = False, anew, False, True
            share, near, far = 1.0, 0.0, 1.0
        if not np.isfinite(left):
            return facts.NOT_FINITE
        for i in range(z.size):
            frozen.trial[i] = z[i] + share * frozen.correction[i]
        next_left = np.inf
        if _rates(system, frozen, t, frozen.trial, counts):
            next_left = _correct(system, frozen, base, shift, frozen.trial, frozen.next_correction, counts)
        if share == 1.0 and next_left <= tolerance:
            for i in range(z.size):
                z[i] = frozen.trial[i] + frozen.next_correction[i]
            return facts.OK if frozen.memory[SIGN] > 0.0 else facts.NOT_UNIQUE
        reduction = next_left / left
        if reduction <= (_ENOUGH if share == 1.0 else 1.0 - 0.5 * share):
            copy(frozen.trial, z)
            copy(frozen.next_correction, frozen.correction)
            left, share, near, far, fresh = next_left, 1.0, 0.0, 1.0, False
            # a new Jacobian costs n evaluations: less than as many passes
            begin = left * reduction ** (z.size + 2) > tolerance
            continue
        if fresh:
            overshot = _overshot(system, frozen)
            bracketed |= overshot
            if bracketed and not overshot:
                near = share
            else:
                far = share
            share = 0.5 * (near + far)
            if far - near >= LEAST_SHARE:
                continue
            leaps += 1
            if leaps > _MOST_LEAPS:
                break
            z += frozen.correction
        begin = True
        if not _rates(system, frozen, t, z, counts):
            return facts.NO_VALUE
    return facts.NOT_UNIQUE if crossed else facts.NO_CONVERGENCE
