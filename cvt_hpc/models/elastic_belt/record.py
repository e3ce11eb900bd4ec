"""Variables of the record of the elastic belt: names, units, and how each follows from the samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.elastic_belt import fluctuation, ring_record
from cvt_hpc.models.elastic_belt.belt import MODES
from cvt_hpc.models.elastic_belt.grouping import cost, lane_key, lanes
from cvt_hpc.models.elastic_belt.history import histories
from cvt_hpc.models.elastic_belt.momentary import profile_bytes
from cvt_hpc.models.elastic_belt.power_terms import POWERS
from cvt_hpc.models.elastic_belt.pulley_settings import PULLEY_DEFAULTS, are_free, oil_factor
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import PULLEYS, judging
from cvt_hpc.variator.band import band
from cvt_hpc.variator.judging import assess, each, efficiency, mean, power_balance
from cvt_hpc.variator.slip import VARIABLES as AGAINST_SLIP
from cvt_hpc.variator.slip import capacity, slide
from cvt_hpc.variator.variables import COORDINATES, frequency_bins, shared
from cvt_hpc.vibration import assessment, peaks, ramp
from cvt_hpc.vibration.signals import band_amplitude

if TYPE_CHECKING:
    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun

__all__ = [
    "VARIABLES",
    "assess",
    "coordinates",
    "cost",
    "evaluate",
    "histories",
    "judge",
    "lane_key",
    "lanes",
    "profile_bytes",
]

LOSSES = tuple(name for name in POWERS if name.endswith("_loss"))

VARIABLES = (
    *assessment.VARIABLES,
    *ramp.VARIABLES,
    Variable(
        "mode",
        "1",
        "half waves of the strongest mode of the strand in the band; 0: none",
        dims=("strand",),
        dtype="i1",
        words="strongest mode",
    ),
    Variable(
        "modal_amplitude", "m", "amplitude of each sine mode in the band", dims=("strand", "half_waves")
    ),
    *peaks.VARIABLES,
    *shared("spectrum", "mean_ring_tension", "mean_push_force", "axial_force", "slip"),
    *AGAINST_SLIP,
    Variable(
        "slip_load",
        "N m",
        "load from which on a pulley of a run that slips through slips grossly for good",
        words="load at gross slip",
    ),
    Variable(
        "piston_force",
        "N",
        "mean force of a piston's pressure, or force required: axial force less spring and centrifugal oil",
        dims=("pulley",),
        words="piston force",
    ),
    Variable(
        "sheave_tilt",
        "rad",
        "mean angle that the tilt of the collar and the bending of the shaft put between the sheaves",
        dims=("pulley",),
        words="angle between sheaves",
    ),
    Variable("open_share", "1", "mean, out of contact", dims=("pulley",), words="open share of the wrap"),
    *shared("flank_loss", "thrust_ratio", "speed_loss", "driven_speed_ripple", "driving_power", "load_power"),
    *shared("thrust_power", "storing_power", "ring_loss", "belt_loss", "layer_loss"),
    Variable("lag_loss", "W", "mean power of the driven sheave's lag"),
    *shared("seating_loss", "loss", "efficiency", "power_residual"),
    Variable(
        "step_ripple",
        "m s-1",
        "speed that alternates from step to step, root mean square over the belt's mass and the judged part",
    ),
    *ring_record.VARIABLES,
    *fluctuation.VARIABLES,
    Variable("least_strand_force", "N", "smallest T - P - m v^2 in a strand: below 0 it is slack"),
)


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions.

    Parameters
    ----------
    parameters : dict
        Flat parameters of the job.
    """
    of_peaks = {"peak": peaks.coordinate()} if parameters["modal_peaks"] == "on" else {}
    return {
        **COORDINATES,
        **of_peaks,
        **ring_record.coordinates(parameters),
        "arc_part": Coordinate(
            np.arange(1, fluctuation.ARC_PARTS + 1), "1", "part of the wrap", "from its inlet to its outlet"
        ),
        "ramp_share": ramp.coordinate(),
        "half_waves": Coordinate(np.arange(1, MODES + 1), "1", "half waves", "along the strand"),
        "frequency_bin": frequency_bins(parameters),
    }


def judge(run: RecordedRun) -> dict[str, Any]:
    """The record of a run that has reached its end, or slipped through before, its cost apart.

    Parameters
    ----------
    run : RecordedRun
        With all samples recorded, or those until it slipped through.
    """
    if run.failure is not None:
        samples = slide(run)
        shares = [run.channel(f"open_share {pulley}")[samples].mean() for pulley in PULLEYS]
        load = run.channel("load")[samples.start]
        return judging.slipped(run) | {"open_share": np.array(shares), "slip_load": load}
    found = assess(run)
    return found.record() | evaluate(run, found.strongest_probe)


def evaluate(run: RecordedRun, strongest_probe: np.ndarray) -> dict[str, Any]:
    """Values from a finished run of those VARIABLES that are the belt's own.

    Parameters
    ----------
    run : RecordedRun
        With all samples recorded.
    strongest_probe : (2,) int array
        Column of the displacement that vibrates most, for each strand.

    Returns
    -------
    dict
        Value by name.
    """
    p, judged = run.parameters, run.judged
    rate, judged_band = p["sampling_rate"], band(run)
    modal = band_amplitude(run.modes[judged], rate, judged_band)
    of_peaks = p["modal_peaks"] == "on"
    losses = {name: mean(run, name) for name in LOSSES}
    stored = run.channel("stored_energy")[judged]
    storing = (stored[-1] - stored[0]) / ((stored.size - 1) * run.interval)
    driving, load, thrust = (mean(run, f"{name}_power") for name in ("driving", "load", "thrust"))
    loss = sum(losses.values())
    return {
        "mode": np.where(modal.max(axis=1) > 0.0, 1 + modal.argmax(axis=1), 0),
        "modal_amplitude": modal,
        **(peaks.modal_peaks(run.modes[judged], rate, judged_band).record() if of_peaks else {}),
        **judging.evaluate(run, strongest_probe),
        **capacity(run, judged),
        "open_share": each(run, "open_share"),
        "piston_force": piston_forces(run),
        "sheave_tilt": each(run, "tilt") / [run.path.driving_radius, run.path.driven_radius],
        **power_balance(driving, load, loss, storing, thrust),
        "efficiency": efficiency(driving, load, loss),
        "thrust_power": thrust,
        **{name: loss for name, loss in losses.items() if "flank" not in name},
        "step_ripple": np.sqrt(np.mean(run.channel("step_ripple")[judged] ** 2)),
        **ring_record.layer_record(run),
        **fluctuation_record(run),
        "least_strand_force": run.channel("least_strand_force")[judged].min(),
    }


def piston_forces(run: RecordedRun) -> np.ndarray:
    """Mean force of the pressure on the pistons [N], (2,); the axial position is at rest in the mean."""
    p = PULLEY_DEFAULTS | dict(run.parameters)
    turning = np.array([(run.channel(f"{pulley}_speed")[run.judged] ** 2).mean() for pulley in PULLEYS])
    # the driving spring is counted from the opening that is given
    shifts = np.array([mean(run, f"{pulley}_position") for pulley in PULLEYS]) - [p["driving_position"], 0.0]
    rates, forces = (
        np.array([p[f"{pulley}_spring_{name}"] for pulley in PULLEYS]) for name in ("rate", "force")
    )
    oil = np.array([oil_factor(p[f"{pulley}_piston"], p["oil_density"]) for pulley in PULLEYS])
    return each(run, "axial_force") - forces - rates * shifts - oil * turning


def fluctuation_record(run: RecordedRun) -> dict[str, Any]:
    """Values from a finished run of `fluctuation.VARIABLES`.

    Parameters
    ----------
    run : RecordedRun
        With all samples recorded.
    """
    p, judged, found = run.parameters, run.judged, run.fluctuation
    shares, dual = fluctuation.part_shares(run.mesh), fluctuation.at_stations(run.mesh.cell)
    fed = {"flank_fed": shares @ found.flanks, "stress_fed": found.stresses.sum()}
    lag = run.channel("axial_force driven")[judged].var() / (p["sheave_lag"] * p["lag_stiffness"])
    if are_free(p):
        # tilts and the driving sheave have lags, too; the mean motion, at rest, takes nothing in them
        lag = run.channel("lag_loss")[judged].mean()
    taken = {
        "belt_taken": -found.belt.sum(),
        "ring_taken": -found.rings.sum(),
        "layer_taken": run.channel("layer_loss")[judged].mean() - found.mean_layers,
        "lag_taken": fluctuation.steadiness(p) * lag,
        "carried_power": -found.carried.sum(),
    }
    remainder = fed["flank_fed"].sum() + fed["stress_fed"] - sum(taken.values())
    values = fed | taken | {"fluctuation_remainder": remainder}
    return {"part_flank_loss": -(shares * dual) @ run.means["flank_power"], **values}
