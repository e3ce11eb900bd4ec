"""Variables of the oscillator in a record: its vibration, whether it sticks, the work of a cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.oscillator.cycles import cycle_starts, work_per_cycle
from cvt_hpc.models.oscillator.steady import steady_sliding
from cvt_hpc.netcdf import attributes
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.vibration import assessment

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.oscillator.transient import Transient

STEP_COST = 1e-6  # core-seconds of a step of moreau, and of a sample


class Sticks(IntEnum):
    """Whether the mass sticks to the belt at times; the CF flags of `sticks`."""

    NO = 0
    YES = 1


VARIABLES = (
    *(replace(variable, dims=()) for variable in assessment.VARIABLES),
    Variable(
        "sticks", "", "whether the mass sticks to the belt in the judged part", dtype="i1", flags=Sticks
    ),
    Variable("stuck_share", "1", "share of the samples at which the mass sticks, in whole cycles"),
    Variable("half_stroke", "m", "half of the way between the extremes of the judged part"),
    Variable("cycles", "1", "whole cycles in the judged part; 0 of a motion too small for any", dtype="i8"),
    Variable("friction_work", "J", "work of friction on the mass, mean of a cycle"),
    Variable("damping_loss", "J", "energy that the damper takes, mean of a cycle"),
    Variable(
        "energy_residual", "1", "work that the balance of these cycles leaves open, over the work converted"
    ),
    Variable("steady_displacement", "m", "displacement in steady sliding"),
    Variable("linear_growth_rate", "s-1", "growth rate of small motions about steady sliding, exact"),
    Variable("linear_frequency", "Hz", "frequency of small motions about steady sliding, exact"),
)


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions: it has none."""
    return {}


def cost(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Core-seconds of a run; of methods that choose their step, little is known.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of a run, each a number or an array of them.
    stepper : str
        Name of a stepper.
    """
    p = parameters
    samples = p["duration"] * p["sampling_rate"]
    return STEP_COST * (samples + p["duration"] / p.get("step", 1e-6))


def judge(run: Transient) -> dict[str, Any]:
    """The record of a run that has reached its end, its cost apart.

    Parameters
    ----------
    run : Transient
        With all samples recorded.
    """
    p, first = run.parameters, run.first_judged
    found = assessment.assess(run.displacement, p["sampling_rate"], ("mass",), p)
    numbers = {variable.name: float(getattr(found, variable.name)[0]) for variable in assessment.VARIABLES}
    x, is_stuck = run.displacement[first:, 0], run.is_stuck[first:]
    starts = cycle_starts(x, p["negligible_amplitude"])
    cycles = slice(starts[0], starts[-1]) if len(starts) > 1 else slice(None)
    steady = steady_sliding(run.constants)
    return {
        **found.record(),
        **numbers,
        "sticks": Sticks.YES if is_stuck.any() else Sticks.NO,
        "stuck_share": float(is_stuck[cycles].mean()),
        "half_stroke": 0.5 * float(np.ptp(x)),
        "cycles": max(len(starts) - 1, 0),
        **work_per_cycle(run, first + starts),
        "steady_displacement": steady.displacement,
        "linear_growth_rate": steady.eigenvalue.real,
        "linear_frequency": abs(steady.eigenvalue.imag) / (2.0 * np.pi),
    }


def histories(run: Transient) -> xr.Dataset:
    """Histories over `time` of a run, finished or failed.

    Parameters
    ----------
    run : Transient
        With the samples that it has.

    Returns
    -------
    Dataset
        `displacement` (time, probe) [m], `speed` [m/s] and `friction_force` [N] (time).
    """
    import xarray as xr

    displacement = attributes("displacement", "m", "of the mass, in the belt's direction")
    return xr.Dataset(
        {
            "displacement": (("time", "probe"), run.displacement, displacement),
            "speed": ("time", run.channel("speed"), attributes("speed", "m s-1", "of the mass")),
            "friction_force": ("time", run.friction(), attributes("friction force", "N", "on the mass")),
        },
        {
            "time": ("time", run.times, attributes("time", "s")),
            "probe": ("probe", np.array([p.label for p in run.probes], object), attributes("probe")),
        },
    )
