"""Profiles of load, speed and thrust, given and from measured files, and their verdict over time."""

import gc
import sys

import netCDF4
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.errors import InputError, JobWarning, UnitWarning
from cvt_hpc.experiments import growth
from cvt_hpc.job import build_job
from cvt_hpc.job.summary import summarize
from cvt_hpc.models.elastic_belt.grouping import lane_key
from cvt_hpc.variables import Vibrates
from cvt_hpc.variator.course import multiple_at, profile_table, slope_at
from support.marched import balance, finished, job, record

COARSE = {"stations": 64, "load": 100.0, "friction_gradient": -0.4}
SPEED = job().parameters["driving_speed"]
T = COARSE | {"duration": 0.1}


@given(
    st.lists(st.floats(0.001, 10.0), min_size=1, max_size=9),
    st.integers(0, 2**31),
    st.floats(-1.0, 60.0),
)
def test_multiples_are_linear_between_their_times_and_constant_outside(steps, seed, time):
    times = np.cumsum(steps)
    profile = np.column_stack([times, np.random.default_rng(seed).normal(size=(times.size, 3))])
    for at in (time, times[0], times[-1]):
        for column in (1, 2, 3):
            expected = np.interp(at, times, profile[:, column])
            assert multiple_at(profile, column, at) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    step = 1e-7
    if not np.any(np.abs(times - time) < 2.0 * step):
        rise = multiple_at(profile, 2, time + step) - multiple_at(profile, 2, time - step)
        assert slope_at(profile, 2, time) == pytest.approx(0.5 * rise / step, rel=1e-5, abs=1e-6)


def test_profiles_of_ones_change_no_bit():
    ones = {f"{name}_profile": (1.0, 1.0) for name in ("load", "driving_speed", "thrust")}
    plain = finished(**T)
    assert finished(**T, profile_time=(0.01, 0.05), **ones).rows.tobytes() == plain.rows.tobytes()


@pytest.mark.parametrize(
    ("ramp", "profile"),
    [
        ({"load_history": "ramp", "load_start": 40.0}, {"load_profile": (0.4, 1.0)}),
        ({"speed_history": "ramp", "speed_start": 0.6 * SPEED}, {"driving_speed_profile": (0.6, 1.0)}),
    ],
)
def test_a_profile_along_the_whole_run_is_a_ramp(ramp, profile):
    p = job(**T).point(0)
    given_times = profile | {"profile_time": (p["rise_time"], p["duration"])}
    expected, found = finished(**T, **ramp), finished(**T, **given_times)
    size = np.abs(expected.displacement).max()
    assert np.abs(found.displacement - expected.displacement).max() < 1e-6 * size
    for name in ("ring_tension t1", "driven_speed", "axial_force driving", "load", "driving_speed"):
        assert found.channel(name) == pytest.approx(expected.channel(name), rel=1e-6, abs=1e-6), name


def test_the_power_balance_closes_and_the_sheave_follows_its_thrust_along_profiles():
    course = {
        "profile_time": (0.0, 0.1, 0.14, 0.3),
        "load_profile": (0.6, 1.0, 0.7, 0.8),
        "driving_speed_profile": (1.0, 1.05, 0.95, 1.0),
        "thrust_profile": (1.0, 0.9, 0.9, 1.1),
    }
    run = finished(**COARSE | {"stations": 96, "duration": 0.3}, **course)
    found, p = balance(run), run.parameters
    assert abs(found["power_residual"]) < 5e-4
    times = (1.0 + np.arange(run.samples)) * run.interval
    late = times > 0.05  # the load has risen
    expected = p["load"] * np.interp(times, course["profile_time"], course["load_profile"])
    assert run.channel("load")[late] == pytest.approx(expected[late])
    thrust = p["thrust"] * np.interp(times, course["profile_time"], course["thrust_profile"])
    force = run.channel("axial_force driven")
    assert np.abs(force[late] / thrust[late] - 1.0).max() < 0.05  # friction of a sheave that moves
    turning = run.channel("driving_speed").mean()
    assert run.mean_driving_speed(slice(None)) == pytest.approx(turning) != p["driving_speed"]


def test_a_pressure_moves_the_thrust_beside_a_spring():
    spring = {"driven_piston": (0.02, 0.09), "driven_pressure": 2e6, "driven_spring_force": 4e3}
    point = job(**spring, profile_time=(0.0, 0.1), driven_pressure_profile=(1.0, 0.5)).point(0)
    area = np.pi * (0.09**2 - 0.02**2)
    thrust = point["thrust"] * profile_table(point)[:, 3]
    assert thrust == pytest.approx([area * 2e6 + 4e3, area * 1e6 + 4e3])


LOADED = {"stations": 96, "step": 7.6e-6, "friction_gradient": -1.0, "load": 120.0, "duration": 0.4}
RISEN = LOADED | {"profile_time": (0.0, 0.1, 0.2, 0.4), "load_profile": (0.2, 0.2, 1.0, 1.0)}


@pytest.mark.slow
def test_a_course_is_judged_all_along_over_time():
    found = record(**RISEN)
    assert found["vibrates"] is Vibrates.YES, found["reason"]
    assert 0.12 < found["onset_time"] < 0.25 and np.isnan(found["end_time"])
    assert f"from {found['onset_time']:.4g} s to its end" in found["reason"]
    times = found["ramp_time"]
    assert np.all(np.diff(times[np.isfinite(times)]) > 0.0) and np.isnan(found["onset_load"])
    quiet = record(**RISEN | {"load_profile": (0.2, 0.2, 0.2, 0.2)})
    assert quiet["vibrates"] is Vibrates.NO and "quiet between" in quiet["reason"]


def test_a_course_that_ends_before_the_judged_part_leads_to_a_constant_scene():
    ended = {"profile_time": (0.0, 0.05), "load_profile": (0.5, 1.0)}
    found = record(**COARSE | {"duration": 0.2, "shortest_duration": 0.05}, **ended)
    assert np.isnan(found["onset_time"]) and np.all(np.isnan(found["ramp_time"]))
    # no part of it is judged that the course still changes
    assert found["simulated_seconds"] * (1.0 - job().parameters["judged_fraction"]) >= 0.05


RIG = """time [s],torque [N m],speed [rpm],clamping force [kN]
2.0,40,2900,45
2.05,150,3000,50
2.2,120,3100,40
"""


def course_job(folder, text, name="rig.csv", model="elastic_belt", **tables):
    (folder / name).write_text(text)
    document = {"name": "course", "model": model, "profiles": {"profile_file": name}, **tables}
    return build_job(document, str(folder / "course.toml"))


@pytest.mark.parametrize(
    "model", ["elastic_belt", "auto", "quasi_static_belt", "pushbelt", "spatial_pushbelt"]
)
def test_a_measured_file_gives_profiles_and_what_they_multiply(tmp_path, model):
    told = '"torque .N m." as load.*; line 2 is time 2 s, load 40 N m, driving_speed 2900 rpm, thrust 45 kN'
    with pytest.warns(JobWarning, match=told):
        job = course_job(tmp_path, RIG, model=model)
    assert job.files == {"profile_file": "rig.csv"}
    point = job.point(0)
    assert point["load"] == 150.0 and point["thrust"] == 50e3
    assert point["driving_speed"] == pytest.approx(3100 * np.pi / 30)
    assert point["profile_time"] == pytest.approx((0.0, 0.05, 0.2))
    assert point["load_profile"] == pytest.approx((40 / 150, 1.0, 0.8))
    assert point["driving_speed_profile"] == pytest.approx((29 / 31, 30 / 31, 1.0))
    assert point["thrust_profile"] == pytest.approx((0.9, 1.0, 0.8))


def test_an_axis_takes_the_place_of_a_measured_greatest_value(tmp_path):
    with pytest.warns(JobWarning):
        studied = course_job(tmp_path, RIG, axes={"load": ["100 N m", "200 N m"]})
    assert [studied.point(k)["load"] for k in (0, 1)] == [100.0, 200.0]
    assert studied.point(1)["load_profile"] == pytest.approx((40 / 150, 1.0, 0.8))


def test_a_long_file_is_averaged_over_equal_parts(tmp_path):
    times = np.arange(5000) / 1e4
    rows = [f"{time:.4f},{100 + 10 * time + (-1) ** k}" for k, time in enumerate(times)]
    with pytest.warns(
        JobWarning, match=r"rig.csv: 5000 times from 0 s to 0.4999 s, averaged over 1000 parts"
    ):
        job = course_job(tmp_path, "\n".join(["time [s],load [N m]", *rows]), run={"duration": "0.5 s"})
    told = "5000 times from 0 s to 0.4999 s, averaged over 1000 parts"
    (line,) = (line for line in summarize(job, 1.0).split("\n") if line.split()[:1] == ["profile_time"])
    assert told in line
    point = job.point(0)
    at, load = np.array(point["profile_time"]), point["load"] * np.array(point["load_profile"])
    assert at.size == 1000 and max(point["load_profile"]) == 1.0  # an axis gives the greatest that is driven
    assert load == pytest.approx(100 + 10 * at, abs=0.25)  # alternating samples cancel but for one in five


@pytest.mark.parametrize(
    ("speeds", "unit", "expected"),
    [
        ((2900.0, -2950.0), "rpm", "entry 2: expected a driving_speed above 0, found -2950 rpm"),
        ((2900.0, -2950.0), "1/min", "entry 2: expected a driving_speed above 0, found -2950 rpm"),
        ((2900.0, -300.0), "rad/s", "entry 2: expected a driving_speed above 0, found -300 rad/s"),
        (
            (1.0, 2.9e6),
            "rpm",
            "entry 2: expected driving_speed within the range of the model, up to 7639.437 rpm, "
            "found 2900000 rpm",
        ),
    ],
)
def test_errors_of_netcdf_have_the_units_of_the_file(tmp_path, speeds, unit, expected):
    with netCDF4.Dataset(tmp_path / "rig.nc", "w") as file:
        file.createDimension("time", 2)
        for name, values, own in (("time", (0.0, 100.0), "ms"), ("driving_speed", speeds, unit)):
            variable = file.createVariable(name, "f8", ("time",))
            variable[:], variable.units = values, own
    document = {"name": "x", "model": "elastic_belt", "profiles": {"profile_file": "rig.nc"}}
    with pytest.raises(InputError, match=expected):
        build_job(document, str(tmp_path / "x.toml"))


def test_what_no_rig_measures_is_told(tmp_path):
    table = "time [s],load [N m],speed [rpm]\n0,0.1,2900\n0.1,0.4,5\n0.2,0,2900\n"
    with pytest.warns(UnitWarning) as found:
        course_job(tmp_path, table)
    texts = [str(one.message).partition("rig.csv: ")[2] for one in found if one.category is UnitWarning]
    assert texts == [
        "line 3: load 0.4 N m is below the usual 0.5 to 2000 N m; check the unit of the column",
        "line 3: driving_speed 5 rpm is below the usual 9.549297 to 7639.437 rpm; check the unit of the column",
    ]


def test_a_course_may_pass_through_no_load_and_rest(tmp_path, recwarn):
    table = "time [s],load [N m]\n0,-60\n0.1,0\n0.2,60\n2,60\n2.1,2000\n"
    found = course_job(tmp_path, table, run={"duration": "3 s"}).parameters
    assert found["load"] == 2000.0 and found["profile_time"][3] == 2.0
    assert not [one for one in recwarn if issubclass(one.category, UnitWarning)]


SAMPLED = "\n".join(["time [s],load [N m]", *(f"{k / 100 + (k > 25)},{80 + k % 3}" for k in range(40))])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time [s]\n0\n1\n", "expected a column beside time, found none"),
        ("time [s],load [N m]\n0,1\n", "expected two times or more, found 1"),
        ("time [s],load [N m]\n0,1\n1,2\n0.5,3\n", "line 4: expected a time after 1 s, .* found 0.5 s"),
        ("time [ms],load [N m]\n0,1\n200,2\n100,3\n", "a time after 200 ms, .* found 100 ms"),
        (SAMPLED, "line 28: expected samples every 0.01 s without a gap, found none from 0.25"),
        ("time [s],load [N m]\n0,1\n9,2\n", "duration: expected 9 s or more, the end of profile_time"),
        ("time [s],thrust [kN]\n0,50\n0.1,-1\n", "line 3: expected a thrust above 0, found -1 kN"),
        ("time [s],speed [rpm]\n0,2900\n0.1,-2950\n", "a driving_speed above 0, found -2950 rpm"),
        (
            "time [s],load [kN m]\n0,1\n1,-2.001\n2,9\n",
            "rig.csv: line 3: expected load within the range of the model, up to 2 kN m in size, found -2.001 kN m",
        ),
        (
            "time [s],thrust [N]\n0,3e6\n1,5e4\n",
            r"rig.csv: line 2: expected thrust within .*, up to 2000000 N, found 3000000 N",
        ),
        (
            "time [ms],load [N m]\n0,1\n100,2\n200,3\n701,4\n800,4\n",
            "line 5: expected no step over 500 ms .5 median ones. where a value changes, found a gap from 200 ms to 701 ms; write rows",
        ),
        ("time [s],load [rpm]\n0,1\n1,2\n", "line 1: expected load .N m., found"),
        ("time [s],grip [N]\n0,1\n1,2\n", "expected columns among time"),
        ("time [s],load [N m]\n0,1\n1,\n", "line 3"),
    ],
)
def test_a_file_of_courses_that_cannot_be_driven_is_one_error(tmp_path, text, expected):
    with pytest.raises(InputError, match=expected) as raised:
        course_job(tmp_path, text).point(0)
    assert "\n" not in str(raised.value)


def test_a_file_and_what_it_gives_are_not_both_given(tmp_path):
    with pytest.raises(InputError, match="profile_file: expected either profile_file or load, found both"):
        course_job(tmp_path, "time [s],load [N m]\n0,1\n0.1,2\n", scene={"load": "50 N m"})
    # what it does not give is the job's
    point = course_job(tmp_path, "time [s],thrust [N]\n0,4e4\n0.1,5e4\n", scene={"load": "50 N m"}).point(0)
    assert point["load"] == 50.0 and point["thrust"] == 5e4


SIGNALS = {
    "Time": ([1.0, 1.2, 1.5], "s"),
    "Torque": ([40.0, 160.0, 80.0], "N m"),
    "Speed": ([1500, 3000, 3000], "rpm"),
}


def write_mat(path, signals, **further):
    from scipy.io import savemat

    told = {f"{name}_unit": unit for name, (_, unit) in signals.items() if unit}
    savemat(path, {name: np.array(values) for name, (values, _) in signals.items()} | told | further)


def write_mdf(path, signals, times=()):
    """Signals over the times of "Time", or over `times` of their own by name."""
    asammdf = pytest.importorskip("asammdf")
    times = dict(times)
    with asammdf.MDF(version="4.10") as measured:
        for name, (values, unit) in signals.items():
            if name != "Time":
                at = np.array(times.get(name, signals["Time"][0]), float)
                measured.append(asammdf.Signal(np.array(values, float), timestamps=at, name=name, unit=unit))
        measured.save(path, overwrite=True)


def test_a_long_log_is_read_whatever_its_kind(tmp_path):
    times = np.arange(80_000) * 1e-3
    loads = np.round(100.0 + 50.0 * np.sin(times / 9.0), 4)
    rows = "".join(f"{time:.3f},{load:.4f}\n" for time, load in zip(times, loads, strict=True))
    duration = {"run": {"duration": 80.0}}
    found = course_job(tmp_path, f"time [s],load [N m]\n{rows}", **duration).parameters
    assert (tmp_path / "rig.csv").stat().st_size > 2**20
    write_mat(tmp_path / "rig.mat", {"time": (times, "s"), "load": (loads, "N m")})
    document = {"name": "course", "model": "elastic_belt", "profiles": {"profile_file": "rig.mat"}}
    other = build_job(document | duration, str(tmp_path / "course.toml")).parameters
    assert found["load"] == other["load"] == pytest.approx(loads.max(), rel=1e-5)
    assert found["load_profile"] == other["load_profile"]
    assert found["profile_time"] == pytest.approx(other["profile_time"])


@pytest.mark.parametrize("numbers", ["0123", "1234", "0124", "01", "1235"])
def test_a_column_that_numbers_the_rows_does_so_in_all_blocks(tmp_path, monkeypatch, numbers):
    monkeypatch.setattr("cvt_hpc.job.csv_files._BLOCK", 2)
    rows = "".join(f"{n},{0.1 * k:g},{100 + k}\n" for k, n in enumerate(numbers.ljust(4)))
    table = f",time [s],load [N m]\n{rows}".replace(" ,", ",")
    if numbers in ("0123", "1234"):
        with pytest.warns(JobWarning, match="no column for the numbers of the rows"):
            assert course_job(tmp_path, table).parameters["load"] == 103.0
    else:
        with pytest.raises(InputError, match="line [45], column 1: expected the number of the row"):
            course_job(tmp_path, table)


def test_names_are_looked_for_above_the_numbers_and_not_all_through_a_long_log(tmp_path):
    table = "time [s],load [N m]\n0,100\n1,120\n"
    found = course_job(tmp_path, 99 * "a line above\n" + table, run={"duration": 1.0})
    assert found.parameters["load"] == 120.0
    expected = r"a line that names columns, such as time \[s\], found none among the first 10000"
    with pytest.raises(InputError, match=expected):
        course_job(tmp_path, 20_000 * "1.5,2\n" + table)


def test_what_a_rig_measured_beside_a_course_is_not_read(tmp_path):
    table = "time [s];load [N m];oil temp [degC];remark\n0;100,5;80.25;cold\n0,1;120;80.5\n0,2;90;;warm\n"
    with pytest.warns(
        JobWarning,
        match='decimal commas; line 2 is time 0 s, load 100.5 N m; not read: "oil temp .degC.", "remark"',
    ):
        point = course_job(tmp_path, table).point(0)
    assert point["load"] == 120.0 and point["load_profile"] == pytest.approx((100.5 / 120, 1.0, 0.75))
    with pytest.raises(
        InputError, match="line 3, load: expected a number such as 1500 or 0.13, found nothing"
    ):
        course_job(tmp_path, "time;load [N m];oil;remark\n0;1;2;3\n1\n".replace("time", "time [s]"))


@pytest.mark.parametrize(("write", "suffix"), [(write_mat, ".mat"), (write_mdf, ".mf4")])
def test_signals_of_measuring_programs_give_profiles(tmp_path, write, suffix):
    write(tmp_path / f"rig{suffix}", SIGNALS | {"Oil_temperature": ([80.0, 80.0, 80.0], "degC")})
    document = {"name": "course", "model": "elastic_belt", "profiles": {"profile_file": f"rig{suffix}"}}
    point = build_job(document | {"run": {"duration": "0.5 s"}}, str(tmp_path / "course.toml")).point(0)
    assert point["load"] == 160.0 and point["load_profile"] == pytest.approx((0.25, 1.0, 0.5))
    assert point["driving_speed"] == pytest.approx(100.0 * np.pi)
    assert point["driving_speed_profile"] == pytest.approx((0.5, 1.0, 1.0))
    assert point["profile_time"] == pytest.approx((0.0, 0.2, 0.5))


@pytest.mark.parametrize(
    ("changed", "further", "expected"),
    [
        ({"Torque": ([40.0, 160.0, 80.0], "")}, {}, "Torque: expected the unit of load .N m., found none"),
        ({"Torque": ([40.0, np.nan, 80.0], "N m")}, {}, "Torque: expected finite numbers"),
        ({"Torque": ([40.0, 160.0], "N m")}, {}, "load: expected 3 values, as others have, found 2"),
        ({"Torque": (["a", "b", "c"], "N m")}, {}, "Torque: expected a row or a column of numbers"),
        ({"Time": ([1.0, 1.2, 1.1], "s")}, {}, "entry 3: expected a time after 1.2 s"),
        ({}, {"Load": np.ones(3), "Load_unit": "N m"}, "expected one signal for load"),
    ],
)
def test_a_signal_that_means_nothing_certain_is_one_error(tmp_path, changed, further, expected):
    write_mat(tmp_path / "rig.mat", SIGNALS | changed, **further)
    document = {"name": "course", "model": "elastic_belt", "profiles": {"profile_file": "rig.mat"}}
    with pytest.raises(InputError, match=expected) as raised:
        build_job(document, str(tmp_path / "course.toml"))
    assert "\n" not in str(raised.value)


OF_ANOTHER_KIND = (
    *(b"", b"no file of theirs", bytes(2000)),
    *(b"MATLAB 5.0 MAT-file" + bytes(300), b"MDF     4.10    " + bytes(2000)),
)


@pytest.mark.parametrize("suffix", [".mat", ".mf4"])
def test_a_file_of_another_kind_is_one_error(tmp_path, monkeypatch, suffix):
    more = []
    monkeypatch.setattr(sys, "unraisablehook", more.append)
    if suffix == ".mf4":
        pytest.importorskip("asammdf")
    document = {"name": "course", "model": "elastic_belt", "profiles": {"profile_file": f"rig{suffix}"}}
    for content in OF_ANOTHER_KIND:
        (tmp_path / f"rig{suffix}").write_bytes(content)
        with pytest.raises(InputError, match="profile_file: .*rig.*expected an?") as raised:
            build_job(document, str(tmp_path / "course.toml"))
        assert "\n" not in str(raised.value) and "BytesIO" not in str(raised.value)
        del raised
    gc.collect()  # once for all: what a library says of files that it could not close
    assert not more


def mdf_point(folder, signals, times=()):
    write_mdf(folder / "rig.mf4", signals, times)
    document = {"name": "course", "model": "elastic_belt", "profiles": {"profile_file": "rig.mf4"}}
    return build_job(document | {"run": {"duration": "2 s"}}, str(folder / "course.toml")).point(0)


def test_signals_over_times_of_their_own_count_where_all_have_values(tmp_path):
    fine, coarse = np.linspace(1.0, 2.0, 201), np.array([0.5, 1.5, 2.5])
    torque, speed = 60.0 + 50.0 * np.sin(20.0 * fine), np.array([2000.0, 3000.0, 1000.0])
    signals = {"Speed": (speed, "1/min"), "Torque": (torque, "N m"), "Time": ([], "s")}
    with pytest.warns(JobWarning, match='"Speed" as driving_speed, "Torque" as load'):
        point = mdf_point(tmp_path, signals, {"Speed": coarse, "Torque": fine})
    assert np.array(point["profile_time"]) == pytest.approx(fine - 1.0)
    assert point["load"] * np.array(point["load_profile"]) == pytest.approx(torque)
    found = point["driving_speed"] * np.array(point["driving_speed_profile"]) * 30.0 / np.pi
    assert found == pytest.approx(np.interp(fine, coarse, speed))


TORQUE, SPEED_TURNS = (np.full(50, 60.0), "N m"), (np.full(50, 3000.0), "rpm")
REGULAR_TIMES = np.arange(50) / 100.0


@pytest.mark.parametrize(
    ("of_speed", "expected"),
    [
        (
            REGULAR_TIMES + 5.0,
            "expected signals that were measured at the same time, found .*Speed 5 to 5.49 s",
        ),
        (
            REGULAR_TIMES + 0.3 * (REGULAR_TIMES > 0.2),
            "Speed, entry 22: expected samples every 0.01 s without a gap",
        ),
        (np.where(np.arange(50) == 7, 0.0, REGULAR_TIMES), "Speed, entry 8: expected a time after 0.06 s"),
    ],
)
def test_signals_that_do_not_go_together_are_one_error(tmp_path, of_speed, expected):
    signals = {"Torque": TORQUE, "Speed": SPEED_TURNS, "Time": ([], "s")}
    with pytest.raises(InputError, match=expected):
        mdf_point(tmp_path, signals, {"Torque": REGULAR_TIMES, "Speed": of_speed})


def test_a_gap_in_one_signal_is_not_filled_from_the_times_of_another(tmp_path):
    fine = np.arange(50) / 100.0
    signals = {"Torque": (60.0 + fine, "N m"), "Speed": ([2900, 2900, 2900, 3000], "rpm"), "Time": ([], "s")}
    times = {"Torque": fine, "Speed": [0.0, 0.04, 0.08, 0.4]}
    with pytest.raises(
        InputError, match="Speed, entry 4: expected no step over 0.2 s .* gap from 0.08 s to 0.4"
    ):
        mdf_point(tmp_path, signals, times)


def test_a_formula_of_a_measured_file_is_not_evaluated(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as measured:
        formula = {"formula": "X1 * 2"}
        told = {"timestamps": REGULAR_TIMES, "name": "Torque", "unit": "N m", "conversion": formula}
        measured.append(asammdf.Signal(np.arange(50), **told))
        measured.save(tmp_path / "rig.mf4")
    document = {"name": "course", "model": "elastic_belt", "profiles": {"profile_file": "rig.mf4"}}
    with pytest.raises(InputError, match="Torque: expected stored values, .* found a formula"):
        build_job(document, str(tmp_path / "course.toml"))


def test_turns_a_minute_are_read_in_each_of_their_spellings(tmp_path):
    for unit in ("1/min", "U/min", "min-1", "min^-1", "rev/min", "RPM", "rpm"):
        text = f"time [s],driving_speed [{unit}]\n0,2900\n0.1,3000\n"
        assert course_job(tmp_path, text).point(0)["driving_speed"] == pytest.approx(100.0 * np.pi)


def test_runs_whose_courses_differ_share_no_lanes():
    oil = {"driven_piston": (0.02, 0.09), "driven_pressure": 2e6, "profile_time": (0.0, 0.1)}
    oil |= {"driven_pressure_profile": (1.0, 0.5)}
    asked = [job(**oil, driven_spring_force=force).point(0) for force in (0.0, 2e4)]
    assert lane_key(asked[0]) != lane_key(asked[1])
    loads = [
        job(load=load, profile_time=(0.0, 0.1), load_profile=(1.0, 0.5)).point(0) for load in (50.0, 60.0)
    ]
    assert lane_key(loads[0]) == lane_key(loads[1])


def test_a_speed_is_not_prescribed_to_a_pulley_that_has_an_inertia():
    course = {"profile_time": (0.0, 0.1), "driving_speed_profile": (1.0, 0.9), "driving_inertia": 0.05}
    with pytest.raises(InputError, match="driving_speed_profile: expected none where .* is not given"):
        job(**course).point(0)


def test_growth_refuses_courses():
    asked = {"profile_time": [0.0, 0.1], "load_profile": [0.5, 1.0]}
    with pytest.raises(
        InputError, match=r"\[profiles\]: expected none: growth is that about one steady state"
    ):
        growth.load("jobs/lebrecht_2004.toml", asked)


def test_a_course_may_lead_beyond_what_a_belt_carries_but_not_begin_there():
    course = {"load": 480.0, "profile_time": (0.0, 0.1)}
    job(**course, load_profile=(0.2, 1.0)).point(0)
    with pytest.raises(InputError, match="load: expected at most"):
        job(**course, load_profile=(1.0, 0.2)).point(0)


def test_a_share_of_the_torque_and_a_measured_torque_are_not_both_given(tmp_path):
    with pytest.raises(InputError, match="either profile_file, which gives load, or load_share, found both"):
        course_job(tmp_path, "time [s],load [N m]\n0,1\n0.1,2\n", axes={"load_share": [0.2, 0.4]})
