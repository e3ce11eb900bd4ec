"""The examples of the guide's page on extensions, run as they stand there."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import van_der_pol
from van_der_pol.transient import Transient

import cvt_hpc
from cvt_hpc.cli import main
from cvt_hpc.experiment_kinds import EXPERIMENTS, Experiment
from cvt_hpc.job import build_job
from cvt_hpc.models import MODELS
from cvt_hpc.steppers import STEPPERS
from support.small_systems import order

PACKAGE, HERE = Path(cvt_hpc.__file__).parent, Path(__file__).parent
PAGE = (PACKAGE.parent / "docs" / "guide" / "extend.md").read_text()
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_the_page_shows_the_files_that_are_run():
    shown = dict(
        re.match(r"# (?:cvt_hpc/(?:steppers|experiments)/)?(\S+\.py)\n(.*)", b, re.DOTALL).groups()
        for b in BLOCKS
        if b[0] == "#"
    )
    files = [
        HERE / "runge_kutta_3.py",
        HERE / "two_steppers.py",
        *sorted((HERE / "van_der_pol").glob("*.py")),
    ]
    assert shown == {str(file.relative_to(HERE)): file.read_text() for file in files}


def test_a_friction_law_by_its_two_blocks(tmp_path):
    declaration = next(block for block in BLOCKS if block.startswith("PARABOLIC"))
    formula = next(block for block in BLOCKS if block.startswith("@_formula_of"))
    shutil.copytree(PACKAGE, tmp_path / "cvt_hpc", ignore=shutil.ignore_patterns("__pycache__"))
    for name, text, before in (
        ("friction_laws.py", f"    {declaration}", "\n\nFRICTION_LAWS ="),
        ("friction.py", f"{formula}\n\n", "if missing :="),
    ):
        module = tmp_path / "cvt_hpc" / "physics" / name
        head, tail = module.read_text().split(before)
        module.write_text(head + text + before + tail)
    tried = """
import numpy as np
from cvt_hpc.cli import main
from cvt_hpc.experiment_kinds import EXPERIMENTS, Experiment
from cvt_hpc.job import build_job
from cvt_hpc.physics.friction import friction_coefficient, given_law
from cvt_hpc.physics.friction_laws import largest_friction

p = {"friction_law": "parabolic", "kinetic_friction": 0.1, "friction_gradient": -0.8, "stribeck_velocity": 0.05}
build_job({"name": "x", "model": "elastic_belt", "friction": p})
law = given_law({**p, "table_force": (), "table_speed": (), "table_mu": ()})
for speed, mu, slope in ((0.0, 0.12, -0.8), (0.025, 0.105, -0.4), (0.05, 0.1, 0.0), (0.1, 0.1, 0.0)):
    # 1e-12: round-off of a handful of operations on numbers near 1
    assert np.allclose(friction_coefficient(law, speed, 1.0), (mu, slope), rtol=0.0, atol=1e-12), speed
assert np.isclose(largest_friction(p), 0.12)
"""
    own = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", tried], env=os.environ | own, cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_a_stepper_is_chosen_by_a_job_and_has_its_order(monkeypatch):
    monkeypatch.setitem(MODELS, "van_der_pol", "van_der_pol")
    for known in (STEPPERS, van_der_pol.STEPPERS):
        monkeypatch.setitem(known, "runge_kutta_3", "runge_kutta_3")

    steps, decays = np.array([50e-6, 25e-6, 12.5e-6]), []
    for step in steps:
        scene = {"excitation": 0.0, "start": 1e-5}
        document = {"name": "x", "model": "van_der_pol", "stepper": "runge_kutta_3", "scene": scene}
        job = build_job(document | {"run": {"duration": 0.05}, "numerics": {"step": step}})
        run = Transient(job.parameters, "runge_kutta_3")
        assert run.advance(run.samples) is None
        swing = run.rows / (scene["start"] * np.array([1.0, 2.0 * np.pi * 600.0]))
        decays.append(-np.log(np.hypot(*swing[-1])) / 0.05)
    # without excitation it is a harmonic vibration, whose decay the method states: step^3 w^4 / 24, up to
    # (step w)^2 / 3 of it by the next term, 1 % at 50 us
    assert decays == pytest.approx(steps**3 * (2.0 * np.pi * 600.0) ** 4 / 24.0, rel=0.02)
    assert order(steps, decays) == pytest.approx(3.0, abs=0.02)


def test_an_experiment_has_its_command_its_files_and_its_table(monkeypatch, tmp_path, capsys):
    registered = next(block for block in BLOCKS if block.startswith("EXPERIMENTS"))
    own = {"EXPERIMENTS": {}, "Experiment": Experiment}
    exec(registered.replace("cvt_hpc.experiments.", ""), own)
    monkeypatch.setitem(EXPERIMENTS, "two_steppers", own["EXPERIMENTS"]["two_steppers"])
    monkeypatch.setitem(MODELS, "van_der_pol", "van_der_pol")
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(
        'name = "x"\nmodel = "van_der_pol"\n[axes]\nexcitation = [-0.1, 0.2]\n[numerics]\nstep = "20 us"\n'
        '[run]\nduration = "0.1 s"\n[two_steppers]\nsecond = "symplectic_euler"\n'
    )
    assert main(["check", "x.toml"]) == 0
    assert capsys.readouterr().out.startswith("two_steppers x (x.toml): 2 runs by two steppers\n")
    assert main(["run", "x.toml"]) == 2
    assert "expected a job of runs, found one for `cvt-hpc two_steppers`" in capsys.readouterr().err
    assert main(["two_steppers", "x.toml"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in printed[1:3]] == [["runge_kutta_4", "1"], ["symplectic_euler", "1"]]
    assert printed[3:] == ["table: out/x/two_steppers.csv", "picture: out/x/two_steppers.png"]
    assert Path("out/x/two_steppers.png").stat().st_size > 5000
    assert main(["two_steppers", "x.toml"]) == 0  # the runs are on record
    assert capsys.readouterr().out.splitlines() == printed
