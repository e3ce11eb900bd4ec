"""What the record of a run of the belt drive holds, what a run costs, and how it is judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.belt_drive import pulleys as fields
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import STRANDS, judging
from cvt_hpc.variator.history import dataset
from cvt_hpc.variator.judging import pair
from cvt_hpc.variator.path import REGIONS, regions
from cvt_hpc.variator.slip import speed_loss
from cvt_hpc.variator.variables import COORDINATES, frequency_bins, shared
from cvt_hpc.vibration import assessment

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.belt_drive.transient import Transient

# Measured on one core of an EPYC beside other work: core-seconds per element and step, and per sample
STEP_COST, SAMPLE_COST = 4e-6, 6e-4

VARIABLES = (
    *assessment.VARIABLES,
    *shared("spectrum"),
    Variable("strand_tension", ("strand",), "f8", "N", "mean tension in the middle half of the strand"),
    *shared("slip"),
    replace(
        shared("speed_loss")[0], comment="1 - ratio x driven speed / driving speed, mean of whole belt turns"
    ),
    *shared("driven_speed_ripple"),
    Variable("friction_loss", ("pulley",), "f8", "W", "mean friction power of the belt on the pulley"),
    Variable("contact_loss", (), "f8", "W", "mean power of the contacts' normal damping"),
    replace(shared("belt_loss")[0], comment="mean power of the belt's damping along, across and in bending"),
    *shared("driving_power", "load_power", "storing_power", "loss", "power_residual"),
    Variable("efficiency", (), "f8", "1", "what is left of driving_power for load and storing"),
    Variable("turns", (), "i8", "1", "whole turns of the belt that speed_loss is the mean of"),
    Variable("unsolved_share", (), "f8", "1", "share of steps that were not solved to the tolerance"),
    Variable("iterations", (), "f8", "1", "of Newton's method in a step, mean"),
)


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions.

    Parameters
    ----------
    parameters : dict
        Flat parameters of the job.
    """
    return {**COORDINATES, "frequency_bin": frequency_bins(parameters)}


def cost(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    step = np.minimum(p["step"], 1.0 / p["sampling_rate"])
    return p["duration"] * (STEP_COST * p["elements"] / step + SAMPLE_COST * p["sampling_rate"])


def judge(run: Transient) -> dict[str, Any]:
    """The record of a run that has reached its end, or slipped through before, its cost apart.

    Parameters
    ----------
    run : Transient
        With all samples recorded, or those until it slipped through.
    """
    if run.failure is not None:
        return judging.slipped_through(run)
    found = judging.assess(run)
    return found.record() | evaluate(run, found.strongest_probe)


def evaluate(run: Transient, strongest_probe: np.ndarray) -> dict[str, Any]:
    """Values from a finished run of those VARIABLES that are the drive's own.

    Parameters
    ----------
    run : Transient
        With all samples recorded.
    strongest_probe : (2,) int array
        Column of the displacement that vibrates most, for each strand.

    Returns
    -------
    dict
        Value by name.
    """
    driving, load = run.mean_rate(fields.WORK_IN), run.mean_rate(fields.WORK_OUT)
    contact, belt = run.mean_rate(fields.CONTACT_LOSS), run.mean_rate(fields.BELT_LOSS)
    friction = np.array([run.mean_rate(fields.FRICTION_LOSS + k) for k in range(2)])
    storing = run.mean_rate(-1)
    work = run.counters()
    return {
        **judging.motion(run, strongest_probe),
        "speed_loss": speed_loss(run, run.whole_turns),
        "strand_tension": pair(run, "tension", STRANDS),
        "friction_loss": friction,
        "contact_loss": contact,
        "belt_loss": belt,
        **judging.power_balance(driving, load, contact + belt + friction.sum(), storing),
        "efficiency": (load + storing) / driving if driving > 0.0 else np.nan,
        "turns": run.turns,
        "unsolved_share": work["unsolved"] / max(work["steps"], 1),
        "iterations": work["iterations"] / max(work["steps"], 1),
    }


def histories(run: Transient) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed.

    Parameters
    ----------
    run : Transient
        With the samples that it has.

    Returns
    -------
    Dataset
        `displacement` (time, probe) [m], scalars over time, profiles of the judged part by `position`.
    """
    from cvt_hpc.models.belt_drive.readings import PROFILES

    comment = "mean over the middle half of the strand"
    over_time = {f"tension {k}": (f"tension {k}", "N", comment) for k in STRANDS}
    profiles = {name: (values, *PROFILES[name]) for name, values in run.profiles.items()}
    region = np.array(REGIONS)[regions(run.path, run.places)]
    return dataset(run, over_time, profiles, run.places, region)
