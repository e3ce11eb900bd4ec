"""Messages about values whose meaning another key decides, if nothing names that key, or that it disables."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from cvt_hpc.errors import JobWarning, NoEffectWarning, mismatch, show
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.definition import Derived, Job
from cvt_hpc.job.schema import Schema


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


def tell_of_no_effect(
    schema: Schema,
    values: Mapping[str, Any],
    files: Mapping[str, str],
    without: Mapping[str, str],
    source: str,
) -> None:
    """Refuse files and lists without effect on any run, and warn of other values, unless they are defaults.

    Parameters
    ----------
    schema : Schema
        Of the job.
    values : mapping
        Value [SI] by key.
    files : mapping
        By key the name of each file that the job gives.
    without : mapping
        Given keys without effect, each with the setting that makes it so.
    source : str
        The job file.

    Raises
    ------
    InputError
        With the first file or list without effect.
    """
    of_files = {one: key for key in files if (file := schema.parameters[key].file) for one in file.gives}
    told = []
    for key, setting in without.items():
        value, shown = values[key], of_files.get(key, key)
        if value == schema.parameters[key].default:
            continue
        if isinstance(value, tuple):
            found, nothing = (files[shown], '""') if shown in files else (value, "[]")
            where = f"{source}: [{schema.section_of[key]}] {shown}"
            expected, then = (
                f"nothing, as it has no effect with {setting}",
                f"delete it, or set {shown} = {nothing}",
            )
            raise mismatch(where, expected, show(found), then)
        told.append(f"{key} (with {setting})")
    if told:
        warnings.warn(
            f"{source}: without effect on all runs: {', '.join(told)}", NoEffectWarning, stacklevel=4
        )
