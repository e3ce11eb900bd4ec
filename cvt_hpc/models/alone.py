"""A run of a stepper or model without lanes, in the form of a batch of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cvt_hpc.variables import Status


def lanes(parameters: Mapping[str, Any], stepper: str | None) -> int:
    """Most runs that a batch can take, whatever its parameters and its stepper."""
    return 1


def lane_key(parameters: Mapping[str, Any]) -> tuple:
    """What runs in one batch have in common: nothing, where none has company."""
    return ()


class Alone:
    """A batch of one run.

    Parameters
    ----------
    run : Transient
        Of any model; what is not said here is asked of it.

    Attributes
    ----------
    samples : int
        Samples of the whole run.
    interval : float
        Sampling interval [s].
    failure : (Status, str) or None
        What has gone wrong, where the run cannot go on.
    """

    def __init__(self, run: Any) -> None:
        self.run = run
        self.samples, self.interval = run.samples, run.interval
        self.failure: tuple[Status, str] | None = None

    @property
    def runs(self) -> tuple[Alone]:
        """The run, which has a failure as those of batches do."""
        return (self,)

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self.failure is None and self.run.done < self.samples

    def advance(self, samples: int) -> None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most.
        """
        self.failure = self.run.advance(samples)

    def paused(self) -> Any:
        """What a batch of the same point over a longer time goes on from: the run itself."""
        return self.run

    def __getattr__(self, name: str) -> Any:
        return getattr(self.run, name)


def batch_of_one(
    run: Callable[[Mapping[str, Any], str], Any],
    points: Sequence[Mapping[str, Any]],
    stepper: str,
    paused: Sequence[Any] = (),
) -> Alone:
    """One run in the form of a batch.

    Parameters
    ----------
    run : type
        The model's Transient.
    points : sequence of mapping
        Resolved parameters of the one run [SI].
    stepper : str
        One of the model's STEPPER_NAMES.
    paused : sequence, optional
        A shorter run at its end, as `Alone.paused` returns it: it goes on.
    """
    (parameters,) = points
    if not paused:
        return Alone(run(parameters, stepper))
    (shorter,) = paused
    shorter.prolong(parameters)
    return Alone(shorter)
