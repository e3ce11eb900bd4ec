"""`cvt-hpc growth`: modes by twin runs, against exact rates and eigenvalues; its files, and its errors."""

import csv

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.experiments.growth import find_growth, load
from cvt_hpc.experiments.sweeps import handed
from cvt_hpc.job import build_job
from cvt_hpc.models.contract import load_model
from cvt_hpc.models.linear_stability.record import solve
from cvt_hpc.study import run
from cvt_hpc.tables import below_origin
from support.cf import cf_findings
from support.rungs import scene_tables

OSCILLATOR = """name = "mass"
model = "oscillator"
stepper = "runge_kutta_4"
[axes]
friction_gradient = ["-0.3 s/m", "0 s/m"]
belt_speed = ["200 mm/s", "0.01 mm/s"]
[scene]
start = "sliding"
normal_load = "1 kN"
[oscillator]
stiffness = "1e7 N/m"
damping = "150 N s/m"
[friction]
friction_law = "linear"
stribeck_velocity = "1 m/s"
[run]
duration = "50 ms"
[numerics]
step = "10 us"
"""
BELT = """name = "belt"
model = "elastic_belt"
[axes]
load = [60]
[scene]
rise_time = "40 ms"
[mesh]
stations = 112
[run]
duration = "0.08 s"
""" + scene_tables("elastic_belt")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_oscillator_has_its_exact_growth(folder, capsys):
    (folder / "mass.toml").write_text(OSCILLATOR)
    assert main(["growth", "mass.toml"]) == 1
    told = capsys.readouterr()
    with xr.open_dataset(folder / "out" / "mass" / "growth.nc") as dataset:
        found = dataset.load()
    for gradient in (-0.3, 0.0):
        cell = found.sel(friction_gradient=gradient, belt_speed=0.2)
        growth = -0.5 * (150.0 + 1000.0 * gradient)
        assert cell["growth_rate"][0] == pytest.approx(growth, abs=1e-3)
        assert cell["frequency"][0] == pytest.approx(np.sqrt(1e7 - growth**2) / (2.0 * np.pi), rel=1e-6)
        assert cell["growth_rate_error"][0] < 1e-3 and cell["share"][0] == pytest.approx(1.0)
        assert np.isnan(cell["growth_rate"][1]) and cell["floor"] < 1e-6 * cell["difference"]
        assert f"{growth:.3f} +- 0.000" in told.out
    slow = found.sel(friction_gradient=-0.3, belt_speed=1e-5)
    assert np.isnan(slow["growth_rate"]).all() and slow["reason"].item().startswith("failed_numerics: at ")
    assert slow["reason"].item() in told.out
    with (folder / "out" / "mass" / "growth.csv").open() as table:
        rows = list(csv.DictReader(below_origin(table)))
    assert [row["growth_rate [s-1]"] == "" for row in rows] == [False, True, False, True]
    assert {row["belt_speed [mm/s]"] for row in rows} == {"200", "0.01"}
    assert cf_findings(folder / "out" / "mass" / "growth.nc") == []


def test_an_elastic_belt_has_the_eigenvalues_of_its_steady_state(folder):
    (folder / "belt.toml").write_text(BELT)
    asked = load("belt.toml")
    assert [rung.name for rung in asked.rungs] == ["twins", "linear_stability"]
    run(asked.rungs[0].job, "out/twins", progress=False)
    (found,) = find_growth(asked, folder / "out")
    assert found.reason == "" and found.floor < 0.05 * found.difference
    modes = solve(handed(asked.job, "linear_stability", {}).point(0)).modes
    for growth, error, frequency in zip(
        found.modes.growth, found.growth_error, found.modes.frequency, strict=True
    ):
        near = [mode.growth for mode in modes if abs(mode.frequency - frequency) < 0.05 * frequency]
        assert min(abs(growth - one) for one in near) < error + 20.0


@pytest.mark.parametrize("name", ["pushbelt", "spatial_pushbelt"])
def test_a_kick_of_a_pushbelt_is_a_speed_outwards_of_both_strands(name):
    model = load_model(name)
    small = {
        "elements": 104,
        "band_high": 1000.0,
        "rise_time": 0.004,
        "duration": 0.04,
        "judged_fraction": 0.85,
    }
    job = build_job({"name": "kicked", "model": name}, "kicked", small)
    runs = [model.batch([job.point(0) | {"kick": kick}], job.stepper).runs[0] for kick in (0.0, 0.1, 0.2)]
    for one in runs:
        one.advance(one.first_judged + 1)
    rest, half, whole = (one.displacement for one in runs)
    first = runs[0].first_judged
    np.testing.assert_array_equal(whole[:first], rest[:first])
    moved = (whole[first] - rest[first])[:10]
    # outwards everywhere on both strands, by nearly the largest speed at the second of five probes
    assert (moved > 0.0).all() and np.all(moved[[1, 6]] == moved.reshape(2, 5).max(axis=1))
    assert moved[[1, 6]] == pytest.approx(0.2 * runs[0].interval, rel=0.1)
    np.testing.assert_allclose((half[first] - rest[first])[:10], 0.5 * moved, rtol=0.05)


def test_what_growth_refuses(folder, capsys):
    (folder / "belt.toml").write_text(BELT)
    for arguments, told in (
        (["--set", "model=auto"], "model: expected one whose runs can be kicked (beam_pushbelt, "),
        (
            ["--set", "disturbance=[1e-6, 1e-5]"],
            "[axes] disturbance: expected none: growth takes a kick of its own",
        ),
        (["--kick", "0 m"], "--kick: expected a value above 0, found 0 m"),
        (["--kick", "3 N"], "--kick: "),
    ):
        assert main(["growth", "belt.toml", *arguments]) == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1 and told in lines[0]


def test_runs_of_a_twin_are_neither_ended_early_nor_prolonged_nor_refined(folder):
    (folder / "belt.toml").write_text(BELT)
    asked = load("belt.toml", {"disturbance": "1 um", "longest_duration": "1 s"}, "4 um")
    twins = asked.rungs[0].job
    assert [axis.name for axis in twins.axes] == ["load", "disturbance"] and asked.kick == 4e-6
    assert twins.axes[1].values == (0.0, 2e-6, 4e-6) and twins.histories == (0, 1, 2)
    p = twins.parameters
    assert p["longest_duration"] == p["duration"] == 0.08 and p["most_refinements"] == 0
    assert p["precision"] == "double"
    single = load("belt.toml", {"precision": "single"}).rungs[0].job
    assert single.parameters["precision"] == "single"
    with pytest.raises(InputError, match=r"\[design\]: expected none"):
        load("belt.toml", {"design.kind": "sobol", "design.runs": 4, "load": {"from": 50, "to": 60}})
