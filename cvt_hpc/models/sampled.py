"""A run that a kernel of the model's own marches from sample to sample, and its record so far."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cvt_hpc.models.marched import Probe
from cvt_hpc.recording import sample_count, start_up_samples
from cvt_hpc.variables import Status

MOST_UNSOLVED = 0.02  # of the steps
_LATEST = 0.01  # [s] before a run ends early in which its steps have to be solved, too


class SampledRun:
    """One run, advanced sample by sample.

    A model's run prepares its march, gives its record by `_record`, and fills `_rows`, `_totals` and
    `_sums`. The first three counters of its state are steps, iterations, and steps that were not solved.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI], those of the stepper among them.

    Attributes
    ----------
    parameters
        As given.
    channels : tuple of str
        Names of the histories beside displacement.
    probes : tuple of Probe
        On the strands, equally spaced between their ends.
    interval : float
        Sampling interval [s].
    samples, done, risen : int
        Samples of the whole run, those recorded so far, and those before the load has risen.
    first_judged : int
        The sample at which the judged part begins.
    failure : (Status, str) or None
        Why the run cannot continue: the failure, or that the belt slips through, with the status done.
    """

    _state: Any  # the marched state, with `counters`

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self.interval = 1.0 / parameters["sampling_rate"]
        steps = np.ceil(self.interval / parameters["step"] * (1.0 - 1e-9))
        self._steps_per_sample = max(1, int(steps))
        self.parameters, self.done = parameters, 0
        self.failure: tuple[Status, str] | None = None

    def _record(
        self,
        channels: Sequence[str],
        strands: Sequence[str],
        positions: np.ndarray,
        totals: int,
        sums: tuple[int, int],
    ) -> None:
        """Record channels, displacement at path coordinates (strand, probe) [m], totals and sums."""
        self.channels = tuple(channels)
        self.probes = tuple(
            Probe(f"{strand} {k + 1}", float(position))
            for strand, along in zip(strands, positions, strict=True)
            for k, position in enumerate(along)
        )
        self._rows = np.empty((0, len(self.probes) + len(channels)))
        self._totals = np.empty((0, totals))
        self._unsolved = np.empty(0, int)
        self._sums = np.zeros(sums)
        self.prolong(self.parameters)

    def prolong(self, parameters: Mapping[str, Any]) -> None:
        """Make room for the samples of a longer duration.

        Parameters
        ----------
        parameters : mapping
            Parameters of the run but for `duration` and `judged_fraction`.
        """
        self.parameters = parameters
        self.samples, self.risen = sample_count(parameters), start_up_samples(parameters)
        self.first_judged = self.samples - round(parameters["judged_fraction"] * self.samples)
        more = self.samples - len(self._rows)
        self._rows = np.concatenate([self._rows, np.full((more, self._rows.shape[1]), np.nan)])
        self._totals = np.concatenate([self._totals, np.full((more, self._totals.shape[1]), np.nan)])
        self._unsolved = np.concatenate([self._unsolved, np.zeros(more, int)])
        self._sums = np.zeros_like(self._sums)

    def _keep(self, row: Sequence[float], totals: Sequence[float]) -> None:
        """Record a sample."""
        self._rows[self.done], self._totals[self.done] = row, totals
        self._unsolved[self.done] = self.counters()["unsolved"]
        self.done += 1

    def _recorded(self) -> tuple[np.ndarray, ...]:
        """Views of the samples so far."""
        return self._rows[: self.done], self._totals[: self.done], self._unsolved[: self.done]

    def _early_end(self, why: str) -> tuple[Status, str]:
        """Status of a run that ends early: done, unless its steps were not solved."""
        late = round(_LATEST / self.interval)
        before = self._unsolved[self.done - 1 - late] if self.done > late else 0
        steps = min(late, self.done) * self._steps_per_sample
        share = max(self.unsolved_share, (self.counters()["unsolved"] - before) / steps)
        if share > MOST_UNSOLVED:
            return Status.FAILED_NUMERICS, f"{share:.1%} of the steps were not solved, and then {why}"
        return Status.DONE, why

    @property
    def step(self) -> float:
        """Time step [s]."""
        return self.interval / self._steps_per_sample

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return int(self._state.counters[0])

    @property
    def contact_solves(self) -> int:
        """Solves of the contact problem so far: iterations."""
        return int(self._state.counters[1])

    def counters(self) -> dict[str, int]:
        """Work done so far: steps, iterations, and steps that were not solved to the tolerance."""
        names = ("steps", "iterations", "unsolved")
        return dict(zip(names, self._state.counters[: len(names)].tolist(), strict=True))

    @property
    def unsolved_share(self) -> float:
        """Share of the steps so far that were not solved to the tolerance [1]."""
        work = self.counters()
        return work["unsolved"] / max(work["steps"], 1)

    @property
    def iterations(self) -> float:
        """Iterations of a step, mean."""
        return self.contact_solves / max(self.steps, 1)

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, outwards, (done, probe) [m]."""
        return self._rows[: self.done, : len(self.probes)]

    def channel(self, name: str) -> np.ndarray:
        """History of one of `channels`, (done,)."""
        return self._rows[: self.done, len(self.probes) + self.channels.index(name)]

    def mean_driving_speed(self, samples: slice) -> float:
        """Mean speed of the driving pulley in some samples [rad/s]."""
        return float(self.channel("driving_speed")[samples].mean())

    @property
    def judged(self) -> slice:
        """Samples of the judged part."""
        return slice(self.first_judged, self.samples)

    def paused(self) -> Any:
        """The state from which a batch of the same point over a longer time continues: the run itself."""
        return self
