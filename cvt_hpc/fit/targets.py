"""The targets of a fit, read from a job: each measure with the keys that it takes."""

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.fit.scoring import MEASURES, Target
from cvt_hpc.job import Job
from cvt_hpc.job.tables import read_table
from cvt_hpc.job.values import expectation
from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.study.simulator import default_simulator

_EACH_OF = ("strand", "pulley")  # of such a quantity that of the largest motion counts


def read_targets(
    raw: Any, job: Job, along: str, values: NDArray[np.float64], cases: Collection[str], where: str
) -> tuple[Target, ...]:
    """Return the targets of a table [fit].

    Parameters
    ----------
    raw : Any
        Content of the file: a list of tables.
    job : Job
        For units and quantities.
    along : str
        The swept parameter.
    values : (runs,) array
        The values that the search runs: some of them have to belong to each target.
    cases : collection of str
        Names of the cases.
    where : str
        File and table, for the errors.

    Raises
    ------
    InputError
        If a target is not legal, or there is none.
    """
    if not isinstance(raw, list) or not raw:
        raise mismatch(f"{where} targets", "a list of one target or more", show(raw))
    found: list[Target] = []
    for number, table in enumerate(raw, 1):
        place = f"{where} targets, item {number}"
        target = _read_target(table, job, along, cases, place)
        if target.name in {one.name for one in found}:
            raise mismatch(f"{place} name", "a name of its own", show(target.name))
        if not ((values >= target.low) & (values <= target.high)).any():
            expected = f"one or more of the values of {along} that the search runs"
            raise mismatch(f"{place} from, to", expected, "none between them")
        found.append(target)
    return tuple(found)


def _read_target(table: Any, job: Job, along: str, cases: Collection[str], where: str) -> Target:
    if not isinstance(table, Mapping):
        raise mismatch(where, "a table", show(table))
    unit, kind = job.schema.parameters[along].unit, table.get("measure")
    declared = {
        "name": Parameter(None, "", "in one word"),
        "statement": Parameter("", "", "as its source has it"),
        "case": Parameter(next(iter(cases)), "", "whose runs", choices=tuple(cases)),
        "measure": Parameter("", "", "how it is scored", choices=tuple(MEASURES)),
        "from": Parameter(-math.inf, unit, "first value that is asked", allow_infinite=True),
        "to": Parameter(math.inf, unit, "last value that is asked", allow_infinite=True),
        "weight": positive(1.0, "", "in the mean of all targets"),
    }
    own: dict[str, Parameter] = {}
    if kind == "within":
        name = table.get("quantity")
        if not isinstance(name, str):
            raise mismatch(f"{where} quantity", "a recorded quantity", show(name))
        own = {"quantity": Parameter("", "", ""), **_bounds(unit_of(name, job, f"{where} quantity"))}
    elif kind == "onset":
        own = _bounds(unit)
    elif kind == "areas":
        own = {"count": Parameter(1, "", "separate areas", minimum=1)}
    elif kind == "larger":
        own = {
            "than": Parameter("", "", "the other case", choices=tuple(cases)),
            "by": Parameter(1.1, "", "factor", minimum=1.0, exclusive=True),
        }
    read = read_table(declared | own, table, where)
    for key in {"measure", "than"} & {*read}:
        if not read[key]:
            raise mismatch(f"{where} {key}", expectation((declared | own)[key]), "nothing")
    low, high = read.pop("from"), read.pop("to")
    if low > high:
        raise mismatch(f"{where} from", "a value not above `to`", f"{low:g} and {high:g}")
    bounds = read.get("bounds", ())
    if own and "bounds" in own and not (len(bounds) == 2 and bounds[0] <= bounds[1]):
        raise mismatch(f"{where} bounds", "two values, the lower one first", str(list(bounds)))
    if read.get("than") == read["case"]:
        raise mismatch(f"{where} than", "another case than its own", show(read["case"]))
    return Target(low=low, high=high, **read)


def _bounds(unit: str) -> dict[str, Parameter]:
    return {
        "bounds": Parameter((), unit, "between which the score is 1"),
        "fading": Parameter(
            None if unit else 1.0, unit, "distance from them at which it is 0", minimum=0.0, exclusive=True
        ),
    }


def unit_of(name: str, job: Job, where: str) -> str:
    """Return the unit of a recorded quantity, such as "frequency", or "mode t1" of one strand.

    Raises
    ------
    InputError
        If runs record none of this name that is a number for each run, strand or pulley.
    """
    simulator = default_simulator()
    variables = {
        one.name: one
        for one in simulator.record_variables(job)
        if one.dims == () or (len(one.dims) == 1 and one.dims[0] in _EACH_OF)
    }
    quantity, _, label = name.partition(" ")
    if quantity not in variables or variables[quantity].dtype.startswith("S"):
        raise unknown(where, "quantity of a run", quantity, variables)
    if label:
        labels = {
            str(one)
            for dim in variables[quantity].dims
            for one in simulator.record_coordinates(job)[dim].values
        }
        if label not in labels:
            raise unknown(where, f"part of {quantity}", label, sorted(labels))
    unit = variables[quantity].units
    return "" if unit == "1" else unit
