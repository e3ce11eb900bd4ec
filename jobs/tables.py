"""The stored tables of jobs/results: how old they are; make them again; compare some of their rows.

    python jobs/tables.py list [NAME ...]   # revision, date, cost, state; of a NAME what has changed since
    python jobs/tables.py make NAME ...     # from HEAD alone, cheapest first; --stale: all that are stale
    python jobs/tables.py confirm REVISION  # that HEAD computes the same, bit for bit; some twenty minutes
    python jobs/tables.py check             # some rows are computed again

A line `# made by: COMMANDS` on top of a table has the shell commands that write $TABLE, and keep what
they need in the folder $OUT. Pictures that they write as ${TABLE%.csv}.png, or with a word between, lie
beside it. A table is older than the code where anything that it rests on has changed since its revision:
its job, its scripts, its data, and the modules of its models, its steppers and its experiment, with all
that these import. Of the package, only rooms that compute count. Comments and docstrings do not count.
A table that was as the code at a revision, of which later code computes the same bits (`tests/bits.py`),
is as that code: a line `# confirmed at: REVISION` takes the place of making it again.

Exit status 1: a table could not be made, or a row differs; 2: bad input.
"""

import argparse
import ast
import csv
import datetime
import hashlib
import math
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise, takewhile
from pathlib import Path
from statistics import median

from cvt_hpc import load_job, open_results, run
from cvt_hpc.errors import InputError, mismatch, unknown
from cvt_hpc.experiment_kinds import EXPERIMENTS
from cvt_hpc.kernels.identity import code_digest
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.steppers import STEPPERS
from cvt_hpc.storage.files import written_aside
from cvt_hpc.tables import below_origin, columns

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "jobs"))
from tabulate import OF_A_BELT, rows  # noqa: E402

# lines on top of a table
MADE_BY, COST, OLDER, CONFIRMED = "made by", "cost", "older than the code", "confirmed at"
UNKNOWN, DIRTY, STORED = "unknown revision", "dirty revision", "revision of storing it"

# Rooms of the package that compute, or judge what was computed: numbers depend on no other.
COMPUTING = {"models", "variator", "steppers", "multibody", "solvers", "lanes", "physics", "vibration"}
COMPUTING |= {"simulation", "experiments", "recording.py", "linear_algebra.py"}

# How far a row may be from the stored one. Other lanes and other processors round otherwise. So runs that
# vibrate part within milliseconds, and what is recorded of them differs as between two random starts.
QUIET, MOVING = 0.01, 0.05  # of the largest value of the column, in runs that do not vibrate and that do
OF_VIBRATION = {"amplitude": 0.25, "lateral": 0.25, "frequency": 0.05}  # relative, in runs that vibrate
STILL = 0.5  # [um]: amplitude of a quiet run, a tenth of what vibrates
FREE = ("core_seconds", "power_residual", "step_ripple", "refinements", "time_step", "unsolved_share")
NOISE = ("frequency", "mode", "lateral")  # of a quiet run
ALWAYS = 0.5  # [core-s] of a run: tables of cheaper ones are in each check
STRIDE = 7919  # rows from turn to turn: prime, so that each is met


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


# The commands


def show(names):
    """Print what is known of tables."""
    found = tables(names)
    rows_of = [
        (table.name, *(name[:9] for name in table.revisions[:1] or [""]), table.told.get("date", "")[-10:],
         f"{table.cost:.0f}".replace("inf", ""), table.state)
        for table in found
    ]  # fmt: skip
    print(*columns([("table", "revision", "date", "core-s", "state"), *rows_of], ""), sep="\n")
    print(f"{sum(table.is_stale for table in found)} of {len(found)} are stale")
    for table in found if names else ():
        print(f"\n{table.name}: {table.made_by}")
        print(*(f"  {OLDER}: {text}" for text in [table.told.get(OLDER)] if text), sep="\n")
        print(*(f"  {path.relative_to(ROOT)} has changed" for path in table.changed), sep="\n")
    return 0


def make(names, stale):
    """Make tables again, the cheapest first, with the files of HEAD and no machine code; 1 if one fails."""
    wanted = [table for table in tables(names) if table.is_stale or not stale]
    refuse_uncommitted(wanted)
    failed, folder = [], Path(tempfile.mkdtemp())
    (tree := folder / "tree").mkdir()
    subprocess.run(["tar", "-x", "-C", tree], input=git("archive", "HEAD"), check=True)
    for table in wanted:
        why = made(table, folder)
        print(f"{table.name}: {why or 'made'}", flush=True)
        failed += [table.name] if why else []
    if failed:
        print(f"kept, with what its runs have left: {folder}")
    else:
        shutil.rmtree(folder)
    print(f"{len(wanted) - len(failed)} made" + f", not {', '.join(failed)}" * bool(failed))
    return int(bool(failed))


def refuse_uncommitted(wanted):
    """Raise InputError where a table rests on what is not committed."""
    for table in wanted:
        if later := sorted(path for path in rests_on(table.made_by) if differs(path, "HEAD")):
            files = ", ".join(str(path.relative_to(ROOT)) for path in later)
            raise mismatch(table.name, "all that it rests on as in HEAD", f"changes of {files}")


def made(table, work):
    """Replace a table by one that is made with the files of a folder; why it cannot be made, or ""."""
    runs = table.made_by.partition("&&")[0]  # tables of the same runs share their folder
    target = work / "table.csv"
    for earlier in work.glob("table*"):
        earlier.unlink()
    environment = os.environ | {
        "OUT": str(work / hashlib.sha256(runs.encode()).hexdigest()[:16]), "TABLE": str(target),
        "PYTHONPATH": str(work / "tree"), "NUMBA_CACHE_DIR": str(work / "kernels"), "OMP_NUM_THREADS": "1",
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }  # fmt: skip
    before, shell = spent(), ["bash", "-euo", "pipefail", "-c", table.made_by]
    told = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    done = subprocess.run(shell, cwd=work / "tree", env=environment, **told)
    if done.returncode:
        return f"exit status {done.returncode}: {''.join(done.stdout.strip().splitlines()[-1:])}"
    lines = target.read_text(encoding="utf-8").splitlines() if target.is_file() else []
    cells = list(csv.reader(below_origin(lines)))
    if len(cells) < 2 or any(len(row) != len(cells[0]) for row in cells):
        return f"expected a table of whole rows, found {len(cells)} lines"
    *origin, head = lines[: len(lines) - len(cells) + 1]
    begins = next((k for k, line in enumerate(origin) if line.startswith("# revision: ")), 0)
    origin = origin[begins:] + origin[:begins]  # what else is told comes behind
    # of the commands of its runs, which name folders of here, the first place has what makes all of it
    ours = [k for k, line in enumerate(origin) if line.startswith("# command: ")]
    origin = [line for k, line in enumerate(origin) if k not in ours[1:]]
    origin[ours[0]] = f"# {MADE_BY}: {table.made_by}"
    origin += [f"# {COST}: {spent() - before:.0f} core-s, with compiling"]
    with written_aside(table.path) as aside:
        aside.write_text(
            "\n".join([*origin, head, *lines[len(lines) - len(cells) + 1 :], ""]), encoding="utf-8"
        )
    for picture in work.glob("table*.png"):
        with written_aside(table.path.with_name(picture.name.replace("table", table.path.stem, 1))) as aside:
            shutil.copyfile(picture, aside)
    return ""


def confirm(revision):
    """Tell in tables that were as the code at a revision that HEAD computes its bits; 1 if it does not."""
    head, found = git("rev-parse", "HEAD").decode().strip(), []
    gone = {path for path in objects(revision) if computes(path) and not path.exists()}
    for table in (table for table in tables() if table.changed and not {UNKNOWN, DIRTY} & {*table.doubts}):
        paths = rests_on(table.made_by)
        was = all(says(p, r) == says(p, revision) for p in paths | gone for r in table.revisions)
        # what the comparison of bits does not run, such as scripts, has to be the same
        if was and not any(differs(path, revision) for path in paths if not computes(path)):
            found.append(table)
    refuse_uncommitted(found)
    if subprocess.run([sys.executable, "tests/bits.py", revision, head], cwd=ROOT).returncode:
        return 1
    for table in found:
        first, *lines = table.path.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [line for line in lines if not line.startswith(f"# {CONFIRMED}: ")]
        with written_aside(table.path) as aside:
            aside.write_text("".join([first, f"# {CONFIRMED}: {head}\n", *kept]), encoding="utf-8")
    print(f"{len(found)} confirmed: {', '.join(table.name for table in found)}")
    return 0


def spent():
    """Processor time [s] of processes that this one has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def check(turn, seconds):
    """Compare rows, of cheap tables first, then of others in turn; 1 if one differs of no older table."""
    studies = []
    for table in tables():
        done = [place for place, row in enumerate(table.rows) if row.get("status") == "done"]
        if done and table.seconds and (study := study_of(table.made_by)):  # not of cells of many runs
            studies.append((median(table.seconds), table, study, done[turn * STRIDE % len(done)]))
    cheap = [entry for entry in studies if entry[0] <= ALWAYS]
    dear = [entry for entry in studies if entry[0] > ALWAYS]
    first, begun, status = turn % max(len(dear), 1), time.process_time(), 0
    print(f"turn {turn}: a row of each of {len(cheap)} cheap tables, and of others within {seconds:g} core-s")
    for cost, table, study, place in [*cheap, *dear[first:], *dear[:first]]:
        if time.process_time() - begun + cost > seconds:
            continue
        try:
            told = [*differences(table.rows, place, recomputed(*study, place, len(table.rows)))]
        except InputError as error:  # the job has changed
            told = [str(error)]
        expected = OLDER in table.told or table.is_stale
        status |= bool(told) and not expected
        words = f"{'; '.join(told)}{' (older)' * expected}" if told else "the same"
        print(f"{table.name}, row {place + 1}: {words}", flush=True)
    print(f"{time.process_time() - begun:.0f} core-s")
    return int(status)


def study_of(made_by):
    """Return job file, settings and variables of a table with a row for each run of a study, else None."""
    words = shlex.split(made_by)
    if words[:2] != ["cvt-hpc", "run"] or "&&" not in words or (at := words.index("&&")) + 5 > len(words):
        return None
    if words[at + 1 : at + 5] != ["python", "jobs/tabulate.py", "$OUT", "$TABLE"]:
        return None
    settings = [value for word, value in pairwise(words[:at]) if word == "--set"]
    quantities = [*takewhile(lambda word: word != "&&", words[at + 5 :])]
    return words[2], settings, quantities or OF_A_BELT


def recomputed(file, settings, quantities, place, size):
    """Return the cells of a run of a study, which has so many of them, by column."""
    job = load_job(ROOT / file, settings)
    if job.size != size:
        raise mismatch(file, f"{size} runs, as its table has rows", f"{job.size}")
    point = job.point(place)
    axes = tuple(replace(axis, values=(point[axis.name],)) for axis in job.axes)
    alone = replace(job, axes=axes, design=job.design | {"runs": 1} if job.is_sampled else {}, histories=())
    with tempfile.TemporaryDirectory() as folder:
        run(alone, folder, progress=False)
        with open_results(folder) as results:
            (row,) = csv.DictReader(rows(results.load(), quantities))
    return row


def differences(stored, place, found):
    """Yield in words what differs between a row of a table and other cells by more than rounding explains."""
    for column in ("status", "vibrates"):
        if stored[place][column] != found[column]:
            yield f"{column} {found[column]}, stored {stored[place][column]}"
            return
    moves = found["vibrates"] == "yes"
    for column, text in stored[place].items():
        if column.startswith(FREE) or (column.startswith(NOISE) and not moves) or text == found.get(column):
            continue
        try:
            one, other = float(text), float(found[column])
            largest = max(abs(float(row[column])) for row in stored if row[column] not in ("", "nan"))
        except (KeyError, ValueError):
            one, other, largest = 0.0, 1.0, 0.0
        most = largest * (MOVING if moves else QUIET)
        if moves and (word := column.partition("_")[0]) in OF_VIBRATION:
            most = max(abs(one), abs(other)) * OF_VIBRATION[word]
        elif column.startswith("amplitude"):
            most = STILL
        if not abs(one - other) <= most:
            yield f"{column} {found.get(column)}, stored {text}"


def main(arguments=None):
    """Do what a command line asks for, and return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for name, text in (("list", "how old tables are"), ("make", "make tables again")):
        commands.add_parser(name, help=text).add_argument("names", nargs="*", metavar="NAME")
    commands.choices["make"].add_argument(
        "--stale", action="store_true", help="those that may be older than the code"
    )
    commands.add_parser("confirm", help="that HEAD computes the bits of a revision").add_argument("revision")
    checking = commands.add_parser("check", help="compute some rows again")
    day = datetime.date.today().toordinal()
    checking.add_argument("--turn", type=int, default=day, help="which rows (default: by the day)")
    checking.add_argument(
        "--seconds", type=float, default=40.0, help="processor time for all of them (default: 40)"
    )
    asked = parser.parse_args(arguments)
    try:
        if asked.command == "list":
            return show(asked.names)
        if asked.command == "confirm":
            return confirm(asked.revision)
        if asked.command == "check":
            return check(asked.turn, asked.seconds)
        if not asked.names and not asked.stale:
            raise mismatch("make", "names of tables, or --stale", "neither")
        return make(asked.names, asked.stale)
    except InputError as error:
        print(f"tables.py: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
