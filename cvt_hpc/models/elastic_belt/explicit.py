"""The plain explicit step of the elastic belt: symplectic Euler, the judge of faster ones."""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import (
    DRIVEN_POSITION,
    DRIVEN_SPEED,
    LAYER_WORK,
    N_ELEMENT,
    TIME,
    V_ELEMENT,
    V_FILTERED,
    V_RING,
    Belt,
    State,
    U,
    W,
)
from cvt_hpc.models.elastic_belt.rhs import (
    accelerations,
    contact_forces,
    content_rates,
    load_at,
    memory_rates,
    strains,
)
from cvt_hpc.physics.compliance import ContactState


@kernel
def step_explicit(
    belt: Belt,
    state: State,
    contacts: tuple[ContactState, ContactState],
    work: np.ndarray,
    step: float,
) -> int:
    """One step: velocities by the forces of the present state, then positions by the new velocities.

    Parameters
    ----------
    belt, state, contacts
        Constants, state (advanced in place) and the contact solver's memory.
    work : (10, N) array
        Work space.
    step : float
        Step [s]; stable below 2 / (largest rate), some 0.2 us with the default belt.

    Returns
    -------
    int
        Solves of the contact problem; 0 where it failed.
    """
    force, eps, rate = work[0], work[1:3], work[3:10]
    fields, scalars = state.fields, state.scalars
    solves = contact_forces(belt, state, contacts, force)
    strains(belt, fields, eps)
    moment = accelerations(belt, state, force, eps, rate)
    axial = driven_thrust(belt, force)

    scalars[LAYER_WORK] += step * damper_power(belt, fields, eps, rate, step)
    for row in (U, V_ELEMENT, V_RING):
        fields[row] += step * rate[row]
    load = belt.ratio * load_at(belt, scalars[TIME])
    scalars[DRIVEN_SPEED] += step * (moment - load) / belt.driven_inertia

    memory_rates(belt, state, rate)
    content_rates(belt, state, eps, rate)
    fields[W] += step * fields[U]
    for row in range(V_FILTERED, N_ELEMENT + 2):
        fields[row] += step * rate[row]
    scalars[DRIVEN_POSITION] += step * (axial - belt.thrust) / belt.axial_damping
    scalars[TIME] += step
    return solves


@kernel
def damper_power(belt: Belt, fields: np.ndarray, eps: np.ndarray, rate: np.ndarray, step: float) -> float:
    """Power of the layers' dampers in a step [W]: forces at its start times the mean closing speeds."""
    n = belt.cell.size
    power = 0.0
    for layer in range(2):
        v, change = fields[V_ELEMENT + layer], rate[V_ELEMENT + layer]
        damper = belt.ring_damping if layer else belt.element_damping
        for c in range(n):
            b = c + 1 if c < n - 1 else 0
            damped = damper * (v[b] - v[c]) / belt.cell[c]
            if layer == 0:
                # as in `accelerations`: elements that are apart have none, and it never makes them pull
                damped = (
                    min(damped, max(-belt.element_stiffness * eps[0, c], 0.0)) if eps[0, c] < 0.0 else 0.0
                )
            power += damped * (v[b] - v[c] + 0.5 * step * (change[b] - change[c]))
    return power


@kernel
def driven_thrust(belt: Belt, force: np.ndarray) -> float:
    """Axial force of the belt on the driven sheave [N]."""
    first = belt.driven_start
    total = 0.0
    for k in range(belt.driven.weight.size):
        total += belt.driven.weight[k] * force[first + k]
    return total
