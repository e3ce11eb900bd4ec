"""The input of a stepper: rates of change with their constants, and facts on the unknowns."""

from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel

# Half of the digits of double precision: the error of a difference quotient is smallest there.
RELATIVE_INCREMENT = 1.5e-8


class System(NamedTuple):
    """First-order equations dy/dt = f(t, y) of n unknowns.

    Attributes
    ----------
    rates : kernel
        rates(constants, t, y, out) -> bool: writes f(t, y) into `out` (n,); False where there is no value,
        such as that of a contact without a solution.
    constants : NamedTuple
        Input of `rates`.
    velocities : (n,) bool array
        Unknowns that partitioned methods advance first.
    position_of : (n,) int array
        For a velocity the unknown whose rate it is, -1 where there is none and for all others.
    scale : (n,) array
        Typical size of each unknown: tolerances and difference quotients are relative to it.
    """

    rates: Any
    constants: Any
    velocities: np.ndarray
    position_of: np.ndarray
    scale: np.ndarray


class SetValuedSystem(NamedTuple):
    """A `System` with c forces that are known by bounds only: dry friction, contact of rigid bodies.

    Each acts on a relative speed s = directions y + (terms that do not depend on y) and stays between its
    bounds: it is whatever makes s = -restitution s_before where it can, else at the bound that comes nearest.

    Attributes
    ----------
    rates, constants, velocities, position_of, scale
        As in `System`, without the set-valued forces.
    bounds : kernel
        bounds(constants, t, y, held, speed, low, high, restitution) -> bool: writes the relative speeds
        [m/s], the bounds of the forces [N] and the coefficients of restitution [1] at a state, (c,) each;
        `held` (c,) bool says which of them the last step left at rest. False where they have no value.
    directions : (c, n) array
        Change of the relative speeds with the unknowns.
    response : (n, c) array
        Change of the unknowns by a unit impulse of each force: directions^T over the masses.
    """

    rates: Any
    constants: Any
    velocities: np.ndarray
    position_of: np.ndarray
    scale: np.ndarray
    bounds: Any
    directions: np.ndarray
    response: np.ndarray


@kernel
def all_finite(y: np.ndarray) -> bool:
    """Whether every number of an array is one.

    Parameters
    ----------
    y : (n,) array
        Any numbers.
    """
    for value in y:
        if not np.isfinite(value):
            return False
    return True


@kernel
def size(change: np.ndarray, scale: np.ndarray) -> float:
    """Largest change of an unknown against its typical size, [1].

    Parameters
    ----------
    change : (n,) array
        Of the unknowns, each in its unit.
    scale : (n,) array
        Of the system.
    """
    largest = 0.0
    for i in range(change.size):
        largest = max(largest, abs(change[i]) / scale[i])
        if not np.isfinite(change[i]):
            return np.inf
    return largest


@kernel
def jacobian(
    system: System, t: float, y: np.ndarray, rates: np.ndarray, changed: np.ndarray, matrix: np.ndarray
) -> bool:
    """Jacobian of the rates by difference quotients: n evaluations.

    Parameters
    ----------
    system : System
        Of n unknowns.
    t : float
        Time [s].
    y : (n,) array
        State; left as it was.
    rates : (n,) array
        f(t, y).
    changed : (n,) array
        Work space.
    matrix : (n, n) array
        Result: matrix[i, j] = df_i/dy_j.

    Returns
    -------
    bool
        False where a rate has no value near y.
    """
    n = y.size
    for j in range(n):
        before = y[j]
        y[j] = before + RELATIVE_INCREMENT * max(abs(before), system.scale[j])
        increment = y[j] - before
        known = system.rates(system.constants, t, y, changed)
        y[j] = before
        if not known:
            return False
        for i in range(n):
            matrix[i, j] = (changed[i] - rates[i]) / increment
    return True
