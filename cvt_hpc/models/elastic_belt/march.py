"""Many steps and samples in one call: one loop per step kernel, since a kernel is compiled for its callee."""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.explicit import step_explicit
from cvt_hpc.models.elastic_belt.imex import ImexWork, step_imex
from cvt_hpc.models.elastic_belt.sampling import Sensors, sample
from cvt_hpc.physics.compliance import ContactState


@kernel
def march_imex(
    belt: Belt,
    state: State,
    contacts: tuple[ContactState, ContactState],
    work: ImexWork,
    step: float,
    steps: int,
    sensing: Sensors,
    rows: np.ndarray,
    profiles: np.ndarray,
    scratch: np.ndarray,
    counts: np.ndarray,
) -> int:
    """Fill `rows` with samples, `steps` steps before each.

    Parameters
    ----------
    belt, state, contacts, work
        As the step kernel takes them.
    step, steps : float, int
        Step [s] and their number between samples.
    sensing, profiles, scratch
        As `sample` takes them.
    rows : (samples, S + C) array
        One row for each sample.
    counts : (3,) int array
        Samples, steps and solves of the contact problem are added to it.

    Returns
    -------
    int
        An `Outcome`; unless it is OK, the march ended before the sample that is not counted.
    """
    for k in range(rows.shape[0]):
        for _ in range(steps):
            solves = step_imex(belt, state, contacts, work, step)
            if solves == 0:
                return 1
            counts[1] += 1
            counts[2] += solves
        outcome = sample(belt, state, contacts, sensing, rows[k], profiles, scratch)
        if outcome != 0:
            return outcome
        counts[0] += 1
    return 0


@kernel
def march_explicit(
    belt: Belt,
    state: State,
    contacts: tuple[ContactState, ContactState],
    work: np.ndarray,
    step: float,
    steps: int,
    sensing: Sensors,
    rows: np.ndarray,
    profiles: np.ndarray,
    scratch: np.ndarray,
    counts: np.ndarray,
) -> int:
    """As `march_imex`, with the explicit step and its work space (10, N)."""
    for k in range(rows.shape[0]):
        for _ in range(steps):
            solves = step_explicit(belt, state, contacts, work, step)
            if solves == 0:
                return 1
            counts[1] += 1
            counts[2] += solves
        outcome = sample(belt, state, contacts, sensing, rows[k], profiles, scratch)
        if outcome != 0:
            return outcome
        counts[0] += 1
    return 0
