"""Variables of the oscillator in a record: its vibration, whether it sticks, the work of a cycle.

Whole cycles of the mass, and the energy that goes in and out in one of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.oscillator.motion import Oscillator, V, X, friction_forces, together
from cvt_hpc.storage.netcdf import attributes
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.vibration import assessment
from cvt_hpc.vibration.settings import PARAMETERS

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.oscillator.transient import Transient

SAMPLE_COST = 2e-7  # core-seconds of a sample, its judgement included
STEP_COST = {"moreau": 1.5e-8}  # core-seconds of a step in full lanes; of the others 1e-6
LANES = 64  # runs of a batch by `moreau`: so many share what a call takes
SAMPLES = 1 << 18  # of all runs of a batch, most: their spectra take 16 MB
LAW = ("friction_law", "table_file", "table_force", "table_speed", "table_mu")
_MARCH = ("duration", "shortest_duration", "sampling_rate", "step")


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
    Variable("friction_work", "J", "work of friction on the mass, mean of a cycle", may_miss=True),
    Variable("damping_loss", "J", "energy that the damper takes, mean of a cycle", may_miss=True),
    Variable(
        "energy_residual",
        "1",
        "work that the balance of these cycles leaves open, over the work converted",
        may_miss=True,
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

    Resolved parameters of a run are numbers or arrays of them.
    """
    p = parameters
    samples, step_cost = p["duration"] * p["sampling_rate"], STEP_COST.get(stepper, 1e-6)
    return lanes(p, stepper) * (SAMPLE_COST * samples + step_cost * p["duration"] / p.get("step", 1e-6))


def lanes(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Most runs that advance together; of parameters that are arrays, an array."""
    p = parameters
    found = np.clip(SAMPLES // (p["duration"] * p["sampling_rate"]), 1, LANES if stepper == "moreau" else 1)
    return found.astype(int) if found.ndim else int(found)


def lane_key(parameters: Mapping[str, Any]) -> tuple:
    """Values that all runs of one batch have in common."""
    return tuple(parameters.get(key) for key in (*_MARCH, *LAW, *PARAMETERS["vibration"]))


def judge(run: Transient) -> dict[str, Any]:
    """The record of a run that has reached its end, its cost apart; see `judge_together`."""
    return judge_together([run])[0]


def judge_together(runs: Sequence[Transient]) -> list[dict[str, Any]]:
    """The records of runs of one batch that have reached their ends, with all samples, but for their cost."""
    p, interval, first = runs[0].parameters, runs[0].interval, runs[0].first_judged
    rows = np.stack([run.rows for run in runs])
    motions = np.ascontiguousarray(rows[:, :, X:V])
    occurrences = assessment.assess_runs(motions, p["sampling_rate"], ("mass",), p)
    x, v = motions[:, first:, 0], rows[:, first:, V]
    several, slowest = together([run.constants for run in runs]), np.array([run.slowest for run in runs])
    forces = friction_forces(several, rows[:, first:], slowest, runs[0].is_set_valued)
    sticks = np.abs(several.belt_speed[:, np.newaxis] - v) <= slowest[:, np.newaxis]
    passages, half_strokes = cycle_starts(x, p["negligible_amplitude"]), 0.5 * np.ptp(x, axis=1)
    records = []
    for k, (run, found, starts) in enumerate(zip(runs, occurrences, passages, strict=True)):
        numbers = {one.name: np.ravel(getattr(found, one.name)).item() for one in assessment.VARIABLES}
        cycles = slice(starts[0], starts[-1]) if len(starts) > 1 else slice(None)
        records.append(
            {
                **found.verdict(),
                **numbers,
                "sticks": Sticks.YES if sticks[k].any() else Sticks.NO,
                "stuck_share": float(sticks[k, cycles].mean()),
                "half_stroke": float(half_strokes[k]),
                "cycles": max(len(starts) - 1, 0),
                **work_per_cycle(run.constants, v[k], forces[k], starts, interval),
                "steady_displacement": run.steady.displacement,
                "linear_growth_rate": run.steady.eigenvalue.real,
                "linear_frequency": abs(run.steady.eigenvalue.imag) / (2.0 * np.pi),
            }
        )
    return records


def histories(run: Transient) -> xr.Dataset:
    """Histories over `time` of a run, finished or failed, as far as it has samples.

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


def cycle_starts(x: np.ndarray, least: float) -> list[np.ndarray]:
    """Find where displacements, (run, n) [m], come up through the middle of their range.

    Of each run the samples before each passage, (cycles + 1,); empty where there are none, as of a motion
    with a half stroke up to `least` [m].
    """
    low, high = x.min(axis=1, keepdims=True), x.max(axis=1, keepdims=True)
    away = x - 0.5 * (high + low)
    rises = (away[:, :-1] < 0.0) & (away[:, 1:] >= 0.0) & (high - low > 2.0 * least)
    return [np.flatnonzero(own) for own in rises]


def work_per_cycle(
    o: Oscillator, speed: np.ndarray, friction: np.ndarray, starts: np.ndarray, interval: float
) -> dict[str, float]:
    """Mean work of a cycle, by the trapezoidal rule over the samples.

    `friction_work` and `damping_loss` [J], and `energy_residual`, what remains of friction's work after the
    loss and the change of kinetic energy, over the work that friction turns over either way; nan without a
    cycle.

    A jump of friction between two samples leaves an error of the first order in their interval [s], a
    sticking phase that falls between two is not seen: `energy_residual` shows it. The mass has speeds [m/s]
    and takes friction forces [N], (n,) each; `starts`, (cycles + 1,), are the samples at which cycles start
    and end.
    """
    if len(starts) < 2:
        return dict.fromkeys(("friction_work", "damping_loss", "energy_residual"), np.nan)
    cycles = slice(starts[0], starts[-1] + 1)
    v = speed[cycles]
    power = friction[cycles] * v
    rates = np.stack([power, np.abs(power), o.damping * v * v])
    work, turned_over, loss = np.trapezoid(rates, dx=interval).tolist()
    # cycles start at one displacement: spring and preload have done no work
    kinetic = 0.5 * o.mass * v[[0, -1]] ** 2
    left = work - loss - (kinetic[1] - kinetic[0])
    count = len(starts) - 1
    return {
        "friction_work": work / count,
        "damping_loss": loss / count,
        "energy_residual": float(left / turned_over),
    }
