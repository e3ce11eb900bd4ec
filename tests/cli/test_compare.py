"""`cvt-hpc compare` on studies of the toy model."""

import csv
import sys

import pytest

from cvt_hpc.variables import Vibrates
from support.toy_jobs import GRID

pytestmark = pytest.mark.usefixtures("mechanics")


def contrary_at(load, monkeypatch):
    """Let the runs at one load vibrate where they are quiet, and the other way round."""
    double = sys.modules["cvt_hpc.simulation"]  # the double of this room

    run_points = double.run_points

    def contrary(job, points, interrupt, more):
        records = run_points(job, points, interrupt)
        for point, record in zip(points, records, strict=True):
            if point["load"] == load:
                record["vibrates"] = Vibrates(1 - record["vibrates"])
        return records

    monkeypatch.setattr(double, "run_points", contrary)


def test_studies_that_agree_and_studies_that_do_not(write_job, call, tmp_path, monkeypatch):
    write_job(GRID)
    call("run", "x.toml")
    call("run", "x.toml", "--set", "step=2e-6", "--out", "out/coarse")
    status, out, err = call("compare", "out/x", "out/coarse")
    assert (status, err) == (0, [])
    assert "differs: numerics.step: 1e-06 in A, 2e-06 in B" in out
    assert out[-3:] == [
        "0 of 10 cells contradict (quiet against vibrating), 0 of them beyond the threshold (larger amplitude "
        "not within 20% of it)",
        "picture: out/coarse/compare.png",
        "table: out/coarse/compare.csv",
    ]
    assert (tmp_path / "out/coarse/compare.png").read_bytes().startswith(b"\x89PNG")
    contrary_at(75, monkeypatch)
    call("run", "x.toml", "--set", "step=3e-6", "--out", "out/wrong")
    status, out, err = call("compare", "out/x/results.nc", "out/wrong/results.nc", "--out", "found")
    assert (status, err) == (1, [])
    assert "  load = 75 N m, sheave_stiffness = 1: vibrating | quiet" in out
    rows = list(csv.DictReader((tmp_path / "found/compare.csv").open()))
    assert [row["load [N m]"] for row in rows if row["pair"] == "vibrates in A only"] == ["75.0"] * 2


def test_two_designs_are_compared_without_a_contradiction(write_job, call, monkeypatch):
    write_job(GRID)
    call("run", "x.toml")
    contrary_at(75, monkeypatch)
    call("run", "x.toml", "--set", "thrust=30 kN", "--out", "out/other")
    status, out, err = call("compare", "out/x", "out/other")
    assert (status, err) == (0, [])
    assert any(line.startswith("two designs: of 10 cells B is better in 2") for line in out)


def test_studies_of_other_grids(write_job, call):
    write_job(GRID)
    call("run", "x.toml")
    call("run", "x.toml", "--set", "sheave_stiffness=3", "--out", "out/one")
    status, out, _ = call("compare", "out/x", "out/one")
    assert (status, out[:2]) == (0, ["A: out/x; 5 of its runs left out, unknown there", "B: out/one"])
    call("run", "x.toml", "--set", "sheave_stiffness=2", "--out", "out/other")
    status, out, err = call("compare", "out/x", "out/other")
    assert (status, out) == (2, [])
    assert err == ["cvt-hpc: out/x: axis sheave_stiffness: expected one of 1, 3, found 2 in out/other"]


def test_cells_are_named_in_the_units_of_the_job(write_job, call, tmp_path, monkeypatch):
    write_job('[scene]\nthrust = "20 kN"\n[axes]\nload = ["0.025 kN m", "0.075 kN m"]\n')
    call("run", "x.toml")
    call("run", "x.toml", "--set", "load=50", "--out", "out/one")
    assert call("compare", "out/x", "out/one")[2] == [
        "cvt-hpc: out/x: axis load: expected one of 0.025, 0.075 [kN m], found 0.05 kN m in out/one"
    ]
    contrary_at(75, monkeypatch)
    call("run", "x.toml", "--out", "out/wrong")
    assert "  load = 0.075 kN m: vibrating | quiet" in call("compare", "out/x", "out/wrong")[1]
    rows = list(csv.DictReader((tmp_path / "out/wrong/compare.csv").open()))
    assert [row["load [kN m]"] for row in rows] == ["0.025", "0.075"]
    # the units are no part of what determines the numbers
    status, out, err = call("run", "x.toml", "--set", "load=[25, 75]")
    assert (status, out[0], err[1:]) == (0, "2 runs: 2 done, 0 failed, 0 left", [])
    assert call("map", "out/x", "--at", "load=75 N m")[2] == [
        "cvt-hpc: out/x: expected results over one axis or more to be drawn, found a single run; "
        "`cvt-hpc simulate` draws one"
    ]


def test_bad_input_is_one_line(write_job, call):
    write_job(GRID)
    call("run", "x.toml")
    assert call("compare", "out/x", "out/y") == (
        2,
        [],
        ["cvt-hpc: out/y: expected a netCDF dataset, found nothing; did you mean out/x?"],
    )
    status, _, err = call("compare", "out/x")
    assert status == 2 and "the following arguments are required" in err[0]
