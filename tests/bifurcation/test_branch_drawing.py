"""The picture of a branch, and branches with gaps, made up."""

from dataclasses import replace
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest

from cvt_hpc.analysis.figures import STYLE
from cvt_hpc.experiments.branch import attractors
from cvt_hpc.experiments.branch.attractors import Attractor, Followed, states_of
from cvt_hpc.experiments.branch.drawing import GAP, HOPF, STARTS, branch_figure, stable_parts
from cvt_hpc.experiments.branch.table import branch_lines, failure_lines, gap_lines
from cvt_hpc.job.schema import load_schema
from cvt_hpc.models.linear_stability.branch import Branch, Onset, Point, branch, onsets, tracks
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.walking import NoSteadyState
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Criticality, Kind

ALONG = np.linspace(0.0, np.pi, 33)
SHAPES = [np.sin(k * ALONG) + 0j for k in (1, 2, 3)]
Q, V, U, F, NOT_RUN, SLIPS, IRREGULAR = OccurrenceClass


def mode(growth, frequency, shape=0):
    return Mode(
        growth, frequency, np.ones(4), shape % 2, shape + 1, np.zeros(33), SHAPES[shape], SHAPES[shape]
    )


def point(load, *growths):
    """A state with the modes 0, 1, ... of such growth, the fastest first; None: it is not there."""
    modes = [mode(g, 400.0 + 100.0 * k + load, k) for k, g in enumerate(growths) if g is not None]
    return Point(SimpleNamespace(load=load), sorted(modes, key=lambda one: -one.growth))


POINTS = [point(10.0, -50.0, -90.0), point(20.0, 30.0, -60.0), point(30.0, 60.0, -20.0), point(50.0, -70.0, -80.0),
          point(60.0, -75.0, -60.0)]  # fmt: skip
ONSET = Onset(16.0, 420.0, 0, 1, True, 0)
LOADS = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
FOUND = Branch(POINTS, {40.0: "no steady state found"})


def diagram(**units):
    job = SimpleNamespace(name="x", schema=replace(load_schema("linear_stability", None, "x"), units=units))
    return SimpleNamespace(loads=LOADS, axes=(), job=job)


def run(load, start, occurrence, amplitude=np.nan, reason=""):
    return Attractor(load, start, occurrence, amplitude, 450.0, reason)


def followed(onsets=(ONSET,)):
    runs = [run(20.0, 0, V, 9e-6), run(30.0, 0, V, 12e-6), run(10.0, 0, Q, 1e-9), run(10.0, 1, V, 6e-6),
            run(50.0, 1, U, 3e-6), run(60.0, 0, F, reason="slips"), run(60.0, 1, F, reason="slips through")]  # fmt: skip
    kinds = [Criticality(Kind.SUBCRITICAL, 6.0, 1.0, "both attractors")] * len(onsets)
    asked = SimpleNamespace(place={}, parameters={"friction_gradient": -0.8, "sheave_stiffness": np.inf})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(attractors, "quantities", lambda steady, grid: {})
        states = states_of(FOUND, None, LOADS)
    return Followed(asked, states, list(onsets), [(30.0, 50.0)], runs, kinds)


@pytest.fixture(scope="module")
def panels():
    with matplotlib.rc_context(STYLE):
        figure = branch_figure(diagram(), followed())
    return figure, *figure.axes


def test_the_steady_state_is_solid_where_stable_dashed_where_not_and_has_gaps(panels):
    lines = [line for line in panels[1].lines if line.get_color() == "black" and line.get_linewidth() == 1.8]
    drawn = [(*line.get_xdata(), line.get_linestyle()) for line in lines]
    assert drawn == [(10.0, 16.0, "-"), (16.0, 30.0, "--"), (50.0, 60.0, "-")]
    for axes in panels[1:]:
        (gap,) = [patch for patch in axes.patches if patch.get_facecolor() == matplotlib.colors.to_rgba(GAP)]
        assert (gap.get_x(), gap.get_x() + gap.get_width()) == (30.0, 50.0)


def test_limit_cycles_are_filled_dots_and_quiet_runs_are_not_drawn(panels):
    dots = {}
    for line in panels[1].lines:
        if line.get_marker() in ("o", "D") and len(line.get_xdata()):
            filled = line.get_markerfacecolor() != "none"
            dots[line.get_marker(), filled] = list(zip(line.get_xdata(), line.get_ydata(), strict=True))
    assert dots == {
        ("o", True): [(20.0, pytest.approx(9.0)), (30.0, pytest.approx(12.0))],
        ("D", True): [(10.0, pytest.approx(6.0))],
        ("D", False): [(50.0, pytest.approx(3.0))],
    }
    (hopf,) = [line for line in panels[1].lines if line.get_marker() == "s"]
    assert (list(hopf.get_xdata()), hopf.get_color()) == ([16.0], HOPF)
    assert hopf.get_markerfacecolor() == "white"  # subcritical
    (legend,) = panels[0].legends
    assert "Hopf point, subcritical" in [text.get_text() for text in legend.get_texts()]


def test_failed_runs_stand_at_the_upper_edge_and_in_the_legend(panels):
    marks = {line.get_color(): line for line in panels[1].lines if line.get_marker() == "X"}
    assert [list(line.get_xdata()) for line in marks.values()] == [[60.0], [60.0]] and len(marks) == 2
    for line in marks.values():
        assert line.get_transform() == panels[1].get_xaxis_transform()
        assert 0.8 < line.get_ydata()[0] < 1.0
    (legend,) = panels[0].legends
    words = [text.get_text() for text in legend.get_texts()]
    assert {f"failed from the {start} (no amplitude)" for start in ("steady state", "large start")} <= {
        *words
    }


def test_slipping_and_irregular_runs_have_marks_and_words_of_their_own():
    special = [run(60.0, 0, SLIPS), run(60.0, 1, SLIPS), run(50.0, 0, IRREGULAR, 4e-6)]
    one = followed()
    one.runs[:] = special
    with matplotlib.rc_context(STYLE):
        figure = branch_figure(diagram(), one)
    upper = figure.axes[0]
    edge = [line for line in upper.lines if line.get_marker() == ">"]
    assert [(line.get_xdata()[0], line.get_color()) for line in edge] == [(60.0, c) for _, c in STARTS]
    assert all(line.get_transform() == upper.get_xaxis_transform() for line in edge)
    (dot,) = [line for line in upper.lines if line.get_marker() == "o" and len(line.get_xdata())]
    assert dot.get_ydata() == pytest.approx([4.0]) and dot.get_markerfacecolor() not in ("none", STARTS[0][1])
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "irregular" in words and "slips from the large start (no limit cycle)" in words
    assert "the belt slips at 60 N m" in list(branch_lines(diagram(), one))
    assert not list(failure_lines(diagram(), one))


@pytest.mark.parametrize("onsets", [(), (ONSET,)])
def test_the_legend_is_on_the_sheet(onsets):
    with matplotlib.rc_context(STYLE):
        figure = branch_figure(diagram(), followed(onsets))
        figure.draw_without_rendering()
    (legend,) = figure.legends
    extent = legend.get_window_extent()
    assert 0.0 <= extent.x0 < extent.x1 <= figure.bbox.width and extent.y0 >= 0.0


def test_modes_are_lines_that_end_at_the_gap(panels):
    growth = [line for line in panels[2].lines if line.get_marker() == "."]
    drawn = sorted(
        (tuple(line.get_xdata()), tuple(line.get_ydata()), line.get_linewidth()) for line in growth
    )
    assert drawn == [
        ((10.0, 20.0, 30.0), (-90.0, -60.0, -20.0), 0.8),
        ((10.0, 20.0, 30.0), (-50.0, 30.0, 60.0), 1.8),
        ((50.0, 60.0), (-80.0, -60.0), 0.8),
        ((50.0, 60.0), (-70.0, -75.0), 0.8),
    ]
    frequency = [line.get_ydata() for line in panels[3].lines if line.get_marker() == "."]
    assert sorted(map(tuple, frequency))[0] == (410.0, 420.0, 430.0)


def test_words_name_hopf_points_and_gaps(panels):
    assert list(branch_lines(diagram(), followed())) == [
        "friction gradient -0.8 s/m, sheave stiffness inf:",
        "Hopf point at 16.0 N m, 420 Hz, 1 half wave in t1: stability lost; subcritical, hysteresis 6.0 +- 1.0 N m",
        "no steady state found at 40 N m",
        "stability changes between 30 and 50 N m, where a steady state is not found",
        "no run from the steady state at 50 N m, where none is found",
    ]
    title = panels[0].get_suptitle().replace("\n", " ").replace("\u00a0", " ")
    assert all(line.rstrip(":") in title for line in (*branch_lines(diagram(), followed()),)[:4:2])
    assert list(gap_lines(diagram(), followed()))[1] in title
    assert list(failure_lines(diagram(), followed())) == [
        "friction gradient -0.8 s/m, sheave stiffness inf: the run from the steady state at 60 N m failed: slips",
        "friction gradient -0.8 s/m, sheave stiffness inf: the run from the large start at 60 N m failed: "
        "slips through",
    ]


def test_loads_are_in_the_unit_of_the_job():
    one, in_knm = followed(), diagram(load="kN m")
    one.runs.append(run(60.0, 1, SLIPS))
    assert list(branch_lines(in_knm, one))[1:] == [
        "Hopf point at 0.0160 kN m, 420 Hz, 1 half wave in t1: stability lost; subcritical, "
        "hysteresis 0.0060 +- 0.0010 kN m",
        "no steady state found at 0.04 kN m",
        "stability changes between 0.03 and 0.05 kN m, where a steady state is not found",
        "no run from the steady state at 0.05 kN m, where none is found",
        "the belt slips at 0.06 kN m",
    ]
    assert next(failure_lines(in_knm, one)).endswith("from the steady state at 0.06 kN m failed: slips")
    with matplotlib.rc_context(STYLE):
        *_, lower = (upper, *_) = branch_figure(in_knm, one).axes
    assert lower.get_xlabel() == "load [kN m]" and lower.get_xlim() == pytest.approx((0.01, 0.06))
    # steady states, the dots of runs with what stands at the upper edge, and modes, each at its own load
    xs = {round(float(x), 6) for line in (*upper.lines, *lower.lines) for x in line.get_xdata()}
    assert xs == {0.01, 0.016, 0.02, 0.03, 0.05, 0.06}


def test_a_hopf_point_of_an_unstable_state_does_not_make_it_stable():
    both = [Onset(12.0, 420.0, 0, 1, True, 0), Onset(25.0, 520.0, 1, 2, True, 1)]
    assert stable_parts(np.array(LOADS[:3]), True, both) == [(10.0, 12.0, True), (12.0, 30.0, False)]


def test_modes_are_followed_by_shape_where_their_order_changes():
    piece = [point(1.0, -10.0, -20.0), point(2.0, -15.0, -12.0), point(3.0, None, -5.0, -9.0)]
    lines = [{place: one.half_waves for place, one in track.items()} for track in tracks(piece)]
    assert sorted(lines, key=str) == [{0: 1, 1: 1}, {0: 2, 1: 2, 2: 2}, {2: 3}]


class OnALine:
    """Steady states whose modes grow linearly with the load: -1.5 + 0.1 load and -2.5 + 0.1 load."""

    missed: tuple[float, ...] = ()
    fails_between = False

    def at(self, load, near=None):
        if load in self.missed or self.fails_between and load not in (10.0, 20.0, 30.0):
            raise NoSteadyState(f"not at {load:g}")
        return SimpleNamespace(load=load)


@pytest.fixture
def on_a_line(monkeypatch):
    def at(steady, grid, band):
        assert band == (100.0, 1500.0)
        return point(steady.load, -1.5 + 0.1 * steady.load, -2.5 + 0.1 * steady.load).modes

    monkeypatch.setattr("cvt_hpc.models.linear_stability.branch.modes", at)
    return OnALine()


def test_every_mode_that_crosses_the_axis_has_its_hopf_point(on_a_line):
    for loads in ((10.0, 20.0, 30.0), (10.0, 30.0)):
        found, hidden = onsets(on_a_line, None, branch(on_a_line, None, loads))
        assert [(one.rising, one.others, one.half_waves) for one in found] == [
            (True, 0, 1),
            (True, 1, 2),
        ]
        assert [one.load for one in found] == pytest.approx([15.0, 25.0], abs=0.05) and hidden == []


def test_nothing_is_joined_across_a_load_without_a_steady_state(on_a_line):
    on_a_line.missed = (18.0,)
    found = branch(on_a_line, None, (10.0, 18.0, 30.0))
    assert found.missed == {18.0: "not at 18"}
    assert [[one.steady.load for one in piece] for piece in found.pieces()] == [[10.0], [30.0]]
    assert onsets(on_a_line, None, found) == ([], [(10.0, 30.0)])


def test_a_state_that_is_not_found_on_the_way_is_no_hopf_point(on_a_line):
    on_a_line.fails_between = True
    found = branch(on_a_line, None, (10.0, 20.0))
    assert onsets(on_a_line, None, found) == ([], [(10.0, 20.0)])
