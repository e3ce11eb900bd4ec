"""MAT and MDF4 files that give parameters of a job: signals with units, one error for all faults.

Of all signals of a file those count that a column's name, or another name of it, names in any case.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cvt_hpc.errors import few_of, mismatch, show
from cvt_hpc.job.csv_files import arranged, content_of, named_column, told
from cvt_hpc.job.units import factor_to
from cvt_hpc.job.values import Point
from cvt_hpc.parameters import Column, FromFile

MOST_BYTES = 2**26
MOST_VALUES = 2**22  # of a signal
MAT, MDF = ".mat", ".mf4"
UNIT = "_unit"  # of the name of a text beside a signal
_HDF5 = b"\x89HDF\r\n\x1a\n"
_MOST_NAMED = 8
Signal = tuple[str, np.ndarray, str]  # name, values (n,), unit


def read_signals(file: FromFile, name: str, source: str, where: str) -> Point:
    """Return the raw values of the parameters that a file gives, by key.

    In a MAT file (version 7 and before) each signal is an array, and a text NAME_unit beside it its unit. In
    an MDF4 file signals over other times than the first one are linear between theirs.

    Parameters
    ----------
    file, name, source, where
        As of `csv_files.read_csv`.

    Raises
    ------
    InputError
        If the file is missing, a link, no regular file, too large or of another kind, if the library that
        reads it is missing, or if a signal is not legal.
    """
    path = Path(source).parent / name
    place = f"{where}: {path}"
    suffix = MAT if name.endswith(MAT) else MDF
    content = content_of(path, MOST_BYTES, place, f"a {suffix} file", suffix)
    columns: dict[str, Column] = {}
    others = []
    for signal, values, unit in (_of_mat if suffix == MAT else _of_mdf)(file, content, place):
        if (key := named_column(file, signal)) is None:
            others.append(signal)
        elif key in columns:
            raise mismatch(place, f"one signal for {key}", f"{show(signal)} and another one")
        else:
            columns[key] = _column(file, key, signal, values, unit, place)
    for key in file.required:
        if key not in columns:
            found = f"none among {few_of(others, _MOST_NAMED)}" if others else "no signals"
            raise mismatch(place, f"a signal {told(key, file)}", found)
    rows = max(len(column.values) for column in columns.values())
    for key, column in columns.items():
        if len(column.values) != rows:
            raise mismatch(f"{place}: {key}", f"{rows} values, as others have", str(len(column.values)))
    return arranged(file, columns, place, [f"entry {row}" for row in range(1, rows + 1)])


def _column(file: FromFile, key: str, signal: str, values: np.ndarray, unit: str, place: str) -> Column:
    place = f"{place}: {signal}"
    if values.dtype.kind not in "fiu" or values.ndim != 1:
        raise mismatch(place, "a row or a column of numbers", f"{show(values)} of {values.dtype}")
    if values.size > MOST_VALUES:
        raise mismatch(place, f"at most {MOST_VALUES} values", str(values.size))
    if not np.isfinite(values).all():
        raise mismatch(place, "finite numbers", "others, as where a signal is missing")
    for si in file.columns[key]:
        bare = unit in ("", "1", "-")
        if bare == (not si) and (factor := 1.0 if bare else factor_to(unit, si)):
            return Column(si, tuple((values * float(factor)).tolist()))
    raise mismatch(place, f"the unit of {told(key, file)}", show(unit) if unit else "none")


def _of_mat(file: FromFile, content: bytes, place: str) -> Iterator[Signal]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    if _HDF5 in content[:1024]:
        raise mismatch(place, "a MAT file of version 7 or before", "version 7.3", "save it with -v7")
    try:
        found = loadmat(io.BytesIO(content), squeeze_me=True)
    except (MatReadError, NotImplementedError, ValueError, TypeError, OSError, EOFError) as error:
        raise mismatch(place, "a MAT file", str(error) or type(error).__name__) from None
    for signal, values in found.items():
        if not signal.startswith("__") and not signal.endswith(UNIT):
            yield signal, np.atleast_1d(values), str(found.get(signal + UNIT, "")).strip()


def _of_mdf(file: FromFile, content: bytes, place: str) -> Iterator[Signal]:
    try:
        import asammdf
    except ImportError:
        then = 'pip install "cvt_hpc[mdf]"'
        raise mismatch(place, "asammdf, which reads MDF4 files", "no such package", then) from None
    try:
        with asammdf.MDF(io.BytesIO(content)) as measured:
            yield from _over_one_time(file, measured)
    except Exception as error:  # a foreign file may raise anything in that library
        raise mismatch(place, "an MDF4 file", str(error) or type(error).__name__) from None


def _over_one_time(file: FromFile, measured: object) -> Iterator[Signal]:
    """Signals of an MDF file over the times of the first one that counts, and their time."""
    first = None
    for name, places in measured.channels_db.items():  # type: ignore[attr-defined]
        key = named_column(file, name)
        if key is None or key == "time":
            continue
        group, index = places[0]
        signal = measured.get(name, group=group, index=index)  # type: ignore[attr-defined]
        if first is None:
            first = np.asarray(signal.timestamps, float)
            yield "time", first, "s"
        values = np.interp(first, signal.timestamps, np.asarray(signal.samples, float))
        yield name, values, str(signal.unit)
