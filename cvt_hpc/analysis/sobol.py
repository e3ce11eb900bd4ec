"""Sobol indices: which uncertain parameter a result owes its variance to, by samples with swapped parameters.

Of samples A and B, and those of A with one parameter from B, f(A), f(B) and f(AB) give the share of the
variance V that a parameter makes alone (first order; Saltelli et al. 2010) and with all others (total order;
Jansen 1999):

    S = mean(f(B) (f(AB) - f(A))) / V,    S_T = mean((f(A) - f(AB))^2) / (2 V)

Of the cells of a row together, numerators and variances are added before they are divided (Gamboa et al.
2014).
"""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.job.axes import ALL, NONE, SAMPLE, SWAPPED

RESAMPLES = 200  # of the bootstrap
WITHOUT = "without_value"  # attribute of a variable: what is the case where it is nan
_LEAST_KNOWN = 0.9  # of the samples: those left out are not like the others
_ENDS = {"": "index", "_low": "low end of the 95 % bounds", "_high": "high end of the 95 % bounds"}


def orders(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return indices of first and of total order, shape (2, parameter).

    Scores (..., 2 + parameter, sample) are f(A), f(B), and f(AB) of each parameter; not all alike. nan is
    left out; further cells are pooled.
    """
    both, crossed = scores[..., :2, :], scores[..., 2:, :]
    a, b = both[..., :1, :], both[..., 1:, :]
    mean = np.nanmean(both, axis=(-2, -1), keepdims=True)
    shares = np.nanmean([(b - mean) * (crossed - a), 0.5 * (a - crossed) ** 2], axis=-1)
    return shares.reshape(2, -1, crossed.shape[-2]).sum(axis=1) / np.nanvar(both, axis=(-2, -1)).sum()


def orders_with_bounds(scores: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return `orders` and the ends of their 95 % bounds by bootstrap, shape (3, 2, parameter).

    They are nan where the scores, as of `orders`, do not vary.
    """
    size = scores.shape[-1]
    if not _vary(scores):
        return np.full((3, 2, scores.shape[-2] - 2), np.nan)
    drawn = rng.integers(size, size=(RESAMPLES, size))
    resampled = [orders(part) for part in (scores[..., rows] for rows in drawn) if _vary(part)]
    return np.stack([orders(scores), *np.quantile(resampled, [0.025, 0.975], axis=0)])


def _vary(scores: NDArray[np.float64]) -> bool:
    """Whether each cell has a known sample, and the samples of any differ."""
    both = scores[..., :2, :]
    is_known = np.isfinite(both)
    least, most = np.where(is_known, both, np.inf), np.where(is_known, both, -np.inf)
    spans = most.max(axis=(-2, -1), initial=-np.inf) - least.min(axis=(-2, -1), initial=np.inf)
    return bool(spans.size) and bool(np.isfinite(spans).all()) and bool((spans > 0.0).any())


def sobol_indices(values: xr.DataArray, along: str = "") -> xr.Dataset:
    """Return the indices of a result in each cell, or in each row of cells.

    Parameters
    ----------
    values : DataArray
        Over the cells, `sample` and `swapped`. A sample counts if all its values are known.
    along : str
        Axis along which rows go, the cells of which are pooled; "": each cell alone.

    Returns
    -------
    Dataset
        Over `parameter` and the cells or rows `first_order` and `total_order`, with the ends of their 95 %
        bounds, `_low` and `_high`; nan where the result does not vary, or less than 90 % of the samples
        count. Of a row the cells count in which so many do.
    """
    parameters = [str(name) for name in values[SWAPPED].values if name not in (NONE, ALL)]
    values = values.rename({along: "row"}).drop_vars("row") if along else values.expand_dims("row")
    ordered = values.sel({SWAPPED: [NONE, ALL, *parameters]}).transpose(..., "row", SWAPPED, SAMPLE)
    dims, shape = ordered.dims[:-3], ordered.shape[:-3]
    found = np.empty((*shape, 3, 2, len(parameters)))
    for place in np.ndindex(shape):
        scores = ordered.values[place].astype(float)
        is_known = np.isfinite(scores).all(axis=1, keepdims=True)
        known = np.where(is_known, scores, np.nan)[is_known.mean(axis=(1, 2)) >= _LEAST_KNOWN]
        found[place] = orders_with_bounds(known, np.random.default_rng(0))
    cells = {dim: ordered[dim] for dim in dims if dim in ordered.coords}
    dataset = xr.Dataset(coords={**cells, "parameter": parameters})
    for k, order in enumerate(("first_order", "total_order")):
        for end, (suffix, words) in enumerate(_ENDS.items()):
            told = {"units": "1", "comment": f"Sobol index of {order.replace('_', ' ')}: {words}"}
            told[WITHOUT] = f"less than {100.0 * _LEAST_KNOWN:g} % of the samples count, or all are alike"
            dataset[order + suffix] = (*dims, "parameter"), found[..., end, k, :], told
    return dataset
