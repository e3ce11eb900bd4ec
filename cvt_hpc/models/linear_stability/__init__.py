"""Eigenvalues of the running elastic belt about its steady state, friction memory included.

It answers *does the steady state lose its stability, at what load, in which strand and at what frequency?* by
the full right-hand side's Jacobian, and shows along the belt where friction feeds a vibration and where it
takes energy. It cannot answer how large the vibration becomes and at what frequency it settles; whether a
larger disturbance starts one where small ones die; and anything where friction has no memory (see README.md).
Importing this package is cheap.
"""

from cvt_hpc.models import steady_variator
from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

LEAST_MEMORY = 1e-4  # [s]: shorter ones are outside the band that is searched (README.md)

PARAMETERS: dict[str, dict[str, Parameter]] = steady_variator.PARAMETERS | {
    "judgement": {
        "band_low": not_negative(
            0.0,
            "Hz",
            "lowest frequency of a mode that counts as vibration; 0: from the strands, as of a run",
            (1.0, 2e4),
        ),
        "band_high": positive(1500.0, "Hz", "highest such frequency", (1.0, 2e4)),
        "undecided_growth": not_negative(
            50.0,
            "1/s",
            "growth or decay of the fastest growing mode up to which nothing is decided",
            (1e-3, 1e5),
        ),
    }
}


def check(p: Parameters) -> list[Problem]:
    """Problems that lie between parameters: as of `steady_variator`, and a band that is none."""
    problems = steady_variator.check(p)
    for key in ("collar_clearance", "bearing_clearance"):
        if p[key] > 0.0 and p["tilt_lag"] == 0.0:
            problems.append((key, "0, or a tilt_lag, by which a motion goes on", f"{p[key]:g}"))
    if p["band_low"] >= p["band_high"]:
        expected = f"above band_low = {p['band_low']:g} Hz"
        problems.append(("band_high", expected, f"{p['band_high']:g} Hz"))
    if p["friction_memory"] < LEAST_MEMORY and p["friction_gradient"] < 0.0:
        expected = (
            f"{LEAST_MEMORY:g} s or more where friction falls: below, single stations grow by themselves"
        )
        problems.append(("friction_memory", expected, f"{p['friction_memory']:g} s"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect: see `elastic_belt.inert`."""
    return {
        key: setting
        for key, setting in steady_variator.inert(parameters).items()
        if key not in steady_variator.OF_LAGS
    }
