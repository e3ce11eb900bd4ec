"""Around a set: how far each parameter may be moved alone, and Sobol indices of all moved together."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc, sobol_indices

from cvt_hpc.fit.confirming import Confirmed
from cvt_hpc.fit.evaluating import Evaluation
from cvt_hpc.fit.job import Fit
from cvt_hpc.fit.scoring import Course
from cvt_hpc.vibration.classes import OccurrenceClass

_RESAMPLES = 200  # of the bootstrap


class Moved(NamedTuple):
    """Result of the first case with one parameter moved by a factor.

    Attributes
    ----------
    parameter : str
        Its name.
    factor, value : float
        The factor, and the resulting value [SI].
    course : Course
        Its runs.
    """

    parameter: str
    factor: float
    value: float
    course: Course

    @property
    def is_out(self) -> bool:
        """Whether nothing vibrates any more; undecided, failed and missing runs may vibrate."""
        if (self.course.classes == OccurrenceClass.NOT_RUN).all():
            return False
        open_ = (OccurrenceClass.UNDECIDED, OccurrenceClass.IRREGULAR, OccurrenceClass.FAILED)
        return not (self.course.vibrates | np.isin(self.course.classes, open_) & self.course.counted).any()


class Index(NamedTuple):
    """Sobol indices of a score to a parameter, with 95 % bounds by bootstrap; nan where it does not vary."""

    score: str
    parameter: str
    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float


class Around(NamedTuple):
    """Results around a set: its name, each parameter moved alone, all of them together."""

    name: str
    moved: list[Moved]
    indices: list[Index]


def look_around(fit: Fit, evaluation: Evaluation, confirmed: Sequence[Confirmed]) -> list[Around]:
    """Examine the surroundings of the best set and, if requested, of each start of the job; the best first.

    Parameters
    ----------
    fit : Fit
        The requested fit.
    evaluation : Evaluation
        Does the runs.
    confirmed : sequence of Confirmed
        The best one first; the starts are among them.
    """
    best, *others = confirmed
    chosen = [best, *(one for one in others if fit.around == "starts" and one.is_start)]
    studies = [one.name.replace(" ", "_") if one.is_start else "best" for one in chosen]
    return [
        Around(
            one.name,
            move_each(fit, evaluation, f"distances_{study}", one.scene),
            sensitivities(fit, evaluation, f"sensitivities_{study}", one.scene),
        )
        for one, study in zip(chosen, studies, strict=True)
    ]


def move_each(fit: Fit, evaluation: Evaluation, study: str, scene: NDArray[np.float64]) -> list[Moved]:
    """Move each parameter of a set [SI] alone by each factor, and run the first case in full."""
    places = [(column, factor) for column in range(len(scene)) for factor in sorted(fit.distances)]
    if not places:
        return []
    scenes = np.tile(scene, (len(places), 1))
    for row, (column, factor) in enumerate(places):
        scenes[row, column] *= factor
    (first, *_) = fit.cases
    found = evaluation.evaluate(study, scenes, {}, fit.thinned, [first])
    return [
        Moved(fit.free[column].name, factor, float(moved[column]), courses[first])
        for (column, factor), moved, courses in zip(places, scenes, found.courses, strict=True)
    ]


def reach(moved: list[Moved], parameter: str) -> tuple[float, float]:
    """Nearest factors below and above 1 at which the vibration goes out; nan where none was found."""
    out = np.array([one.factor for one in moved if one.parameter == parameter and one.is_out])
    below, above = out[out < 1.0], out[out > 1.0]
    return (
        float(below.max()) if below.size else float("nan"),
        float(above.min()) if above.size else float("nan"),
    )


def sensitivities(fit: Fit, evaluation: Evaluation, study: str, scene: NDArray[np.float64]) -> list[Index]:
    """Sobol indices of the total score and of each target's, all parameters within a part of a set [SI].

    Parameters are spread evenly by their logarithm, from (1 - nearby) to 1 / (1 - nearby) times the set.
    """
    if not fit.samples:
        return []
    size, rng = len(scene), np.random.default_rng(fit.seed)
    drawn = qmc.Sobol(2 * size, seed=rng).random(fit.samples)
    a, b = drawn[:, :size], drawn[:, size:]
    crossed = np.tile(a, (size, 1, 1))
    crossed[np.arange(size), :, np.arange(size)] = b.T
    shares = np.concatenate([a[None], b[None], crossed]).reshape(-1, size)
    scenes = scene * (1.0 - fit.nearby) ** (1.0 - 2.0 * shares)
    found = evaluation.evaluate(study, scenes, fit.coarse, fit.thinned)
    scores = np.column_stack([found.totals, found.scores]).reshape(size + 2, fit.samples, -1)
    names = ["total", *(target.name for target in fit.targets)]
    return [index for k, name in enumerate(names) for index in _indices(fit, name, scores[..., k], rng)]


def _indices(fit: Fit, name: str, scores: NDArray[np.float64], rng: np.random.Generator) -> Iterator[Index]:
    """Yield the indices of one score, shape (2 + free, samples): of both sets of samples, and crossed."""
    names = [one.name for one in fit.free]
    if np.ptp(scores[:2]) == 0.0:
        yield from (Index(name, parameter, *[np.nan] * 6) for parameter in names)
        return
    drawn = rng.integers(fit.samples, size=(_RESAMPLES, fit.samples))
    resampled = [_orders(part) for part in (scores[:, rows] for rows in drawn) if np.ptp(part[:2]) > 0.0]
    low, high = np.quantile(resampled, [0.025, 0.975], axis=0)
    for k, parameter in enumerate(names):
        both = zip(_orders(scores)[:, k], low[:, k], high[:, k], strict=True)
        yield Index(name, parameter, *(float(value) for order in both for value in order))


def _orders(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Indices of first and of total order, shape (2, free)."""
    given = {"f_A": scores[:1], "f_B": scores[1:2], "f_AB": scores[2:, None]}
    found = sobol_indices(func=given, n=scores.shape[1])
    return np.array([np.ravel(found.first_order), np.ravel(found.total_order)])
