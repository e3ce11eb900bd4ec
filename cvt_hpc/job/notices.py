"""Messages about values whose meaning another key decides, if nothing names that key."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from cvt_hpc.errors import JobWarning
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.definition import Derived, Job


def warn_of_notices(job: Job, beside: Mapping[str, Sequence[Any]] | None = None) -> None:
    """Warn by the notices that parameters declare.

    Parameters
    ----------
    job : Job
        The job whose base scene, axes and rules are checked.
    beside : mapping, optional
        Values [SI] by key that a run or a range has beside those of the job. Then these are checked, for
        keys of which the job itself has drawn no warning.
    """
    varied: dict[str, Axis | Derived] = {axis.name: axis for axis in job.axes}
    varied |= {derived.name: derived for derived in job.derived}
    schema, named = job.schema, {*job.given, *varied, *(beside or {})}
    for key, parameter in schema.parameters.items():
        notice = parameter.notice
        if notice is None or key not in job.parameters or notice.settled_by in named:
            continue
        values = varied[key].values if key in varied else (job.parameters[key],)
        if beside is not None:
            is_told = any(value != parameter.default for value in values)
            values = () if is_told else tuple(beside.get(key, ()))
        if any(value != parameter.default for value in values):
            text = f"{job.source}: [{schema.section_of[key]}] {key} {notice.text}"
            warnings.warn(text, JobWarning, stacklevel=3)
