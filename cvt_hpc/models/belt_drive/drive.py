"""The belt on its pulleys: the moving parts, and the step in time."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.belt_drive import pulleys as rotating
from cvt_hpc.models.belt_drive.contact import Contact, Touch, add_contacts, first_touch
from cvt_hpc.models.belt_drive.friction import begin_friction, finish_friction
from cvt_hpc.multibody.ancf_beam import AncfBeam
from cvt_hpc.multibody.ancf_equations import (
    SIZE,
    Chain,
    begin_stage,
    chain,
    correct,
    finish_stage,
    place,
    set_up,
)
from cvt_hpc.solvers.cyclic_blocks import factor, solve_bordered
from cvt_hpc.solvers.generalised_alpha import Scheme, stage_length

STEPS, ITERATIONS, UNSOLVED = range(3)  # counters of a state


class Drive(NamedTuple):
    """Constants of a belt of k elements on P pulleys.

    Attributes
    ----------
    beam : AncfBeam
        Of the belt.
    pulleys : Pulleys
        The pulleys that it runs around.
    contact : Contact
        Between both.
    """

    beam: AncfBeam
    pulleys: rotating.Pulleys
    contact: Contact


class State(NamedTuple):
    """Motion of a drive, and the work space of its steps.

    Attributes
    ----------
    chain : Chain
        Of the belt's n = k nodes.
    wheels : Wheels
        Of the pulleys.
    touch : Touch
        Of the contacts.
    counters, totals : (3,) int array, (5 + P,) array
        Work done [J].
    """

    chain: Chain
    wheels: rotating.Wheels
    touch: Touch
    counters: np.ndarray
    totals: np.ndarray


def state(
    drive: Drive, q: np.ndarray, v: np.ndarray, speeds: np.ndarray, angles: np.ndarray | None = None
) -> State:
    """Begin a motion.

    Parameters
    ----------
    drive : Drive
        The moving parts.
    q, v : (n, 4) arrays
        Positions [m, 1] and speeds [m/s, 1/s] of the belt.
    speeds : (P,) array
        Of the pulleys [rad/s].
    angles : (A,) array, optional
        Of the arms [rad]; by default as drawn.
    """
    count, n = len(speeds), len(q)
    turning = rotating.wheels_at(
        drive.pulleys, speeds, np.zeros(len(drive.pulleys.arms.pivot)) if angles is None else angles, n
    )
    return State(
        chain(q, v, columns=turning.speed.shape[1]),
        turning,
        first_touch(count, n, len(drive.contact.shape)),
        np.zeros(3, np.int64),
        np.zeros_like(turning.power),
    )


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
    """Advance by some steps.

    Parameters
    ----------
    drive, state : Drive, State
        The moving parts, and their motion.
    scheme : Scheme
        Of the step.
    inputs : (2, P) array
        At the begin and at the end of all steps, linear between: speed of the first pulley [rad/s], and
        torques that act on the others [N m].
    dt : float
        Step [s].
    steps : int
        How many.
    tolerance : float
        Largest correction of a speed of the belt with which a stage counts as solved [m/s].
    most : int
        Corrections of a stage; after them it is counted as not solved, and the step is taken.

    Returns
    -------
    bool
        Whether the state is of numbers.
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
            laws_hold = add_contacts(
                drive.contact,
                state.touch,
                drive.beam.lengths,
                belt,
                drive.pulleys,
                wheels,
                tau,
                iteration > 0,
            )
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
