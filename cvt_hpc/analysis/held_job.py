"""The job that a dataset of results keeps in its attributes."""

import json
from dataclasses import replace
from typing import Any

import xarray as xr

from cvt_hpc.errors import InputError, one_line
from cvt_hpc.job import Job, stored_job
from cvt_hpc.job.units import factor_to
from cvt_hpc.job.values import JOB_FILES, JOB_UNITS


def job_of(dataset: xr.Dataset) -> dict[str, Any]:
    """The resolved job that a dataset keeps in its attributes; empty where it keeps none."""
    return json.loads(dataset.attrs.get("job", "{}"))


def job_held(dataset: xr.Dataset, source: str = "results") -> Job | None:
    """The job of a dataset, with its units and files; None where this version cannot read it any more."""
    try:
        job = stored_job(job_of(dataset), source)
        units = json.loads(dataset.attrs.get(JOB_UNITS, "{}"))
        known = job.schema.parameters
        legal = {k: u for k, u in units.items() if k in known and factor_to(str(u), known[k].unit)}
        files = json.loads(dataset.attrs.get(JOB_FILES, "{}"))
        return replace(job, units=legal, files={k: one_line(name) for k, name in files.items() if k in known})
    except (AttributeError, InputError, TypeError, ValueError, RecursionError):
        return None
