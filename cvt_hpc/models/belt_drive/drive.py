"""The belt on its pulleys: the moving parts, and the step in time.

Small free vibrations of a whole drive about an instant, with strands, arcs that stick and driven pulleys,
obey

    M u'' + K u = 0

over the coordinates of the belt's nodes and the angles of all pulleys but the first, with K the slope of all
elastic forces: those of the belt at its tensions, of contacts across the rim with their direction, and of
contacts that stick, which tie the belt to its pulley. Contacts that slide carry a friction that does not
change. Damping, and the effect of the belt's running (v^2 / c^2 of a frequency, 0.3 % of the default drive),
are left out, and arms stand still.

Strands that bend where they leave a pulley are curved there. So their vibration pulls at the belt to the
first order and turns the driven pulleys, as Kong and Parker (2003) found of serpentine drives.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix, lil_matrix
from scipy.sparse.linalg import eigsh

from cvt_hpc.kernels import kernel
from cvt_hpc.models.belt_drive import pulleys as rotating
from cvt_hpc.models.belt_drive.contact import Contact, Touch, add_contacts, first_touch
from cvt_hpc.models.belt_drive.friction import Memory, Treatment, begin_friction, finish_friction
from cvt_hpc.multibody.ancf_beam import PER_NODE, AncfBeam, at_places
from cvt_hpc.multibody.ancf_equations import (
    SIZE,
    Chain,
    assemble,
    begin_stage,
    chain,
    correct,
    finish_stage,
    place,
    set_up,
)
from cvt_hpc.solvers.cyclic_blocks import LOWER, UPPER, factor, solve_bordered
from cvt_hpc.solvers.generalised_alpha import Scheme, stage_length

STEPS, ITERATIONS, UNSOLVED = range(3)  # counters of a state

_STUCK = 1.5  # friction_speed: slower contacts stick
_TIED = 1e3  # times as stiff as contacts across the rim: the stiffness of ties
_LOWEST = 1.0  # [Hz]: modes below are the belt as it runs around


class Drive(NamedTuple):
    """Constants of a belt of k elements on P pulleys."""

    beam: AncfBeam  # of the belt
    pulleys: rotating.Pulleys  # the pulleys that it runs around
    contact: Contact  # between both


class State(NamedTuple):
    """Motion of a drive, and the work space of its steps."""

    chain: Chain  # of the belt's n = k nodes
    wheels: rotating.Wheels  # of the pulleys
    touch: Touch  # of the contacts
    # counters, totals, shapes (3,), of int, and (5 + P,): work done [J]
    counters: np.ndarray
    totals: np.ndarray


def state(
    drive: Drive, q: np.ndarray, v: np.ndarray, speeds: np.ndarray, angles: np.ndarray | None = None
) -> State:
    """Begin a motion of a drive.

    With positions [m, 1] and speeds [m/s, 1/s] of the belt, (n, 4) each, speeds of the pulleys, (P,) [rad/s],
    and angles of the arms, (A,) [rad]; by default as drawn.
    """
    count, n = len(speeds), len(q)
    drawn = np.zeros(len(drive.pulleys.arms.pivot))
    turning = rotating.wheels_at(drive.pulleys, speeds, drawn if angles is None else angles, n)
    belt, touch = chain(q, v, columns=turning.speed.shape[1]), first_touch(count, n, len(drive.contact.shape))
    return State(belt, turning, touch, np.zeros(3, np.int64), np.zeros_like(turning.power))


@kernel
def advance(
    drive: Drive,
    state: State,
    scheme: Scheme,
    inputs: np.ndarray,
    dt: float,
    steps: int,
    tolerance: float,
    most: int,
) -> bool:
    """Advance by some steps of `dt` [s], by a scheme; return whether the state is of numbers.

    Parameters
    ----------
    inputs : (2, P) array
        At the begin and at the end of all steps, linear between: speed of the first pulley [rad/s], and
        torques that act on the others [N m].
    tolerance : float
        Largest correction of a speed of the belt with which a stage counts as solved [m/s].
    most : int
        Corrections of a stage; after them it is counted as not solved, and the step is taken.
    """
    belt, wheels, tau = state.chain, state.wheels, stage_length(scheme, dt)
    friction, memory = drive.contact.friction, state.touch.memory
    last = wheels.speed.shape[1] - 1
    for step in range(steps):
        begin_stage(belt, scheme, dt)
        begin_friction(friction, memory, scheme, dt)
        share = (step + scheme.alpha_f) / steps
        rotating.begin_wheels(wheels, scheme, dt, inputs[0, 0] + share * (inputs[1, 0] - inputs[0, 0]))
        is_solved = False
        for iteration in range(most):
            place(belt, tau)
            rotating.place_wheels(drive.pulleys, wheels, tau)
            wheels.power[:] = 0.0
            wheels.power[rotating.BELT_LOSS] = set_up(drive.beam, belt, tau, last)
            rotating.add_pulleys(drive.pulleys, wheels, inputs, share, tau)
            touching = drive.contact, state.touch, drive.beam.lengths
            laws_hold = add_contacts(*touching, belt, drive.pulleys, wheels, tau, iteration > 0)
            state.counters[ITERATIONS] += 1
            if not factor(belt.blocks, SIZE):
                return False
            if not solve_bordered(belt.blocks, belt.columns, wheels.rows, wheels.corner, SIZE):
                return False
            largest = correct(belt, last)
            rotating.correct_wheels(wheels)
            if not np.isfinite(largest):
                return False
            is_solved = laws_hold and largest <= tolerance
            if is_solved:
                break
        finish_stage(belt, scheme, dt)
        finish_friction(friction, memory, state.touch.normal, scheme, dt)
        rotating.finish_wheels(drive.pulleys, wheels, scheme, dt)
        for k in range(state.totals.size):
            state.totals[k] += dt * wheels.power[k]
        state.counters[STEPS] += 1
        if not is_solved:
            state.counters[UNSOLVED] += 1
    return True


def drive_frequencies(drive: Drive, state: State, count: int) -> np.ndarray:
    """Lowest frequencies of a drive about its state, (count,) ascending [Hz]; nan where fewer are found."""
    mass, stiffness = matrices(drive, state)
    # a shift below all: the belt that runs around has 0
    shift = -((2.0 * np.pi * _LOWEST) ** 2)
    most = min(count + 4, mass.shape[0] - 2)
    start = np.random.default_rng(0).normal(size=mass.shape[0])  # one of its own would differ from run to run
    squares = eigsh(stiffness, most, mass, sigma=shift, v0=start, return_eigenvectors=False)
    found = np.sort(np.sqrt(np.maximum(squares, 0.0))) / (2.0 * np.pi)
    found = found[found > _LOWEST][:count]
    return np.concatenate([found, np.full(count - len(found), np.nan)])


def matrices(drive: Drive, state: State) -> tuple[csc_matrix, csc_matrix]:
    """M and K, over the nodes' coordinates and the angles of all pulleys but the first."""
    q, inertia = state.chain.q, drive.pulleys.inertia
    size = q.size + len(inertia) - 1
    beam = drive.beam._replace(axial_damping=0.0, mass_damping=0.0, bending_damping=0.0)
    limp = beam._replace(axial_stiffness=0.0, bending_stiffness=0.0)
    mass, both = (_of_belt(body, q, size) for body in (limp, beam))
    stiffness = both - mass
    mass[range(q.size, size), range(q.size, size)] = inertia[1:]
    across, tied, turning = _contacts(drive, state, size)
    stiffness = csc_matrix(stiffness) + across.T @ across + tied.T @ tied - turning.T @ turning
    return csc_matrix(mass), csc_matrix(0.5 * (stiffness + stiffness.T))


def _of_belt(beam: AncfBeam, q: np.ndarray, size: int) -> lil_matrix:
    """M + K of the belt alone: the matrix of a stage of 1 s at rest."""
    rest = np.zeros_like(q)
    work = chain(q, rest)
    assemble(beam, work.work, work.q, work.v, work.v, 1.0, work.blocks, work.columns, 0)
    matrix, n = lil_matrix((size, size)), len(q)
    for i in range(n):
        rows = slice(PER_NODE * i, PER_NODE * (i + 1))
        for block, j in ((0, i), (LOWER, (i - 1) % n), (UPPER, (i + 1) % n)):
            columns = slice(PER_NODE * j, PER_NODE * (j + 1))
            part = work.blocks.data[i, PER_NODE * block : PER_NODE * (block + 1), :PER_NODE]
            matrix[rows, columns] = matrix[rows, columns].toarray() + part
    return matrix


def _contacts(drive: Drive, state: State, size: int) -> tuple[csc_matrix, csc_matrix, csc_matrix]:
    """Rows whose squares are stiffnesses: across the rim, of sticking contacts, of turning normal forces."""
    q, contact, lengths = state.chain.q, drive.contact, drive.beam.lengths
    points = at_places(drive.beam, q, contact.shape)
    touching, ties = np.argwhere(state.touch.normal > 0.0), _ties(contact, state.touch.memory)
    across, tied, turning = (lil_matrix((len(touching), size)) for _ in range(3))
    for row, (p, i, c) in enumerate(touching):
        j = (i + 1) % len(q)
        away = points[i, c] - state.wheels.centre[p]
        distance = np.hypot(*away)
        normal = away / distance
        tangent = np.array([-normal[1], normal[0]])
        weight = lengths[i] / len(contact.shape)
        root, tie = np.sqrt(weight * contact.stiffness), np.sqrt(weight * ties[p, i, c])
        turn = np.sqrt(state.touch.normal[p, i, c] / distance)
        s = contact.shape[c] * [1.0, lengths[i], 1.0, lengths[i]]
        for node, shape in ((i, s[:2]), (j, s[2:])):
            for kind in range(2):
                at = PER_NODE * node + 2 * kind
                across[row, at : at + 2] = root * shape[kind] * normal
                tied[row, at : at + 2] = tie * shape[kind] * tangent
                turning[row, at : at + 2] = turn * shape[kind] * tangent
        if p > 0:
            tied[row, PER_NODE * len(q) + p - 1] = -tie * distance
    return csc_matrix(across), csc_matrix(tied), csc_matrix(turning)


def _ties(contact: Contact, memory: Memory) -> np.ndarray:
    """Stiffness per length by which contacts tie the belt to their pulley, (P, k, C) [N/m^2]."""
    friction = contact.friction
    sticks = memory.side == 0
    if friction.treatment == Treatment.REGULARISED:
        sticks = np.abs(memory.slip) < _STUCK * friction.friction_speed
    is_bristle = friction.treatment == Treatment.BRISTLE
    return np.where(sticks, friction.shear_stiffness if is_bristle else _TIED * contact.stiffness, 0.0)
