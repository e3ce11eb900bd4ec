"""The attractors of runs from several starts along a parameter: quiet, or a limit cycle of some amplitude.

A start is a few settings of the job, such as a disturbance. Where a steady state is known a run may begin in
it, which a belt that is loaded within tens of milliseconds does not come near. Values lie more closely
where vibration begins or ends.

`Followed` is a branch with all its results, as it is kept and as all that shows it reads it.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from enum import IntEnum
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.experiments.branch.job import Asked
from cvt_hpc.job import Job
from cvt_hpc.models.contract import load_model
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Mesh, State
from cvt_hpc.models.linear_stability.branch import Branch, Onset, tracks
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.record import quantities
from cvt_hpc.simulation.marching import march
from cvt_hpc.simulation.record import in_lanes, record_of, recorded_model
from cvt_hpc.storage.archives import Arrays
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs
from cvt_hpc.vibration.criticality import Criticality

FROM = ("from the steady state", "from the large start")  # the starts of a branch, in words
_SAID = (OccurrenceClass.QUIET, OccurrenceClass.VIBRATING)

STRAND = "strand in which the mode is largest: 1 is t1, 2 is t2"
# value, name for people, unit, comment
OF_MODES: dict[str, tuple[Callable[[Mode], float], str, str, str]] = {
    "growth_rate": (lambda mode: mode.growth, "growth rate", "s-1", "of the mode"),
    "frequency": (lambda mode: mode.frequency, "frequency", "Hz", "of the mode"),
    "vibrating_strand": (lambda mode: mode.strand + 1, "vibrating strand", "1", STRAND),
    "half_waves": (lambda mode: mode.half_waves, "half waves", "1", "of the mode along its vibrating strand"),
}


class Attractor(NamedTuple):
    """Result of a run."""

    value: float  # of the parameter [SI]
    start: int  # place among the starts
    occurrence: OccurrenceClass  # its class
    # of the strand that moves most, or of the mass, in the band and over the judged part [m]; nan where the
    # run failed
    amplitude: float
    frequency: float  # of the same [Hz]
    reason: str  # why the run failed, or was found to vibrate or not


class Start(NamedTuple):
    """A start of runs."""

    settings: Mapping[str, Any]  # keys of the job with values [SI]
    # the belt's state at a value of the parameter, or None where there is none: that run is left out. Without
    # such a function runs begin as any other.
    state: Callable[[float], State | None] | None = None


def attractors(
    job: Job,
    parameter: str,
    starts: Sequence[Start],
    values: Sequence[float],
    bifurcations: Collection[float],
    resolution: float,
) -> list[Attractor]:
    """Run from all starts at all values, and more closely where vibration begins or ends.

    Values of the job's parameter are ascending [SI]; beside bifurcations there are to be ones as close as the
    resolution. The order is that of values, then of starts. The job's model has a transient, and no axes.
    """
    found = _run_all(job, parameter, starts, values)
    between = close_values(values, found, bifurcations, resolution)
    found += _run_all(job, parameter, starts, between)
    return sorted(found, key=lambda one: (one.value, one.start))


def close_values(
    values: Sequence[float], found: Sequence[Attractor], bifurcations: Collection[float], resolution: float
) -> list[float]:
    """Return values in the intervals where runs of one start turn, or which hold a bifurcation."""
    split = {pair for pair in pairwise(values) if any(pair[0] < place < pair[1] for place in bifurcations)}
    for start in {one.start for one in found}:
        said = [one for one in found if one.start == start and one.occurrence in _SAID]
        for one, other in pairwise(sorted(said)):
            if one.occurrence != other.occurrence:
                split |= {pair for pair in pairwise(values) if one.value <= pair[0] < other.value}
    between: list[float] = []
    for low, high in sorted(split):
        count = int(np.ceil((high - low) / resolution - 1e-9))
        between += np.linspace(low, high, count + 1)[1:-1].tolist()
    return between


def _run_all(job: Job, parameter: str, starts: Sequence[Start], values: Sequence[float]) -> list[Attractor]:
    """Run from all starts, as many runs together as can advance so."""
    runs: list[_Started] = []
    for k, start in enumerate(starts):
        for value in values:
            point = job.point_at({**start.settings, parameter: value})
            state = start.state(value) if start.state else None
            if start.state and state is None:
                continue
            runs.append(_Started(value, k, state, point))
    model = recorded_model(job)
    groups = in_lanes(model, job.stepper, runs, lambda run: run.point, lambda run: run.state is None)
    return [attractor for group in groups for attractor in _run_batch(job, group)]


class _Started(NamedTuple):
    """A run at one value of the parameter, from one of the starts, in a state or by itself."""

    value: float
    start: int
    state: State | None
    point: dict[str, Any]


class _AtRest(NamedTuple):
    """A run that stands in a state, as a batch takes it over: without a history."""

    done: int
    time: float
    state: State
    rows: float = 0.0


def _at_rest(batch: Any, state: State) -> _AtRest:
    """Return a run in a state, at the time when its strands are disturbed and the load has risen."""
    done = batch.records.kick
    state = state.copy()
    state.scalars[f.TIME] = done * batch.interval
    return _AtRest(done, state.scalars[f.TIME], state)


def _run_batch(job: Job, group: list[_Started]) -> list[Attractor]:
    """Do runs that advance together; runs with a state begin in it when strands are disturbed."""
    batch = load_model(job.model).batch([run.point for run in group], job.stepper)
    states = [run.state for run in group if run.state is not None]
    if states:
        batch.take_over([_at_rest(batch, state) for state in states])
    march(batch)
    found = []
    for asked, run in zip(group, batch.runs, strict=True):
        record = record_of(job, run, 0.0)
        (kind,) = classify_runs(np.array([record["status"]]), np.array([record["vibrates"]]))
        amplitude, frequency = (np.atleast_1d(record[name]) for name in ("amplitude", "frequency"))
        largest = 0 if np.isnan(amplitude).all() else int(np.nanargmax(amplitude))
        found.append(
            Attractor(
                asked.value,
                asked.start,
                OccurrenceClass(int(kind)),
                float(amplitude[largest]),
                float(frequency[largest]),
                record["reason"],
            )
        )
    return found


class Stability(IntEnum):
    """Stability of a steady state."""

    STABLE = 0
    UNSTABLE = 1
    NOT_FOUND = 2
    NOT_COMPUTED = 3


class Followed(NamedTuple):
    """One branch with all its results."""

    asked: Asked  # the requested branch
    states: Arrays  # as of `states_of`
    onsets: list[Onset]  # its Hopf points, in the order of their loads
    # loads between which stability changes without a Hopf point that could be found [N m]
    hidden: list[tuple[float, float]]
    # from near the steady state (start 0) and from the large start (1); empty if none were requested
    runs: list[Attractor]
    kinds: list[Criticality]  # one for each of `onsets`

    @property
    def missed(self) -> np.ndarray:
        """Tell where no steady state was found, (load,)."""
        return self.states["stability"] == Stability.NOT_FOUND


def states_of(found: Branch, grid: Mesh, loads: Sequence[float]) -> Arrays:
    """Return steady states and modes of a branch along all its loads, ascending [N m].

    `load` and `stability` (load,); by their names quantities of the steady states (load, ...) and values of
    the modes (load, mode), each mode followed as far as there are states, the most unstable first; nan where
    there is none.
    """
    lines = [
        {piece[place].steady.load: mode for place, mode in track.items()}
        for piece in found.pieces()
        for track in tracks(piece)
    ]
    lines.sort(key=lambda line: -max(mode.growth for mode in line.values()))
    states = {"load": np.array(loads), "stability": np.full(len(loads), Stability.NOT_FOUND, np.int8)}
    for point in found.points:
        place = loads.index(point.steady.load)
        states["stability"][place] = Stability.UNSTABLE if point.growth > 0.0 else Stability.STABLE
        for name, value in quantities(point.steady, grid).items():
            states.setdefault(name, np.full((len(loads), *np.shape(value)), np.nan))[place] = value
    for name, (value_of, *_) in OF_MODES.items():
        states[name] = np.full((len(loads), len(lines)), np.nan)
        for column, line in enumerate(lines):
            for load, mode in line.items():
                states[name][loads.index(load), column] = value_of(mode)
    return states
