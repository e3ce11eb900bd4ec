"""The fast step of the elastic belt: explicit in the strands, implicit in friction and longitudinal waves.

Staggered in time: w, n_i, v_f, z at t_k; u, v_i, omega at t_k-1/2. Transverse forces are explicit (leapfrog,
no numerical damping of the strands). Flank and ring friction enter with their slopes, the stresses T and P by
backward Euler, so neither the regularisation of friction nor the longitudinal waves (5-6 km/s) limit the
step. Eliminating u and the content leaves one cyclic block-tridiagonal system, 2x2 blocks (v_element,
v_ring), symmetric positive definite; the content then follows from the fluxes, so that each layer's total is
kept to round-off.

First order in the longitudinal part: it damps pressed elements like EA dt / 2 [N s]. The set of separated
elements is frozen during a step: those that are apart and, with the old speeds, stay apart. What limits the
step is accuracy, c dt / h about 5, and the transverse contact and bending.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
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
from cvt_hpc.models.elastic_belt.explicit import driven_thrust
from cvt_hpc.models.elastic_belt.flank import flank_forces, sliding
from cvt_hpc.models.elastic_belt.rhs import (
    contact_forces,
    damping_at,
    load_at,
    memory_transport,
    strains,
)
from cvt_hpc.physics.compliance import ContactState
from cvt_hpc.physics.friction import formula_coefficient, friction_coefficient, saturation

MOST_PASSES = 3  # one, unless friction turns sliding about; a third where the second turns others


class ImexWork(NamedTuple):
    """Work space of the step; `last_u` is u one step earlier, the rest is scratch.

    Attributes
    ----------
    force, last_u : (N,) arrays
        Axial line force; u at t_k-3/2.
    eps : (2, N) array
        Strains in the cells.
    stress : (2, N) array
        Predicted longitudinal stress resultants T and -P in the cells [N].
    link : (2, N) array
        Their slope with the difference of the speeds at both ends [N s/m].
    diagonal : (3, N) array
        Diagonal blocks (element, coupling, ring), then their inverted pivots.
    right : (2, N) array
        Right-hand sides, then the solution: increments of v_element and v_ring [m/s].
    border : (4, N) array
        Coupling to the last station, which closes the cycle.
    radial : (3, N) array
        Pending increment of u, its sensitivity to v_element's, slope w_s.
    flank : (3, N) array
        Tangential flank force and its slopes with v_element and u.
    sliding : (2, N) array
        Radial and tangential sliding speed at the old state [m/s].
    reversing : (N,) bool array
        Stations that the linearised friction of this step would throw back.
    """

    force: np.ndarray
    last_u: np.ndarray
    eps: np.ndarray
    stress: np.ndarray
    link: np.ndarray
    diagonal: np.ndarray
    right: np.ndarray
    border: np.ndarray
    radial: np.ndarray
    flank: np.ndarray
    sliding: np.ndarray
    reversing: np.ndarray


def imex_work(state: State) -> ImexWork:
    """Work space for a state of N stations."""
    n = state.fields.shape[1]
    scratch = (np.zeros((k, n)) for k in (2, 2, 2, 3, 2, 4, 3, 3, 2))
    return ImexWork(np.zeros(n), state.fields[U].copy(), *scratch, np.zeros(n, dtype=np.bool_))


@merged_kernel
def implicit_share(rate: float) -> float:
    """Weight of a slope in the step: 1/2 (time-centred) where slow, 1 where stiff; rate = dt x slope / mass.

    The linearised step then multiplies the velocity by an approximation of exp(-rate) that never changes
    sign.
    """
    return 0.5 + rate / (12.0 + 2.0 * rate)


@kernel
def step_imex(
    belt: Belt,
    state: State,
    contacts: tuple[ContactState, ContactState],
    work: ImexWork,
    step: float,
) -> int:
    """One step.

    Parameters
    ----------
    belt, state, contacts, work
        Constants, state (advanced in place), the contact solver's memory, work space.
    step : float
        Step [s].

    Returns
    -------
    int
        Solves of the contact problem; 0 where it failed.
    """
    solves = contact_forces(belt, state, contacts, work.force)
    strains(belt, state.fields, work.eps)
    work.reversing[:] = False
    for _ in range(MOST_PASSES):
        _stations(belt, state, work, step)
        _cells(belt, state, work, step)
        _solve_cyclic(work)
        if not _reversals(belt, work):
            break
    moment = _advance(belt, state, work, step)
    scalars = state.scalars
    load = belt.ratio * load_at(belt, scalars[TIME])
    scalars[DRIVEN_SPEED] += step * (moment - load) / belt.driven_inertia
    axial = driven_thrust(belt, work.force)
    scalars[DRIVEN_POSITION] += step * (axial - belt.thrust) / belt.axial_damping
    scalars[TIME] += step
    return solves


@merged_kernel
def _stations(belt: Belt, state: State, work: ImexWork, step: float) -> None:
    """Forces and slopes at the stations: `radial`, `flank`, `diagonal`, `right`, but for the stresses."""
    n = belt.cell.size
    w, u = state.fields[W], state.fields[U]
    v0, v1, vf = state.fields[V_ELEMENT], state.fields[V_RING], state.fields[V_FILTERED]
    eps = work.eps
    # plain numbers and arrays: handing the whole belt to a call in the loop costs more than the call
    sine, cosine = np.sin(belt.half_wedge_angle), np.cos(belt.half_wedge_angle)
    law, width, memory = belt.law, belt.friction_speed, belt.friction_memory
    kind, kinetic, gradient, scale = law.kind, law.kinetic, law.gradient, law.speed
    cell, dual_cell, curvature, bending = belt.cell, belt.dual, belt.curvature, belt.bending
    per_cell, per_dual, per_span = belt.per_cell, belt.per_dual, belt.per_span
    arc_share, arc_curvature, ring_masses = belt.arc_share, belt.arc_curvature, belt.ring_mass
    ring_stiffness, element_stiffness = belt.ring_stiffness, belt.element_stiffness
    element_mass, mass, ring_offset = belt.element_mass, belt.mass, belt.ring_offset
    ring_friction, ring_width = belt.ring_friction, belt.ring_friction_speed
    driven_start, driven_radius, driving_radius = belt.driven_start, belt.driven_radius, belt.driving_radius
    driven_speed, driving_speed = state.scalars[DRIVEN_SPEED], belt.driving_speed
    force, last_u = work.force, work.last_u
    radial_row, flank_row, diagonal, right_hand = work.radial, work.flank, work.diagonal, work.right
    sliding_row, reversing = work.sliding, work.reversing
    speed_squared = belt.belt_speed * belt.belt_speed
    centrifugal = belt.mass * belt.belt_speed * belt.belt_speed
    gyroscopic = 2.0 * belt.mass * belt.belt_speed
    damping = damping_at(belt, state.scalars[TIME])
    per_step = 1.0 / step
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        aa, bb = a - 1 if a > 0 else n - 1, b + 1 if b < n - 1 else 0
        left, right, dual = cell[a], cell[j], dual_cell[j]
        per_left, per_right, span = per_cell[a], per_cell[j], per_span[j]
        ring_left, ring_right = ring_stiffness * eps[1, a], ring_stiffness * eps[1, j]
        net_left = ring_left + element_stiffness * min(eps[0, a], 0.0) - centrifugal
        net_right = ring_right + element_stiffness * min(eps[0, j], 0.0) - centrifugal
        slope = (w[b] - w[a]) * span
        # u at t_k, extrapolated: the gyroscopic term then neither damps nor feeds
        change = 1.5 * (u[b] - u[a]) - 0.5 * (last_u[b] - last_u[a])
        inward = net_right * right * curvature[j] + net_left * left * curvature[a]
        transverse = (
            (net_right * (w[b] - w[j]) * per_right - net_left * (w[j] - w[a]) * per_left - 0.5 * inward)
            * per_dual[j]
            - gyroscopic * change * span
            + bending[j, 0] * w[aa]
            + bending[j, 1] * w[a]
            + bending[j, 2] * w[j]
            + bending[j, 3] * w[b]
            + bending[j, 4] * w[bb]
        )
        v_radial = u[j] + v0[j] * slope
        outward = -damping * v_radial
        radial_mass = mass * per_step + 0.5 * damping
        element, ring, coupling = element_mass * per_step, ring_masses[j] * per_step, 0.0
        along_element = -v0[j] * (v0[j] - v0[a]) * per_left * element_mass
        along_ring = -v1[j] * (v1[j] - v1[a]) * per_left * ring_masses[j]
        cross = 0.0
        share = arc_share[j]
        if share > 0.0:
            driven = j >= driven_start
            radius = (driven_radius if driven else driving_radius) + w[j]
            omega = driven_speed if driven else driving_speed
            v_tangential = v0[j] - omega * radius
            speed, meridian = sliding(v_radial, v_tangential, cosine)
            v_law = speed if memory == 0.0 else vf[j]
            if kind == 5:
                coefficient, _ = friction_coefficient(law, v_law, force[j] / cosine)
            else:
                coefficient, _ = formula_coefficient(kind, kinetic, gradient, scale, v_law)
            radial, tangential, along, across = flank_forces(
                coefficient, width, sine, cosine, force[j], v_radial, v_tangential
            )
            outward += share * radial
            along_element += share * tangential
            rate = step * share / element_mass
            sliding_row[0, j], sliding_row[1, j] = v_radial, v_tangential
            if reversing[j]:
                # by the secant friction stops, and never throws back
                along = across
            along *= share * implicit_share(rate * along)
            across *= share * implicit_share(rate * across)
            c, s = meridian / speed, v_tangential / speed
            radial_mass += (along * c * c + across * s * s) / (cosine * cosine)
            cross = (along - across) * c * s / cosine
            tangential_slope = along * s * s + across * c * c
            element += tangential_slope
            flank_row[0, j], flank_row[1, j], flank_row[2, j] = share * tangential, tangential_slope, cross

            lever = 1.0 + ring_offset * arc_curvature[j]
            factor, stiff = saturation(lever * v0[j] - v1[j], ring_width)
            relief = ring_masses[j] * speed_squared
            pressure = max(ring_right - relief, 0.0) * right * curvature[j]
            pressure += max(ring_left - relief, 0.0) * left * curvature[a]
            grip = ring_friction * 0.5 * pressure * per_dual[j]
            along_ring += grip * factor
            along_element -= lever * grip * factor
            stiff *= grip
            stiff *= implicit_share(step * stiff / ring_masses[j])
            ring += stiff
            element += lever * lever * stiff
            coupling = -lever * stiff
        along_element += outward * slope
        mobility = 1.0 / radial_mass
        push = (transverse + outward) * mobility
        lag = cross * mobility
        radial_row[0, j], radial_row[1, j], radial_row[2, j] = push, lag, slope
        diagonal[0, j] = dual * (element - cross * lag)
        diagonal[1, j] = dual * coupling
        diagonal[2, j] = dual * ring
        right_hand[0, j] = dual * (along_element - cross * push)
        right_hand[1, j] = dual * along_ring


@merged_kernel
def _cells(belt: Belt, state: State, work: ImexWork, step: float) -> None:
    """Stresses at the end of the step, predicted with the old speeds, and their slopes; into the stations."""
    n = belt.cell.size
    u, push = state.fields[U], work.radial[0]
    for layer in range(2):
        v, eps = state.fields[V_ELEMENT + layer], work.eps[layer]
        content = state.fields[N_ELEMENT + layer]
        stiffness = belt.ring_stiffness if layer else belt.element_stiffness
        damper = belt.ring_damping if layer else belt.element_damping
        for c in range(n):
            a, b = c - 1 if c > 0 else n - 1, c + 1 if c < n - 1 else 0
            inverse = 1.0 / (content[c] * belt.cell[c])
            stretch = 1.0 + eps[c]
            widening = 0.5 * belt.curvature[c] * belt.cell[c] * (u[c] + push[c] + u[b] + push[b])
            outflow = v[b] - v[c] * stretch / (1.0 + eps[a])
            ahead = eps[c] + step * inverse * (widening + outflow)
            if layer == 0 and eps[c] >= 0.0 and ahead >= 0.0:
                work.stress[0, c] = work.link[0, c] = 0.0
                continue
            viscous, grip = damper * (v[b] - v[c]) / belt.cell[c], damper / belt.cell[c]
            if layer == 0 and viscous > -stiffness * eps[c]:
                # elements never pull: their damper ends where it would outweigh the push force
                viscous, grip = -stiffness * min(eps[c], 0.0), 0.0
            work.stress[layer, c] = stiffness * ahead + viscous
            work.link[layer, c] = stiffness * step * inverse + grip
    for j in range(n):
        a = j - 1 if j > 0 else n - 1
        work.diagonal[0, j] += work.link[0, a] + work.link[0, j]
        work.diagonal[2, j] += work.link[1, a] + work.link[1, j]
        work.right[0, j] += work.stress[0, j] - work.stress[0, a]
        work.right[1, j] += work.stress[1, j] - work.stress[1, a]


@merged_kernel
def _solve_cyclic(work: ImexWork) -> None:
    """Solve the cyclic block-tridiagonal system in place of `right`, the last station as border."""
    n = work.right.shape[1]
    last = n - 1
    d, y, g, link = work.diagonal, work.right, work.border, work.link
    # Schur complement of the last station
    p, q, r = d[0, last], d[1, last], d[2, last]
    f0, f1 = y[0, last], y[1, last]
    # coupling of the present row to the last station (00, 01, 10, 11)
    c00, c01, c10, c11 = -link[0, last], 0.0, 0.0, -link[1, last]
    d00, d01, d11 = d[0, 0], d[1, 0], d[2, 0]
    y0, y1 = y[0, 0], y[1, 0]
    for j in range(last):
        e0, e1 = link[0, j], link[1, j]
        if j == last - 1:
            c00 -= e0
            c11 -= e1
        determinant = 1.0 / (d00 * d11 - d01 * d01)
        i00, i01, i11 = d11 * determinant, -d01 * determinant, d00 * determinant
        z0, z1 = i00 * y0 + i01 * y1, i01 * y0 + i11 * y1
        g00, g01 = i00 * c00 + i01 * c10, i00 * c01 + i01 * c11
        g10, g11 = i01 * c00 + i11 * c10, i01 * c01 + i11 * c11
        p -= c00 * g00 + c10 * g10
        q -= c00 * g01 + c10 * g11
        r -= c01 * g01 + c11 * g11
        f0 -= c00 * z0 + c10 * z1
        f1 -= c01 * z0 + c11 * z1
        d[0, j], d[1, j], d[2, j] = i00, i01, i11
        y[0, j], y[1, j] = z0, z1
        g[0, j], g[1, j], g[2, j], g[3, j] = g00, g01, g10, g11
        d00, d01, d11 = (
            d[0, j + 1] - e0 * e0 * i00,
            d[1, j + 1] - e0 * e1 * i01,
            d[2, j + 1] - e1 * e1 * i11,
        )
        y0, y1 = y[0, j + 1] + e0 * z0, y[1, j + 1] + e1 * z1
        c00, c01, c10, c11 = e0 * g00, e0 * g01, e1 * g10, e1 * g11
    determinant = 1.0 / (p * r - q * q)
    x0, x1 = (r * f0 - q * f1) * determinant, (p * f1 - q * f0) * determinant
    y[0, last], y[1, last] = x0, x1
    n0, n1 = 0.0, 0.0
    for j in range(last - 1, -1, -1):
        e0, e1 = link[0, j] * n0, link[1, j] * n1
        n0 = y[0, j] - g[0, j] * x0 - g[1, j] * x1 + d[0, j] * e0 + d[1, j] * e1
        n1 = y[1, j] - g[2, j] * x0 - g[3, j] * x1 + d[1, j] * e0 + d[2, j] * e1
        y[0, j], y[1, j] = n0, n1


@merged_kernel
def _reversals(belt: Belt, work: ImexWork) -> bool:
    """Mark stations that slid in the saturated range and would now slide back; whether there are new ones.

    There the tangent of friction is flat, the step all but explicit, and a large friction force turns the
    sliding about within a step: it chatters, and takes energy out of nothing.
    """
    found = False
    for j in range(belt.cell.size):
        if belt.arc_share[j] > 0.0 and not work.reversing[j]:
            v_radial, v_tangential = work.sliding[0, j], work.sliding[1, j]
            dv = work.right[0, j]
            turn = v_radial * (work.radial[0, j] + (work.radial[2, j] - work.radial[1, j]) * dv)
            turn += v_tangential * dv
            speed_squared = v_radial * v_radial + v_tangential * v_tangential
            if speed_squared > belt.friction_speed * belt.friction_speed and turn < -speed_squared:
                work.reversing[j] = found = True
    return found


@merged_kernel
def _advance(belt: Belt, state: State, work: ImexWork, step: float) -> float:
    """Apply the increments; returns the moment of the flanks on the driven pulley [N m]."""
    n = belt.cell.size
    w, u = state.fields[W], state.fields[U]
    v0, v1 = state.fields[V_ELEMENT], state.fields[V_RING]
    moment = 0.0
    for j in range(n):
        dv = work.right[0, j]
        du = work.radial[0, j] - work.radial[1, j] * dv
        work.last_u[j] = u[j]
        u[j] += du
        v0[j] += dv
        v1[j] += work.right[1, j]
        if belt.arc_share[j] > 0.0 and j >= belt.driven_start:
            tangential = work.flank[0, j] - work.flank[1, j] * dv - work.flank[2, j] * du
            moment -= belt.dual[j] * tangential * (belt.driven_radius + w[j])
    if belt.friction_memory > 0.0:
        _advance_memory(belt, state, work.radial[2], step)
    for layer in range(2):
        v, eps, content = state.fields[V_ELEMENT + layer], work.eps[layer], state.fields[N_ELEMENT + layer]
        first = inflow = v[0] / (1.0 + eps[n - 1])
        for c in range(n):
            outflow = v[c + 1] / (1.0 + eps[c]) if c < n - 1 else first
            content[c] += step * (inflow - outflow) / belt.cell[c]
            inflow = outflow
    for j in range(n):
        w[j] += step * u[j]
    return moment


@merged_kernel
def _advance_memory(belt: Belt, state: State, slope: np.ndarray, step: float) -> None:
    """Filtered sliding speed by the exact exponential of its own rate, towards its new sliding speed."""
    w, u, v0, vf = state.fields[W], state.fields[U], state.fields[V_ELEMENT], state.fields[V_FILTERED]
    cosine = np.cos(belt.half_wedge_angle)
    forget = 1.0 / belt.friction_memory
    for driven in range(2):
        sheave = belt.driven if driven else belt.driving
        first = belt.driven_start if driven else 0
        radius = belt.driven_radius if driven else belt.driving_radius
        omega = state.scalars[DRIVEN_SPEED] if driven else belt.driving_speed
        carry = memory_transport(belt, belt.cell[first])
        decay = np.exp(-step * (carry + forget))
        upstream = 0.0
        for j in range(first, first + sheave.weight.size):
            v_tangential = v0[j] - omega * (radius + w[j])
            speed, _ = sliding(u[j] + v0[j] * slope[j], v_tangential, cosine)
            old = vf[j]
            target = (carry * upstream + forget * speed) / (carry + forget) if j > first else speed
            vf[j] = target + (old - target) * decay if j > first else speed
            upstream = old
