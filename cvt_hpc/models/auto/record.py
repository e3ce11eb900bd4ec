"""The record of a run: as of the elastic belt, and the model of the ladder that gave it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cvt_hpc.models.auto.rules import COARSENESS, SHARE, Rung, coarse, is_clear, is_passive, is_settled
from cvt_hpc.models.elastic_belt import grouping
from cvt_hpc.models.elastic_belt import record as belt_record
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Status, Values, Variable, Vibrates, shortened
from cvt_hpc.variator import judging

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun
    from cvt_hpc.vibration.assessment import Occurrence

VARIABLES = (
    Variable("rung", "", "model of the ladder that answered", dtype="i1", flags=Rung),
    Variable(
        "margin",
        "1",
        "distance of amplitude or slip from its threshold, the nearer one, in e-folds; 0: nothing decided",
    ),
    *belt_record.VARIABLES,
)
PILOT_SHARE = 1.0  # of a run's time that a pilot does: a shorter run would use another model
_REFINED = 0.2  # of the runs are done in full, more of them in a trace


def cost(parameters: Parameters, stepper: str) -> Any:
    """Core-seconds of runs that fill the lanes once."""
    coarse = COARSENESS**2 * SHARE
    return (coarse + _REFINED) * grouping.cost(parameters, stepper)


def known(parameters: Parameters) -> Values | None:
    """The values of a run that needs no transient; None where it does.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    """
    if not is_passive(parameters):
        return None
    reason = "friction does not fall with sliding speed"
    return {"status": Status.DONE, "vibrates": Vibrates.NO, "reason": reason, "rung": Rung.PASSIVE}


coordinates, lane_key, lanes = belt_record.coordinates, grouping.lane_key, grouping.lanes
preliminary = coarse


def settle(run: RecordedRun) -> Values | None:
    """The values of a coarse run if it answers the question, else None.

    Parameters
    ----------
    run : RecordedRun
        With all samples recorded, or those until it slipped through: then a full run answers.
    """
    if run.failure is not None:
        return None
    found = judging.assess(run)
    if not is_settled(run.parameters, found):
        return None
    values = _values(run, found, Rung.COARSE)
    if not is_clear(run.parameters, found):
        reason = shortened(f"too close for a coarse run: {found.reason}")
        values |= {"vibrates": Vibrates.UNDECIDED, "reason": reason}
    return values


def judge(run: RecordedRun) -> Values:
    """The record of a full run that has reached its end, or slipped through before, its cost apart."""
    if run.failure is not None:
        return belt_record.judge(run) | {"rung": Rung.FULL}
    return _values(run, judging.assess(run), Rung.FULL)


def _values(run: RecordedRun, found: Occurrence, rung: Rung) -> Values:
    return judging.finished(run, belt_record.VARIABLES, found) | {"rung": rung, "margin": found.margin}


def histories(run: RecordedRun | None) -> xr.Dataset:
    """Histories and profiles of the transient that answered; empty where none was needed."""
    import xarray as xr

    return xr.Dataset() if run is None else belt_record.histories(run)
