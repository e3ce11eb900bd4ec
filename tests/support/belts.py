"""Belts for the tests of where methods end: short runs by general steppers, and growth of tiny differences."""

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import typeof

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.elastic_belt.belt import belt_constants
from cvt_hpc.models.elastic_belt.general_run import GeneralTransient
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, system
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import RELATIVE_INCREMENT, System
from support.lone import Transient
from support.rungs import rung_job

COARSE = {"stations": 48, "duration": 0.04, "rise_time": 0.01, "load": 60.0}


def point(stepper: str, **values) -> dict:
    """Parameters of a run of a coarse belt on the scene of the tests but for `values` [SI]."""
    return rung_job("elastic_belt", stepper=stepper, **COARSE | values).point(0)


def general(stepper: str, **values) -> GeneralTransient:
    """A run by a general stepper."""
    return GeneralTransient(point(stepper, **values), stepper)


@cache
def settled(**values) -> tuple[System, np.ndarray]:
    """A belt under its load, and its unknowns 1 ms after the start-up, by short explicit steps."""
    run = Transient(point("explicit", **{"step": 5e-8} | values), "explicit")
    end = round((run.parameters["rise_time"] + 1e-3) / run.interval)
    while run.done < end:
        assert run.advance(end - run.done) is None
    flat = flat_belt(belt_constants(run.parameters), run.time)
    return system(flat), pack(flat, run.state)


def eigenvalues(**values) -> np.ndarray:
    """Of the settled belt's Jacobian [1/s]."""
    whole, y = settled(**values)

    compiled = called_alike(whole.rates)

    def rates(start: np.ndarray) -> np.ndarray:
        found = np.empty_like(start)
        assert compiled(whole.constants, 1.0, start.copy(), found)
        return found

    return np.linalg.eigvals(_quotients(rates, y, whole.scale))


def growth(stepper: str, step: float, **values) -> float:
    """Largest factor by which one step from the settled belt makes a tiny difference grow."""
    whole, y = settled(**values)
    march = Marching(stepper, point(stepper, step=step, **values), whole, y, step)
    row = np.empty((1, y.size))
    assert march.advance(row) == Result.OK
    # the compiled march itself: to tell the types of all that a belt has takes 2 ms a call, a step some us
    method = march._method.march
    arguments = march._system, march._control, step, row, march._clock, march.y, march._work, march._counts
    arguments = *method.args, *arguments
    compiled = method.func.get_overload(tuple(map(typeof, arguments)))

    def after(start: np.ndarray) -> np.ndarray:
        march.y[:] = start
        assert compiled(*arguments) == Result.OK
        return row[0].copy()

    return np.abs(np.linalg.eigvals(_quotients(after, y, whole.scale))).max()


def _quotients(function: Callable[[np.ndarray], np.ndarray], y: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Derivative of a function of the unknowns, (n, n), by differences to either side, the lesser of both.

    Where elements close, the force of their damper sets in at once: a cell that has just met its neighbour
    has a derivative to one side only.
    """
    base, sides = function(y), []
    for sign in (1.0, -1.0):
        change = np.empty((y.size, y.size))
        for j in range(y.size):
            moved = y.copy()
            moved[j] += sign * RELATIVE_INCREMENT * max(abs(y[j]), scale[j])
            change[:, j] = (function(moved) - base) / (moved[j] - y[j])
        sides.append(change)
    sizes = [np.linalg.norm(change / scale[:, None], axis=0) for change in sides]
    return np.where(sizes[0] <= sizes[1], *sides)


def longest_stable_step(stepper: str, guess: float, **values) -> float:
    """Step between 3/4 and 4/3 of a guess beyond which differences grow, by bisection to 2 %."""
    low, high = 0.75 * guess, guess / 0.75
    for _ in range(4):
        step = np.sqrt(low * high)
        # 1 % in a step is far more than what the belt itself lets grow, 10^3 per second
        low, high = (low, step) if growth(stepper, step, **values) > 1.01 else (step, high)
    return np.sqrt(low * high)
