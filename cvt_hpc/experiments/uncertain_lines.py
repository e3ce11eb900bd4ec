"""The table [uncertain] of a job, and the distribution that is nearest to weighed samples."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.job.uncertain import Distribution

Array = NDArray[np.float64]
SAMPLES = 64
_CHANCE = 0.05  # that any pair of independent parameters passes for correlated
_BOUNDS = [-2.0, -1.0], [2.0, 2.0]  # of place in standard deviations, and of the logarithm of the width


def given(value: float, unit: str) -> str:
    """Return a value [SI] as a job file has it."""
    return f'"{value:.6g} {unit}"' if unit else f"{value:.6g}"


def uncertain_lines(
    what: str,
    distributions: Sequence[Distribution],
    units: Mapping[str, str],
    correlation: Array,
    comments: Mapping[str, str] | None = None,
) -> list[str]:
    """Lines of the table: `what` scatters, for a comment, SI units and further comments by parameter.

    `correlation`, (parameter, parameter), is that of their normal scores; parameters that have none with any
    other one are independent.
    """
    lines, told = [f"[uncertain] # {what}", f"samples = {SAMPLES}"], dict(comments or {})
    for one in distributions:
        numbers = ", ".join(f"{name} = {given(value, units[one.key])}" for name, value in one.numbers)
        line = f'{one.key} = {{ distribution = "{one.kind}", {numbers} }}'
        lines.append(f"{line} # {told[one.key]}" if one.key in told else line)
    kept = np.flatnonzero((correlation != 0.0).sum(axis=0) > 1)
    names, correlation = [f'"{distributions[k].key}"' for k in kept.tolist()], correlation[np.ix_(kept, kept)]
    if names:
        # reduced until four digits keep the matrix positive definite
        least = float(np.linalg.eigvalsh(correlation).min())
        share = max(0.0, (1e-3 - least) / (1.0 - least))
        matrix = (1.0 - share) * correlation + share * np.eye(len(names))
        rows = ["[" + ", ".join(f"{one:.4f}" for one in row) + "]" for row in matrix]
        head = f"parameters = [{', '.join(names)}]"
        lines += ["", "[uncertain.correlation]", head, f"matrix = [{', '.join(rows)}]"]
    return lines


def correlated_groups(ranks: Array, effective: float, before: NDArray) -> NDArray[np.int64]:
    """Number of the group of each parameter, (parameter,): one alone, or several that are correlated.

    Those of one group `before` the measurement, (parameter,), stay together. Else groups are what pairs
    connect whose rank correlation, of `ranks` (parameter, parameter), is significant:

        |rho| > z / sqrt(n - 1),    z = Phi^-1(1 - _CHANCE / (2 m)),

    n being the `effective` number of samples and m the number of pairs (Bonferroni).
    """
    from scipy.sparse.csgraph import connected_components
    from scipy.special import ndtri

    pairs = max(len(ranks) * (len(ranks) - 1) // 2, 1)
    least = ndtri(1.0 - 0.5 * _CHANCE / pairs) / np.sqrt(max(effective - 1.0, 1.0))
    links = (np.abs(ranks) > least) | (before == before[:, np.newaxis])
    found: NDArray[np.int64] = connected_components(links, directed=False)[1]
    return found


def shares_of(values: Array, weights: Array) -> Array:
    """Share of weighed samples (n,) below each, half of its own weight included."""
    order, shares = np.argsort(values), np.empty_like(values)
    shares[order] = np.cumsum(weights[order]) - 0.5 * weights[order]
    return shares


def nearest_distribution(prior: Distribution, values: Array, weights: Array) -> Distribution:
    """Return the distribution that is nearest to weighed samples (n,) of a prior one.

    It is uniform, or normal, or log-normal where the prior is, and stays within the limits of that. Its
    numbers make the mean square of the difference of both cumulative distributions least (Cramer-von Mises),
    and of both kinds the one is taken of which that is less. Below the k-th of m independent samples lies on
    average the share k / (m + 1); m is the effective number of the weighed ones.
    """
    from scipy.optimize import least_squares

    has, count = dict(prior.numbers), 1.0 / (weights**2).sum()
    shares = (count * shares_of(values, weights) + 0.5) / (count + 1.0)
    limits = tuple((name, has[name]) for name in ("from", "to") if name in has)
    mean = float(weights @ values)
    spread = float(np.sqrt(weights @ (values - mean) ** 2))

    def made(kind: str, place: float, width: float) -> Distribution:
        middle, deviation = mean + place * spread, spread * float(np.exp(width))
        if kind == "uniform":
            ends = middle + np.sqrt(3.0) * deviation * np.array([-1.0, 1.0])
            low, high = np.clip(ends, has.get("from", -np.inf), has.get("to", np.inf)).tolist()
            return Distribution(prior.key, kind, (("from", low), ("to", high)))
        if kind == "log_normal":
            middle = mean * float(np.exp(place * spread / mean))
        return Distribution(prior.key, kind, (("mean", middle), ("standard_deviation", deviation), *limits))

    def off(at: Array, kind: str) -> Array:
        return np.sqrt(weights) * (made(kind, *at.tolist()).shares(values) - shares)

    kinds = "uniform", "log_normal" if prior.kind == "log_normal" else "normal"
    fits = {kind: least_squares(off, [0.0, 0.0], bounds=_BOUNDS, args=(kind,)) for kind in kinds}
    kind = min(fits, key=lambda one: fits[one].cost)
    return made(kind, *fits[kind].x.tolist())
