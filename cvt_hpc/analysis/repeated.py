"""What a sample of runs that were done again another way tells of their study, in words."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from cvt_hpc.analysis.comparison import Comparison, compare
from cvt_hpc.study import open_results
from cvt_hpc.study.repeats import AUDIT, WAYS, interval
from cvt_hpc.vibration.agreement import PairClass
from cvt_hpc.vibration.classes import OccurrenceClass

_SAMPLES = (*WAYS.values(), ("in full", AUDIT))  # words of a way, and the folder of its runs


def contradictions(found: Comparison, way: str) -> str:
    """Return how many runs of a sample contradict those of the study.

    Parameters
    ----------
    found : Comparison
        Of the study with the runs that were done again.
    way : str
        How they were done again, in words.
    """
    runs, contradicting = int(found.answered.sum()), int(found.contradicts.sum())
    low, high = interval(contradicting, runs)
    share = f"{contradicting / runs:.2%}, " if runs else ""
    others = int((found.answered & (found.pairs == PairClass.OTHERWISE)).sum())
    failed = sum(
        count for kinds, count in found.counts().items() if kinds[1] == OccurrenceClass.FAILED != kinds[0]
    )
    return (
        f"{contradicting} of {runs} contradict (quiet against vibrating; {share}95 % interval {low:.2%} to "
        f"{high:.2%}), {int(found.contradicts_beyond.sum())} of them beyond the threshold; "
        f"{others} more of another class" + (f"; {failed} more failed {way}" if failed else "")
    )


def deviations(found: Comparison, who: str = "B deviates") -> Iterator[str]:
    """Yield how far amplitude, frequency and what else is compared deviate; `who` is subject and verb."""
    both = int((found.pairs == OccurrenceClass.VIBRATING).sum())
    where = {name: f"{name} where both vibrate ({both} cells)" for name in ("amplitude", "frequency")}
    where |= {name: f"{name} where both have ended" for name in found.quantities}
    for name, text in where.items():
        deviation = found.deviation(name)
        if math.isnan(deviation.median):
            continue
        most = ""
        if name in found.quantities:
            unit = found.quantities[name]
            most = f"; at most {found.largest_difference(name):.3g} {'' if unit == '1' else unit}".rstrip()
        yield (
            f"{text}: {who} by {deviation.median:.2%} (median), {deviation.high:.2%} (95 %), "
            f"{deviation.largest:.2%} (largest){most}"
        )


def sample_sentences(dataset: xr.Dataset, folder: Path, source: str) -> Iterator[str]:
    """Yield what the samples in the folder of a study tell: checks of the time step, and the audit.

    Parameters
    ----------
    dataset : Dataset
        Results of the study.
    folder : Path
        Its folder, in which `--check-step` and `--audit` leave their runs.
    source : str
        Where the results are from, for errors.

    Raises
    ------
    InputError
        If a sample cannot be read, or has nothing in common with the study.
    """
    for way, name in _SAMPLES:
        if not (folder / name / "results.nc").is_file():
            continue
        with open_results(folder / name) as again:
            found = compare(dataset, again, (source, str(folder / name)))
        repeated = int(np.sum(found.cells["class_b"] != OccurrenceClass.NOT_RUN))
        runs = "1 run was" if repeated == 1 else f"{repeated} runs were"
        yield f"{runs} done again {way}, in `{name}`: {contradictions(found, way)}."
        yield from (
            f"{line[:1].upper()}{line[1:]}." for line in deviations(found, "those done again deviate")
        )
