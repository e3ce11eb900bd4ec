"""The table [uncertain] of a job file: its distributions and their correlation, each checked in turn."""

import math
import warnings
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from cvt_hpc.errors import InputError, UnitWarning, mismatch, show, unknown
from cvt_hpc.job.axes import ALL, NONE, SAMPLE, SWAPPED
from cvt_hpc.job.design import SEED, check_power_of_2
from cvt_hpc.job.rules import Rule
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.uncertain import KINDS, MOST, OUTERMOST, TABLE, Distribution, Scatter, Uncertain
from cvt_hpc.job.units import unit_in
from cvt_hpc.job.values import Point, Table, in_words, kind_of, read_or_default, read_value, refuse_unknown
from cvt_hpc.parameters import Parameter, positive

_LEAST_SHARE = 1e-6  # of a distribution within its limits
_TOLERANCE = 1e-9  # of a matrix: how symmetric it is, and how positive its eigenvalues are
_SAMPLES = Parameter(256, "", "samples of each cell", minimum=2, maximum=MOST)

_COEFFICIENTS = Parameter((), "", "matrix of correlation")
_INDICES = Parameter(False, "", "whether runs for Sobol indices are done, too")
SETTINGS = ("samples", "seed", "correlation", "indices")


def read_uncertain(
    table: Table, gone: Collection[str], schema: Schema, source: str
) -> tuple[list[Rule], dict[str, list], Point]:
    """Check a job file's table [uncertain].

    Parameters
    ----------
    table, schema, source
        `samples`, `seed`, `correlation`, `indices`, and a distribution by parameter; the job's declarations,
        with samples; and its file, for the error.
    gone : collection of str
        Parameters that overrides have given a value of their own.

    Returns
    -------
    rules : list of Rule
        The values of each uncertain parameter by the number of the sample; none if overrides left none.
    axes : dict
        The values on the axes that the table adds to the job.
    fixed : dict
        The number of the sample, or what is swapped, where the table fixes it.

    Raises
    ------
    InputError
        If anything is wrong with the table.
    """
    where = f"{source}: [{TABLE}]"
    found: dict[str, Distribution] = {}
    pairs = ((name, raw) for name, raw in schema.flatten(table) if name not in (*SETTINGS, SAMPLE, SWAPPED))
    for key, entry in schema.entries(pairs, where):
        if key in found:
            raise mismatch(entry.where, "one distribution of a parameter", f"a second one of {key}")
        found[key] = _read_distribution(key, *entry)
    if not found:
        raise mismatch(where, "a parameter with a distribution, or several", "none")
    settings = read_or_default({"seed": SEED, "indices": _INDICES}, table, where)
    correlated, matrix = _read_correlation(table.get("correlation"), found, gone, schema, where)
    # by name, so that the samples of a job do not depend on its layout
    left = tuple(one for key, one in sorted(found.items()) if key not in gone)
    uncertain = Uncertain(left, settings["seed"], correlated, matrix, settings["indices"])
    rules = []
    for place, one in enumerate(left):
        parameter = replace(schema.parameters[one.key], sensible=None)
        rules.append(Rule(one.key, Scatter(uncertain, place), f"{where} {one.key}", parameter))
    own = {key: parameter for key, parameter in schema.sections[TABLE].items() if key in table}
    axes: dict[str, list] = {}
    if "samples" in table:
        samples = read_value(_SAMPLES, table["samples"], f"{where} samples")
        check_power_of_2(samples, f"{where} samples")
        axes[SAMPLE] = list(range(samples))
        if uncertain.indices:
            axes[SWAPPED] = [NONE, ALL, *uncertain.groups()]
    return rules, axes, read_or_default(own, table, where)


def _read_distribution(key: str, parameter: Parameter, raw: object, where: str) -> Distribution:
    if kind_of(parameter) is not float or key == SAMPLE:
        raise mismatch(where, "a parameter with continuous values, to give it a distribution", "another one")
    if not isinstance(raw, Mapping):
        raise mismatch(where, 'a distribution, such as { distribution = "uniform", from =, to = }', show(raw))
    kinds = Parameter("normal", "", "", choices=tuple(KINDS))
    kind = read_value(kinds, raw.get("distribution"), f"{where}.distribution")
    needed, optional = KINDS[kind]
    refuse_unknown(raw, ("distribution", *needed, *optional), f"{where}.", f"key of a {kind} distribution")
    numbers = []
    for name in (*needed, *optional):
        if name not in raw and name in needed:
            raise mismatch(f"{where}.{name}", f"a number, which a {kind} distribution needs", "nothing")
        if name in raw:
            is_positive = name == "standard_deviation" or (kind == "log_normal" and name == "mean")
            free = positive(1.0, parameter.unit, "") if is_positive else Parameter(0.0, parameter.unit, "")
            numbers.append((name, read_value(free, raw[name], f"{where}.{name}")))
    if unit_in(raw.get("standard_deviation")) == "%" != unit_in(raw["mean"]):
        told = f"{show(raw['standard_deviation'])} is {dict(numbers)['standard_deviation']:g}"
        told = f"{where}.standard_deviation: {told}, no share of the mean"
        warnings.warn(told, UnitWarning, stacklevel=2)
    distribution, has = Distribution(key, kind, tuple(numbers)), dict(numbers)
    if not has.get("from", -math.inf) < has.get("to", math.inf):
        raise mismatch(where, "from below to", f"{show(raw['from'])} and {show(raw['to'])}")
    if "mode" in has and not has["from"] <= has["mode"] <= has["to"]:
        raise mismatch(f"{where}.mode", "a value from `from` to `to`", show(raw["mode"]))
    if (share := distribution.share_within()) < _LEAST_SHARE:
        found = f"a share of {share:.1g} between them"
        raise mismatch(where, "limits between which values are likely", found)
    return distribution


def _read_correlation(
    raw: object, found: Mapping[str, Distribution], gone: Collection[str], schema: Schema, where: str
) -> tuple[tuple[str, ...], tuple[tuple[float, ...], ...]]:
    """Return the correlated parameters that overrides have left, and their matrix."""
    where = f"{where} correlation"
    if raw is None:
        return (), ()
    if not isinstance(raw, Mapping):
        raise mismatch(where, "a table with parameters and matrix", show(raw))
    refuse_unknown(raw, ("parameters", "matrix"), f"{where}.", "key of a correlation")
    names = raw.get("parameters")
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise mismatch(f"{where}.parameters", "a list of uncertain parameters", show(names))
    correlated = tuple(schema.find(name, f"{where}.parameters") for name in names)
    for key in correlated:
        if key not in found:
            raise unknown(f"{where}.parameters {key}", "uncertain parameter", key, found)
    size = len(correlated)
    if size < 2 or len({*correlated}) < size:
        raise mismatch(f"{where}.parameters", "two or more, each once", ", ".join(correlated) or "none")
    matrix = read_value(_COEFFICIENTS, raw.get("matrix", ()), f"{where}.matrix")
    shape = f"{size} rows of {size} numbers, one for each parameter"
    if len(matrix) != size or not all(isinstance(row, tuple) and len(row) == size for row in matrix):
        raise mismatch(f"{where}.matrix", shape, f"{len(matrix)} rows" if matrix else "nothing")
    values = np.array(matrix)
    if not (values.ndim == 2 and np.abs(values - values.T).max() <= _TOLERANCE):
        raise mismatch(f"{where}.matrix", "a symmetric matrix", "one that is not")
    if not np.array_equal(np.diag(values), np.ones(size)):
        raise mismatch(f"{where}.matrix", "1 on the diagonal", "other numbers")
    if (least := float(np.linalg.eigvalsh(values).min())) < _TOLERANCE:
        raise mismatch(f"{where}.matrix", "a positive definite matrix", f"an eigenvalue of {least:.3g}")
    kept = [place for place, key in enumerate(correlated) if key not in gone]
    if len(kept) < 2:
        return (), ()
    return tuple(correlated[k] for k in kept), tuple(tuple(matrix[j][k] for k in kept) for j in kept)


def check_limits(rules: Collection[Rule], schema: Schema) -> None:
    """Refuse distributions of which a sample may be no legal value, however many samples a study takes.

    Raises
    ------
    InputError
        With the first parameter whose distribution goes beyond its limits, and the share that does.
    """
    for rule in rules:
        if not isinstance(rule.source, Scatter):
            continue
        one, limits = rule.source.uncertain.distributions[rule.source.place], rule.parameter
        unit, wanted = limits.unit, schema.units.get(rule.key, "")
        for end in one.quantiles(np.array([OUTERMOST, 1.0 - OUTERMOST])).tolist():
            try:
                read_value(limits, in_words(end, unit, wanted), rule.where)
            except InputError as error:
                with np.errstate(divide="ignore", invalid="ignore"):  # logarithms of values that it has not
                    below, up_to = np.nan_to_num(one.shares(np.array([limits.minimum, limits.maximum])))
                share = f"{100.0 * (1.0 + below - up_to):.2g} % of the distribution"
                then = f"at its end, {share} beyond; limits `from` and `to` cut it off"
                raise InputError(f"{error} {then}") from None
