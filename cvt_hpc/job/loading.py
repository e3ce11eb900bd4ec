"""From a job file to a job: the head, the tables, the axes and the overrides, each checked in turn."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from cvt_hpc.errors import InputError, did_you_mean, mismatch, show
from cvt_hpc.experiment_kinds import with_table
from cvt_hpc.job import assignments
from cvt_hpc.job.assignments import Assignments, plain
from cvt_hpc.job.axes import SAMPLE, Axes, read_axis
from cvt_hpc.job.course_files import check_gaps, check_range
from cvt_hpc.job.crosscheck import check_grid, check_rules
from cvt_hpc.job.csv_files import BARE, FileValues, read_csv
from cvt_hpc.job.definition import HEADER, Job, answering_model, handed_to
from cvt_hpc.job.design import (
    ADAPTIVE,
    KEY,
    KEYS_OF_A_DESIGN,
    Design,
    check_adaptive,
    read_design,
    read_histories,
    resolve_spacing,
    sampled_axes,
)
from cvt_hpc.job.document import read_document
from cvt_hpc.job.netcdf_files import SUFFIX as NETCDF
from cvt_hpc.job.netcdf_files import read_netcdf
from cvt_hpc.job.rules import (
    Link,
    Rule,
    follow,
    ordered_rules,
    overridden,
    read_derived,
    read_linked,
    relinked,
)
from cvt_hpc.job.schema import Entry, Schema, load_schema
from cvt_hpc.job.signal_files import MAT, MDF, read_signals
from cvt_hpc.job.summary import tell_of_no_effect
from cvt_hpc.job.uncertain import TABLE, with_samples
from cvt_hpc.job.uncertain_table import SETTINGS, check_limits, read_uncertain
from cvt_hpc.job.units import unit_in
from cvt_hpc.job.values import (
    Document,
    Point,
    Table,
    Units,
    check_usual,
    expectation,
    kind_of,
    read_value,
    warn_of_bare_numbers,
)
from cvt_hpc.models.contract import load_model
from cvt_hpc.parameters import Parameters

_READERS = {NETCDF: read_netcdf, MAT: read_signals, MDF: read_signals}  # by suffix; others are CSV
_TABLES = {"design": KEYS_OF_A_DESIGN, TABLE: SETTINGS}  # whose keys --set has to name with the table
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def load_job(path: str | Path, overrides: Assignments = ()) -> Job:
    """Read and validate a job file, and return it with every default resolved.

    Parameters
    ----------
    path : str or Path
        A TOML file.
    overrides : mapping, or sequence of "KEY=VALUE"
        Values that replace those of the file. One value for an axis replaces the axis by that value; a list
        or a range, as a table [axes] has it, makes an axis or replaces one.

    Raises
    ------
    InputError
        If anything is wrong with the file or an override.
    """
    return build_job(read_document(Path(path)), str(path), overrides)


def build_job(
    document: Table, source: str = "build_job", overrides: Assignments = (), label: str | None = None
) -> Job:
    """Validate a job that is given as a dict; result, overrides and errors as of `load_job`.

    Parameters
    ----------
    document : mapping
        Tables and values as TOML gives them. An axis may also be a 1-D array of numpy, pandas, xarray or
        pint, and a table of coefficients a 2-D one; units of pint, and attributes `units`, count.
    source : str
        Where it is from, for the errors: for a job of a file its path.
    label : str, optional
        Name of the overrides in an error; by default after their origin.
    """
    return rebuild_job(document, source, None, overrides, label)


def stored_job(document: Table, source: str) -> Job:
    """Return the job that a dataset holds, without keys of other versions; errors as of `build_job`."""
    schema = load_schema(document.get("model"), document.get("stepper"), source)
    known = {
        name: {key: value for key, value in table.items() if key in schema.parameters}
        for name, table in document.items()
        if name in schema.sections and isinstance(table, Mapping)
    }
    return rebuild_job({**document, **known}, source, {})


def rebuild_job(
    document: Table, source: str, units: Units | None, overrides: Assignments = (), label: str | None = None
) -> Job:
    """Return the job of a document whose numbers are SI values of another job, and draw no warning.

    Parameters
    ----------
    document, source, overrides, label
        As of `build_job`, errors too.
    units : mapping or None
        Units for people: those of the other job. None: the document is a user's own, as of `build_job`.
    """
    document = plain(document)
    label = label or ("override" if isinstance(overrides, Mapping) else "--set")
    pairs = assignments.split_assignments(overrides, source, label)
    head = {**document, **{key: value for key, value in pairs.items() if key in HEADER}}
    name, description = read_name(head, source), head.get("description", "")
    if not isinstance(description, str):
        raise mismatch(f"{source}: description", "a text", show(description))
    schema = load_schema(head.get("model"), head.get("stepper"), source)
    _check_top_level(document, schema, source)
    is_users = units is None
    written = _written(document, pairs, schema, source, label) if is_users else {}
    if units is None:
        units = {key: unit for key, entry in written.items() if (unit := unit_in(entry.raw))}
    schema = replace(schema, units=units)
    tables = _read_tables(document, schema, source)
    changed = assignments.take_own(pairs, "design")
    uncertain = {**document.get(TABLE, {}), **assignments.take_own(pairs, TABLE)}
    if is_uncertain := TABLE in document or bool(uncertain):
        schema = with_samples(schema, uncertain)
    others = {key: value for key, value in pairs.items() if key not in HEADER}
    for key in others:
        near = [f"{table}.{key}" for table, keys in _TABLES.items() if key in keys]
        if near and key not in schema.parameters:
            raise InputError(f"{source}: {label} {key}: unknown key; did you mean {' or '.join(near)}?")
    put_axes, replaced = assignments.read_axes_and_values(others, schema, source, label)
    design = read_design({**document.get("design", {}), **changed}, source)
    put = {*replaced, *put_axes}
    contents = _contents(replaced, schema, source)
    put |= {key for content in contents.values() for key in content.values}
    gone = {*put, *overridden(put, schema)}
    scatters: list[Rule] = []
    if is_uncertain:
        scatters, further, fixed = read_uncertain(uncertain, gone, schema, source)
        if not scatters:  # the job of the values that overrides give
            certain = {name: table for name, table in document.items() if name != TABLE}
            certain |= {"design": {**document.get("design", {}), **changed}}
            return rebuild_job(certain, source, None if is_users else units, pairs, label)
        tables |= fixed
        document = _with_samples(document, further, {*fixed, *gone}, design, source)
    given = {key: value for key, value in tables.items() if key not in gone} | replaced
    files = {key: name for key, name in given.items() if name and schema.parameters[key].file}
    contents |= _contents({key: name for key, name in given.items() if key not in contents}, schema, source)
    given = _with_files(given, contents, document.get("axes", {}), schema, source)
    axes, rules = _read_axes_and_rules(document, scatters, design, gone, put_axes, given, schema, source)
    if is_users:
        check_limits(rules, schema)
    for entry in written.values():
        warn_of_bare_numbers(*entry)
    if design.get("kind") == ADAPTIVE:
        check_adaptive(axes, source)
    if "first_spacing" in design:
        design = resolve_spacing(design, axes, source)
    scene = _resolve({**{axis.name: axis.values[0] for axis in axes}, **given}, rules, schema, source)
    sampled = "runs" in design
    check_rules(schema, scene, axes, rules, sampled=sampled)
    scene = follow(rules, scene)
    parameters = {key: scene[key] for key in schema.parameters if key in scene}
    swept = {axis.name for axis in axes}
    # keys linked to a former axis that an override set: each has one given value
    settled = {rule.key for rule in rules if isinstance(rule.source, Link) and rule.source.axis not in swept}
    own = [*given, *sorted(settled)]
    checked = own if is_users else ()
    without = check_grid(schema, parameters, axes, source, rules=rules, sampled=sampled, given=checked)
    tell_of_no_effect(schema, parameters, files, without, source)
    histories = document.get(KEY[0], {}).get(KEY[1], [])
    replacing = {key: replaced.get(key) for key in gone}
    kept = read_histories(histories, schema, axes, replacing, source, design.get("runs"))
    stated = tuple(rule for rule in rules if rule.key not in settled)
    told = {key: text for content in contents.values() for key, text in content.told.items()}
    runs = parameters, axes, frozenset(own), design, kept, stated, schema.units, files, told
    job = Job(name, schema.model, schema.stepper, description, source, *runs)
    answering = answering_model(job)
    if answering is not None:
        job = replace(rebuild_job(handed_to(job, *answering), source, job.units), files=files, told=told)
    return job


def _written(document: Table, pairs: Table, schema: Schema, source: str, label: str) -> dict[str, Entry]:
    """Return the entry of each number in the tables, the axes or the overrides, unchecked.

    If there are several, the one that takes precedence.
    """
    links = [(f"[linked.{axis}]", table) for axis, table in document.get("linked", {}).items()]
    tables = [(f"[{name}]", document.get(name, {})) for name in (*schema.sections, TABLE)]
    found = {}
    for place, table in [*tables, *links, ("[axes]", document.get("axes", {})), (label, pairs)]:
        for name, raw in schema.flatten(table) if isinstance(table, Mapping) else ():
            parameter = schema.parameters.get(key := name.rpartition(".")[2])
            if parameter is not None and kind_of(parameter) in (float, tuple):
                found[key] = Entry(parameter, assignments.structured(raw), f"{source}: {place} {name}")
    return found


def _contents(given: Parameters, schema: Schema, source: str) -> dict[str, FileValues]:
    """Return by key of each file among given values what it gives."""
    found = {}
    for key, name in given.items():
        if (file := schema.parameters[key].file) is None:
            continue
        where = f"{source}: [{schema.section_of[key]}] {key}"
        read = _READERS.get(Path(name).suffix.lower(), read_csv)
        content = read(file, name, source, where) if name else FileValues({}, {}, {}, {}, str)
        values = {one: read_value(schema.parameters[one], raw, where) for one, raw in content.values.items()}
        found[key] = content._replace(values=values, columns={})
        if rows := content.columns:
            courses = (column.values for one, column in rows.items() if one != "time")
            check_gaps(rows["time"].values, courses, content.units["time"], content.named)
        for one, value in values.items():
            parameter, unit = schema.parameters[one], content.units.get(one, "")
            unit = parameter.unit if unit in BARE else unit
            if one in rows:
                check_range(one, parameter, rows[one], unit, content.named)
            elif not rows:
                check_usual(parameter, value, unit, f"{where}: {name}: {one}")
    return found


def _with_files(
    given: Parameters, contents: Mapping[str, FileValues], axes: Table, schema: Schema, source: str
) -> Point:
    """Return given values, with the contents of files instead of their names; no axis may give the same."""
    found = {key: value for key, value in given.items() if key not in contents}
    for key, file_values in contents.items():
        content = file_values.values
        where = f"{source}: [{schema.section_of[key]}] {key}"
        for one in content:
            if one in found:
                raise mismatch(where, f"either {key} or {one}", "both")
        for one in (*found, *axes):
            declared = schema.parameters.get(one)
            if declared is not None and declared.gives is not None and declared.gives.key in content:
                raise mismatch(where, f"either {key}, which gives {declared.gives.key}, or {one}", "both")
        found |= content
    return found


def _with_samples(
    document: Table, further: Mapping[str, list], given: Collection[str], design: Design, source: str
) -> Document:
    """Return a document with the axes of the samples, the last ones, unless they are given otherwise."""
    where, axes = f"{source}: [{TABLE}]", document.get("axes", {})
    if "runs" in design:
        expected = "a grid or a trace, each cell of which has its samples"
        raise mismatch(where, expected, f"a design of kind {show(design['kind'])}")
    if SAMPLE not in {*further, *axes, *given}:
        raise mismatch(f"{where} samples", "the number of samples", "nothing")
    if twice := [name for name in further if name in axes]:
        raise mismatch(f"{where} samples", f"either samples or an axis {twice[0]}", "both")
    return {**document, "axes": {**axes, **further}}


def _read_axes_and_rules(
    document: Table,
    scatters: Sequence[Rule],
    design: Design,
    gone: Collection[str],
    put: Mapping[str, Entry],
    given: Collection[str],
    schema: Schema,
    source: str,
) -> tuple[Axes, list[Rule]]:
    """Return the axes and the rules in their order, `scatters` among them.

    Those that overrides have put out of force are `gone`; the axes that they `put` come in their place.
    """
    of_file = _find_axes(document.get("axes", {}), schema, source)
    kept = {key: entry for key, entry in of_file.items() if key not in gone or key in put}
    kept |= put
    sampled = "runs" in design
    axes = sampled_axes(kept, design, source) if sampled else _read_grid(kept)
    linked = document.get("linked", {})
    if linked and sampled:
        expected = "a grid, since samples have no values to be linked to; a formula in [derived] follows them"
        raise mismatch(f"{source}: [linked]", expected, f"a design of kind {show(design['kind'])}")
    stated = read_derived(document.get("derived", {}), schema, source)
    # a link has a value for each of the file's axis, and keeps the values that are left of it
    stated += [] if sampled else read_linked(linked, _read_grid(of_file), schema, source)
    stated = relinked([rule for rule in [*stated, *scatters] if rule.key not in gone], axes)
    return axes, ordered_rules(stated, {*given, *(axis.name for axis in axes)}, schema, source)


def read_name(head: Table, source: str) -> str:
    """Return the name of a job, which is also that of its output folder; InputError where it is no word."""
    name = head.get("name")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        expected = "a word of letters, digits, '.', '_' and '-' (it names the output folder)"
        raise mismatch(f"{source}: name", expected, show(name))
    return name


def _check_top_level(document: Table, schema: Schema, source: str) -> None:
    tables = [*_sections(document, schema), "axes", "design", "derived", "linked", TABLE]
    for key, value in document.items():
        if key in HEADER:
            continue
        if key in tables:
            if not isinstance(value, Mapping):
                raise mismatch(f"{source}: {key}", f"a table [{key}]", show(value))
        elif key in with_table():
            raise InputError(f"{source}: [{key}]: expected a job of runs, found one for `cvt-hpc {key}`")
        elif isinstance(value, Mapping):
            hint = did_you_mean(key, tables) or f"; known: {', '.join(tables)}"
            raise InputError(f"{source}: [{key}]: unknown table{hint}")
        elif home := schema.section_of.get(key):
            raise InputError(f"{source}: {key}: belongs in [{home}], found above all tables")
        else:
            hint = did_you_mean(key, HEADER) or schema.nearest(key) or f"; known: {', '.join(HEADER)}"
            raise InputError(f"{source}: {key}: unknown key{hint}")


def _sections(document: Table, schema: Schema) -> list[str]:
    """Return the tables of parameters; without a transient that of kept histories may join them."""
    sections = list(schema.sections)
    if KEY[0] in document and KEY[0] not in sections and load_model(schema.model).has_histories:
        sections.append(KEY[0])
    return sections


def _read_tables(document: Table, schema: Schema, source: str) -> Document:
    values = {}
    for section in _sections(document, schema):
        pairs = ((name, raw) for name, raw in document.get(section, {}).items() if (section, name) != KEY)
        for key, entry in schema.entries(pairs, f"{source}: [{section}]", section):
            values[key] = read_value(*entry)
    return values


def _find_axes(table: Table, schema: Schema, source: str) -> dict[str, Entry]:
    """Return the entry of each key in the file's table [axes]."""
    found: dict[str, Entry] = {}
    for key, entry in schema.entries(schema.flatten(table), f"{source}: [axes]"):
        if key in found:
            raise mismatch(entry.where, "one axis for a parameter", f"a second one for {key}")
        found[key] = entry
    return found


def _read_grid(entries: Mapping[str, Entry]) -> Axes:
    return tuple(read_axis(key, *entry) for key, entry in entries.items())


def _resolve(values: Parameters, rules: Sequence[Rule], schema: Schema, source: str) -> Document:
    """Return the value of every key that has one and does not follow from others."""
    follows = {rule.key for rule in rules}
    giving = {rule.needs[0] for rule in rules if rule.is_substituted}
    resolved = {}
    for key, parameter in schema.parameters.items():
        where = f"{source}: [{schema.section_of[key]}] {key}"
        if key in values:
            resolved[key] = values[key]
        elif key in follows or parameter.file or (parameter.gives and key not in giving):
            continue
        elif parameter.default is None:
            raise mismatch(where, expectation(parameter), "nothing")
        else:
            resolved[key] = read_value(parameter, parameter.default, where)
    return resolved
