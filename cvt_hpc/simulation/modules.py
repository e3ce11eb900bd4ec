"""The modules of a job's model that make its runs and say what is recorded of them."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING

from cvt_hpc.errors import InputError
from cvt_hpc.models import MODELS

if TYPE_CHECKING:
    from cvt_hpc.job import Job


def transient_module(job: Job) -> ModuleType:
    """Of its runs; InputError where nothing is recorded of them."""
    _check_recorded(job)
    return import_module(MODELS[job.model] + ".transient")


def record_module(job: Job) -> ModuleType:
    """Of what is recorded of its runs; InputError where nothing is."""
    _check_recorded(job)
    return import_module(MODELS[job.model] + ".record")


def _check_recorded(job: Job) -> None:
    if not has_record(job):
        raise InputError(
            f"{job.source}: model: expected one whose runs are judged and recorded (elastic_belt), "
            f"found {job.model}, which is there to compare steppers: `cvt-hpc chart`"
        )


def has_record(job: Job) -> bool:
    """Whether runs of the job's model are judged and recorded."""
    return find_spec(MODELS[job.model] + ".record") is not None
