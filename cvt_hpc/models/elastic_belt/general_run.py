"""A transient run of the elastic belt by any general stepper: the belt as one system, sampled as ever."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import one_system, rings
from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants, initial_state, random_strands
from cvt_hpc.models.elastic_belt.belt_settings import layer_count
from cvt_hpc.models.elastic_belt.column import pressed_strains
from cvt_hpc.models.elastic_belt.lane_belt import put_lane
from cvt_hpc.models.elastic_belt.recorded_run import OneLaneRun
from cvt_hpc.models.elastic_belt.rhs import lengthening, strains
from cvt_hpc.models.elastic_belt.rings import FIRST_LAYER, ring_constants
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.sparsity import SparseJacobian
from cvt_hpc.models.elastic_belt.validity import FAILURES
from cvt_hpc.models.marched import Marched
from cvt_hpc.parameters import Parameters
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.fastest_rate import STABLE, fastest_rate
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.variables import Failure, Status

SAMPLES_TOGETHER = 20  # between two checks of the samples: a run that has left its path goes not far


class GeneralTransient(Marched, OneLaneRun):
    """One run by any general stepper that the model takes, sample by sample; attributes of `RecordedRun`.

    Its resolved parameters [SI] have those of the stepper.
    """

    def __init__(self, parameters: Parameters, stepper: str) -> None:
        p = parameters
        self.done = 0
        self.prolong(p)
        self.belt = belt_constants(p)
        self._disturbed = False
        is_layered = layer_count(p) > 1
        # the module that knows the unknowns, and its constants and work space
        self._equations: Any = rings if is_layered else one_system
        self._flat: Any = (
            rings.flat_rings(self.belt, ring_constants(p, self.belt))
            if is_layered
            else one_system.flat_belt(self.belt)
        )
        self._system = self._equations.system(self._flat)
        start = self._equations.pack(self._flat, initial_state(p, self.belt))
        self._make_lane(self.belt, self._unpacked(0.0, start))
        self.marching = Marching(stepper, p, self._system, start, self.interval)
        self._stable = STABLE.get(stepper, np.inf)
        self._fastest = np.random.default_rng(0).normal(size=start.size)
        if stepper.startswith("scipy_") and isinstance(self._flat, one_system.FlatBelt):
            jacobian = SparseJacobian(self._flat)
            dense = stepper == "scipy_lsoda"  # others take it sparse
            self.marching.tell(jac=(lambda t, y: jacobian(t, y).toarray()) if dense else jacobian)
        self.failure: Failure | None = None

    @property
    def state(self) -> State:
        """The present state; a copy."""
        return self._unpacked(self.time, self.marching.y).copy()

    def _unpacked(self, time: float, y: np.ndarray) -> State:
        """State of unknowns; overwritten by the next call, and by the next evaluation of rates."""
        self._equations.unpack(self._flat, time, y)
        return self._flat.state

    @property
    def contact_solves(self) -> int:
        """Solves of the contact problem so far: two wraps in every evaluation of the rates."""
        return 2 * self.counters()["rates"]

    def take_over(self, runs: Sequence[Any]) -> None:
        """Continue a run by another stepper, its history included, except for means that began before.

        Of `runs`, one LaneRun or GeneralTransient, of the same mesh, sampling and duration.
        """
        (run,) = runs
        self._go_on_from(run)
        self.marching.begin(run.time, self._equations.pack(self._flat, run.state))

    def advance(self, samples: int) -> Failure | None:
        """March on by so many samples at most, 0 compiles only; the failure, if the run cannot continue."""
        last = min(self.done + samples, self.samples)
        found = self._march(0) if samples == 0 else None
        while found is None and self.done < last:
            if self.done == self._records.kick and not self._disturbed:
                self._disturb()
            stop = min(last, self.done + SAMPLES_TOGETHER)
            if self.done < self._records.kick:
                stop = min(stop, self._records.kick)
            found = self._march(stop - self.done)
        self.failure = found
        return found

    def _disturb(self) -> None:
        """Give the strands their random displacement, once the start-up's damping has gone."""
        p, state = self.parameters, self.state
        state.fields[f.W] += random_strands(self.mesh, p["disturbance"], p["seed"])
        self.marching.y[:] = self._equations.pack(self._flat, state)
        self._disturbed = True

    def _march(self, count: int) -> Failure | None:
        """March by `count` sampling intervals and record them."""
        rows = np.full((count, self.marching.y.size), np.nan)
        outcome = self.marching.advance(rows)
        for row in rows:
            if not np.all(np.isfinite(row)):
                break
            seen = self._sample(row)
            if seen != Outcome.OK:
                return FAILURES[Outcome(seen)]
        if outcome != Result.OK:
            return Status.FAILED_NUMERICS, self.marching.explain(outcome)
        return self._too_long() if np.isfinite(self._stable) else None

    def _too_long(self) -> Failure | None:
        """Whether an explicit step is beyond its limit, where friction only hums and nothing diverges."""
        rate = fastest_rate(self._system, self.time, self.marching.y, self._fastest)
        if self.marching.step * rate <= self._stable:
            return None
        step, limit = self.marching.step, self._stable / rate
        found = f"the step {step:.3g} s is beyond what is stable, {limit:.3g} s"
        return Status.FAILED_NUMERICS, f"{found}: some motion has a rate of {rate:.3g}/s"

    def _sample(self, y: np.ndarray) -> int:
        """Record one state."""
        state = self._unpacked((self.done + 1) * self.interval, y)
        lane = self._state
        put_lane(lane, 0, self.belt, state)
        # a general stepper knows nothing of dampers: their work is taken from the state, as over the interval
        lane.scalars.data[0, lf.LAYER_WORK] = damper_power(self.belt, state) * self.interval
        outcome = self._sample_lane()
        self._rows.data[self.done, -1, 0] = np.nan  # its steps are not seen here: no step_ripple
        self.done += int(outcome == Outcome.OK)
        return outcome


@kernel
def damper_power(belt: Belt, state: State) -> float:
    """Power of the layers' dampers in a state [W], as `rhs.accelerations` has their forces."""
    n = belt.cell.size
    eps = np.empty((2, n))
    strains(belt, state.fields, eps)
    pressed = pressed_strains(belt, state.fields, eps[0])
    power = 0.0
    for layer in range(2):
        v = state.fields[f.V_ELEMENT + layer]
        damper = belt.ring_damping if layer else belt.element_damping
        for c in range(n):
            rate = lengthening(belt, v, state.fields[f.U], c)
            damped = damper * rate
            if layer == 0:
                # elements that are apart have none, and it never makes them pull
                damped = min(damped, -belt.element_stiffness * pressed[c]) if pressed[c] < 0.0 else 0.0
            power += damped * rate * belt.cell[c]
    for k in range(FIRST_LAYER, (FIRST_LAYER + state.fields.shape[0]) // 2):
        # beside the transport by the layers' mean speed
        share = 2.0 / (state.fields.shape[0] - FIRST_LAYER)
        v = state.fields[k] - state.fields[f.V_RING]
        for c in range(n):
            closing = v[c + 1 if c < n - 1 else 0] - v[c]
            power += share * belt.ring_damping * closing * closing / belt.cell[c]
    return power
