"""Friction tables from CSV files: columns with units, and one error for whatever is wrong with a file."""

import json
import os

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, load_job
from cvt_hpc.job.summary import summarize

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
        ("speed [mm/s]", "sped [mm/s]", 'found " sped [mm/s]"; did you mean speed?'),
        ("speed [mm/s]", "mu", "line 2: expected distinct columns, found mu twice"),
        (", mu", ", element_pitch [mm]", "line 2: expected a column mu, found none among force, speed, element_pitch"),
        ("force [kN/m]", "force [kN]", "expected a column element_pitch [m] beside the force of an element, found none"),
        ("0.12", "0;12", 'line 4, mu: expected a number, found "0;12"'),
        ("0.12", "nan", 'line 4, mu: expected a finite number, found "nan"'),
        ("0.12", "-1", "line 4: expected a coefficient of friction > 0, found -1"),
        ("0.12", "0.12, 3", "line 4: expected 3 columns, as in line 2, found 4"),
        ("200, 50", "-200, 50", "line 7: expected a force of 0 or more, found -200000"),
        ("100, 0,", "200, 0,", "line 6: expected one coefficient for each force and speed, found a second one for these"),
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
    assert refusal(path) == f"{place}: {file}: expected a CSV file, found a folder"
    file.rmdir()
    os.mkfifo(file)  # who opens it waits for a writer
    assert refusal(path) == f"{place}: {file}: expected a CSV file, found no regular file"
    file.unlink()
    file.write_bytes(b"x" * (2**20 + 1))
    assert refusal(path) == f"{place}: {file}: expected at most 1048576 bytes, found 1048577"
    file.write_bytes(b"\xff\xfe")
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
