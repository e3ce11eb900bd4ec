"""A transient run of the elastic belt by any general stepper: the belt as one system, sampled as ever.

Integrators that can use it have the Jacobian by few evaluations, since it is known which unknowns act on
which rates: SciPy's BDF and Radau factorise it as a sparse matrix. It is sparse but for the sheaves, whose
deformation lets each displacement of a wrap act on every force of that wrap.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import one_system, rings
from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants, initial_state, random_strands
from cvt_hpc.models.elastic_belt.belt_settings import layer_count
from cvt_hpc.models.elastic_belt.column import pressed_strains
from cvt_hpc.models.elastic_belt.lane_belt import put_lane
from cvt_hpc.models.elastic_belt.one_system import ROWS, FlatBelt, carried_places, rates, system
from cvt_hpc.models.elastic_belt.recorded_run import OneLaneRun
from cvt_hpc.models.elastic_belt.rhs import lengthening, strains
from cvt_hpc.models.elastic_belt.rings import FIRST_LAYER, ring_constants
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.validity import FAILURES
from cvt_hpc.models.marched import Marched
from cvt_hpc.parameters import Parameters
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.fastest_rate import STABLE, fastest_rate
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import RELATIVE_INCREMENT
from cvt_hpc.variables import Failure, Status

_SAMPLES_TOGETHER = 20  # between two checks of the samples: a run that has left its path goes not far


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
            stop = min(last, self.done + _SAMPLES_TOGETHER)
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


SPEED, OPENING = -1, -2  # of the driven pulley, beside the rows of the state

# rate: {unknown: stations behind it (negative) to stations ahead of it that act on it}
_HERE, _BESIDE = (0, 0), (-1, 1)
_STRESSES = {f.N_ELEMENT: (-1, 0), f.N_RING: (-1, 0)}  # of the cells beside a station
_FLANKS = {f.U: _BESIDE, f.V_ELEMENT: _BESIDE, f.V_FILTERED: _HERE}
REACH = {
    f.W: {f.U: _HERE},
    f.U: {f.W: (-2, 2), f.V_RING: _BESIDE} | _FLANKS | _STRESSES,
    f.V_ELEMENT: {f.W: _BESIDE, f.V_RING: _HERE} | _FLANKS | _STRESSES,
    f.V_RING: {f.W: _BESIDE, f.U: _BESIDE, f.V_ELEMENT: _HERE, f.V_RING: _BESIDE, f.N_RING: (-1, 0)},
    f.N_ELEMENT: {f.W: (-1, 2), f.V_ELEMENT: (0, 1), f.N_ELEMENT: _BESIDE},
    f.N_RING: {f.W: (-1, 2), f.V_RING: (0, 1), f.N_RING: _BESIDE},
}
# With a column that bears a moment, which knows strains and turning of the cells around
_OF_COLUMN = {f.U: {f.N_ELEMENT: (-2, 1)}, f.V_ELEMENT: {f.W: (-2, 2)}}
# With elements that tilt by the rings' friction, which acts on both layers
_OF_TILT = {
    f.V_ELEMENT: {f.ELEMENT_TILT: (0, 0)},
    f.V_RING: {f.ELEMENT_TILT: (0, 0)},
    f.ELEMENT_TILT: REACH[f.V_RING] | {f.V_RING: (0, 0), f.ELEMENT_TILT: (-1, 0)},
}
# A station's flank forces and filtered speed: beyond the above they depend on the driven pulley, the filtered
# speed where contact begins on sliding at the open station behind, and on where that is, by the forces
_ON_FLANK = {f.U: (-1, 0), f.V_ELEMENT: (-1, 0), f.W: (-2, 1), f.V_FILTERED: (-1, 0)}


def pattern(flat: FlatBelt) -> csc_array:
    """Return the places at which the Jacobian of `flat.rates` may differ from 0, (n, n) bool."""
    belt = flat.belt
    n, count = belt.cell.size, flat.origin.size
    place = {row: k * n + np.arange(n) for k, row in enumerate(ROWS)}
    place |= carried_places(flat)
    place[SPEED], place[OPENING] = np.array([count - 2]), np.array([count - 1])
    found = np.zeros((count, count), dtype=bool)

    def mark(row: int, unknown: int, stations: np.ndarray, offsets: range) -> None:
        for offset in offsets:
            rows, columns = place[row][stations], place[unknown][(stations + offset) % n]
            known = (rows >= 0) & (columns >= 0)
            found[rows[known], columns[known]] = True

    for reach in (REACH, *[_OF_COLUMN] * belt.has_column, *[_OF_TILT] * belt.tilts):
        for row, reaches in reach.items():
            for unknown, (behind, ahead) in reaches.items():
                mark(row, unknown, np.arange(n), range(behind, ahead + 1))
    for arc, is_driven in ((belt.driving_stations, False), (belt.driven_stations, True)):
        for row in (f.U, f.V_ELEMENT, f.V_FILTERED):
            for unknown, (behind, ahead) in _ON_FLANK.items():
                mark(row, unknown, arc, range(behind, ahead + 1))
        remembered = place[f.V_FILTERED][arc]
        remembered = remembered[remembered >= 0]
        pushed = [place[f.U][arc], place[f.V_ELEMENT][arc], remembered]
        moved = [place[f.W][arc]]
        if is_driven:
            pushed += [place[SPEED], place[OPENING]]
            moved += [place[OPENING]]
            found[np.concatenate(pushed), place[SPEED]] = True
            rim = [place[row] for row in (f.W, f.U, f.V_ELEMENT)]
            near = np.arange(arc[0] - 1, arc[-1] + 2) % n
            found[np.ix_(place[SPEED], np.concatenate([row[near] for row in rim]))] = True
            found[np.ix_(place[SPEED], remembered)] = True
        found[np.ix_(np.concatenate(pushed), np.concatenate(moved))] = True
    # states of free pulleys know both wraps, and all of those know them
    if flat.loose.size > 0:
        loose = count - 2 - flat.loose.size
        found[:, loose:] = found[loose:] = True
    return csc_array(found)


def groups(pattern: csc_array) -> np.ndarray:
    """A group for each column, (n,) int, such that no two columns of a group act on the same rate."""
    n = pattern.shape[1]
    rows = [pattern.indices[pattern.indptr[j] : pattern.indptr[j + 1]] for j in range(n)]
    taken: list[np.ndarray] = []
    found = np.zeros(n, dtype=int)
    for j in sorted(range(n), key=lambda j: -rows[j].size):
        free = [group for group, used in enumerate(taken) if not used[rows[j]].any()]
        if not free:
            free = [len(taken)]
            taken.append(np.zeros(pattern.shape[0], dtype=bool))
        found[j] = free[0]
        taken[found[j]][rows[j]] = True
    return found


class SparseJacobian:
    """Jacobian of `flat.rates` by difference quotients, several columns at once.

    `evaluations` counts those of the rates so far.
    """

    def __init__(self, flat: FlatBelt) -> None:
        self._flat = flat
        self._pattern = pattern(flat)
        self._scale = system(flat).scale
        self._rows = self._pattern.indices
        self._columns = np.repeat(np.arange(self._scale.size), np.diff(self._pattern.indptr))
        self._groups = groups(self._pattern)
        self.evaluations = 0

    def __call__(self, t: float, y: np.ndarray) -> csc_array:
        """Jacobian at a state, (n, n); not a number where a rate has no value."""
        base, values = self._rates(t, y), np.empty(self._rows.size)
        increments = RELATIVE_INCREMENT * np.maximum(np.abs(y), self._scale)
        for group in range(self._groups.max() + 1):
            moved = np.where(self._groups == group, y + increments, y)
            change = self._rates(t, moved) - base
            mine = self._groups[self._columns] == group
            columns = self._columns[mine]
            values[mine] = change[self._rows[mine]] / (moved - y)[columns]
        return csc_array((values, self._rows, self._pattern.indptr), shape=self._pattern.shape)

    def _rates(self, t: float, y: np.ndarray) -> np.ndarray:
        out = np.empty_like(y)
        self.evaluations += 1
        if not rates(self._flat, t, y, out):
            out[:] = np.nan
        return out
