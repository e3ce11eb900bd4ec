"""The record of a run of the belt drive: its variables, the cost of a run, and the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.belt_drive import theory
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.models.belt_drive.theory import answers
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.belt_path import regions
from cvt_hpc.variables import Coordinate, Variable, together, values
from cvt_hpc.variator import PULLEYS, judging
from cvt_hpc.variator.history import dataset
from cvt_hpc.variator.variables import COORDINATES, Measured, frequency_bins, power, shared
from cvt_hpc.vibration import assessment
from cvt_hpc.vibration.settings import SHORTEST_SEGMENT
from cvt_hpc.vibration.signals import amplitude_spectrum

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.belt_drive.transient import Transient

# Measured on one core of an EPYC beside other work: core-seconds per element and step, and per sample
_STEP_COST, _SAMPLE_COST = 1.8e-6, 5e-5

DRIVE_MODES = 8


def _largest_spectrum(measured: Measured) -> np.ndarray:
    """Largest spectrum of each strand's probes, (strand, bin) [m]: one alone may sit on a node of a shape."""
    m, p = measured, measured.parameters
    spectra = amplitude_spectrum(_moved(m)[m.samples], p["sampling_rate"], frequency_bins(p).values)
    return spectra.max(axis=2).T


def _moved(measured: Measured) -> np.ndarray:
    """Displacement, (done, strand, probe) [m]."""
    return measured.displacement.reshape(measured.done, len(measured.drawn.spans), -1)


def _strand_tension(measured: Measured) -> np.ndarray:
    """Mean tensions, (strand,) [N]."""
    return measured.each("tension {}", measured.drawn.spans)


def _eigenfrequencies(measured: Measured) -> np.ndarray:
    """Eigenfrequencies of the strands, (strand, mode) [Hz]."""
    m = measured
    return theory.strand_frequencies(m.parameters, m.present.path, _strand_tension(m))


def _answered(measured: Measured) -> np.ndarray | None:
    """Frequencies (strand, mode) [Hz] at which strands answer a kick; None without one."""
    m, kicked = measured, measured.kicked
    if kicked is None or kicked.start - m.risen < SHORTEST_SEGMENT:
        return None
    before, after, rate = _moved(m)[m.risen : kicked.start], _moved(m)[kicked], m.parameters["sampling_rate"]
    expected = _eigenfrequencies(m)
    return np.array([answers(before[:, k], after[:, k], rate, modes) for k, modes in enumerate(expected)])


def _of_arms(measured: Measured) -> np.ndarray:
    """Mean angle, ripple and share at a stop of the arms that carry pulleys, nan of others, (3, P)."""
    pulleys = measured.pulleys
    found = np.full((3, len(pulleys.arm)), np.nan)
    for p in np.flatnonzero(pulleys.arm >= 0):
        a = pulleys.arm[p]
        angle = measured.part(f"arm T{a + 1}")
        inside = (pulleys.arms.lowest[a] < angle) & (angle < pulleys.arms.highest[a])
        found[:, p] = angle.mean(), angle.std(), 1.0 - inside.mean()
    return found


VARIABLES = (
    *assessment.VARIABLES,
    *shared("spectrum", comment="largest of the strand's probes", of=_largest_spectrum),
    Variable(
        "strand_tension",
        "N",
        "mean tension in the middle half of the strand",
        dims=("strand",),
        of=_strand_tension,
    ),
    Variable(
        "tension_ripple",
        "N",
        "standard deviation of that mean",
        dims=("strand",),
        of=lambda m: np.array([m.part(f"tension {k}").std() for k in m.drawn.spans]),
    ),
    *shared("slip", of=lambda m: m.each("slip {}", m.drawn.pulleys), early=False),
    *shared(
        "speed_loss",
        comment="1 - ratio x driven speed / driving speed, mean of whole belt turns or ripples of the speed; "
        "none where the judged part is shorter than a turn",
        of=lambda m: m.run.speed_loss(m.whole_turns) if m.turns else None,
        early=False,
        may_miss=True,
    ),
    Variable(
        "expected_speed_loss",
        "1",
        "by creep and radial compliance, with the mean tensions of the strands",
        words="creep and compliance",
        of=lambda m: theory.expected_loss(m.parameters, m.present, _strand_tension(m)),
    ),
    Variable(
        "creep_speed_loss",
        "1",
        "by creep alone, from tension at rest and torque; of two pulleys",
        words="creep alone",
        of=lambda m: theory.creep_loss(m.parameters, m.drawn),
    ),
    Variable(
        "eigenfrequency",
        "Hz",
        "of a running beam under the strand's mean tension, pinned where tangents touch the pulleys; "
        "arms at their mean angles",
        dims=("strand", "half_waves"),
        of=_eigenfrequencies,
    ),
    Variable(
        "drive_frequency",
        "Hz",
        "of strands, sticking arcs and driven pulleys together, linearised at the end; arms stand still",
        dims=("drive_mode",),
        of=lambda m: m.drive_frequencies(DRIVE_MODES),
    ),
    Variable(
        "answered_frequency",
        "Hz",
        "peak near each eigenfrequency after a kick, where it exceeds three times the unrest before",
        dims=("strand", "half_waves"),
        of=_answered,
        may_miss=True,
    ),
    *together(
        _of_arms,
        Variable("arm_angle", "rad", "mean rotation of the arm from where it is drawn", dims=("pulley",)),
        Variable("arm_ripple", "rad", "standard deviation of that rotation", dims=("pulley",)),
        Variable(
            "stop_share", "1", "share of the judged part in which the arm is at a stop", dims=("pulley",)
        ),
        may_miss=True,
    ),
    Variable(
        "lifted",
        "1",
        "1 where the belt has left the pulley, which ends a run as slip does",
        dims=("pulley",),
        of=lambda m: m.lifted.astype(float),
        early=True,
    ),
    *shared("driven_speed_ripple"),
    power("friction_loss", "mean friction power of the belt on the pulley", dims=("pulley",), early=True),
    power("contact_loss", "mean power of the contacts' normal damping", early=True),
    *shared("belt_loss", comment="mean power of the belt's damping along, across and in bending", early=True),
    *shared("driving_power", "load_power", "storing_power", "loss", "power_residual", early=True),
    power("arm_loss", "mean power of the tensioners' dashpots", early=True),
    *shared("efficiency", comment="share of the power put in that is not lost"),
    Variable(
        "turns",
        "1",
        "whole revolutions of the belt over which speed_loss is the mean, roughly so with speed_ripple",
        dtype="i8",
    ),
    Variable("unsolved_share", "1", "share of steps that were not solved to the tolerance", early=True),
    Variable("iterations", "1", "of Newton's method in a step, mean"),
)


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, by flat parameters of the job."""
    drawn = layout(parameters)
    driving, driven = drawn.pulleys[0], drawn.pulleys[drawn.driven]
    names = COORDINATES
    if drawn.pulleys != PULLEYS:
        order = "in the order in which the belt runs"
        roles = f"{order}; {driving} drives, {driven} is driven, of which is speed_loss"
        names = {
            "strand": COORDINATES["strand"]._replace(values=np.array(drawn.spans), comment=order),
            "pulley": COORDINATES["pulley"]._replace(values=np.array(drawn.pulleys), comment=roles),
        }
    return {
        **names,
        "frequency_bin": frequency_bins(parameters),
        "half_waves": Coordinate(np.arange(1, theory.MODES + 1), "1", "half waves", "along the strand"),
        "drive_mode": Coordinate(np.arange(1, DRIVE_MODES + 1), "1", "mode of the drive"),
    }


def cost(parameters: Parameters, stepper: str) -> float | np.ndarray:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    step = np.minimum(p["step"], 1.0 / p["sampling_rate"])
    return p["duration"] * (_STEP_COST * p["elements"] / step + _SAMPLE_COST * p["sampling_rate"])


def judge(run: Transient) -> dict[str, Any]:
    """The record of a run that has reached its end, or lost its grip before, its cost apart.

    All samples are recorded, or those until it slipped through or the belt left a pulley.
    """
    if run.failure is not None:
        early = (variable for variable in VARIABLES if variable.early)
        return judging.slipped_through(run) | values(early, Measured(run, run.judged, None))
    return judging.finished(run, VARIABLES, judging.assess(run, run.drawn.spans, run.drawn.pulleys))


def histories(run: Transient) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed, as far as it has samples.

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
    comment = "by Euler and Eytelwein, from the strands' tensions, arms as drawn"
    profiles["sliding_tension"] = sliding, "tension where it slides", "N", comment
    comment = "from the inlet of the arc, arms as drawn"
    profiles["wrap_angle"] = theory.wrap_angles(run.path, run.places), "wrap angle", "rad", comment
    names = [name for pair in zip(run.drawn.pulleys, run.drawn.spans, strict=True) for name in pair]
    region = np.array(names)[regions(run.path, run.places)]
    return dataset(run, over_time, profiles, run.places, region)


def _late(run: Transient, name: str) -> float:
    """Mean of a channel over the judged part as far as the run has come; nan before it."""
    values = run.channel(name)[run.first_judged :]
    return float(values.mean()) if values.size else np.nan
