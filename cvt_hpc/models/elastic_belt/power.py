"""Where power enters and leaves the belt drive, and what it stores: the audit of a run.

In a steady state, on average over a vibration,

    driving = load + thrust + losses,    losses = flanks + rings + belt + layers + lag + seating,

and before that the difference is what the stored energy takes up. What does not close is the work of the
numerics: upwinded transport, backward Euler in the layers, and the linear stretch that leaves the product of
changing tension and slope squared out.

Seating is what the belt carries out of the sheaves' elastic contact at an outlet beyond what it brings in at
the inlet. Contact begins and ends at the arcs' ends here, with forces that are not zero; along an arc the
elastic forces do no work on the whole, whatever the belt's speed, since the compliance depends on the
distance of two stations alone.
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import (
    DRIVEN_POSITION,
    DRIVEN_SPEED,
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
from cvt_hpc.models.elastic_belt.flank import flank_forces, sliding
from cvt_hpc.models.elastic_belt.rhs import damping_at, load_at, ring_drag
from cvt_hpc.physics.friction import friction_coefficient

POWERS = (
    "driving_power",
    "load_power",
    "thrust_power",
    "driving_flank_loss",
    "driven_flank_loss",
    "ring_loss",
    "belt_loss",
    "layer_loss",
    "lag_loss",
    "seating_loss",
    "stored_energy",
)
(
    DRIVING_POWER,
    LOAD_POWER,
    THRUST_POWER,
    DRIVING_FLANK_LOSS,
    DRIVEN_FLANK_LOSS,
    RING_LOSS,
    BELT_LOSS,
    LAYER_LOSS,
    LAG_LOSS,
    SEATING_LOSS,
    STORED_ENERGY,
) = range(len(POWERS))


@kernel
def audit(
    belt: Belt, state: State, force: np.ndarray, eps: np.ndarray, axial: float, out: np.ndarray
) -> None:
    """Powers [W] and stored energy [J] of a state.

    Parameters
    ----------
    belt, state
        Constants and state.
    force : (N,) array
        Axial line forces of the flanks [N/m].
    eps : (2, N) array
        Strains of the cells.
    axial : float
        Axial force of the belt on the driven sheave [N].
    out : (11,) array
        Result, in the order of POWERS.
    """
    n = belt.cell.size
    w, u = state.fields[W], state.fields[U]
    v0, v1, vf = state.fields[V_ELEMENT], state.fields[V_RING], state.fields[V_FILTERED]
    driven_speed = state.scalars[DRIVEN_SPEED]
    sine, cosine = np.sin(belt.half_wedge_angle), np.cos(belt.half_wedge_angle)
    wedge = 2.0 * sine / cosine
    damping = damping_at(belt, state.scalars[TIME])
    axial_speed = (axial - belt.thrust) / belt.axial_damping
    out[:] = 0.0
    out[LOAD_POWER] = belt.ratio * load_at(belt, state.scalars[TIME]) * driven_speed
    out[THRUST_POWER] = belt.thrust * axial_speed
    out[LAG_LOSS] = belt.axial_damping * axial_speed * axial_speed
    stored = 0.5 * belt.driven_inertia * driven_speed * driven_speed
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        left, right, dual = belt.cell[a], belt.cell[j], belt.dual[j]
        v_radial = u[j] + v0[j] * (w[b] - w[a]) / (left + right)
        out[BELT_LOSS] += dual * damping * v_radial * v_radial
        bending = 0.0
        for k in range(5):
            bending += belt.bending[j, k] * w[(j + k - 2) % n]
        stored += (
            0.5
            * dual
            * (
                belt.element_mass * v0[j] * v0[j]
                + belt.ring_mass[j] * v1[j] * v1[j]
                + belt.mass * u[j] * u[j]
                - w[j] * bending
            )
        )
        for layer in range(2):
            stiffness = belt.ring_stiffness if layer else belt.element_stiffness
            if layer == 0 and eps[0, j] >= 0.0:
                continue
            content = state.fields[N_ELEMENT + layer, j]
            stored += 0.5 * right * content * stiffness * eps[layer, j] * eps[layer, j]
            v = state.fields[V_ELEMENT + layer]
            damper = belt.ring_damping if layer else belt.element_damping
            out[LAYER_LOSS] += damper * (v[b] - v[j]) * (v[b] - v[j]) / right
        share = belt.arc_share[j]
        if share == 0.0:
            continue
        driven = j >= belt.driven_start
        radius = (belt.driven_radius if driven else belt.driving_radius) + w[j]
        omega = driven_speed if driven else belt.driving_speed
        v_tangential = v0[j] - omega * radius
        v_law = sliding(v_radial, v_tangential, cosine)[0] if belt.friction_memory == 0.0 else vf[j]
        coefficient, _ = friction_coefficient(belt.law, v_law, force[j] / cosine)
        radial, tangential, _, _ = flank_forces(
            coefficient, belt.friction_speed, sine, cosine, force[j], v_radial, v_tangential
        )
        rubbing = tangential * v_tangential + (radial - wedge * force[j]) * v_radial
        out[SEATING_LOSS] -= share * dual * wedge * force[j] * (v_radial - u[j])
        out[DRIVEN_FLANK_LOSS if driven else DRIVING_FLANK_LOSS] -= share * dual * rubbing
        if not driven:
            out[DRIVING_POWER] += share * dual * tangential * radius * omega
        drag, sliding_speed = ring_drag(belt, j, a, eps, v0[j], v1[j])
        out[RING_LOSS] += dual * drag * sliding_speed
        opening = (state.scalars[DRIVEN_POSITION] if driven else belt.driving_position) + wedge * w[j]
        stored -= 0.5 * share * dual * force[j] * opening
    out[STORED_ENERGY] = stored
