"""The commands within this process, on the toy model and runs without mechanics."""

import re
import sys

import netCDF4
import numpy as np
import pytest

from cvt_hpc.cli.parts import colour_end, picture_beside
from cvt_hpc.errors import INTERRUPTED, InputError
from cvt_hpc.printing import report_lines
from cvt_hpc.study import FailedRun, RunReport, StudyStatus
from cvt_hpc.variables import Status
from support.toy_jobs import GRID

pytestmark = pytest.mark.usefixtures("mechanics")


def test_run_status_gather_and_map_of_one_study(write_job, call, tmp_path):
    write_job(GRID)
    status, out, err = call("run", "x.toml")
    then = "next: cvt-hpc map out/x; cvt-hpc report out/x"
    assert (status, out) == (0, ["10 runs: 10 done, 0 failed, 0 left", "results: out/x/results.nc", then])
    assert not [line for line in err if line.startswith("cvt-hpc:")]
    status, out, err = call("status", "out/x")
    assert (status, err) == (0, [])
    assert re.fullmatch(
        r"job     x \(finished \d{4}-\d\d-\d\d \d\d:\d\d UTC, after 0:00:\d\d at work\)", out[0]
    )
    assert out[1:5] == [
        "runs    10",
        "done    10 (100.0%)",
        "failed  0",
        "left    0",
    ]
    assert [line.split()[0] for line in out[5:]] == ["rate"]
    (tmp_path / "out/x/results.nc").unlink()
    assert call("gather", "out/x") == (0, ["results: out/x/results.nc"], [])
    with netCDF4.Dataset("out/x/results.nc") as results:
        assert results["vibrates"][:].tolist() == [[0, 0]] * 2 + [[1, 1]] * 3
    assert call("map", "out/x", "--at", "sheave_stiffness=3") == (
        0,
        ["map: out/x/map_sheave_stiffness=3.png"],
        [],
    )
    assert call("report", "out/x", "--every", "1s") == (0, ["report: out/x/report.html"], [])
    assert call("report", "out/x", "--follow") == (0, ["report: out/x/report.html"], [])
    assert "(finished" in (tmp_path / "out/x/report.html").read_text()
    status, _, told = call("report", "out/x", "--every", "soon")
    assert status == 2 and told[0].startswith("cvt-hpc: --every: expected")
    assert call("map", "out/x/results.nc", "--out", "y.png") == (0, ["map: y.png"], [])
    assert call("map", "out/x", "out/x/results.nc") == (0, ["map: out/x/maps.png"], [])
    status, _, told = call("map", "out/x", "--show", "vibrate", "--vmax", "20 um")
    assert status == 2 and "unknown numeric variable of the results; did you mean vibrates?" in told[0]
    curve = "plot", "curve", "out/x", "vibrates", "--at", "sheave_stiffness=3"
    assert call(*curve) == (0, ["picture: out/x/curve_vibrates_sheave_stiffness=3.png"], [])
    for picture in (
        "out/x/map_sheave_stiffness=3.png",
        "y.png",
        "out/x/curve_vibrates_sheave_stiffness=3.png",
    ):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")


def test_samples_keep_the_spacing_of_their_ranges(write_job, call, tmp_path):
    write_job("""[scene]
thrust = "20 kN"
[design]
kind = "sobol"
runs = 8
[axes]
load = { from = 20, to = 100 }
sheave_stiffness = { from = 1, to = 3, spacing = "log" }
""")
    assert call("run", "x.toml")[0] == 0
    with netCDF4.Dataset("out/x/results.nc") as results:
        spacings = {name: getattr(results[name], "spacing", None) for name in ("load", "sheave_stiffness")}
    assert spacings == {"load": None, "sheave_stiffness": "log"}
    assert call("map", "out/x") == (0, ["map: out/x/map.png"], [])


def test_run_goes_on_unless_fresh(write_job, call, tmp_path, monkeypatch):
    write_job(GRID)
    call("run", "x.toml", "--out", "here")
    logs = set((tmp_path / "here/records").iterdir())
    assert call("run", "x.toml", "--out", "here")[1][0] == "10 runs: 10 done, 0 failed, 0 left"
    assert set((tmp_path / "here/records").iterdir()) == logs
    assert call("run", "x.toml", "--out", "here", "--fresh")[0] == 0
    assert not logs & set((tmp_path / "here/records").iterdir())


AGAIN = "cvt-hpc: the same command with --retry failed_numerics does them again, at half the step where they take steps"


def test_run_names_failed_runs_and_ends_with_1(write_job, call):
    write_job(GRID)
    status, out, err = call("run", "x.toml", "--set", "sheave_stiffness=inf", "--set", "thrust=0.03 MN")
    assert status == 1
    assert out == ["5 runs: 0 done, 5 failed, 0 left", "results: out/x/results.nc"]
    named = [line for line in err if line.startswith("cvt-hpc:")]
    assert named == [
        f"cvt-hpc: run {i} (load = {load} N m): failed_numerics: step 3: too stiff"
        for i, load in enumerate((0, 25, 50, 75, 100))
    ] + [AGAIN]


def test_failed_runs_are_named_in_the_units_of_the_job(write_job, call):
    write_job('[scene]\nthrust = 2e4\n[belt]\nsheave_stiffness = inf\n[axes]\ndriving_speed = ["3000 rpm"]\n')
    named = [line for line in call("run", "x.toml")[2] if line.startswith("cvt-hpc:")]
    assert named == ["cvt-hpc: run 0 (driving_speed = 3000 rpm): failed_numerics: step 3: too stiff", AGAIN]
    # and so they are by a start that finds the folder
    assert [line for line in call("run", "x.toml")[2] if line.startswith("cvt-hpc:")] == named


def test_ten_failed_runs_are_named_and_the_rest_counted(write_job, call):
    write_job("[scene]\nthrust = 2e4\nsheave_stiffness = inf\n".replace("sheave", "[belt]\nsheave") +
              "[axes]\nload = {from = 0, to = 11, step = 1}\n")  # fmt: skip
    named = [line for line in call("run", "x.toml")[2] if line.startswith("cvt-hpc:")]
    assert [line.split()[2] for line in named[:10]] == [str(i) for i in range(10)]
    more = "cvt-hpc: 2 more runs failed; `status` and `reason` in the results tell which"
    assert named[10:] == [more, AGAIN]


def test_a_stopped_sweep_ends_with_99(write_job, call, monkeypatch, tmp_path):
    write_job(GRID)
    failed = (
        FailedRun(
            3, {"load": 5.0, "law": "coulomb"}, "load = 5 N m, law = coulomb", "failed_error", "ValueError: x"
        ),
    )
    report = RunReport(tmp_path, tmp_path / "results.nc", 10, 4, failed, 5, "SIGTERM", 1)
    monkeypatch.setattr("cvt_hpc.study.run", lambda job, out, **options: report)
    status, out, err = call("run", "x.toml")
    assert status == 99
    assert out[0] == "10 runs: 4 done, 1 failed, 5 left"
    assert err == [
        "cvt-hpc: run 3 (load = 5 N m, law = coulomb): failed_error: ValueError: x",
        "cvt-hpc: stopped early (SIGTERM); the same command goes on from here",
    ]


def test_a_sweep_that_stopped_before_any_run_had_ended_needs_more_time(
    write_job, call, monkeypatch, tmp_path
):
    write_job(GRID)
    report = RunReport(tmp_path, tmp_path / "results.nc", 10, 4, (), 6, "time limit", 0)
    monkeypatch.setattr("cvt_hpc.study.run", lambda job, out, **options: report)
    status, _, err = call("run", "x.toml", "--time-limit", "1s")
    assert (status, err) == (
        98,
        ["cvt-hpc: stopped early (time limit) before any run had ended; give it more time"],
    )


def test_limits_and_retries_reach_the_sweep(write_job, call, monkeypatch, tmp_path):
    write_job(GRID)
    given = {}
    report = RunReport(tmp_path, tmp_path / "results.nc", 10, 10, (), 0, None, 10)
    monkeypatch.setattr("cvt_hpc.study.run", lambda job, out, **options: given.update(options) or report)
    options = (
        "--time-limit",
        "2h30m",
        "--run-limit",
        "10 min",
        "--retry",
        "timed_out",
        "--retry",
        "failed_error",
    )
    assert call("run", "x.toml", *options)[0] == 0
    assert given == {
        "part": None,
        "fresh": False,
        "time_limit": 9000.0,
        "run_limit": 600.0,
        "retry": [Status.TIMED_OUT, Status.FAILED_ERROR],
        "raises": False,
    }
    given.clear()
    call("run", "x.toml")
    assert given == {"part": None, "fresh": False, "retry": [], "raises": False}


def test_status_of_a_sweep_at_work(call, monkeypatch):
    status = StudyStatus("x", 40, 10, 2, 28, True, 0.01234, 3725.0, ("a.log: damaged",))
    monkeypatch.setattr("cvt_hpc.study.read_status", lambda path: status)
    assert call("status", "out/x") == (
        0,
        [
            "job     x (running)",
            "runs    40",
            "done    10 (25.0%)",
            "failed  2",
            "left    28",
            "rate    0.0123 runs/s",
            "to go   1:02:05",
        ],
        ["cvt-hpc: a.log: damaged"],
    )


def test_slipping_and_irregular_runs_are_counted(call, monkeypatch, tmp_path):
    status = StudyStatus("x", 40, 30, 2, 8, False, None, None, (), slipping=3, irregular=1, undecided=2)
    monkeypatch.setattr("cvt_hpc.study.read_status", lambda path: status)
    assert "done    30 (75.0%), of these 2 undecided, 3 slip, 1 irregular" in call("status", "out/x")[1]
    report = RunReport(tmp_path, tmp_path / "results.nc", 40, 40, (), 0, None, 40, slipping=3)
    assert list(report_lines(report))[:2] == ["40 runs: 40 done, 0 failed, 0 left", "of those done 3 slip"]
    assert report.exit_status == 0


def test_another_job_in_the_folder_is_refused_and_kept(write_job, call, tmp_path):
    write_job(GRID)
    call("run", "x.toml")
    before = (tmp_path / "out/x/results.nc").read_bytes()
    status, out, err = call("run", "x.toml", "--set", "thrust=30 kN")
    assert (status, out, len(err)) == (2, [], 1)
    assert (tmp_path / "out/x/results.nc").read_bytes() == before


def test_pictures_are_named_by_dataset_kind_quantity_and_place(tmp_path):
    def name(path, *words, files=()):
        return (
            picture_beside(path, [tmp_path / file for file in files], *words).relative_to(tmp_path).as_posix()
        )

    study, run = tmp_path / "study", tmp_path / "run-000001.nc"
    study.mkdir()
    assert name(study, "map", "loss", "load=20 N m") == "study/map_loss_load=20_N_m.png"
    assert name(study / "results.nc", "map", files=["study/results.nc"]) == "study/map.png"
    assert name(run, "wrap", files=[run.name]) == "run-000001_wrap.png"
    assert name(run, "wrap", files=["a.nc", "b.nc"]) == "a_b_wrap.png"
    many = [f"run-{k:06d}.nc" for k in range(40)]
    assert name(study, "ramp", "t1", files=many) == "study/run-000000_and_39_more_ramp_t1.png"


def test_simulate_prints_the_outcome_and_keeps_the_history(write_job, call, mechanics):
    write_job(GRID)
    arguments = ("--at", "load=0.05 kN m", "--set", "ratio=2", "--out", "new/h.nc", "--plot", "h.png")
    status, out, err = call("simulate", "x.toml", *arguments)
    assert (status, err) == (0, [])
    assert out == [
        "at      load 0.05 kN m, sheave stiffness 1",
        "status     done",
        "vibrates   yes",
        "amplitude  t1 1, t2 25 um",
        "load       50 N m",
        "steps      3",
        "history: new/h.nc",
        "picture: h.png",
    ]
    ((written, where),) = mechanics["written"]
    ((drawn, picture),) = mechanics["drawn"]
    assert (str(where), str(picture)) == ("new/h.nc", "h.png")
    assert written is drawn and written["load"] == 50


def test_simulate_prints_what_matters_and_the_rest_when_asked(write_job, call, mechanics, monkeypatch):
    write_job(GRID)
    double = sys.modules["cvt_hpc.simulation"]
    made = double.simulate
    forces = {f"force_{k}": ((), 2.5e3 * 10.0**-k, {"units": "N"}) for k in range(12)}
    speed = {"efficiency": ((), 0.9, {"units": "1"}), "driven_speed": ((), np.pi, {"units": "rad s-1"})}
    monkeypatch.setattr(double, "simulate", lambda job, at: made(job, at).assign(forces).assign(speed))
    command = ("simulate", "x.toml", "--set", "thrust=20 kN", "--set", "driving_speed=30 rpm")
    status, out, err = call(*command)
    assert (status, err, len(out)) == (0, [], 13)
    told = [" ".join(line.split()) for line in out[1:]]
    assert told[:4] == ["status done", "vibrates no", "amplitude t1 1, t2 25 um", "efficiency 0.9"]
    assert told[-1] == "8 more by --all"
    whole = [" ".join(line.split()) for line in call(*command, "--all")[1][1:]]
    assert whole[:11] == told[:11] and len(whole) == 19
    assert {"force 0 2.5 kN", "force 3 2.5 N", "force 11 2.5e-08 N", "driven speed 30 rpm"} <= set(whole)


def test_simulate_replaces_an_earlier_history(write_job, call, tmp_path, mechanics):
    write_job(GRID)
    (tmp_path / "history.nc").write_text("earlier")
    assert call("simulate", "x.toml", "--out", "history.nc")[0] == 0
    assert len(mechanics["written"]) == 1


def test_simulate_of_a_run_that_fails_ends_with_1(write_job, call):
    write_job(GRID)
    status, out, err = call("simulate", "x.toml", "--at", "sheave_stiffness=inf")
    assert status == 1
    # no verdict, and no number that is none
    assert out == [
        "at      load 0 N m, sheave stiffness inf",
        "status  failed_numerics",
        "reason  step 3: too stiff",
        "steps   3",
    ]
    assert err == ["cvt-hpc: the run failed: failed_numerics: step 3: too stiff"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "y.toml"], "y.toml: expected a job file, found nothing; did you mean x.toml?"),
        (
            ["run", "x.toml", "--set", "laod=1"],
            "x.toml: --set laod: unknown key; did you mean load in [scene]?",
        ),
        (["check", "x.toml", "--set", "load"], 'x.toml: --set: expected KEY=VALUE, found "load"'),
        (
            ["simulate", "x.toml", "--at", "load=1 kg"],
            'x.toml: --at load: expected a value in N m (such as "1 N m" or a bare number in N m), found "1 kg"',
        ),
        (
            ["simulate", "x.toml", "--at", "load=1 kN m"],
            "x.toml: [scene] load: expected at most 200 N m at this thrust, found 1000 N m (1 kN m) (at load = 1 kN m)",
        ),
        (["simulate", "x.toml", "--out", "h.txt"], "h.txt: expected a file name in .nc, found .txt"),
        (
            ["simulate", "x.toml", "--plot", "h"],
            "h: expected a file name in .png, .svg, .pdf, found no suffix",
        ),
        (
            ["simulate", "x.toml", "--out", "d.nc"],
            "d.nc: expected a file that can be written, found a folder of this name",
        ),
        (
            ["simulate", "x.toml", "--plot", "x.toml/new/h.png"],
            "x.toml/new/h.png: expected a file that can be written, found the file HERE/x.toml in the place of a folder",
        ),
        (
            ["simulate", "x.toml", "--out", "notes.nc"],
            "notes.nc: expected a new file, or a history written by cvt_hpc, found another file",
        ),
        (
            ["status", "out/x"],
            "out/x: expected the output folder of a run, found nothing; `cvt-hpc run JOB.toml` makes one",
        ),
        (
            ["gather", "x.toml"],
            "x.toml: expected the output folder of a run, found a file; `cvt-hpc run x.toml` computes its results, "
            "in out/NAME unless --out says otherwise",
        ),
        (
            ["map", "x.toml"],
            "x.toml: expected the output folder of a run, or a dataset, found a job file; `cvt-hpc run x.toml` "
            "computes its results, in out/NAME unless --out says otherwise",
        ),
        (["map", "out/x"], None),
        (
            ["plot", "wrap", "absent.nc"],
            "absent.nc: expected a history written by `cvt-hpc simulate --out`, found nothing; `cvt-hpc simulate JOB "
            "--out absent.nc` writes one",
        ),
        (
            ["plot", "history", "notes.nc"],
            "notes.nc: expected a history written by `cvt-hpc simulate --out`, found another file; `cvt-hpc map` and "
            "`cvt-hpc plot curve` draw the results of a study",
        ),
        (["plt"], "argument COMMAND: invalid choice: 'plt'; did you mean plot?; see `cvt-hpc --help`"),
        (
            ["plot", "histroy", "x.nc"],
            "argument KIND: invalid choice: 'histroy'; did you mean history?; see `cvt-hpc plot --help`",
        ),
        (
            ["plot", "waterfall", "out/x", "--out", "h"],
            "h: expected a file name in .png, .svg, .pdf, found no suffix",
        ),
        (["run"], "the following arguments are required: JOB; see `cvt-hpc run --help`"),
        (
            ["run", "x.toml", "--run-limit", "10 N"],
            '--run-limit: expected a time above 0, such as "2h30m", "90 min" or a bare number in s, found "10 N"',
        ),
        (["run", "x.toml", "--fast"], "unrecognized arguments: --fast; see `cvt-hpc --help`"),
        ([], "the following arguments are required: COMMAND; see `cvt-hpc --help`"),
    ],
)
def test_bad_input_is_one_line_and_2(write_job, call, tmp_path, mechanics, arguments, message):
    write_job(GRID)
    (tmp_path / "d.nc").mkdir()
    (tmp_path / "notes.nc").write_text("mine")
    status, out, err = call(*arguments)
    assert (status, out, len(err)) == (2, [], 1)
    if message is not None:
        assert [line.replace(str(tmp_path), "HERE") for line in err] == [f"cvt-hpc: {message}"]
    assert mechanics == {"written": [], "drawn": []}
    assert not (tmp_path / "out").exists()


def test_a_folder_closed_to_writing_is_named(write_job, call, monkeypatch, tmp_path, mechanics):
    write_job(GRID)
    monkeypatch.setattr("os.access", lambda path, mode: path != tmp_path)
    assert call("simulate", "x.toml", "--out", "h.nc") == (
        2,
        [],
        [f"cvt-hpc: h.nc: expected a file that can be written, found no permission to write to {tmp_path}"],
    )
    assert mechanics == {"written": [], "drawn": []}


def test_map_says_what_it_cannot_fix(write_job, call):
    write_job(GRID)
    call("run", "x.toml")
    assert call("map", "out/x", "--at", "laod=1") == (
        2,
        [],
        ["cvt-hpc: out/x: --at laod: unknown axis; did you mean load?"],
    )
    status, _, err = call("map", "out/x", "--at", "load=25 kg")
    assert status == 2
    assert err == [
        'cvt-hpc: out/x: --at load: expected a value in N m (such as "1 N m" or a bare number in N m), found "25 kg"'
    ]
    assert call("map", "out/x", "--at", "sheave_stiffness=stiff")[2] == [
        'cvt-hpc: out/x: --at sheave_stiffness: expected a number, found "stiff"'
    ]
    assert call("map", "out/x", "--at", "load=0.025 kN m")[0] == 0
    assert call("map", "out/x", "--at", "load=26 N m")[::2] == (
        2,
        ["cvt-hpc: out/x: at load: expected a value of that axis: 0, 25, 50, 75, 100 [N m], found 26 N m"],
    )


@pytest.mark.parametrize(
    "variable", [{"PMI_RANK": "1", "PMI_SIZE": "2"}, {"SLURM_PROCID": "3", "SLURM_NTASKS": "4"}]
)
def test_other_ranks_are_silent(write_job, call, monkeypatch, variable):
    write_job(GRID)
    for name, value in variable.items():
        monkeypatch.setenv(name, value)
    assert call("run", "y.toml") == (2, [], [])
    assert call("run", "--fast") == (2, [], [])
    assert call("run", "x.toml", "--dry-run") == (0, [], [])


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (ZeroDivisionError("x"), (70, "ZeroDivisionError: x")),
        (RuntimeError("x"), (70, "RuntimeError: x")),
        (MemoryError("x"), (2, "too many ones: x")),
        (RuntimeError("NetCDF: x"), (2, "too many ones: NetCDF: x")),
    ],
)
def test_a_defect_is_no_failed_run_and_ends_all_ranks(call, monkeypatch, error, expected):
    def fail(path):
        raise error

    ended = []
    monkeypatch.setattr("cvt_hpc.study.read_status", fail)
    monkeypatch.setattr("cvt_hpc.cli.end_all", lambda status, line="": ended.append(status))
    status, out, err = call("status", "out/x")
    assert (status, out, ended) == (expected[0], [], [expected[0]])
    assert err[-1].endswith(expected[1])


def test_an_interrupt_ends_with_130(write_job, call, monkeypatch):
    def interrupt(path):
        raise KeyboardInterrupt

    monkeypatch.setattr("cvt_hpc.study.read_status", interrupt)
    assert call("status", "out/x") == (130, [], ["cvt-hpc: interrupted"])
    assert INTERRUPTED == 130


def test_the_end_of_the_colours_is_given_with_its_unit():
    assert colour_end("20 um", "m") == 20e-6
    assert colour_end("0.4", "1") == 0.4
    assert colour_end(None, "m") is None and colour_end("fit", "m") is None
    assert colour_end("fit", "m", fits=False) == "fit" and colour_end(None, "m", fits=False) is None
    with pytest.raises(InputError, match="--vmax: expected a value with its unit, of m, found 20"):
        colour_end("20", "m")
