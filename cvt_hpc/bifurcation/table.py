"""What a branch says in words: its Hopf points, and where there is no steady state."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.bifurcation.attractors import FROM, Attractor
from cvt_hpc.bifurcation.job import Asked, Diagram
from cvt_hpc.errors import few_of
from cvt_hpc.models.linear_stability.branch import Onset
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Criticality, Kind

if TYPE_CHECKING:
    from cvt_hpc.bifurcation.followed import Followed

NAMED = ("friction_gradient", "sheave_stiffness")  # of every branch, axis or not
MOST_NAMED = 12  # loads in a row


def branch_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the lines that tell of one branch."""
    yield f"{place_text(diagram, followed.asked)}:"
    yield from onset_lines(followed)
    if not followed.onsets:
        yield "no Hopf point between the loads that have a steady state"
    yield from gap_lines(followed)
    yield from left_out_lines(followed)
    loads = sorted({run.value for run in followed.runs if run.occurrence == OccurrenceClass.SLIPPING})
    if loads:
        yield f"the belt slips at {few_of([f'{load:g}' for load in loads], MOST_NAMED)} N m"


def place_text(diagram: Diagram, asked: Asked) -> str:
    """Values of the axes other than the load, and of what a branch depends on most."""
    schema = diagram.job.schema
    values = {name: asked.parameters[name] for name in NAMED} | asked.place
    return ", ".join(
        f"{name.replace('_', ' ')} {schema.in_words(name, value)}" for name, value in values.items()
    )


def onset_lines(followed: Followed) -> Iterator[str]:
    """Yield a line for each Hopf point."""
    for onset, kind in zip(followed.onsets, followed.kinds, strict=True):
        mode = onset.mode
        waves = f"{mode.half_waves} half wave{'s' if mode.half_waves > 1 else ''} in t{mode.strand + 1}"
        yield (
            f"Hopf point at {onset.load:.1f} N m, {mode.frequency:.0f} Hz, {waves}: {_direction(onset)}; "
            f"{kind_text(kind)}"
        )


def _direction(onset: Onset) -> str:
    if onset.others:
        return "a further mode becomes unstable" if onset.rising else "one of the unstable modes decays again"
    return "stability lost" if onset.rising else "stability regained"


def kind_text(kind: Criticality) -> str:
    """Whether a Hopf point is super- or subcritical."""
    if kind.kind is Kind.SUBCRITICAL:
        size = f"more than {kind.width:.1f} N m"
        if np.isfinite(kind.error):
            size = f"{kind.width:.1f} +- {kind.error:.1f} N m"
        return f"subcritical, hysteresis {size}"
    if kind.kind is Kind.SUPERCRITICAL:
        return f"supercritical within {abs(kind.width) + kind.error:.1f} N m"
    return f"undecided whether subcritical, {kind.reason}"


def gap_lines(followed: Followed) -> Iterator[str]:
    """Yield the lines that say where states were not found, and where stability changes unseen."""
    if followed.branch.missed:
        loads = ", ".join(f"{load:g}" for load in sorted(followed.branch.missed))
        yield f"no steady state found at {loads} N m"
    for low, high in followed.hidden:
        yield f"stability changes between {low:g} and {high:g} N m, where a steady state is not found"


def left_out_lines(followed: Followed) -> Iterator[str]:
    """Yield the line that says where there is no run from the steady state, because none is found."""
    begun = {run.value for run in followed.runs if run.start == 0}
    loads = [f"{run.value:g}" for run in followed.runs if run.start == 1 and run.value not in begun]
    if loads:
        yield f"no run {FROM[0]} at {few_of(loads, MOST_NAMED)} N m, where none is found"


def failure_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield a line for each run that failed."""
    place = place_text(diagram, followed.asked)
    for run in failed_runs(followed):
        yield f"{place}: the run {FROM[run.start]} at {run.value:g} N m failed: {run.reason}"


def failed_runs(followed: Followed) -> list[Attractor]:
    """Runs of a branch that ended without results."""
    return [run for run in followed.runs if run.occurrence == OccurrenceClass.FAILED]
