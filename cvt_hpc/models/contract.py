"""The modules of a job's model that make its runs and say what is recorded of them.

The `record` module of a model offers VARIABLES, `coordinates(parameters)`, `cost(parameters, stepper)`,
`lanes(parameters, stepper)` and `lane_key(parameters)`; and

- of a model with a transient, `judge(run)`: the values of VARIABLES and the verdict (status, vibrates,
  reason) of a run that its `transient` module has made and that has come to its end, or ended before with
  a result, its `failure` then having the status done;
- of a model without, which takes no stepper, `solve(parameters)`, whose result `judge(solution)` reads. It
  may leave out what is not known, such as all but status and reason where nothing was found.

A model with a transient may answer some runs without all of it. Its record module then also has

- `known(parameters)`: the values where no transient is needed, else None;
- `preliminary(parameters)`: the parameters of a cheaper transient that comes first, or None;
- `settle(run)`: the values of a run by that transient if it answers, else None.

Its `judge` reads the full transient as ever. The `transient` module of any model offers `batch(points,
stepper, paused=())`: runs that advance together, each from its start or from where a shorter one has ended.

A model whose runs cannot be shortened for a forecast says so by PILOT_SHARE.

`histories(run)`, or of a solution, is the dataset of what `simulate` has beyond the record, where there is
such.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Protocol

from cvt_hpc.errors import InputError
from cvt_hpc.models import MODELS


class Named(Protocol):
    """What a job says of its model: which, and in which file."""

    model: str
    source: str


def transient_module(job: Named) -> ModuleType:
    """Of its runs; InputError where nothing is recorded of them."""
    _check_recorded(job)
    return import_module(MODELS[job.model] + ".transient")


def record_module(job: Named) -> ModuleType:
    """Of what is recorded of its runs; InputError where nothing is."""
    _check_recorded(job)
    return import_module(MODELS[job.model] + ".record")


def _check_recorded(job: Named) -> None:
    if not has_record(job):
        known = ", ".join(model for model in MODELS if _is_recorded(model))
        raise InputError(
            f"{job.source}: model: expected one whose runs are judged and recorded ({known}), "
            f"found {job.model}, which is there to compare steppers: `cvt-hpc chart`"
        )


def has_record(job: Named) -> bool:
    """Whether runs of the job's model are judged and recorded."""
    return _is_recorded(job.model)


def _is_recorded(model: str) -> bool:
    return find_spec(MODELS[model] + ".record") is not None
