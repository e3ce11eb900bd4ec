"""A job for `cvt-hpc fit`: a job whose axes are the ranges of free parameters, with a table [fit].

Its targets are measures, each with the keys that it takes.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.experiments.fit.job import MEASURES, NUMBERS, TABLE, Case, Fit, Free, Target, share_of
from cvt_hpc.job import Job, build_job
from cvt_hpc.job.assignments import Assignments, split_assignments, take_own
from cvt_hpc.job.axes import read_values
from cvt_hpc.job.design import read_range
from cvt_hpc.job.document import read_document, read_set, read_table, read_tables
from cvt_hpc.job.units import unit_in
from cvt_hpc.job.values import expectation, kind_of, read_value, warn_of_bare_numbers
from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.study.simulator import default_simulator

_EACH_OF = ("strand", "pulley")  # of such a quantity that of the largest motion counts

_TABLES = ("along", "starts", "coarse", "repeat", "counted", "cases", "targets")


def load(path: str | Path, overrides: Assignments = ()) -> Fit:
    """Read and validate a job of a fit.

    It is a TOML file: a job whose [axes] are the ranges of the free parameters, with a table [fit]. Overrides
    are as of `load_job`; fit.KEY replaces a number, or the list of factors, of the table [fit].

    Raises
    ------
    InputError
        If anything is wrong with the file or an override.
    """
    source, document = str(path), read_document(Path(path))
    where = f"{source}: [{TABLE}]"
    replaced = split_assignments(overrides, source, "--set")
    put = take_own(replaced, TABLE)
    if TABLE not in document:
        then = "`cvt-hpc examples fit_lebrecht` copies a job that has one; for a measured file: "
        then += "`cvt-hpc calibrate`, which weighs samples of [uncertain]"
        raise mismatch(where, "a table of cases and targets", "nothing", then)
    table = document.pop(TABLE)
    for key in put:
        if key not in NUMBERS:
            raise unknown(f"{source}: --set {TABLE}.{key}", "number of [fit]", key, NUMBERS)
    if isinstance(table, Mapping):
        table = {**table, **put}
    own = read_table(NUMBERS, table, where, _TABLES)
    _check_own(own, where)
    axes = document.pop("axes", {})
    for key in ("design", "linked", "uncertain"):
        if key in document:
            raise mismatch(f"{source}: [{key}]", "none: a fit draws its candidates itself", "one")
    job = build_job(document, source, replaced, "--set")
    if job.axes:
        raise mismatch(f"{source}: --set {job.axes[0].name}", "one value", "an axis")
    free, units = _read_free(axes, job, source)
    job = replace(job, units={**job.units, **units})
    along, values = _read_along(table.get("along"), job, where)
    cases = _read_cases(table.get("cases"), job, where)
    _check_apart(free, along, cases, where)
    every = own["every"]
    fit = Fit(
        job=job,
        free=free,
        along=along,
        values=values,
        cases=cases,
        targets=_read_targets(table.get("targets"), job, along, values[::every], cases, where),
        starts=_read_starts(table.get("starts", []), free, job, where),
        coarse=read_set({"set": table.get("coarse", {})}, f"{where} coarse"),
        repeat=_read_repeat(table.get("repeat", {}), job, where),
        counted=_read_counted(table.get("counted", {}), job, where),
        **own,
    )
    if axes := fit.coarse_job().axes:
        raise mismatch(f"{where} coarse {axes[0].name}", "one value", "an axis")
    return fit


def _check_own(own: Mapping[str, Any], where: str) -> None:
    for key in ("screened", "samples"):
        if own[key] & (own[key] - 1):
            raise mismatch(f"{where} {key}", "a power of 2", str(own[key]))
    if any(factor <= 0.0 for factor in own["distances"]):
        raise mismatch(f"{where} distances", "factors above 0", str(list(own["distances"])))
    if own["nearby"] >= 1.0:
        raise mismatch(f"{where} nearby", "a part below 1", f"{own['nearby']:g}")


def _read_free(axes: Any, job: Job, source: str) -> tuple[tuple[Free, ...], dict[str, str]]:
    """Return the free parameters, and the units in which the job gives them."""
    where = f"{source}: [axes]"
    found, units = [], {}
    for name, raw in read_tables(axes, where, "ranges of the free parameters").items():
        place = f"{where} {name}"
        key, parameter = _continuous(name, job, place, ", to fit it")
        low, high, spacing = read_range(parameter, raw, place)
        warn_of_bare_numbers(parameter, raw, place)
        found.append(Free(key, low, high, spacing))
        units[key] = unit_in(raw)
    return tuple(found), {key: unit for key, unit in units.items() if unit}


def _continuous(name: str, job: Job, where: str, why: str = "") -> tuple[str, Parameter]:
    """Return the key that a name means, of a parameter with continuous values, and its declaration."""
    key = job.schema.find(name, where)
    parameter = job.schema.parameters[key]
    if kind_of(parameter) is not float:
        raise mismatch(where, f"a parameter with continuous values{why}", "another one")
    return key, parameter


def _read_along(raw: Any, job: Job, where: str) -> tuple[str, NDArray[np.float64]]:
    where = f"{where} along"
    table = read_tables(raw if raw is not None else {}, where, "one parameter with its values")
    if len(table) != 1:
        raise mismatch(where, "one parameter", f"{len(table)}")
    ((name, values),) = table.items()
    key, parameter = _continuous(name, job, f"{where} {name}")
    read = read_values(parameter, values, f"{where} {name}")
    if list(read) != sorted(set(read)):
        raise mismatch(f"{where} {name}", "values that rise all the way", "others")
    return key, np.array(read)


def _read_cases(raw: Any, job: Job, where: str) -> dict[str, Case]:
    found = {}
    for name, table in read_tables(raw if raw is not None else {}, f"{where} cases", "cases").items():
        place = f"{where} cases.{name}"
        read_table({}, table, place, ("set", "factor"))
        parts: dict[str, dict[str, float]] = {"set": {}, "factor": {}}
        for part, of_part in parts.items():
            entries = table.get(part, {})
            if not isinstance(entries, Mapping):
                raise mismatch(f"{place} {part}", "a table", show(entries))
            for key, value in entries.items():
                spot = f"{place} {part} {key}"
                key, parameter = _continuous(key, job, spot)
                declared = parameter if part == "set" else positive(1.0, "", "factor")
                of_part[key] = read_value(declared, value, spot)
        found[name] = Case(**parts)
    return found


def _check_apart(free: tuple[Free, ...], along: str, cases: Mapping[str, Case], where: str) -> None:
    if along in {one.name for one in free}:
        raise mismatch(f"{where} along {along}", "a parameter that is not free", "one of [axes]")
    for name, case in cases.items():
        if along in {*case.set, *case.factor}:
            raise mismatch(f"{where} cases.{name} {along}", "other parameters than the swept one", along)


def _read_starts(raw: Any, free: tuple[Free, ...], job: Job, where: str) -> NDArray[np.float64]:
    """Return the shares at which the search begins; values that a start leaves open are those of the job."""
    if not isinstance(raw, list):
        raise mismatch(f"{where} starts", "a list of tables", show(raw))
    shares = np.empty((len(raw), len(free)))
    names = [one.name for one in free]
    for row, table in enumerate(raw):
        place = f"{where} starts, item {row + 1}"
        if not isinstance(table, Mapping):
            raise mismatch(place, "a table", show(table))
        for key in table:
            if key not in names:
                raise unknown(f"{place} {key}", "free parameter", key, names)
        for column, one in enumerate(free):
            spot = f"{place} {one.name}"
            if one.name in table:
                value = read_value(job.schema.parameters[one.name], table[one.name], spot)
            elif (value := job.parameters.get(one.name)) is None:
                raise mismatch(spot, "a value, as the job has none", "nothing")
            shares[row, column] = share = share_of(one, value)
            if not -1e-9 <= share <= 1.0 + 1e-9:
                words = [job.schema.in_words(one.name, end) for end in (one.low, one.high, value)]
                raise mismatch(spot, f"a value from {words[0]} to {words[1]}", words[2])
    return np.clip(shares, 0.0, 1.0)


def _read_repeat(raw: Any, job: Job, where: str) -> dict[str, tuple]:
    where = f"{where} repeat"
    if not isinstance(raw, Mapping) or len(raw) > 1:
        raise mismatch(where, "a table of one parameter with its values", show(raw))
    found = {}
    for name, values in raw.items():
        key = job.schema.find(name, f"{where} {name}")
        found[key] = read_values(job.schema.parameters[key], values, f"{where} {name}")
    return found


def _read_counted(raw: Any, job: Job, where: str) -> dict[str, tuple[float, float]]:
    where = f"{where} counted"
    if not isinstance(raw, Mapping):
        raise mismatch(where, "a table of quantities", show(raw))
    found = {}
    for name, table in raw.items():
        place = f"{where} {name}"
        unit = _unit_of(name, job, place)
        ends = {
            "from": Parameter(-math.inf, unit, "", allow_infinite=True),
            "to": Parameter(math.inf, unit, "", allow_infinite=True),
        }
        read = read_table(ends, table, place)
        found[name] = (read["from"], read["to"])
    return found


def _read_targets(
    raw: Any, job: Job, along: str, values: NDArray[np.float64], cases: Collection[str], where: str
) -> tuple[Target, ...]:
    """Return the targets of a table [fit]; each has to have some of the `values` that the search runs."""
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
    if kind in ("within", "least"):
        name = table.get("quantity")
        if not isinstance(name, str):
            raise mismatch(f"{where} quantity", "a recorded quantity", show(name))
        own = {"quantity": Parameter("", "", ""), **_bounds(_unit_of(name, job, f"{where} quantity"))}
        if kind == "least":
            del own["bounds"]
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


def _unit_of(name: str, job: Job, where: str) -> str:
    """Return the unit of a number of each run, strand or pulley, such as "frequency" or "mode t1"."""
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
