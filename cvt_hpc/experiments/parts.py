"""The output folder of an experiment whose parts are done one by one, and each kept once it is done."""

from abc import abstractmethod
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from cvt_hpc.storage.archives import Archives
from cvt_hpc.storage.output_folder import Content, OutputFolder
from cvt_hpc.study.job_difference import another_job

_LIMIT = 1 << 26  # [bytes] of a part; a branch of 20 loads has some 10 kB
_WITHOUT_EFFECT = ("name", "description")  # on any number

Entry = dict[str, Any]  # of a job file


class PartsFolder(OutputFolder[Content]):
    """The output folder of an experiment with parts; a study or another experiment may share it.

    `parts` are the finished ones, in the first of the kind's folders; `dataset` and `table` are files of the
    results, named as the job file is.
    """

    def __init__(self, path: Path, asked: Content) -> None:
        super().__init__(path)
        self.parts = Archives(path / self.kind.folders[0], asked.fingerprint(), _LIMIT)
        self.dataset, self.table = (self.job_file.with_suffix(suffix) for suffix in (".nc", ".csv"))
        self._asked = asked

    @abstractmethod
    def is_picture(self, name: str, job: Entry) -> bool:
        """Return whether a file of this name is a picture of a job."""

    def accept(self, entry: Entry) -> Entry:
        """Return the content of a sound job file."""
        self.is_picture("", entry["job"])  # KeyError or TypeError where there is no such job
        return entry

    def refuse_other(self, found: Entry, asked: Content) -> None:
        """Raise InputError unless the folder is that of the content."""
        if found["fingerprint"] != asked.fingerprint():
            raise another_job(self.path, numbers_of(found["job"]), numbers_of(asked.resolved()))

    def unexplained(self) -> str | None:
        """Return a file that only a job file explains, in words."""
        own = [*self._files(self._asked.resolved()), *([self.parts.folder] if self.parts.written() else [])]
        names = sorted((path.suffix == ".png", path.name) for path in own)  # pictures last
        return f"{names[0][1]} without a {self.job_file.name}" if names else None

    def results_tell(self) -> Callable[[Content], bool] | None:
        """Return a function that decides whether the parts are of a content; None if there are none."""
        fingerprints = self.parts.fingerprints()
        return (lambda asked: fingerprints == {asked.fingerprint()}) if fingerprints else None

    def written(self, found: Entry | None) -> Iterator[Path]:
        """Yield the files of a content: parts, table, dataset and pictures."""
        yield from (*self.parts.written(), *self._files(found["job"] if found else self._asked.resolved()))

    def leftovers(self) -> list[Path]:
        """Return the half-written files of processes that died while they wrote."""
        return [*self.path.glob(f".{self.dataset.name}.*.part"), *super().leftovers()]

    def _files(self, job: Entry) -> list[Path]:
        results = self.dataset, self.table
        return [path for path in self.path.iterdir() if path in results or self.is_picture(path.name, job)]


def numbers_of(job: Entry) -> Entry:
    """Return a resolved job without the entries that have no effect on any number."""
    return {key: value for key, value in job.items() if key not in _WITHOUT_EFFECT}
