"""The page about a study: what it says, and what a browser makes of it."""

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

from cvt_hpc.analysis.arrangement import arrange
from cvt_hpc.analysis.maps import sheet_of
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.netcdf import HISTORY
from cvt_hpc.report import write_report
from cvt_hpc.report.interactive import LONGEST_TITLE, map_with_values
from cvt_hpc.variables import Status, Vibrates
from support.studies import sampled, study, traced

SMALL = {"gradients": (-2.4, -0.8), "stiffnesses": (1.0, np.inf)}
# Moves the pointer to the cell at 100 N m and -2.4 s/m of the first panel, and keeps what stands beside it.
POINT = """
<script>
window.addEventListener("load", () => setTimeout(() => {
  const panel = document.querySelector(".nsewdrag"), place = panel.getBoundingClientRect();
  const at = {clientX: place.left + 0.45 * place.width, clientY: place.top + 0.75 * place.height, bubbles: true};
  panel.dispatchEvent(new MouseEvent("mouseover", at));
  panel.dispatchEvent(new MouseEvent("mousemove", at));
  setTimeout(() => { document.body.dataset.told = document.querySelector(".hoverlayer").textContent; }, 500);
}, 500));
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
    path = tmp_path_factory.mktemp("report") / "report.html"
    return write_report(results, path)


def words_of(page):
    """The text outside of scripts and tags."""
    text = re.sub(r"<(script|style)\b.*?</\1>", "", page.read_text(), flags=re.S)
    return " ".join(re.sub(r"<[^>]+>", " ", text).split())


def test_the_page_says_what_was_found_in_sentences(page):
    words = words_of(page)
    assert "occurrence Vibration occurrence over load, friction and stiffness" in words
    assert "40 runs: " in words
    # by the law of the made-up study: 40 N m is quiet, 60 N m vibrates, largest nearest to 115 N m, in t1 at
    # 640 - 0.6 * 120 Hz with 22 um * sin(80 pi / 150); its last loads failed
    place = "At sheave stiffness 1 and friction gradient −2.4 s/m"
    assert (
        f"{place} the belt vibrates from 50 N m on, as far as is decided, most at 120 N m: 21.9 µm at 568 Hz."
        in words
    )
    # between rigid sheaves all is quiet at -2.4 s/m; at -0.8 s/m a run failed and one was not done
    assert "Nothing vibrates in 1 of 4 lines along load." in words
    assert (
        "In 1 of 4 lines along load no run is known to vibrate, but not all are known to be quiet." in words
    )


def page_of(results, tmp_path):
    return words_of(write_report(results, tmp_path / "report.html"))


@pytest.mark.parametrize("status", [Status.FAILED_NUMERICS, Status.NOT_RUN])
def test_where_nothing_was_computed_nothing_is_called_quiet(status, tmp_path):
    results = study(**SMALL)
    results["status"][:], results["vibrates"][:] = status, Vibrates.UNDECIDED
    words = page_of(results, tmp_path)
    assert "No run is known to be quiet or to vibrate." in words
    assert "Nothing vibrates" not in words and "Windows begin" not in words


def test_one_run_is_counted_as_one_and_is_no_window(tmp_path):
    words = page_of(study().isel(friction_gradient=[0], sheave_stiffness=[0], load=[4]), tmp_path)
    assert "1 run: 1 vibrating." in words and "the belt vibrates in all runs, most at 100 N m" in words
    assert "Windows begin" not in words and "Cost and quality" not in words


def test_a_window_that_ends_before_rigid_sheaves_has_no_number_there(tmp_path):
    results = study().isel(load=4, friction_gradient=0, drop=True)
    results["vibrates"][:] = [Vibrates.NO, Vibrates.YES, Vibrates.YES, Vibrates.NO]
    assert "vibrates from 1.1 to a value between 1.5 and rigid, most" in page_of(results, tmp_path)


def test_values_without_a_unit_are_followed_by_no_gap(tmp_path):
    results = study(**SMALL)
    results["load"].attrs.clear()
    assert " to 180, most at 120: " in page_of(results, tmp_path)


def test_axes_have_their_values_in_the_units_of_the_job_and_what_is_fixed_is_said(tmp_path):
    results = xr.concat([study(**SMALL)] * 2, "speed").assign_coords(
        speed=("speed", [0.01, 0.02], {"units": "m s-1", "job_units": "mm/s"})
    )
    words = page_of(results, tmp_path)
    assert "speed 10, 20 [mm/s]" in words and "sheave_stiffness 1, inf" in words
    assert "Below, and in the map: speed = 10 mm/s (first of 2)." in words
    assert "load 20 N m to 200 N m" in page_of(sampled(), tmp_path)


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


def figure_of(results):
    return map_with_values(sheet_of(arrange(results, {}, "results")))


def test_a_quantity_is_told_at_the_place_of_its_run():
    """The middle of a cell is another place where the axis is uneven."""
    results = study(stiffnesses=(1.5, np.inf), loads=(10.0, 20.0, 100.0)).isel(friction_gradient=0, drop=True)
    for name in ("slip", "efficiency"):
        values = results["amplitude"].isel(strand=0, drop=True).copy(data=np.arange(6.0).reshape(2, 3))
        results[name] = values.assign_attrs(units="1", long_name="of one name")
    figure = figure_of(results)
    told = [trace for trace in figure.data if "of one name" in (trace.hovertemplate or "")]
    assert len(told) == 2
    assert list(told[0].text[1]) == [f"sheave stiffness: rigid<br>load: {load} N m" for load in (10, 20, 100)]
    (menu,) = figure.layout.updatemenus
    assert [button.label for button in menu.buttons] == ["occurrence", "of one name", "of one name"]
    assert [sum(button.args[0]["visible"]) for button in menu.buttons[1:]] == [1, 1]


def test_failed_runs_have_a_mark_and_a_place_in_the_legend():
    results = study(**SMALL)
    results["status"][:] = Status.FAILED_NUMERICS
    crosses = [trace for trace in figure_of(results).data if trace.type == "scatter"]
    assert sum(len(trace.x) for trace in crosses if not trace.showlegend) == results["status"].size
    assert [trace.name for trace in crosses if trace.showlegend] == ["failed"]


def test_texts_of_an_axis_are_no_tags_for_the_plotting_library():
    texts = [f'<a href="x{k}">{"y" * 40}</a>' for k in range(2)]
    results = study().isel(load=slice(0, 2), sheave_stiffness=slice(0, 2), friction_gradient=[0])
    results = results.assign_coords(load=texts, sheave_stiffness=texts, friction_gradient=texts[:1])
    layout = figure_of(results).layout
    titles = [title.text for title in layout.annotations]
    assert not any("<" in text for text in [*layout.xaxis.ticktext, *layout.yaxis.ticktext, *titles])
    assert max(len(html.unescape(title)) for title in titles) == LONGEST_TITLE


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
    assert path.stat().st_size < 15e6
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
@pytest.mark.parametrize("width", [1200, 390])
def test_a_browser_draws_the_map_and_tells_the_values_of_a_cell(page, width):
    tried = page.with_name(f"tried_{width}.html")
    tried.write_text(page.read_text().replace("</body>", f"{POINT}</body>"))
    drawn = browse(tried, f"--window-size={width},900", "--virtual-time-budget=8000", "--dump-dom")
    told = re.search(r'data-told="([^"]*)"', drawn)
    assert told and "vibrating" in told[1] and "load: 100 N m" in told[1] and "frequency: 580 Hz" in told[1]
    assert drawn.count('class="heatmaplayer') >= 2


@pytest.mark.slow
def test_it_prints_on_paper(page):
    printed = page.with_name("printed.pdf")
    browse(page, "--virtual-time-budget=5000", f"--print-to-pdf={printed}")
    assert printed.read_bytes().startswith(b"%PDF") and printed.stat().st_size > 20_000
