"""The table [uncertain] of a job, from the mean and the covariance of its parameters."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAMPLES = 64


class Scattered(NamedTuple):
    """A parameter that scatters: key, SI unit, whether its logarithm is normal, limits [SI]."""

    key: str
    unit: str
    is_log: bool = False
    low: float = -np.inf
    high: float = np.inf


def uncertain_lines(parameters: Sequence[Scattered], mean: Array, covariance: Array, what: str) -> list[str]:
    """Lines of the table.

    Parameters
    ----------
    parameters : sequence of Scattered
        The parameters.
    mean, covariance : (k,) and (k, k) arrays
        Of their values [SI], or of the logarithms of these.
    what : str
        What scatters, for a comment.
    """
    deviation = np.sqrt(np.diag(covariance))
    lines = [f"[uncertain] # {what}", f"samples = {SAMPLES}"]
    for one, centre, spread in zip(parameters, mean.tolist(), deviation.tolist(), strict=True):
        kind, of_value, limits = "normal", centre, ""
        if one.is_log:  # moments of a value whose logarithm is normal
            kind, of_value = "log_normal", float(np.exp(centre + 0.5 * spread * spread))
            spread = of_value * float(np.sqrt(np.expm1(spread * spread)))
        for name, limit in (("from", one.low), ("to", one.high)):
            limits += f", {name} = {given(limit, one.unit)}" if np.isfinite(limit) else ""
        numbers = f"mean = {given(of_value, one.unit)}, standard_deviation = {given(spread, one.unit)}"
        lines.append(f'{one.key} = {{ distribution = "{kind}", {numbers}{limits} }}')
    if len(parameters) > 1:
        rows = ["[" + ", ".join(f"{one:.4f}" for one in row) + "]" for row in _correlation(covariance)]
        names = ", ".join(f'"{one.key}"' for one in parameters)
        lines += ["", "[uncertain.correlation]", f"parameters = [{names}]", f"matrix = [{', '.join(rows)}]"]
    return lines


def given(value: float, unit: str) -> str:
    """Return a value [SI] as a job file has it."""
    return f'"{value:.6g} {unit}"' if unit else f"{value:.6g}"


def _correlation(covariance: Array) -> Array:
    """Correlations, reduced until four digits keep their matrix positive definite."""
    deviation = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(deviation, deviation)
    least = float(np.linalg.eigvalsh(matrix).min())
    share = max(0.0, (1e-3 - least) / (1.0 - least))
    found: Array = (1.0 - share) * matrix + share * np.eye(len(matrix))
    return found
