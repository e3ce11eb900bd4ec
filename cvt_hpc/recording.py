"""How long a run lasts and what is recorded of it: what every job may set, whatever its model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cvt_hpc.parameters import Parameter

LEAST_SAMPLES_PER_PERIOD = 4  # of the band's highest frequency: amplitudes need 2, spectra and pictures more

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "run": {
        "duration": Parameter(0.3, "s", "simulated time of a run", minimum=0.0, exclusive=True),
    },
    "record": {
        "sampling_rate": Parameter(
            20e3, "Hz", "rate at which displacement and forces are recorded", minimum=0.0, exclusive=True
        ),
        "strand_probes": Parameter(
            5, "", "probes on each strand, equally spaced between its ends", minimum=2, maximum=99
        ),
        "arc_probes": Parameter(3, "", "probes on each arc, equally spaced", minimum=1, maximum=99),
        "spectrum_step": Parameter(
            10.0, "Hz", "spacing of the spectrum's frequencies", minimum=0.1, maximum=500.0
        ),
    },
}


def check(parameters: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Problems between parameters: (key, expected, found).

    Parameters
    ----------
    parameters : mapping
        Flat parameters of a run, those of [vibration] included.
    """
    problems = []
    needed = LEAST_SAMPLES_PER_PERIOD * parameters["band_high"]
    if parameters["sampling_rate"] < needed:
        expected = f"{LEAST_SAMPLES_PER_PERIOD} x band_high = {needed:g} Hz or more"
        problems.append(("sampling_rate", expected, f"{parameters['sampling_rate']:g} Hz"))
    if parameters["spectrum_step"] > parameters["band_high"]:
        expected = f"band_high = {parameters['band_high']:g} Hz or less"
        problems.append(("spectrum_step", expected, f"{parameters['spectrum_step']:g} Hz"))
    return problems
