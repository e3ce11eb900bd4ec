"""What the record of a run holds: as of the elastic belt, and which rung it is of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from cvt_hpc.models.auto.rules import COARSENESS, SHARE, Rung
from cvt_hpc.models.elastic_belt import grouping
from cvt_hpc.models.elastic_belt import record as belt_record
from cvt_hpc.models.elastic_belt.record import coordinates, lane_key
from cvt_hpc.variables import Variable

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.auto.transient import ClimbingRun

__all__ = ["VARIABLES", "coordinates", "cost", "histories", "judge", "lane_key", "lanes"]

VARIABLES = (
    Variable("rung", (), "i1", "", "rung of the ladder that answered", Rung),
    Variable(
        "margin",
        (),
        "f8",
        "1",
        "distance of amplitude or slip from its threshold, the nearer one, in e-folds; 0: nothing decided",
    ),
    *belt_record.VARIABLES,
)
LANE_GROUPS = 16  # batches of coarse runs in one: what they leave open fills the lanes of full runs again
PILOT_SHARE = 1.0  # of a run's time that a pilot does: a shorter run would take another rung
REFINED = 0.2  # of the runs are done in full, more of them in a trace


def cost(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Core-seconds of a batch."""
    coarse = COARSENESS**2 * SHARE
    return LANE_GROUPS * (coarse + REFINED) * grouping.cost(dict(parameters), stepper)


def lanes(parameters: Mapping[str, Any], stepper: str) -> int:
    """Most runs that a batch can take."""
    return LANE_GROUPS * grouping.lanes(dict(parameters), stepper)


def judge(run: ClimbingRun) -> dict[str, Any]:
    """The record of a run that has ended, its cost apart."""
    return run.found


def histories(run: ClimbingRun) -> xr.Dataset:
    """Histories and profiles of the transient that answered; empty where none was needed."""
    import xarray as xr

    return xr.Dataset() if run.answering is None else belt_record.histories(run.answering)
