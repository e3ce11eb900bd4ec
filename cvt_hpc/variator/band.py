"""The band by which a variator is judged: it begins below the first modes of its own strands."""

from typing import Any

import numpy as np

from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import variator
from cvt_hpc.physics.running_strand import Strand, eigenfrequencies, net_forces
from cvt_hpc.variator import STRANDS
from cvt_hpc.vibration import settings
from cvt_hpc.vibration.ramped import ramped
from cvt_hpc.vibration.signals import band_amplitude, dominant_frequency

MODES = 5  # of a strand, that are known
FUNCTIONS = 24  # sines of the Ritz model, which so many modes need
_SLOWER = 0.5  # of the lower first mode: judder is slower, its second harmonic is no first mode
LEAST_JERK = 1e-3  # of the driven pulley's speed, amplitude from which it judders


def strand_frequencies(parameters: Parameters, forces: tuple[float, float] | None = None) -> np.ndarray:
    """Eigenfrequencies of both strands as running beams, (strand, MODES) [Hz], by the model `strand`.

    `forces` are ring tension less push force of t1 and t2 [N]; else they follow by belt formulas from thrust
    and load. Of the parameters [SI] of a run; without `bending_stiffness` its strands do not resist bending.
    nan where a strand holds no shape, where the belt slips, or where a parameter is missing.
    """
    unknown = np.full((len(STRANDS), MODES), np.nan)
    p = {"strand_forces": "formulas", "bending_stiffness": 0.0, **parameters}
    try:
        path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
        speed, mass = p["driving_speed"] * path.driving_radius, p["element_mass"] + p["ring_mass"]
        held = net_forces(p) if forces is None else forces
        strands = [Strand(path.strand_length, mass, speed, float(f), p["bending_stiffness"]) for f in held]
    except (KeyError, TypeError, ValueError):
        return unknown
    if not all(np.isfinite([*strand, strand.critical_speed]).all() for strand in strands):
        return unknown
    return np.array([eigenfrequencies(strand, FUNCTIONS)[:MODES] for strand in strands])


def steady_band(parameters: Parameters, forces: tuple[float, float] | None = None) -> tuple[float, float]:
    """Lowest and highest frequency of the modes by which a steady state is judged [Hz].

    It is the band of a run that does not judder. Arguments as of `strand_frequencies`.
    """
    lowest = float(strand_frequencies(parameters, forces)[:, 0].min())
    return settings.edge_of_modes(parameters, lowest), parameters["band_high"]


def band(run: Any) -> tuple[float, float]:
    """Lowest and highest frequency by which a run is judged [Hz].

    Where the job gives no `band_low`, `settings.lower_edge` follows from the means of the judged part, of a
    belt of rings and elements with all samples recorded. A belt without rings and a ramp, along which forces
    change, have the band of `settings.band`.
    """
    p = run.parameters
    if _is_given(p):
        return settings.band(p)
    modes = _first_modes(run)
    lowest, highest = float(modes.min()), float(modes.max())
    judders = bool(np.isfinite(_jerks(run, _SLOWER * lowest)))
    return settings.lower_edge(p, lowest, highest, judders), p["band_high"]


def judder_frequency(run: Any) -> float:
    """Frequency of the judder of a run that `band` takes [Hz]; nan: none, or the job decides on the band.

    It is 0 where jerks have no peak by which it could be told.
    """
    if _is_given(run.parameters):
        return np.nan
    return _jerks(run, _SLOWER * float(_first_modes(run).min()))


def _is_given(parameters: Parameters) -> bool:
    """Whether the band of a run follows from its parameters alone."""
    return bool(parameters["band_low"] or ramped(parameters) or "ring_mass" not in parameters)


def _first_modes(run: Any) -> np.ndarray:
    """First eigenfrequencies of both strands under the mean forces of the judged part [Hz], (2,)."""
    p = run.parameters
    tension, push = (
        [run.channel(f"{name} {strand}")[run.judged].mean() for strand in STRANDS]
        for name in ("ring_tension", "push_force")
    )
    means = {**p, "driving_speed": run.mean_driving_speed(run.judged)}
    return strand_frequencies(means, (tension[0] - push[0], tension[1] - push[1]))[:, 0]


def _jerks(run: Any, below: float) -> float:
    """Frequency of jerks of the driven pulley, slower than another one [Hz]; nan: none, 0: without a peak."""
    speed, rate = run.channel("driven_speed")[run.judged], run.parameters["sampling_rate"]
    slowest = settings.LEAST_IN_WINDOW * rate / len(speed)
    if not slowest < below or band_amplitude(speed, rate, (slowest, below)) <= LEAST_JERK * abs(speed.mean()):
        return np.nan
    frequency = float(dominant_frequency(speed, rate, (slowest, below)))
    # a slow drift may leave no peak
    return 0.0 if np.isnan(frequency) else frequency
