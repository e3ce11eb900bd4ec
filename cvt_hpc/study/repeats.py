"""A sample of a study's runs, done again another way, to see how far its results depend on the way.

The sample is drawn by the runs' indices: a continued study, or a larger share, continues
with the same sample. Its runs are a study of their own, in a folder of that of the first one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from cvt_hpc.errors import mismatch, show
from cvt_hpc.files import refuse_link
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.simulator import default_simulator
from cvt_hpc.study.status import RunReport
from cvt_hpc.study.sweep import check_start, run

CONFIDENCE = 0.95
AUDIT = "audit"  # folder of the runs of an audit, in that of the study
AUDITED, FULL_MODEL = "auto", "elastic_belt"  # what answers some runs cheaply, and what does all in full


def _of_the_job(records: Records, runs: NDArray[np.intp]) -> Mapping[int, float]:
    return {}


@dataclass(frozen=True)
class Repeat:
    """A sample of the runs of a study, and another way to do them.

    Attributes
    ----------
    label : str
        Its name in messages.
    way : str
        How the runs are done again, in words.
    first : Job
        The runs as they were done.
    out : Path
        Their folder; all of them are done before the sample is drawn.
    folder : str
        Where the repeated runs are kept, in that folder.
    job : Job
        The same runs as they are done again.
    fraction : float
        Share of the eligible runs that is done again; one run at least, if any is eligible.
    eligible : callable
        Returns by the records of the first study the runs that may be drawn, shape (runs,).
    core_seconds : callable
        Returns the expected cost of a repeated run [core-seconds], mean over the job.
    steps : callable
        Returns by these records and the indices of drawn runs the time step [s] of runs that are not to
        take that of `job`, by index.
    """

    label: str
    way: str
    first: Job
    out: Path
    folder: str
    job: Job
    fraction: float
    eligible: Callable[[Records], NDArray[np.bool_]]
    core_seconds: Callable[[], float]
    steps: Callable[[Records, NDArray[np.intp]], Mapping[int, float]] = _of_the_job

    @property
    def place(self) -> Path:
        """The output folder of the repeated runs."""
        return self.out / self.folder

    @cached_property
    def study(self) -> Study:
        """The first study."""
        return describe(self.first, default_simulator())

    @cached_property
    def records(self) -> Records:
        """Records of the first study, as they are at the first access."""
        return StudyFolder(self.out).read_records(self.study)

    @cached_property
    def may_be_drawn(self) -> NDArray[np.bool_]:
        """Which runs of the first study are eligible, shape (runs,)."""
        return self.eligible(self.records)

    @property
    def sample(self) -> NDArray[np.bool_]:
        """Which runs are done again, shape (runs,): each by a lot that is drawn for its index."""
        lots = np.random.default_rng(int(self.study.fingerprint[:16], 16)).random(self.study.size)
        lots = np.where(self.may_be_drawn, lots, np.inf)
        # the lowest lot is in every larger sample as well
        return np.isfinite(lots) & (lots <= max(self.fraction, lots.min()))

    def check(self, fresh: bool) -> None:
        """Raise the InputError that `run` would raise before it computes anything; touches nothing."""
        refuse_link(self.place)
        check_start(self.job, self.place, fresh=fresh)

    def run(self, **options: Any) -> RunReport:
        """Do the runs of the sample again; on all ranks, with the options of `cvt_hpc.study.run`."""
        refuse_link(self.place)
        return run(
            self.job,
            self.place,
            chosen=lambda: self.sample,
            asked_steps=lambda: self.steps(self.records, np.flatnonzero(self.sample)),
            **options,
        )


def check_fraction(flag: str, fraction: float, part: str | None = None) -> None:
    """Raise InputError where a share is none, or where only a part of a study is to be done."""
    if not 0.0 < fraction <= 1.0:
        raise mismatch(flag, "a fraction above 0, at most 1", show(fraction))
    if part is not None:
        raise mismatch(flag, "a run of the whole study, once its parts have ended", f"part {part}")


def built(job: Job, document: dict[str, Any]) -> Job:
    """Return the job of a document of the same runs; of the whole grid where the first one traces it."""
    if "first_spacing" in job.design:
        document = {key: table for key, table in document.items() if key != "design"}
    return rebuild_job(document, job.source, job.units)


def interval(count: int, runs: int) -> tuple[float, float]:
    """Return the ends of the interval that holds a rate with CONFIDENCE (Clopper and Pearson 1934)."""
    outside = 0.5 * (1.0 - CONFIDENCE)
    low = betaincinv(count, runs - count + 1, outside) if count > 0 else 0.0
    high = betaincinv(count + 1, runs - count, 1.0 - outside) if count < runs else 1.0
    return float(low), float(high)
