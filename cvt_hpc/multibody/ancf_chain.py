"""Chains of planar ANCF elements, open or closed, and the stages of their steps in time."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.multibody.ancf_beam import PER_NODE, AncfBeam
from cvt_hpc.multibody.ancf_equations import assemble, empty_work
from cvt_hpc.solvers.cyclic_blocks import block_size, empty_blocks, empty_columns
from cvt_hpc.solvers.generalised_alpha import Scheme, begin, finish, stage_length

SIZE = block_size(PER_NODE)


class Chain(NamedTuple):
    """Motion of a chain of n nodes; all but the equations are (n, 4) arrays.

    Attributes
    ----------
    q, v : arrays
        Positions [m, 1] and speeds [m/s, 1/s] of the nodes.
    dq, dv : arrays
        Their rates, as the method of steps knows them.
    stage_q, stage_v : arrays
        Those of the last stage.
    start_q, start_v : arrays
        Initial values of its implicit Euler step.
    blocks, columns : LaneArrays
        Equations of `cyclic_blocks`.
    work : LaneArray
        Of `assemble`.
    """

    q: np.ndarray
    v: np.ndarray
    dq: np.ndarray
    dv: np.ndarray
    stage_q: np.ndarray
    stage_v: np.ndarray
    start_q: np.ndarray
    start_v: np.ndarray
    blocks: LaneArray
    columns: LaneArray
    work: LaneArray


def chain(q: np.ndarray, v: np.ndarray, columns: int = 1) -> Chain:
    """A chain at positions and speeds (n, 4); its accelerations are 0.

    Parameters
    ----------
    q, v : (n, 4) arrays
        Positions [m, 1] and speeds [m/s, 1/s] of the nodes.
    columns : int
        Right-hand sides of its equations.

    Returns
    -------
    Chain
        With copies of both.
    """
    q, v = np.array(q, float), np.array(v, float)
    dv, stage_q, stage_v, start_q, start_v = np.zeros((5, *q.shape))
    equations = empty_blocks(len(q), PER_NODE), empty_columns(len(q), PER_NODE, columns)
    return Chain(q, v, v.copy(), dv, stage_q, stage_v, start_q, start_v, *equations, empty_work())


@kernel
def begin_stage(chain: Chain, scheme: Scheme, dt: float) -> None:
    """Initial values of a stage, with the speeds at the begin of the step as a guess of its own."""
    begin(scheme, dt, chain.q, chain.dq, chain.start_q)
    begin(scheme, dt, chain.v, chain.dv, chain.start_v)
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            chain.stage_v[i, k] = chain.v[i, k]


@kernel
def finish_stage(chain: Chain, scheme: Scheme, dt: float) -> None:
    """Positions and speeds at the end of a step, by the speeds of its stage."""
    place(chain, stage_length(scheme, dt))
    finish(scheme, dt, chain.stage_q, chain.start_q, chain.q, chain.dq)
    finish(scheme, dt, chain.stage_v, chain.start_v, chain.v, chain.dv)


@kernel
def place(chain: Chain, tau: float) -> None:
    """Positions of a stage by its speeds."""
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            chain.stage_q[i, k] = chain.start_q[i, k] + tau * chain.stage_v[i, k]


@kernel
def set_up(beam: AncfBeam, chain: Chain, tau: float, column: int) -> float:
    """Set up a correction of the speeds of a stage, by `assemble`; the power that damping takes [W]."""
    return assemble(
        beam,
        chain.work,
        chain.stage_q,
        chain.stage_v,
        chain.start_v,
        tau,
        chain.blocks,
        chain.columns,
        column,
    )


@kernel
def correct(chain: Chain, column: int) -> float:
    """Add a solution to the speeds of a stage; the largest correction of a node's own speed [m/s]."""
    largest = 0.0
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            correction = chain.columns.data[i, k, column]
            chain.stage_v[i, k] += correction
            if k < 2 and not abs(correction) <= largest:
                largest = abs(correction)
    return largest
