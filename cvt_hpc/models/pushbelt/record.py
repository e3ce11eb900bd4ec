"""What the record of a run of the pushbelt holds, what a run costs, and how it is judged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.pushbelt import belt as fields
from cvt_hpc.netcdf import attributes
from cvt_hpc.variables import Coordinate, Variable, Vibrates
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.variator.path import REGIONS, regions
from cvt_hpc.variator.variables import COORDINATES, shared
from cvt_hpc.vibration import assessment, ramp
from cvt_hpc.vibration.ramped import ramped
from cvt_hpc.vibration.signals import amplitude_spectrum

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.pushbelt.transient import Transient

# Measured on one core of an EPYC (Zen 5): core-seconds per element and step, and per sample
RIGID_COST, ELASTIC_COST, SAMPLE_COST = 5.2e-7, 9.3e-7, 2e-4
GROSS_SLIP = 0.05  # of the belt's speed
RAMPED_CHANNELS = {"load": "load", "speed": "driving_speed"}  # by what a ramp changes

VARIABLES = (
    *assessment.VARIABLES,
    *ramp.VARIABLES,
    Variable(
        "spectrum",
        ("strand", "frequency_bin"),
        "f8",
        "m",
        "at the strongest probe",
        words="amplitude spectrum",
    ),
    *shared("mean_ring_tension", "mean_push_force", "axial_force", "slip", "flank_loss", "thrust_ratio"),
    *shared("speed_loss", "driven_speed_ripple", "driving_power", "load_power", "thrust_power"),
    *shared("storing_power", "ring_loss", "belt_loss"),
    Variable("tilt_loss", (), "f8", "W", "mean power of the dampers of the elements' tilt"),
    *shared("loss", "power_residual"),
    Variable("efficiency", (), "f8", "1", "mean power of the load over that of the driving pulley"),
    Variable("largest_push_force", (), "f8", "N", "largest along the path, of means over the judged part"),
    Variable(
        "driven_radius_found", (), "f8", "m", "mean radius at which the flanks touch the driven sheaves"
    ),
    Variable("passing_frequency", (), "f8", "Hz", "mean, of elements that pass a point of the path"),
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
    step = parameters["spectrum_step"]
    bins = np.arange(0.0, parameters["band_high"] + step / 2, step)
    return {
        **COORDINATES,
        "ramp_share": ramp.coordinate(),
        "frequency_bin": Coordinate(bins, "Hz", "frequency"),
    }


def cost(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    each = np.where(np.isinf(p["sheave_stiffness"]), RIGID_COST, ELASTIC_COST)[()]
    return p["duration"] * (each * p["elements"] / p["step"] + SAMPLE_COST * p["sampling_rate"])


def judge(run: Transient) -> dict[str, Any]:
    """The record of a run that has reached its end, or slipped through before, its cost apart.

    Parameters
    ----------
    run : Transient
        With all samples recorded, or those until it slipped through.
    """
    p, labels = run.parameters, [probe.label.split()[0] for probe in run.probes]
    if run.failure is not None:
        status, why = run.failure
        return {"status": status, "vibrates": Vibrates.SLIPS, "reason": f"at {run.time * 1e3:.4g} ms: {why}"}
    if quantity := ramped(p):
        first = min(int(np.ceil(p["rise_time"] * p["sampling_rate"])), run.samples)
        values = run.channel(RAMPED_CHANNELS[quantity])[first:]
        found: Any = ramp.assess_ramp(
            run.displacement[first:], p["sampling_rate"], labels, quantity, values, run.samples - first, p
        )
    else:
        found = assessment.assess(run.displacement, p["sampling_rate"], labels, p)
    record = found.record() | evaluate(run, found.strongest_probe)
    largest = np.abs(record["slip"]).max()
    if largest > GROSS_SLIP:
        record["vibrates"] = Vibrates.SLIPS
        record["reason"] = f"a pulley slips by {largest:.3g} of the belt's speed"
    return record


def evaluate(run: Transient, strongest_probe: np.ndarray) -> dict[str, Any]:
    """Values from a finished run of those VARIABLES that are the belt's own.

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
    p, judged = run.parameters, run.judged

    def mean(name: str) -> float:
        return float(run.channel(name)[judged].mean())

    def pair(name: str, labels: tuple[str, str]) -> np.ndarray:
        return np.array([mean(f"{name} {label}") for label in labels])

    axial, driven_speed = pair("axial_force", PULLEYS), run.channel("driven_speed")[judged]
    radii = np.stack([run.channel(f"{pulley}_radius")[judged] for pulley in PULLEYS])
    driving, load = run.mean_rate(fields.WORK_IN), run.mean_rate(fields.WORK_OUT)
    ring = run.mean_rate(fields.RING_LOSS)
    belt, tilt = run.mean_rate(fields.BELT_LOSS), run.mean_rate(fields.DAMPING_LOSS)
    loss = run.mean_rate(fields.FLANK_LOSS) + ring + belt + tilt
    # both sheaves of a pulley give way by the tangent of the wedge angle
    widening = -2.0 * np.tan(p["half_wedge_angle"]) * (radii[:, -1] - radii[:, 0])
    thrust = float(axial @ widening) / ((radii.shape[1] - 1) * run.interval)
    storing = run.mean_rate(fields.TOTALS)
    work = run.counters()
    return {
        "spectrum": amplitude_spectrum(
            run.displacement[judged][:, strongest_probe],
            p["sampling_rate"],
            coordinates(p)["frequency_bin"].values,
        ).T,
        "mean_ring_tension": pair("ring_tension", STRANDS),
        "mean_push_force": pair("push_force", STRANDS),
        "axial_force": axial,
        "slip": pair("slip", PULLEYS),
        "flank_loss": np.array([mean(f"{pulley}_flank_loss") for pulley in PULLEYS]),
        "thrust_ratio": axial[0] / axial[1],
        "speed_loss": 1.0 - p["ratio"] * driven_speed.mean() / run.channel("driving_speed")[judged].mean(),
        "driven_speed_ripple": driven_speed.std(),
        "driving_power": driving,
        "load_power": load,
        "thrust_power": thrust,
        "storing_power": storing,
        "ring_loss": ring,
        "belt_loss": belt,
        "tilt_loss": tilt,
        "loss": loss,
        "power_residual": (driving - load - thrust - loss - storing) / max(abs(driving), loss),
        "efficiency": load / driving if driving > 0.0 else np.nan,
        "largest_push_force": np.nanmax(run.profiles["push_force"]),
        "driven_radius_found": radii[1].mean(),
        "passing_frequency": mean("passing_frequency"),
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
    import xarray as xr

    from cvt_hpc.models.pushbelt.readings import PROFILES

    time = (1 + np.arange(run.done)) * run.interval
    variables: dict[str, Any] = {
        "displacement": (
            ("time", "probe"),
            run.displacement,
            attributes("displacement", "m", "transverse, outward"),
        )
    }
    over_time = {
        "load": ("load", "N m", "torque at the driving pulley"),
        "driving_speed": ("driving speed", "rad s-1", "of the driving pulley"),
        "driven_speed": ("driven speed", "rad s-1", "of the driven pulley"),
        "driven_radius": ("driven radius", "m", "at which the flanks touch the driven sheaves"),
    }
    for name, named in over_time.items():
        variables[name] = ("time", run.channel(name), attributes(*named))
    for name, labels in (("push_force", STRANDS), ("ring_tension", STRANDS), ("axial_force", PULLEYS)):
        for label in labels:
            words = f"{name.replace('_', ' ')} {label}"
            variables[f"{name}_{label}"] = (
                "time",
                run.channel(f"{name} {label}"),
                attributes(
                    words, "N", "mean over the middle half of the strand" if labels is STRANDS else ""
                ),
            )
    for name, values in run.profiles.items():
        variables[name] = ("position", values, attributes(*PROFILES[name]))
    region = np.array(REGIONS)[regions(run.path, run.places)]
    coordinates = {
        "time": ("time", time, attributes("time", "s")),
        "probe": ("probe", np.array([probe.label for probe in run.probes], object), attributes("probe")),
        "probe_position": (
            "probe",
            np.array([probe.position for probe in run.probes]),
            attributes("position of the probe", "m", "path coordinate"),
        ),
        "position": (
            "position",
            run.places,
            attributes("position", "m", "path coordinate, from the inlet of the driving arc"),
        ),
        "region": ("position", region.astype(object), attributes("region", comment="of the path")),
    }
    return xr.Dataset(variables, coordinates)
