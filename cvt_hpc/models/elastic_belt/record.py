"""What the record of a run holds of the elastic belt: names, units, and how each follows from the samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.elastic_belt import fluctuation
from cvt_hpc.models.elastic_belt.belt import MODES
from cvt_hpc.models.elastic_belt.grouping import cost, lane_key, lanes
from cvt_hpc.models.elastic_belt.history import histories
from cvt_hpc.models.elastic_belt.slip import VARIABLE as SLIP_MARGIN
from cvt_hpc.models.elastic_belt.slip import slid, slip_margin, with_slip
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.variator.variables import COORDINATES, shared
from cvt_hpc.vibration import assessment, ramp
from cvt_hpc.vibration.ramped import ramped
from cvt_hpc.vibration.signals import amplitude_spectrum, band_amplitude

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
]

RAMPED_CHANNELS = {"load": "load", "speed": "driving_speed"}  # by what a ramp changes

LOSSES = (
    "driving_flank_loss",
    "driven_flank_loss",
    "ring_loss",
    "belt_loss",
    "layer_loss",
    "lag_loss",
    "seating_loss",
)

VARIABLES = (
    *assessment.VARIABLES,
    *ramp.VARIABLES,
    Variable(
        "mode",
        ("strand",),
        "i1",
        "1",
        "half waves of the strongest mode of the strand in the band; 0: none",
        words="strongest mode",
    ),
    Variable(
        "modal_amplitude", ("strand", "half_waves"), "f8", "m", "amplitude of each sine mode in the band"
    ),
    Variable(
        "spectrum",
        ("strand", "frequency_bin"),
        "f8",
        "m",
        "at the strongest probe",
        words="amplitude spectrum",
    ),
    *shared("mean_ring_tension", "mean_push_force", "axial_force", "slip"),
    SLIP_MARGIN,
    Variable("open_share", ("pulley",), "f8", "1", "mean, out of contact", words="open share of the wrap"),
    *shared(
        "flank_loss",
        "thrust_ratio",
        "speed_loss",
        "driven_speed_ripple",
        "driving_power",
        "load_power",
        "thrust_power",
        "storing_power",
        "ring_loss",
        "belt_loss",
    ),
    Variable("layer_loss", (), "f8", "W", "mean power of the layers' longitudinal dampers"),
    Variable("lag_loss", (), "f8", "W", "mean power of the driven sheave's lag"),
    Variable(
        "seating_loss", (), "f8", "W", "mean elastic power carried out of the contact at the arcs' ends"
    ),
    *shared("loss", "power_residual"),
    Variable(
        "step_ripple",
        (),
        "f8",
        "m s-1",
        "speed that alternates from step to step, root mean square over the belt's mass and the judged part",
    ),
    *fluctuation.VARIABLES,
    Variable("least_strand_force", (), "f8", "N", "smallest T - P - m v^2 in a strand: below 0 it is slack"),
)


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions.

    Parameters
    ----------
    parameters : dict
        Flat parameters of the job.
    """
    step = parameters["spectrum_step"]
    bins = np.arange(0.0, parameters["band_high"] + step / 2, step)
    return {
        **COORDINATES,
        "arc_part": Coordinate(
            np.arange(1, fluctuation.ARC_PARTS + 1), "1", "part of the wrap", "from its inlet to its outlet"
        ),
        "ramp_share": ramp.coordinate(),
        "half_waves": Coordinate(np.arange(1, MODES + 1), "1", "half waves", "along the strand"),
        "frequency_bin": Coordinate(bins, "Hz", "frequency"),
    }


def judge(run: RecordedRun) -> dict[str, Any]:
    """The record of a run that has reached its end, or slipped through before, its cost apart.

    Parameters
    ----------
    run : RecordedRun
        With all samples recorded, or those until it slipped through.
    """
    if run.failure is not None:
        return _slipped(run, *run.failure)
    found = assess(run)
    return found.record() | evaluate(run, found.strongest_probe)


def assess(run: RecordedRun) -> assessment.Occurrence:
    """Whether and how a run vibrates that has reached its end; its probes are columns of the displacement."""
    p = run.parameters
    if ramped(p):
        return with_slip(run, _assess_ramp(run))  # type: ignore[arg-type]  # None is of a run before its end
    columns, strands = _on_strands(run)
    found = assessment.assess(run.displacement[:, columns], p["sampling_rate"], strands, p)
    return with_slip(run, replace(found, strongest_probe=columns[found.strongest_probe]))


def _assess_ramp(run: RecordedRun) -> ramp.RampOccurrence | None:
    """Whether and how a run vibrates along a ramp; None if it ended too soon to tell."""
    p, first, quantity = run.parameters, run.kick, ramped(run.parameters)
    columns, strands = _on_strands(run)
    rate, moved = p["sampling_rate"], run.displacement[first:, columns]
    values = run.channel(RAMPED_CHANNELS[quantity])[first:]
    found = ramp.assess_ramp(moved, rate, strands, quantity, values, run.samples - first, p)
    return found and replace(found, strongest_probe=columns[found.strongest_probe])


def _on_strands(run: RecordedRun) -> tuple[np.ndarray, list[str]]:
    """Columns of the displacement whose probes lie on strands, and on which."""
    regions = [probe.label.split()[0] for probe in run.probes]
    columns = [k for k, region in enumerate(regions) if region in STRANDS]
    return np.array(columns), [regions[k] for k in columns]


def _slipped(run: RecordedRun, status: Status, why: str) -> dict[str, Any]:
    """The record of a run that has slipped through before its end: what is known until then."""
    found = {"status": status, "vibrates": Vibrates.SLIPS, "reason": f"at {run.time * 1e3:.4g} ms: {why}"}
    before = _assess_ramp(run) if ramped(run.parameters) else None
    if before is not None:
        found = before.record() | found | {"reason": f"{found['reason']}; before: {before.reason}"[:240]}
    return found | slid(run)


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
    rate, band = p["sampling_rate"], (p["band_low"], p["band_high"])

    def mean(name: str) -> float:
        return float(run.channel(name)[judged].mean())

    def pair(name: str, labels: tuple[str, str]) -> np.ndarray:
        return np.array([mean(f"{name} {label}") for label in labels])

    modal = band_amplitude(run.modes[judged], rate, band)
    bins = coordinates(p)["frequency_bin"].values
    axial = pair("axial_force", PULLEYS)
    driven_speed = run.channel("driven_speed")[judged]
    loss = sum(mean(name) for name in LOSSES)
    stored = run.channel("stored_energy")[judged]
    storing = (stored[-1] - stored[0]) / ((stored.size - 1) * run.interval)
    open_power = mean("driving_power") - mean("load_power") - mean("thrust_power") - loss - storing
    return {
        "mode": np.where(modal.max(axis=1) > 0.0, 1 + modal.argmax(axis=1), 0),
        "modal_amplitude": modal,
        "spectrum": amplitude_spectrum(run.displacement[judged][:, strongest_probe], rate, bins).T,
        "mean_ring_tension": pair("ring_tension", STRANDS),
        "mean_push_force": pair("push_force", STRANDS),
        "axial_force": axial,
        "slip": pair("slip", PULLEYS),
        SLIP_MARGIN.name: slip_margin(run, judged),
        "open_share": pair("open_share", PULLEYS),
        "flank_loss": np.array([mean(f"{pulley}_flank_loss") for pulley in PULLEYS]),
        "thrust_ratio": axial[0] / axial[1],
        "speed_loss": 1.0 - p["ratio"] * driven_speed.mean() / run.mean_driving_speed(judged),
        "driven_speed_ripple": driven_speed.std(),
        "driving_power": mean("driving_power"),
        "load_power": mean("load_power"),
        "thrust_power": mean("thrust_power"),
        "storing_power": storing,
        **{name: mean(name) for name in LOSSES if "flank" not in name},
        "loss": loss,
        "power_residual": open_power / max(abs(mean("driving_power")), loss),
        "step_ripple": np.sqrt(np.mean(run.channel("step_ripple")[judged] ** 2)),
        **fluctuation_record(run),
        "least_strand_force": run.channel("least_strand_force")[judged].min(),
    }


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
