"""Kinds of the Hopf points of a branch, by the runs beside them."""

from collections.abc import Callable
from functools import partial

import numpy as np

from cvt_hpc.archives import Arrays
from cvt_hpc.bifurcation.attractors import Attractor
from cvt_hpc.bifurcation.followed import Followed
from cvt_hpc.bifurcation.job import Asked, Diagram
from cvt_hpc.bifurcation.table import load_text
from cvt_hpc.models.linear_stability.branch import CLOSE, Onset
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Criticality, Kind, criticality

# [N m]: how far runs from near the steady state may turn quiet from the Hopf point. They do so up to 5.3 N m
# off, since linear rates hold below 1 nm alone (README of linear_stability), and windows are 15 N m wide or
# more. On jobs/branch.toml 2.5 and 10 N m give the same verdicts
AGREEMENT = 5.0
# of the lowest frequency that is judged: vibrations that a mode below the band begins may lie in it, as those
# of 583 Hz beside a mode of 277. On jobs/branch.toml a third gives the same verdicts, since beside slow modes
# (185 Hz and less) no run begins to vibrate; at four thirds modes of 277-346 Hz are left undecided
SEEN = 2.0 / 3.0


def lowest_judged(asked: Asked) -> float:
    """Lowest frequency of a mode that the runs of a branch are judged by [Hz]."""
    return SEEN * float(asked.parameters["band_low"])


def with_kinds(
    diagram: Diagram,
    asked: Asked,
    states: Arrays,
    hopf: list[Onset],
    hidden: list[tuple[float, float]],
    runs: list[Attractor],
) -> Followed:
    """A branch with the kinds of its Hopf points, super- or subcritical, with loads in the unit of the job.

    Parameters
    ----------
    diagram, asked : Diagram, Asked
        The diagram, and the branch of it.
    states : dict of array
        As of `states_of`.
    hopf, hidden, runs
        As `judged` takes them.
    """
    lowest, in_words = lowest_judged(asked), partial(load_text, diagram)
    kinds = [judged(onset, hopf, hidden, runs, lowest, in_words) for onset in hopf]
    return Followed(asked, states, hopf, hidden, runs, kinds)


def judged(
    onset: Onset,
    hopf: list[Onset],
    hidden: list[tuple[float, float]],
    runs: list[Attractor],
    lowest: float,
    in_words: Callable[[float], str],
) -> Criticality:
    """Whether a Hopf point is super- or subcritical, if its mode is within the band by which runs are judged.

    Parameters
    ----------
    onset : Onset
        The Hopf point.
    hopf, hidden
        All of the branch, and where stability changes unseen, as `onsets` returns them.
    runs : list of Attractor
        From near the steady state (start 0) and from the large start (1).
    lowest : float
        Lowest frequency of a mode that runs are judged by [Hz].
    in_words : callable
        Turns a load [N m] into words.
    """
    if not runs:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "no runs were asked for")
    if onset.frequency < lowest:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "its mode lies below the band of runs")
    if onset.others:
        return Criticality(Kind.UNDECIDED, np.nan, np.nan, "the steady state is unstable on both sides")
    loads = sorted({run.value for run in runs})
    classes = {(run.start, run.value): int(run.occurrence) for run in runs}
    small, large = ([classes.get((k, load), OccurrenceClass.NOT_RUN) for load in loads] for k in (0, 1))
    # on the stable side the steady state ends to be stable at the next mode, whatever its frequency
    ends = [load for ends in hidden for load in ends if (load < onset.load) == onset.rising]
    for other in hopf:
        if other is not onset and (other.frequency >= lowest or (other.load < onset.load) == onset.rising):
            ends.append(other.load)
    return criticality(
        onset.load,
        not onset.rising,
        loads,
        small,
        large,
        agreement=AGREEMENT,
        bracket=0.5 * CLOSE,
        limits=(
            max((load for load in ends if load <= onset.load), default=-np.inf),
            min((load for load in ends if load > onset.load), default=np.inf),
        ),
        in_words=in_words,
    )
