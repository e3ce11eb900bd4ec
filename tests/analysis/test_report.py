"""The page about a study: what it says, and what a browser makes of it."""

import base64
import html
import json
import os
import re
import shutil
import subprocess
import time

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.classes import map_classes, occurrence_classes
from cvt_hpc.analysis.hysteresis_bands import lowest_onsets
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.report import write_report
from cvt_hpc.report.findings import shown_quantities
from cvt_hpc.report.interactive import as_script, map_data
from cvt_hpc.storage.netcdf import HISTORY
from cvt_hpc.variables import Status, Vibrates
from support.studies import ramps, sampled, study, traced

SMALL = {"gradients": (-2.4, -0.8), "stiffnesses": (1.0, np.inf)}
# Tells the page around how wide what is drawn is and what came of it.
TELL = """
<script>
const tell = told => parent.postMessage(JSON.stringify({told, wide: document.documentElement.scrollWidth,
  room: document.documentElement.clientWidth, maps: document.querySelectorAll(".heatmaplayer").length}), "*");
</script>
"""
# A page in a frame of its own width: a window of Chromium is at least 500 px wide.
FRAME = """
<body><iframe src="{page}" style="border: 0; width: {width}px; height: 900px"></iframe>
<script>window.addEventListener("message", message => {{ document.body.dataset.told = message.data; }});</script></body>
"""
# Moves the pointer to the cell at 100 N m and -2.4 s/m of the first panel, and keeps what stands beside it.
POINT = """
<script>
window.addEventListener("load", () => setTimeout(() => {
  const panel = document.querySelector(".nsewdrag"), place = panel.getBoundingClientRect();
  const at = {clientX: place.left + 0.45 * place.width, clientY: place.top + 0.75 * place.height, bubbles: true};
  panel.dispatchEvent(new MouseEvent("mouseover", at));
  panel.dispatchEvent(new MouseEvent("mousemove", at));
  setTimeout(() => tell(document.querySelector(".hoverlayer").textContent), 500);
}, 500));
</script>
"""
# Shows the frequency instead, the last value of the axis that is left over, and other sides.
CHOOSE = """
<script>
window.addEventListener("load", () => {
  const onsets = () => document.getElementById("map").data.filter(one => one.mode === "lines").map(one => [one.line.dash, ...one.x]);
  const pick = (name, value) => {
    const box = [...document.querySelectorAll("#map-controls label")].find(one => one.textContent.startsWith(name));
    const input = box.querySelector("select, input");
    input.value = value;
    input.dispatchEvent(new Event(input.type === "range" ? "input" : "change"));
  };
  const first = onsets(); // white below each line
  pick("show", -2);
  const both = onsets(), legend = document.getElementById("map-legend").textContent;
  pick("show", 1); pick("along x", 1); pick("disturbance", 1);
  const {layout, data} = document.getElementById("map"), told = document.querySelector("#map-controls output");
  document.body.dataset.told = JSON.stringify([
    layout.coloraxis.colorbar.title.text, layout.xaxis2.title.text, layout.yaxis.title.text, told.textContent,
    layout.annotations.length, data[0].text[0][0], onsets(), first, both, legend]);
});
</script>
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of a small made-up study, with a reason that would be a script if it were not escaped."""
    results = study(**SMALL)
    reasons = np.full(results["status"].shape, "", object)
    reasons[results["status"].values != Status.DONE] = "<script>alert(1)</script>: 3 steps unsolved"
    results["reason"] = (results["status"].dims, reasons)
    results["core_seconds"] = results["status"].copy(data=np.full(results["status"].shape, 2.0)).astype(float)
    axes = {name: results[name].values.tolist() for name in results["status"].dims}
    job = build_job({"name": "a", "model": "elastic_belt", "axes": axes, "sheaves": {"stiffness_of": "disc"}})
    results.attrs["job"] = json.dumps(job.resolved())
    path = tmp_path_factory.mktemp("report") / "report.html"
    return write_report(results, path)


def words_of(page):
    """The text outside of scripts and tags."""
    text = re.sub(r"<(script|style)\b.*?</\1>", "", page.read_text(), flags=re.S)
    return " ".join(re.sub(r"<[^>]+>", " ", text).split())


def test_where_runs_are_quiet_or_slip_through_no_doubt_is_told(tmp_path):
    results = study(gradients=(-0.8,)).isel(sheave_stiffness=[0])
    results["status"][:] = Status.DONE
    results["vibrates"][:] = np.where(results["load"] > 150.0, Vibrates.SLIPS, Vibrates.NO)
    words = page_of(results, tmp_path)
    assert "No run vibrates, but some slip through." in words and "not all are known" not in words


def test_the_page_says_what_was_found_in_sentences(page):
    words = words_of(page)
    assert "occurrence Vibration occurrence over load, friction and stiffness" in words
    assert "40 runs: " in words
    # by the law of the made-up study: 40 N m is quiet, 60 N m vibrates, largest nearest to 115 N m, in t1 at
    # 640 - 0.6 * 120 Hz with 22 um * sin(80 pi / 150); its last loads failed
    place = "At sheave stiffness 1 and friction gradient −2.4 s/m"
    assert (
        f"{place} there is vibration from 50 N m on, as far as is decided, most at 120 N m: 21.9 µm at 568 Hz"
        in words
    )
    assert "midway between neighbouring runs of different class: each end is known ± 10 N m." in words
    # between rigid sheaves all is quiet at -2.4 s/m; at -0.8 s/m a run failed and one was not done
    assert "Nothing vibrates in 1 of 4 lines along load." in words
    assert (
        "In 1 of 4 lines along load no run is known to vibrate, but not all are known to be quiet." in words
    )


def written(results, path, *options):
    """A page whose pictures are not drawn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cvt_hpc.report.page._encoded", lambda compose: "AA==")
        return write_report(results, path, *options)


def page_of(results, tmp_path):
    """The words of such a page."""
    return words_of(written(results, tmp_path / "report.html"))


def test_the_page_begins_with_what_one_hands_on(page):
    words = words_of(page)
    headings = ["Study", "Findings", "What it rests on", "Map", "Next steps", "Failed runs", "Parameters"]
    found = re.findall(r"<h2>(.*?)</h2>", page.read_text())
    assert [one for one in found if one in headings] == headings
    first = page.read_text().partition("Next steps")[0]
    assert first.count('<div class="front">') == 1 and first.rstrip().endswith("</div>\n\n<h2>")
    assert "A run vibrates where the amplitude of a strand is 5 µm or more ( amplitude_threshold )." in words
    assert "All that is fixed is at its default, which is an assumption" in words
    assert re.search(r"Runs that are neither quiet nor vibrating: \d+ undecided, \d failed", words)


@pytest.mark.parametrize(
    ("units", "told"),
    [
        ({"driving_speed": "rpm"}, "driving speed 2500 rpm, thrust 40000 N."),
        ({"driving_speed": "rpm", "thrust": "kN"}, "driving speed 2500 rpm, thrust 40 kN."),
        ({"driving_speed": "kg", "thrust": 5}, "driving speed 261.7993878 rad/s (2500 rpm), thrust 40000 N."),
    ],
)
def test_parameters_have_the_units_of_the_job(units, told, tmp_path):
    results = study(gradients=(-2.4,), stiffnesses=(1.0,))
    axes = {name: results[name].values.tolist() for name in results["status"].dims}
    scene = {"driving_speed": "2500 rpm", "thrust": "40 kN"}
    job = build_job({"name": "a", "model": "elastic_belt", "axes": axes, "scene": scene})
    results.attrs |= {"job": json.dumps(job.resolved()), "job_units": json.dumps(units)}
    assert f"Other than the defaults: {told}" in page_of(results, tmp_path)


def driven_by_a_course(tmp_path, until=0.3):
    """Results of a job whose course is that of a file, and a line of which no value is constant."""
    (tmp_path / "rig.csv").write_text(
        f"time [s],driving_speed [rpm],thrust [kN],load [N m]\n0,2400,44,20\n{until},3000,50,80\n"
    )
    results = study(gradients=(-2.4,), stiffnesses=(1.0,))
    axes = {name: results[name].values.tolist() for name in results["status"].dims if name != "load"}
    document = {"name": "a", "model": "elastic_belt", "axes": axes, "run": {"duration": 0.4}}
    job = build_job(document | {"profiles": {"profile_file": "rig.csv"}}, str(tmp_path / "rig.toml"))
    told = {"job": json.dumps(job.resolved()), "job_files": json.dumps(dict(job.files))}
    return results.isel(load=0).assign_attrs(told)


def test_a_course_that_drives_the_runs_is_told_with_its_file_and_ranges(tmp_path):
    results = driven_by_a_course(tmp_path)
    words = page_of(results, tmp_path)
    ranges = "load 20 to 80 N m, speed 2400 to 3000 rpm, thrust 44 to 50 kN"
    assert f"The course of rig.csv drives each run from 0 to 0.3 s: {ranges}. Verdicts hold over" in words
    assert "Other than the defaults: duration 0.4 s. All else but the course" in words
    for row in ("profile_file rig.csv", "driving_speed 2400 to 3000 rpm", "thrust 44 to 50 kN", "load 20 to"):
        assert row in words
    title = map_figure(results).get_suptitle().replace("\u00a0", " ")
    assert f"course of rig.csv: {ranges}" in " ".join(title.split())
    words = page_of(driven_by_a_course(tmp_path, until=0.1), tmp_path)
    assert "from 0 to 0.1 s:" in words and "Verdicts hold for the constant values to which it leads." in words
    results = study(gradients=(-2.4,), stiffnesses=(1.0,)).assign_attrs(results.attrs)
    told = json.loads(results.attrs["job"])
    told["axes"] |= {"load": results["load"].values.tolist()}
    words = page_of(results.assign_attrs(job=json.dumps(told)), tmp_path)
    assert ": load 0.25 to 1 times its value, speed 2400 to" in words


def test_what_turns_the_direction_of_a_text_is_seen(tmp_path):
    turning = "".join(map(chr, [0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)]))
    results = study(**SMALL)
    results.attrs |= {"title": f"a {turning}", "history": f"b\nc {turning}", "job_name": turning}
    results["reason"] = results["status"].dims, np.full(results["status"].shape, f"d {turning}")
    results["load"].attrs["long_name"] = f"e {turning}"
    results["loss"] = results["load"] * (results["status"] == Status.DONE)
    results["loss"].attrs = {"units": "W", "long_name": "f \u202e"}
    text = written(results, tmp_path / "report.html").read_text()
    data = re.search(r'id="map-data">(.*?)</script>', text, flags=re.S)[1]
    for shown in (text, json.dumps(json.loads(data), ensure_ascii=False)):
        assert not set(turning) & set(shown)
    seen = turning.encode("unicode_escape").decode()
    assert all(f"{letter} {seen}" in text for letter in "acde") and '"name":"f \\\\u202e"' in data


@pytest.mark.parametrize("status", [Status.FAILED_NUMERICS, Status.NOT_RUN])
def test_where_nothing_was_computed_nothing_is_called_quiet(status, tmp_path):
    results = study(**SMALL)
    results["status"][:], results["vibrates"][:] = status, Vibrates.UNDECIDED
    words = page_of(results, tmp_path)
    assert "No run is known to be quiet or to vibrate." in words
    assert "Nothing vibrates" not in words and "Windows begin" not in words


def test_one_run_is_counted_as_one_and_is_no_window(tmp_path):
    words = page_of(study().isel(friction_gradient=[0], sheave_stiffness=[0], load=[4]), tmp_path)
    assert "1 run: 1 vibrating." in words and "there is vibration in all runs, most at 100 N m" in words
    assert "Windows begin" not in words and "Cost and quality" not in words


def test_a_window_that_ends_before_rigid_sheaves_has_no_number_there(tmp_path):
    results = study().isel(load=4, friction_gradient=0, drop=True)
    results["vibrates"][:] = [Vibrates.NO, Vibrates.YES, Vibrates.YES, Vibrates.NO]
    assert "There is vibration from 1.1 to a value between 1.5 and rigid, most" in page_of(results, tmp_path)


def test_values_without_a_unit_are_followed_by_no_gap(tmp_path):
    results = study(**SMALL)
    results["load"].attrs.clear()
    assert " to 180, most at 120: " in page_of(results, tmp_path)


def test_axes_have_their_values_in_the_units_of_the_job_and_a_further_axis_a_map_for_each_value(tmp_path):
    results = xr.concat([study(**SMALL)] * 2, "speed").assign_coords(
        speed=("speed", [0.01, 0.02], {"units": "m s-1", "job_units": "mm/s"})
    )
    words = page_of(results, tmp_path)
    assert "speed 10, 20 [mm/s]" in words and "sheave_stiffness 1, inf" in words
    assert "speed = 10 mm/s 40 runs: " in words and "speed = 20 mm/s 40 runs: " in words
    # the sentences are of all runs, not of the first value alone
    assert "At speed 20 mm/s, sheave stiffness 1 and friction gradient −2.4 s/m there is vibration" in words
    assert map_data(results)["sides"] == {"x": 3, "y": 1, "panel": 2}  # the speed is left to a slider
    assert "load 20 N m to 200 N m" in page_of(sampled(), tmp_path)


def test_each_start_has_a_map_below_that_of_both(tmp_path):
    starts = ("disturbance", [1e-6, 1e-4], {"units": "m", "job_units": "um"})
    results = xr.concat([study(**SMALL)] * 2, "disturbance").assign_coords(disturbance=starts)
    words = page_of(results, tmp_path)
    headings = "Smallest and largest disturbance in one", "disturbance = 1 µm", "disturbance = 100 µm"
    places = [words.find(heading) for heading in headings]
    assert -1 not in places and places == sorted(places)
    assert (tmp_path / "report.html").read_text().count('<img alt="map"') == 3  # for paper


def test_what_follows_from_other_parameters_is_no_choice(tmp_path):
    job = build_job({"name": "a", "model": "elastic_belt", "axes": {"load_share": [0.2, 0.4]}})
    results = study().isel(friction_gradient=0, sheave_stiffness=0, load=[1, 2], drop=True)
    results = results.rename(load="load_share").assign_attrs(job=json.dumps(job.resolved()))
    words = page_of(results, tmp_path)
    assert "Other than the defaults" not in words and "All that is fixed is at its default." in words
    derived = words.partition("Derived from others:")[2].partition("At their defaults")[0]
    assert "by load_share, varies with load_share" in derived and "step 4.6e-06 s" in derived


def test_the_history_of_a_run_is_no_study(tmp_path):
    with pytest.raises(InputError, match="found the history of one run; `cvt-hpc plot` draws it"):
        write_report(study().assign_attrs(cvt_hpc_content=HISTORY), tmp_path / "report.html")


def test_nothing_in_the_map_uploads_it(page):
    text = page.read_text()
    assert re.search(r'"showSendToCloud": ?false', text)


def decoded(text, kind, shape):
    return np.frombuffer(base64.b64decode(text), kind).reshape(shape)


def test_the_map_has_the_numbers_of_each_run_in_units_for_people():
    results = study(stiffnesses=(1.5, np.inf), loads=(100.0, 10.0, 20.0))  # sorted by the map
    results["slip"] = (
        *results["frequency"].dims[:1],
        results["friction_gradient"].data,
    )  # of no run: passed over
    results["part"] = (
        results["frequency"].copy(data=results["frequency"].values / 2e3).assign_attrs(units="m s-1")
    )
    data = map_data(results)
    assert [axis["name"] for axis in data["axes"]] == ["friction gradient", "sheave stiffness", "load"]
    assert data["axes"][2]["texts"] == ["10 N m", "20 N m", "100 N m"]
    assert data["axes"][1]["texts"] == ["1.5", "rigid"]
    keys = ["amplitude", "frequency", "part", "part"]
    assert [(one["key"], one["name"]) for one in data["quantities"]] == list(
        zip(keys, ["amplitude", "frequency", "part, t1", "part, t2"], strict=True)
    )
    assert [one["unit"] for one in data["quantities"]] == ["µm", "Hz", "m/s", "m/s"]
    ordered = results.sortby("load")
    sizes = ordered["amplitude"].max("strand").values * 1e6
    np.testing.assert_allclose(decoded(data["quantities"][0]["values"], "<f4", (3, 2, 3)), sizes, rtol=1e-6)
    classes = decoded(data["classes"], np.int8, (3, 2, 3))
    np.testing.assert_array_equal(classes, map_classes(ordered))
    assert data["first"] == -1 and data["inferred"] == "" and data["starts"] == ""


def two_starts():
    """The study from two disturbances: from the small one nothing vibrates below 90 N m."""
    small, large = study(**SMALL), study(**SMALL)
    small["vibrates"][{"load": slice(0, 4)}] = Vibrates.NO
    starts = ("disturbance", [1e-6, 1e-4], {"units": "m", "job_units": "um"})
    return xr.concat([small, large], "disturbance", combine_attrs="override").assign_coords(
        disturbance=starts
    )


def test_the_map_has_the_onset_lines_of_the_printed_one():
    results = study(**SMALL)
    (line,) = map_data(results)["onsets"]
    assert (line["axis"], line["starts"], line["label"]) == (2, False, "onset of vibration ± 10 N m")
    expected = lowest_onsets(results["load"].values, map_classes(results).values.reshape(-1, 10))
    np.testing.assert_allclose(decoded(line["at"], "<f4", 4), expected)
    assert expected[0] == 50.0 and np.isnan(expected[1])  # rigid sheaves are quiet
    each, small, large = map_data(two_starts())["onsets"]
    assert (each["label"], small["label"], large["label"]) == (
        "onset of vibration ± 10 N m", "onset from a small start ± 10 N m", "onset from a large start ± 10 N m")  # fmt: skip
    # over the disturbance, whose values have it in common, the gradient and the stiffness
    np.testing.assert_allclose(decoded(each["at"], "<f4", (2, 4))[:, 0], [90.0, 50.0])
    np.testing.assert_allclose(decoded(small["at"], "<f4", (2, 4))[:, 0], 90.0)
    np.testing.assert_allclose(decoded(large["at"], "<f4", (2, 4))[:, 0], 50.0)
    assert large["dashed"] and not small["dashed"]


def test_a_logarithmic_axis_has_ticks_between_its_labels():
    data = map_data(study(loads=np.geomspace(10.0, 1000.0, 9)))
    assert data["axes"][2]["ticks"]["texts"] == ["10", "20", "50", "100", "200", "500", "1000"]
    np.testing.assert_allclose(10.0 ** np.array(data["axes"][2]["minor"])[:3], [8.0, 9.0, 10.0])
    assert data["axes"][0]["minor"] == []


def test_ramps_up_and_down_have_a_picture_of_their_bands(tmp_path):
    heading = "Hysteresis: vibration along ramps up and down"
    assert heading in words_of(page := write_report(ramps(), tmp_path / "ramps.html"))
    assert page.read_text().count('<img alt="hysteresis"') == 1
    assert heading not in words_of(write_report(study(**SMALL), tmp_path / "steady.html"))


def test_runs_that_were_done_again_tell_of_the_quality(tmp_path):
    """The sample has three runs: one alike, one with half the amplitude, one quiet instead of vibrating."""
    results = study(**SMALL)
    again = results.copy(deep=True)
    again["status"][:] = Status.NOT_RUN
    for load in (4, 5, 6):
        again["status"][0, 0, load] = Status.DONE
    again["amplitude"][0, 0, 5] *= 0.5
    again["vibrates"][0, 0, 6] = Vibrates.NO
    (tmp_path / "check_step").mkdir()
    again.to_netcdf(tmp_path / "check_step" / "results.nc")
    words = words_of(written(results, tmp_path / "report.html", "x", tmp_path))
    assert "3 runs were done again at half the step, in check_step : 1 of 3 contradict" in words
    assert "those done again deviate by 25.00% (median)" in words
    assert "done again" not in page_of(results, tmp_path)
    other = again.assign_coords(load=again["load"] + 1.0)
    (tmp_path / "check_step" / "results.nc").unlink()
    other.to_netcdf(tmp_path / "check_step" / "results.nc")
    words = words_of(written(results, tmp_path / "report.html", "x", tmp_path))
    assert "Runs were done again, but cannot be compared: " in words


def test_a_trace_has_inferred_cells_and_counts_them_apart(tmp_path):
    results = traced(**SMALL)
    data = map_data(results)
    inferred = decoded(data["inferred"], np.int8, results["status"].shape)
    expected = map_classes(results) != occurrence_classes(results)
    np.testing.assert_array_equal(inferred, expected)
    assert f"{int(expected.sum())} cells inferred: " in page_of(results, tmp_path)


def test_samples_lie_at_their_values_of_every_axis():
    data = map_data(sampled())
    assert data["sampled"] and data["axes"][0]["name"] == "load" and data["sides"]["panel"] == -1
    assert data["axes"][0]["values"] == sampled()["load"].values.tolist()


def unjudged():
    """Results of a model that judges no vibration."""
    results = study(**SMALL).drop_vars(["amplitude", "frequency"])
    results["status"][:], results["vibrates"][:] = Status.DONE, Vibrates.UNDECIDED
    results["limit_torque"] = results["status"].dims, np.arange(40.0).reshape(2, 2, 10), {"units": "N m"}
    return results


def test_a_map_shows_quantities_where_no_run_is_judged(tmp_path, monkeypatch):
    unjudged().to_netcdf(tmp_path / "results.nc")
    drawn = []
    monkeypatch.setattr("cvt_hpc.analysis.value_maps.value_map_figure", lambda *given: drawn.append(given[1]))
    monkeypatch.setattr("cvt_hpc.analysis.figures.draw", lambda compose, out: compose())
    assert main(["map", str(tmp_path / "results.nc")]) == 0
    assert drawn == [["limit_torque"]] and shown_quantities(study(**SMALL)) == []


def test_a_study_that_judges_no_vibration_tells_and_shows_its_quantities(tmp_path):
    words = page_of(unjudged(), tmp_path)
    assert "40 runs: 40 undecided. No run is known to be quiet or to vibrate." in words
    place = "friction gradient −0.8 s/m, sheave stiffness rigid and load 200 N m"
    assert f"Limit torque: from 0 to 39 N m, largest at {place}." in words
    assert map_data(unjudged())["first"] == 0


def test_next_steps_follow_from_what_came_out(tmp_path):
    results = study(**SMALL)
    words = page_of(results, tmp_path)
    # of the made-up study two runs failed by numerics, one by an error, one was stopped, one is left
    assert "cvt-hpc run JOB --retry failed_numerics does the 2 runs again, with a smaller step." in words
    assert "cvt-hpc run JOB --retry timed_out does the run again, with a longer --run-limit ." in words
    assert "cvt-hpc run JOB goes on: 1 run is left." in words
    assert "Steps of load below 20 N m between" in words
    axes = {name: results[name].values.tolist() for name in results["status"].dims}
    disc = {"stiffness_of": "disc"}
    job = build_job({"name": "a", "model": "elastic_belt", "axes": axes, "sheaves": disc})
    words = html.unescape(page_of(results.assign_attrs(job=json.dumps(job.resolved())), tmp_path))
    command = "--at 'friction_gradient=-2.4 s/m' --at sheave_stiffness=1 --at 'load=120 N m'"
    assert f"cvt-hpc simulate JOB {command} --out run.nc --plot run.png shows the run" in words
    words = page_of(results.isel(load=slice(2, 5), sheave_stiffness=[0], friction_gradient=[0]), tmp_path)
    assert "Vibration reaches the largest load, 100 N m, in a line: go further there." in words


def test_between_two_windows_it_is_quiet(tmp_path):
    results = study().isel(friction_gradient=0, sheave_stiffness=0, drop=True)
    results["status"][:] = Status.DONE
    results["vibrates"][:] = [0, 1, 1, 0, 0, 1, 1, 0, 0, 0]
    assert "from 30 to 70 N m and from 110 to 150 N m, quiet between" in page_of(results, tmp_path)


def test_texts_of_a_dataset_end_no_script():
    script = as_script({"text": "</script><script>alert(1)</script>&"})
    assert "<" not in script and json.loads(script)["text"] == "</script><script>alert(1)</script>&"


def test_failed_runs_are_counted_by_reason_and_texts_of_datasets_are_escaped(page):
    assert "<script>alert" not in page.read_text()
    words = words_of(page)
    assert re.search(r"\d+ runs ended without results", words)
    assert "&lt;script&gt;alert(1)&lt;/script&gt;: 3 steps unsolved" in words
    assert "80 core-seconds in all; a run took 2 s of a core (median), 2 s at most" in words


def test_no_address_is_loaded(page):
    text = re.sub(r"<script\b.*?</script>", "", page.read_text(), flags=re.S)
    assert not re.search(r"(src|href)=\"(?!data:)", text)


@pytest.mark.parametrize(
    "results", [traced(**SMALL), study().isel(load=slice(0, 1)), study(gradients=(-0.8,))]
)
def test_studies_of_other_kinds_have_a_page(results, tmp_path):
    assert "runs: " in words_of(write_report(results, tmp_path / "report.html"))


def test_what_is_no_study_has_none(tmp_path):
    with pytest.raises(InputError, match="expected results of a study"):
        write_report(xr.Dataset(), tmp_path / "report.html")
    assert list(tmp_path.iterdir()) == []


def test_ten_thousand_runs_take_seconds(tmp_path):
    large = study(
        gradients=np.linspace(-2, -0.2, 25), stiffnesses=(1.0, 1.2, 1.5, 2.0), loads=np.linspace(2, 200, 100)
    )
    start = time.process_time()
    path = write_report(large, tmp_path / "report.html")
    library = 5e6  # [byte], of the plotting library
    assert path.stat().st_size < library + 1e6
    print(f"{time.process_time() - start:.1f} s")  # mark: 20 s; no assertion depends on the clock


def browse(page, *options):
    """What Chromium prints of a page, errors of its scripts included."""
    browser = shutil.which("chromium")
    if browser is None:
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)("no chromium here")
    always = ("--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr")
    command = [browser, *always, f"--user-data-dir={page.parent / 'profile'}", *options, page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert "CONSOLE" not in done.stderr, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_browser_draws_the_map_and_tells_the_values_of_a_cell(page):
    """In a frame as narrow as a telephone."""
    width, tried, frame = 390, page.with_name("tried.html"), page.with_name("frame.html")
    tried.write_text(page.read_text().replace("</body>", f"{TELL}{POINT}</body>"))
    frame.write_text(FRAME.format(page=tried.name, width=width))
    drawn = browse(frame, "--window-size=1300,1000", "--virtual-time-budget=8000", "--dump-dom")
    (found,) = re.findall(r'<body data-told="([^"]*)"', drawn)
    found = json.loads(html.unescape(found))
    assert "vibrating" in found["told"] and "load: 100 N m" in found["told"]
    assert "frequency: 580 Hz" in found["told"] and found["maps"] == 2
    scroll_bar = 15  # [pixel]
    assert width - scroll_bar <= found["room"] <= width
    assert found["wide"] <= found["room"]  # nothing to be moved sideways


@pytest.mark.slow
def test_sides_values_and_quantities_are_chosen_in_the_browser(tmp_path):
    tried = write_report(two_starts(), tmp_path / "report.html")
    tried.write_text(tried.read_text().replace("</body>", f"{CHOOSE}</body>"))
    drawn = browse(tried, "--virtual-time-budget=5000", "--dump-dom")
    (told,) = re.findall(r'<body data-told="([^"]*)"', drawn)
    scale, x, y, value, panels, text, *lines = json.loads(html.unescape(told))
    hidden, of_small, of_both, legend = lines
    # in each of two panels, the second of which is quiet: that of the disturbance that is chosen; of both
    # along the borders of both rows
    vibrates, quiet = ["solid", 90, 90, 90, 90], ["solid", None, None, None, None]
    assert of_small == [vibrates, vibrates, quiet, quiet] and hidden == []
    assert of_both[:4] == [vibrates, vibrates, ["solid", 50, 50, 40, 40], ["dash", 50, 50, 40, 40]]
    assert legend.endswith("onset from a small start ± 10 N monset from a large start ± 10 N m")
    assert (scale, x, y) == ("frequency [Hz]", "friction gradient [s/m]", "load [N m]") and panels == 2
    assert value == "100 µm"
    place = ["sheave stiffness: 1", "load: 20 N m", "friction gradient: −2.4 s/m"]
    assert text.split("<br>") == [*place, "quiet"]


@pytest.mark.slow
def test_it_prints_on_paper(page):
    from pypdf import PdfReader

    printed = page.with_name("printed.pdf")
    browse(page, "--virtual-time-budget=5000", f"--print-to-pdf={printed}")
    pages = PdfReader(printed).pages
    words = " ".join(" ".join(one.extract_text() for one in pages).split())
    assert "40 runs: " in words and "Nothing vibrates in 1 of 4 lines along load." in words
    assert "Point at a run" not in words  # the printed map stands in the place of that to point at
    assert sum(len(one.images) for one in pages) == 1
    assert "[belt] ring_mass" in words  # the defaults, which are folded on the screen
    handed_on = [" ".join(one.extract_text().split()) for one in pages[:2]]
    assert "Findings" in handed_on[0] and "What it rests on" in handed_on[0]
    assert "Map" in handed_on[1] and len(pages[1].images) == 1
    assert "Next steps" not in " ".join(handed_on)
