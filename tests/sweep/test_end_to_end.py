"""From a job file to its map, with the real mechanics and the real command line."""

import json
import os
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from io import StringIO

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from cvt_hpc import open_results
from cvt_hpc.analysis.cells import STYLES
from cvt_hpc.analysis.classes import OccurrenceClass, occurrence_classes
from cvt_hpc.cli import main
from cvt_hpc.variables import Status, Vibrates
from support.cf import cf_findings
from support.recorded import assert_same_numbers
from support.rungs import scene_tables
from support.sweeps import call, environment

JOB = """
name = "small"
description = "A coarse belt"
model = "elastic_belt"

[axes]
sheave_stiffness = [1.0, inf]
load = ["0 N m", "60 N m", "120 N m", "450 N m"] # the last one is more than friction carries

[scene]
rise_time = "20 ms"

[mesh]
stations = 48

[run]
duration = "0.08 s"
""" + scene_tables("elastic_belt")


HISTORY = """
[record]
history = [{ sheave_stiffness = 1.0, load = "120 N m" }]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the job, where commands find themselves."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(JOB)
    return tmp_path


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """The folder of an undisturbed serial run."""
    folder = tmp_path_factory.mktemp("serial")
    (folder / "small.toml").write_text(JOB + HISTORY)
    with chdir(folder), redirect_stdout(StringIO()) as printed:
        assert main(["run", "small.toml"]) == 0
    assert printed.getvalue().splitlines() == [
        "8 runs: 8 done, 0 failed, 0 left",
        "of those done 2 slip",  # at 450 N m, on both sheaves
        "results: out/small/results.nc",
        "next: cvt-hpc map out/small; cvt-hpc report out/small",
    ]
    return folder / "out" / "small"


def load_results(out):
    with open_results(out) as dataset:
        return dataset.load()


def test_the_dataset_of_a_sweep(serial):
    dataset = load_results(serial)
    assert dataset["status"].dims == ("sheave_stiffness", "load")
    status = [[Status(value) for value in row] for row in dataset["status"].values]
    assert status == [[Status.DONE] * 4] * 2
    assert (dataset["vibrates"].values == Vibrates.SLIPS).tolist() == [[False] * 3 + [True]] * 2
    vibrating = dataset["vibrates"].values == Vibrates.YES
    # the coarse belt vibrates where the fine one does
    assert np.argwhere(vibrating & (dataset["status"].values == Status.DONE)).tolist() == [[0, 2]]
    assert np.isfinite(dataset["amplitude"].values[:, :3]).all()
    assert np.isnan(dataset["amplitude"].values[:, 3]).all()
    assert "slips through" in str(dataset["reason"].values[0, 3])
    assert (dataset["slip_margin"].values > 0.0).tolist() == [[False] * 3 + [True]] * 2
    assert json.loads(dataset.attrs["job"])["axes"]["sheave_stiffness"] == [1.0, "inf"]


def test_the_cf_checker_finds_nothing_in_a_sweep(serial):
    assert cf_findings(serial / "results.nc") == []


def test_costs_are_estimated_by_what_is_on_record(serial, monkeypatch, capsys):
    monkeypatch.chdir(serial.parents[1])
    estimate = {}
    for name in ("small", "other"):
        assert main(["check", "small.toml", "--set", f"name={name}"]) == 0
        printed = capsys.readouterr().out.splitlines()
        (estimate[name],) = (line for line in printed if line.startswith("estimated cost"))
    took = load_results(serial)["core_seconds"].values[:, :3].mean()
    assert estimate["small"].startswith(f"estimated cost: {took:.3g} core-seconds per run")
    assert estimate["small"].endswith("(by what 6 runs on record took)")
    assert "record" not in estimate["other"]


@pytest.mark.slow
def test_simulate_gives_the_numbers_of_the_sweep(serial, folder, capsys):
    at = ("--at", "load=120 N m", "--at", "lanes=runs")
    assert main(["simulate", "small.toml", *at, "--out", "h.nc", "--plot", "h.png"]) == 0
    printed = capsys.readouterr()
    assert [line for line in printed.err.splitlines() if "cvt-hpc: compil" not in line] == []
    assert "vibrates" in printed.out
    swept = load_results(serial).sel(sheave_stiffness=1.0, load=120.0)
    with xr.open_dataset(folder / "h.nc", decode_times=False) as history:
        for name in swept.data_vars:
            if swept[name].attrs.get("volatile") != "yes" and swept[name].dtype.kind == "f":
                assert history[name].values.tobytes() == swept[name].values.tobytes(), name
        assert history.sizes["time"] == 1600
        # and so does the history that the sweep has kept, of a run in a batch
        (kept,) = (serial / "histories").iterdir()
        assert kept.name == "run-000002.nc"
        with xr.open_dataset(kept, decode_times=False) as beside:
            assert_same_numbers(beside.drop_vars("core_seconds"), history.drop_vars("core_seconds"))
    # By CF a time coordinate is known by units "... since ...", and time since the start is none; the checker
    # goes by the name alone.
    findings = cf_findings(folder / "h.nc")
    assert [finding for finding in findings if "Coordinate variable 'time'" not in finding] == []
    with Image.open(folder / "h.png") as picture:
        assert min(picture.size) > 500
        # lines, shades and letters, not an empty sheet
        assert len(picture.convert("RGB").getcolors(1 << 20)) > 20


@pytest.mark.slow
def test_simulate_of_a_run_that_fails_ends_with_1_and_still_draws(folder, capsys):
    bare = ["--set", "most_refinements=0"]  # else the run is done again at half the step, and well
    assert main(["simulate", "small.toml", "--at", "step=20 us", *bare, "--plot", "f.png"]) == 1
    assert "cvt-hpc: the run failed: failed_numerics: at " in capsys.readouterr().err
    assert (folder / "f.png").exists()


def ink(picture, colour, tolerance=12):
    """Number of pixels of a colour."""
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return int((np.abs(pixels - wanted).max(axis=2) <= tolerance).sum())


@pytest.mark.slow
def test_runs_with_a_step_too_long_are_failed_on_the_map_not_quiet(folder, capsys):
    job = JOB.replace("sheave_stiffness = [1.0, inf]", 'step = ["2.5 us", "50 us"]').replace(
        ', "450 N m"', ""
    )
    (folder / "steps.toml").write_text(job)
    assert main(["run", "steps.toml", "--set", "most_refinements=0", "--out", "steps"]) == 1
    named = [line for line in capsys.readouterr().err.splitlines() if ": failed_numerics:" in line]
    assert len(named) == 3
    assert named[0].startswith("cvt-hpc: run 3 (step = 50 us, load = 0 N m): failed_numerics: at ")
    dataset = load_results(folder / "steps")
    classes = occurrence_classes(dataset)
    assert (classes.sel(step=50e-6) == OccurrenceClass.FAILED).all()
    assert (classes.sel(step=2.5e-6) != OccurrenceClass.FAILED).all()
    assert classes.sel(step=2.5e-6, load=0.0) == OccurrenceClass.QUIET
    assert classes.sel(step=2.5e-6, load=120.0) == OccurrenceClass.VIBRATING
    assert (main(["map", "steps"]), capsys.readouterr().out) == (0, "map: steps/map.png\n")
    assert main(["map", "steps", "--at", "step=2.5 us", "--out", "good.png"]) == 0
    # the red of failed runs covers their half of the map, hatching between white, and is nowhere else
    red = STYLES[OccurrenceClass.FAILED].ink
    assert ink(folder / "steps" / "map.png", red) > 10 * max(ink(folder / "good.png", red), 100)


def test_a_serial_run_does_without_mpi4py(serial, folder):
    (folder / "site").mkdir()
    (folder / "site" / "sitecustomize.py").write_text(
        "import sys\n"
        "class Hidden:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.partition('.')[0] == 'mpi4py':\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Hidden())\n"
    )
    paths = [str(folder / "site"), environment().get("PYTHONPATH", "")]
    path = {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    hidden = subprocess.run(
        [sys.executable, "-c", "import mpi4py"], env=environment(**path), capture_output=True, text=True
    )
    assert "No module named 'mpi4py'" in hidden.stderr
    done = call("run", "small.toml", cwd=folder, **path)
    assert done.returncode == 0, done.stderr
    assert_same_numbers(load_results(folder / "out" / "small"), load_results(serial))
