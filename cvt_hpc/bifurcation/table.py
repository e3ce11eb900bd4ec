"""What a branch says in words: its Hopf points, and where there is no steady state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.bifurcation.asking import Diagram
from cvt_hpc.job.values import in_words
from cvt_hpc.models.linear_stability.branch import Onset
from cvt_hpc.vibration.criticality import Criticality, Kind

if TYPE_CHECKING:
    from cvt_hpc.bifurcation.making import Followed


def branch_lines(diagram: Diagram, followed: Followed) -> Iterator[str]:
    """Yield the lines that tell of one branch."""
    if followed.asked.place:
        yield f"{place_text(diagram, followed.asked.place)}:"
    yield from onset_lines(followed)
    if not followed.onsets:
        yield "no Hopf point between the loads that have a steady state"
    yield from gap_lines(followed)


def place_text(diagram: Diagram, place: Mapping[str, Any]) -> str:
    """Values of the axes other than the load."""
    units = {axis.name: axis.unit for axis in diagram.axes}
    return ", ".join(f"{name.replace('_', ' ')} {in_words(v, units[name])}" for name, v in place.items())


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
