"""Intervals of a probability by samples with and without a property, and how many an adaptive study needs.

The intervals are those of Clopper and Pearson (1934). A study that looks at its runs, and goes on where the
interval is too wide, would stop more often where it is misled. Hence it looks at stated numbers of samples
alone, each twice the one before. At each of K looks the interval holds with a confidence of 1 - 0.05 / K, so
that all K hold together in 95 of 100 studies or more, wherever a cell stops (Bonferroni).

A further run can only ask for more samples: what is run does not depend on order, ranks or interruptions.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.job.values import Table
from cvt_hpc.vibration.classes import OccurrenceClass

CONFIDENCE = 0.95
# That a run vibrates or not: any other that has ended counts on neither side, and widens the interval
VERDICTS = (OccurrenceClass.QUIET, OccurrenceClass.VIBRATING, OccurrenceClass.SLIPPING)


def interval(count: Any, runs: Any, looks: int = 1) -> tuple[Any, Any]:
    """Return the ends of the interval that holds a rate with CONFIDENCE, at all of several looks.

    Numbers of runs, and of those with the property, may be arrays of one shape, and so are the ends then.
    """
    from scipy.special import betaincinv

    outside = 0.5 * (1.0 - CONFIDENCE) / looks
    count, runs = np.asarray(count, float), np.asarray(runs, float)
    low = np.where(count > 0, betaincinv(np.maximum(count, 1), runs - count + 1, outside), 0.0)
    high = np.where(count < runs, betaincinv(count + 1, np.maximum(runs - count, 1), 1.0 - outside), 1.0)
    return low[()], high[()]


def looks_of(design: Table, samples: int) -> list[int]:
    """Return the numbers of samples at which a study looks: of one that is not adaptive at all of them."""
    first = min(design.get("first_samples", samples), samples)
    return [first << k for k in range((samples // first).bit_length())]


class Looked(NamedTuple):
    """Progress of the cells of an adaptive study, arrays over the cells."""

    counted: NDArray[np.int64]  # samples at the last look, all of which have ended; 0 before the first
    # samples at the next look, or at the last one where the probability is known as well as was asked
    wanted: NDArray[np.int64]


def look(classes: NDArray[np.int8], design: Table) -> Looked:
    """Return how many samples count in each cell, and how many it wants.

    Parameters
    ----------
    classes : array, shape (..., samples)
        `OccurrenceClass` of each run.
    design : mapping
        `first_samples`, and `widest_interval`: of the probability of vibration, where a cell stops. It stops
        as well where runs without a verdict alone keep its interval wider, with the same confidence.
    """
    looks = looks_of(design, classes.shape[-1])
    counted = np.zeros(classes.shape[:-1], np.int64)
    wanted = np.full(classes.shape[:-1], looks[0])
    goes_on = np.ones(classes.shape[:-1], bool)
    for size, following in zip(looks, [*looks[1:], looks[-1]], strict=True):
        part = classes[..., :size]
        goes_on &= (part != OccurrenceClass.NOT_RUN).all(axis=-1)
        counted[goes_on] = size
        hits = (part == OccurrenceClass.VIBRATING).sum(axis=-1)
        hidden = (~np.isin(part, VERDICTS)).sum(axis=-1)
        low, high = (interval(n, size, len(looks))[end] for n, end in ((hits, 0), (hits + hidden, 1)))
        in_vain = interval(hidden, size, len(looks))[0] > design["widest_interval"]
        goes_on &= (high - low > design["widest_interval"]) & ~in_vain
        wanted[goes_on] = following
    return Looked(counted, wanted)
