"""Chains of ANCF elements that nothing holds, as whole matrices, and their definition for complex numbers."""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.multibody.ancf_beam import PER_NODE
from cvt_hpc.multibody.ancf_equations import (
    SIZE,
    assemble,
    begin_stage,
    chain,
    correct,
    finish_stage,
    place,
    set_up,
)
from cvt_hpc.solvers.cyclic_blocks import LOWER, UPPER, factor, solve
from cvt_hpc.solvers.generalised_alpha import stage_length

INSTANT = 1e-12  # [s]: a stage so short that nothing but mass counts in its matrix


@kernel
def accelerate(beam, chain):
    """Find the accelerations of a chain; without them the first step errs by its size. Whether they were found."""
    assemble(beam, chain.work, chain.q, chain.v, chain.v, INSTANT, chain.blocks, chain.columns, 0)
    if not factor(chain.blocks, SIZE):
        return False
    solve(chain.blocks, chain.columns, SIZE)
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            chain.dv[i, k] = chain.columns.data[i, k, 0] / INSTANT
    return True


@kernel
def advance(beam, chain, scheme, dt, steps, tolerance, most):
    """Advance a chain by steps of dt [s]; the steps done, fewer where a stage was not solved.

    A stage is solved when no correction of a speed is beyond a tolerance [m/s], after so many at most.
    """
    tau = stage_length(scheme, dt)
    for step in range(steps):
        begin_stage(chain, scheme, dt)
        solved = False
        for _ in range(most):
            place(chain, tau)
            set_up(beam, chain, tau, 0)
            if not factor(chain.blocks, SIZE):
                return step
            solve(chain.blocks, chain.columns, SIZE)
            largest = correct(chain, 0)
            solved = largest <= tolerance
            if solved or not np.isfinite(largest):
                break
        if not solved:
            return step
        finish_stage(chain, scheme, dt)
    return steps


def equations(beam, q, u, start=None, tau=INSTANT, power=False):
    """Matrix (4 n, 4 n) and right-hand side (4 n,) of a correction; by default the forces, as tau is tiny.

    With `power` what damping takes instead [W].
    """
    work = chain(q, u)
    start = work.v if start is None else start
    lost = assemble(beam, work.work, work.q, work.v, start, tau, work.blocks, work.columns, 0)
    if power:
        return lost
    return whole(work.blocks), work.columns.data[:-1, :, 0].ravel().copy()


def whole(blocks):
    """Matrix (4 n, 4 n) of the blocks of a closed chain, or an open one."""
    n = blocks.data.shape[0] - 1
    matrix = np.zeros((n, PER_NODE, n, PER_NODE))
    for i in range(n):
        for block, j in ((0, i), (LOWER, i - 1), (UPPER, (i + 1) % n)):
            matrix[i, :, j] += blocks.data[i, PER_NODE * block : PER_NODE * (block + 1)]
    return matrix.reshape(PER_NODE * n, -1)


def mass_and_stiffness(beam, q):
    """Matrices (4 n, 4 n) of small motions about rest at q, without damping."""
    rest = np.zeros_like(q)
    mass = equations(beam._replace(axial_stiffness=0.0, bending_stiffness=0.0), q, rest, tau=1.0)[0]
    return mass, equations(beam, q, rest, tau=1.0)[0] - mass


def straight(lengths, stretch=1.0):
    """Nodes (k + 1, 4) of an open chain along x."""
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    nothing = np.zeros_like(s)
    return np.stack([stretch * s, nothing, stretch + nothing, nothing], 1)


def ring(lengths, stretch=1.0):
    """Nodes (k, 4) of a closed chain on a circle."""
    angle = 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) / lengths.sum()
    radius, c, s = stretch * lengths.sum() / (2.0 * np.pi), np.cos(angle), np.sin(angle)
    return np.stack([radius * c, radius * s, -stretch * s, stretch * c], 1)


# The definition, for complex numbers: a derivative by a complex step is exact.


def _points(beam, q, count=7):
    """Places, weights, and r, r', r'' at Gauss points of each element."""
    x, weight = np.polynomial.legendre.leggauss(count)
    x, weight = 0.5 + 0.5 * x, 0.5 * weight
    hermite = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
    for i, l0 in enumerate(beam.lengths):
        a, b = q[i], q[(i + 1) % len(q)]
        ends = np.stack([a[:2], l0 * a[2:], b[:2], l0 * b[2:]])
        along = [np.polynomial.Polynomial(c) for c in (hermite.T @ ends).T]
        yield (
            x,
            l0 * weight,
            *(np.stack([c.deriv(k)(x) if k else c(x) for c in along], -1) / l0**k for k in range(3)),
        )


def nearest_line(x, weight, values):
    """Projection on 1 and x in the mean square."""
    basis = np.stack([x**0, x])
    return np.linalg.solve(basis * weight @ basis.T, basis * weight @ values) @ basis


def potential(beam, q):
    total = 0.0
    for _, w, r, slope, bend in _points(beam, q):
        strain = 0.5 * ((slope**2).sum(-1) - 1.0)
        stored = 0.5 * beam.axial_stiffness * strain**2 + 0.5 * beam.bending_stiffness * (bend**2).sum(-1)
        total += (w * (stored - beam.line_mass * r @ np.array(beam.gravity))).sum()
    return total


def lost(beam, q, u):
    """Power that damping takes, for real q."""
    total = 0.0
    bends, moved = (list(_points(beam, nodes)) for nodes in (q, u))
    for (x, w, _, slope, bend), (*_, turn, bending) in zip(bends, moved, strict=True):
        rate = (slope * turn).sum(-1)
        bent = nearest_line(x, w, cross(turn, bend) + cross(slope, bending))
        power = beam.axial_damping * rate**2
        power = power + beam.bending_damping * beam.bending_stiffness * bent**2
        total += (w * power).sum()
    bends, moved = (_points(beam, nodes, 2) for nodes in (q, u))
    for (_, w, _, slope, _), (_, _, speed, *_) in zip(bends, moved, strict=True):
        across = cross(slope, speed) / np.sqrt((slope**2).sum(-1))
        total += (w * beam.mass_damping * beam.line_mass * across**2).sum()
    return total


def kinetic(beam, u):
    return sum((0.5 * beam.line_mass * w * (speed**2).sum(-1)).sum() for _, w, speed, *_ in _points(beam, u))


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def gradient(function, at):
    """Derivatives of a function of an (n, 4) array, (4 n,)."""
    found = np.empty(at.size)
    for k in range(at.size):
        moved = at.astype(complex)
        moved.ravel()[k] += 1e-30j
        found[k] = np.imag(function(moved)) / 1e-30
    return found
