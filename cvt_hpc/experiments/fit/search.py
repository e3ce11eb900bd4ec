"""The search: samples of the whole ranges, then differential evolution from the best of them.

Samples are those of a scrambled Sobol sequence, beside the job's own starts. Differential evolution is that
of scipy, a generation at once, so that its runs fill the lanes; it needs no gradient, which scores that are
shares of runs do not have. Both follow from the seed: a search that was stopped requests the same candidates
again, whose studies are there.

The best candidates are run in full, which gives the results that count of a set. Around a set `look_around`
finds how far each parameter may be moved alone, and Sobol indices of all moved together.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from cvt_hpc.analysis.sobol import orders_with_bounds
from cvt_hpc.experiments.fit.evaluating import Evaluation, Findings
from cvt_hpc.experiments.fit.job import Course, Fit
from cvt_hpc.vibration.classes import OccurrenceClass

_DIGITS = 9  # of a share: a rounding of the optimiser is no other candidate
Evaluate = Callable[[str, NDArray[np.float64]], Findings]

_START = "start "


class Found(NamedTuple):
    """All candidates of a search, in the order in which they were requested."""

    stages: list[str]  # name of the study of each
    # scenes, scores, totals: as of `Findings`
    scenes: NDArray[np.float64]
    scores: NDArray[np.float64]
    totals: NDArray[np.float64]

    def best(self, count: int) -> NDArray[np.intp]:
        """Return places of the best candidates, the earlier one first where two are as good."""
        return np.argsort(-self.totals, kind="stable")[:count]


def search(fit: Fit, evaluate: Evaluate, tell: Callable[[str], None] = lambda line: None) -> Found:
    """Look for the parameters that meet the targets best, and tell a line after each study.

    `evaluate` takes the name of a study and the scenes of its candidates, (candidates, free) [SI].
    """
    known: dict[tuple[float, ...], tuple[str, NDArray, NDArray, float]] = {}

    def totals_of(name: str, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the total score of each candidate, (candidates,); known ones are not run again."""
        keys = [tuple(row) for row in shares.round(_DIGITS).tolist()]
        if new := [key for key in dict.fromkeys(keys) if key not in known]:
            found = evaluate(name, fit.scenes(np.array(new)))
            each = zip(new, found.scenes, found.scores, found.totals, strict=True)
            known.update({key: (name, scene, scores, total) for key, scene, scores, total in each})
            best = max(entry[-1] for entry in known.values())
            tell(f"{name}: {len(new)} candidates, score up to {found.totals.max():.3f}; so far {best:.3f}")
        return np.array([known[key][-1] for key in keys])

    rng = np.random.default_rng(fit.seed)
    samples = qmc.Sobol(len(fit.free), seed=rng).random(fit.screened)
    screened = np.vstack([fit.starts, samples])
    order = np.argsort(-totals_of("screening", screened), kind="stable")
    if fit.generations:
        generation = -1  # the first one is that of the population itself, which is known

        def energies(shares: NDArray[np.float64]) -> NDArray[np.float64]:
            nonlocal generation
            generation += 1
            return -totals_of(f"generation_{generation:03d}", shares.T)

        differential_evolution(
            energies,
            [(0.0, 1.0)] * len(fit.free),
            init=screened[order[: fit.population]],
            maxiter=fit.generations,
            seed=rng,
            tol=0.0,
            polish=False,
            updating="deferred",
            vectorized=True,
        )
    stages, scenes, scores, totals = zip(*known.values(), strict=True)
    return Found(list(stages), np.array(scenes), np.array(scores), np.array(totals))


@dataclass(frozen=True)
class Confirmed:
    """A set run in full."""

    name: str  # "start 1" for a start of the job, else the study of the search in which it was found
    scene: NDArray[np.float64]  # shape (free,): values of the free parameters [SI]
    coarse: float  # score in the search
    scores: NDArray[np.float64]  # shape (repeats, target): 0 to 1
    totals: NDArray[np.float64]  # shape (repeats,): their weighted means
    courses: list[dict[str, Course]]  # of each repeat its runs by case

    @property
    def is_start(self) -> bool:
        """Tell whether the job has the set as a start."""
        return self.name.startswith(_START)

    @property
    def total(self) -> float:
        """Return the mean score of the repeats."""
        return float(self.totals.mean())

    @property
    def spread(self) -> tuple[float, float]:
        """Return the smallest and the largest score of the repeats."""
        return float(self.totals.min()), float(self.totals.max())

    @property
    def mean(self) -> NDArray[np.float64]:
        """Return the score of each target, mean over the repeats."""
        return self.scores.mean(axis=0)


def confirm(fit: Fit, evaluation: Evaluation, found: Found) -> list[Confirmed]:
    """Run the best candidates and the job's own starts in full, as often as requested; the best one first.

    The candidates of the search have the starts before all others.
    """
    starts = len(fit.starts)
    chosen = list(dict.fromkeys([*range(starts), *found.best(fit.confirmed).tolist()]))
    findings = [
        evaluation.evaluate(name, found.scenes[chosen], settings, fit.values)
        for name, settings in _repeats(fit).items()
    ]
    confirmed = [
        Confirmed(
            f"{_START}{place + 1}" if place < starts else found.stages[place],
            found.scenes[place],
            float(found.totals[place]),
            np.array([one.scores[row] for one in findings]),
            np.array([one.totals[row] for one in findings]),
            [one.courses[row] for one in findings],
        )
        for row, place in enumerate(chosen)
    ]
    return sorted(confirmed, key=lambda one: -one.total)


def _repeats(fit: Fit) -> Mapping[str, Mapping[str, Any]]:
    """Return name and settings of the study of each repeat."""
    for key, values in fit.repeat.items():
        return {f"confirmed_{number}": {key: value} for number, value in enumerate(values, 1)}
    return {"confirmed": {}}


class Moved(NamedTuple):
    """Result of the first case with one parameter moved by a factor."""

    parameter: str  # its name
    # factor, value: the factor, and the resulting value [SI]
    factor: float
    value: float
    course: Course  # its runs

    @property
    def is_out(self) -> bool:
        """Tell whether nothing vibrates any more; undecided, failed and missing runs may vibrate."""
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

    The starts are among the confirmed ones.
    """
    best, *others = confirmed
    chosen = [best, *(one for one in others if fit.around == "starts" and one.is_start)]
    studies = [one.name.replace(" ", "_") if one.is_start else "best" for one in chosen]
    return [
        Around(
            one.name,
            _move_each(fit, evaluation, f"distances_{study}", one.scene),
            sensitivities(fit, evaluation, f"sensitivities_{study}", one.scene),
        )
        for one, study in zip(chosen, studies, strict=True)
    ]


def _move_each(fit: Fit, evaluation: Evaluation, study: str, scene: NDArray[np.float64]) -> list[Moved]:
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
    """Return the nearest factors below and above 1 that end the vibration; nan where none was found."""
    out = np.array([one.factor for one in moved if one.parameter == parameter and one.is_out])
    below, above = out[out < 1.0], out[out > 1.0]
    return (
        float(below.max()) if below.size else float("nan"),
        float(above.min()) if above.size else float("nan"),
    )


def sensitivities(fit: Fit, evaluation: Evaluation, study: str, scene: NDArray[np.float64]) -> list[Index]:
    """Return Sobol indices of the total score and of each target's around a set [SI].

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
    found = orders_with_bounds(scores, rng)
    for k, one in enumerate(fit.free):
        yield Index(name, one.name, *map(float, found[:, :, k].T.ravel()))
