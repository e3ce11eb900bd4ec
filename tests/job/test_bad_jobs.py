"""Every kind of bad job file: one error, with the file, the key, what was expected, what was found, the nearest key."""

import os

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job
from cvt_hpc.models import MODELS

HEAD = 'name = "x"\nmodel = "toy"\n'
THRUST = '[scene]\nthrust = "20 kN"\n'
SEPARATED = (
    "; decimals have a point, as 2.4, thousands have no mark, and several values are a list, as [2, 4]"
)
IN_N = 'expected a value in N (such as "1 N" or a bare number in N), found'
IN_KG_PER_M = 'expected a value in kg/m (such as "1 kg/m" or a bare number in kg/m), found'
OTHER_ENCODING = "x.toml: expected a text in UTF-8, found another encoding or binary data; save it in UTF-8"
A_WORD = "expected a word of letters, digits, '.', '_' and '-' (it names the output folder), found"


def complaint(path="x.toml"):
    with pytest.raises(InputError) as caught:
        load_job(path)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[belt]\nelement_mas = 1", "[belt] element_mas: unknown key; did you mean element_mass?"),
        ("[belt]\nElement_Mass = 1", "[belt] Element_Mass: unknown key; did you mean element_mass?"),
        ("[belt]\nlaod = 1", "[belt] laod: unknown key; did you mean load in [scene]?"),
        ("[belt]\nload = 1", "[belt] load: belongs in [scene], found in [belt]"),
        ("[mesh]\nzzz = 1", "[mesh] zzz: unknown key; known: stations, refined"),
        ('[scene]\nthrust = "50 kg"', f'[scene] thrust: {IN_N} "50 kg" (write kgf)'),
        ('[scene]\nthrust = "50 kX"', f'[scene] thrust: {IN_N} "50 kX" (kX is no known unit)'),
        ('[scene]\nthrust = "2,4 kN"', f'[scene] thrust: {IN_N} "2,4 kN"{SEPARATED}'),
        ('[scene]\nthrust = "1; 2"', f'[scene] thrust: {IN_N} "1; 2"{SEPARATED}'),
        ('[scene]\nthrust = "much"', f'[scene] thrust: {IN_N} "much"'),
        ("[scene]\nthrust = true", f"[scene] thrust: {IN_N} true"),
        ("[scene]\nthrust = 2020-01-01", f"[scene] thrust: {IN_N} 2020-01-01"),
        ("[scene]\nthrust = { from = 1 }", f"[scene] thrust: {IN_N} a table"),
        ("[scene.thrust]\nvalue = 1", f"[scene] thrust: {IN_N} a table"),
        ("[scene]\nthrust = [1, 2]", f"[scene] thrust: {IN_N} a list; what a study varies stands in [axes]"),
        ("[scene]\nthrust = nan", "[scene] thrust: expected a finite value in N, found nan"),
        ("[scene]\nthrust = inf", "[scene] thrust: expected a finite value in N, found inf"),
        ("[scene]\nthrust = '-1e98 kN'", '[scene] thrust: expected a value of at most 1e+100 in N, found "-1e98 kN"'),
        (f"[scene]\nthrust = 1{'0' * 400}", "[scene] thrust: expected a finite value in N, found a number of too many digits"),
        ("[scene]\nratio = 2", f"[scene] thrust: {IN_N} nothing"),
        ("[belt]\nelement_mass = -1", "[belt] element_mass: expected > 0 kg/m, found -1"),
        ("[belt]\nelement_mass = 0", "[belt] element_mass: expected > 0 kg/m, found 0"),
        ("[belt]\nelement_mass = '-1 g/m'", '[belt] element_mass: expected > 0 g/m, found "-1 g/m"'),
        ("[belt]\nhalf_wedge_angle = 11", "[belt] half_wedge_angle: expected >= 0 and <= 1 rad, found 11; did you mean \"11 deg\"?"),
        ("[belt]\nhalf_wedge_angle = -11", "[belt] half_wedge_angle: expected >= 0 and <= 1 rad, found -11"),
        ("[belt]\nfriction_gradient = 0.5", "[belt] friction_gradient: expected <= 0 s/m, found 0.5"),
        ("[belt]\nsheave_stiffness = -inf", "[belt] sheave_stiffness: expected > 0, found -inf"),
        ("[belt]\nsheave_stiffness = nan", "[belt] sheave_stiffness: expected a finite value, found nan"),
        ("[belt]\nsheave_stiffness = '1 N'", '[belt] sheave_stiffness: expected a number, found "1 N"'),
        ("[belt]\nlabel = 5", "[belt] label: expected a text, found 5"),
        ("[belt]\ntable = 5", "[belt] table: expected a list of numbers in N/m, found 5"),
        ('[belt]\ntable = "2,4"', f'[belt] table: expected a list of numbers in N/m, found "2,4"{SEPARATED}'),
        (
            "[belt]\ntable = [[1, 2], [3, 'x']]",
            '[belt] table, item 2, item 2: expected a value in N/m (such as "1 N/m" or a bare number in N/m), found "x"',
        ),
        ("[mesh]\nstations = 30.5", "[mesh] stations: expected a whole number, found 30.5"),
        ("[mesh]\nstations = 3", "[mesh] stations: expected >= 24 and <= 4096, found 3"),
        ("[mesh]\nrefined = 1", "[mesh] refined: expected true or false, found 1"),
        (
            "[scene]\nload_history = 'rmap'",
            '[scene] load_history: expected one of constant, ramp, found "rmap"; did you mean ramp?',
        ),
        ("[scene]\nload_history = 1", "[scene] load_history: expected one of constant, ramp, found 1"),
        ("[blet]", "[blet]: unknown table; did you mean belt?"),
        ("[zzz]", "[zzz]: unknown table; known: scene, belt, mesh, numerics, run, axes, design, derived, linked, uncertain"),
        ("[[belt]]", "belt: expected a table [belt], found a list"),
        ("[axes]\nlaod = [1]", "[axes] laod: unknown key; did you mean load in [scene]?"),
        ("[axes]\nzzz.load = [1]", "[axes] zzz: unknown key; known: ratio, driving_speed, thrust, load, load_history, "
         "element_mass, half_wedge_angle, sheave_stiffness, friction_gradient, table, label, stations, refined, step, duration"),
        ("[axes]\nbelt.load = [1]", "[axes] belt.load: belongs in [scene], found in [belt]"),
        ("[axes]\nload = [1]\nscene.load = [2]", "[axes] scene.load: expected one axis for a parameter, found a second one for load"),
        ("[axes]\nload = []", "[axes] load: expected at least one value, found an empty list"),
        ("[axes]\nelement_mass = [1, '2 N']", f'[axes] element_mass, value 2: {IN_KG_PER_M} "2 N"'),
        ("[axes]\nelement_mass = [1, 0]", "[axes] element_mass, value 2: expected > 0 kg/m, found 0"),
    ],
)  # fmt: skip
def test_tables(write_job, text, message):
    write_job(text if "thrust" in text or "ratio" in text else f"{text}\n", head=HEAD)
    assert complaint() == f"x.toml: {message}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('model = "toy"', f"name: {A_WORD} nothing"),
        ('name = "a/b"\nmodel = "toy"', f'name: {A_WORD} "a/b"'),
        ('name = "..\\n"\nmodel = "toy"', f'name: {A_WORD} "..\\n"'),
        ('name = 5\nmodel = "toy"', f"name: {A_WORD} 5"),
        (
            'name = "x"',
            f"model: expected one of {', '.join(MODELS)}, toy, found nothing; `cvt-hpc models` says what each is",
        ),
        (
            'name = "x"\nmodel = "toi"',
            f'model: expected one of {", ".join(MODELS)}, toy, found "toi"; did you mean toy?',
        ),
        (
            'name = "x"\nmodel = 5',
            f"model: expected one of {', '.join(MODELS)}, toy, found 5; `cvt-hpc models` says what each is",
        ),
        (f'{HEAD}stepper = "hopp"', 'stepper: expected one of hop, found "hopp"; did you mean hop?'),
        (f"{HEAD}description = 5", "description: expected a text, found 5"),
        (f"{HEAD}thrust = 5", "thrust: belongs in [scene], found above all tables"),
        (f"{HEAD}thurst = 5", "thurst: unknown key; did you mean thrust in [scene]?"),
        (f"{HEAD}steper = 5", "steper: unknown key; did you mean stepper?"),
        (f"{HEAD}zzz = 5", "zzz: unknown key; known: name, model, stepper, description"),
        (f"{HEAD}belt = 5", "belt: expected a table [belt], found 5"),
        (f"{HEAD}axes = [1]", "axes: expected a table [axes], found a list"),
    ],
)
def test_head(write_job, text, message):
    write_job(text, head="")
    assert complaint() == f"x.toml: {message}"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"name = ", "x.toml: line 1, column 8: expected TOML, found: invalid value"),
        (b'name = "x"\nmodel = toy\n', "x.toml: line 2, column 9: expected TOML, found: invalid value"),
        (
            b"a = 1\nb = 2\na = 3\n",
            "x.toml: line 3, column 6: expected TOML, found: cannot overwrite a value",
        ),
        (b"a = " + b"[" * 5000, "x.toml: expected TOML, found lists or tables nested too deep"),
        (
            b"a" + b".a" * 5000 + b" = 1",
            "x.toml: expected lists and tables nested at most 20 deep, found deeper ones",
        ),
        (b"\x7fELF\x00\xff\xfe", OTHER_ENCODING),
        ('name = "B\u00e4nder"'.encode("latin-1"), OTHER_ENCODING),
        ('name = "x"'.encode("utf-16"), OTHER_ENCODING),
    ],
)
def test_files_that_are_not_toml(tmp_path, monkeypatch, content, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.toml").write_bytes(content)
    assert complaint() == message


SEPARATE = "decimals have a point, as 2.4, thousands have no mark, and several values are a list, as [2, 4]"


@pytest.mark.parametrize(
    ("line", "advice"),
    [
        ("load = 2,4", SEPARATE),
        ("load = [2;4]", SEPARATE),
        ("load = 2;4", SEPARATE),
        ("load = { from = 1,5, to = 3, count = 5 }", SEPARATE),
        ("load = { from = 1; to = 3; count = 5 }", SEPARATE),
        ("load = 10 N m", 'a value with its unit is a text, as "10 mm/s"'),
        ("load = [2, 4", None),
        ("load = tow", None),
    ],
)
def test_a_comma_a_semicolon_and_a_unit_outside_a_text_get_advice(write_job, line, advice):
    write_job(f"[axes]\n{line}\n")
    found = complaint()
    assert ": expected TOML, found: " in found and "\n" not in found
    assert found.endswith(f"; {advice}") if advice else ";" not in found


def test_numbers_of_too_many_digits(write_job):
    write_job(f"[mesh]\nstations = {'1' * 5000}")
    assert complaint().startswith("x.toml: expected TOML, found: Exceeds the limit")


def test_missing_file(write_job, tmp_path):
    write_job()
    assert complaint("y.toml") == "y.toml: expected a job file, found nothing; did you mean x.toml?"
    then = "`cvt-hpc init NAME` writes one to begin with"
    assert complaint("quick/zzz") == f"quick/zzz: expected a job file, found nothing; {then}"


def test_folder_instead_of_a_file(tmp_path):
    assert complaint(tmp_path) == f"{tmp_path}: expected a job file, found a folder"


def test_what_is_no_regular_file_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("x.toml")
    assert complaint() == "x.toml: expected a job file, found a pipe in the place of a file"
    assert complaint("/dev/zero") == "/dev/zero: expected a job file, found a device in the place of a file"


def test_path_that_the_system_refuses(write_job):
    write_job()
    assert complaint("x.toml/y.toml") == "x.toml/y.toml: expected a job file, found Not a directory"


def test_byte_order_mark_is_harmless(write_job, tmp_path):
    write_job()
    text = (tmp_path / "x.toml").read_bytes()
    (tmp_path / "x.toml").write_bytes(b"\xef\xbb\xbf" + text)
    assert load_job("x.toml").name == "x"
