"""What the pictures show, read from their artists."""

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Polygon, Rectangle
from PIL import Image

from cvt_hpc.analysis.figures import STYLE
from cvt_hpc.experiments.chart import load, make
from cvt_hpc.experiments.chart.comparing import compare
from cvt_hpc.experiments.chart.measuring import measure
from cvt_hpc.experiments.chart.scene_drawing import GREY, budget_figure, scene_figure


def comparison_of(job):
    chart = load(job)
    found = {p.name: measure(p, chart.scene(p.scene), 1, 3600.0) for p in chart.points}
    return compare(chart, found)[0]


def drawn(draw, comparison):
    with matplotlib.rc_context(STYLE):
        figure = draw(comparison)
        figure.draw_without_rendering()
    return figure


def panel(figure, title):
    (axes,) = [axes for axes in figure.axes if axes.get_title(loc="left").startswith(title)]
    return axes


def marked(axes, what):
    return [(*line.get_xdata(), *line.get_ydata()) for line in axes.lines if line.get_gid() == what]


@pytest.fixture(scope="module")
def kept():
    """What is measured and drawn once for all tests, and only looked at."""
    return {}


@pytest.fixture
def figure(write_chart, kept):
    """Against the bell at 2 us, whose own error is 2e-4."""
    if "figure" not in kept:
        job = write_chart(('reference = "exact"', 'reference = { stepper = "soft", step = "2 us" }'))
        kept["figure"] = drawn(scene_figure, comparison_of(job))
    return kept["figure"]


@pytest.fixture
def comparison(write_chart, kept):
    """Against the exact solution."""
    if "comparison" not in kept:
        kept["comparison"] = comparison_of(write_chart())
    return kept["comparison"]


def test_each_quantity_has_a_panel_with_both_axes_logarithmic(figure):
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert titles == ["trajectory, 0-10 ms", "amplitude", "fundamental frequency"]
    for axes in figure.axes[:3]:
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert axes.get_xlabel() == "relative error"
        assert axes.get_ylim() == figure.axes[0].get_ylim()  # costs are compared across panels
    assert figure.axes[0].get_ylabel() == "core-seconds per\nsimulated second"
    assert figure.get_suptitle() == "Ringing\nerror against cost, lower left is better"


def test_each_method_is_a_line_over_its_settings(figure):
    axes = panel(figure, "amplitude")
    lines = {line.get_label(): line for line in axes.lines if not line.get_label().startswith("_")}
    assert {"soft hammer", "clever"} <= set(lines)
    soft = lines["soft hammer"]
    # 1, 10 and 200 us, against the reference at 2 us; 2 ms has failed
    assert soft.get_xdata() == pytest.approx(np.array([1e-4, 8e-4, 1.98e-2]) / 1.0002, rel=1e-3)
    assert soft.get_ydata() == pytest.approx(20e3 * 1.1e-9 / np.array([1e-6, 1e-5, 2e-4]), rel=1e-6)
    assert (
        soft.get_color() != lines["clever"].get_color() and soft.get_marker() != lines["clever"].get_marker()
    )


def test_a_method_looks_alike_in_all_scenes(write_chart):
    other = """
[chart.scenes.other]
reference = "exact"
quantities = { amplitude = {} }

[chart.methods.soft]
scenes = ["ringing"]"""
    chart = load(write_chart(("[chart.methods.soft]", other), ('"hard"', '"hard"\nscenes = ["ringing"]')))
    found = {p.name: measure(p, chart.scene(p.scene), 1, 3600.0) for p in chart.points}
    looks = []
    for comparison in compare(chart, found):
        figure = drawn(scene_figure, comparison)
        line = next(line for line in panel(figure, "amplitude").lines if line.get_label() == "clever")
        looks.append((line.get_color(), line.get_marker()))
    assert looks[0] == looks[1]


def test_what_is_below_the_references_error_is_hatched_and_grey(figure):
    axes = panel(figure, "amplitude")
    (hatched,) = [patch for patch in axes.patches if patch.get_gid() == "reference"]
    assert isinstance(hatched, (Rectangle, Polygon)) and hatched.get_hatch()
    extent = hatched.get_extents().transformed(axes.transData.inverted())
    assert extent.x1 == pytest.approx(2e-4, rel=1e-2)
    ((x, y),) = marked(axes, "below")
    assert (x, y) == pytest.approx((1e-4, 22.0), rel=1e-2)
    (line,) = [line for line in axes.lines if line.get_gid() == "below"]
    assert to_hex(line.get_markeredgecolor()) == GREY and line.get_markerfacecolor() == "white"


def test_the_chosen_point_and_the_tolerance_are_marked(figure):
    axes = panel(figure, "amplitude")
    ((x, y),) = marked(axes, "chosen")
    assert (x, y) == pytest.approx((9.8e-3, 20e3 * 1.1e-9 / 0.1), rel=1e-2)  # clever at 0.1
    (tolerance,) = [line for line in axes.lines if line.get_gid() == "tolerance"]
    assert list(tolerance.get_xdata()) == [0.01, 0.01]


def texts(figure):
    return "\n".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_what_failed_is_listed_under_the_panels(figure):
    assert "omitted: failed, the bell has cracked: soft hammer (2\u00a0ms)" in texts(figure)
    assert "reference: soft at 2\u00a0µs; its own error from a coarser one" in texts(figure)
    assert "cheapest within all tolerances: clever at 0.1, 0.00022\u00a0core-s/s" in texts(figure)


def test_the_legend_explains_all_signs(figure, comparison):
    names = [text.get_text() for text in figure.legends[0].texts]
    assert names == [
        "soft hammer", "clever", "hard", "below the reference's error", "tolerance",
        "cheapest within all tolerances",
    ]  # fmt: skip
    exact = drawn(scene_figure, comparison)
    assert "below the reference's error" not in [text.get_text() for text in exact.legends[0].texts]
    assert "reference: exact solution" in texts(exact)


def test_legend_and_title_fit_into_the_picture(figure):
    width, height = figure.canvas.get_width_height()
    for box in (figure.legends[0].get_window_extent(), figure._suptitle.get_window_extent()):
        assert 0 <= box.x0 and box.x1 <= width and 0 <= box.y0 and box.y1 <= height


def test_a_false_occurrence_is_crossed_and_a_huge_error_named(write_chart):
    job = write_chart(("20 um", "4.95 um"), ("[0.01, 0.1, 0.5]", "[0.01, 200.0]"))
    figure = drawn(scene_figure, comparison_of(job))
    axes = panel(figure, "amplitude")
    crossed = marked(axes, "occurrence")
    assert crossed and min(x for x, _ in crossed) == pytest.approx(
        2e-2, rel=1e-2
    )  # 1 % louder is still quiet
    assert "occurrence differs" in [text.get_text() for text in figure.legends[0].texts]
    assert "omitted: error of more than 1000%: clever (200)" in texts(figure)
    assert axes.get_xlim()[1] < 10


def test_an_error_over_a_scale_says_so(write_chart):
    job = write_chart(('amplitude = { tolerance = "1 %" }', 'amplitude = { scale = "5 um" }'))
    assert panel(drawn(scene_figure, comparison_of(job)), "amplitude").get_xlabel() == "error / 5 µm"


def test_the_budget_shows_errors_of_the_default_first(comparison):
    figure = drawn(budget_figure, comparison)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["amplitude", "frequency"]
    axes = figure.axes[0]
    assert axes.get_xscale() == "log" and axes.get_xlabel() == "relative error"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["step 1 us", "louder", "cracked"]
    assert axes.get_ylim()[0] > axes.get_ylim()[1]  # the first on top
    dots = {float(line.get_ydata()[0]): line for line in axes.lines if line.get_marker() == "o"}
    assert dots[0].get_xdata()[0] == pytest.approx(9e-4, rel=1e-2)
    assert dots[1].get_xdata()[0] == pytest.approx(0.1, rel=1e-3)
    assert dots[0].get_markerfacecolor() != "white" and dots[1].get_markerfacecolor() == "white"
    assert 2 not in dots and "failed" in [text.get_text() for text in axes.texts]
    # the quiet one is cracked, so that the occurrence of none that is drawn differs
    assert [text.get_text() for text in figure.legends[0].texts] == [
        "error of the default",
        "what another choice changes",
        "tolerance",
    ]


def test_the_legend_of_a_budget_has_what_is_drawn_alone(write_chart):
    job = write_chart(
        ('set = { loudness = "22 um" }', 'set = { loudness = "2 um" }\nrefines = true'),
        ('amplitude = { tolerance = "1 %" }', "amplitude = {}"),
        ('frequency = { tolerance = "1 %" }', "frequency = {}"),
    )
    figure = drawn(budget_figure, comparison_of(job))
    assert [text.get_text() for text in figure.legends[0].texts] == [
        "error of the default",
        "occurrence differs",
    ]


def test_the_largest_error_of_the_default_is_on_top(write_chart):
    job = write_chart(('set = { loudness = "22 um" }', 'set = { loudness = "22 um" }\nrefines = true'))
    axes = drawn(budget_figure, comparison_of(job)).axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["louder", "step 1 us", "cracked"]


def test_pictures_are_small_and_named_after_their_scenes(write_chart):
    outcome = make(load(write_chart()), Path("out/bells"), fresh=False, tell=print)
    pictures = [path for kind, path in outcome.files if kind == "picture"]
    assert [str(path) for path in pictures] == ["out/bells/ringing.png", "out/bells/budget.png"]
    for path in pictures:
        assert path.stat().st_size < 300_000
        assert Image.open(path).size[0] == 1088
