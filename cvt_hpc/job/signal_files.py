"""MAT and MDF4 files that give parameters of a job: signals with units, one error for all faults.

Of all signals of a file those count that a column's name, or another name of it, names in any case.
"""

from __future__ import annotations

import gc
import io
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from cvt_hpc.errors import JobWarning, few_of, mismatch, show
from cvt_hpc.job.course_files import check_gaps
from cvt_hpc.job.csv_files import (
    BARE,
    MOST_BYTES,
    FileValues,
    arranged,
    content_of,
    named_column,
    not_read,
    told,
    unit_of,
)
from cvt_hpc.job.netcdf_files import MOST_VALUES
from cvt_hpc.job.units import factor_to
from cvt_hpc.parameters import Column, FromFile, RowError
from cvt_hpc.variator.profiles import check_times

MAT, MDF = ".mat", ".mf4"
UNIT = "_unit"  # of the name of a text beside a signal
_HDF5 = b"\x89HDF\r\n\x1a\n"
_MOST_NAMED = 8
_FORMULAS = (3, 10)  # kinds of conversion in MDF 4, and in versions before
Signal = tuple[str, np.ndarray, str]  # name, values (n,), unit


def read_signals(file: FromFile, name: str, source: str, where: str) -> FileValues:
    """Return the raw values of the parameters that a file gives.

    In a MAT file (version 7 and before) each signal is an array, and a text NAME_unit beside it its unit. The
    signals of an MDF4 file count where all have values, linear between their own times. A warning states how
    the file was read, and which of its signals do not count.

    Arguments and errors are as of `csv_files.read_csv`; InputError also where the library is missing.
    """
    path = Path(source).parent / name
    place = f"{where}: {path}"
    suffix = path.suffix.lower()
    content = content_of(path, MOST_BYTES, place, f"a {suffix} file", suffix)
    columns: dict[str, Column] = {}
    others: list[str] = []
    units: dict[str, str] = {}
    named: dict[str, str] = {}
    for signal, values, unit in (_of_mat if suffix == MAT else _of_mdf)(file, content, place):
        if (key := named_column(file, signal)) is None:
            others.append(signal)
        elif key in columns:
            raise mismatch(place, f"one signal for {key}", f"{show(named[key])} and {show(signal)}")
        else:
            named[key] = signal
            units[key] = unit_of(file, key, unit)
            columns[key] = _column(file, key, signal, values, units[key], place)
    for key in file.required:
        if key not in columns:
            found = f"none among {few_of(others, _MOST_NAMED)}" if others else "no signals"
            raise mismatch(place, f"a signal {told(key, file)}", found)
    rows = max(len(column.values) for column in columns.values())
    for key, column in columns.items():
        if len(column.values) != rows:
            raise mismatch(f"{place}: {key}", f"{rows} values, as others have", str(len(column.values)))
    given = arranged(file, columns, place, lambda row: f"entry {row + 1}", units)
    read = ", ".join(f"{show(signal)} as {key}" for key, signal in named.items())
    warnings.warn(f"{place}: read with {read}{not_read(others)}", JobWarning, stacklevel=2)
    return given


def _column(file: FromFile, key: str, signal: str, values: np.ndarray, unit: str, place: str) -> Column:
    place = f"{place}: {signal}"
    if values.dtype.kind not in "fiu" or values.ndim != 1:
        raise mismatch(place, "a row or a column of numbers", f"{show(values)} of {values.dtype}")
    if values.size > MOST_VALUES:
        raise mismatch(place, f"at most {MOST_VALUES} values", str(values.size))
    if not np.isfinite(values).all():
        raise mismatch(place, "finite numbers", "others, as where a signal is missing")
    for si in file.columns[key]:
        bare = unit in BARE
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
    stream = io.BytesIO(content)
    try:
        with asammdf.MDF(stream) as measured:
            known = {name: named_column(file, name) for name in measured.channels_db}
            others = [name for name, key in known.items() if key is None]
            found, calculated = [], []
            for name in (name for name, key in known.items() if key not in (None, "time")):
                for group, index in measured.channels_db[name]:
                    rule = measured.get_channel_metadata(group=group, index=index).conversion
                    if rule is not None and rule.conversion_type in _FORMULAS:
                        calculated.append(name)
                        continue
                    one = measured.get(name, group=group, index=index)
                    times = np.asarray(one.timestamps, float)
                    found.append((name, times, np.asarray(one.samples), str(one.unit)))
    except Exception as error:  # a foreign file may raise anything in that library
        hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
        try:
            traceback.clear_frames(error.__traceback__)
            gc.collect()  # what is half read goes, and fails once more
        finally:
            sys.unraisablehook = hook
        what = str(error).replace(str(stream), Path(place).name) or type(error).__name__
        raise mismatch(place, "an MDF4 file", what) from None
    if calculated:  # a text of the file that would be evaluated
        raise mismatch(f"{place}: {calculated[0]}", "stored values, or a straight line of them", "a formula")
    yield from _over_one_time(found, place)
    for name in others:
        yield name, np.empty(0), ""


def _over_one_time(found: Sequence[tuple[str, np.ndarray, np.ndarray, str]], place: str) -> Iterator[Signal]:
    """Time, and signals over it: the times of the signal with most samples, where all have values."""
    if not found:
        return
    for name, times, values, _ in found:
        try:
            check_times(times)
        except RowError as error:
            raise mismatch(_entry(f"{place}: {name}", error.row), error.expected, error.found) from None
        if _is_course(values):
            check_gaps(times, (values,), "s", partial(_entry, f"{place}: {name}"))
    first, last = max(times[0] for _, times, _, _ in found), min(times[-1] for _, times, _, _ in found)
    finest = max((times for _, times, _, _ in found), key=len)
    shared = finest[(finest >= first) & (finest <= last)]
    if shared.size < 2:
        spans = ", ".join(f"{name} {times[0]:g} to {times[-1]:g} s" for name, times, _, _ in found)
        raise mismatch(place, "signals that were measured at the same time", spans)
    yield "time", shared, "s"
    for name, times, values, unit in found:
        yield name, np.interp(shared, times, values) if _is_course(values) else values, unit


def _entry(place: str, row: int) -> str:
    return f"{place}, entry {row + 1}"


def _is_course(values: np.ndarray) -> bool:
    return values.dtype.kind in "fiu" and values.ndim == 1
