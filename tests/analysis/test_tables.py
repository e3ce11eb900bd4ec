"""jobs/tables.py: how old stored tables are, how they are made again, and rows of them that are computed again."""

import csv
import importlib
import re
import shlex
import subprocess
import sys

import pytest

from cvt_hpc.tables import below_origin
from support.pages import ROOT

TOLD = ("revision", "job", "made by", "versions", "date", "machine")
OF_ALL = sorted((ROOT / "jobs" / "results").rglob("*.csv"))
HEAD = "# revision: {}\n# job: none\n# made by: bash jobs/{}.sh $TABLE\n# date: 2026-01-31\n"


@pytest.fixture
def stored(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "jobs")
    for name in ("stored_tables", "tables"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return importlib.import_module("stored_tables")


@pytest.fixture
def program(stored):
    return importlib.import_module("tables")


def git(folder, *arguments):
    identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
    done = subprocess.run(
        ["git", *identity, *arguments], cwd=folder, check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


@pytest.fixture
def store(program, stored, tmp_path, monkeypatch):
    """A repository with three tables, of scripts that write their own values; those of one fail."""
    for module in (program, stored):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    results = tmp_path / "jobs" / "results"
    results.mkdir(parents=True)
    for name, last in (("small", ""), ("large", ""), ("broken", "echo no belt >&2; exit 3\n")):
        lines = r"# in words\n# revision: made\n# command: x\n# command: y\nload,core_seconds\n1,2\n"
        (tmp_path / "jobs" / f"{name}.sh").write_text(f"# says\nprintf '{lines}' > $1\n{last}")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "scripts")
    revision = git(tmp_path, "rev-parse", "HEAD")
    for name, seconds in (("large", 9), ("small", 2), ("broken", 1)):
        text = HEAD.format(revision, name)
        (results / f"{name}.csv").write_text(f"{text}load,core_seconds\n0,{seconds}\n")
    return tmp_path


def edit(path, old, new):
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


@pytest.mark.parametrize("path", OF_ALL, ids=[path.stem for path in OF_ALL])
def test_a_stored_table_tells_its_origin_and_how_it_is_made(path):
    lines = path.read_text().splitlines()
    for name, line in zip(TOLD, lines, strict=False):
        assert line.startswith(f"# {name}: ") and line.partition(": ")[2].strip()
    head, *rows = csv.reader(below_origin(lines))
    assert rows and all(len(row) == len(head) for row in rows)
    made_by = lines[2].partition(": ")[2]
    subprocess.run(["bash", "-n"], input=made_by, text=True, check=True)
    assert "$TABLE" in made_by
    files = [word for word in shlex.split(made_by) if re.match(r"(jobs|tests)/", word)]
    assert files and all((ROOT / file).is_file() for file in files)


def test_a_table_rests_on_job_data_and_all_modules_that_compute_it(program):
    (table,) = program.tables(["sheave_deformation"])
    files = {str(path.relative_to(ROOT)) for path in program.rests_on(table.made_by)}
    assert {"jobs/sheave_deformation.py", "jobs/sheave_deformation.toml", "jobs/sheave/driven.nc"} <= files
    assert {"cvt_hpc/models/elastic_belt/imex.py", "cvt_hpc/physics/friction.py"} & files
    assert {"cvt_hpc/variator/judging.py", "cvt_hpc/simulation/marching.py"} <= files
    assert not {
        path for path in files if re.match(r"cvt_hpc/(cli|study|report|models/pushbelt|kernels)", path)
    }
    (of_steppers,) = program.tables(["chart_oscillator"])
    assert ROOT / "cvt_hpc/steppers/moreau.py" in program.rests_on(of_steppers.made_by)
    assert ROOT / "cvt_hpc/experiments/chart/measuring.py" in program.rests_on(of_steppers.made_by)
    (of_script,) = program.tables(["terms"])
    assert ROOT / "jobs/terms.toml" in program.rests_on(of_script.made_by)
    (of_tests,) = program.tables(["paper_tests"])
    needed = "tests/support/settled.py", "jobs/sheave_flexibility.py", "cvt_hpc/physics/flank.py"
    assert {ROOT / file for file in needed} <= program.rests_on(of_tests.made_by)


@pytest.mark.parametrize(
    ("suffix", "first", "same", "other"),
    [
        (".py", 'def f(x):\n    """Told."""\n    return x\n', "def f(x):\n\n    return x  # x\n", "def f(x):\n    return -x\n"),
        (".toml", 'description = "a"\nload = 1\n', "load = 1 # N m\n", "load = 2\n"),
        (".sh", "# told\necho 1\n", "  echo 1\n", "echo 2\n"),
        (".nc", "1", "1", "2"),
    ],
)  # fmt: skip
def test_comments_and_docstrings_make_nothing_older(stored, suffix, first, same, other):
    said, again, changed = (stored.meaning(text.encode(), suffix) for text in (first, same, other))
    assert said == again != changed


def states(program):
    return {table.name: (table.state, table.is_stale) for table in program.tables()}


def test_a_table_is_stale_once_what_it_rests_on_has_changed(program, stored, store):
    assert set(states(program).values()) == {("as the code", False)}
    edit(store / "jobs" / "small.sh", "# says", "# says more")
    edit(store / "jobs" / "large.sh", "1,2", "1,3")
    stored.of_file.cache_clear()
    assert states(program)["small"] == ("as the code", False)
    assert states(program)["large"] == ("older than large.sh", True)


@pytest.mark.parametrize(
    ("told", "state", "stale"),
    [
        ("{}-dirty", "as the code; dirty revision", True),
        ("stored by {}", "as the code; revision of storing it", False),
        (40 * "f", "unknown revision", True),
        ("not recorded", "unknown revision", True),
    ],
)
def test_a_revision_that_leaves_something_open_is_named(program, store, told, state, stale):
    revision = git(store, "rev-parse", "HEAD")
    edit(
        store / "jobs" / "results" / "small.csv",
        f"revision: {revision}",
        f"revision: {told.format(revision)}",
    )
    assert states(program)["small"] == (state, stale)


def test_tables_are_made_the_cheapest_first_and_one_that_fails_stays_as_it_is(
    program, store, capsys, tmp_path, monkeypatch
):
    (kept := tmp_path / "made").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(kept))
    results = store / "jobs" / "results"
    broken = (results / "broken.csv").read_text()
    assert program.main(["make", "large", "small", "broken"]) == 1
    told = capsys.readouterr().out.splitlines()
    assert told == [
        "broken: exit status 3: no belt",
        "small: made",
        "large: made",
        f"kept, with what its runs have left: {next(kept.iterdir())}",
        "2 made, not broken",
    ]
    assert (results / "broken.csv").read_text() == broken
    *origin, head, row = (results / "small.csv").read_text().splitlines()
    assert origin[:3] == ["# revision: made", "# made by: bash jobs/small.sh $TABLE", "# in words"]
    assert re.fullmatch(r"# cost: \d+ core-s, with compiling", origin[3]) and len(origin) == 4
    assert (head, row) == ("load,core_seconds", "1,2")
    assert sorted(path.name for path in results.iterdir()) == ["broken.csv", "large.csv", "small.csv"]


def test_pictures_of_a_table_are_made_with_it(program, store, tmp_path, monkeypatch):
    (kept := tmp_path / "made").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(kept))
    results = store / "jobs" / "results"
    drawing = "sh $TABLE && printf drawn > ${TABLE%.csv}.png && printf too > ${TABLE%.csv}_along.png"
    edit(results / "large.csv", "sh $TABLE", drawing)
    assert program.main(["make", "large", "small"]) == 0
    found = {path.name: path.read_text() for path in results.glob("*.png")}
    assert found == {"large.png": "drawn", "large_along.png": "too"}


def test_all_that_are_stale_are_made_from_what_is_committed(
    program, stored, store, capsys, tmp_path, monkeypatch
):
    (left := tmp_path / "made").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(left))
    edit(store / "jobs" / "large.sh", "1,2", "1,3")
    assert program.main(["make", "--stale"]) == 2
    assert re.fullmatch(
        r"tables.py: large: expected all .* changes of jobs/large.sh\n", capsys.readouterr().err
    )
    git(store, "commit", "-q", "-a", "-m", "another load")
    stored.objects.cache_clear()
    assert program.main(["make", "--stale"]) == 0
    assert capsys.readouterr().out == "large: made\n1 made\n" and not [*left.iterdir()]
    assert (store / "jobs" / "results" / "large.csv").read_text().endswith("1,3\n")


@pytest.mark.parametrize("same", [True, False], ids=["same bits", "other bits"])
def test_tables_of_code_whose_bits_are_the_same_are_confirmed(program, stored, store, same, capfd):
    def rewrite(text, message):
        law.write_text(text)
        git(store, "commit", "-q", "-a", "-m", message)
        stored.objects.cache_clear(), stored.of_file.cache_clear(), stored.rests_on.cache_clear()
        return git(store, "rev-parse", "HEAD")

    law, results = store / "cvt_hpc" / "models" / "law.py", store / "jobs" / "results"
    law.parent.mkdir(parents=True)
    (store / "tests").mkdir()
    (store / "tests" / "bits.py").write_text(f"import sys\nprint(*sys.argv[1:])\nsys.exit({int(not same)})\n")
    for name in ("small", "large"):
        edit(store / "jobs" / f"{name}.sh", "# says", f"true {law.relative_to(store)}")
    law.write_text("friction = 0.5\n")
    git(store, "add", ".")
    first, before = (rewrite(f"friction = {value}\n", "a law") for value in (0.1, 0.2))
    for name, revision in (("small", before), ("large", first), ("broken", first)):
        text = (results / f"{name}.csv").read_text()
        (results / f"{name}.csv").write_text(re.sub("(?<=revision: ).*", revision, text))
    last = rewrite("friction = float(0.2)\n", "the same law, written in another way")
    assert program.main(["confirm", before]) == int(not same)
    told, older = capfd.readouterr().out, ("older than 1 of 1 modules", True)
    assert f"{before} {last}\n" in told and ("1 confirmed: small\n" in told) is same
    assert states(program)["small"] == (("as the code", False) if same else older)
    assert states(program)["large"] == older  # it was older than the code before
    origin = (
        (results / "small.csv").read_text().partition("load,")[0]
    )  # what tells of making it stays in front
    assert origin == HEAD.format(before, "small") + f"# confirmed at: {last}\n" * same
    edit(store / "jobs" / "small.sh", "1,2", "1,3")
    rewrite("friction = 0.2\n", "another script")
    assert program.main(["confirm", last]) == int(not same)
    assert "0 confirmed" in capfd.readouterr().out or not same
    rewrite("friction = 0.3\n", "a third law")  # small: by a script newer than `before`
    (results / "small.csv").write_text(HEAD.format(git(store, "rev-parse", "HEAD~1"), "small") + "load\n0\n")
    assert program.main(["confirm", before]) == int(not same)
    assert "1 confirmed: small\n" in capfd.readouterr().out or not same


@pytest.mark.parametrize("lines", [r"load\n1,2\n", r"load\n"])
def test_a_table_without_whole_rows_replaces_none(program, store, lines, capsys, tmp_path, monkeypatch):
    (tmp_path / "made").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "made"))
    kept = (store / "jobs" / "results" / "small.csv").read_text()
    (store / "jobs" / "small.sh").write_text(rf"printf '# command: x\n{lines}' > $1")
    git(store, "commit", "-q", "-a", "-m", "less")
    assert program.main(["make", "small"]) == 1
    assert "small: expected a table of whole rows" in capsys.readouterr().out
    assert (store / "jobs" / "results" / "small.csv").read_text() == kept


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["list", "smal"], "tables.py: smal: unknown table; did you mean small?\n"),
        (["confirm", "v0"], "tables.py: confirm: expected a revision that git knows, found v0\n"),
        (["make"], "tables.py: make: expected names of tables, or --stale, found neither\n"),
    ],
)
def test_bad_input_is_one_line(program, store, arguments, told, capsys):
    assert program.main(arguments) == 2
    assert capsys.readouterr().err == told


def test_a_table_that_does_not_tell_how_it_is_made_is_bad_input(program, store, capsys):
    edit(store / "jobs" / "results" / "small.csv", "made by", "made somehow by")
    assert program.main(["list"]) == 2
    assert "small.csv: expected a line `# made by: COMMANDS`" in capsys.readouterr().err


QUIET = {"load": "20", "status": "done", "vibrates": "no", "amplitude_t1 [um]": "0.31", "frequency_t1 [Hz]": "300.1", "loss [W]": "100"}  # fmt: skip
STATED = {"verdict": "partly", "measured": "11 um up to 200 N m"}
MOVES = QUIET | {"vibrates": "yes", "amplitude_t1 [um]": "20.0", "frequency_t1 [Hz]": "540.0"}


@pytest.mark.parametrize(
    ("kept", "found", "told"),
    [
        (QUIET, {"amplitude_t1 [um]": "0.7", "frequency_t1 [Hz]": "700"}, []),
        (QUIET, {"loss [W]": "98.1"}, []),  # the largest of the column is 200 W
        (QUIET, {"loss [W]": "97"}, ["loss [W] 97, stored 100"]),
        (QUIET, {"loss [W]": "nan"}, ["loss [W] nan, stored 100"]),
        (QUIET, {"loss [W]": "-100"}, ["loss [W] -100, stored 100"]),
        (QUIET, {"amplitude_t1 [um]": "0.9"}, ["amplitude_t1 [um] 0.9, stored 0.31"]),
        (QUIET, {"load": "30"}, ["load 30, stored 20"]),
        (QUIET, {"vibrates": "yes", "loss [W]": "1"}, ["vibrates yes, stored no"]),
        (MOVES, {"amplitude_t1 [um]": "16", "frequency_t1 [Hz]": "530", "loss [W]": "91"}, []),
        (MOVES, {"loss [W]": "89"}, ["loss [W] 89, stored 100"]),
        (MOVES, {"load": "twenty"}, ["load twenty, stored 20"]),
        (MOVES, {"amplitude_t1 [um]": "14"}, ["amplitude_t1 [um] 14, stored 20.0"]),
        (MOVES, {"frequency_t1 [Hz]": "500"}, ["frequency_t1 [Hz] 500, stored 540.0"]),
        (STATED, {"measured": "10 um up to 190 N m"}, []),
        (
            STATED,
            {"measured": "8 um up to 200 N m"},
            ["measured 8 um up to 200 N m, stored 11 um up to 200 N m"],
        ),
        (STATED, {"measured": "11 um to 200 N m"}, ["measured 11 um to 200 N m, stored 11 um up to 200 N m"]),
        (STATED, {"measured": "11 um"}, ["measured 11 um, stored 11 um up to 200 N m"]),
        (STATED, {"verdict": "not"}, ["verdict not, stored partly"]),
    ],
)
def test_rows_differ_beyond_what_rounding_explains(program, kept, found, told):
    rows = [kept, kept | {"loss [W]": "200"}, kept | {"status": "failed_error", "loss [W]": ""}]
    assert list(program.differences(rows, 0, kept | found)) == told


def check(program, capsys, monkeypatch, tables):
    monkeypatch.setattr(program, "tables", lambda: tables)
    status = program.main(["check", "--turn", "3", "--seconds", "30"])
    return status, capsys.readouterr().out


def test_a_stored_row_is_computed_again_and_named_where_it_differs(program, capsys, monkeypatch):
    (table,) = program.tables(["strand"])
    dear = type(table)(table.path, table.told, [row | {"core_seconds": "1e9"} for row in table.rows])
    status, told = check(program, capsys, monkeypatch, [table, dear])
    assert status == 0 and told.count("strand, row 9: the same") == 1
    table.rows[8]["net_force_t1 [N]"] = "1"
    monkeypatch.setattr(type(table), "is_stale", True)
    status, told = check(program, capsys, monkeypatch, [table, dear])
    assert status == 0 and told.count("(older)") == 1
    monkeypatch.setattr(type(table), "is_stale", False)
    status, told = check(program, capsys, monkeypatch, [table, dear])
    assert status == 1 and re.search(r"row 9: net_force_t1 \[N\] \S+, stored 1\n", told)
    table.told["older than the code"] = "another formula"
    status, told = check(program, capsys, monkeypatch, [table, dear])
    assert status == 0 and told.count("(older)") == 1


def test_a_job_of_another_size_than_its_table_is_named(program, capsys, monkeypatch):
    (table,) = program.tables(["strand"])
    table.rows.pop()
    monkeypatch.setattr(type(table), "is_stale", False)
    status, told = check(program, capsys, monkeypatch, [table])
    assert (
        status == 1
        and "strand, row 8: jobs/strand.toml: expected 10 runs, as its table has rows, found 11" in told
    )


def test_a_row_of_samples_is_the_sample_of_its_place(program):
    (table,) = program.tables(["ratio_1"])
    file, settings, quantities = program.study_of(table.made_by)
    assert (file, settings, quantities[0]) == ("jobs/ratio_1.toml", [], "amplitude")
    job = program.load_job(ROOT / file, settings)
    for place in (0, 200):
        stored = {axis.name: table.rows[place][axis.name] for axis in job.axes}
        assert {axis.name: f"{job.point(place)[axis.name]:g}" for axis in job.axes} == stored


@pytest.mark.parametrize(
    ("name", "file", "settings", "quantities"),
    [
        ("lebrecht_2004", "lebrecht_2004", [], ["amplitude", "frequency", "mode", "power_residual"]),
        ("quasi_static_convergence", "quasi_static_convergence", [], ["amplitude", "frequency", "mode", "power_residual"]),
        ("tilt_and_discs", "lebrecht_2004", ["friction_gradient=-0.8", "sheave_stiffness=[1,1.5]", "tilt_factor=[0.8,1,1.25]"],
         ["amplitude", "frequency", "mode", "power_residual"]),
        ("strand", "strand", [], ["eigenfrequency", "resting_frequency", "net_force", "critical_speed"]),
    ],
)  # fmt: skip
def test_a_study_is_found_in_the_commands_of_its_table(program, name, file, settings, quantities):
    (table,) = program.tables([name])
    found, by, of = program.study_of(table.made_by)
    assert (found, by, [*of]) == (f"jobs/{file}.toml", settings, quantities)


@pytest.mark.parametrize(
    "name", ["terms", "pushbelt_beside_belt", "misalignment_flanks", "figures/serpentine"]
)
def test_a_table_of_other_commands_has_no_study(program, name):
    (table,) = program.tables([name])
    assert program.study_of(table.made_by) is None


def test_a_table_without_a_study_is_made_again_and_compared(program, store, capsys):
    assert program.main(["check", "--turn", "0", "--seconds", "5"]) == 1
    told = capsys.readouterr().out.splitlines()[1:-1]
    assert told == [
        "broken, all rows: exit status 3: no belt",
        "small, all rows: 1 of 1 rows differ, first row 1: load 1, stored 0",
    ]  # large takes 9 core-s
    for name in ("small", "broken"):
        edit(store / "jobs" / "results" / f"{name}.csv", "\n0,", "\n1,")
    edit(store / "jobs" / "broken.sh", "exit 3", "exit 0")
    git(store, "commit", "-q", "-a", "-m", "repaired")
    program.main(["check", "--turn", "0", "--seconds", "5"])
    assert capsys.readouterr().out.count("all rows: the same\n") == 2
    edit(store / "jobs" / "results" / "small.csv", "\n1,2\n", "\n1,2\n2,2\n")
    program.main(["check", "--turn", "0", "--seconds", "5"])
    said = capsys.readouterr().out
    assert "small, all rows: its commands: expected 2 rows, as its table has, found 1" in said


def test_tables_of_the_same_runs_cost_what_the_dearest_of_them_does(program, store, capsys):
    edit(store / "jobs" / "results" / "large.csv", "jobs/large.sh $TABLE", "jobs/small.sh $TABLE && true")
    edit(store / "jobs" / "results" / "small.csv", "jobs/small.sh $TABLE", "jobs/small.sh $TABLE && :")
    program.main(["check", "--turn", "0", "--seconds", "5"])
    assert [line.partition(",")[0] for line in capsys.readouterr().out.splitlines()[1:-1]] == ["broken"]


def test_a_check_without_time_goes_through_all_tables_and_computes_none(program, capsys):
    assert program.check(turn=1, seconds=-1.0) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2
