"""The picture of a ladder: every answer at its error and its cost."""

from types import SimpleNamespace

import matplotlib
import pytest

from cvt_hpc.analysis.figures import STYLE
from cvt_hpc.experiments.ladder.comparing import Finding, Score
from cvt_hpc.experiments.ladder.making import ladder_figure, ladder_lines, write_ladder

FINDINGS = [
    Finding("occurrence", "cheap", Score(10, wrong=0.3, undecided=0.2), 0.01),
    Finding("occurrence", "dear", Score(10, wrong=0.0, undecided=0.0), 1.0),
    Finding("occurrence", "reference", Score(10, wrong=0.1), 2.0),
    Finding("onset", "dear", Score(4, 5.0, 10.0, undecided=0.0), 1.0),
    Finding("onset", "reference", Score(4, 5.0), 2.0),
    Finding("frequency", "cheap", Score(0, undecided=1.0), 0.01),
    Finding("frequency", "reference", Score(0), 2.0),
    Finding("amplitude", "dear", Score(5, 0.0, 0.05, undecided=0.0), 1.0),
    Finding("amplitude", "reference", Score(5, 0.0), 2.0),
    Finding("forces", "cheap", Score(10, 0.01, 0.02, undecided=0.0), 0.01),
    Finding("forces", "reference", Score(10, 0.002), 2.0),
]


@pytest.fixture(scope="module")
def panels():
    with matplotlib.rc_context(STYLE):
        return ladder_figure(SimpleNamespace(name="x", units={}), FINDINGS).axes


def drawn(axes, gid):
    return [tuple(zip(*line.get_data(), strict=True)) for line in axes.lines if line.get_gid() == gid]


def test_answers_stand_at_their_error_and_their_cost(panels):
    assert drawn(panels[0], "cheap") == [((30.0, 0.01),)] and drawn(panels[0], "dear") == [((0.0, 1.0),)]
    assert drawn(panels[0], "span")[0] == ((30.0, 0.01), (50.0, 0.01))  # with what is undecided
    assert drawn(panels[0], "reference") == [((10.0, 2.0),)]
    assert drawn(panels[1], "dear") == [((5.0, 1.0),)] and drawn(panels[1], "cheap") == []
    assert drawn(panels[1], "span")[0] == ((5.0, 1.0), (10.0, 1.0))
    assert drawn(panels[4], "cheap") == [((1.0, 0.01),)]


def test_errors_of_zero_are_seen(panels):
    left, _ = panels[0].get_xlim()
    assert panels[0].get_xscale() == "linear" and left < 0.0
    ((error, _),) = drawn(panels[3], "dear")[0]
    assert panels[3].get_xscale() == "log" and error == panels[3].get_xlim()[0]


def test_a_rung_that_costs_less_than_the_clock_tells_is_seen():
    free = Finding("forces", "free", Score(10, 0.1, 0.2, undecided=0.0), 0.0)
    with matplotlib.rc_context(STYLE):
        panel = ladder_figure(SimpleNamespace(name="x", units={}), [*FINDINGS, free]).axes[4]
    ((_, cost),) = drawn(panel, "free")[0]
    low, high = panel.get_ylim()
    assert 0.0 < low < cost < 0.01 and high > 2.0


def test_the_reference_is_hatched_as_far_as_it_is_not_known(panels):
    ends = [[p.get_x() + p.get_width() for p in axes.patches if p.get_gid() == "hatched"] for axes in panels]
    assert ends[0] == [pytest.approx(10.0)] and ends[1] == [5.0] and ends[4] == [pytest.approx(0.2)]
    assert ends[2] == ends[3] == []


def test_every_rung_is_in_the_legend_once(panels):
    texts = [text.get_text() for text in panels[-1].get_legend().get_texts()]
    assert texts[:3] == ["cheap", "dear", "reference"] and len(texts) == 5


def test_errors_of_onsets_are_in_the_unit_of_the_job(panels, tmp_path):
    job = SimpleNamespace(name="x", units={"load": "kN m"})
    with matplotlib.rc_context(STYLE):
        onset = ladder_figure(job, FINDINGS).axes[1]
    assert drawn(onset, "span")[0] == ((0.005, 1.0), (0.01, 1.0))
    assert [axes.get_xlabel() for axes in (onset, panels[1])] == [
        "error of the load [kN m]", "error of the load [N m]",
    ]  # fmt: skip
    lines = list(ladder_lines(job, FINDINGS))
    at = lines.index("onset: error [kN m]; that of the reference is estimated")
    assert lines[at + 2].split()[:4] == ["dear", "4", "0.005", "0.01"]
    write_ladder(job, FINDINGS, {}, tmp_path / "ladder.csv")
    assert "\nonset,dear,kN m,4,0.005,0.01," in (tmp_path / "ladder.csv").read_text()
