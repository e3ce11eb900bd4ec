"""The results of a branch in words: its Hopf points, and loads without a steady state.

`with_kinds` finds the kinds of the Hopf points of a branch, by the runs beside them.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from cvt_hpc.errors import few_of
from cvt_hpc.experiments.branch.attractors import FROM, Attractor, Followed
from cvt_hpc.experiments.branch.job import Asked, Diagram, load_attributes
from cvt_hpc.job.values import number_within, shown_number, shown_unit
from cvt_hpc.models.linear_stability.branch import CLOSE, Onset
from cvt_hpc.storage.archives import Arrays
from cvt_hpc.variator.band import steady_band
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Criticality, Kind, criticality

NAMED = ("friction_gradient", "sheave_stiffness")  # of every branch, axis or not
MOST_NAMED = 12  # loads in a row

# [N m]: how far runs from near the steady state may turn quiet from the Hopf point. They do so up to 5.3 N m
# off, since linear rates hold below 1 nm alone (README of linear_stability), and windows are 15 N m wide or
# more. On jobs/branch.toml 2.5 and 10 N m give the same verdicts
AGREEMENT = 5.0
# of the lowest frequency that is judged: vibrations that a mode below the band begins may lie in it, as those
# of 583 Hz beside a mode of 277. On jobs/branch.toml, judged from 300 Hz on, a third gives the same verdicts,
# since beside slow modes (185 Hz and less) no run begins to vibrate; at four thirds modes of 277-346 Hz are
# left undecided
SEEN = 2.0 / 3.0


def branch_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the lines that describe one branch."""
    yield f"{place_text(diagram, followed.asked)}:"
    yield from _onset_lines(diagram, followed)
    if not followed.onsets:
        yield "no Hopf point between the loads that have a steady state"
    yield from gap_lines(diagram, followed)
    yield from _left_out_lines(diagram, followed)
    loads = sorted({run.value for run in followed.runs if run.occurrence == OccurrenceClass.SLIPPING})
    if loads:
        yield f"the belt slips at {_load_text(diagram, *loads)}"


def place_text(diagram: Diagram, asked: Asked) -> str:
    """Return the place of a branch in words: other axes than the load, and leading parameters."""
    schema = diagram.job.schema
    values = {name: asked.parameters[name] for name in NAMED} | asked.place
    return ", ".join(
        f"{name.replace('_', ' ')} {schema.in_words(name, value)}" for name, value in values.items()
    )


def _onset_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield a line for each Hopf point."""
    along = load_attributes(diagram.job)
    for onset, kind in zip(followed.onsets, followed.kinds, strict=True):
        waves = f"{onset.half_waves} half wave{'s' if onset.half_waves > 1 else ''} in t{onset.strand + 1}"
        yield (
            f"Hopf point at {number_within(onset.load, CLOSE, along)} {shown_unit(along)}, "
            f"{onset.frequency:.0f} Hz, {waves}: {_direction(onset)}; {_kind_text(diagram, kind)}"
        )


def _direction(onset: Onset) -> str:
    if onset.others:
        return "a further mode becomes unstable" if onset.rising else "one of the unstable modes decays again"
    return "stability lost" if onset.rising else "stability regained"


def _kind_text(diagram: Diagram, kind: Criticality) -> str:
    """Return in words whether a Hopf point is super- or subcritical."""
    along = load_attributes(diagram.job)
    unit = shown_unit(along)
    if kind.kind is Kind.SUBCRITICAL:
        width = number_within(kind.width, CLOSE, along)
        if not np.isfinite(kind.error):
            return f"subcritical, hysteresis more than {width} {unit}"
        return f"subcritical, hysteresis {width} +- {number_within(kind.error, CLOSE, along)} {unit}"
    if kind.kind is Kind.SUPERCRITICAL:
        return f"supercritical within {number_within(abs(kind.width) + kind.error, CLOSE, along)} {unit}"
    return f"undecided whether subcritical, {kind.reason}"


def gap_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the lines that state where states were not found, and where stability changes unseen."""
    if missed := followed.states["load"][followed.missed].tolist():
        yield f"no steady state found at {_load_text(diagram, *missed, most=len(missed))}"
    for low, high in followed.hidden:
        between = f"{_load_number(diagram, low)} and {_load_text(diagram, high)}"
        yield f"stability changes between {between}, where a steady state is not found"


def _load_number(diagram: Diagram, load: float) -> str:
    """Return a load [N m] as a number in the unit of the job."""
    return f"{shown_number(load, load_attributes(diagram.job)):g}"


def _load_text(diagram: Diagram, *loads: float, most: int = MOST_NAMED) -> str:
    """Return loads [N m] in the unit of the job; of many the first ones and the last."""
    numbers = [_load_number(diagram, load) for load in loads]
    return f"{few_of(numbers, most)} {shown_unit(load_attributes(diagram.job))}"


def _left_out_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the line that states where there is no run from the steady state, because none is found."""
    begun = {run.value for run in followed.runs if run.start == 0}
    loads = [run.value for run in followed.runs if run.start == 1 and run.value not in begun]
    if loads:
        yield f"no run {FROM[0]} at {_load_text(diagram, *loads)}, where none is found"


def failure_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield a line for each run that failed."""
    place = place_text(diagram, followed.asked)
    for run in _failed_runs(followed):
        yield f"{place}: the run {FROM[run.start]} at {_load_text(diagram, run.value)} failed: {run.reason}"


def _failed_runs(followed: Followed) -> list[Attractor]:
    """Return the runs of a branch that ended without results."""
    return [run for run in followed.runs if run.occurrence == OccurrenceClass.FAILED]


def lowest_judged(asked: Asked, load: float) -> float:
    """Return the lowest frequency [Hz] of a mode by which runs of a branch under a load [N m] are judged."""
    return SEEN * steady_band(asked.parameters | {"load": load})[0]


def with_kinds(
    diagram: Diagram,
    asked: Asked,
    states: Arrays,
    hopf: list[Onset],
    hidden: list[tuple[float, float]],
    runs: list[Attractor],
) -> Followed:
    """Return a branch with the kinds of its Hopf points; reasons give loads in the unit of the job.

    States are those of `states_of`, the others as `judged` takes them.
    """
    lowest, in_words = partial(lowest_judged, asked), partial(_load_text, diagram)
    kinds = [judged(onset, hopf, hidden, runs, lowest, in_words) for onset in hopf]
    return Followed(asked, states, hopf, hidden, runs, kinds)


def judged(
    onset: Onset,
    hopf: list[Onset],
    hidden: list[tuple[float, float]],
    runs: list[Attractor],
    lowest: Callable[[float], float],
    in_words: Callable[[float], str],
) -> Criticality:
    """Judge whether a Hopf point is super- or subcritical, if its mode lies in the band of the runs.

    `hopf` and `hidden` are all of the branch, and where stability changes unseen, as `onsets` returns them.
    Runs are from near the steady state (start 0) and from the large start (1). Of a load [N m] `lowest`
    returns the lowest frequency of a mode that its runs are judged by [Hz], `in_words` the words.
    """
    if not runs:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "no runs were asked for")
    if onset.frequency < lowest(onset.load):
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "its mode lies below the band of runs")
    if onset.others:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "the steady state is unstable on both sides")
    loads = sorted({run.value for run in runs})
    classes = {(run.start, run.value): int(run.occurrence) for run in runs}
    small, large = ([classes.get((k, load), OccurrenceClass.NOT_RUN) for load in loads] for k in (0, 1))
    # on the stable side the steady state ends to be stable at the next mode, whatever its frequency
    ends = [load for ends in hidden for load in ends if (load < onset.load) == onset.rising]
    for other in hopf:
        if other is not onset and (
            other.frequency >= lowest(other.load) or (other.load < onset.load) == onset.rising
        ):
            ends.append(other.load)
    return criticality(
        onset.load,
        not onset.rising,
        loads,
        small,
        large,
        agreement=AGREEMENT,
        bracket=0.5 * CLOSE,
        limits=(
            max((load for load in ends if load <= onset.load), default=-np.inf),
            min((load for load in ends if load > onset.load), default=np.inf),
        ),
        in_words=in_words,
    )
