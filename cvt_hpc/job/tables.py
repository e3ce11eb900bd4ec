"""Tables of a command beside the job's own, such as [chart]: checks of keys against their declaration."""

from collections.abc import Mapping
from typing import Any

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.job.definition import HEADER
from cvt_hpc.job.plausibility import warn_of_bare_numbers
from cvt_hpc.job.values import expectation, read_value
from cvt_hpc.parameters import Parameter


def read_table(
    declared: Mapping[str, Parameter], raw: Any, where: str, tables: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the values of a table by key, defaults included.

    Parameters
    ----------
    declared : mapping
        Declared keys of the table.
    raw : Any
        Content of the file.
    where : str
        File and table, for the errors.
    tables : tuple of str
        Further keys that are legal and read elsewhere.

    Raises
    ------
    InputError
        If it is no table, or a key is unknown, missing or not legal.
    """
    if not isinstance(raw, Mapping):
        raise mismatch(where, "a table", show(raw))
    for key in raw:
        if key not in declared and key not in tables:
            raise unknown(f"{where} {key}", "key", key, [*declared, *tables])
    values = {}
    for key, parameter in declared.items():
        if key in raw:
            values[key] = read_value(_typed(parameter), raw[key], f"{where} {key}")
            warn_of_bare_numbers(parameter, raw[key], f"{where} {key}")
        elif parameter.default is None:
            raise mismatch(f"{where} {key}", expectation(_typed(parameter)), "nothing")
        else:
            values[key] = parameter.default
    return values


def read_tables(raw: Any, where: str, what: str) -> Mapping[str, Any]:
    """Return a table of tables.

    Raises
    ------
    InputError
        If it is none, or empty.
    """
    if not isinstance(raw, Mapping) or not raw:
        found = "an empty one" if isinstance(raw, Mapping) else show(raw)
        raise mismatch(where, f"a table of {what}", found)
    return raw


def read_set(raw: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the values that the table `set` of a table gives to parameters.

    Raises
    ------
    InputError
        If it is no table, or names something of the job's head.
    """
    values = raw.get("set", {})
    if not isinstance(values, Mapping):
        raise mismatch(f"{where} set", "a table", show(values))
    for key in values:
        if key in HEADER:
            raise mismatch(f"{where} set {key}", "a parameter", f"the job's {key}")
    return dict(values)


def _typed(parameter: Parameter) -> Parameter:
    """Return a declaration without a default as that of a text, where it has no unit."""
    if parameter.default is None and not parameter.unit:
        return Parameter("", "", parameter.description)
    return parameter
