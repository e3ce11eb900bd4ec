"""The results of a study as tables for spreadsheets and data frames: a row for each run, or each cell."""

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from pandas import DataFrame

from cvt_hpc.analysis.arrangement import labelled
from cvt_hpc.analysis.classes import check_results, map_classes
from cvt_hpc.analysis.probability import has_samples, probabilities
from cvt_hpc.errors import mismatch
from cvt_hpc.job.values import heading, shown_number
from cvt_hpc.storage.files import written_aside

FORMATS = (".csv", ".xlsx")
_MOST_ROWS = (1 << 20) - 1  # of a sheet, below its head
_DIGITS = 14  # of what was converted: 3000 rpm from 314.1592653589793 rad/s


def run_table(dataset: xr.Dataset, source: str = "results") -> DataFrame:
    """Return results with a row for each run, or each cell of the grid; InputError of what is none.

    Columns are the axes and what follows from them in the units of the job; `status` and `class`; then all
    results in the units of the dataset, with a column for each strand, pulley or other named place, such as
    `amplitude_t1 [m]`. Flags are words. Spectra and other series are left out.
    """
    check_results(dataset, source)
    dims = dataset["status"].dims
    axes = [name for name, values in dataset.coords.items() if set(values.dims) <= set(dims)]
    results = [name for name, array in dataset.data_vars.items() if _is_named(array, dims)]
    loaded = dataset[[*axes, *results]].assign({"class": map_classes(dataset)}).load()
    status = loaded["status"]
    columns: dict[str, np.ndarray] = {}
    for name in axes:
        values = _flat(loaded[name].broadcast_like(status), dims)
        columns[heading(str(name), loaded[name].attrs)] = _in_job_units(values, loaded[name].attrs)
    for name in dict.fromkeys(["status", "class", *results]):
        array = loaded[name]
        unit = str(array.attrs.get("units", "1"))
        of_unit = "" if unit in ("", "1") else f" [{unit}]"
        for labels, part in labelled(array, dims):
            values = _flat(part.broadcast_like(status), dims)
            columns["_".join([str(name), *labels]) + of_unit] = _in_words(values, array.attrs)
    return DataFrame(columns)


def tables(dataset: xr.Dataset, source: str = "results") -> dict[str, DataFrame]:
    """Return the `run_table` as "runs"; of uncertain parameters the probabilities as "cells", too."""
    found = {"runs": run_table(dataset, source)}
    if has_samples(dataset):
        # a cell of many runs has no verdict of its own
        found["cells"] = run_table(probabilities(dataset)).drop(columns=["status", "class", "vibrates"])
    return found


def write_tables(frames: Mapping[str, DataFrame], out: Path) -> list[Path]:
    """Write tables as CSV, or as sheets for Excel and the like, by the suffix, and return the paths.

    Of CSV files the first one is `out`, and the names of the others are beside its own. InputError if the
    suffix is none of FORMATS; of sheets, if the library is missing or there are more than _MOST_ROWS.
    """
    if out.suffix.lower() not in FORMATS:
        raise mismatch(str(out), f"a table: {', '.join(FORMATS)}", out.suffix or "no suffix")
    if out.suffix.lower() == ".csv":
        first, *others = frames
        paths = {first: out} | {name: out.with_stem(f"{out.stem}_{name}") for name in others}
        for name, path in paths.items():
            with written_aside(path, parents=True) as aside:
                frames[name].to_csv(aside, index=False, lineterminator="\n")
        return [*paths.values()]
    try:
        from xlsxwriter import Workbook
    except ImportError:
        then = '`pip install "cvt_hpc[xlsx]"`, or write a .csv, which spreadsheets read too'
        raise mismatch(str(out), "the library XlsxWriter", "none", then) from None
    if (rows := max(map(len, frames.values()))) > _MOST_ROWS:
        expected = f"at most {_MOST_ROWS} runs, which a sheet holds"
        raise mismatch(str(out), expected, str(rows), "write .csv")
    # texts stay texts, whoever has written them: no formulas and no links
    options = {"constant_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    with written_aside(out, parents=True) as aside, Workbook(str(aside), options) as book:
        for name, frame in frames.items():
            sheet = book.add_worksheet(name)
            cells = (
                frame.astype(object).where(frame.notna(), None).replace([np.inf, -np.inf], ["inf", "-inf"])
            )
            for row, values in enumerate([frame.columns, *cells.itertuples(index=False, name=None)]):
                sheet.write_row(row, 0, values)
    return [out]


def _is_named(array: xr.DataArray, dims: tuple[Hashable, ...]) -> bool:
    """Whether a variable has one value for each run, or one for each of named places."""
    extra = [dim for dim in array.dims if dim not in dims]
    return all(dim in array.coords and array[dim].dtype.kind in "OUST" for dim in extra)


def _flat(array: xr.DataArray, dims: tuple[Hashable, ...]) -> np.ndarray:
    return array.transpose(*dims).values.ravel()


def _in_job_units(values: np.ndarray, attributes: dict[str, Any]) -> np.ndarray:
    """Values [SI] of an axis in the unit that `heading` names; texts as they are."""
    if values.dtype.kind != "f" or (factor := shown_number(1.0, attributes)) == 1.0:
        return _in_words(values, attributes)
    return np.array([float(f"{factor * value:.{_DIGITS}g}") for value in values.tolist()])


def _in_words(values: np.ndarray, attributes: dict[str, Any]) -> np.ndarray:
    """Words of flags, texts of bytes, numbers as they are."""
    if "flag_meanings" in attributes:
        meanings = dict(zip(attributes["flag_values"], attributes["flag_meanings"].split(), strict=True))
        known, places = np.unique(values, return_inverse=True)
        return np.array([meanings.get(value, "") for value in known], object)[places]
    return np.char.decode(values, errors="replace") if values.dtype.kind == "S" else values
