"""Moreau's steps of several oscillators, taken in turn.

With one mass and one contact a step is a few lines: those of `steppers.moreau` for
`motion.set_valued_system`, in their order and so equal to the bit. While a run waits for its exponential, the
processor is at the steps of the next ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.physics.friction import formula_coefficient, law_numbers, table_coefficient
from cvt_hpc.physics.friction_laws import Law
from cvt_hpc.steppers import moreau
from cvt_hpc.steppers.facts import COUNTERS, NO_VALUE, NOT_FINITE, OK, RATES, SOLVES, STEPS
from cvt_hpc.steppers.marching import Marching

ENDED = -1  # outcome of a run that is not to go on, though its steps could be taken


class Lanes(NamedTuple):
    """State and work of runs that advance together, (run,) each."""

    state: np.ndarray  # displacement [m] and speed [m/s], (run, 2)
    held: np.ndarray  # whether friction was between its bounds in the last step
    fastest: np.ndarray  # largest speed of the samples so far, at least the typical one [m/s]
    clock: np.ndarray  # simulated time [s]
    counts: np.ndarray  # work, (run, COUNTERS)
    outcome: np.ndarray  # a `Result`, or ENDED; only runs that are OK go on

    @classmethod
    def at(cls, states: np.ndarray) -> Lanes:
        """Runs that begin in these states (run, 2)."""
        runs = len(states)
        counts, outcome = np.zeros((runs, len(COUNTERS)), np.int64), np.full(runs, OK)
        return cls(states, np.zeros(runs, np.bool_), np.zeros(runs), np.zeros(runs), counts, outcome)


class Lane(Marching):
    """The march of a run whose steps are taken in the lanes of a batch."""

    def __init__(self, parameters: Mapping[str, Any], interval: float) -> None:
        self.facts, self.interval = moreau.FACTS, interval
        self._control, self._begun = moreau.control(parameters), 0.0

    def enter(self, lanes: Lanes, place: int) -> None:
        """Be at a place of these lanes from now on."""
        self.lanes, self.place = lanes, place
        self.y, self._counts = lanes.state[place], lanes.counts[place]
        self._clock = lanes.clock[place : place + 1]

    def go_over(self, lanes: Lanes, place: int) -> None:
        """Take state and work along to a place of other lanes."""
        for array, before in zip(lanes, self.lanes, strict=True):
            array[place] = before[self.place]
        self.enter(lanes, place)


@kernel
def march(several: Any, lanes: Lanes, interval: float, steps: int, rows: np.ndarray) -> None:
    """March on in place, each run as long as its outcome is OK.

    `several` has arrays, by `motion.together`. Results: into `rows`, (run, samples, 2), the state at the end
    of each sampling interval [s], of so many steps.
    """
    o, law, state, counts = several, several.law, lanes.state, lanes.counts
    clock, outcome, held = lanes.clock, lanes.outcome, lanes.held
    table = law.table_force, law.table_speed, law.table_mu
    runs = len(state)
    numbers, weight = np.empty((runs, 4)), np.empty(runs)
    for r in range(runs):
        own = law_numbers(law.kinetic[r], law.gradient[r], law.speed[r])
        numbers[r, 0], numbers[r, 1], numbers[r, 2], numbers[r, 3] = own
        weight[r] = 1.0 / o.mass[r]
    step = interval / steps
    half = 0.5 * step
    for k in range(rows.shape[1]):
        for i in range(steps):
            for r in range(runs):
                if outcome[r] != OK:
                    continue
                x, v, is_held = state[r, 0], state[r, 1], held[r]
                x += half * v
                rate = (o.preload[r] - o.stiffness[r] * x - o.damping[r] * v) / o.mass[r]
                change = step * rate
                load = o.normal_load[r] - o.normal_stiffness[r] * x
                counts[r, STEPS] += 1
                counts[r, RATES] += 1
                if not load > 0.0:
                    outcome[r] = NO_VALUE
                    clock[r] += i * step
                    continue
                speed = v - o.belt_speed[r]
                wanted = -(speed + change) / weight[r]
                while True:
                    sliding = 0.0 if is_held else abs(speed)
                    if law.kind == Law.TABLE:
                        mu = table_coefficient(table, sliding, load)[0]
                    else:
                        own = numbers[r, 0], numbers[r, 1], numbers[r, 2], numbers[r, 3]
                        mu = formula_coefficient(law.kind, own, sliding)[0]
                    most = step * (load * (mu + (o.excess[r] if is_held else 0.0)))
                    impulse = min(max(wanted, -most), most)
                    saturated = impulse <= -most or impulse >= most
                    counts[r, SOLVES] += 1
                    if not (is_held and saturated):
                        break
                    is_held = False
                v = v + change + weight[r] * impulse
                x += half * v
                state[r, 0], state[r, 1], held[r] = x, v, not saturated
                if not (np.isfinite(x) and np.isfinite(v)):
                    outcome[r] = NOT_FINITE
                    clock[r] += i * step
        for r in range(runs):
            if outcome[r] == OK:
                clock[r] += interval
                rows[r, k, 0], rows[r, k, 1] = state[r, 0], state[r, 1]
