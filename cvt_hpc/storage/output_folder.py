"""An output folder: its content, the process at work in it, and the files that may be removed from it.

A study, a chart and a bifurcation diagram may share one, each with a job file against which all else is
checked. The folder may be damaged, or another user's: a checksum shows damage of the job file, and nothing
is written or removed outside.
"""

import errno
import hashlib
import json
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from cvt_hpc.errors import HeldError, InputError, mismatch
from cvt_hpc.storage import files
from cvt_hpc.storage.locks import is_locked, locked

CHECKSUM = "checksum"  # key of the job file
_LIMIT = 1 << 29  # [bytes] of a job file; 10^6 samples of ten parameters are 400 MB

_logger = logging.getLogger(__name__)

Content = TypeVar("Content", bound=Any)  # a job, or what describes it: with `fingerprint` and `resolved`


class DamagedJobError(InputError):
    """The job file of an output folder is damaged; other files beside it may identify the content.

    Attributes
    ----------
    entry : dict
        The entries that could be read.
    """

    def __init__(self, text: str, entry: dict[str, Any] | None = None) -> None:
        super().__init__(text)
        self.entry = entry or {}


class Kind(NamedTuple):
    """The properties of one kind of output folder."""

    what: str  # its content, in words for people
    # job_file, lock_file: names of these files
    job_file: str
    lock_file: str
    format: str  # first entry of the job file
    folders: tuple[str, ...] = ()  # names of the folders in it


class OutputFolder(ABC, Generic[Content]):
    """An output folder of some kind.

    Parameters
    ----------
    path : str or Path
        The folder; it need not exist.
    """

    kind: ClassVar[Kind]

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.job_file = self.path / self.kind.job_file
        self.lock_file = self.path / self.kind.lock_file

    def document(self, content: Content) -> dict[str, Any]:
        """Return the job file of a content as JSON types, its fingerprint among them."""
        return {"fingerprint": content.fingerprint(), "job": content.resolved()}

    def accept(self, entry: dict[str, Any]) -> Any:
        """Return the content of a sound job file, in the form in which `refuse_other` takes it.

        Raises
        ------
        ValueError, TypeError, KeyError
            If another version has written it, names in it lead out of the folder, or it is too large.
        """
        return entry

    @abstractmethod
    def refuse_other(self, found: Any, asked: Content) -> None:
        """Raise InputError unless the content that was found is the requested one."""

    def agrees(self, found: Any, asked: Content) -> bool:
        """Return whether a content that was found, and is not refused, agrees in all else."""
        return True

    @abstractmethod
    def unexplained(self) -> str | None:
        """Return, in words, files that only a job file explains; None if there are none."""

    @abstractmethod
    def results_tell(self) -> Callable[[Content], bool] | None:
        """Return a function that decides whether the results are of a content; None if there are none."""

    @abstractmethod
    def written(self, found: Any) -> Iterator[Path]:
        """Yield the files that work in this folder has left, according to a sound job file."""

    def read_job(self) -> Any:
        """Return the content of the job file, as of `accept`; None if there is no such file.

        Raises
        ------
        DamagedJobError
            If it cannot be believed.
        InputError
            If it is the file of something else, or cannot be read.
        """
        expected = f"{self.job_file}: expected the job of a {self.kind.what}, found"
        if (kind := files.kind_of(self.job_file)) is None:
            return None
        if kind != "a file":
            raise DamagedJobError(f"{expected} {kind}")
        try:
            data = files.read_regular(self.job_file, _LIMIT)
        except OSError as error:
            if error.errno == errno.EFBIG:
                raise DamagedJobError(f"{expected} {error.strerror}") from error
            raise files.StorageError(f"{expected}: {error.strerror}") from error
        try:
            entry = json.loads(data.decode())
            if not isinstance(entry, dict):
                raise ValueError("it is no table")
        except (ValueError, RecursionError) as error:
            raise DamagedJobError(f"{expected} damage ({error})") from error
        if entry.get("format") != self.kind.format:
            found = entry.get("format")
            quoted = json.dumps(found[:60]) if isinstance(found, str) else "none"
            raise InputError(f'{self.job_file}: expected format "{self.kind.format}", found {quoted}')
        if entry.pop(CHECKSUM, None) != checksum(entry):
            raise DamagedJobError(f"{expected} damage (its content does not fit its checksum)", entry)
        try:
            return self.accept(entry)
        except (KeyError, TypeError, ValueError) as error:  # of another version
            raise DamagedJobError(f"{expected} damage ({error})", entry) from error

    def check_free_for(self, asked: Content, fresh: bool) -> Any:
        """Make sure that the folder may be used for a content; touches nothing.

        Parameters
        ----------
        asked : Content
            The content to be made in it.
        fresh : bool
            Whether earlier results may be thrown away.

        Returns
        -------
        object
            Content of a sound job file, None if there is none.

        Raises
        ------
        InputError
            If the folder is a file or that of something else, holds another job, or results that neither a
            job file nor they themselves explain.
        """
        what = self.kind.what
        with files.naming_refusals(self.path, "a folder that can be read"):
            if not self.path.is_dir():
                if (kind := files.kind_of(self.path)) is not None:
                    raise InputError(f"{self.path}: expected a folder for the results, found {kind}")
                return None
            expected = f"{self.path}: expected an empty folder or that of an earlier {what}, found"
            # In this order: another start writes its job file before any results.
            unexplained = self.unexplained()
            try:
                found = self.read_job()
            except DamagedJobError as error:
                self._ask_results(asked, fresh, str(error), error.entry)
                return None
            if found is None and unexplained is not None:
                self._ask_results(asked, fresh, f"{expected} {unexplained}", {})
            if found is not None and not fresh:
                self.refuse_other(found, asked)
            return found

    @contextmanager
    def claimed(
        self, asked: Content, *, fresh: bool = False, inner: AbstractContextManager | None = None
    ) -> Iterator[None]:
        """Be at work in the folder, which is made if needed, for the time of a `with`.

        Parameters
        ----------
        asked : Content
            The content that is made in it.
        fresh : bool
            Remove files that earlier work has left.
        inner : context manager, optional
            The lock of a part: the folder's own lock is shared then with other parts.

        Raises
        ------
        InputError
            As of `check_free_for`, if another process is at work here, or the system refuses.
        """
        self.check_free_for(asked, fresh)
        self.create(fresh)
        with locked(self.lock_file, shared=inner is not None), inner or nullcontext():
            found = self.check_free_for(asked, fresh)  # again: another may have been there before the lock
            if fresh:
                self.clear(found)
                found = None
            self.save(asked)
            yield

    def create(self, fresh: bool = False) -> None:
        """Make the folder and its subfolders, and test that files can be written there.

        Parameters
        ----------
        fresh : bool
            Remove links and pipes in their place, or in that of a lock; folders and files stay.

        Raises
        ------
        InputError
            If the system refuses.
        """
        with files.naming_refusals(self.path, "a folder that results can be written to"):
            self.path.mkdir(parents=True, exist_ok=True)
            folders = [self.path / name for name in self.kind.folders]
            for place in folders:
                _make_way(place, ("a folder", "a file"), fresh)
                files.make_own_folder(place)
            for place in self.locks():
                _make_way(place, ("a file",), fresh)
            files.try_to_write((folders or [self.path])[0])

    def locks(self) -> list[Path]:
        """Return the lock files that are, or may be, in the folder."""
        return [self.lock_file]

    def is_in_use(self) -> bool:
        """Return whether a process is at work in the folder."""
        return any(map(is_locked, self.locks()))

    def save(self, asked: Content) -> None:
        """Write the job file, unless a sound one that agrees exists."""
        try:
            found = self.read_job()
        except DamagedJobError:
            found = None
        if found is not None:
            if self.agrees(found, asked):
                return
            self.replace(found, asked)
        elif self.results_tell() is not None:
            told = "%s: damaged or gone; written anew, since the results are of this job"
            _logger.warning(told, self.job_file)
        self.write_job(self.job_file, asked)

    def write_job(self, path: Path, content: Content) -> None:
        """Write the job file of a content, with its checksum; StorageError if the system refuses."""
        entry = {"format": self.kind.format, **self.document(content)}
        text = json.dumps({**entry, CHECKSUM: checksum(entry)}, indent=1, allow_nan=False)
        with files.written_aside(path) as aside:
            aside.write_text(text)

    def replace(self, found: Any, asked: Content) -> None:
        """Prepare for a job file in the place of one that is not refused, but does not agree."""
        _logger.warning("%s: does not fit its job; written anew", self.job_file)

    def clear(self, found: Any) -> None:
        """Remove the files that work in the folder has left, and last the job file.

        Parameters
        ----------
        found : object
            Content of a sound job file.
        """
        with files.naming_refusals(self.path, "a folder that results can be removed from"):
            for path in [*self.written(found), *self.leftovers(), self.job_file]:
                files.remove_own(path)

    def leftovers(self) -> list[Path]:
        """Return the half-written files of processes that died while they wrote."""
        return [*self.path.glob(f".{self.job_file.name}.*.part")]

    def _ask_results(self, asked: Content, fresh: bool, complaint: str, entry: dict[str, Any]) -> None:
        """Raise the complaint unless results make up for the job file: they are to go, or are of this job."""
        tell = self.results_tell()
        is_own = isinstance(entry.get("fingerprint"), str)  # a job file of this program, if not as it was
        if is_own and (fresh or entry["fingerprint"] == self.document(asked)["fingerprint"]):
            return
        if tell is not None and (fresh or tell(asked)):
            return
        advice = ", or --fresh to throw away its results, which are of another job" if is_own or tell else ""
        raise HeldError(complaint, f"choose another --out{advice}")


def checksum(entry: dict[str, Any]) -> str:
    """Return the SHA-256 [hex] of a document in JSON types; the order of keys counts."""
    return hashlib.sha256(json.dumps(entry).encode()).hexdigest()


def _make_way(path: Path, kinds: tuple[str, ...], fresh: bool) -> None:
    """Remove files that are none of these kinds if results may be removed, or else raise InputError."""
    found = files.kind_of(path)
    if found is None or found in kinds:
        return
    if not fresh:
        raise mismatch(str(path), kinds[0], found, "remove it, or --fresh with all results")
    files.remove_own(path)
