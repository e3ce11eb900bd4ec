"""The page about a study: what it says, and what a browser makes of it."""

import os
import re
import shutil
import subprocess
import time

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.errors import InputError
from cvt_hpc.report import write_report
from cvt_hpc.variables import Status
from support.studies import study, traced

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
    assert "Nothing vibrates in 2 of 4 lines along load." in words


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
