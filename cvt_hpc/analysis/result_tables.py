"""Small tables that slow studies leave in the repository, read as datasets."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.conversion import documented_units
from cvt_hpc.errors import mismatch
from cvt_hpc.files import naming_refusals, read_regular
from cvt_hpc.job.units import to_si
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.netcdf import flag_attributes
from cvt_hpc.tables import below_origin
from cvt_hpc.variables import Status, Vibrates

_LARGEST_TABLE = 16 << 20  # [byte]
_LABELS = {"t1": "strand", "t2": "strand", "driving": "pulley", "driven": "pulley"}


def read_table(path: str | Path) -> xr.Dataset:
    """Return the results that a small table of a study keeps, such as jobs/results/lebrecht_2004.csv.

    Parameters
    ----------
    path : str or Path
        A CSV file as `jobs/tabulate.py` writes it: lines with "#" of its origin, then a head of axes [SI],
        `status`, `vibrates`, and quantities with the unit and a column for each strand or pulley. The axes
        make a full grid.

    Returns
    -------
    Dataset
        As `open_results` returns it, of these quantities alone [SI].

    Raises
    ------
    InputError
        If the file cannot be read or is no such table.
    """
    with naming_refusals(Path(path), "a table of a study"):
        lines = read_regular(Path(path), _LARGEST_TABLE).decode().splitlines()
        rows = list(csv.reader(below_origin(lines)))
    head, body = (rows[0] if rows else []), rows[1:]
    if "status" not in head or any(len(row) != len(head) for row in body):
        raise mismatch(str(path), "a table of a study, with a column status and full rows", ", ".join(head))
    columns = dict(zip(head, zip(*body, strict=True), strict=True))
    axes = {name: _numbers(columns[name]) for name in head[: head.index("status")]}
    coordinates = {name: np.unique(values) for name, values in axes.items()}
    shape = tuple(map(len, coordinates.values()))
    places = tuple(np.searchsorted(coordinates[name], values) for name, values in axes.items())
    if len(body) != np.prod(shape) or len(set(zip(*places, strict=True))) != len(body):
        raise mismatch(str(path), "a row for each place of the grid", f"{len(body)} rows")

    def grid(values: np.ndarray) -> np.ndarray:
        filled = np.empty(shape, values.dtype)
        filled[places] = values
        return filled

    dataset = xr.Dataset(
        coords={name: (name, v, {"units": _unit_of(name)}) for name, v in coordinates.items()}
    )
    for name, flags in (("status", Status), ("vibrates", Vibrates)):
        known = {flag.name.lower(): flag for flag in flags}
        values = [known.get(word, Vibrates.UNDECIDED) for word in columns[name]]
        dataset[name] = (tuple(axes), grid(np.array(values, np.int8)), flag_attributes(flags))
    for column in head[head.index("vibrates") + 1 :]:
        _add(dataset, column, tuple(axes), columns[column], grid)
    return dataset.assign_attrs(job_name=Path(path).stem)


def _add(dataset: xr.Dataset, column: str, dims: tuple[str, ...], texts: Sequence[str], grid: Any) -> None:
    """Add a column of numbers to a dataset, where it belongs to a strand or pulley at its place."""
    name, _, unit = column.removesuffix("]").partition(" [")
    try:
        values = grid(_numbers(texts))
    except ValueError:
        return  # of texts
    si = {"um": "m"}.get(unit, unit)
    values = values * (to_si(f"1 {unit}", si) if unit else 1.0)
    head, _, label = name.rpartition("_")
    if not head or label not in _LABELS:
        head, label = name, ""
    attributes = {"units": si or documented_units(False).get(head, "1")}
    if not label:
        dataset[name] = (dims, values, attributes)
        return
    extra = _LABELS[label]
    if head not in dataset:
        labels = [one for one, dim in _LABELS.items() if dim == extra]
        dataset[head] = ((*dims, extra), np.full((*values.shape, len(labels)), np.nan), attributes)
        dataset[extra] = labels
    dataset[head].loc[{extra: label}] = values


def _numbers(texts: Sequence[str]) -> np.ndarray:
    return np.array([float(text) if text else np.nan for text in texts])


def _unit_of(key: str) -> str:
    """The SI unit of a parameter of any model; "1" of what none knows."""
    tables = (table for model in MODELS for table in load_model(model).parameters.values())
    return next((table[key].unit or "1" for table in tables if key in table), "1")
