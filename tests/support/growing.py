"""How fast the transient belt lets a small disturbance of its steady state grow, beside the eigenvalue."""

import numpy as np

from cvt_hpc.models.elastic_belt.one_system import FlatBelt, flat_belt, pack, rates, unpack
from cvt_hpc.models.linear_stability.branch import Point
from cvt_hpc.models.steady_variator.equations import LATE
from cvt_hpc.models.steady_variator.linearised import Linearisation, corners
from cvt_hpc.models.steady_variator.walking import Steady
from support.fast_runs import FastRuns


def at_rest(steady: Steady) -> tuple[FlatBelt, np.ndarray, np.ndarray]:
    """The belt as one system, at rest in a steady state; its unknowns; its Jacobian there, dense."""
    flat = flat_belt(steady.belt._replace(bridging_stiffness=steady.belt.element_stiffness), LATE)
    y = pack(flat, steady.state)
    assert rates(flat, 0.0, y, np.empty_like(y))
    return flat, y, Linearisation(flat)(flat, corners(flat.belt, flat.state) > 0.0).toarray()


def measured(point: Point, size: float = 1e-10, step: float = 1e-6, duration: float = 4.8e-3):
    """Growth rate [1/s] and frequency [Hz] of the leading mode in a run by the fast step.

    From a disturbance by the mode itself, `size` high [m], seen through the left eigenvector, in which no other mode
    shows. The first quarter is left out: a step that begins beside a cell which rests on its damper alone needs
    a millisecond to find that rest.
    """
    flat, y, matrix = at_rest(point.steady)
    mode = point.modes[0]
    value = mode.growth + 2j * np.pi * mode.frequency
    left = np.linalg.solve((matrix - value * (1 + 1e-9) * np.eye(y.size)).conj().T, mode.vector)
    unpack(flat, 0.0, y + size * mode.vector.real)
    run = FastRuns([point.steady.belt], [flat.state.copy()])
    together = 40
    samples = round(duration / (together * step))
    seen = np.empty(samples, complex)
    for k in range(samples):
        run.advance(together, step)
        seen[k] = np.vdot(left, pack(flat, run.state()) - y)
    settled = slice(samples // 4, None)
    time = np.arange(samples)[settled] * together * step
    growth = np.polyfit(time, np.log(np.abs(seen[settled])), 1)[0]
    pulse = np.polyfit(time, np.unwrap(np.angle(seen[settled])), 1)[0]
    return growth, pulse / (2.0 * np.pi)
