"""The output folder of a bifurcation diagram: whose it is."""

from __future__ import annotations

import json
from math import prod
from pathlib import Path

import numpy as np
import xarray as xr

from cvt_hpc.bifurcation.dataset import Stability
from cvt_hpc.bifurcation.job import Diagram
from cvt_hpc.errors import mismatch
from cvt_hpc.files import naming_refusals
from cvt_hpc.history_files import DIAGRAM, holds
from cvt_hpc.study.job_difference import another_job

DATASET = "branch.nc"
LABELS = ("name", "description")  # of a job, without effect on any number


def picture_names(branches: int) -> list[str]:
    """Names of the pictures of so many branches."""
    return [f"branch_{number}.png" for number in range(1, branches + 1)] if branches > 1 else ["branch.png"]


def claim_folder(diagram: Diagram, out: Path, fresh: bool) -> int:
    """See that the folder is that of a diagram, or free.

    Parameters
    ----------
    diagram : Diagram
        What is to be made in it.
    out : Path
        The folder; it need not exist.
    fresh : bool
        Throw away what another diagram, or an earlier start, has left.

    Returns
    -------
    int
        Number of branches that its dataset holds.

    Raises
    ------
    InputError
        If it holds a file that is no diagram, or without `fresh` that of another job.
    """
    path = out / DATASET
    if not path.exists():
        return 0
    if not holds(path, DIAGRAM):
        raise mismatch(str(path), "a new file, or a bifurcation diagram of cvt_hpc", "another file")
    with xr.open_dataset(path, engine="netcdf4", decode_cf=False) as dataset:
        found = json.loads(dataset.attrs["job"])
        computed = (dataset["stability"] != Stability.NOT_COMPUTED).all("load")
        held = int(np.count_nonzero(computed))
    if fresh:
        branches = prod(len(values) for name, values in found["axes"].items() if name != "load")
        with naming_refusals(out, "a folder in which files can be removed"):
            for name in (*picture_names(branches), DATASET):
                (out / name).unlink(missing_ok=True)
        return 0
    there, here = (
        {key: value for key, value in job.items() if key not in LABELS} for job in (found, diagram.resolved())
    )
    if there != here:
        raise another_job(out, there, here)
    return held
