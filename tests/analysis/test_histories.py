"""The history of one run as a file and as a picture."""

import json
import os
import re
from itertools import combinations
from textwrap import wrap

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis import histories
from cvt_hpc.analysis.figures import balanced
from cvt_hpc.analysis.histories import draw_history, history_figure, phase_figure
from cvt_hpc.analysis.history_panels import read_strands
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, load_job
from cvt_hpc.printing import point_lines
from cvt_hpc.storage.netcdf import is_history, write_history
from cvt_hpc.variables import Status, shortened
from support.runs import PROBES, RATE, run
from support.stored import stored

BAND = (100.0, 1500.0)


@pytest.fixture(scope="module")
def whole():
    """The picture of a run with everything that a history may hold, only looked at."""
    return history_figure(run())


def panel(figure, ylabel):
    (found,) = [axes for axes in figure.axes if axes.get_ylabel() == ylabel]
    return found


def labels_of(figure):
    return {axes.get_ylabel() for axes in figure.axes}


# File


def test_a_history_comes_back_as_it_was(tmp_path):
    dataset = run()
    path = write_history(dataset, tmp_path / "new" / "run.nc")
    with xr.open_dataset(path, engine="netcdf4") as stored:
        xr.testing.assert_equal(stored, dataset)
        assert dataset.attrs.items() <= stored.attrs.items()
        assert stored["displacement"].attrs == dataset["displacement"].attrs
        assert (
            "_FillValue" not in stored["time"].encoding
            and "_FillValue" not in stored["probe_position"].encoding
        )
    assert [file.name for file in path.parent.iterdir()] == ["run.nc"]
    assert "cvt_hpc_content" not in dataset.attrs  # the caller's dataset is not touched


def test_an_own_history_is_replaced_and_nothing_else(tmp_path):
    path = write_history(run(0.05), tmp_path / "run.nc")
    write_history(run(0.06), path)
    with xr.open_dataset(path, engine="netcdf4") as stored:
        assert stored.sizes["time"] == round(0.06 * RATE)
    results, text = tmp_path / "results.nc", tmp_path / "notes.nc"
    run(0.05).to_netcdf(results, engine="netcdf4")
    text.write_text("not a dataset")
    for other in (results, text, tmp_path):
        before = other.read_bytes() if other.is_file() else None
        assert not is_history(other)
        with pytest.raises(InputError, match="a history written by cvt_hpc, found another file"):
            write_history(run(0.05), other)
        assert before is None or other.read_bytes() == before


def test_a_history_that_cannot_be_written_leaves_the_old_one(tmp_path):
    path = write_history(run(0.05), tmp_path / "run.nc")
    before = path.read_bytes()
    broken = run(0.05).assign(odd=("time", np.full(round(0.05 * RATE), object())))
    with pytest.raises(Exception, match="object"):
        write_history(broken, path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["run.nc"]


def test_a_system_that_refuses_leaves_the_old_one(tmp_path, monkeypatch):
    path = write_history(run(0.05), tmp_path / "run.nc")
    before = path.read_bytes()

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(
        InputError, match="run.nc: expected to be able to write, found: No space left on device"
    ):
        write_history(run(0.06), path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["run.nc"]


# Picture


def test_everything_a_history_holds_is_drawn(whole):
    t1, spectrum = panel(whole, "t1 [µm]"), panel(whole, "amplitude [µm]")
    assert t1.get_title(loc="left") == "displacement at t1 1/4, judged part shaded"  # 1/2 is a node
    values = t1.lines[0].get_ydata()
    assert values.mean() == pytest.approx(0, abs=1e-9)
    assert np.ptp(values[-200:]) == pytest.approx(20, rel=0.01)
    assert t1.lines[0].get_xdata()[-1] == pytest.approx(300, abs=0.1)
    marked = sorted(text.get_text() for text in spectrum.texts)
    assert marked == ["560 Hz", "560 Hz", "690 Hz"]
    heights = {
        line.get_label(): line.get_ydata().max() for line in spectrum.lines if line.get_label()[0] == "t"
    }
    assert heights == pytest.approx({"t1 1/4": 10.0, "t2 1/6": 6.0}, rel=0.01)
    load = panel(whole, "load [N m]").lines[0]
    assert load.get_ydata()[[0, -1]] == pytest.approx([20, 140], rel=1e-3)


def test_forces_lie_over_shaded_arcs(whole):
    forces = panel(whole, "force [kN]")
    tension, push = (line.get_ydata().max() for line in forces.lines)
    assert (tension, push) == pytest.approx((9.1, 5.0), rel=1e-2)
    assert panel(whole, "contact [kN/m]").lines[0].get_ydata().max() == pytest.approx(400, rel=1e-2)
    assert [text.get_text() for text in forces.texts] == ["driving arc", "t1", "driven arc", "t2"]
    names = [str(name).removesuffix(" arc") for name in run()["region"].values]
    of_pushbelt = run().assign_coords(region=("position", names))
    for drawn in (forces, panel(history_figure(of_pushbelt), "force [kN]")):
        check_arcs(drawn)


def check_arcs(forces):
    spans = [(p.get_x(), p.get_x() + p.get_width()) for p in forces.patches]
    # borders between stations, which are 4.1 mm apart
    assert np.array(spans) == pytest.approx(np.array([[0, 100], [248, 504]]), abs=4.1)


def test_what_feeds_lies_above_zero_and_what_takes_below(whole):
    fed = panel(whole, "fed [W/m]")
    flanks, stresses, damping, zero = (np.asarray(line.get_ydata()) for line in fed.lines)
    assert (flanks.min(), flanks.max(), stresses.max()) == (-800.0, 100.0, 1500.0)
    assert np.all(damping == -1.0) and np.all(zero == 0.0)
    assert fed.get_ylim()[0] < -800.0 and fed.get_ylim()[1] > 1500.0
    assert len(fed.get_legend().get_texts()) == 3
    # what friction feeds on the driven arc is seen beside what gaps trade: a sixth of the panel and more above zero
    height = np.diff(fed.transData.transform([(0.0, 0.0), (0.0, 100.0)])[:, 1])
    assert height > fed.bbox.height / 6


def test_the_end_shows_all_probes_of_a_strand(whole):
    close = [axes for axes in whole.axes if axes.get_legend() and len(axes.lines) == 3]
    labels = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in close]
    assert labels == [["1/4", "1/2", "3/4"], ["1/6", "1/2", "5/6"]]
    for axes in close:
        assert np.ptp(axes.lines[0].get_xdata()) == pytest.approx(10, abs=0.1)


@pytest.mark.parametrize(
    ("missing", "gone"),
    [
        (["displacement", "contact_force"], {"t1 [µm]", "t2 [µm]", "amplitude [µm]", "contact [kN/m]"}),
        (["load", "ring_tension", "push_force", "flank_feed"], {"load [N m]", "force [kN]", "fed [W/m]"}),
        (["ring_tension", "stress_feed", "damping_feed", "region", "status", "vibrates", "reason"], set()),
    ],
)
def test_what_is_absent_is_left_out(whole, missing, gone):
    rest = labels_of(history_figure(run().drop_vars(missing)))
    assert (labels_of(whole) - rest) - {""} == gone  # the close-ups have no label


def test_a_constant_load_is_not_drawn():
    labels = labels_of(history_figure(run(ramp=False)))
    assert "load [N m]" not in labels and "force [kN]" in labels
    ramp = run().assign(
        driving_speed=("time", np.linspace(100.0, 400.0, run().sizes["time"]), {"units": "rad s-1"})
    )
    assert "driving speed\n[rpm]" in labels_of(history_figure(ramp)) - labels
    scalar = run().drop_vars("load").assign(load=120.0)
    assert "load [N m]" not in labels_of(history_figure(scalar))


def test_a_run_without_history_is_refused(tmp_path):
    with pytest.raises(InputError, match="found none of them"):
        draw_history(run()[["status", "vibrates", "reason"]], tmp_path / "run.png")
    assert not any(tmp_path.iterdir())


def test_the_title_says_what_became_of_the_run(whole):
    assert whole.get_suptitle().startswith("One run: ramp\nvibrates: yes (t1 vibrates")
    failed = run().assign(status=np.int8(Status.FAILED_NUMERICS), reason=b"not a number at 0.02 s")
    title = history_figure(failed).get_suptitle()
    assert title.endswith("failed numerics: not a number at 0.02\u00a0s")
    assert "vibrates" not in title


def test_the_title_says_which_run_it_is(write_job):
    job = load_job(
        write_job("""[scene]
thrust = "20 kN"
[axes]
load = [0, "0.05 kN m", 120]
sheave_stiffness = [1, inf]
""")
    )
    at = {"load": 50.0, "sheave_stiffness": np.inf, "driving_speed": "2000 rpm"}
    job = job.with_units_of(at)
    point = job.point_at(at)
    told = {key: repr(value) if value == np.inf else value for key, value in point.items()}
    attributes = {"job": json.dumps(job.resolved()), "point": json.dumps(told)}
    attributes["point_units"] = json.dumps(dict(job.units))
    figure = history_figure(run().assign_attrs(attributes))
    lines = figure.get_suptitle().splitlines()
    assert lines[1].replace("\u00a0", " ") == "load 0.05 kN m, sheave stiffness inf, driving speed 2000 rpm"
    assert panel(figure, "load [kN m]").lines[0].get_ydata()[[0, -1]] == pytest.approx([0.02, 0.14], rel=1e-3)
    (printed,) = point_lines(job, {**at, "driving_speed": point["driving_speed"]})
    assert printed.endswith(lines[1].replace("\u00a0", " "))


COURSE = {
    "profile_time": [0.0, 0.1, 0.3],
    "load_profile": [0.25, 1.0, 0.5],
    "driving_speed_profile": [1.0, 0.5, 0.75],
    "thrust_profile": [0.8, 0.9, 1.0],
}


def driven(axes, **tables):
    """The made-up run, with the attributes of one that a course drives; loads in kN m."""
    scene = {"thrust": "40 kN", "driving_speed": "3000 rpm"} | ({} if axes else {"load": "0.12 kN m"})
    document = {"name": "ramp", "model": "elastic_belt", "scene": scene, "axes": axes}
    job = build_job(document | {"profiles": COURSE, "run": {"duration": 0.3}} | tables)
    told = {key: repr(value) if value == np.inf else value for key, value in job.point(0).items()}
    units = json.dumps(dict(job.units))
    attributes = {"job": json.dumps(job.resolved()), "point": json.dumps(told), "point_units": units}
    return run(duration=0.3).assign_attrs(attributes)


def test_the_title_has_the_ranges_of_a_course_and_no_value_as_if_it_were_constant():
    told = "course: load 0.03 to 0.12 kN m, speed 1500 to 3000 rpm, thrust 32 to 40 kN"
    for compose in (history_figure, phase_figure):
        lines = compose(driven({})).get_suptitle().replace("\u00a0", " ")
        assert told in " ".join(lines.split())
    varied = driven({"load": ["0.12 kN m", "0.2 kN m"], "seed": [3, 4]})
    lines = history_figure(varied).get_suptitle().replace("\u00a0", " ").splitlines()
    assert lines[1] == "load 0.03 to 0.12 kN m, seed 3"
    assert lines[2] == "course: speed 1500 to 3000 rpm, thrust 32 to 40 kN"
    pressed = {"driven_piston": (0.02, 0.09), "driven_pressure": "2 MPa", "driven_spring_force": "4 kN"}
    course = {"profile_time": [0.0, 0.3], "driven_pressure_profile": [1.0, 0.5]}
    scene = {"driving_speed": "3000 rpm", "load": "0.12 kN m"}
    title = history_figure(driven({}, scene=scene, pulleys=pressed, profiles=course)).get_suptitle()
    area = np.pi * (0.09**2 - 0.02**2)
    thrusts = " to ".join(f"{1e-3 * (area * pressure + 4e3):.4g}" for pressure in (1e6, 2e6))
    told = f"thrust {thrusts} kN course: driven pressure 1 to 2 MPa"  # the thrust follows
    assert told in " ".join(title.replace("\u00a0", " ").split())
    for files, told in (('{"profile_file": "rig.csv"}', "course of rig.csv: load"), ("[", "course: load")):
        title = history_figure(driven({}).assign_attrs(job_files=files)).get_suptitle()
        assert told in title.replace("\u00a0", " ")


@pytest.mark.parametrize("broken", [{"load_profile": [1.0]}, {"thrust": "a"}, {"profile_time": 3}])
def test_a_course_that_is_none_is_one_error(broken):
    dataset = driven({})
    point = json.loads(dataset.attrs["point"]) | broken
    with pytest.raises(InputError, match="history: job, point: expected a job of this program"):
        history_figure(dataset.assign_attrs(point=json.dumps(point)))
    with pytest.raises(InputError, match="history: job, point: expected a job of this program"):
        phase_figure(dataset.assign_attrs(point=json.dumps(point)))


def test_a_thrust_that_a_course_changes_is_drawn_unless_forces_are_recorded():
    dataset = driven({})
    axes = panel(history_figure(dataset), "thrust [kN]")
    assert axes.lines[0].get_ydata()[[0, 2000, -1]] == pytest.approx([32.0, 36.0, 40.0], rel=1e-3)
    force = ("time", np.full(dataset.sizes["time"], 4e4), {"units": "N"})
    recorded = history_figure(dataset.assign(axial_force_driving=force, axial_force_driven=force))
    assert "thrust [kN]" not in labels_of(recorded)
    lines = panel(recorded, "axial force [kN]").lines
    assert [line.get_label() for line in lines] == ["driving", "driven"]


def test_the_title_has_no_numerics_that_the_program_has_chosen():
    assert (
        history_figure(stored("history_elastic_belt_ramp"))
        .get_suptitle()
        .startswith("One run: elastic_belt_ramp\nvibrates: yes")
    )


def test_the_title_names_the_rung_by_what_the_dataset_says_of_it():
    flags = {"flag_values": np.array([0, 7], np.int8), "flag_meanings": "none guessed"}
    rung = run().assign(rung=((), np.int8(7), flags), simulated_seconds=0.12)
    assert "decided by the guessed run of model auto, 0.12\u00a0s" in history_figure(rung).get_suptitle()


@pytest.mark.parametrize(
    ("long_name", "label"),
    [
        ("wheel speed", "wheel speed\n[rpm]"),
        ("speed of the driving pulley, in a sentence", "driving speed\n[rpm]"),
        ("", "driving speed\n[rpm]"),
    ],
)
def test_a_name_that_fits_is_that_of_the_dataset(long_name, label):
    speed = np.linspace(100.0, 400.0, run().sizes["time"])
    ramp = run().assign(driving_speed=("time", speed, {"units": "rad s-1", "long_name": long_name}))
    assert panel(history_figure(ramp), label).lines[0].get_ydata()[-1] == pytest.approx(400 * 30 / np.pi)


@pytest.mark.parametrize("width", [20, 30, 45, 76])
def test_lines_of_a_title_are_of_like_length_and_keep_numbers_with_units(width):
    line = "vibrates: yes (t1 vibrates for the last 0.2 s, 27.2 um at the end, growth 0.037 1/s)"
    lines = balanced(line, width).split("\n")
    assert " ".join(lines).replace("\u00a0", " ") == line
    assert len(lines) == len(wrap(line.replace("0.2 s", "0.2_s").replace("27.2 u", "27.2_u"), width))
    assert max(map(len, lines)) <= width and len(lines[-1]) > 0.5 * max(map(len, lines))
    assert any("27.2\u00a0um" in part for part in lines)


def test_a_title_breaks_between_phrases_where_that_takes_no_further_line():
    line = "uncertain_criterion: 91 cells of 32 samples; 95 % intervals up to 0.7 wide"
    head = balanced(line, 72).replace("\u00a0", " ")
    assert head == "uncertain_criterion: 91 cells of 32 samples;\n95 % intervals up to 0.7 wide"


def boxes(artists):
    return [artist.get_window_extent() for artist in artists]


def test_labels_and_legends_cover_nothing():
    level = run()
    level["ring_tension"][:] = 9e3
    figure = history_figure(level)
    figure.draw_without_rendering()
    spectrum, forces = panel(figure, "amplitude [µm]"), panel(figure, "force [kN]")
    labels = boxes(spectrum.texts)
    assert not any(a.overlaps(b) for a, b in combinations(labels, 2))
    first, second = (line for line in spectrum.lines if line.get_label()[0] == "t")
    for text, box in zip(spectrum.texts, labels, strict=True):
        assert box.x0 > spectrum.bbox.x0 and box.x1 < spectrum.bbox.x1
        other = second if text.get_color() == first.get_color() else first
        assert not other.get_path().transformed(spectrum.transData).intersects_bbox(box, filled=False)
    for axes in (spectrum, forces):
        (legend,) = boxes([axes.get_legend()])
        for line in axes.lines:
            assert not line.get_path().transformed(axes.transData).intersects_bbox(legend, filled=False)


@pytest.mark.parametrize("frequency", [120.0, 1480.0])
def test_labels_stay_within_the_spectrum(frequency):
    at_the_edge = run()
    wave = 10e-6 * np.sin(2 * np.pi * frequency * at_the_edge["time"].values)
    at_the_edge["displacement"][:] = wave[:, np.newaxis]
    at_the_edge.attrs["job"] = json.dumps({"vibration": {"band_low": 100.0}})
    figure = history_figure(at_the_edge)
    figure.draw_without_rendering()
    spectrum = panel(figure, "amplitude [µm]")
    assert len(spectrum.texts) == 1  # both strands at one place
    for box in boxes(spectrum.texts):
        assert box.x0 > spectrum.bbox.x0 and box.x1 < spectrum.bbox.x1


def test_pictures_are_of_the_band_by_which_the_run_was_judged():
    def told(dataset):
        return re.search(r"motion above (\d+) Hz", phase_figure(dataset).get_suptitle())[1]

    followed = run()
    followed.attrs["job"] = json.dumps({"vibration": {"band_low": 0.0}})
    assert told(followed) == "300"  # of a dataset without the edge
    assert told(followed.assign(lower_band_edge=((), 168.2))) == "168"
    followed.attrs["job"] = json.dumps({"vibration": {"band_low": 250.0}})
    assert told(followed) == "250"


def test_a_failed_run_is_drawn_up_to_where_it_failed():
    failed = run(0.1)
    failed["displacement"][1500:, 2] = np.nan
    t1, t2 = read_strands(failed, 0.5, BAND)
    assert t1.time.size == t2.time.size == 1500
    assert np.isfinite(t1.displacement).all() and t1.first_judged == 750
    failed["displacement"][0] = np.inf
    assert read_strands(failed, 0.5, BAND) == []


def test_nothing_of_a_failed_run_is_shown_as_judged():
    failed = run().assign(status=np.int8(Status.FAILED_NUMERICS), reason=b"not a number at 0.3 s")
    figure = history_figure(failed)
    axes = panel(figure, "t1 [µm]")
    assert axes.get_title(loc="left") == "displacement at t1 1/4"
    assert len(axes.patches) == 0 and axes.lines
    assert "amplitude [µm]" not in labels_of(figure)  # the judged part's spectrum


def test_the_judged_part_is_that_of_the_job():
    dataset = run()
    dataset.attrs["job"] = json.dumps({"vibration": {"judged_fraction": 0.2}})
    shade = panel(history_figure(dataset), "t1 [µm]").patches[0]
    assert shade.get_x() == pytest.approx(240, abs=0.1)


def test_short_or_coarse_records_have_no_spectrum():
    for dataset in (run(0.002), run().isel(time=slice(None, None, 10))):
        labels = labels_of(history_figure(dataset))
        assert "amplitude [µm]" not in labels and "t1 [µm]" in labels


def test_rest_is_drawn_without_peaks():
    still = run()
    still["displacement"][:] = 0.0
    assert panel(history_figure(still), "amplitude [µm]").texts[:] == []


def test_a_picture_is_small(tmp_path):
    out = draw_history(run(), tmp_path / "run.svg")
    assert out.stat().st_size < 300_000
    with pytest.raises(InputError, match="found no suffix"):
        draw_history(run(), tmp_path / "run")


def test_spans_of_many_pulleys_are_told_apart():
    time, names = run()["time"].values, [f"P{k}-P{k + 1} 1" for k in range(1, 6)]
    sizes = 10e-6 * 10.0 ** -np.arange(5.0)
    moved = sizes * np.sin(2 * np.pi * 560 * time)[:, np.newaxis]
    moved[0] = 1e-3
    dataset = xr.Dataset({"displacement": (("time", "probe"), moved)}, {"time": time, "probe": names})
    for k in range(5):
        dataset[f"speed_P{k + 1}"] = ("time", np.ones(time.size), {"units": "rad s-1"})
    figure = history_figure(dataset)
    spectrum, speed = panel(figure, "amplitude [µm]"), panel(figure, "speed [rpm]")
    lines = [line for line in spectrum.lines if line.get_label() in names]
    assert len({line.get_color() for line in lines}) == 5 and spectrum.get_yscale() == "log"
    assert [text.get_text() for text in spectrum.texts] == ["560 Hz"]
    widths = [line.get_linewidth() for line in speed.lines]
    assert (np.diff(widths) < 0.0).all()  # each lies narrower upon those before
    assert panel(figure, "P1-P2 [µm]").texts[0].get_text().startswith("start cut off: ")


def test_a_long_reason_is_shortened_by_whole_clauses():
    clauses = [
        f"P{k}-P{k + 1} vibrates for the last 0.35 s, 889 um at the end, growth -0.064 1/s" for k in range(5)
    ]
    stored = shortened("; ".join(clauses))
    assert stored == "; ".join([*clauses[:3], "and 2 more"])
    assert shortened(stored, 100) == f"{clauses[0]}; and 4 more"
    assert shortened(clauses[0], 30) == "P0-P1 vibrates for the ..."
    title = history_figure(run().assign(reason=stored.encode())).get_suptitle()
    assert " ".join(title.replace("\u00a0", " ").split()).endswith(f"({clauses[0]}; and 4 more)")


def test_probes_are_grouped_by_strand():
    t1, t2 = read_strands(run(), 0.5, BAND)
    assert t1.probes + t2.probes == PROBES
    assert (t1.rate, t1.strongest, t2.name) == (pytest.approx(RATE), 0, "t2")


@pytest.mark.parametrize(
    ("course", "share"),
    [
        ({}, 0.4),
        ({"profile_time": []}, 0.4),
        ({"load_history": "ramp"}, 0.9),
        ({"profile_time": [0.0, 0.25]}, 0.9),
        ({"profile_time": [0.0, 0.15]}, 0.4),  # constant from there on
    ],
)
def test_the_judged_part_of_a_run_that_changes_all_along_follows_its_start_up(course, share):
    point = {"duration": 0.3, "rise_time": 0.03, "judged_fraction": 0.4} | course
    run = xr.Dataset(attrs={"point": json.dumps(point)})
    assert histories._judged_share(run, {"judged_fraction": 0.4}) == pytest.approx(share)
