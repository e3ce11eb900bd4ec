"""Whole cycles of the mass, and the energy that goes in and out in one of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from cvt_hpc.models.oscillator.transient import Transient


def cycle_starts(x: np.ndarray, least: float) -> np.ndarray:
    """Where a displacement comes up through the middle of its range.

    Parameters
    ----------
    x : (n,) array
        Displacement [m].
    least : float
        Half stroke [m] up to which a motion has no cycles.

    Returns
    -------
    (cycles + 1,) int array
        The sample before each passage; empty where there are none.
    """
    if x.size == 0 or np.ptp(x) <= 2.0 * least:
        return np.zeros(0, np.int64)
    away = x - 0.5 * (x.max() + x.min())
    return np.flatnonzero((away[:-1] < 0.0) & (away[1:] >= 0.0))


def work_per_cycle(run: Transient, starts: np.ndarray) -> dict[str, float]:
    """Mean work of a cycle, by the trapezoidal rule over the samples.

    A jump of friction between two samples leaves an error of the first order in their interval, a sticking
    phase that falls between two is not seen: `energy_residual` shows it.

    Parameters
    ----------
    run : Transient
        With all samples recorded.
    starts : (cycles + 1,) int array
        Samples at which cycles start and end.

    Returns
    -------
    dict
        `friction_work` and `damping_loss` [J], and `energy_residual`, what remains of friction's work after
        the loss and the change of kinetic energy, over the work that friction turns over either way; nan
        without a cycle.
    """
    if len(starts) < 2:
        return dict.fromkeys(("friction_work", "damping_loss", "energy_residual"), np.nan)
    o, cycles = run.constants, slice(starts[0], starts[-1] + 1)
    v = run.channel("speed")[cycles]
    power = run.friction()[cycles] * v
    count = len(starts) - 1
    work, turned_over, loss = (
        float(np.trapezoid(rate, dx=run.interval)) for rate in (power, np.abs(power), o.damping * v * v)
    )
    # cycles start at one displacement: spring and preload have done no work
    kinetic = 0.5 * o.mass * v**2
    left = work - loss - (kinetic[-1] - kinetic[0])
    return {
        "friction_work": work / count,
        "damping_loss": loss / count,
        "energy_residual": float(left / turned_over),
    }
