"""Sobol indices: which uncertain parameter a result owes its variance to, by samples with swapped parameters.

Of samples A and B, and those of A with one parameter from B, f(A), f(B) and f(AB) give the share of the
variance V that a parameter makes alone (first order; Saltelli et al. 2010) and with all others (total order;
Jansen 1999):

    S = mean(f(B) (f(AB) - f(A))) / V,    S_T = mean((f(A) - f(AB))^2) / (2 V)
"""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.job.axes import ALL, NONE, SAMPLE, SWAPPED

_RESAMPLES = 200  # of the bootstrap
_LEAST_KNOWN = 0.9  # of the samples: those left out are not like the others
_ENDS = {"": "index", "_low": "low end of the 95 % bounds", "_high": "high end of the 95 % bounds"}


def orders(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return indices of first and of total order, shape (2, parameter).

    Parameters
    ----------
    scores : array, shape (2 + parameter, sample)
        f(A), f(B), and f(AB) of each parameter; not all alike.
    """
    a, b, crossed = scores[0], scores[1], scores[2:]
    variance = np.var(scores[:2])
    first = np.mean((b - np.mean(scores[:2])) * (crossed - a), axis=1)
    return np.stack([first, 0.5 * np.mean((a - crossed) ** 2, axis=1)]) / variance


def orders_with_bounds(scores: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return `orders` and the ends of their 95 % bounds by bootstrap, shape (3, 2, parameter).

    They are nan where the scores, as of `orders`, do not vary.
    """
    if scores.shape[1] == 0 or np.ptp(scores[:2]) == 0.0:
        return np.full((3, 2, len(scores) - 2), np.nan)
    drawn = rng.integers(scores.shape[1], size=(_RESAMPLES, scores.shape[1]))
    resampled = [orders(part) for part in (scores[:, rows] for rows in drawn) if np.ptp(part[:2]) > 0.0]
    return np.stack([orders(scores), *np.quantile(resampled, [0.025, 0.975], axis=0)])


def sobol_indices(values: xr.DataArray) -> xr.Dataset:
    """Return the indices of a result in each cell.

    Parameters
    ----------
    values : DataArray
        Over the cells, `sample` and `swapped`. A sample counts if all its values are known.

    Returns
    -------
    Dataset
        Over `parameter` and the cells `first_order` and `total_order`, with the ends of their 95 % bounds,
        `_low` and `_high`; nan where the result does not vary, or less than 90 % of the samples count.
    """
    parameters = [str(name) for name in values[SWAPPED].values if name not in (NONE, ALL)]
    ordered = values.sel({SWAPPED: [NONE, ALL, *parameters]}).transpose(..., SWAPPED, SAMPLE)
    dims, shape = ordered.dims[:-2], ordered.shape[:-2]
    found = np.empty((*shape, 3, 2, len(parameters)))
    for cell in np.ndindex(shape):
        scores = ordered.values[cell].astype(float)
        is_known = np.isfinite(scores).all(axis=0)
        known = scores[:, is_known if is_known.mean() >= _LEAST_KNOWN else []]
        found[cell] = orders_with_bounds(known, np.random.default_rng(0))
    dataset = xr.Dataset(coords={"parameter": parameters})
    for k, order in enumerate(("first_order", "total_order")):
        for end, (suffix, words) in enumerate(_ENDS.items()):
            told = {"units": "1", "comment": f"Sobol index of {order.replace('_', ' ')}: {words}"}
            dataset[order + suffix] = (*dims, "parameter"), found[..., end, k, :], told
    return dataset
