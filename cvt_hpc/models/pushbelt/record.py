"""Record of a run of the pushbelt, its cost, and its verdict."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import PULLEYS, STRANDS, judging
from cvt_hpc.variator.history import REGIONS, dataset, regions
from cvt_hpc.variator.slip import AGAINST_SLIP
from cvt_hpc.variator.variables import (
    COORDINATES,
    Measured,
    each_pulley,
    frequency_bins,
    power,
    shared,
    shift_speed,
)
from cvt_hpc.vibration import ramp

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.pushbelt.run import ElementRun

_IDLE = 0.02  # of the largest push force: what is below does not press
# Measured on one core of an EPYC (Zen 5): core-seconds per element and step, and per sample
_RIGID_COST, _ELASTIC_COST, _SAMPLE_COST = 5.2e-7, 9.3e-7, 2e-4


def slip_loss(measured: Measured) -> float:
    """Loss of speed by sliding alone, mean [1]."""
    driving, driven = (measured.part(f"{k}_speed") * measured.part(f"running_radius {k}") for k in PULLEYS)
    return float(np.mean(1.0 - driven / driving))


def _share_left(measured: Measured) -> float:
    """Share of the driving power that is not lost [1]; not a number where the load drives."""
    powers = measured.powers
    left = powers["load_power"] + powers["thrust_power"] + powers["storing_power"]
    return left / powers["driving_power"] if powers["driving_power"] > 0.0 else np.nan


def _idle_arcs(measured: Measured) -> np.ndarray:
    """Share of each arc without push force [1], (2,); as well where no element has been."""
    push, where = measured.profiles["push_force"], regions(measured.path, measured.places)
    idle = ~(push > _IDLE * np.nanmax(push))
    return np.array([idle[where == REGIONS.index(pulley)].mean() for pulley in PULLEYS])


VARIABLES = (
    *judging.VIBRATION,
    *shared("spectrum", "mean_ring_tension", "mean_push_force", "axial_force", "slip"),
    *AGAINST_SLIP,
    *shared("flank_loss", "thrust_ratio", "speed_loss"),
    Variable(
        "slip_loss",
        "1",
        "speed_loss by sliding alone: 1 - driven over driving speed, each times its running_radius, mean",
        words="speed loss by slip",
        of=slip_loss,
        early=True,
    ),
    each_pulley(
        "running_radius",
        "m",
        "mean radius of the flanks' contact points, weighted by contact force",
        early=True,
    ),
    shift_speed(lambda m: [m.part(f"{pulley}_radius") for pulley in PULLEYS]),
    *shared("driven_speed_ripple", "driving_power", "load_power", "thrust_power"),
    *shared("storing_power", "ring_loss", "belt_loss", "tilt_loss"),
    power("element_loss", "mean power of the dampers of contacts between elements, most of it of impacts"),
    power("stretch_loss", "mean power of the rings' damping along the belt"),
    power("lag_loss", "mean power of the lag of the sheaves' tilt"),
    *shared("loss"),
    power(
        "numerical_damping",
        "mean power that the time step damps by itself, no loss of the belt's",
        dims=("spring",),
        words="numerical damping",
    ),
    *shared("power_residual"),
    *shared(
        "efficiency", comment="what is left of driving_power for load, thrust and storing", of=_share_left
    ),
    Variable(
        "largest_push_force",
        "N",
        "largest along the path, of means over the judged part",
        of=lambda m: np.nanmax(m.profiles["push_force"]),
    ),
    Variable(
        "idle_arc",
        "1",
        "without push force: its mean is below 2 % of the largest along the path",
        dims=("pulley",),
        words="idle share of the arc",
        of=_idle_arcs,
    ),
    Variable(
        "passing_frequency",
        "Hz",
        "mean, of elements that pass a point of the path",
        of=lambda m: m.mean("passing_frequency"),
    ),
    Variable("unsolved_share", "1", "share of steps that were not solved to the tolerance"),
    Variable("iterations", "1", "of Newton's method in a step, mean"),
)


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, by flat parameters of the job."""
    return {
        **COORDINATES,
        "ramp_share": ramp.coordinate(),
        "spring": Coordinate(np.array(tuple(f.DAMPED)), "", "spring", "contact or elastic part"),
        "frequency_bin": frequency_bins(parameters),
    }


def cost(parameters: Parameters, stepper: str) -> float | np.ndarray:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p = parameters
    each = np.where(np.isinf(p["sheave_stiffness"]), _RIGID_COST, _ELASTIC_COST)[()]
    return p["duration"] * (each * p["elements"] / p["step"] + _SAMPLE_COST * p["sampling_rate"])


judge = partial(judging.judge, variables=VARIABLES)


def histories(run: ElementRun) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed, as far as it has samples.

    `displacement` (time, probe) [m], scalars over time, profiles of the judged part by `position`.
    """
    from cvt_hpc.models.pushbelt.readings import PROFILES

    return history(run, PROFILES, {})


def history(
    run: ElementRun,
    profiles: Mapping[str, tuple[str, str, str]],
    over_time: Mapping[str, tuple[str, str, str]],
) -> xr.Dataset:
    """Result of `histories`, with the words of a model's profiles and of its own channels over time."""
    touching = "at which the flanks touch the sheaves"
    told = {f"{k}_radius": (f"{k} radius", "m", touching) for k in PULLEYS}
    comment = "mean over the middle half of the strand"
    for name in ("push force", "ring tension"):
        told |= {f"{name.replace(' ', '_')} {k}": (f"{name} {k}", "N", comment) for k in STRANDS}
    told |= {f"axial_force {k}": (f"axial force {k}", "N", "") for k in PULLEYS}
    along = {name: (values, *profiles[name]) for name, values in run.profiles.items()}
    where = regions(run.path, run.places)
    along["wrap_angle"] = _wrap_angles(run, where), "wrap angle", "rad", "from the inlet of the arc"
    return dataset(run, {**told, **over_time}, along, run.places, np.array(REGIONS)[where])


def _wrap_angles(run: ElementRun, region: np.ndarray) -> np.ndarray:
    """Angles of places from the inlets of their arcs [rad], by their regions; nan on strands."""
    path = run.path
    starts = np.concatenate([[0.0], np.cumsum(path.lengths)[:3]])[region]
    radius = np.array([path.driving_radius, np.nan, path.driven_radius, np.nan])[region]
    return (run.places - starts) / radius
