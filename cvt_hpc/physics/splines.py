"""Hierarchical cubic B-splines on a closed path: a coarse basis everywhere, finer splines where requested.

Finer splines are added and change none of the coarser ones (Bullinger et al. 2005, sec. 5.1, fig. 12): each
level halves the spacing and takes the splines that sit between those of the level before, which with them
span the finer space.
"""

from typing import NamedTuple

import numpy as np


class Splines(NamedTuple):
    """A basis of n splines at N stations."""

    values: np.ndarray  # of each spline at the stations, (N, n) [1]
    centres: np.ndarray  # where it sits, (n,) [m]
    spacings: np.ndarray  # a quarter of its width, (n,) [m]
    levels: np.ndarray  # (n,) int, 0 the coarse ones


def cubic_spline(x: np.ndarray) -> np.ndarray:
    """Cardinal cubic B-spline, of support |x| < 2 and value 2/3 at 0."""
    x = np.abs(x)
    inner = (4.0 - 6.0 * x**2 + 3.0 * x**3) / 6.0
    outer = (2.0 - x) ** 3 / 6.0
    return np.where(x < 1.0, inner, np.where(x < 2.0, outer, 0.0))


def hierarchical_splines(
    position: np.ndarray, length: float, coarse: int, zones: list[list[tuple[float, float]]]
) -> Splines:
    """Basis at the stations of a closed path, level by level.

    `position` (N,) are their path coordinates and `length` that of the path [m]; `coarse` is the number of
    splines of level 0, at least 4. Of each finer level `zones` has the intervals (start, end) of the path
    that it refines [m]: it takes the splines whose centres lie there. An interval may reach beyond the path's
    seam.
    """
    found, widths, levels = [], [], []
    for level, intervals in enumerate([[(0.0, length)], *zones]):
        spacing = length / coarse / 2**level
        offered = np.arange(coarse * 2**level)
        offered = spacing * (offered if level == 0 else offered[1::2])
        kept = [c for c in offered if any((c - start) % length <= end - start for start, end in intervals)]
        found += kept
        widths += [spacing] * len(kept)
        levels += [level] * len(kept)
    centres, spacings = np.array(found), np.array(widths)
    apart = (position[:, None] - centres + 0.5 * length) % length - 0.5 * length
    return Splines(cubic_spline(apart / spacings), centres, spacings, np.array(levels))
