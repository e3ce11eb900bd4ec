"""Pictures of eigenfrequencies over load: which lines are where."""

import matplotlib
import numpy as np
import pytest

from cvt_hpc.analysis.eigenfrequencies import eigenfrequency_figure
from cvt_hpc.analysis.figures import STYLE, draw, save_figure
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.study import open_results, run
from support.rungs import rung_job

LOADS = [200.0, 0.0, 100.0]
SPEEDS = [300.0, 2000.0]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    axes = {"driving_speed": SPEEDS, "load": LOADS}
    job = rung_job("strand", axes, ritz_functions=8)
    with open_results(run(job, tmp_path_factory.mktemp("strand"), progress=False).results) as dataset:
        yield dataset.load()


def drawn(dataset, at):
    with matplotlib.rc_context(STYLE):
        return eigenfrequency_figure(dataset, at, "results")


def test_lines_are_those_of_the_dataset(results):
    figure = drawn(results, {})
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["strand t1", "strand t2"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["load [N m]"] * 2
    for strand, axes in zip(("t1", "t2"), figure.axes, strict=True):
        assert [text.get_text() for text in axes.texts] == ["1", "2", "3", "4", "5"]
        for number, line in enumerate(axes.lines, start=1):
            x, y = line.get_data()
            assert x.tolist() == sorted(LOADS)
            wanted = results["eigenfrequency"].sel(strand=strand, half_waves=number, driving_speed=300.0)
            assert np.array_equal(y, wanted.sel(load=x))
    title = figure.get_suptitle()
    assert title.startswith("Eigenfrequencies: test\n") and "(first of 2)" in title


def test_an_axis_can_be_fixed_and_a_strand_without_shape_leaves_a_gap(results):
    gone = results.copy()
    gone["eigenfrequency"] = results["eigenfrequency"].where(
        (results["strand"] == "t2") | (results["driving_speed"] < 1000.0)
    )
    figure = drawn(gone, {"driving_speed": 2000.0})
    first, second = ([np.isfinite(line.get_ydata()).all() for line in axes.lines] for axes in figure.axes)
    assert (any(first), all(second)) == (False, True)


def test_the_map_of_strands_is_that_picture(results, tmp_path):
    at = {"driving_speed": 2000.0}
    with matplotlib.rc_context(STYLE):
        save_figure(eigenfrequency_figure(results, at, "results"), tmp_path / "wanted.png")
    draw(lambda: map_figure(results, at), tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes() == (tmp_path / "wanted.png").read_bytes()
