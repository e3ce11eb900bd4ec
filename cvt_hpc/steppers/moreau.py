"""Moreau's time stepping: dry friction and rigid contact as they are, with jumps of the velocity.

Positions half a step on; smooth forces there; then the impulses of the step, found together with the new
velocities (half-explicit: positions explicit, set-valued forces implicit); positions the second half on
(Moreau 1988; Acary and Brogliato 2008, sec. 10.1). The impulses solve the inclusion exactly, contact by
contact until nothing changes (Gauss-Seidel of proximal points): a contact that sticks is at rest, without
regularisation and without creep, and a rigid body that closes a gap in infinitely many bounces is at rest
when they are over, those too short for the step being skipped.

Order 2 between events where smooth forces depend on positions only, 1 else: damping and falling friction are
taken at the velocity of the step's start. Events fall on steps: order 1. A gap is closed only once it is
overrun, by up to a step's way, and stays so while the bodies rest on each other; contact is unilateral on the
level of velocities.

A contact may have a larger bound while it sticks (`held`). Where that does not hold it, the step is solved
again with the bound of sliding.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.facts import NO_CONVERGENCE, NO_VALUE, OK, RATES, SOLVES, Facts
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.settings import STEP, FixedStep, fixed_step
from cvt_hpc.steppers.system import SetValuedSystem

FACTS = Facts(
    order=1,
    order_at_events=1.0,
    needs=frozenset({"rates", "partition", "friction"}),
    vibration_limit=2.0,
    stability="step < 2 / w for a vibration of frequency w, step < 2 / d for a damping rate d (rising "
    "friction: N |mu'| / m); dry friction and rigid contact set no limit",
    damping="none where smooth forces depend on positions only",
)
PARAMETERS = {"numerics": {"step": STEP}}
control = fixed_step

MOST_SWEEPS = 10_000
SETTLED = 1e-14  # change of a relative speed in a sweep, against the largest there is


class Work(NamedTuple):
    """Work space.

    Attributes
    ----------
    rates : (n,) array
        Rates; then the effect of the smooth forces on the unknowns.
    moves : (n,) bool array
        Unknowns that are no positions.
    held : (c,) bool array
        Contacts whose force was between its bounds in the last step.
    speed, low, high, restitution, target, impulse : (c,) arrays
        Of the contacts.
    coupling : (c, c) array
        Change of the relative speeds by unit impulses.
    """

    rates: np.ndarray
    moves: np.ndarray
    held: np.ndarray
    speed: np.ndarray
    low: np.ndarray
    high: np.ndarray
    restitution: np.ndarray
    target: np.ndarray
    impulse: np.ndarray
    coupling: np.ndarray


def work(system: SetValuedSystem) -> Work:
    """Work space for a system; no contact sticks yet."""
    contacts, n = system.directions.shape
    moves = np.ones(n, dtype=bool)
    moves[system.position_of[system.position_of >= 0]] = False
    speed, low, high, restitution, target, impulse = (np.zeros(contacts) for _ in range(6))
    held, coupling = np.zeros(contacts, dtype=bool), system.directions @ system.response
    return Work(np.zeros(n), moves, held, speed, low, high, restitution, target, impulse, coupling)


@kernel
def _project(work: Work, step: float, counts: np.ndarray) -> bool:
    """Impulses between their bounds and the relative speeds that go with them; `speed` without impulses."""
    contacts = work.speed.size
    work.impulse[:] = 0.0
    largest = 1e-300
    for i in range(contacts):
        largest = max(largest, abs(work.speed[i]), abs(work.target[i]))
    for _ in range(MOST_SWEEPS):
        counts[SOLVES] += 1
        change = 0.0
        for i in range(contacts):
            wanted = work.impulse[i] - (work.speed[i] - work.target[i]) / work.coupling[i, i]
            impulse = min(max(wanted, step * work.low[i]), step * work.high[i])
            for j in range(contacts):
                work.speed[j] += work.coupling[j, i] * (impulse - work.impulse[i])
            change = max(change, work.coupling[i, i] * abs(impulse - work.impulse[i]))
            work.impulse[i] = impulse
        if contacts == 1 or change <= SETTLED * largest:
            return True
    return False


@kernel
def _saturated(work: Work, step: float, i: int) -> bool:
    return work.impulse[i] <= step * work.low[i] or work.impulse[i] >= step * work.high[i]


@kernel
def _impulses(
    system: SetValuedSystem, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> int:
    """Impulses of the step; a second time with those let go that their larger bounds did not hold."""
    contacts = work.speed.size
    for _ in range(contacts + 1):
        if not system.bounds(
            system.constants, t, y, work.held, work.speed, work.low, work.high, work.restitution
        ):
            return NO_VALUE
        for i in range(contacts):
            work.target[i] = -work.restitution[i] * work.speed[i]
            for j in range(y.size):
                work.speed[i] += system.directions[i, j] * work.rates[j]
        if not _project(work, step, counts):
            return NO_CONVERGENCE
        released = False
        for i in range(contacts):
            if work.held[i] and _saturated(work, step, i):
                work.held[i], released = False, True
        if not released:
            return OK
    return OK


@kernel
def _advance(
    system: SetValuedSystem,
    control: FixedStep,
    step: float,
    t: float,
    y: np.ndarray,
    work: Work,
    counts: np.ndarray,
) -> int:
    middle = t + 0.5 * step
    for i in range(y.size):
        if system.position_of[i] >= 0:
            y[system.position_of[i]] += 0.5 * step * y[i]
    counts[RATES] += 1
    if not system.rates(system.constants, middle, y, work.rates):
        return NO_VALUE
    for i in range(y.size):
        work.rates[i] = step * work.rates[i] if work.moves[i] else 0.0
    outcome = _impulses(system, step, middle, y, work, counts)
    if outcome != OK:
        return outcome
    for i in range(y.size):
        y[i] += work.rates[i]
        for c in range(work.impulse.size):
            y[i] += system.response[i, c] * work.impulse[c]
    for c in range(work.impulse.size):
        work.held[c] = not _saturated(work, step, c)
    for i in range(y.size):
        if system.position_of[i] >= 0:
            y[system.position_of[i]] += 0.5 * step * y[i]
    return OK


march = partial(march_in_equal_steps, _advance)
