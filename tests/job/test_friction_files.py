"""Friction tables from CSV files: columns with units, and one error for whatever is wrong with a file."""

import json
import os
import warnings
from dataclasses import dataclass
from decimal import Decimal

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from cvt_hpc.errors import InputError, JobWarning
from cvt_hpc.job import build_job, load_job, rebuild_job
from cvt_hpc.job.csv_files import read_csv
from cvt_hpc.job.summary import summarize
from cvt_hpc.parameters import FromFile

JOB = 'name = "x"\nmodel = "elastic_belt"\n[friction]\nfriction_law = "table"\n'
PER_LENGTH = """# measured at 90 degrees
force [kN/m], speed [mm/s], mu

200, 0, 0.12
100, 50, 10 %
100, 0, 0.13
200, 50, 0.09
""".replace("10 %", "0.1")
VALUES = {
    "table_force": (100e3, 200e3),
    "table_speed": (0.0, 0.05),
    "table_mu": ((0.13, 0.1), (0.12, 0.09)),
}


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a friction table beside a job file, and returns the path of the job file."""

    def write_both(table, name="mu.csv", job=JOB):
        (tmp_path / "jobs").mkdir(exist_ok=True)
        if isinstance(table, bytes):
            (tmp_path / "jobs" / name).write_bytes(table)
        elif table is not None:
            (tmp_path / "jobs" / name).write_text(table)
        (tmp_path / "jobs/x.toml").write_text(f'{job}table_file = "{name}"\n')
        return tmp_path / "jobs/x.toml"

    return write_both


def tables(job):
    return {key: job.parameters[key] for key in VALUES}


def test_a_file_gives_what_the_lists_would(write):
    job = load_job(write(PER_LENGTH))
    assert tables(job) == VALUES
    lists = json.loads(json.dumps(VALUES))
    written = build_job(
        {"name": "x", "model": "elastic_belt", "friction": {"friction_law": "table", **lists}}
    )
    assert job.fingerprint() == written.fingerprint()
    assert "table_file" not in job.parameters and job.given == written.given
    assert build_job(json.loads(json.dumps(job.resolved()))).fingerprint() == job.fingerprint()
    told = [" ".join(line.split()) for line in summarize(job, 1.0).splitlines()]
    assert any(line.startswith("table_speed [0, 0.05] m/s given") for line in told)


def test_force_of_an_element_is_taken_over_its_pitch(write):
    rows = [row.split(", ") for row in PER_LENGTH.splitlines()[3:]]
    lines = [f"{speed}, {mu}, {1.5 * float(force)}, 1.5" for force, speed, mu in rows]
    job = load_job(write("\n".join(["speed [mm/s],mu [-],force [N],element_pitch [mm]", *lines])))
    assert job.parameters["table_force"] == pytest.approx(VALUES["table_force"], rel=1e-14)
    assert job.parameters["table_mu"] == VALUES["table_mu"]


def test_without_forces_friction_is_the_same_under_each(write):
    job = load_job(write("speed [m/s],mu\n0.1,0.09\n0,0.1\n"))
    assert job.parameters["table_mu"] == ((0.1, 0.09), (0.1, 0.09))
    assert len(job.parameters["table_force"]) == 2


def test_a_single_contact_has_forces_alone(write):
    job = JOB.replace("elastic_belt", "oscillator")
    found = load_job(write("force [kN],speed [m/s],mu\n1,0,0.2\n1,1,0.1\n2,0,0.3\n2,1,0.2\n", job=job))
    assert found.parameters["table_force"] == (1000.0, 2000.0)


def test_an_override_of_either_kind_counts(write):
    path = write(PER_LENGTH)
    (path.parent / "other.csv").write_text(PER_LENGTH.replace("0.13", "0.2"))
    assert load_job(path, ["table_file=other.csv"]).parameters["table_mu"][0][0] == 0.2
    lists = build_job(load_job(path).resolved(), str(path), ["table_file=other.csv"])
    assert lists.parameters["table_mu"][0][0] == 0.2
    assert load_job(path, {"friction_law": "stribeck", "table_file": ""}).parameters["table_mu"] == ()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("force [kN/m]", "force [kg]", 'line 2: expected force [N/m] or force [N], found "force [kg]"'),
        ("force [kN/m]", "force", 'line 2: expected force [N/m] or force [N], found "force"'),
        ("force [kN/m]", "load [N]", "line 2: expected columns among force [N/m] or force [N], speed [m/s], mu, element_pitch [m], "
         'found "load [N]"'),
        ("speed [mm/s]", "sped [mm/s]", 'found "sped [mm/s]"; did you mean speed?'),
        ("speed [mm/s]", "mu", "line 2: expected distinct columns, found mu twice"),
        (", mu", ", element_pitch [mm]", "line 2: expected a column mu, found none among force, speed, element_pitch"),
        ("force [kN/m]", "force [kN]", "expected a column element_pitch [m] beside the force of an element, found none"),
        ("0.12", "0;12", 'line 4, mu: expected a number such as 1500 or 0.13, found "0;12"'),
        ("0.12", "nan", 'line 4, mu: expected a number such as 1500 or 0.13, found "nan"'),
        ("0.12", "1e999", 'line 4, mu: expected a finite number, found "1e999"'),
        ("0.12", "-1", "line 4: expected a coefficient of friction > 0, found -1"),
        ("0.12", "0.12, 3", "line 4: expected 3 columns, as in line 2, found 4"),
        ("200, 50", "-200, 50", "line 7: expected a force of 0 or more (a magnitude), found -200 kN/m"),
        ("100, 0,", "200, 0,", "line 6: expected one coefficient for each force and speed, such as the mean of repeated measurements, found a second one for these"),
        ("200, 50, 0.09", "", "expected a coefficient for each force and speed, found none for force 200000 N/m and speed 0.05 m/s"),
        (PER_LENGTH, "# nothing\n", "expected a line of column names and lines of numbers, found fewer lines"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_said_with_its_line(write, old, new, told):
    assert old in PER_LENGTH
    path = write(PER_LENGTH.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_job(path)
    assert str(caught.value).startswith(f"{path}: [friction] table_file: {path.parent / 'mu.csv'}: ")
    assert told in str(caught.value)


def refusal(path, *overrides):
    with pytest.raises(InputError) as caught:
        load_job(path, *overrides)
    return str(caught.value).removeprefix(f"{path}: ")


def test_only_regular_text_files_of_a_sane_size_are_read(write):
    path = write(None)
    place, file = "[friction] table_file", path.parent / "mu.csv"
    (path.parent / "nu.csv").write_text("")
    assert (
        refusal(path)
        == f"{place}: {file}: expected a CSV file, found nothing; did you mean {path.parent / 'nu.csv'}?"
    )
    file.mkdir()
    assert refusal(path) == f"{place}: {file}: expected a CSV file, found a folder in the place of a file"
    file.rmdir()
    os.mkfifo(file)  # who opens it waits for a writer
    assert refusal(path) == f"{place}: {file}: expected a CSV file, found a pipe in the place of a file"
    file.unlink()
    file.touch()
    os.truncate(file, 2**26 + 1)
    assert refusal(path) == f"{place}: {file}: expected a CSV file, found a file of more than 64 MiB"
    file.write_bytes(b"\x89PNG\r\n\x1a\n\x00")
    assert refusal(path) == f"{place}: {file}: expected a text file (CSV in UTF-8), found binary data"


@pytest.mark.parametrize("name", ["/proc/kmsg", "/proc/self/maps", "/dev/zero", "/dev/tty"])
def test_a_file_of_the_kernel_is_not_waited_for(write, name):
    path = write(None)
    path.write_text(path.read_text().replace("mu.csv", name))
    assert refusal(path).startswith(f"[friction] table_file: {name}: expected ")


def test_a_file_is_one_and_beside_no_lists(write):
    path = write(PER_LENGTH, job=JOB + "table_mu = [[1, 2], [1, 2]]\n")
    assert refusal(path) == "[friction] table_file: expected either table_file or table_mu, found both"
    path = write(PER_LENGTH)
    assert refusal(path, {"table_file": ["mu.csv"]}) == (
        "override table_file: expected one file for all runs, found an axis of files"
    )
    path.write_text(JOB + '[axes]\ntable_file = ["mu.csv"]\n')
    assert refusal(path) == "[axes] table_file: expected one file for all runs, found an axis of files"
    job = load_job(write(PER_LENGTH))
    with pytest.raises(InputError, match="at table_file: expected one file for all runs, found another one"):
        job.point_at({"table_file": "mu.csv"})


PLAIN = FromFile(
    {"speed": ("m/s",), "mu": ("",)},
    ("speed", "mu"),
    ("speed", "mu"),
    lambda columns: {name: list(column.values) for name, column in columns.items()},
)


@dataclass
class Dialect:
    """How a program writes a table."""

    separator: str
    mark: str
    grouped: bool
    quoted: bool
    units: str
    encoding: str
    end: str
    surplus: int
    above: list[str]
    first_row: int | None

    def number(self, value):
        whole, _, fraction = f"{value:f}".partition(".")
        if self.grouped:
            whole = f"{int(whole):,}".replace(",", "." if self.mark == "," else ",")
        return whole + (self.mark + fraction if fraction else "")

    def line(self, *cells):
        told = [f'"{cell}"' if self.quoted or self.separator in cell else cell for cell in cells]
        return self.separator.join([*told, *[""] * self.surplus])

    def write(self, rows):
        names = {"below": ("speed", "MU"), "[]": ("speed [µm/s]", "mu [-]"), "()": ("Speed (µm/s)", "mu")}
        lines = [*names[self.units].__iter__()], *([["µm/s", "-"]] if self.units == "below" else [])
        lines = [*lines, *([self.number(value) for value in row] for row in rows)]
        if self.first_row is not None:
            numbers = [*[""] * (len(lines) - len(rows)), *(str(self.first_row + i) for i in range(len(rows)))]
            lines = [[number, *cells] for number, cells in zip(numbers, lines, strict=True)]
        text = self.end.join([*self.above, *(self.line(*cells) for cells in lines), ""])
        return text.encode(self.encoding)


dialects = st.builds(
    Dialect,
    st.sampled_from(",;\t"),
    st.sampled_from(".,"),
    st.booleans(),
    st.booleans(),
    st.sampled_from(["below", "[]", "()"]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.integers(0, 2),
    st.lists(
        st.sampled_from(["", "# µ", "sep=;", "Run # 1", "Velocity = 2,5", 'a disc of 5"', "1;2"]), max_size=3
    ),
    st.sampled_from([None, 0, 1]),
)
values = st.builds(
    lambda digits, places: Decimal(digits).scaleb(-places), st.integers(0, 99999), st.integers(0, 4)
)


def may_be_a_thousand(text):
    whole, fraction = text.replace(",", ".").split(".")
    return len(fraction) == 3 and 1 <= len(whole) <= 3 and whole[0] != "0"


@pytest.mark.parametrize("block", [1, 2**18])
@settings(max_examples=60)
@example(Dialect(",", ".", True, False, "[]", "utf-8", "\n", 0, [], None), [(Decimal(1), Decimal("1000.0"))])
@given(dialects, st.lists(st.tuples(values, values), min_size=1, max_size=4))
def test_a_table_in_any_dialect_gives_its_numbers_or_is_refused(block, tmp_path_factory, dialect, rows):
    path = tmp_path_factory.mktemp("dialect") / "mu.csv"
    path.write_bytes(dialect.write(rows))
    marked = [text for row in rows for text in map(dialect.number, row) if set(text) & set(".,")]
    # 1.000 for a thousand, in a file of commas without a decimal one, is a plain number to anybody
    assume(dialect.separator != dialect.mark or not marked or any("," in text for text in marked))
    of_thousands = dialect.grouped and any(value >= 1000 for row in rows for value in row)
    plain = dialect.separator == "," and dialect.mark == "."
    certain = not of_thousands and (plain or not marked or not all(map(may_be_a_thousand, marked)))
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("cvt_hpc.job.csv_files._BLOCK", block)
                found = read_csv(PLAIN, "mu.csv", str(path.with_name("x.toml")), "x")
    except InputError as error:
        assert not certain, error
        assert "separators of thousands" in str(error) or "expected a number such as" in str(error)
        return
    assert not of_thousands and certain
    expected = {"speed": [float(v.scaleb(-6)) for v, _ in rows], "mu": [float(mu) for _, mu in rows]}
    assert found.values == expected
    told = " ".join(str(one.message) for one in caught)
    assert ("decimal commas" in told) == (dialect.mark == "," and bool(marked))
    assert ("semicolons between columns" in told) == (dialect.separator == ";")


@pytest.mark.parametrize(
    ("model", "table", "told"),
    [
        ("elastic_belt", {"friction": {"table_file": "mu.csv"}},
         '[friction] table_file: expected nothing, as it has no effect with friction_law stribeck, found "mu.csv"; delete it, or set table_file = ""'),
        ("oscillator", {"friction": {"friction_law": "coulomb", "table_mu": [[1, 2]]}},
         "[friction] table_mu: expected nothing, as it has no effect with friction_law coulomb, found a list; delete it, or set table_mu = []"),
        ("elastic_belt", {"deflection": {"driven_flexibility_file": "w.csv"}},
         '[deflection] driven_flexibility_file: expected nothing, as it has no effect with sheave_deformation bending, found "w.csv"; '
         'delete it, or set driven_flexibility_file = ""'),
        ("elastic_belt", {"axes": {"friction_law": ["linear", "cubic"]}, "friction": {"table_file": "mu.csv"}}, "[friction] table_file: expected nothing"),
    ],
)  # fmt: skip
def test_a_file_or_a_list_without_effect_is_an_error(write, model, table, told):
    source = write(PER_LENGTH)
    (source.parent / "w.csv").write_text("angle [deg],flexibility [um/N]\n0,1\n1,0.5\n")
    with pytest.raises(InputError) as caught:
        build_job({"name": "x", "model": model} | table, str(source))
    assert told in str(caught.value)


def test_a_file_has_an_effect_if_any_run_reads_it_and_none_in_a_stored_job(write):
    path = write(
        PER_LENGTH,
        job='name = "x"\nmodel = "elastic_belt"\n[axes]\nfriction_law = ["linear", "table"]\n[friction]\n',
    )
    stored = load_job(path).resolved()
    stored["axes"]["friction_law"] = ["linear"]
    assert rebuild_job(stored, "x", {}).parameters["table_mu"]  # of an earlier version, which took it
    with pytest.raises(InputError, match="table_force: expected nothing"):
        build_job(stored)


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ("speed [m/s];mu\n0;1.234\n1;1.125\n", 'expected a number that shows whether the mark is decimal or separates thousands, '
         'found only such as "1.234" in line 2; write numbers with decimal points, without separators of thousands'),
        ("speed [m/s];mu\n0;0,13\n1;0.1\n", 'expected one decimal mark, found "0,13" in line 2 and "0.1" in line 3; write'),
        ("speed [m/s];mu\n0;1.234,5\n", 'line 2, mu: expected a number such as 1500 or 0.13, found "1.234,5"'),
        ("speed [m/s],mu\n0,0,13\n", "line 2: expected 2 columns, as in line 1, found 3; separate columns by semicolons where commas are decimal"),
        ("speed,mu\nmm/s,-,\n0,0.1,7\n", "line 3: expected 2 columns, as in line 1, found 3"),
        ("speed [m/s],mu\n0,0.1\n1,\n", "line 3, mu: expected a number such as 1500 or 0.13, found nothing"),
        ("speed [m/s];mu;\n0;0,1;\n1;;\n", "line 3, mu: expected a number such as 1500 or 0.13, found nothing"),
        ("speed [m/s],mu\n0,0.1\nEnd of test\n", 'line 3, speed: expected a number such as 1500 or 0.13, found "End of test"'),
        ("speed [mm/s];mu\n0;0.13\n1'000;0.1\n", """line 3, speed: expected a number such as 1500 or 0.13, found "1'000"; write numbers with decimal points, without"""),
        ("speed [mm/s];mu\n0;0,13\n1\u202f000;0,1\n", "; write numbers with decimal points, without separators of thousands"),
        ("speed [mm/s] mu\n0 0.13\n", 'found "speed [mm/s] mu"; name them so, separated by commas, semicolons or tabs'),
        ("Geschwindigkeit [mm/s];Reibwert\n0;0,13\n", 'line 1: expected columns among force [N/m] or force [N], speed [m/s], mu, element_pitch [m], '
         'found "Geschwindigkeit [mm/s]", "Reibwert"; name them so, or delete them'),
        ("speed [m/s],,mu\n0,7,0.1\n", 'line 2, column 2: expected nothing, as it has no name in line 1, found "7"'),
        (",speed [m/s],mu\n3,0,0.1\n", 'line 2, column 1: expected nothing, as it has no name in line 1, found "3"'),
        ("speed [m/s],mu\nmm/s,-\n0,0.1\n", 'line 2, speed: expected no other unit than m/s, found "mm/s"'),
        ("speed,mu\n0,0.1\n", 'line 1: expected speed [m/s], found "speed"'),
        ("speed,mu\nkg,-\n0,0.1\n", 'line 2: expected speed [m/s], found "speed [kg]"'),
        ('speed [m/s],mu\n0,"0.1\n', "line 2: expected each quoted text closed in its line, found"),
        ("force [g],speed [m/s],COF\n1,2,3\n", 'line 1: expected force [N/m] or force [N], found "force [g]"; write "gf" for the weight of this mass'),
        ("Data of 1.1.26\n\nFz,V1,T,COF\ng,mm/sec,sec,\n1,2,3,4\n", "line 3: expected columns among force [N/m] or force [N], speed [m/s], mu, element_pitch [m], "
         'found "Fz", "V1", "T"; name them so, or delete them'),
    ],
)  # fmt: skip
def test_what_may_mean_two_things_is_refused_with_what_to_write(write, table, told):
    path = write(table)
    assert refusal(path).startswith(f"[friction] table_file: {path.parent / 'mu.csv'}: ")
    assert told in refusal(path)


def test_how_a_file_was_read_is_told_once_with_its_first_row(write):
    table = 'Messung 7\r\nGeschwindigkeit "v"\r\n\r\n;sliding speed;COF;\r\n;mm/sec;-;\r\n1;0;0,13;\r\n2;50;0,1;\r\n'
    path = write(table.encode("utf-16"))
    with pytest.warns(JobWarning) as caught:
        job = load_job(path)
    (told,) = (str(one.message) for one in caught)
    assert told.endswith(
        "mu.csv: read with UTF-16 letters, names in line 4, units in line 5, semicolons between columns, empty "
        'columns, no column for the numbers of the rows, decimal commas, "sliding speed" as speed, "COF" as mu; '
        "line 6 is speed 0 mm/sec, mu 0.13"
    )
    assert job.parameters["table_speed"] == (0.0, 0.05) and job.parameters["table_mu"][0] == (0.13, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_job(write(b'\xef\xbb\xbf# plain\r\n"speed [mm/s]","mu"\r\n0,0.13\r\n50,0.10\r\n'))
