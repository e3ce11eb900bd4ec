"""Parameters in words: the models, the keys of one, and a commented job file to begin with.

Jobs, notebooks and batch files come with the program, to be copied and changed.
"""

import json
import math
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path, PurePosixPath
from textwrap import TextWrapper

import cvt_hpc
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.job.loading import build_job, read_name
from cvt_hpc.job.schema import Schema, load_schema
from cvt_hpc.job.units import to_si
from cvt_hpc.job.values import angle_in_words, in_words, kind_of
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.parameters import Parameter
from cvt_hpc.storage.files import written_aside
from cvt_hpc.tables import columns

_SHARE = "share/cvt_hpc/"  # where an installed package has them
_QUOTED = re.compile(r"\"([\w./-]+)\\?\"")  # in notebooks the marks are escaped
_NAMED = re.compile(r"[\w./-]+\w")  # in batch files, from the folder above theirs

# Axes that a study varies first, where the model knows them: load as a share of the load that friction
# carries, its gradient
_FIRST_AXES = {"load_share": (0.2, 0.4, 0.6), "friction_gradient": None}
_SHARES = (0.5, 1.0, 1.5)  # of the default, else
# Both as a map, where that takes no longer than this [core-s]
_LOADS, _LONGEST_MAP = "load_share = { from = 0.1, to = 0.9, count = 9 }", 5.0
# Values of a first study where defaults show nothing, in a minute of a core; in braces: its axes
_FIRST_STUDIES = {
    # the mass vibrates, at 500 Hz, where damping is less than the normal load times the fall of friction
    "oscillator": {
        "friction_gradient": '{ from = "-1 s/m", to = "-0.1 s/m", count = 10 }',
        "damping": '{ from = "0 N s/m", to = "90 N s/m", count = 10 }',
        "belt_speed": '"50 mm/s"',
        "normal_load": '"300 N"',
        "start": '"sliding"',
        "initial_displacement": '"10 um"',
        "stiffness": '"10 kN/mm"',
        "friction_law": '"stribeck"',
    },
    # a slow slip feeds the vibration where damping and memory of friction do not outweigh its fall
    "criterion": {
        "friction_gradient": '{ from = "-1 s/m", to = "-0.1 s/m", count = 10 }',
        "radial_speed": '{ from = "20 mm/s", to = "200 mm/s", count = 10 }',
    },
    # the load that a belt carries, by the formula, which takes no time
    "slip_limit": {
        "thrust": '{ from = "20 kN", to = "60 kN", count = 5 }',
        "ratio": "{ from = 1, to = 2.5, count = 4 }",
        "method": '"formula"',
    },
    # which load slips by which tension
    "belt_drive": {
        "load": '{ from = "5 N m", to = "30 N m", count = 6 }',
        "tension": '{ from = "200 N", to = "400 N", count = 5 }',
    },
    # where falling friction has the strands vibrate: a coarser belt and short runs, which do for that
    "pushbelt": {
        "load_share": "{ from = 0.2, to = 0.8, count = 3 }",
        "friction_gradient": '{ from = "-0.9 s/m", to = "-0.1 s/m", count = 3 }',
        "rise_time": '"60 ms"',
        "elements": "216",
        "duration": '"0.2 s"',
        "longest_duration": '"0.2 s"',
    },
}
# Without unit, and of effect in each model that knows them: friction, and the tilt of the collars
_FIRST_UNCERTAIN = ("kinetic_friction", "tilt_factor")
_LONGEST = 120  # letters of a line
# Units in which engineers give a size, by SI unit: each from a magnitude [SI] on, the largest first
CUSTOMARY = {
    "m": ((1.0, "m"), (1e-4, "mm"), (1e-9, "um")),
    "s": ((0.1, "s"), (1e-4, "ms"), (1e-9, "us")),
    "m/s": ((0.1, "m/s"), (1e-9, "mm/s")),
    "N": ((1e3, "kN"),),
    "N m": ((1e4, "kN m"),),
    "N m/rad": ((1e4, "kN m/rad"),),
    "N/m": ((1e6, "kN/mm"), (1e4, "kN/m")),
    "N/m^2": ((1e9, "kN/mm^2"), (1e6, "N/mm^2")),
    "Pa": ((1e9, "GPa"), (1e6, "MPa")),
    "Hz": ((1e4, "kHz"),),
}


def model_lines() -> list[str]:
    """Return a line for each model: its name and title."""
    return list(columns([(name, load_model(name).title) for name in sorted(MODELS)]))


def key_lines(model: str) -> list[str]:
    """Return the parameters of a model that a job may set: tables, keys, defaults, units, choices, meanings.

    Raises
    ------
    InputError
        If there is no such model.
    """
    schema = load_schema(model, None, "models")
    loaded = load_model(model)
    lines = [f"{model}: {loaded.title}"]
    if loaded.steppers:
        lines.append(f"steppers: {', '.join(loaded.steppers)} (default: {schema.stepper})")
    for section, table in schema.sections.items():
        rows = [(key, _default_in_words(parameter), _meaning(parameter)) for key, parameter in table.items()]
        lines += ["", f"[{section}]", *columns(rows)]
    return lines


def job_template(name: str, model: str, source: str) -> str:
    """Return a job file of a model in which each key stands commented out, with its default and meaning.

    As it stands it is a small study along one axis, or along two if its runs are cheap; all else is at its
    default, but for models whose defaults show nothing. `name` is also that of its output folder, `source`
    the command that needs it, for the error.

    Raises
    ------
    InputError
        If the name is no word, there is no such model, or `cvt-hpc run` has no use for it.
    """
    read_name({"name": name}, source)
    schema = load_schema(model, None, source)
    loaded = load_model(model)
    if not loaded.is_recorded:
        raise mismatch(f"{source}: model", "a model whose runs are recorded", f"{model}, for charts alone")
    axes = [_axis(schema, [key for key in _FIRST_AXES if key in schema.parameters])]
    known = schema.parameters
    if _FIRST_AXES.keys() <= known.keys() and _may_be_varied(known["friction_gradient"]):
        grid = [_LOADS, _axis(schema, ["friction_gradient"])]
        job = build_job({"name": name, "model": model, "axes": tomllib.loads("\n".join(grid))})
        cost = loaded.cost(job.point(0), job.stepper) / loaded.lanes(job.parameters, job.stepper)
        axes = grid if cost * job.size <= _LONGEST_MAP else axes
    first = _FIRST_STUDIES.get(model, {})
    axes = [f"{key} = {value}" for key, value in first.items() if value[0] == "{"] or axes
    changed = {key: value for key, value in first.items() if value[0] != "{"}
    lines = [
        *_commented(f"A study with the model {model}: {loaded.title}"),
        "# Each key stands here with its default: take away the # to change it. Defaults that no paper gives",
        f"# are assumptions. `cvt-hpc check {name}.toml` shows what this file does and what it costs,",
        f"# `cvt-hpc run {name}.toml` does it, and `cvt-hpc map out/{name}` draws the result.",
        "",
        f'name = "{name}"',
        f'model = "{model}"',
        'description = ""',
    ]
    if loaded.steppers:
        lines += [*_commented(f"steppers: {', '.join(loaded.steppers)}"), f'# stepper = "{schema.stepper}"']
    lines += [
        "",
        "[axes]  # what the study varies: any key with a number or a choice",
        "# as a list of values, or as a range: { from = 1, to = 9, count = 5 }, or step = 2 for count",
        *axes,
        "",
        "# Uncertain parameters: maps have probabilities, `cvt-hpc plot sensitivity` tells which decides.",
        "# `cvt-hpc friction` and `calibrate` write such a table from measurements. Take away all # below:",
        "# [uncertain]",
        "# samples = 64  # of each cell, a power of 2",
        *(
            f'# {key} = {{ distribution = "normal", mean = {mean}, standard_deviation = {0.1 * mean:g} }}'
            for key, mean in ((key, known[key].default) for key in _FIRST_UNCERTAIN if key in known)
        ),
    ]
    for section, table in schema.sections.items():
        lines += ["", f"[{section}]"]
        for key, parameter in table.items():
            line = f"# {key} = {_as_toml(parameter)}"
            if key in changed:
                line = f"{key} = {changed[key]}  # assumed, in place of {_as_toml(parameter)}"
            lines += [*_commented(_meaning(parameter)), line]
    return "\n".join(lines) + "\n"


def write_template(name: str, model: str) -> Path:
    """Write a `job_template` to the file NAME.toml of this folder, and return its path.

    Raises
    ------
    InputError
        As of `job_template`, or if there is a file of this name or it cannot be written.
    """
    text = job_template(name, model, "init")
    path = Path(f"{name}.toml")
    if os.path.lexists(path):
        raise mismatch(str(path), "a name that is free", "a file of this name")
    with written_aside(path) as aside:
        aside.write_text(text)
    return path


def _meaning(parameter: Parameter) -> str:
    choices = f" ({', '.join(parameter.choices)})" if parameter.choices else ""
    return parameter.description + choices


def _default_in_words(parameter: Parameter) -> str:
    if parameter.default is None:
        return f"none {parameter.unit}".rstrip()
    in_customary = angle_in_words(parameter.default, parameter.unit) if kind_of(parameter) is float else ""
    return in_words(parameter.default, parameter.unit) + (f" ({in_customary})" if in_customary else "")


def _commented(text: str) -> list[str]:
    """Return a text as lines of a comment, broken between words."""
    wrapper = TextWrapper(_LONGEST, "# ", "# ", break_long_words=False, break_on_hyphens=False)
    return wrapper.wrap(text)


def _as_toml(parameter: Parameter) -> str:
    """Return the default as a job file writes it: read again it is the same value to the last digit."""
    value, unit = parameter.default, parameter.unit
    if value is None:
        return f'"... {unit}"' if unit else "..."
    if not isinstance(value, float):
        return json.dumps(value)  # of these TOML has the same form
    if not unit or not math.isfinite(value):
        return repr(value)
    near, *others = _in_customary(value, unit), in_words(value, unit), f"{value!r} {unit}"
    text = next(text for text in (near, *others) if text and to_si(text, unit) == value)
    return f'"{text}"' if text == near or not near else f'"{text}"  # {near}'


def _in_customary(value: float, unit: str) -> str:
    """Return a number [unit] as engineers give it, rounded for people; "" where that is the SI unit."""
    wanted = next((other for least, other in CUSTOMARY.get(unit, ()) if least <= abs(value)), "")
    if not wanted:
        return angle_in_words(value, unit) or ("0 rpm" if unit == "rad/s" else "")
    return in_words(value, unit, wanted)


def _axis(schema: Schema, preferred: Sequence[str]) -> str:
    """Return a line with the axis of a first study: given values of a key, or some about its default."""
    known = schema.parameters
    key = next(key for key in (*preferred, *known) if _FIRST_AXES.get(key) or _may_be_varied(known[key]))
    unit = known[key].unit
    values = _FIRST_AXES.get(key) or [share * known[key].default for share in _SHARES]
    texts = (_in_customary(value, unit) or in_words(value, unit) for value in values)
    items = (f'"{text}"' if unit else text for text in texts)
    return f"{key} = [{', '.join(items)}]"


def _may_be_varied(parameter: Parameter) -> bool:
    """Whether all shares of the default are legal and differ."""
    default = parameter.default
    if not isinstance(default, float) or not math.isfinite(default) or default == 0.0:
        return False
    low, high = sorted((_SHARES[0] * default, _SHARES[-1] * default))
    return parameter.minimum < low and high < parameter.maximum


def example_files() -> dict[str, Path]:
    """Return the examples by their names, such as "jobs/quickstart.toml".

    Those of an installed package are among its files; those of a checkout are where its pyproject.toml lists
    them.

    Raises
    ------
    InputError
        If there are none.
    """
    root = Path(cvt_hpc.__file__).parents[1]
    if (settings := root / "pyproject.toml").is_file():
        kept = tomllib.loads(settings.read_text("utf-8"))["tool"]["setuptools"]["data-files"]
        patterns = [pattern for listed in kept.values() for pattern in listed]
        paths = {path for pattern in patterns for path in root.glob(pattern) if path.is_file()}
        files = {path.relative_to(root).as_posix(): path for path in paths}
    else:
        installed = [file for file in metadata.files("cvt_hpc") or () if file.suffix != ".pyc"]
        named = {file.as_posix().partition(_SHARE)[2]: Path(str(file.locate())) for file in installed}
        files = {name: path for name, path in named.items() if name}
    if not files:
        raise mismatch("examples", f"those of a wheel, or of a checkout in {root}", "none")
    return dict(sorted(files.items()))


def example_lines() -> Iterator[str]:
    """Yield a line for each example that somebody runs: its name, and what it is about."""
    shown = {name: path for name, path in example_files().items() if path.suffix not in (".csv", ".nc")}
    yield from columns([(name, _subject(path)) for name, path in shown.items()], indent="")


def copy_examples(names: Sequence[str], out: Path) -> list[Path]:
    """Copy examples, with the files that they read, to their places below a folder, and return the copies.

    Each is named as of `example_files`, or by a folder, or by the last part of either, with or without its
    suffix. The folder is made if needed.

    Raises
    ------
    InputError
        If there is no such example, a copy would replace another file, or the system refuses.
    """
    known = example_files()
    chosen = dict.fromkeys(name for word in names for name in _named(word, known))
    chosen |= dict.fromkeys(other for name in chosen for other in _read_by(name, known))
    copies = {name: out / name for name in chosen}
    for name, path in copies.items():
        if os.path.lexists(path) and not _is_copy(path, known[name]):
            raise mismatch(str(path), "a place that is free", "a file", "choose another folder by --out")
    for name, path in copies.items():
        with written_aside(path, parents=True) as aside:
            aside.write_bytes(known[name].read_bytes())
    return list(copies.values())


def _is_copy(path: Path, example: Path) -> bool:
    """Whether a file is an example as it came, such as one that two notebooks read."""
    return path.is_file() and not path.is_symlink() and path.read_bytes() == example.read_bytes()


def _named(word: str, known: Mapping[str, Path]) -> list[str]:
    """Names of the examples that a word means."""
    word = word.rstrip("/")
    found = [
        name
        for name in known
        for place in [PurePosixPath(name)]
        if word in (name, place.name, place.stem, str(place.with_suffix("")))
        or any(word in (str(folder), folder.name) for folder in list(place.parents)[:-1])
    ]
    if not found:
        stems = dict.fromkeys(PurePosixPath(name).stem for name in known)
        raise unknown(f"examples: {word}", "example", word, stems, "`cvt-hpc examples` lists them")
    return found


def _read_by(name: str, known: Mapping[str, Path]) -> Iterator[str]:
    """Names of the other examples that a job, a notebook, a program or a batch file reads."""
    if known[name].suffix == ".sbatch":
        yield from (word for word in _NAMED.findall(known[name].read_text()) if word in known)
    if known[name].suffix not in (".toml", ".ipynb", ".py"):
        return
    for word in _QUOTED.findall(known[name].read_text()):
        other = os.path.normpath(PurePosixPath(name).parent / word)
        if other in known:
            yield other


def _subject(path: Path) -> str:
    """Return the subject of an example, the first sentence of its first line."""
    text = path.read_text()
    if path.suffix == ".toml":
        return str(tomllib.loads(text).get("description", ""))
    if path.suffix == ".ipynb":
        text = "".join(json.loads(text)["cells"][0]["source"])
    lines = (line.strip('#" \n') for line in text.splitlines() if not line.startswith("#!"))
    return next(filter(None, lines), "").partition(". ")[0]
