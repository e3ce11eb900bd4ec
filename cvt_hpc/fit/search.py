"""The search: samples of the whole ranges, then differential evolution from the best of them.

Samples are those of a scrambled Sobol sequence, beside the job's own starts. Differential evolution is that
of scipy, a generation at once, so that its runs fill the lanes; it needs no gradient, which scores that are
shares of runs do not have. Both follow from the seed: a search that was stopped requests the same candidates
again, whose studies are there.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from cvt_hpc.fit.evaluating import Findings
from cvt_hpc.fit.job import Fit

_DIGITS = 9  # of a share: a rounding of the optimiser is no other candidate
Evaluate = Callable[[str, NDArray[np.float64]], Findings]


class Found(NamedTuple):
    """All candidates of a search, in the order in which they were requested.

    Attributes
    ----------
    stages : list of str
        Name of the study of each.
    scenes, scores, totals : arrays
        As of `Findings`.
    """

    stages: list[str]
    scenes: NDArray[np.float64]
    scores: NDArray[np.float64]
    totals: NDArray[np.float64]

    def best(self, count: int) -> NDArray[np.intp]:
        """Places of the best candidates, the earlier one first where two are as good."""
        return np.argsort(-self.totals, kind="stable")[:count]


def search(fit: Fit, evaluate: Evaluate, tell: Callable[[str], None] = lambda line: None) -> Found:
    """Look for the parameters that meet the targets best.

    Parameters
    ----------
    fit : Fit
        The requested fit.
    evaluate : callable
        Given the name of a study and the scenes of its candidates, shape (candidates, free) [SI].
    tell : callable
        Given a line after each study.
    """
    known: dict[tuple[float, ...], tuple[str, NDArray, NDArray, float]] = {}

    def totals_of(name: str, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Total score of each candidate, shape (candidates,); known ones are not run again."""
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
