"""Record of a run of the spatial pushbelt, its cost, and its verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.pushbelt import record as pushbelt
from cvt_hpc.models.spatial_pushbelt import readings
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.out_of_plane import clamped_force
from cvt_hpc.variables import Coordinate, Variable, together
from cvt_hpc.variator import PULLEYS, STRANDS, judging
from cvt_hpc.variator.history import REGIONS, regions
from cvt_hpc.variator.variables import Measured, each_strand, means, shared

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.pushbelt.run import ElementRun

# Measured on one core of an EPYC (Zen 5): core-seconds per element and step, and per sample
_RIGID_COST, _ELASTIC_COST, _SAMPLE_COST = 2.4e-6, 3.3e-6, 1e-3
_OF_TWO = 1.6  # cost of a step with two flows of ring material by that of one with one

IN_PLANE, LATERAL = slice(len(STRANDS)), slice(len(STRANDS), None)  # of strands' probes


def of_strands(variable: Variable, strands: slice, **changes: Any) -> Variable:
    """A variable of strands in both planes, of one of these."""

    def of(measured: Measured) -> Any:
        return None if (found := variable.of(measured)) is None else found[strands]

    return replace(variable, of=of, **changes)


def net_axial_force(measured: Measured) -> np.ndarray:
    """Force on both sheaves of each pulley, to the right [N]."""
    forces = measured.each("sheave_force {}", readings.SHEAVES)
    return forces[1::2] - forces[::2]


def _of_clamped_strands(measured: Measured) -> tuple[np.ndarray, np.ndarray]:
    """Axial force on each pulley by strands as beams, and as strings [N]."""
    m, p, path = measured, measured.parameters, measured.path
    offset = m.mean("axial_offset")
    speed = m.mean_driving_speed(m.samples) * path.driving_radius
    centrifugal = (p["element_mass"] + p["ring_mass"]) * speed**2
    net = m.each("ring_tension {}", STRANDS) - m.each("push_force {}", STRANDS) - centrifugal
    stiffness = p["lateral_bending_stiffness"], p["lateral_shear_stiffness"]
    # a strand that is pushed more than it is pulled is no string, and counts as one without tension
    held = [clamped_force(offset, path.strand_length, max(force, 0.0), *stiffness) for force in net]
    signs = np.array([1.0, -1.0])  # the driving pulley is pulled to where the driven one is
    return signs * sum(held), signs * offset / path.strand_length * np.maximum(net, 0.0).sum()


def _one_sidedness(measured: Measured, names: Sequence[str]) -> np.ndarray:
    """Push force of the right side less the left one's over both, in regions [1]."""
    left, right = (measured.profiles[f"push_force_{side}"] for side in readings.SIDES)
    where, found = regions(measured.path, measured.places), []
    for name in names:
        one, other = (np.nansum(push[where == REGIONS.index(name)]) for push in (left, right))
        found.append((other - one) / (other + one) if other + one > 0.0 else np.nan)
    return np.array(found)


def largest(name: str, units: str, what: str) -> Variable:
    """Largest of an extreme over the judged part, declared."""
    comment = f"largest {what} over the judged part"
    return Variable(f"largest_{name}", units, comment, of=lambda m: m.part(f"extreme_{name}").max())


_each_sheave = partial(means, "sheave", readings.SHEAVES)
_OF_STRANDS = tuple(v for v in judging.VIBRATION if v.dims[:1] == ("strand",))
VARIABLES = (
    *(of_strands(v, IN_PLANE) if v in _OF_STRANDS or v.name == "spectrum" else v for v in pushbelt.VARIABLES),
    *(
        of_strands(v, LATERAL, name=f"lateral_{v.name}", comment=f"as {v.name}, out of the plane", words="")
        for v in _OF_STRANDS
    ),
    of_strands(
        shared("spectrum")[0],
        LATERAL,
        name="lateral_spectrum",
        comment="at the probe strongest out of the plane",
        words="lateral amplitude spectrum",
    ),
    _each_sheave("sheave_force", "N", "mean axial force of the belt on each sheave, outwards"),
    _each_sheave("sheave_loss", "W", "mean friction power of the flanks at each sheave"),
    Variable(
        "net_axial_force",
        "N",
        "mean force of the belt on both sheaves along their axis, to the right",
        dims=("pulley",),
        of=net_axial_force,
    ),
    *together(
        _of_clamped_strands,
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
    ),
    Variable(
        "strand_one_sidedness",
        "1",
        "push force of the right side less the left one's over both, means over the strand",
        dims=("strand",),
        words="one-sided push in strands",
        of=lambda m: _one_sidedness(m, STRANDS),
    ),
    Variable(
        "arc_one_sidedness",
        "1",
        "push force of the right side less the left one's over both, means over the arc",
        dims=("pulley",),
        words="one-sided push in arcs",
        of=lambda m: _one_sidedness(m, PULLEYS),
    ),
    *(
        largest(angle, "rad", f"{words} of an element")
        for angle, words in zip(
            readings.ANGLES, ("lateral lean", "yaw out of the plane", "tilt against the rings"), strict=True
        )
    ),
    largest("nose_force", "N", "force of a nose"),
    each_strand(
        "mean_tension_difference",
        "N",
        "ring tension of the right package less the left one's; not a number with one flow for both",
        "tension_difference {}",
        may_miss=True,
    ),
    Variable(
        "final_misalignment",
        "m",
        "mean axial offset of the pulleys' mid planes as sheaves stand",
        of=lambda m: m.mean("axial_offset"),
    ),
)


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, by flat parameters of the job."""
    sheave = Coordinate(np.array(readings.SHEAVES), "", "sheave", "pulley and side")
    return {**pushbelt.coordinates(parameters), "sheave": sheave}


def cost(parameters: Parameters, stepper: str) -> float | np.ndarray:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    each_step = np.where(np.isinf(p["sheave_stiffness"]), _RIGID_COST, _ELASTIC_COST)[()]
    each_step = each_step * np.where(np.equal(p["ring_flows"], 2), _OF_TWO, 1.0)[()]
    return p["duration"] * (each_step * p["elements"] / p["step"] + _SAMPLE_COST * p["sampling_rate"])


judge = partial(judging.judge, variables=VARIABLES, names=(*STRANDS, *readings.LATERAL))


def histories(run: ElementRun) -> xr.Dataset:
    """Histories of a run as those of the planar pushbelt, as far as it has samples.

    Probes of t1_lateral and t2_lateral move out of the plane, to the right.
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
