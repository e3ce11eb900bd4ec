"""The output folder of a bifurcation diagram: its files, and the origin of its dataset."""

import json
import logging
import re
from collections.abc import Callable, Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.archives import Archives, Arrays
from cvt_hpc.bifurcation.attractors import Attractor, Followed, Stability
from cvt_hpc.bifurcation.job import Diagram, fingerprint_of, numbers_of
from cvt_hpc.bifurcation.table import with_kinds
from cvt_hpc.files import kind_of
from cvt_hpc.models.linear_stability.branch import Onset
from cvt_hpc.netcdf import DIAGRAM, holds, open_netcdf
from cvt_hpc.output_folder import Kind, OutputFolder
from cvt_hpc.study.job_difference import another_job

DATASET = "branch.nc"
_PICTURE = re.compile(r"branch(?:_([1-9]\d{0,8}))?\.png", re.ASCII)
_LIMIT = 1 << 26  # [bytes] of a branch; one of 20 loads has some 10 kB
_DAMAGE = (AttributeError, KeyError, OSError, RecursionError, RuntimeError, TypeError, ValueError)
_logger = logging.getLogger(__name__)


def picture_names(branches: int) -> list[str]:
    """Names of the pictures of so many branches."""
    return [f"branch_{number}.png" for number in range(1, branches + 1)] if branches > 1 else ["branch.png"]


class DiagramFolder(OutputFolder[Diagram]):
    """The output folder of a bifurcation diagram, which may lie beside a study.

    Parameters
    ----------
    path : Path
        The folder; it need not exist.
    diagram : Diagram
        The diagram that is to be made in it.

    Attributes
    ----------
    branches : Archives
        Finished branches, by their number in the names of pictures.
    """

    kind = Kind("bifurcation diagram", "branch.json", ".branch.lock", "cvt_hpc bifurcation 1", ("branches",))

    def __init__(self, path: Path, diagram: Diagram) -> None:
        super().__init__(path)
        self.dataset = self.path / DATASET
        self.branches = Archives(self.path / "branches", diagram.fingerprint(), _LIMIT)
        self._diagram = diagram

    def load_branch(self, number: int) -> Followed | None:
        """Return branch `number`, counted from 0; None if it is not done, or cannot be read."""

        def restored(plain: Any, states: Arrays) -> Followed:
            if plain is None:
                raise ValueError("of an earlier version")
            onsets, runs = (
                [Onset(*one) for one in plain["onsets"]],
                [Attractor(*run) for run in plain["runs"]],
            )
            asked = self._diagram.branches[number]
            return with_kinds(self._diagram, asked, states, onsets, plain["hidden"], runs)

        return self.branches.load(f"branch_{number + 1}", restored)

    def save_branch(self, number: int, followed: Followed) -> None:
        """Keep branch `number`."""
        plain = {"onsets": followed.onsets, "hidden": followed.hidden, "runs": followed.runs}
        self.branches.save(f"branch_{number + 1}", plain, followed.states)

    def stored_branches(self) -> int:
        """Return how many branches the dataset holds, 0 where none can be read."""
        if kind_of(self.dataset) is None:
            return 0
        try:
            with open_netcdf(self._stored(), decode_cf=False) as dataset:
                computed = (dataset["stability"] != Stability.NOT_COMPUTED).all("load")
                return int(np.count_nonzero(computed))
        except _DAMAGE as error:
            _logger.warning("%s: damaged (%s); made again", self.dataset, error)
            return 0

    def refuse_other(self, found: dict[str, Any], asked: Diagram) -> None:
        """Raise InputError unless the folder is that of the diagram."""
        if found["fingerprint"] != asked.fingerprint():
            raise another_job(self.path, numbers_of(found["job"]), numbers_of(asked.resolved()))

    def unexplained(self) -> str | None:
        """Return files that neither a branch.json nor a dataset explains."""
        if kind_of(self.dataset):
            return f"{DATASET} without a {self.job_file.name}"
        return f"branches without a {self.job_file.name}" if self.branches.written() else None

    def results_tell(self) -> Callable[[Diagram], bool] | None:
        """Return a function that decides whether dataset and branches are of a diagram; None without these.

        None, too, if the dataset is something else, which is not to be written over.
        """
        stored, fingerprints = self._job_of_dataset(), self.branches.fingerprints()
        if stored is not None:
            fingerprints.add(fingerprint_of(stored))
        elif kind_of(self.dataset) is not None:
            return None
        return (lambda diagram: fingerprints == {diagram.fingerprint()}) if fingerprints else None

    def written(self, found: dict[str, Any] | None) -> Iterator[Path]:
        """Yield the files of a diagram: branches, dataset, and pictures of as many branches as it has."""
        axes = found["job"]["axes"] if found else {}
        branches = prod(len(values) for name, values in axes.items() if name != "load")
        yield from (*self.branches.written(), self.dataset)
        for path in self.path.iterdir():
            if (name := _PICTURE.fullmatch(path.name)) and int(name[1] or 1) <= branches:
                yield path

    def leftovers(self) -> list[Path]:
        """Return the half-written files of processes that died while they wrote."""
        return [*self.path.glob(f".{DATASET}.*.part"), *super().leftovers()]

    def _stored(self) -> Path:
        """Return the dataset; ValueError if it is no diagram."""
        if not holds(self.dataset, DIAGRAM):
            raise ValueError("no bifurcation diagram")
        return self.dataset

    def _job_of_dataset(self) -> dict[str, Any] | None:
        """Return the job of the dataset; None where there is none, or another dataset."""
        try:
            with open_netcdf(self._stored(), decode_cf=False) as dataset:
                return dict(json.loads(dataset.attrs["job"]))
        except _DAMAGE:
            return None
