"""Whether an amplitude comes and goes about a threshold without a trend: a longer run would not decide.

The belt near 40 N m moves so: judder of the driven pulley rings a strand, now above the threshold and now
below. Called irregular is a record of windows in which

- the amplitude crosses the threshold LEAST_CROSSINGS times or more: growth and decay cross it once, a single
  burst twice;
- it scatters by LEAST_SCATTER of its mean or more: settled vibrations scatter by 2-7 %, noise in the band by
  10-15 %, judder by 30-100 %. A steady amplitude that happens to lie at the threshold is not irregular;
- a trend is ruled out: the 95 % confidence interval of the gain over the record, in e-folds, contains 0 and
  lies within +-`most_gain`. So an amplitude that grows or decays by that much is called irregular in at most
  one of 40 records. Large scatter requires more windows: some 15 if the logarithm scatters by 0.5.

Windows within one burst are alike, so the interval is that of fewer independent windows: n (1 - r)/(1 + r)
of n, r being the autocorrelation of neighbouring windows about the trend (Santer et al. 2000, J. Geophys.
Res. 105, 7337-7356), and of these there have to be LEAST_WINDOWS. A beat of which the record holds a few
periods is undecided for that reason.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEAST_WINDOWS = 12  # that are independent
LEAST_CROSSINGS = 4
LEAST_SCATTER = 0.2
_CONFIDENCE = 0.975  # one-sided


def relative_scatter(windows: ArrayLike) -> NDArray[np.float64]:
    """Standard deviation of amplitudes (window, ...) over their mean, (...); nan where nothing moves."""
    amplitudes = np.asarray(windows, dtype=float)
    with np.errstate(invalid="ignore"):
        return np.std(amplitudes, axis=0) / np.mean(amplitudes, axis=0)


def is_irregular(windows: ArrayLike, threshold: float, most_gain: float) -> bool:
    """Whether an amplitude comes and goes about a threshold, and a trend is ruled out.

    Parameters
    ----------
    windows : array, shape (window,)
        Amplitudes in successive windows, equally spaced in time.
    threshold : float
        From which amplitude a strand vibrates, in the same unit.
    most_gain : float
        Growth or decay over the record that has to be ruled out [e-folds].
    """
    amplitudes = np.asarray(windows, dtype=float)
    crossings = np.count_nonzero(np.diff(amplitudes >= threshold))
    if crossings < LEAST_CROSSINGS or relative_scatter(amplitudes) < LEAST_SCATTER:
        return False
    return is_stationary(amplitudes, most_gain)


def is_stationary(windows: ArrayLike, most_gain: float) -> bool:
    """Whether a trend of an amplitude is ruled out; arguments as of `is_irregular`."""
    amplitudes = np.asarray(windows, dtype=float)
    if len(amplitudes) < LEAST_WINDOWS or not np.all(amplitudes > 0.0):
        return False
    gain, error = _gain(np.log(amplitudes))
    return abs(gain) < error and abs(gain) + error < most_gain


def _gain(levels: NDArray[np.float64]) -> tuple[float, float]:
    """Gain of levels (window,) along their straight line, and how far it is uncertain; inf: not known."""
    n = len(levels)
    t = np.linspace(-0.5, 0.5, n)
    slope = t @ levels / (t @ t)
    scatter = levels - levels.mean() - slope * t
    # about a fitted line neighbours seem less alike than they are, by (2 + 4 r)/n
    found = (scatter[1:] @ scatter[:-1]) / (scatter @ scatter)
    alike = float(np.clip((n * found + 2.0) / (n - 4.0), 0.0, 1.0))
    freedom = n * (1.0 - alike) / (1.0 + alike) - 2.0
    if freedom < LEAST_WINDOWS - 2:
        return float(slope), np.inf
    from scipy.special import stdtrit  # takes long, and quiet runs do without

    error = np.sqrt(scatter @ scatter / (freedom * (t @ t)))
    return float(slope), float(stdtrit(freedom, _CONFIDENCE) * error)
