"""What the record of a run of the spatial pushbelt holds, what a run costs, and how it is judged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.pushbelt import record as pushbelt
from cvt_hpc.models.spatial_pushbelt import readings
from cvt_hpc.physics.out_of_plane import clamped_force
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import PULLEYS, STRANDS, judging
from cvt_hpc.variator.history import REGIONS, regions
from cvt_hpc.variator.judging import each, mean
from cvt_hpc.variator.slip import slide
from cvt_hpc.variator.variables import frequency_bins
from cvt_hpc.vibration import assessment, ramp
from cvt_hpc.vibration.signals import amplitude_spectrum

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.pushbelt.run import ElementRun

# Measured on one core of an EPYC (Zen 5): core-seconds per element and step, and per sample
RIGID_COST, ELASTIC_COST, SAMPLE_COST = 2.4e-6, 3.3e-6, 1e-3
OF_TWO = 1.6  # cost of a step with two flows of ring material by that of one with one

# told of each strand, in the plane of the belt and out of it
_OF_STRANDS = tuple(v for v in (*assessment.VARIABLES, *ramp.VARIABLES) if v.dims[:1] == ("strand",))
VARIABLES = (
    *pushbelt.VARIABLES,
    *(
        Variable(f"lateral_{v.name}", v.units, f"as {v.name}, out of the plane", dims=v.dims, dtype=v.dtype)
        for v in _OF_STRANDS
    ),
    Variable(
        "lateral_spectrum",
        "m",
        "at the probe strongest out of the plane",
        dims=("strand", "frequency_bin"),
        words="lateral amplitude spectrum",
    ),
    Variable("sheave_force", "N", "mean axial force of the belt on each sheave, outwards", dims=("sheave",)),
    Variable("sheave_loss", "W", "mean friction power of the flanks at each sheave", dims=("sheave",)),
    Variable(
        "net_axial_force",
        "N",
        "mean force of the belt on both sheaves along their axis, to the right",
        dims=("pulley",),
    ),
    Variable(
        "beam_axial_force",
        "N",
        "the same by both strands as beams under their mean forces, held without slope at the arcs",
        dims=("pulley",),
        words="clamped strands",
    ),
    Variable(
        "string_axial_force",
        "N",
        "the same by both strands as strings under their mean forces",
        dims=("pulley",),
        words="strings",
    ),
    Variable(
        "strand_one_sidedness",
        "1",
        "push force of the right side less the left one's over both, means over the strand",
        dims=("strand",),
        words="one-sided push in strands",
    ),
    Variable(
        "arc_one_sidedness",
        "1",
        "push force of the right side less the left one's over both, means over the arc",
        dims=("pulley",),
        words="one-sided push in arcs",
    ),
    *(
        Variable(f"largest_{angle}", "rad", f"largest {words} of an element over the judged part")
        for angle, words in zip(
            readings.ANGLES, ("lateral lean", "yaw out of the plane", "tilt against the rings"), strict=True
        )
    ),
    Variable("largest_nose_force", "N", "largest force of a nose over the judged part"),
    Variable(
        "mean_tension_difference",
        "N",
        "ring tension of the right package less the left one's; not a number with one flow for both",
        dims=("strand",),
    ),
    Variable("final_misalignment", "m", "mean axial offset of the pulleys' mid planes as sheaves stand"),
)


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions.

    Parameters
    ----------
    parameters : dict
        Flat parameters of the job.
    """
    sheave = Coordinate(np.array(readings.SHEAVES), "", "sheave", "pulley and side")
    return {**pushbelt.coordinates(parameters), "sheave": sheave}


def cost(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    each_step = np.where(np.isinf(p["sheave_stiffness"]), RIGID_COST, ELASTIC_COST)[()]
    each_step = each_step * np.where(np.equal(p["ring_flows"], 2), OF_TWO, 1.0)[()]
    return p["duration"] * (each_step * p["elements"] / p["step"] + SAMPLE_COST * p["sampling_rate"])


def judge(run: ElementRun) -> dict[str, Any]:
    """The record of a run that has reached its end, or slipped through before, its cost apart.

    Both planes are judged alike, and together: a belt vibrates if a strand does in either.

    Parameters
    ----------
    run : ElementRun
        With all samples recorded, or those until it slipped through.
    """
    both = (*STRANDS, *readings.LATERAL)
    if run.failure is not None:
        return _by_plane(judging.slipped(run, both)) | pushbelt.speeds(run, slide(run))
    found = judging.assess(run, both)
    probes, lateral = np.split(found.strongest_probe, [len(STRANDS)])
    p, moved = run.parameters, run.displacement[run.judged][:, lateral]
    spectrum = amplitude_spectrum(moved, p["sampling_rate"], frequency_bins(p).values).T
    evaluated = pushbelt.evaluate(run, probes) | _evaluate(run)
    return _by_plane(found.record()) | {"lateral_spectrum": spectrum} | evaluated


def _by_plane(record: dict[str, Any]) -> dict[str, Any]:
    """A record whose values of strands in both planes are told of each plane."""
    parted: dict[str, Any] = {}
    for name in (v.name for v in _OF_STRANDS if v.name in record):
        parted[name], parted[f"lateral_{name}"] = np.split(record[name], [len(STRANDS)])
    return record | parted


def _evaluate(run: ElementRun) -> dict[str, Any]:
    """Values of a finished run that the planar pushbelt has not."""
    forces = each(run, "sheave_force", readings.SHEAVES)
    extremes = {what: run.channel(f"extreme_{what}")[run.judged].max() for what in readings.EXTREMES}
    left, right = (run.profiles[f"push_force_{side}"] for side in readings.SIDES)
    where = regions(run.path, run.places)

    def one_sided(name: str) -> float:
        inside = where == REGIONS.index(name)
        one, other = np.nansum(left[inside]), np.nansum(right[inside])
        return (other - one) / (other + one) if other + one > 0.0 else np.nan

    p, path, offset = run.parameters, run.path, mean(run, "axial_offset")
    speed = run.mean_driving_speed(run.judged) * path.driving_radius
    centrifugal = (p["element_mass"] + p["ring_mass"]) * speed**2
    net = each(run, "ring_tension", STRANDS) - each(run, "push_force", STRANDS) - centrifugal
    stiffness = p["lateral_bending_stiffness"], p["lateral_shear_stiffness"]
    # a strand that is pushed more than it is pulled is no string, and counts as one without tension
    held = [clamped_force(offset, path.strand_length, max(force, 0.0), *stiffness) for force in net]
    signs = np.array([1.0, -1.0])  # the driving pulley is pulled to where the driven one is
    return {
        "beam_axial_force": signs * sum(held),
        "string_axial_force": signs * offset / path.strand_length * np.maximum(net, 0.0).sum(),
        "sheave_force": forces,
        "sheave_loss": each(run, "sheave_loss", readings.SHEAVES),
        "net_axial_force": forces[1::2] - forces[::2],
        "strand_one_sidedness": np.array([one_sided(strand) for strand in STRANDS]),
        "arc_one_sidedness": np.array([one_sided(pulley) for pulley in PULLEYS]),
        **{f"largest_{what}": float(value) for what, value in extremes.items()},
        "mean_tension_difference": each(run, "tension_difference", STRANDS),
        "final_misalignment": mean(run, "axial_offset"),
    }


def histories(run: ElementRun) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed.

    Parameters
    ----------
    run : ElementRun
        With the samples that it has.

    Returns
    -------
    Dataset
        That of the planar pushbelt; probes of t1_lateral and t2_lateral move out of the plane, to the right.
    """
    outwards = "of the belt on the sheave, outwards"
    over_time = {f"sheave_force {k}": (f"axial force {k}", "N", outwards) for k in readings.SHEAVES}
    over_time["axial_offset"] = ("axial offset", "m", "of the pulleys' mid planes")
    for angle in readings.ANGLES:
        over_time[f"extreme_{angle}"] = (f"largest {angle}", "rad", "of any element")
    over_time["extreme_nose_force"] = ("largest force of a nose", "N", "of any element")
    found = pushbelt.history(run, {**readings.PROFILES, **readings.OF_TWO_FLOWS}, over_time)
    found["displacement"].attrs["comment"] = "transverse, outward; of lateral probes axial, to the right"
    return found
