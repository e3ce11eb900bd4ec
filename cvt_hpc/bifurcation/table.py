"""The results of a branch in words: its Hopf points, and loads without a steady state."""

from collections.abc import Iterator

import numpy as np

from cvt_hpc.bifurcation.attractors import FROM, Attractor
from cvt_hpc.bifurcation.followed import Followed
from cvt_hpc.bifurcation.job import Asked, Diagram, load_attributes
from cvt_hpc.errors import few_of
from cvt_hpc.job.shown import number_within, shown_number, shown_unit
from cvt_hpc.models.linear_stability.branch import CLOSE, Onset
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Criticality, Kind

NAMED = ("friction_gradient", "sheave_stiffness")  # of every branch, axis or not
MOST_NAMED = 12  # loads in a row


def branch_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the lines that describe one branch."""
    yield f"{place_text(diagram, followed.asked)}:"
    yield from onset_lines(diagram, followed)
    if not followed.onsets:
        yield "no Hopf point between the loads that have a steady state"
    yield from gap_lines(diagram, followed)
    yield from left_out_lines(diagram, followed)
    loads = sorted({run.value for run in followed.runs if run.occurrence == OccurrenceClass.SLIPPING})
    if loads:
        yield f"the belt slips at {load_text(diagram, *loads)}"


def place_text(diagram: Diagram, asked: Asked) -> str:
    """Values of the axes other than the load, and of the parameters on which a branch depends most."""
    schema = diagram.job.schema
    values = {name: asked.parameters[name] for name in NAMED} | asked.place
    return ", ".join(
        f"{name.replace('_', ' ')} {schema.in_words(name, value)}" for name, value in values.items()
    )


def onset_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield a line for each Hopf point."""
    along = load_attributes(diagram.job)
    for onset, kind in zip(followed.onsets, followed.kinds, strict=True):
        waves = f"{onset.half_waves} half wave{'s' if onset.half_waves > 1 else ''} in t{onset.strand + 1}"
        yield (
            f"Hopf point at {number_within(onset.load, CLOSE, along)} {shown_unit(along)}, "
            f"{onset.frequency:.0f} Hz, {waves}: {_direction(onset)}; {kind_text(diagram, kind)}"
        )


def _direction(onset: Onset) -> str:
    if onset.others:
        return "a further mode becomes unstable" if onset.rising else "one of the unstable modes decays again"
    return "stability lost" if onset.rising else "stability regained"


def kind_text(diagram: Diagram, kind: Criticality) -> str:
    """Whether a Hopf point is super- or subcritical."""
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
        yield f"no steady state found at {load_text(diagram, *missed, most=len(missed))}"
    for low, high in followed.hidden:
        between = f"{load_number(diagram, low)} and {load_text(diagram, high)}"
        yield f"stability changes between {between}, where a steady state is not found"


def load_number(diagram: Diagram, load: float) -> str:
    """A load [N m] in the unit of the job, without that unit."""
    return f"{shown_number(load, load_attributes(diagram.job)):g}"


def load_text(diagram: Diagram, *loads: float, most: int = MOST_NAMED) -> str:
    """Loads [N m] in the unit of the job; of many the first ones and the last."""
    numbers = [load_number(diagram, load) for load in loads]
    return f"{few_of(numbers, most)} {shown_unit(load_attributes(diagram.job))}"


def left_out_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the line that states where there is no run from the steady state, because none is found."""
    begun = {run.value for run in followed.runs if run.start == 0}
    loads = [run.value for run in followed.runs if run.start == 1 and run.value not in begun]
    if loads:
        yield f"no run {FROM[0]} at {load_text(diagram, *loads)}, where none is found"


def failure_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield a line for each run that failed."""
    place = place_text(diagram, followed.asked)
    for run in failed_runs(followed):
        yield f"{place}: the run {FROM[run.start]} at {load_text(diagram, run.value)} failed: {run.reason}"


def failed_runs(followed: Followed) -> list[Attractor]:
    """Runs of a branch that ended without results."""
    return [run for run in followed.runs if run.occurrence == OccurrenceClass.FAILED]
