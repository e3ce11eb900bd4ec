"""Elastic sheaves under the belt: the unilateral contact of one wrap, solved exactly in linear time.

Stations j of a wrap carry axial line forces f_j [N/m] and leave gaps g_j [m] (Bullinger et al. 2005, eqs
33-35):

    g_j = G_j + f_j / c_e + a (y_j + U_j . t),   f_j >= 0,  g_j >= 0,  f_j g_j = 0,

G_j the gap of the rigid bodies (negative: overlap), c_e the axial stiffness of the elements per length, a the
compliance of the sheaves (1 reference, 0 rigid), y the local bending and t the tilt about two axes,

    y_j = sum_k exp(-|x_j - x_k| / l) / (2 l k) h_k f_k,
    t = r^2 / c_tilt sum_k U_k h_k f_k,   U = (cos phi, sin phi),

h_k the length that station k stands for. The kernel's inverse is tridiagonal (Markov), the tilt is of rank
two; so for a given set of closed stations the solution takes one tridiagonal solve and a 2x2 system. The set
is found by flipping every station that violates its sign, warm from the last set, and, should that not
settle, by flipping the first violator only, which ends for every P-matrix (Murty 1974); this matrix is
symmetric positive definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.physics.sheaves import Sheaves

ROUNDS_OF_BLOCK_FLIPS = 10
FORCE_ROUND_OFF = 1e-6  # [N/m]: forces are 1e5, double precision leaves 1e-10


class ContactState(NamedTuple):
    """What the solver keeps between calls: the closed set and what only depends on it.

    Attributes
    ----------
    closed : (m,) bool array
        Stations in contact.
    pivot, multiplier : (m,) arrays
        Factors of the tridiagonal matrix for that set.
    response : (2, m) array
        U - a A^-1 [h c_e a closed U]: what a unit tilt opens at each station, local bending included.
    inverse : (2, 2) array
        Inverse of the tilt's 2x2 system.
    y : (m,) array
        Work space; the local bending of the last solution.
    push : (m,) array
        -c_e times the opening without f / c_e: the force where closed, positive where an open station
        overlaps [N/m].
    fresh : (1,) bool array
        False until the factors belong to `closed`.
    """

    closed: np.ndarray
    pivot: np.ndarray
    multiplier: np.ndarray
    response: np.ndarray
    inverse: np.ndarray
    y: np.ndarray
    push: np.ndarray
    fresh: np.ndarray


def contact_state(stations: int) -> ContactState:
    """Fresh state for a wrap of `stations` stations, all closed."""
    return ContactState(
        np.ones(stations, dtype=np.bool_),
        np.zeros(stations),
        np.zeros(stations),
        np.zeros((2, stations)),
        np.zeros((2, 2)),
        np.zeros(stations),
        np.zeros(stations),
        np.zeros(1, dtype=np.bool_),
    )


@merged_kernel
def _bend(sheave: Sheaves, state: ContactState) -> None:
    """Solve the tridiagonal system in place of `state.y`."""
    y, m = state.y, state.y.size
    for j in range(1, m):
        y[j] -= state.multiplier[j] * y[j - 1]
    y[m - 1] *= state.pivot[m - 1]
    for j in range(m - 2, -1, -1):
        y[j] = y[j] * state.pivot[j] - state.multiplier[j + 1] * y[j + 1]


@kernel
def _factorise(sheave: Sheaves, state: ContactState) -> None:
    """Factors and tilt responses for the present closed set."""
    m = sheave.weight.size
    a, ce, off = sheave.compliance, sheave.element_stiffness, sheave.off_diagonal
    for j in range(m):
        d = sheave.diagonal[j] + (sheave.weight[j] * ce * a if state.closed[j] else 0.0)
        if j > 0:
            state.multiplier[j] = off * state.pivot[j - 1]
            d -= off * state.multiplier[j]
        state.pivot[j] = 1.0 / d
    for b in range(2):
        for j in range(m):
            state.y[j] = sheave.weight[j] * ce * a * sheave.tilt[b, j] if state.closed[j] else 0.0
        _bend(sheave, state)
        for j in range(m):
            state.response[b, j] = sheave.tilt[b, j] - state.y[j]
    gain = sheave.tilt_compliance * ce
    s00, s01, s11 = 1.0, 0.0, 1.0
    for j in range(m):
        if state.closed[j]:
            h = a * gain * sheave.weight[j]
            s00 += h * sheave.tilt[0, j] * state.response[0, j]
            s01 += h * sheave.tilt[0, j] * state.response[1, j]
            s11 += h * sheave.tilt[1, j] * state.response[1, j]
    determinant = s00 * s11 - s01 * s01
    state.inverse[0, 0], state.inverse[1, 1] = s11 / determinant, s00 / determinant
    state.inverse[0, 1] = state.inverse[1, 0] = -s01 / determinant
    state.fresh[0] = True


@merged_kernel
def _forces(sheave: Sheaves, state: ContactState, gap: np.ndarray) -> int:
    """`push` for the present closed set; returns the number of stations on the wrong side."""
    m = gap.size
    a, ce = sheave.compliance, sheave.element_stiffness
    for j in range(m):
        state.y[j] = -sheave.weight[j] * ce * gap[j] if state.closed[j] else 0.0
    _bend(sheave, state)
    p0 = p1 = 0.0
    for j in range(m):
        if state.closed[j]:
            overlap = sheave.weight[j] * (gap[j] + a * state.y[j])
            p0 -= sheave.tilt[0, j] * overlap
            p1 -= sheave.tilt[1, j] * overlap
    gain = sheave.tilt_compliance * ce
    t0 = gain * (state.inverse[0, 0] * p0 + state.inverse[0, 1] * p1)
    t1 = gain * (state.inverse[1, 0] * p0 + state.inverse[1, 1] * p1)
    wrong = 0
    for j in range(m):
        opening = gap[j] + a * (state.y[j] + t0 * state.response[0, j] + t1 * state.response[1, j])
        state.push[j] = -ce * opening
        wrong += _wrong_side(state, j)
    return wrong


@merged_kernel
def _wrong_side(state: ContactState, j: int) -> bool:
    """A closed station that pulls or an open one that overlaps, beyond round-off."""
    return state.push[j] < -FORCE_ROUND_OFF if state.closed[j] else state.push[j] > FORCE_ROUND_OFF


@merged_kernel
def solve_contact(sheave: Sheaves, state: ContactState, gap: np.ndarray, force: np.ndarray) -> int:
    """Axial line forces of one wrap from the gaps of the rigid bodies.

    Parameters
    ----------
    sheave : Sheaves
        Constants of the wrap, m stations.
    state : ContactState
        Last closed set (where the search starts) and its factors; updated.
    gap : (m,) array
        G, negative where rigid bodies would overlap [m].
    force : (m,) array
        Result f >= 0 [N/m].

    Returns
    -------
    int
        Number of linear solves taken (1 where the set has not changed); 0 if the search did not end, which
        happens for gaps that are not numbers only.
    """
    m = gap.size
    for round_ in range(ROUNDS_OF_BLOCK_FLIPS + 10 * m):
        if not state.fresh[0]:
            _factorise(sheave, state)
        if _forces(sheave, state, gap) == 0:
            finite = True
            for j in range(m):
                finite &= np.isfinite(state.push[j])
                force[j] = max(state.push[j], 0.0) if state.closed[j] else 0.0
            return round_ + 1 if finite else 0
        for j in range(m):
            if _wrong_side(state, j):
                state.closed[j] = not state.closed[j]
                if round_ >= ROUNDS_OF_BLOCK_FLIPS:
                    break
        state.fresh[0] = False
    return 0
