"""The stored tables of jobs/results: how old they are; make them again; compare some of their rows.

    python jobs/tables.py list [NAME ...]   # revision, date, cost, state; of a NAME what has changed since
    python jobs/tables.py make NAME ...     # from HEAD alone, cheapest first; --stale: all that are stale
    python jobs/tables.py confirm REVISION  # that HEAD computes the same, bit for bit; ten on two cores
    python jobs/tables.py check             # some rows, and some tables of scripts, are computed again

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
import csv
import datetime
import hashlib
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median

from cvt_hpc import load_job, open_results, run
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.storage.files import written_aside
from cvt_hpc.tables import below_origin, columns

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "jobs"))
from stored_tables import (  # noqa: E402
    CONFIRMED,
    COST,
    DIRTY,
    MADE_BY,
    OLDER,
    UNKNOWN,
    computes,
    differs,
    git,
    is_known,
    objects,
    rests_on,
    says,
    tables,
)
from tabulate import OF_A_BELT, rows  # noqa: E402

# Commands of a row for each run of a study, and those of tables of costs, which no second run repeats.
STUDY = re.compile(r"cvt-hpc run (\S+) (.*?)--out \$OUT\b.*?python jobs/tabulate\.py \$OUT \$TABLE([^&|;]*)")
OF_COSTS = re.compile(
    r"cvt-hpc (chart|ladder)|pip install|benchmarks/(auto|block_solves|faults|pictures|spatial_pushbelt)\.py"
)

# How far a row may be from the stored one. Other lanes and other processors round otherwise. So runs that
# vibrate part within milliseconds, and what is recorded of them differs as between two random starts.
QUIET, MOVING = 0.01, 0.05  # of the largest value of the column, in runs that do not vibrate and that do
OF_VIBRATION = {"amplitude": 0.25, "lateral": 0.25, "frequency": 0.05}  # relative, in runs that vibrate
IN_WORDS = 0.25  # relative, of numbers in sentences, beside which a verdict stands
STILL = 0.5  # [um]: amplitude of a quiet run, a tenth of what vibrates
FREE = ("core_s", "power_residual", "step_ripple", "refinements", "time_step", "unsolved_share")
NOISE = ("frequency", "mode", "lateral")  # of a quiet run
ALWAYS = 0.5  # [core-s] of a run: tables of cheaper ones are in each check
STRIDE = 7919  # rows from turn to turn: prime, so that each is met
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


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
        try:
            made(table, folder)
            print(f"{table.name}: made", flush=True)
        except InputError as error:
            print(f"{table.name}: {error}", flush=True)
            failed.append(table.name)
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


def written(table, work, tree, **environment):
    """Return the lines that the commands of a table write, with the files of a tree; InputError if none."""
    target = work / "table.csv"
    for earlier in work.glob("table*"):
        earlier.unlink()
    environment |= {
        "OUT": str(work / hashlib.sha256(table.runs.encode()).hexdigest()[:16]), "TABLE": str(target),
        "PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1",
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }  # fmt: skip
    shell = ["bash", "-euo", "pipefail", "-c", table.made_by]
    told = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    done = subprocess.run(shell, cwd=tree, env=os.environ | environment, **told)
    if done.returncode:
        raise InputError(f"exit status {done.returncode}: {''.join(done.stdout.strip().splitlines()[-1:])}")
    lines = target.read_text(encoding="utf-8").splitlines() if target.is_file() else []
    cells = list(csv.reader(below_origin(lines)))
    if len(cells) < 2 or any(len(row) != len(cells[0]) for row in cells):
        raise InputError(f"expected a table of whole rows, found {len(cells)} lines")
    return lines


def made(table, work):
    """Replace a table by one that is made with the files of HEAD, in a folder; InputError if none is."""
    before = spent()
    lines = written(table, work, work / "tree", NUMBA_CACHE_DIR=str(work / "kernels"))
    cells = len(list(below_origin(lines)))
    *origin, head = lines[: len(lines) - cells + 1]
    begins = next((k for k, line in enumerate(origin) if line.startswith("# revision: ")), 0)
    origin = origin[begins:] + origin[:begins]  # what else is told comes behind
    # of the commands of its runs, which name folders of here, the first place has what makes all of it
    ours = [k for k, line in enumerate(origin) if line.startswith("# command: ")]
    origin = [line for k, line in enumerate(origin) if k not in ours[1:]]
    origin[ours[0]] = f"# {MADE_BY}: {table.made_by}"
    origin += [f"# {COST}: {spent() - before:.0f} core-s, with compiling"]
    with written_aside(table.path) as aside:
        aside.write_text("\n".join([*origin, head, *lines[len(lines) - cells + 1 :], ""]), encoding="utf-8")
    for picture in work.glob("table*.png"):
        with written_aside(table.path.with_name(picture.name.replace("table", table.path.stem, 1))) as aside:
            shutil.copyfile(picture, aside)


def confirm(revision):
    """Tell in tables that were as the code at a revision that HEAD computes its bits; 1 if it does not."""
    if not is_known(revision):
        raise mismatch("confirm", "a revision that git knows", revision)
    head, found = git("rev-parse", "HEAD").decode().strip(), []
    gone = {path for path in objects(revision) if computes(path) and not path.exists()}
    for table in (table for table in tables() if table.changed and not {UNKNOWN, DIRTY} & {*table.doubts}):
        paths = rests_on(table.made_by) | gone
        code = {path for path in paths if computes(path)}
        was = all(says(path, r) == says(path, revision) for path in code for r in table.revisions)
        # what the comparison of bits does not run, such as scripts, has to be that by which it was made
        if was and not any(differs(path, r) for path in paths - code for r in table.revisions):
            found.append(table)
    refuse_uncommitted(found)
    if subprocess.run([sys.executable, "tests/bits.py", revision, head], cwd=ROOT).returncode:
        return 1
    for table in found:
        lines = table.path.read_text(encoding="utf-8").splitlines(keepends=True)
        cells = len([*below_origin(lines)])
        origin = [line for line in lines[:-cells] if not line.startswith(f"# {CONFIRMED}: ")]
        with written_aside(table.path) as aside:
            told = [*origin, f"# {CONFIRMED}: {head}\n", *lines[-cells:]]
            aside.write_text("".join(told), encoding="utf-8")
    print(f"{len(found)} confirmed: {', '.join(table.name for table in found)}")
    return 0


def spent():
    """Processor time [s] of this process, and of those that it has waited for."""
    used = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def check(turn, seconds):
    """Compare rows, or all of a table, cheap ones first; 1 if one differs of a table that is not older."""
    found = tables()
    shared = {table.runs: table.cost for table in found}  # of the same runs the dearest table comes last
    cheap, dear = [], []
    for table in found:
        done = [place for place, row in enumerate(table.rows) if row.get("status") == "done"]
        if done and table.seconds and (study := study_of(table.made_by)):  # not of cells of many runs
            cost, place = median(table.seconds), done[turn * STRIDE % len(done)]
            (cheap if cost <= ALWAYS else dear).append((cost, table, f"row {place + 1}", (*study, place)))
        elif not OF_COSTS.search(table.made_by):
            dear.append((shared[table.runs], table, "all rows", None))
    dear.sort(key=lambda entry: entry[0])
    first, begun, status = turn % max(len(dear), 1), spent(), 0
    print(f"turn {turn}: a row of each of {len(cheap)} cheap tables, and of others within {seconds:g} core-s")
    with tempfile.TemporaryDirectory() as folder:
        for cost, table, what, run_of in [*cheap, *dear[first:], *dear[:first]]:
            if spent() - begun + cost > seconds:
                continue
            try:
                if run_of:
                    told = [*differences(table.rows, run_of[-1], recomputed(*run_of, len(table.rows)))]
                else:
                    told = [*of_all(table, csv.DictReader(below_origin(written(table, Path(folder), ROOT))))]
            except InputError as error:  # the job has changed
                told = [str(error)]
            expected = OLDER in table.told or table.is_stale
            status |= bool(told) and not expected
            words = f"{'; '.join(told)}{' (older)' * expected}" if told else "the same"
            print(f"{table.name}, {what}: {words}", flush=True)
    print(f"{spent() - begun:.0f} core-s")
    return int(status)


def study_of(made_by):
    """Return job file, settings and variables of a table with a row for each run of a study, else None."""
    if not (found := STUDY.search(made_by)):
        return None
    file, options, quantities = found.groups()
    settings = [value for word, value in pairwise(shlex.split(options)) if word == "--set"]
    return file, settings, quantities.split() or OF_A_BELT


def of_all(table, found):
    """Yield in words in which rows a table that is made again differs; of many, the first."""
    found = list(found)
    if len(found) != len(table.rows):
        raise mismatch("its commands", f"{len(table.rows)} rows, as its table has", f"{len(found)}")
    told = [[*differences(table.rows, place, row)] for place, row in enumerate(found)]
    other = [place for place, words in enumerate(told) if words]
    for place in other[:1]:
        yield f"{len(other)} of {len(found)} rows differ, first row {place + 1}: {'; '.join(told[place])}"


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
        if stored[place].get(column) != found.get(column):
            yield f"{column} {found.get(column)}, stored {stored[place].get(column)}"
            return
    moves = found.get("vibrates") == "yes"
    for column, text in stored[place].items():
        if column.startswith(FREE) or (column.startswith(NOISE) and not moves) or text == found.get(column):
            continue
        try:
            one, other = float(text), float(found.get(column) or "")
            largest = max(abs(float(row[column])) for row in stored if row[column] not in ("", "nan"))
        except ValueError:
            same = in_words(text, found.get(column) or "")
        else:
            most = largest * (MOVING if moves else QUIET)
            if moves and (word := column.partition("_")[0]) in OF_VIBRATION:
                most = max(abs(one), abs(other)) * OF_VIBRATION[word]
            elif column.startswith("amplitude"):
                most = STILL
            same = abs(one - other) <= most
        if not same:
            yield f"{column} {found.get(column)}, stored {text}"


def in_words(one, other):
    """Whether two sentences are the same but for numbers that rounding explains."""
    numbers = [[*map(float, NUMBER.findall(text))] for text in (one, other)]
    near = all(abs(a - b) <= IN_WORDS * max(abs(a), abs(b)) for a, b in zip(*numbers, strict=False))
    return NUMBER.split(one) == NUMBER.split(other) and near


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
