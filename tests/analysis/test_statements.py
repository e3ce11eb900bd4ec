"""Statements about figures of papers: how parts make a verdict, and what they measure."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.followed_drawing import sliding_spectrum
from cvt_hpc.errors import InputError
from cvt_hpc.papers.bullinger_ratios import _thirds
from cvt_hpc.papers.figures import ARROWS, FIGURES, _Arc
from cvt_hpc.papers.verdicts import Measured, Statement, Verdict, judged, on_strand, over_arc
from cvt_hpc.variables import Status
from support import stated

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("holds", "verdict", "why"),
    [
        ([True, True], "reproduced", ""),
        ([True, False], "partly", "for a reason"),
        ([False], "not", "for a reason"),
    ],
)
def test_a_verdict_is_of_all_parts(holds, verdict, why):
    found = judged(Statement("it does", lambda kept: Measured(holds, "3 N"), "for a reason"), None)
    assert (found.verdict.value, found.why, found.numbers) == (verdict, why, "3 N")


def test_a_run_that_failed_measures_nothing():
    def measure(kept):
        raise InputError("expected a run that is done")

    assert judged(Statement("it does", measure), None).verdict is Verdict.UNKNOWN


@pytest.mark.parametrize("name", ["clamping", "misalignment"])
def test_a_study_with_open_runs_measures_no_course(name):
    kept = getattr(stated, name)()
    kept.results["status"][-1] = Status.NOT_RUN
    assert {judged(of, kept).verdict for of in FIGURES[name].statements} == {Verdict.UNKNOWN}


def test_each_figure_has_a_job_and_a_table():
    jobs, own, tables = (
        {path.stem for path in (ROOT / "jobs").glob(names)}
        for names in ("*.toml", "figures/*.toml", "results/figures/*.csv")
    )
    assert own <= set(FIGURES) <= own | jobs and tables == set(FIGURES)


def graded(count=60):
    """A history of a belt whose cells are a fourth as long at the ends of arcs; `rise` is the share of its region."""
    even = np.linspace(0.0, 1.0, count + 1)
    share = even - 0.75 * np.sin(2.0 * np.pi * even) / (2.0 * np.pi)
    position = np.concatenate([number + share[:-1] for number in range(4)])
    angle = np.full(4 * count, np.nan)
    for arc in (0, 2):
        angle[arc * count : (arc + 1) * count + 1] = 3.0 * share
    names = np.repeat(["driving arc", "t1", "driven arc", "t2"], count)
    rise = np.where(np.isfinite(angle), angle / 3.0, position % 1.0)
    return xr.Dataset(
        {"wrap_angle": ("position", angle), "rise": ("position", rise)},
        {"position": 0.2 * position, "region": ("position", names)},
    )


def test_means_along_the_belt_are_over_its_length_whatever_its_cells():
    history = graded()
    stations = history["rise"].values[:61]
    assert np.mean(stations**2) > 1.1 / 3.0  # of which more lie at the ends
    arc = over_arc(history, "rise", "driven")
    assert (arc.values[0], arc.values[-1]) == (0.0, 1.0)
    assert arc.values == pytest.approx(arc.share, abs=1e-12)
    # 61 places hold 20 in a third
    assert _thirds(arc.values) == pytest.approx((1.0 / 6.0, 5.0 / 6.0), abs=0.01)
    drawn = _Arc(history, "driven")
    assert np.diff(drawn.wrap[drawn.arrows]) == pytest.approx(3.0 / (ARROWS - 1), rel=0.5)
    assert np.diff(on_strand(history, "rise", "t1")) == pytest.approx(1.0 / 60.0, rel=0.05)


def test_swings_of_sliding_are_told_over_the_length_of_the_arc():
    history, time = graded(), np.arange(2000) / 2e4
    # 500 Hz at 0.1 m/s in the middle half of the driven arc alone
    share = history["wrap_angle"].fillna(0.0).values / 3.0
    moving = (share > 0.25) & (share < 0.75)
    speed = 0.1 * np.sin(2.0 * np.pi * 500.0 * time)[:, None] * moving
    history["momentary_sliding_speed"] = ("profile_time", "position"), speed
    lines, amplitude = sliding_spectrum(history.assign_coords(profile_time=time))
    assert lines[amplitude.argmax()] == pytest.approx(500.0, abs=2.0)
    # five stations at each end, 2 % of the arc, are left out
    assert amplitude.max() == pytest.approx(0.1 * np.sqrt(0.5), rel=0.05)
