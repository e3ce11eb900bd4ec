"""What somebody needs who begins: a job to fill in, the keys of a model, a look at the machine, completion."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import cvt_hpc
from cvt_hpc import open_results, run
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.job.template import example_files, job_template
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.study import doctor
from cvt_hpc.variables import Vibrates

RECORDED = [name for name in MODELS if load_model(name).is_recorded]


@pytest.mark.parametrize("model", RECORDED)
def test_a_template_is_a_job_and_so_is_all_that_is_commented_out_in_it(model):
    text = job_template("first", model, "init")
    job = build_job(tomllib.loads(text))
    maps = {"auto": (9, 3), "elastic_belt": (9, 3), "oscillator": (10, 10), "belt_drive": (6, 5)}
    maps |= {"pushbelt": (3, 3), "criterion": (10, 10), "slip_limit": (5, 4)}
    shape = maps.get(model, (3,))
    assert (job.name, job.model, job.shape) == ("first", model, shape)
    assert "count = 5" in text
    # uncertain parameters, all lines of them or none
    (table,) = re.findall(r"(?m)^# \[uncertain\]\n(?:# .+\n)+", text)
    assert build_job(tomllib.loads(text.replace(table, re.sub("(?m)^# ", "", table)))).size == 64 * job.size
    text = text.replace(table, "")
    # every key with its default, but what stands in the place of another one, and the load beside its share
    uncommented = re.sub(r"(?m)^# (?!load =)(\w+ = )(?!.*\.\.\.)", r"\1", text)
    assert uncommented.count("\n#") < text.count("\n#")
    filled = build_job(tomllib.loads(uncommented))
    assert filled.fingerprint() == job.fingerprint()
    in_the_place_of_others = {
        key for key, parameter in job.schema.parameters.items() if parameter.default is None
    }
    follow = {parameter.gives.key for parameter in job.schema.parameters.values() if parameter.gives}
    assert max(map(len, text.splitlines())) <= 120
    assert set(job.parameters) - in_the_place_of_others - follow - {"load"} <= filled.given


def test_the_template_of_the_oscillator_shows_the_border_of_damping(tmp_path):
    job = build_job(tomllib.loads(job_template("first", "oscillator", "init")) | {"name": "first"})
    p = job.parameters
    fall = np.exp(
        -p["belt_speed"] / p["stribeck_velocity"]
    )  # of the law's slope, from v = 0 to the belt's speed
    drives = -p["normal_load"] * fall * np.array(job.axes[0].values)[:, None]
    margin = drives / np.maximum(np.array(job.axes[1].values), 1e-9)
    run(job, out=tmp_path)
    found = open_results(tmp_path)["vibrates"]
    assert np.all(found.values[margin > 1.3]) and not np.any(found.values[margin < 0.9])


def test_the_template_of_the_criterion_shows_quiet_and_vibrating_slip(tmp_path):
    run(build_job(tomllib.loads(job_template("first", "criterion", "init"))), out=tmp_path)
    found = open_results(tmp_path)["vibrates"]
    assert np.all(found.isel(radial_speed=0) == Vibrates.NO) and np.mean(found == Vibrates.YES) > 0.5


def test_the_template_of_the_limit_shows_a_torque_that_grows_with_the_thrust(tmp_path):
    """Each limit is proportional to the thrust, by eq. 2 of Bullinger et al. 2005, and differs by ratio."""
    run(build_job(tomllib.loads(job_template("first", "slip_limit", "init"))), out=tmp_path)
    torque = open_results(tmp_path)["limit_torque"].transpose("thrust", "ratio")
    assert (torque / torque["thrust"]).values == pytest.approx(np.tile(torque[0] / 20e3, (5, 1)))
    assert np.all(np.diff(torque[0]) < 0.0)


# A sixth of the cost: the corners lie so far from the border, which hardly depends on the load, that a longer step,
# shorter runs and one load tell the same of it.
CHEAPER = {
    "step": "20 us", "rise_time": "30 ms", "duration": "0.1 s", "longest_duration": "0.1 s", "load_share": 0.2
}  # fmt: skip


@pytest.mark.parametrize(
    ("model", "cheaper", "corners"),
    [
        ("belt_drive", {}, [[Vibrates.NO, Vibrates.NO], [Vibrates.SLIPS, Vibrates.SLIPS]]),
        pytest.param("pushbelt", CHEAPER, [Vibrates.YES, Vibrates.NO], marks=pytest.mark.slow),
    ],
    ids=["belt_drive", "pushbelt"],
)
def test_the_template_of_a_belt_shows_a_border_within_a_minute(model, cheaper, corners, tmp_path):
    template = tomllib.loads(job_template("first", model, "init"))
    job = build_job(template)
    assert job.shape[0] * job.shape[1] * load_model(model).cost(job.point(0), job.stepper) < 90.0
    cheap = build_job(template, overrides=cheaper)
    run(cheap.thinned(2 ** len(cheap.shape)), out=tmp_path)
    assert open_results(tmp_path)["vibrates"].values.tolist() == corners


def test_a_template_has_the_units_of_engineers():
    lines = job_template("first", "elastic_belt", "init").splitlines()
    for line in (
        '# driven_radius = "75 mm"',
        '# thrust = "50 kN"',
        '# driving_speed = "3000 rpm"',
        '# disturbance = "1 um"',
        '# rise_time = "30 ms"',
        '# flank_stiffness = "30 kN/mm^2"',
        '# element_mass = "1 kg/m"',
        '# speed_start = "104.71975511965977 rad/s"  # 1000 rpm',  # the default has another last digit
    ):
        assert line in lines
    lines = job_template("first", "belt_drive", "init").splitlines()
    assert '# speed_ripple = "0 rpm"' in lines
    assert '# driving_speed = "62.8 rad/s"  # 599.696 rpm' in lines  # no round number of turns


def test_init_writes_a_job_that_check_takes_and_overwrites_nothing(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = call("init", "mine", "--model", "criterion")
    assert (status, err) == (0, [])
    assert out[1] == "next: cvt-hpc check mine.toml; cvt-hpc run mine.toml; cvt-hpc map out/mine"
    assert call("check", "mine.toml")[0] == 0
    (tmp_path / "mine.toml").write_text("kept")
    assert call("init", "mine") == (
        2,
        [],
        ["cvt-hpc: mine.toml: expected a name that is free, found a file of this name"],
    )
    assert (tmp_path / "mine.toml").read_text() == "kept"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["../x"], "init: name: expected a word of letters"),
        (["x", "--model", "elastic_bel"], "did you mean elastic_belt?"),
        (["x", "--model", "moving_string"], "found moving_string, for charts alone"),
    ],
)
def test_init_refuses_what_would_be_no_job(call, tmp_path, monkeypatch, arguments, told):
    monkeypatch.chdir(tmp_path)
    status, out, err = call("init", *arguments)
    assert (status, out, len(err)) == (2, [], 1)
    assert told in err[0]
    assert list(tmp_path.iterdir()) == []


def test_models_tells_each_model_and_its_keys(call):
    status, out, err = call("models")
    assert (status, err) == (0, [])
    assert [line.split()[0] for line in out[: len(MODELS)]] == sorted(MODELS)
    told = [" ".join(line.split()) for line in call("models", "criterion")[1]]
    assert "half_wedge_angle 0.1919862177 rad (11 deg) half wedge angle of the groove" in told
    assert call("models", "nothing")[0] == 2


def test_variables_tells_what_the_runs_of_a_model_leave(call):
    status, out, err = call("variables", "elastic_belt")
    assert (status, err) == (0, [])
    told = [" ".join(line.split()) for line in out]
    assert any(line.startswith("frequency strand Hz ") for line in told)
    (vibrates,) = (line for line in told if line.startswith("vibrates "))
    assert vibrates.endswith("(0 no, 1 yes, 2 undecided, 3 slips, 4 irregular)")
    names = {line.split()[0] for line in told[1 : told.index("")]}
    assert names >= {variable.name for variable in load_model("elastic_belt").variables}
    assert any(line.startswith("frequency_bin Hz ") for line in told[told.index("") :])
    assert call("variables", "elastic_bel")[2][0].endswith("did you mean elastic_belt?")
    assert "moving_string" in call("variables", "moving_string")[2][0]


def test_examples_are_listed_and_copied_with_what_they_read_and_replace_nothing(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = call("examples")
    assert (status, err) == (0, [])
    listed = {line.split()[0]: line for line in out[: out.index("")]}
    assert listed["jobs/quickstart.toml"].endswith("A first map: fall of friction x sheave stiffness x load")
    assert {"jobs/notebooks/read_a_map.ipynb", "slurm/sweep.sbatch"} <= listed.keys()
    assert listed["slurm/launch.sh"].endswith("The way to start ranks that the batch files share")
    status, out, err = call("examples", "sheave_deformation.toml", "read_a_map", "slurm", "--out", "mine")
    copied = {path.relative_to(tmp_path / "mine").as_posix() for path in (tmp_path / "mine").rglob("*.*")}
    assert (status, err) == (0, []) and len(out) == len(copied)
    assert copied >= {"jobs/sheave/driving.nc", "jobs/results/lebrecht_2004.csv", "slurm/launch.sh"}
    assert call("check", "mine/jobs/sheave_deformation.toml")[0] == 0
    (tmp_path / "mine/slurm/launch.sh").write_text("mine")
    status, out, err = call("examples", "strand", "slurm/launch.sh", "--out", "mine")
    assert (status, out) == (2, []) and "mine/slurm/launch.sh: expected a place that is free" in err[0]
    assert (tmp_path / "mine/slurm/launch.sh").read_text() == "mine"
    assert not (tmp_path / "mine/jobs/strand.toml").exists()
    assert call("examples", "quickstar")[2] == [
        "cvt-hpc: examples: quickstar: unknown example; did you mean quickstart?"
    ]
    assert (
        call("examples", "from_map_to_mechanism", "--out", "mine")[0] == 0
    )  # the table is there, as it came
    for name, read in (
        ("sweep", {"slurm/launch.sh", "jobs/quickstart.toml"}),
        ("losses.py", {"jobs/driving_cycle.csv"}),
    ):
        assert {line.partition(name)[2][1:] for line in call("examples", name, "--out", name)[1]} >= read
    known = call("examples", "zzz")[2][0].partition("known: ")[2].partition(";")[0].split(", ")
    assert len(known) == len({*known})


@pytest.mark.slow
def test_the_wheel_brings_its_revision_and_the_same_examples(tmp_path):
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    root = Path(cvt_hpc.__file__).parents[1]
    source = tmp_path / "source"  # a build writes beside its sources
    shutil.copytree(root / "cvt_hpc", source / "cvt_hpc", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "jobs", "slurm"):
        (source / name).symlink_to(root / name)
    (source / ".gitignore").write_text("build\n*.egg-info\n")
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", source]
    for asked in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "a"]):
        subprocess.run([*git, *asked], check=True)
    revision = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True).stdout
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    offline = ["--no-deps", "--no-index"]
    subprocess.run(
        [*pip, "wheel", *offline, "--no-build-isolation", "--wheel-dir", tmp_path, source], check=True
    )
    (wheel,) = tmp_path.glob("*.whl")
    subprocess.run(
        [
            *pip,
            "install",
            *offline,
            "--no-compile",
            "--ignore-installed",
            "--prefix",
            tmp_path / "own",
            wheel,
        ],
        check=True,
    )
    (package,) = (tmp_path / "own").glob("lib*/python*/site-packages")
    program = (
        "import json, cvt_hpc; from cvt_hpc.job.template import example_files;"
        "from cvt_hpc.storage.provenance import git_revision;"
        "files = {name: str(path) for name, path in example_files().items()};"
        "print(json.dumps([cvt_hpc.__file__, git_revision(), files]))"
    )
    environment = os.environ | {"PYTHONPATH": str(package)}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, check=True, capture_output=True
    )
    used, told, examples = json.loads(done.stdout)
    assert Path(used).is_relative_to(package) and told == revision.strip()
    known = example_files()
    assert examples.keys() == known.keys() and len(examples) > 90
    for name, path in examples.items():
        assert (
            Path(path).is_relative_to(tmp_path / "own")
            and Path(path).read_bytes() == known[name].read_bytes()
        )


def test_a_package_without_examples_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(cvt_hpc, "__file__", str(tmp_path / "cvt_hpc" / "__init__.py"))
    monkeypatch.setattr("cvt_hpc.job.template.metadata.files", lambda _: None)
    with pytest.raises(InputError, match="examples: expected those of a wheel, or of a checkout"):
        example_files()


def test_doctor_names_what_is_wrong_and_what_to_do(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        doctor, "_said", lambda command: (0, ["1 MPICH", "1 MPICH"])
    )  # ranks that do not see each other
    monkeypatch.setattr(doctor, "versions", lambda: {"python": "3", "mpi4py": "4"})
    monkeypatch.setattr(doctor, "LEAST_DISK", 1e30)
    status, out, err = call("doctor")
    assert (status, err) == (1, [])
    told = {line.split(":")[0] for line in out}
    assert {"ok       versions", "ok       machine", "trouble  disk", "trouble  MPI"} <= told
    advice = out[out.index(next(line for line in out if "trouble  MPI" in line)) + 1]
    assert "does not fit the MPI library" in advice
    assert "fills" not in " ".join(out)  # ranks that cannot be started


@pytest.mark.parametrize(
    ("script", "told"),
    [
        (
            "echo 'srun: error: resolve_ctls: no configuration' >&2; exit 1",
            "trouble  Slurm: sbatch is there, but srun fails: srun: error: resolve_ctls: no configuration",
        ),
        (
            "echo 'MPI plugin types are...'; echo pmi2",
            "ok       Slurm: sbatch is there; srun knows MPI plugin types are... pmi2",
        ),
    ],
)
def test_doctor_asks_srun_whether_slurm_answers(call, tmp_path, monkeypatch, script, told):
    for name in ("sbatch", "srun"):
        (tmp_path / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(doctor, "_mpi", lambda installed: doctor.Finding(True, "MPI", ""))
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    status, out, _ = call("doctor")
    assert told in out and status == (1 if told.startswith("trouble") else 0)
    if status:
        assert out[-1].startswith("         `sinfo` has to list partitions first")


@pytest.mark.slow
def test_doctor_starts_two_ranks():
    found = next(finding for finding in doctor.examine(doctor.Path()) if finding.what == "MPI")
    assert found.fine and found.found.startswith("2 ranks by ")
    assert len(os.sched_getaffinity(0)) == 1 or "fills this machine" in found.advice


@pytest.fixture(scope="module")
def completion():
    """Return a function that gives the script of a shell."""

    def script(shell):
        command = [sys.executable, "-m", "cvt_hpc", "completion", shell]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    return script


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_a_shell_takes_its_completion(completion, shell):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} here")
    # without a user's settings; tcsh has no syntax check that reads standard input, its script only defines
    command = {"bash": ["bash", "-n"], "zsh": ["zsh", "-f", "-n"], "tcsh": ["tcsh", "-f"]}[shell]
    done = subprocess.run(command, input=completion(shell), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_names_the_commands_in_each_shell(completion, shell):
    words = set(re.findall(r"[\w-]+", completion(shell)))
    assert {"run", "map", "init", "doctor", "cvt-hpc"} <= words


def test_completion_names_all_commands(completion):
    script = completion("bash")
    commands = re.search(r"(?m)^_shtab_cvt_hpc_subparsers=\((.*)\)$", script)[1]
    assert {"run", "map", "init", "doctor"} <= set(commands.split())


def test_status_for_programs(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("init", "mine", "--model", "criterion")[0] == 0
    assert call("run", "mine.toml")[0] == 0
    status, out, _ = call("status", "out/mine", "--json")
    assert (status, len(out)) == (0, 1)
    told = json.loads(out[0])
    assert (told["name"], told["total"], told["done"], told["left"]) == ("mine", 100, 100, 0)
