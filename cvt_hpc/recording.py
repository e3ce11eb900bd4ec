"""Duration of a run and recorded quantities: parameters of every job, in each model."""

import math
from typing import Any

from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative
from cvt_hpc.vibration.ramped import along_ramp, ramped
from cvt_hpc.vibration.settings import LEAST_PERIODS, band

LONGEST = 4  # times the duration
_LEAST_SAMPLES_PER_PERIOD = 4  # of the band's highest frequency: amplitudes need 2, spectra and pictures more

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "run": {
        "duration": Parameter(
            0.3, "s", "simulated time of a run", minimum=0.0, exclusive=True, sensible=(0.001, 200.0)
        ),
        "shortest_duration": not_negative(
            0.0,
            "s",
            "from which on a run ends once its verdict is certain, of a vibration twice; 0: the duration",
            sensible=(0.001, 200.0),
        ),
        "longest_duration": not_negative(
            0.0,
            "s",
            "up to which an undecided run is prolonged; 0: four times the duration",
            sensible=(0.001, 1000.0),
        ),
    },
    "numerics": {
        "most_refinements": Parameter(
            3,
            "",
            "times that a run which fails by its numerics is done again, at half the step each time",
            minimum=0,
            maximum=10,
        ),
    },
    "record": {
        "sampling_rate": Parameter(
            20e3,
            "Hz",
            "rate at which displacement and forces are recorded",
            minimum=0.0,
            exclusive=True,
            sensible=(50.0, 10000000.0),
        ),
        "strand_probes": Parameter(
            5, "", "probes on each strand, equally spaced between its ends", minimum=2, maximum=99
        ),
        "arc_probes": Parameter(3, "", "probes on each arc, equally spaced", minimum=1, maximum=99),
        "spectrum_step": Parameter(
            10.0,
            "Hz",
            "spacing of the spectrum's frequencies",
            minimum=0.1,
            maximum=500.0,
            sensible=(0.1, 500.0),
        ),
    },
}


def check(parameters: Parameters) -> list[Problem]:
    """Problems between parameters: (key, expected, found).

    Parameters
    ----------
    parameters : mapping
        Flat parameters of a run, including [vibration].
    """
    problems = []
    duration, longest = parameters["duration"], longest_duration(parameters)
    if longest < duration * (1.0 - 1e-9):
        expected = f"duration = {duration:g} s or more, or 0 for {LONGEST} times the duration"
        problems.append(("longest_duration", expected, f"{longest:g} s"))
    if (first := first_duration(parameters)) < duration:
        share, (low, _) = parameters["judged_fraction"], band(parameters)
        rise = parameters.get("rise_time", 0.0)  # a model that has one refuses to judge all of a run
        least = max(rise / (1.0 - share) if rise else 0.0, LEAST_PERIODS / (share * low))
        if first < least * (1.0 - 1e-9):
            expected = f"{least:g} s or more, of which the last {share:g} can be judged"
            problems.append(("shortest_duration", expected, f"{parameters['shortest_duration']:g} s"))
    needed = _LEAST_SAMPLES_PER_PERIOD * parameters["band_high"]
    if parameters["sampling_rate"] < needed:
        expected = f"{_LEAST_SAMPLES_PER_PERIOD} x band_high = {needed:g} Hz or more"
        problems.append(("sampling_rate", expected, f"{parameters['sampling_rate']:g} Hz"))
    if parameters["spectrum_step"] > parameters["band_high"]:
        expected = f"band_high = {parameters['band_high']:g} Hz or less"
        problems.append(("spectrum_step", expected, f"{parameters['spectrum_step']:g} Hz"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, each with the setting that makes it so."""
    found = {} if "step" in parameters else {"most_refinements": "a stepper that chooses its step"}
    if 2.0 * parameters["shortest_duration"] > parameters["duration"] * (1.0 + 1e-9):
        found["shortest_duration"] = "a duration below twice of it"
    if setting := along_ramp(parameters):
        found |= dict.fromkeys(("shortest_duration", "longest_duration"), setting)
    return found


def sample_count(parameters: Parameters) -> int:
    """Samples of a whole run.

    Parameters
    ----------
    parameters : mapping
        Flat parameters of the run [SI].
    """
    return max(int(round(parameters["duration"] * parameters["sampling_rate"])), 1)


def steps_per_sample(interval: float, step: float) -> int:
    """Equal steps of at most `step` [s] that make a sampling interval [s]."""
    return max(math.ceil(interval / step - 1e-9), 1)


def start_up_samples(parameters: Parameters) -> int:
    """Samples of a run before its load has risen.

    Parameters
    ----------
    parameters : mapping
        Flat parameters of the run [SI], `rise_time` among them.
    """
    risen = math.ceil(parameters["rise_time"] * parameters["sampling_rate"])
    return min(risen, sample_count(parameters))


def first_duration(parameters: Parameters) -> float:
    """Return the least time that a run lasts [s]: half its duration, or a quarter, and so on.

    Parameters
    ----------
    parameters : mapping
        Flat parameters of the run as its job has them [SI].

    Returns
    -------
    float
        Not below `shortest_duration`; the duration itself where that is 0 or a ramp takes the whole run.
    """
    samples, shortest = sample_count(parameters), parameters["shortest_duration"]
    is_whole = shortest == 0.0 or ramped(parameters)
    for end in parameters.get("profile_time", ())[-1:]:  # what is judged lies behind it
        shortest = max(shortest, end / (1.0 - parameters["judged_fraction"]))
    halvings = 0 if is_whole else math.floor(math.log2(parameters["duration"] / shortest) + 1e-9)
    if halvings < 1:
        return float(parameters["duration"])
    return math.ceil(samples / 2**halvings) / float(parameters["sampling_rate"])


def longest_duration(parameters: Parameters) -> Any:
    """Return the longest time that an undecided run may last [s].

    Parameters
    ----------
    parameters : mapping
        Flat parameters of the run as its job has them [SI], each a number or an array of them.
    """
    given = parameters["longest_duration"]
    return given + (given == 0.0) * LONGEST * parameters["duration"]
