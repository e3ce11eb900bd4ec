"""Stored tables of jobs/results: what each tells of itself and rests on, and what of that has changed."""

import ast
import csv
import hashlib
import math
import re
import subprocess
import tomllib
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.experiment_kinds import EXPERIMENTS
from cvt_hpc.kernels.identity import code_digest
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.steppers import STEPPERS
from cvt_hpc.tables import below_origin

ROOT = Path(__file__).resolve().parents[1]
# lines on top of a table
MADE_BY, COST, OLDER, CONFIRMED = "made by", "cost", "older than the code", "confirmed at"
UNKNOWN, DIRTY, STORED = "unknown revision", "dirty revision", "revision of storing it"

# Rooms of the package that compute, or judge what was computed: numbers depend on no other.
COMPUTING = {"models", "variator", "steppers", "multibody", "solvers", "lanes", "physics", "vibration"}
COMPUTING |= {"simulation", "experiments", "recording.py", "linear_algebra.py"}


@dataclass
class Table:
    """A stored table: its file, what its first lines tell, of each kind one, and its cells by column."""

    path: Path
    told: dict[str, str]
    rows: list[dict[str, str]]

    @property
    def name(self):
        """Path below jobs/results, without its ending."""
        return str(self.path.relative_to(ROOT / "jobs" / "results").with_suffix(""))

    @property
    def made_by(self):
        """Commands that make it."""
        return self.told[MADE_BY]

    @property
    def runs(self):
        """Commands before the first `&&`: tables that begin with the same share the folder of runs."""
        return self.made_by.partition("&&")[0]

    @property
    def seconds(self):
        """Core-seconds of each run that is done, where they are told."""
        done = [row for row in self.rows if row.get("status") != "not_run"]
        return [float(row["core_seconds"]) for row in done if "core_seconds" in row]

    @property
    def cost(self):
        """Core-seconds of making it, else of its runs; infinite where neither is told."""
        return float(self.told[COST].split()[0]) if COST in self.told else sum(self.seconds or [math.inf])

    @property
    def revisions(self):
        """Revisions whose code gives it, as told."""
        return re.findall(r"\b[0-9a-f]{40}\b", self.told.get(CONFIRMED, self.told.get("revision", "")))

    @cached_property
    def doubts(self):
        """What is open of its revision, in words."""
        told, known = self.told.get("revision", ""), [*map(is_known, self.revisions)]
        words = {UNKNOWN: not known or not all(known), DIRTY: "-dirty" in told, STORED: told[:6] == "stored"}
        return [word for word, holds in words.items() if holds]

    @cached_property
    def changed(self):
        """What it rests on and has changed since its known revisions, sorted."""
        known = [revision for revision in self.revisions if is_known(revision)]
        return sorted(path for path in rests_on(self.made_by) if any(differs(path, r) for r in known))

    @property
    def is_stale(self):
        """Whether it may be another one than today's code gives."""
        return bool(self.changed or {UNKNOWN, DIRTY} & {*self.doubts})

    @property
    def state(self):
        """Age in words."""
        modules = sum(path.suffix == ".py" for path in rests_on(self.made_by))
        names = [path.name for path in self.changed if path.suffix != ".py"]
        if code := len(self.changed) - len(names):
            names.insert(0, f"{code} of {modules} modules")
        age = [f"older than {', '.join(names)}"] if names else ["as the code"] * (UNKNOWN not in self.doubts)
        return "; ".join([*age, *self.doubts])


def read(path):
    """Read a stored table; InputError if it does not tell how it is made."""
    lines = path.read_text(encoding="utf-8").splitlines()
    told = {}
    for line in lines[: lines.index(next(below_origin(lines), ""))]:
        name, _, text = line.removeprefix("# ").partition(": ")
        told.setdefault(name, text)
    if "$TABLE" not in told.get(MADE_BY, ""):
        raise mismatch(str(path), f"a line `# {MADE_BY}: COMMANDS`, which write $TABLE", "none")
    return Table(path, told, list(csv.DictReader(below_origin(lines))))


def tables(names=()):
    """Return tables by name, by default all, the cheapest first."""
    folder = ROOT / "jobs" / "results"
    paths = {str(path.relative_to(folder).with_suffix("")): path for path in sorted(folder.rglob("*.csv"))}
    for name in names:
        if name not in paths:
            raise unknown(name, "table", name, paths)
    return sorted((read(paths[name]) for name in names or paths), key=lambda table: table.cost)


# What a table rests on


@cache
def rests_on(made_by):
    """Return the files on which the numbers of a table depend, by the commands that make it."""
    found, left, package = set(), named(made_by, ROOT), ROOT / "cvt_hpc"
    for command in re.findall(r"cvt-hpc (\w+)", made_by):
        left |= modules(EXPERIMENTS[command].module) if command in EXPERIMENTS else set()
    while left:
        found.add(path := left.pop())
        left |= needs(path) - found
    computing = {path for path in found if package not in path.parents or computes(path)}
    return computing | (modules("cvt_hpc.papers") if "cvt-hpc figure" in made_by else set())


def computes(path):
    """Whether a file is of a room of the package that computes."""
    place = path.relative_to(ROOT).parts
    return place[0] == "cvt_hpc" and place[1] in COMPUTING


@cache
def needs(path):
    """Return the files that a file imports or names."""
    text = path.read_text(encoding="utf-8") if path.suffix in (".py", ".sh", ".toml") else ""
    if path.suffix == ".toml":
        return of_words({*texts(tomllib.loads(text))}, path.parent) | modules("cvt_hpc.simulation")
    if path.suffix != ".py":
        return named(text, path.parent)
    found, words = set(), set()
    for node in ast.walk(ast.parse(text)):
        names = []
        if isinstance(node, ast.Import | ast.ImportFrom):
            module = getattr(node, "module", None)
            names = [f"{module}.{alias.name}" if module else alias.name for alias in node.names] + [
                module or ""
            ]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            words.add(node.value)
        places = {
            base / name.replace(".", "/") for name in names for base in (ROOT, ROOT / "tests", path.parent)
        }
        files = {file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")}
        found |= {file for file in files if file.is_file()}
    # models that scripts and experiments name
    by_name = ROOT / "cvt_hpc" not in path.parents or ROOT / "cvt_hpc" / "experiments" in path.parents
    return found | (of_words(words, ROOT / "jobs") if by_name else set())


def of_words(words, folder):
    """Return the modules of models and steppers among words, and the jobs, scripts and data of a folder."""
    names = [word for word in words if re.fullmatch(r"[\w./-]+[.](toml|nc|csv|py)", word)]
    found = {folder / name for name in names if (folder / name).is_file()}
    of_models = words & MODELS.keys()
    words = words | {getattr(load_model(model), "DEFAULT_STEPPER", None) for model in of_models}
    places = [*(MODELS[name] for name in of_models), *(STEPPERS[name] for name in words & STEPPERS.keys())]
    return found.union(*map(modules, places))


def texts(part):
    """Yield all texts of a document."""
    if isinstance(part, dict | list):
        for inner in part.values() if isinstance(part, dict) else part:
            yield from texts(inner)
    elif isinstance(part, str):
        yield part


def named(text, folder):
    """Return the files that lines of a shell name, from the root or a folder; `job=X` names jobs/X.toml."""
    code = re.sub(r"(?m)(^|\s)#.*", "", text)
    names = re.findall(r"[\w./-]+[.](?:py|sh|toml|nc)\b", code)
    names += [f"jobs/{name}.toml" for name in re.findall(r"(?m)^job=(\w+)", code)]
    return {base / name for name in names for base in (ROOT, folder) if (base / name).is_file()}


def modules(name):
    """Return the file of a module, or the files of a package."""
    place = ROOT / name.replace(".", "/")
    return {*place.glob("*.py")} or {place.with_suffix(".py")}


# What has changed since a revision


def git(*arguments):
    """Return what git tells about this repository, as bytes; InputError where it refuses."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True)
    if done.returncode:
        raise mismatch(str(ROOT), "a checkout of git", done.stderr.decode().strip())
    return done.stdout


@cache
def is_known(revision):
    """Whether this repository has a revision."""
    name = f"{revision}^{{commit}}"
    return not subprocess.run(["git", "cat-file", "-e", name], cwd=ROOT, capture_output=True).returncode


@cache
def objects(revision):
    """Return the names of the objects of a revision, by file."""
    lines = git("ls-tree", "-rz", revision).decode().split("\0")[:-1]
    return {ROOT / path: entry.split()[2] for entry, _, path in (line.partition("\t") for line in lines)}


def differs(path, revision):
    """Whether a file says something else to the machine than in a revision."""
    name, now = of_file(path)
    return objects(revision).get(path) != name and says(path, revision) != now


def says(path, revision):
    """What a file says to the machine in a revision; None where there is none."""
    name = objects(revision).get(path)
    return name and of_object(name, path.suffix)


@cache
def of_file(path):
    """The name that git gives a file's content, and what that says to the machine."""
    content = path.read_bytes()
    return hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest(), meaning(content, path.suffix)


@cache
def of_object(name, suffix):
    """What an object of git says to the machine."""
    return meaning(git("cat-file", "blob", name), suffix)


def meaning(content, suffix):
    """Return what a file says to the machine, of a program without its comments and docstrings."""
    if suffix == ".py":
        bodies = [(tree := ast.parse(content)).body]
        for body in bodies:  # those within it are appended
            if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
                body[0:1] = [] if body[1:] else [ast.Pass(lineno=1, col_offset=0)]
            within = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
            bodies += [node.body for node in body if isinstance(node, within)]
        return code_digest(compile(tree, "", "exec", dont_inherit=True))
    if suffix == ".toml":
        document = tomllib.loads(content.decode())
        document.pop("description", None)
        return repr(document)  # the order of axes counts
    if suffix == ".sh":
        return [line.strip() for line in content.decode().splitlines() if line.strip()[:1] not in ("", "#")]
    return content
