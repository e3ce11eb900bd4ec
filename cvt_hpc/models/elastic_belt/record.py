"""Variables of the record of the elastic belt, and how each follows from the samples; the history of a run.

A history has quantities over time, and quantities along the path.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.elastic_belt import along_belt as along
from cvt_hpc.models.elastic_belt import fluctuation, grouping
from cvt_hpc.models.elastic_belt.belt import MODES
from cvt_hpc.models.elastic_belt.belt_settings import MOST_LAYERS, layer_count
from cvt_hpc.models.elastic_belt.lane_rings import LOSS, SLIDING, SPEED_SUM, TENSION
from cvt_hpc.models.elastic_belt.pulley_settings import are_free, oil_factor
from cvt_hpc.parameters import Parameters
from cvt_hpc.storage.netcdf import attributes
from cvt_hpc.variables import Coordinate, Variable, together
from cvt_hpc.variator import PULLEYS, judging, variables
from cvt_hpc.variator.band import band
from cvt_hpc.variator.history import dataset, of_means
from cvt_hpc.variator.slip import AGAINST_SLIP
from cvt_hpc.variator.variables import COORDINATES, Measured, each_pulley, power, shared
from cvt_hpc.vibration import peaks, ramp
from cvt_hpc.vibration.signals import band_amplitude

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun

_FED = "power into the fluctuation of the belt"
PREFIX = "momentary_"  # of the names of quantities over time and position


def histories(run: RecordedRun) -> xr.Dataset:
    """Histories over `time` and means by `position` of a run, finished or failed, as far as it has samples.

    `displacement` (time, probe) [m], scalars over time, and the profiles of the judged part by `position`;
    with a profile_duration also those of the last samples over `profile_time`.
    """
    over_time = {
        f"{pulley}_position": (f"{pulley} position", "m", f"axial opening of the {pulley} pulley")
        for pulley in PULLEYS
    }
    found = dataset(run, over_time, _profiles(run), run.mesh.position, run.regions)
    moment = run.channel("driving_power") / run.channel("driving_speed")
    words = "driving moment", "N m", "of the belt on the driving pulley, which the drive has to overcome"
    found = found.assign(driving_moment=("time", moment, attributes(*words)))
    momentary = _last_profiles(run)
    if not momentary:
        return found
    count = len(next(iter(momentary.values()))[0])
    times = attributes("time of the profiles", "s")
    return found.assign_coords(profile_time=("profile_time", found["time"].values[-count:], times)).assign(
        {
            PREFIX + name: (("profile_time", "position"), values, attributes(*named))
            for name, (values, *named) in momentary.items()
        }
    )


def _profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str, str]]:
    """Means of the judged part at the stations, (N,): of a cell, half at either end; name, unit, comment."""
    means, fed = run.means, run.fluctuation
    dual = fluctuation.at_stations(run.mesh.cell)
    stress, damping = fluctuation.at_stations(fed.stresses) / dual, (fed.belt + fed.rings) / dual
    sliding = along.along_belt(means, run.mesh, run.parameters)
    return {
        **{
            name: (values, *of_means(along.ELSEWHERE[name]))
            for name, values in along.elsewhere(means, run.mesh).items()
        },
        "flank_feed": (fed.flanks / dual, "feed by flank friction", "W m-1", _FED),
        "stress_feed": (stress, "feed by push and tension", "W m-1", _FED),
        "damping_feed": (damping, "feed by damping and rings", "W m-1", f"{_FED}; negative: taken"),
        "wrap_angle": (along.wrap_angles(run.mesh), *along.WRAP_ANGLE),
        **{
            name: (sliding[name], words, unit, f"{comment}; of means")
            for name, (words, unit, comment) in along.SLIDING.items()
        },
    }


def _last_profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str, str]]:
    """Quantities of WORDS over the last samples of a run as far as it came, (sample, N), with their words.

    Empty where its profiles are not kept, or the run ended before them.
    """
    kept = run.momentary
    if kept is None or (count := len(kept) - (run.samples - run.done)) <= 0:
        return {}
    sample = dict(zip(along.NEEDED, kept[:count].transpose(1, 0, 2), strict=True))
    samples = slice(run.done - count, run.done)
    # speeds are counted from the course of the driving speed, which is constant where the drive has inertia
    is_given = np.isinf(run.parameters["driving_inertia"])
    course = run.channel("driving_speed")[samples, None] if is_given else run.parameters["driving_speed"]
    belt_speed = course * run.path.driving_radius
    lengthened = 1.0 + along.curvature_at_stations(run.mesh) * sample["mean_displacement"]
    found = along.elsewhere(sample, run.mesh) | along.along_belt(sample, run.mesh, run.parameters)
    found["element_speed"] = (belt_speed + sample["element_speed"]) / lengthened
    return {name: (found[name].astype(along.PRECISION), *words) for name, words in along.WORDS.items()}


def _strongest_modes(measured: Measured) -> tuple[np.ndarray, np.ndarray]:
    """Strongest mode of each strand in the band, and the amplitudes of all [m]."""
    m, rate = measured, measured.parameters["sampling_rate"]
    modal = band_amplitude(m.modes[m.samples], rate, band(m))
    return np.where(modal.max(axis=1) > 0.0, 1 + modal.argmax(axis=1), 0), modal


def modal_peaks(measured: Measured) -> tuple[np.ndarray, ...] | None:
    """Values of `peaks.VARIABLES`, where they are asked for."""
    m, p = measured, measured.parameters
    if p["modal_peaks"] != "on":
        return None
    found = peaks.modal_peaks(m.modes[m.samples], p["sampling_rate"], band(m))
    return *found, found.frequency_ratio


def piston_force(measured: Measured) -> np.ndarray:
    """Mean force of the pressure on the pistons [N], (2,); the axial position is at rest in the mean."""
    p = measured.parameters
    turning = np.array([(measured.part(f"{pulley}_speed") ** 2).mean() for pulley in PULLEYS])
    # the driving spring is counted from the opening that is given
    positions = np.array([measured.mean(f"{pulley}_position") for pulley in PULLEYS])
    shifts = positions - [p["driving_position"], 0.0]
    rates, forces = (
        np.array([p[f"{pulley}_spring_{name}"] for pulley in PULLEYS]) for name in ("rate", "force")
    )
    oil = np.array([oil_factor(p[f"{pulley}_piston"], p["oil_density"]) for pulley in PULLEYS])
    return measured.each("axial_force {}") - forces - rates * shifts - oil * turning


def radii(measured: Measured) -> list[np.ndarray]:
    """Radii of both pulleys by their positions over the judged part [m]."""
    nominal = measured.path.driving_radius, measured.path.driven_radius
    slope = 2.0 * np.tan(measured.parameters["half_wedge_angle"])
    return [
        radius - measured.part(f"{pulley}_position") / slope
        for radius, pulley in zip(nominal, PULLEYS, strict=True)
    ]


def fluctuations(measured: Measured) -> tuple[Any, ...]:
    """Values of `fluctuation.VARIABLES`."""
    p, powers, mesh = measured.parameters, measured.powers, measured.mesh
    found, shares = measured.fluctuation, fluctuation.part_shares(mesh)
    dual = fluctuation.at_stations(mesh.cell)
    fed = shares @ found.flanks, found.stresses.sum()
    lag = measured.part("axial_force driven").var() / (p["sheave_lag"] * p["lag_stiffness"])
    if are_free(p):
        # tilts and the driving sheave have lags, too; the mean motion, at rest, takes nothing in them
        lag = powers["lag_loss"]
    taken = (
        -found.belt.sum(),
        -found.rings.sum(),
        powers["layer_loss"] - found.mean_layers,
        fluctuation.steadiness(p) * lag,
        -found.carried.sum(),
    )
    remainder = fed[0].sum() + fed[1] - sum(taken)
    return -(shares * dual) @ measured.means["flank_power"], *fed, *taken, remainder


def of_layers(measured: Measured) -> tuple[np.ndarray, ...] | None:
    """Values of ring layers and their surfaces; not known where the rings are one."""
    means = measured.layer_means
    if means is None:
        return None
    padded = np.full((MOST_LAYERS + 1, means.shape[1]), np.nan)
    padded[: len(means)] = means
    # the ears have no layer behind them
    padded[len(means) - 1, TENSION:] = np.nan
    tensions, sliding = padded[:MOST_LAYERS, TENSION : TENSION + 2], padded[:, SLIDING : SLIDING + 2]
    return tensions, padded[:MOST_LAYERS, SPEED_SUM], padded[:, LOSS], sliding


VARIABLES = (
    *judging.VIBRATION,
    *together(
        _strongest_modes,
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
    ),
    *together(modal_peaks, *peaks.VARIABLES, may_miss=True),
    *shared("spectrum", "mean_ring_tension", "mean_push_force", "axial_force", "slip"),
    *AGAINST_SLIP,
    Variable(
        "slip_load",
        "N m",
        "load from which on a pulley of a run that slips through slips grossly for good",
        words="load at gross slip",
        of=lambda m: m.part("load")[0] if m.failure else None,
        early=True,
        may_miss=True,
    ),
    Variable(
        "piston_force",
        "N",
        "mean force of a piston's pressure, or force required: axial force less spring and centrifugal oil",
        dims=("pulley",),
        words="piston force",
        of=piston_force,
    ),
    Variable(
        "sheave_tilt",
        "rad",
        "mean angle that the tilt of the collar and the bending of the shaft put between the sheaves",
        dims=("pulley",),
        words="angle between sheaves",
        of=lambda m: m.each("tilt {}") / [m.path.driving_radius, m.path.driven_radius],
    ),
    each_pulley("open_share", "1", "mean, out of contact", words="open share of the wrap", early=True),
    *shared("flank_loss", "thrust_ratio", "speed_loss"),
    variables.shift_speed(radii),
    *shared("driven_speed_ripple", "driving_power", "load_power"),
    *shared("thrust_power", "storing_power", "ring_loss", "belt_loss", "layer_loss"),
    power("lag_loss", "mean power of the driven sheave's lag"),
    *shared("seating_loss", "tilt_loss", "loss", "efficiency", "power_residual"),
    Variable(
        "step_ripple",
        "m s-1",
        "speed that alternates from step to step, root mean square over the belt's mass and the judged part",
        of=lambda m: np.sqrt(np.mean(m.part("step_ripple") ** 2)),
    ),
    *together(
        of_layers,
        Variable(
            "layer_tension",
            "N",
            "mean tension of each ring layer in the middle of the strand; nan: no such layer",
            dims=("ring_layer", "strand"),
            words="tension by ring layer",
        ),
        Variable(
            "layer_speed",
            "m s-1",
            "mean speed of each ring layer around the belt",
            dims=("ring_layer",),
            words="speed by ring layer",
        ),
        Variable(
            "surface_loss",
            "W",
            "mean loss of each sliding surface of the rings; together they are ring_loss",
            dims=("ring_surface",),
            words="loss by ring surface",
        ),
        Variable(
            "surface_sliding",
            "m s-1",
            "mean size of the sliding speed of each surface of the rings on the arc",
            dims=("ring_surface", "pulley"),
            words="sliding by ring surface",
        ),
    ),
    *together(fluctuations, *fluctuation.VARIABLES),
    Variable(
        "least_strand_force",
        "N",
        "smallest T - P - m v^2 in a strand: below 0 it is slack",
        of=lambda m: m.part("least_strand_force").min(),
    ),
)


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, by flat parameters of the job."""
    found = dict(COORDINATES)
    if parameters["modal_peaks"] == "on":
        found["peak"] = peaks.coordinate()
    if layer_count(parameters) > 1:  # as many as there can be, for jobs that vary it
        words = "0: saddle; k: between the layers k and k + 1; behind the outermost layer the elements' ears"
        layers, surfaces = np.arange(1, MOST_LAYERS + 1), np.arange(MOST_LAYERS + 1)
        found["ring_layer"] = Coordinate(layers, "1", "ring layer", "the inner one first")
        found["ring_surface"] = Coordinate(surfaces, "1", "surface of ring layers", words)
    parts, waves = np.arange(1, fluctuation.ARC_PARTS + 1), np.arange(1, MODES + 1)
    return found | {
        "arc_part": Coordinate(parts, "1", "part of the wrap", "from its inlet to its outlet"),
        "ramp_share": ramp.coordinate(),
        "half_waves": Coordinate(waves, "1", "half waves", "along the strand"),
        "frequency_bin": variables.frequency_bins(parameters),
    }


cost, lane_key, lanes, profile_bytes = grouping.cost, grouping.lane_key, grouping.lanes, along.profile_bytes
judge = partial(judging.judge, variables=VARIABLES)
