"""Verdict and record of a run of a variator, as far as they are the same whichever model marched it.

A run is as `slip` takes it, and has `displacement`, `probes` with labels, `failure` and `time` as well, and
`risen`, the samples before its load has risen. Of its channels, those of both strands count here, too.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cvt_hpc.variables import Vibrates, shortened
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.variator.band import band
from cvt_hpc.variator.slip import slid, speed_loss, with_slip
from cvt_hpc.variator.variables import frequency_bins
from cvt_hpc.vibration import assessment, ramp
from cvt_hpc.vibration.ramped import ramped
from cvt_hpc.vibration.signals import amplitude_spectrum

RAMPED_CHANNELS = {"load": "load", "speed": "driving_speed"}  # by the ramped quantity


def assess(
    run: Any, names: Sequence[str] = STRANDS, pulleys: Sequence[str] = PULLEYS
) -> assessment.Occurrence:
    """Whether and how a run vibrates that has reached its end; its probes are columns of the displacement.

    Parameters
    ----------
    run : object
        With all samples recorded.
    names, pulleys : sequences of str
        Of its strands, and of the pulleys whose slip it records.
    """
    p = run.parameters
    if ramped(p):
        # None is of a run before its end
        return with_slip(run, _assess_ramp(run, names))  # type: ignore[arg-type]
    columns, strands = _on_strands(run, names)
    in_band = {**p, "band_low": band(run)[0]}
    found = assessment.assess(run.displacement[:, columns], p["sampling_rate"], strands, in_band)
    return with_slip(run, replace(found, strongest_probe=columns[found.strongest_probe]), pulleys)


def _assess_ramp(run: Any, names: Sequence[str]) -> ramp.RampOccurrence | None:
    """Whether and how a run vibrates along a ramp; None if it ended too soon to tell."""
    p, first, quantity = run.parameters, run.risen, ramped(run.parameters)
    columns, strands = _on_strands(run, names)
    rate, moved = p["sampling_rate"], run.displacement[first:, columns]
    values = run.channel(RAMPED_CHANNELS[quantity])[first:]
    found = ramp.assess_ramp(moved, rate, strands, quantity, values, run.samples - first, p)
    return found and replace(found, strongest_probe=columns[found.strongest_probe])


def _on_strands(run: Any, names: Sequence[str]) -> tuple[np.ndarray, list[str]]:
    """Columns of the displacement whose probes lie on strands, and on which."""
    regions = [probe.label.split()[0] for probe in run.probes]
    columns = [k for k, region in enumerate(regions) if region in names]
    return np.array(columns), [regions[k] for k in columns]


def slipped_through(run: Any) -> dict[str, Any]:
    """The verdict on a run that has slipped through before its end."""
    status, why = run.failure
    return {"status": status, "vibrates": Vibrates.SLIPS, "reason": f"at {run.time * 1e3:.4g} ms: {why}"}


def slipped(run: Any, names: Sequence[str] = STRANDS) -> dict[str, Any]:
    """The record of a run that has slipped through before its end: what is known until then.

    `names` are those of its strands, as of `assess`.
    """
    found = slipped_through(run)
    before = _assess_ramp(run, names) if ramped(run.parameters) else None
    if before is not None:
        reason = shortened(f"{found['reason']}; before: {before.reason}")
        found = before.record() | found | {"reason": reason}
    return found | slid(run)


def mean(run: Any, name: str) -> float:
    """Mean of a channel over the judged part."""
    return float(run.channel(name)[run.judged].mean())


def each(run: Any, name: str, labels: Sequence[str] = PULLEYS) -> np.ndarray:
    """Means of a channel of each pulley, or strand."""
    return np.array([mean(run, f"{name} {label}") for label in labels])


def motion(run: Any, strongest_probe: np.ndarray, pulleys: Sequence[str] = PULLEYS) -> dict[str, Any]:
    """Values of a finished run of any belt on pulleys of these names; arguments as of `evaluate`."""
    p, judged = run.parameters, run.judged
    moved = run.displacement[judged][:, strongest_probe]
    return {
        "spectrum": amplitude_spectrum(moved, p["sampling_rate"], frequency_bins(p).values).T,
        "slip": each(run, "slip", pulleys),
        "speed_loss": speed_loss(run, judged),
        "driven_speed_ripple": run.channel("driven_speed")[judged].std(),
    }


def evaluate(run: Any, strongest_probe: np.ndarray) -> dict[str, Any]:
    """Values of a finished run that all models of a variator have.

    Parameters
    ----------
    run : object
        With all samples recorded.
    strongest_probe : (2,) int array
        Column of the displacement that vibrates most, for each strand.
    """
    axial = each(run, "axial_force")
    return {
        **motion(run, strongest_probe),
        "mean_ring_tension": each(run, "ring_tension", STRANDS),
        "mean_push_force": each(run, "push_force", STRANDS),
        "axial_force": axial,
        "flank_loss": np.array([mean(run, f"{pulley}_flank_loss") for pulley in PULLEYS]),
        "thrust_ratio": axial[0] / axial[1],
    }


def power_balance(
    driving: float, load: float, loss: float, storing: float, thrust: float = 0.0, damped: float = 0.0
) -> dict[str, float]:
    """Powers of a run as its record names them [W], but that of a thrust, and the open balance.

    `damped` is the numerical damping of the time step.
    """
    open_power = driving - load - thrust - loss - storing - damped
    return {
        "driving_power": driving,
        "load_power": load,
        "storing_power": storing,
        "loss": loss,
        "power_residual": open_power / max(abs(driving), loss),
    }


def efficiency(driving: float, load: float, loss: float) -> float:
    """Share of the power put in that is not lost [1]: 0 without load; not a number where nothing is put in.

    Parameters
    ----------
    driving, load : float
        Power of the driving pulley, and power of the load [W]; negative where power flows backwards.
    loss : float
        [W]
    """
    put_in = max(driving, 0.0) + max(-load, 0.0)
    return 1.0 - loss / put_in if put_in > 0.0 else np.nan
