"""What a job would do: `cvt-hpc check`, its forecasts, and dry runs."""

import sys

import pytest

from cvt_hpc.models import MODELS
from cvt_hpc.variables import Status, Variable
from support.toy_jobs import GRID, TRACED

pytestmark = pytest.mark.usefixtures("mechanics")


def test_check_prints_every_parameter_with_its_origin_the_axes_and_the_cost(write_job, call, tmp_path):
    write_job(GRID, head='name = "x"\nmodel = "toy"\ndescription = "a study"\n')
    overrides = ("--set", "element_mass=1500 g/m", "--set", "table=[[1, 2.5], [3]]")
    status, out, err = call("check", "x.toml", *overrides)
    assert (status, err) == (0, [])
    assert out[:11] == [
        "job x (x.toml): model toy, stepper hop",
        "a study",
        "",
        f"models: {', '.join(MODELS)}",
        "steppers of toy: hop",
        "",
        "[scene]",
        "  ratio          2.5                      default  speed ratio",
        "  driving_speed  300 rad/s (2864.79 rpm)  default  speed of the driving pulley",
        "  thrust         20 kN                    given    axial force on the driven pulley",
        "  load           see [axes]               axis     torque at the driving pulley",
    ]
    told = [" ".join(line.split()) for line in out]
    assert "element_mass 1500 g/m given mass per length" in told
    assert "table [[1, 2.5], [3]] N/m given rows of line forces" in told
    assert "load_history constant default how the load is applied (constant, ramp)" in told
    assert "refined false default finer on the arcs" in told
    assert out[-7:] == [
        "[axes]",
        "  load              0, 25, 50, 75, 100 N m  5 values",
        "  sheave_stiffness  1, 3                    2 values",
        "",
        "runs: 10 = 5 x 2",
        "estimated cost: 30 core-seconds per run, 300 core-seconds in all",
        "needed: 4 kB of memory for the plan; disk: 2.74 kB of records, at most 27.4 kB of results.nc",
    ]
    assert call("run", "x.toml", *overrides, "--dry-run") == (0, out, [])
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]


@pytest.mark.parametrize(
    "options",
    [
        ["--part", "9/3"],
        ["--part", "1/3", "--fresh"],
        ["--part", "1/3", *TRACED],
        ["--time-limit", "foo"],
        ["--run-limit", "foo"],
        ["--out", "x.toml"],
        ["--set", "load=x"],
    ],
)
def test_a_dry_run_refuses_what_a_run_refuses(write_job, call, tmp_path, options):
    write_job(GRID)
    status, out, err = call("run", "x.toml", *options)
    assert (status, out, len(err)) == (2, [], 1)
    assert call("run", "x.toml", *options, "--dry-run") == (2, [], err)
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]


@pytest.mark.parametrize("command", [["check"], ["run", "--dry-run"], ["run"]])
def test_an_axis_that_the_dataset_could_not_hold_is_refused_by_all(
    write_job, call, tmp_path, monkeypatch, command
):
    write_job(GRID)
    recorded = (Variable("status", "", "how the run ended", dtype="i1", flags=Status),
                Variable("load", "N m", "mean torque"))  # fmt: skip
    monkeypatch.setattr(sys.modules["cvt_hpc.simulation"], "record_variables", lambda job: recorded)
    status, out, err = call(command[0], "x.toml", *command[1:])
    assert (status, out) == (2, [])
    assert err == [
        "cvt-hpc: x.toml: [axes] load: expected a parameter that is not also the name of a recorded quantity, found load"
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]


def test_check_forecasts_a_sweep_on_several_numbers_of_ranks(write_job, call, tmp_path):
    write_job(GRID)
    status, out, err = call("check", "x.toml", "--ranks", "1", "10", "--plot", "x.png")
    assert (status, err) == (0, [])
    head, names, *rows, disk, picture = out[-6:]
    assert head == "forecast of all 10 runs by predicted costs, right within a factor of two:"
    assert names.split() == [
        "ranks",
        "makespan",
        "95",
        "%",
        "of",
        "sweeps",
        "efficiency",
        "core-hours",
        "--time",
    ]
    assert [row.split()[0] for row in rows] == ["1", "10"]
    assert rows[0].split()[5] == "100%"
    assert rows[0].endswith("  00:05:00")
    assert disk == "disk: 3.06 kB of records, at most 27.4 kB of results.nc"
    assert picture == "picture: x.png"
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.png", "x.toml"]


def test_check_forecasts_by_what_is_on_record(write_job, call):
    write_job(GRID)
    call("run", "x.toml")
    assert "forecast of all 10 runs by batches on record (9):" in call("check", "x.toml", "--ranks", "2")[1]
    rigid = call("check", "x.toml", "--ranks", "2", "--pilots", "1", "--set", "sheave_stiffness=inf")[1]
    assert rigid[-4].endswith("within a factor of two; no pilot batch came to its end:")
    # a trace is another job, and has no records
    traced = call("check", "x.toml", "--ranks", "2", *TRACED)[1]
    assert traced[-4].endswith("factor of two, if all cells of the grid are run:")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--ranks", "4", "0"], "--ranks: expected numbers of ranks from 1 to 1000000, found 0"),
        (["--ranks", "4", "1000001"], "--ranks: expected numbers of ranks from 1 to 1000000, found 1000001"),
        (["--ranks", "4", "--pilots", "-1"], "--pilots: expected a number of batches, found -1"),
        (["--pilots", "2"], "--pilots: expected --ranks beside it, found none"),
        (["--plot", "x.png"], "--plot: expected --ranks beside it, found none"),
        (["--ranks", "4", "--plot", "x.gif"], "x.gif: expected a file name in .png, .svg, .pdf, found .gif"),
    ],
)
def test_a_forecast_that_makes_no_sense_is_refused(write_job, call, options, message):
    write_job(GRID)
    assert call("check", "x.toml", *options) == (2, [], [f"cvt-hpc: {message}"])


def test_check_shortens_long_axes_and_long_times(write_job, call):
    write_job("[scene]\nthrust = 2e4\n[axes]\nload = { from = 0, to = 120, step = 0.5 }\n")
    assert call("check", "x.toml")[1][-5:] == [
        "  load  0, 0.5, 1, ..., 120 N m  241 values",
        "",
        "runs: 241",
        "estimated cost: 30 core-seconds per run, 2.01 core-hours in all",
        "needed: 96.4 kB of memory for the plan; disk: 66 kB of records, at most 78.3 kB of results.nc",
    ]
