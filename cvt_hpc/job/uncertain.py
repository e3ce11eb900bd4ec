"""Uncertain parameters of a job: distributions, from which every cell of the grid draws the same samples.

The axis `sample` counts the points of a scrambled Sobol sequence (Owen 1998; scipy.stats.qmc), a dimension of
it for each uncertain parameter. The values of a parameter follow from distributions, seed and the number of
the sample alone. So a study grows by further samples and keeps the earlier ones, and all cells have them in
common: two cells differ by their place on the grid, and not by the luck of the draw.

Correlated parameters have the copula of a normal distribution: the matrix is that of their normal scores,
which for normal parameters is the correlation of their values. Limits cut a distribution off, and what is
left keeps its shape. Mean and standard deviation are those without the limits.

For Sobol indices each sample is drawn twice, A and B, and a further axis `swapped` names the parameters that
are those of B: none, all, or one of them (Saltelli et al. 2010). Those that correlations connect are swapped
together: all `correlated` ones, or several groups, `correlated_1` and so on.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.job.axes import ALL, CORRELATED, NONE, SAMPLE, SWAPPED
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.units import from_si
from cvt_hpc.job.values import Document, Table, in_words
from cvt_hpc.parameters import Parameter, Parameters

TABLE = "uncertain"
BLOCK = 256  # samples evaluated together: always as many, so that a value has the same bits in every study
MOST = 2**16
OUTERMOST = 2.0**-31  # least share of a sample: points in the unit cube have a resolution of twice as much

# By kind the numbers that a distribution needs, and those that it may have
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("from", "to"), ()),
    "triangular": (("from", "mode", "to"), ()),
    "normal": (("mean", "standard_deviation"), ("from", "to")),
    "log_normal": (("mean", "standard_deviation"), ("from", "to")),
}
_SAMPLE = Parameter(0, "", "number of the Sobol point, common to all cells", minimum=0, maximum=MOST - 1)


class Distribution(NamedTuple):
    """Distribution of a parameter."""

    key: str  # the parameter
    kind: str  # "uniform", "triangular", "normal" or "log_normal"
    # what the kind needs, and limits `from` and `to`, in SI units of the parameter
    numbers: tuple[tuple[str, float], ...]

    def quantiles(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values [SI] below which shares of the distribution lie, of the shape of these."""
        from scipy.special import ndtri

        has = dict(self.numbers)
        low, high = has.get("from", -math.inf), has.get("to", math.inf)
        if self.kind == "uniform":
            return low + (high - low) * shares
        if self.kind == "triangular":
            left = (has["mode"] - low) / (high - low)
            rising = low + (high - low) * np.sqrt(left * shares)
            falling = high - (high - low) * np.sqrt((1.0 - left) * (1.0 - shares))
            return np.where(shares < left, rising, falling)
        below, within = self._share_within(low, high)
        centre, spread, to_value, _ = self._normal()
        # the limits hold whatever rounding does
        return np.clip(to_value(centre + spread * ndtri(below + within * shares)), low, high)

    def shares(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the shares of the distribution below values [SI], of the shape of these."""
        from scipy.special import ndtr

        has = dict(self.numbers)
        low, high = has.get("from", -math.inf), has.get("to", math.inf)
        if self.kind == "uniform":
            found = (values - low) / (high - low)
        elif self.kind == "triangular":
            span = high - low
            rising = (values - low) ** 2 / (span * max(has["mode"] - low, math.ulp(span)))
            falling = 1.0 - (high - values) ** 2 / (span * max(high - has["mode"], math.ulp(span)))
            found = np.where(values < has["mode"], rising, falling)
        else:
            below, within = self._share_within(low, high)
            found = (ndtr(self._scores(values)) - below) / within
        return np.where(values < low, 0.0, np.where(values > high, 1.0, found))

    def log_density(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the logarithm of the density at values [SI], but for a constant; -inf beyond the limits."""
        has = dict(self.numbers)
        low, high = has.get("from", -math.inf), has.get("to", math.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.kind == "uniform":
                found = np.zeros_like(values)
            elif self.kind == "triangular":
                rising = (values - low) / (has["mode"] - low)
                falling = (high - values) / (high - has["mode"])
                found = np.log(np.where(values < has["mode"], rising, falling))
            else:
                found = -0.5 * self._scores(values) ** 2
                found = found - np.log(values) if self.kind == "log_normal" else found
        return np.where((values < low) | (values > high), -math.inf, found)

    def halved(self) -> "Distribution":
        """Return the distribution of half the standard deviation about the same mean; limits stay."""
        has = dict(self.numbers)
        if "standard_deviation" in has:
            has["standard_deviation"] *= 0.5
        else:
            mean = sum(has.values()) / len(has)
            has = {name: mean + 0.5 * (value - mean) for name, value in has.items()}
        return self._replace(numbers=tuple(has.items()))

    def _scores(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the scores of the normal number behind values."""
        centre, spread, _, _ = self._normal()
        return ((np.log(values) if self.kind == "log_normal" else values) - centre) / spread

    def share_within(self) -> float:
        """Return the share of the distribution that its limits leave, 1 of kinds that end at them."""
        if self.kind in ("uniform", "triangular"):
            return 1.0
        has = dict(self.numbers)
        return self._share_within(has.get("from", -math.inf), has.get("to", math.inf))[1]

    def _share_within(self, low: float, high: float) -> tuple[float, float]:
        """Return the share below both limits and that between them."""
        from scipy.special import ndtr

        centre, spread, _, of_value = self._normal()
        below, up_to = (float(ndtr((of_value(limit) - centre) / spread)) for limit in (low, high))
        return below, up_to - below

    def _normal(self) -> tuple[float, float, Callable, Callable[[float], float]]:
        """Mean and standard deviation of the normal number behind it, and functions to a value and back."""
        has = dict(self.numbers)
        mean, deviation = has["mean"], has["standard_deviation"]
        if self.kind == "normal":
            return mean, deviation, np.asarray, float
        variance = math.log1p((deviation / mean) ** 2)
        centre, spread = math.log(mean) - 0.5 * variance, math.sqrt(variance)
        return centre, spread, np.exp, lambda value: math.log(value) if value > 0.0 else -math.inf

    def in_unit(self, unit: str, wanted: str) -> "Distribution":
        """Return the distribution with its numbers [unit] in another unit."""
        return self._replace(numbers=tuple((name, from_si(one, unit, wanted)) for name, one in self.numbers))

    def in_words(self, unit: str, wanted: str) -> str:
        """State the distribution for people, in a unit that is wanted."""
        told = (f"{key.replace('_', ' ')} {in_words(value, unit, wanted)}" for key, value in self.numbers)
        return f"{self.kind.replace('_', '-')}, {', '.join(told)}"


@dataclass(frozen=True)
class Uncertain:
    """The uncertain parameters of a job."""

    distributions: tuple[Distribution, ...]  # by name, in the order of the dimensions of the Sobol sequence
    seed: int  # of its scrambling
    correlated: tuple[str, ...] = ()  # parameters that are correlated
    matrix: tuple[tuple[float, ...], ...] = ()  # the correlation of their normal scores
    indices: bool = False  # whether a second set of samples is drawn

    def value(self, place: int, sample: int, swapped: str = NONE) -> float:
        """Return the value [SI] of the distribution at a place for a sample, by what is swapped."""
        block, row = divmod(sample, BLOCK)
        key = self.distributions[place].key
        is_second = swapped in (ALL, self._group_of[key])
        return float(_block(self, block)[row, place + is_second * len(self.distributions)])

    def groups(self) -> dict[str, tuple[str, ...]]:
        """Return groups of parameters that are independent: those together that correlations connect."""
        from scipy.sparse.csgraph import connected_components

        numbers = connected_components(np.array(self.matrix), directed=False)[1] if self.matrix else ()
        parts: dict[int, list[str]] = {}
        for key, number in zip(self.correlated, numbers, strict=True):
            parts.setdefault(int(number), []).append(key)
        several = [tuple(part) for part in parts.values() if len(part) > 1]
        together = {key for part in several for key in part}
        names = [CORRELATED] if len(several) == 1 else [f"{CORRELATED}_{k + 1}" for k in range(len(several))]
        alone = {one.key: (one.key,) for one in self.distributions if one.key not in together}
        return alone | dict(zip(names, several, strict=True))

    @cached_property
    def _group_of(self) -> dict[str, str]:
        return {key: group for group, keys in self.groups().items() for key in keys}

    def document(self) -> Document:
        """Return the table of a job file, without the number of samples, in JSON types."""
        told: Document = {"seed": self.seed}
        told |= {one.key: {"distribution": one.kind, **dict(one.numbers)} for one in self.distributions}
        if self.correlated:
            matrix = [list(row) for row in self.matrix]
            told["correlation"] = {"parameters": list(self.correlated), "matrix": matrix}
        return told | ({"indices": True} if self.indices else {})


@dataclass(frozen=True)
class Scatter:
    """Values that one uncertain parameter takes by the number of the sample; the source of a `Rule`."""

    uncertain: Uncertain
    place: int

    @property
    def names(self) -> tuple[str, ...]:
        """The axes along which it varies."""
        return (SAMPLE, SWAPPED) if self.uncertain.indices else (SAMPLE,)

    def in_words(self, unit: str, wanted: str) -> str:
        """State the distribution for people, in a unit that is wanted, and what it is correlated with."""
        one = self.uncertain.distributions[self.place]
        group = next(keys for keys in self.uncertain.groups().values() if one.key in keys)
        others = ", ".join(key for key in group if key != one.key)
        return one.in_words(unit, wanted) + (f"; correlated with {others}" if others else "")

    def value(self, parameters: Parameters) -> float:
        """Return the value [SI] of the sample."""
        return self.uncertain.value(self.place, *(parameters[name] for name in self.names))


@lru_cache(maxsize=2 * MOST // BLOCK)
def _block(uncertain: Uncertain, number: int) -> NDArray[np.float64]:
    """Return the values of the samples from BLOCK * number on, shape (BLOCK, distribution) [SI].

    For Sobol indices those of the second set stand behind, for each distribution.
    """
    from scipy.special import ndtr, ndtri
    from scipy.stats import qmc

    sets, size = 2 if uncertain.indices else 1, len(uncertain.distributions)
    found = uncertain.distributions * sets
    engine = qmc.Sobol(len(found), seed=np.random.default_rng(uncertain.seed))
    if number:  # the engine cannot go on by none
        engine.fast_forward(BLOCK * number)
    # in the middle of the cells of the sequence's resolution, so never at 0, where quantiles are infinite
    shares = engine.random(BLOCK) + OUTERMOST
    keys = [one.key for one in uncertain.distributions]
    for first in range(0, sets * size, size) if uncertain.correlated else ():
        columns = [first + keys.index(key) for key in uncertain.correlated]
        scores, factor = ndtri(shares[:, columns]), np.linalg.cholesky(np.array(uncertain.matrix))
        for row, column in enumerate(columns):  # sums in a fixed order, which a matrix product has not
            shares[:, column] = ndtr(sum(factor[row, k] * scores[:, k] for k in range(row + 1)))
    return np.stack([one.quantiles(shares[:, k]) for k, one in enumerate(found)], axis=1)


def read_document(table: Table) -> Uncertain:
    """Return what a table is of, as `Uncertain.document` gives it."""
    tables = ((key, dict(one)) for key, one in table.items() if isinstance(one, Mapping))
    kinds = {key: one for key, one in tables if "distribution" in one}
    drawn = (Distribution(key, one.pop("distribution"), tuple(one.items())) for key, one in kinds.items())
    correlation = table.get("correlation", {"parameters": (), "matrix": ()})
    matrix = tuple(map(tuple, correlation["matrix"]))
    is_second = table.get("indices", False)
    return Uncertain(tuple(drawn), table["seed"], tuple(correlation["parameters"]), matrix, is_second)


def with_samples(schema: Schema, table: Table) -> Schema:
    """Return the schema of a job with a table [uncertain], which knows the number of a sample."""
    known = {SAMPLE: _SAMPLE}
    if table.get("indices"):
        keys = (name.rpartition(".")[2] for name, _ in schema.flatten(table))
        drawn = [key for key in keys if key in schema.parameters]
        several = (f"{CORRELATED}_{k + 1}" for k in range(len(drawn) // 2))
        choices = (NONE, ALL, CORRELATED, *several, *drawn)
        known[SWAPPED] = Parameter(NONE, "", "which are those of the second set of samples", choices=choices)
    return replace(schema, sections=schema.sections | {TABLE: known})
