"""Pictures by their kinds (`picture_kinds.py`); what a picture needs is imported when it is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from cvt_hpc.picture_kinds import HISTORIES, KINDS, RESULTS

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def compose(
    name: str,
    datasets: Sequence[xr.Dataset],
    at: Mapping[str, Any] | None = None,
    sources: Sequence[str] = (),
    **options: Any,
) -> Figure:
    """Compose a picture of a kind.

    Parameters
    ----------
    name : str
        Of KINDS.
    datasets : sequence of Dataset
        Results of one study, one history or several, by the kind's subject.
    at : mapping, optional
        Axes of results to fix.
    sources : sequence of str, optional
        Where the datasets are from, for the errors.
    **options
        By their keys, and by the sides the axes put there; those left out have the defaults of the figure.

    Raises
    ------
    InputError
        As of the figure.
    """
    kind, given = KINDS[name], dict(options)
    if sides := {side: given.pop(side) for side in kind.sides if side in given}:
        from cvt_hpc.analysis.arrangement import Sides

        given["sides"] = Sides(**sides)
    if kind.subject == RESULTS:
        given["at"] = at
    subject: Any = datasets
    if kind.subject != HISTORIES:
        (subject,) = datasets
    if sources:
        given |= {"sources": sources} if kind.subject == HISTORIES else {"source": sources[0]}
    return function_of(kind.figure)(subject, **given)


def function_of(place: str) -> Any:
    """A function by its module in this room and its name."""
    module, _, name = place.partition(".")
    return getattr(import_module(f"cvt_hpc.analysis.{module}"), name)
