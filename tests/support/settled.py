"""A belt run until it has settled, and what a free body cut through its strands needs to know."""

import numpy as np

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, Mesh, State, belt_constants, initial_state, mesh
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts, strains
from cvt_hpc.models.elastic_belt.sampling import Outcome
from support.fast_runs import FastRuns
from support.scene import VALUES

DEFAULTS = VALUES | {"duration": 0.1}
T1, T2 = 1, 3  # regions of the path
# shorter than the default: flanks without friction leave the belt hardly damped, and 5 us is too long for it
STEP = 3e-6


def start(**parameters) -> tuple[Belt, State]:
    """Constants and state of a run on the scene of the tests but for `parameters`."""
    belt = belt_constants(DEFAULTS | parameters)
    return belt, initial_state(DEFAULTS | parameters, belt)


class Settled:
    """Means over the last `averaged` seconds of a run of `duration` seconds.

    Attributes
    ----------
    tension, push, w : (N,) arrays
        T and P in the cells [N], displacement of the stations [m].
    thrusts : (2,) array
        Total axial forces of driving and driven wrap [N].
    spin_up : float
        J omega' of the driven pulley [N m]: what its moments leave.
    closing : float
        The sheave's damping times its speed [N]: what the thrust leaves.
    """

    def __init__(self, duration: float, averaged: float, **parameters):
        self.belt, state = start(**parameters)
        self.grid: Mesh = mesh(DEFAULTS | parameters)
        run = FastRuns([self.belt], [state])
        samples, stride = round(averaged / STEP) // 25, 25
        run.advance(round(duration / STEP) - samples * stride, STEP)
        before = run.state().scalars
        sums = None
        for _ in range(samples):
            run.advance(stride, STEP)
            now = self._forces(run.state())
            sums = now if sums is None else [a + b for a, b in zip(sums, now, strict=True)]
        assert run.outcome() is Outcome.OK
        self.tension, self.push, self.w, self.thrusts = (total / samples for total in sums)
        rates = (run.state().scalars - before) / (samples * stride * STEP)
        self.spin_up = self.belt.driven_inertia * rates[f.DRIVEN_SPEED]
        self.closing = self.belt.axial_damping * rates[f.DRIVEN_POSITION]

    def _forces(self, state: State) -> list[np.ndarray]:
        belt, n = self.belt, self.belt.cell.size
        force, eps = np.empty(n), np.empty((2, n))
        assert contact_forces(belt, state, fresh_contacts(belt), force) > 0
        strains(belt, state.fields, eps)
        wraps = ((belt.driving, belt.driving_stations), (belt.driven, belt.driven_stations))
        thrusts = [sheave.weight @ np.maximum(force[held], 0.0) for sheave, held in wraps]
        push = np.maximum(-belt.element_stiffness * eps[0], 0.0)
        return [belt.ring_stiffness * eps[1], push, state.fields[f.W].copy(), np.array(thrusts)]

    @property
    def relief(self) -> float:
        """Centrifugal force m v^2 of the whole belt [N]."""
        return self.belt.mass * self.belt.belt_speed**2

    def in_strand(self, region: int) -> tuple[float, float, float, tuple[float, float]]:
        """T, P [N] and slope w_s in the middle of a strand; w of its straight line at both ends [m]."""
        first, count = self.grid.starts[region], self.grid.counts[region]
        middle = slice(first + count // 4, first + 3 * count // 4)
        way = self.grid.along(region)
        s = way[count // 4 : 3 * count // 4]
        slope, w = np.polyfit(s, self.w[middle], 1)
        ends = w, w + slope * way[-1]
        return self.tension[middle].mean(), self.push[middle].mean(), slope, ends
