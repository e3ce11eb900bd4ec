"""The record of a run of the belt drive: its variables, the cost of a run, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.belt_drive import pulleys as fields
from cvt_hpc.models.belt_drive import theory
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.models.belt_drive.theory import answers
from cvt_hpc.physics.belt_path import regions
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import PULLEYS, STRANDS, judging
from cvt_hpc.variator.history import dataset
from cvt_hpc.variator.judging import each
from cvt_hpc.variator.variables import COORDINATES, frequency_bins, shared
from cvt_hpc.vibration import assessment
from cvt_hpc.vibration.settings import SHORTEST_SEGMENT
from cvt_hpc.vibration.signals import amplitude_spectrum

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.belt_drive.transient import Transient

# Measured on one core of an EPYC beside other work: core-seconds per element and step, and per sample
STEP_COST, SAMPLE_COST = 1.8e-6, 5e-5

DRIVE_MODES = 8

VARIABLES = (
    *assessment.VARIABLES,
    replace(shared("spectrum")[0], comment="largest of the strand's probes"),
    Variable("strand_tension", "N", "mean tension in the middle half of the strand", dims=("strand",)),
    Variable("tension_ripple", "N", "standard deviation of that mean", dims=("strand",)),
    *shared("slip"),
    replace(
        shared("speed_loss")[0],
        comment="1 - ratio x driven speed / driving speed, mean of whole belt turns or ripples of the speed; "
        "none where the judged part is shorter than a turn",
    ),
    Variable(
        "expected_speed_loss",
        "1",
        "by creep and radial compliance, with the mean tensions of the strands",
        words="creep and compliance",
    ),
    Variable(
        "creep_speed_loss",
        "1",
        "by creep alone, from tension at rest and torque; of two pulleys",
        words="creep alone",
    ),
    Variable(
        "eigenfrequency",
        "Hz",
        "of a running beam under the strand's mean tension, pinned where tangents touch the pulleys; "
        "arms at their mean angles",
        dims=("strand", "half_waves"),
    ),
    Variable(
        "drive_frequency",
        "Hz",
        "of strands, sticking arcs and driven pulleys together, linearised at the end; arms stand still",
        dims=("drive_mode",),
    ),
    Variable(
        "answered_frequency",
        "Hz",
        "peak near each eigenfrequency after a kick, where it exceeds three times the unrest before",
        dims=("strand", "half_waves"),
    ),
    Variable("arm_angle", "rad", "mean rotation of the arm from where it is drawn", dims=("pulley",)),
    Variable("arm_ripple", "rad", "standard deviation of that rotation", dims=("pulley",)),
    Variable("stop_share", "1", "share of the judged part in which the arm is at a stop", dims=("pulley",)),
    Variable(
        "lifted", "1", "1 where the belt has left the pulley, which ends a run as slip does", dims=("pulley",)
    ),
    *shared("driven_speed_ripple"),
    Variable("friction_loss", "W", "mean friction power of the belt on the pulley", dims=("pulley",)),
    Variable("contact_loss", "W", "mean power of the contacts' normal damping"),
    replace(shared("belt_loss")[0], comment="mean power of the belt's damping along, across and in bending"),
    *shared("driving_power", "load_power", "storing_power", "loss", "power_residual"),
    Variable("arm_loss", "W", "mean power of the tensioners' dashpots"),
    Variable("efficiency", "1", "share of the power put in that is not lost"),
    Variable(
        "turns",
        "1",
        "whole revolutions of the belt over which speed_loss is the mean, roughly so with speed_ripple",
        dtype="i8",
    ),
    Variable("unsolved_share", "1", "share of steps that were not solved to the tolerance"),
    Variable("iterations", "1", "of Newton's method in a step, mean"),
)


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions.

    Parameters
    ----------
    parameters : dict
        Flat parameters of the job.
    """
    drawn = layout(parameters)
    driving, driven = drawn.pulleys[0], drawn.pulleys[drawn.driven]
    roles = (
        "" if drawn.pulleys == PULLEYS else f"; {driving} drives, {driven} is driven, of which is speed_loss"
    )
    names = {
        "strand": _named("strand", drawn.spans),
        "pulley": _named("pulley", drawn.pulleys, roles),
    }
    half_waves = Coordinate(np.arange(1, theory.MODES + 1), "1", "half waves", "along the strand")
    modes = Coordinate(np.arange(1, DRIVE_MODES + 1), "1", "mode of the drive")
    bins = frequency_bins(parameters)
    return {**names, "frequency_bin": bins, "half_waves": half_waves, "drive_mode": modes}


def _named(dimension: str, names: tuple[str, ...], roles: str = "") -> Coordinate:
    in_order = "in the order in which the belt runs" + roles
    comment = COORDINATES[dimension].comment if names in (PULLEYS, STRANDS) else in_order
    return COORDINATES[dimension]._replace(values=np.array(names), comment=comment)


def cost(parameters: Mapping[str, Any], stepper: str) -> Any:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    step = np.minimum(p["step"], 1.0 / p["sampling_rate"])
    return p["duration"] * (STEP_COST * p["elements"] / step + SAMPLE_COST * p["sampling_rate"])


def judge(run: Transient) -> dict[str, Any]:
    """The record of a run that has reached its end, or lost its grip before, its cost apart.

    Parameters
    ----------
    run : Transient
        With all samples recorded, or those until it slipped through or the belt left a pulley.
    """
    if run.failure is not None:
        return (
            judging.slipped_through(run)
            | _powers(run)
            | {
                "unsolved_share": run.unsolved_share,
                "lifted": run.lifted.astype(float),
            }
        )
    found = judging.assess(run, run.drawn.spans, run.drawn.pulleys)
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
    drawn, present, powers = run.drawn, run.present, _powers(run)
    work, tension = run.counters(), each(run, "tension", drawn.spans)
    frequencies = theory.strand_frequencies(run.parameters, present.path, tension)
    return {
        **judging.motion(run, strongest_probe, drawn.pulleys),
        "spectrum": _spectrum(run),
        **_of_arms(run),
        "speed_loss": run.speed_loss(run.whole_turns) if run.turns else np.nan,
        "expected_speed_loss": theory.expected_loss(run.parameters, present, tension),
        "creep_speed_loss": theory.creep_loss(run.parameters, drawn),
        "strand_tension": tension,
        "eigenfrequency": frequencies,
        "drive_frequency": run.drive_frequencies(DRIVE_MODES),
        "answered_frequency": _answered(run, frequencies),
        "tension_ripple": np.array([run.channel(f"tension {k}")[run.judged].std() for k in drawn.spans]),
        **powers,
        "efficiency": judging.efficiency(*(powers[key] for key in ("driving_power", "load_power", "loss"))),
        "lifted": run.lifted.astype(float),
        "turns": run.turns,
        "unsolved_share": run.unsolved_share,
        "iterations": work["iterations"] / max(work["steps"], 1),
    }


def _powers(run: Transient) -> dict[str, Any]:
    """Mean powers of a run and their balance."""
    driving, load = run.mean_rate(fields.WORK_IN), run.mean_rate(fields.WORK_OUT)
    contact, belt = run.mean_rate(fields.CONTACT_LOSS), run.mean_rate(fields.BELT_LOSS)
    arm = run.mean_rate(fields.ARM_LOSS)
    friction = np.array([run.mean_rate(fields.FRICTION_LOSS + k) for k in range(len(run.drawn.pulleys))])
    losses = {"friction_loss": friction, "contact_loss": contact, "belt_loss": belt, "arm_loss": arm}
    loss = contact + belt + arm + friction.sum()
    return losses | judging.power_balance(driving, load, loss, run.mean_rate(-1))


def _of_arms(run: Transient) -> dict[str, np.ndarray]:
    """Values of the arms, for the pulleys that they carry; nan of others."""
    pulleys, judged = run.pulleys, run.judged
    found = {name: np.full(len(pulleys.arm), np.nan) for name in ("arm_angle", "arm_ripple", "stop_share")}
    for p in np.flatnonzero(pulleys.arm >= 0):
        a = pulleys.arm[p]
        angle = run.channel(f"arm T{a + 1}")[judged]
        inside = (pulleys.arms.lowest[a] < angle) & (angle < pulleys.arms.highest[a])
        values = angle.mean(), angle.std(), 1.0 - inside.mean()
        for name, value in zip(found, values, strict=True):
            found[name][p] = value
    return found


def _spectrum(run: Transient) -> np.ndarray:
    """Of each strand the largest of its probes, (strand, bin) [m]: one alone may sit on a node of a shape."""
    p = run.parameters
    spectra = amplitude_spectrum(_moved(run)[run.judged], p["sampling_rate"], frequency_bins(p).values)
    largest: np.ndarray = spectra.max(axis=2).T
    return largest


def _moved(run: Transient) -> np.ndarray:
    """Displacement, (done, strand, probe) [m]."""
    return run.displacement.reshape(run.done, len(run.drawn.spans), -1)


def _answered(run: Transient, expected: np.ndarray) -> np.ndarray:
    """Frequencies (strand, mode) [Hz] at which strands answer a kick; nan without one."""
    if run.kicked is None or run.kicked.start - run.risen < SHORTEST_SEGMENT:
        return np.full(expected.shape, np.nan)
    moved = _moved(run)
    before, after = moved[run.risen : run.kicked.start], moved[run.kicked]
    rate = run.parameters["sampling_rate"]
    return np.array([answers(before[:, k], after[:, k], rate, modes) for k, modes in enumerate(expected)])


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

    comment = "mean over the middle half of the strand, arms as drawn"
    over_time = {f"tension {k}": (f"tension {k}", "N", comment) for k in run.drawn.spans}
    names = [name for name in run.channels if name.startswith("speed ")]
    over_time |= {name: (name, "rad s-1", "in the belt's direction") for name in names}
    names = [name for name in run.channels if name.startswith("arm ")]
    over_time |= {name: (name, "rad", "rotation from where it is drawn") for name in names}
    profiles = {name: (values, *PROFILES[name]) for name, values in run.profiles.items()}
    tension = np.array([_late(run, f"tension {k}") for k in run.drawn.spans])
    sliding = theory.sliding_tension(run.parameters, run.path, tension, run.places)
    words = (
        "tension where it slides",
        "N",
        "by Euler and Eytelwein, from the strands' tensions, arms as drawn",
    )
    profiles["sliding_tension"] = sliding, *words
    words = "wrap angle", "rad", "from the inlet of the arc, arms as drawn"
    profiles["wrap_angle"] = theory.wrap_angles(run.path, run.places), *words
    names = [name for pair in zip(run.drawn.pulleys, run.drawn.spans, strict=True) for name in pair]
    region = np.array(names)[regions(run.path, run.places)]
    return dataset(run, over_time, profiles, run.places, region)


def _late(run: Transient, name: str) -> float:
    """Mean of a channel over the judged part as far as the run has come; nan before it."""
    values = run.channel(name)[run.first_judged :]
    return float(values.mean()) if values.size else np.nan
