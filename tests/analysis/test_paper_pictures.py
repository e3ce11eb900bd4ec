"""Pictures that are drawn as papers draw them: what they show of studies of which all that is stated holds."""

import numpy as np
import pytest

from cvt_hpc.analysis.paper_pictures import spectrum_figure
from cvt_hpc.papers.figures import FIGURES
from support import stated


def drawn(name):
    figure = FIGURES[name].compose(getattr(stated, name)())
    figure.draw_without_rendering()
    return figure


def labels_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_sliding_has_arrows_and_both_parts():
    figure = drawn("bullinger_04")
    driving, driven, below, _ = figure.axes
    assert [axes.get_title() for axes in (driving, driven)] == ["driving pulley", "driven pulley"]
    sliding, friction = driving.collections
    # friction is against sliding
    along = sliding.U * friction.U + sliding.V * friction.V
    assert np.all(along < 0.0)
    assert len(below.lines) == 2 * 2 + 1  # two parts of two runs, and zero
    assert labels_of(figure)[:2] == ["sliding of the element", "direction of friction on the element"]


def test_the_moment_stands_over_time_with_the_load_above_it():
    upper, lower, beside = drawn("lebrecht_3_1").axes
    (scale,) = upper.child_axes
    assert (lower.get_xlabel(), scale.get_xlabel()) == ("time [s]", "load [N m]")
    assert scale.get_xlim() == pytest.approx((40.0, 200.0), rel=1e-3)
    moment, strand = (axes.lines[0].get_ydata().max() for axes in (lower, beside))
    # the mean over 10 ms that is taken off holds 6 % of a motion at 550 Hz
    assert moment == pytest.approx(2.0, rel=0.07) and strand == pytest.approx(12.0, rel=0.07)


def test_curves_of_friction_are_marked_where_they_feed():
    (axes,) = drawn("lebrecht_3_12").axes
    curves = [line for line in axes.lines if line.get_linestyle() != "None"]
    marks = [line for line in axes.lines if line.get_marker() == "o" and len(line.get_xdata())]
    assert [line.get_label() for line in curves] == ["0 s/m", "−0.7 s/m", "−1 s/m"]
    assert [line.get_xdata().tolist() for line in marks] == [[100.0, 200.0]] * 2


def test_the_way_into_the_groove_has_its_innermost_point():
    plane, way, speed = drawn("lebrecht_4_1").axes
    inwards, outwards = plane.collections
    assert len(inwards.U) + len(outwards.U) == pytest.approx(11, abs=1)
    x, y = way.lines[0].get_data()
    assert x[np.argmin(y)] == pytest.approx(0.75 * np.degrees(3.0))
    assert speed.lines[0].get_ydata()[[0, -1]] == pytest.approx([-150.0, 50.0])


def test_blocks_tell_who_feeds_and_who_takes():
    falling, constant = drawn("lebrecht_4_4").axes
    texts = [[text.get_text() for text in axes.texts] for axes in (falling, constant)]
    assert "driven outlet +2 W" in texts[0] and "driven outlet −0.01 W" in texts[1]
    assert "elements and belt:\nsilent" in texts[1]
    assert "other flanks +0 W\npush, tension +0 W\ndampers, rings −1 W" in texts[0]


def test_a_spectrum_has_a_line_for_each_strand_and_names_modes():
    peaks = stated.lebrecht_3_11().results
    bins = np.arange(0.0, 1510.0, 10.0)
    amplitude = np.where(np.isin(bins, (520.0, 640.0)), 1e-5, 1e-8) * np.ones((2, 1))
    run = peaks.assign(spectrum=(("strand", "frequency_bin"), amplitude)).assign_coords(frequency_bin=bins)
    figure = spectrum_figure(run)
    (axes,) = figure.axes
    assert [line.get_ydata().max() for line in axes.lines] == pytest.approx([10.0, 10.0])
    assert [text.get_text() for text in axes.texts] == ["mode 2", "mode 3"] * 2
    assert labels_of(figure) == ["strand t1", "strand t2", "500 to 700 Hz"]


def test_push_is_divided_between_rocking_edges_and_heads():
    whole, edges, heads = (
        [line.get_ydata() for line in axes.lines[:2]] for axes in drawn("spatial_push_force").axes
    )
    assert np.add(edges, np.multiply(1e-3, heads)) == pytest.approx(np.array(whole))  # kN and N
    assert np.max(heads) == 60.0


def test_a_serpentine_drive_has_its_spans_an_arm_and_all_speeds_over_time():
    spans, arm, speeds = drawn("serpentine").axes
    assert [len(axes.lines) for axes in (spans, arm, speeds)] == [2, 1, 2]
    assert arm.get_ylabel() == "arm [°]" and arm.lines[0].get_ydata().max() == pytest.approx(1.3, rel=1e-3)


def test_losses_of_contacts_stand_over_the_clamping_force():
    (axes,) = drawn("clamping").axes
    labels = [line.get_label() for line in axes.lines]
    assert labels == [
        *("flank loss driving", "flank loss driven"),
        *(f"{of} loss" for of in ("ring", "tilt", "element", "belt")),
    ]
    assert axes.lines[2].get_ydata() == pytest.approx([55.0, 100.0, 170.0])


@pytest.mark.parametrize(
    "name",
    [
        "push_force",
        "belt_drive",
        "belt_drive_tension",
        "belt_drive_spectra",
        "belt_drive_friction",
        "misalignment",
    ],
)
def test_figures_by_other_pictures_are_drawn(name):
    assert all(axes.lines or axes.collections for axes in drawn(name).axes if axes.get_visible())
