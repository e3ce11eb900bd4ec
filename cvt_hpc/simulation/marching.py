"""Batches marched to their ends, and runs marched together until each has its record.

`_OpenRun` is a run on its way to its record, with its next transient and the cost of its earlier ones. Most
runs are one transient. A run that fails by its numerics is done again from its start at half the step,
`most_refinements` times at most. A run that is undecided is prolonged to twice its time, and again, as long
as that is within `longest_duration`; with `shortest_duration` it begins with a part of its duration, at the
end of which only a certain verdict counts, and a vibration only if the part before has found one as well:
judder that sets in late may end it. All this goes by the run alone, whatever runs beside it. A model
that may answer by less than the full transient declares so in its record module (`contract.py`), and its
answers of this kind are neither refined nor prolonged.
"""

import math
import time
from collections.abc import Callable, Collection, Sequence

from cvt_hpc.job import Job
from cvt_hpc.models.contract import Batch, Run, load_model
from cvt_hpc.recording import first_duration, longest_duration, sample_count
from cvt_hpc.simulation.record import Point, blank_record, has_result, in_lanes, record_of, record_without_run
from cvt_hpc.variables import LONGEST_REASON, Status, Values, Vibrates, shortened
from cvt_hpc.vibration.assessment import is_certain
from cvt_hpc.vibration.ramped import ramped

_COST = ("core_seconds", "steps", "contact_solves")  # of a record: sums over all tries

_BETWEEN_POLLS = 0.05  # [s] of computing between checks whether to stop

More = Callable[[], Sequence[Point]]


def no_more() -> Sequence[Point]:
    """Return no points: no runs join."""
    return ()


class _OpenRun:
    """A run from its point to its record.

    `point` are its flat parameters [SI], `blank` is an empty record of the job, and `is_kept` tells whether
    `run` is to be there in the end.

    Attributes
    ----------
    is_preliminary : bool
        Whether the next transient is one that may answer in the place of the full one.
    next : dict
        Flat parameters of the transient that comes next [SI].
    paused : object or None
        The shorter run from which the next transient continues, by its `paused`; None: it begins anew.
    record : dict or None
        Value of each of `record_variables`; None until they are known.
    run : object or None
        The transient that counts, where it is kept and there is one.
    """

    def __init__(self, job: Job, point: Point, is_kept: bool, blank: Values) -> None:
        if not is_kept and point.get("profile_duration"):
            point = point | {"profile_duration": 0.0}  # only histories have profiles over time
        self._job, self._point, self._model = job, point, load_model(job.model)
        self._is_kept, self._blank = is_kept, blank
        self.next, self.paused = self._first(point), None
        self.record: Values | None = None
        self.run: Run | None = None
        self._refinements, self._vibrated = 0, False
        self._spent = dict.fromkeys(_COST, 0)
        self.is_preliminary = False
        self._begin_cheaply()

    def _begin_cheaply(self) -> None:
        values = self._model.known(self._point)
        if values is not None:
            self.record = record_without_run(self._job, values)
            return
        preliminary = self._model.preliminary(self._point)
        if preliminary is not None:
            self.next, self.is_preliminary = preliminary, True

    def take(self, run: Run, seconds: float, values: Values | None) -> None:
        """Look at a transient that has ended, and decide whether it counts or which one comes next.

        It has taken so many seconds of processor time. Values are as the model judges it; None of a
        preliminary one, and of one that has failed.
        """
        judge = self._model.settle if self.is_preliminary else lambda run: values
        record = record_of(self._job, run, seconds, judge, self._blank)
        record |= {name: record[name] + self._spent[name] for name in _COST}
        if self.is_preliminary and record["status"] != Status.DONE:
            self.is_preliminary = False
            self._begin(self._first(self._point), record)
        elif self.is_preliminary:
            self._end(run, record)
        elif record["status"] == Status.FAILED_NUMERICS and (finer := self._finer(run)):
            self._refinements += 1
            self._begin(self._first(finer), record)
        elif self._goes_on(run, record) and (longer := self._longer(run)):
            self._spent["core_seconds"] = record["core_seconds"]  # steps and solves are counted on
            self.next, self.paused = longer, run.paused()
        else:
            self._end(run, record)

    @staticmethod
    def _first(point: Point) -> Point:
        """Parameters of the first part of a run that may end early."""
        return point | {"duration": first_duration(point)} if "shortest_duration" in point else point

    def _goes_on(self, run: Run, record: Values) -> bool:
        """Whether more of a run may change its verdict."""
        if record["status"] != Status.DONE:
            return False
        left = sample_count(self._point) - sample_count(run.parameters) if "duration" in self._point else 0
        if left > 0:
            before, self._vibrated = self._vibrated, record["vibrates"] == Vibrates.YES
            if self._vibrated and not before:
                return True
            return not is_certain(record, run.parameters, left / self._point["sampling_rate"])
        return bool(record["vibrates"] == Vibrates.UNDECIDED)

    def _begin(self, parameters: Point, record: Values) -> None:
        self._spent, self._vibrated = {name: record[name] for name in _COST}, False
        self.next, self.paused = parameters, None

    def _end(self, run: Run, record: Values) -> None:
        self.run, self.paused = run if self._is_kept else None, None
        self.record = record | {"refinements": self._refinements}
        if self._refinements and record["status"] == Status.FAILED_NUMERICS:
            remedy = f"; failed at {1 + self._refinements} steps down to {record['time_step']:.3g} s"
            remedy += _remedy(self._job, self._point)
            self.record["reason"] = shortened(record["reason"], LONGEST_REASON - len(remedy)) + remedy

    def _finer(self, run: Run) -> Point | None:
        """The point at half the step of a run; None where it has no step, or has been refined enough."""
        if "step" not in self._point or self._refinements >= run.parameters["most_refinements"]:
            return None
        steps = max(math.ceil(run.interval / run.parameters["step"] - 1e-9), 1)
        return self._point | {"step": run.interval / (2 * steps)}

    def _longer(self, run: Run) -> Point | None:
        """The parameters of a run over twice its time; None where that is too long, or a ramp would end.

        The judged part keeps its share, but begins no sooner than the run was prolonged: sums over
        the judged part is not known of less than that.
        """
        p = run.parameters
        taken, whole = sample_count(p), sample_count(self._point)
        samples = min(2 * taken, whole) if taken < whole else 2 * taken
        duration = self._point["duration"] if samples == whole else samples / p["sampling_rate"]
        is_too_long = duration > longest_duration(self._point) * (1.0 + 1e-9)
        if is_too_long or ramped(p):
            return None
        judged = min(self._point["judged_fraction"], 1.0 - taken / samples)
        return {**p, "duration": duration, "judged_fraction": judged}


def _remedy(job: Job, point: Point) -> str:
    """Advice for a run that fails at every step, in words."""
    others = load_model(job.model).steppers
    ways = ['stepper = "explicit"'] if job.stepper == "imex" and "explicit" in others else []
    ways += ["a finer or coarser mesh (stations)"] if "stations" in point else []
    return f": try {' or '.join(ways)}" if ways else ""


class Interrupted(Exception):
    """The run was stopped before its end; the text states the reason."""


def march(
    batch: Batch, until: int | None = None, stop: Callable[[], str | None] | None = None
) -> tuple[float, str | None]:
    """March a batch of any model to its end, or to so many samples.

    `stop` is called every few tens of milliseconds; a text ends the march. Without it the batch is marched in
    one piece, and nothing but the runs is in the time. Returns the processor time [s], and the text of
    `stop`, where the batch has not come to its end, or None.
    """
    last = batch.samples if until is None else min(until, batch.samples)
    piece = last if stop is None else 1
    started = before = time.process_time()
    while batch.running and batch.done < last:
        if stop is not None and (why := stop()):
            return time.process_time() - started, why
        batch.advance(min(piece, last - batch.done))
        now = time.process_time()
        piece = 2 * piece if now - before < 0.5 * _BETWEEN_POLLS else piece
        before = now
    return time.process_time() - started, None


def march_runs(
    job: Job,
    points: Sequence[Point],
    interrupt: Callable[[], str | None],
    kept: Collection[int] = (),
    more: More = no_more,
) -> list[tuple[Run | None, Values]]:
    """Do runs to their records.

    All do their first transient, as many together as there are lanes, and so do the runs that join. Then
    those that are prolonged or done again fill lanes anew, and so on until none is left.

    Parameters
    ----------
    points : sequence of dict
        Flat parameters of the runs [SI].
    interrupt : callable
        Called every few tens of milliseconds; a text ends all runs.
    kept : collection of int
        Places in `points` whose transient is returned; the others are dropped after their verdict.
    more : callable
        Points of runs that join [SI]; called again and again until there are none.

    Returns
    -------
    list of (object or None, dict)
        In the order of the points, those that have joined last: the transient that counts, and the record.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    blank = blank_record(job)
    runs = [_OpenRun(job, point, place in kept, blank) for place, point in enumerate(points)]
    _march_once(job, runs, interrupt)
    while joining := [_OpenRun(job, point, False, blank) for point in more()]:
        _march_once(job, joining, interrupt)
        runs += joining
    while any(run.record is None for run in runs):
        _march_once(job, runs, interrupt)
    return [(run.run, run.record) for run in runs]  # type: ignore[misc]  # each has its record now


def _march_once(job: Job, runs: Sequence[_OpenRun], interrupt: Callable[[], str | None]) -> None:
    """March the next transients of runs that have no record yet to their ends."""
    left = [run for run in runs if run.record is None]
    model = load_model(job.model)
    for group in in_lanes(model, job.stepper, left, lambda run: run.next, lambda run: run.paused is None):
        _march_together(job, group, interrupt)


def _march_together(job: Job, group: Sequence[_OpenRun], interrupt: Callable[[], str | None]) -> None:
    """March the next transients of a group to their ends."""
    paused = [run.paused for run in group if run.paused is not None]
    model = load_model(job.model)
    batch = model.batch([run.next for run in group], job.stepper, paused)
    batch.advance(0)  # compiles or loads the kernels, which is no cost of these runs
    seconds, stopped = march(batch, stop=interrupt)
    if stopped:
        raise Interrupted(stopped)
    started = time.process_time()
    pairs = list(zip(group, batch.runs, strict=True))
    whole = [k for k, (run, marched) in enumerate(pairs) if not run.is_preliminary and has_result(marched)]
    values = dict(zip(whole, model.judge_together([pairs[k][1] for k in whole]), strict=True))
    seconds += time.process_time() - started
    for k, (run, marched) in enumerate(pairs):
        run.take(marched, seconds / len(group), values.get(k))
