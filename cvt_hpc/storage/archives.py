"""Parts of a long work that are done, each kept in an archive of its own until all are.

An archive holds arrays, and a head in JSON types: the job of the part, its origin, and all values that are
no arrays. Nothing in it is executed, and unreadable content is damage: its entries have checksums.
"""

import io
import json
import logging
import struct
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cvt_hpc.storage.files import StorageError, kind_of, read_regular, written_aside
from cvt_hpc.storage.provenance import git_revision, machine, versions

_SUFFIX = ".npz"
# the exception from an archive depends on the damaged byte
_DAMAGE = (
    *(ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RuntimeError),
    *(struct.error, SyntaxError, TypeError, ValueError, zipfile.BadZipFile, zlib.error),
)
_logger = logging.getLogger(__name__)

Arrays = dict[str, np.ndarray]
Part = TypeVar("Part")


class Archives:
    """The archives of one job.

    Parameters
    ----------
    folder : Path
        Where they lie; nothing else does.
    fingerprint : str
        Of the job.
    limit : int
        Of an archive, and of its unpacked content [bytes].

    Attributes
    ----------
    makers : list of dict
        Versions, revision and machine by which the parts that were loaded or saved have been computed.
    """

    def __init__(self, folder: Path, fingerprint: str, limit: int) -> None:
        self.folder = folder
        self.makers: list[dict[str, Any]] = []
        self._fingerprint, self._limit = fingerprint, limit
        self._maker = {"versions": versions(), "git_revision": git_revision(), "machine": machine()}

    def warn_of_others(self, dataset: Path) -> None:
        """Warn if some parts were made by another program or machine than this; the dataset names both."""
        if any(maker != self._maker for maker in self.makers):
            _logger.warning(
                "%s: earlier %s were made with other versions or on another machine (%s names them in its "
                "attributes `versions`, `git_revision` and `machine`); --fresh repeats them",
                dataset.parent,
                self.folder.name,
                dataset.name,
            )

    def written(self) -> list[Path]:
        """Return the archives, half-written ones, too; none where a link stands in their folder's place."""
        if kind_of(self.folder) != "a folder":
            return []
        return [*self.folder.glob(f"*{_SUFFIX}"), *self.folder.glob(f".*{_SUFFIX}.*.part")]

    def fingerprints(self) -> set[str]:
        """Return the jobs that have sound archives."""
        found = set()
        for path in self.written():
            with suppress(*_DAMAGE), self._opened(path) as file:
                found.add(str(_head(file)["fingerprint"]))
        return found

    def load(self, name: str, unpack: Callable[[Any, Arrays], Part]) -> Part | None:
        """Return a part that is kept.

        Parameters
        ----------
        name : str
            Of the part.
        unpack : callable
            Makes the part from the input of `save`; it raises any of the usual errors, such as
            ValueError and KeyError, where that is none.

        Returns
        -------
        object or None
            None if nothing is kept or readable; unreadable archives are logged.

        Raises
        ------
        StorageError
            If the system does not let the archive be read.
        """
        path = self._path(name)
        if kind_of(path) is None:
            return None
        try:
            with self._opened(path) as file:
                head = _head(file)
                if head["fingerprint"] != self._fingerprint:
                    raise ValueError("of another job")
                arrays = {key.removeprefix("values "): file[key] for key in file.files if key != "head"}
            part = unpack(head["plain"], arrays)
        except PermissionError as error:
            found = f"{path}: expected a file that can be read, found: {error.strerror}"
            raise StorageError(found) from error
        except _DAMAGE as error:
            _logger.warning("%s: damaged (%s); done again", path, error or "it is empty")
            return None
        self._remember(head["maker"])
        return part

    def save(self, name: str, plain: Any, arrays: Arrays) -> None:
        """Keep a part: its values of JSON types, and its arrays."""
        head = json.dumps({"plain": plain, "fingerprint": self._fingerprint, "maker": self._maker})
        named: dict[str, Any] = {f"values {key}": array for key, array in arrays.items()}
        with written_aside(self._path(name)) as aside, aside.open("wb") as file:
            np.savez_compressed(file, head=np.array(head), **named)
        self._remember(self._maker)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}{_SUFFIX}"

    def _opened(self, path: Path) -> np.lib.npyio.NpzFile:
        """Return an archive that unpacks to no more than it may, none of its arrays read yet."""
        data = read_regular(path, self._limit)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > self._limit:
            raise ValueError("it unpacks to more than it may")
        return np.load(io.BytesIO(data))

    def _remember(self, maker: dict[str, Any]) -> None:
        if maker not in self.makers:
            self.makers.append(maker)


def _head(file: np.lib.npyio.NpzFile) -> dict[str, Any]:
    """Return the head of an archive, as `save` writes it."""
    return json.loads(str(file["head"]))
