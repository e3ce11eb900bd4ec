"""The picture of a forecast shows the numbers of the forecast, with what they are at the axes."""

import numpy as np
import pytest

from cvt_hpc.analysis.efficiency import draw_efficiency, efficiency_figure
from cvt_hpc.errors import InputError
from cvt_hpc.study.forecast.cost_model import Forecast

FORECASTS = [
    Forecast(1, 10, (100.0, 90.0, 120.0), 100.0, (1.0, 0.99, 1.0)),
    Forecast(10_000, 10, (12.0, 9.0, 15.0), 11.0, (0.4, 0.3, 0.5)),
]


def test_both_panels_show_median_interval_and_bound_over_ranks():
    figure = efficiency_figure(FORECASTS, "a job: 10 runs", "records")
    assert figure.get_suptitle() == "a job: 10 runs\nforecast by records"
    upper, lower = figure.axes
    assert (upper.get_ylabel(), lower.get_ylabel(), lower.get_xlabel()) == (
        "parallel efficiency",
        "makespan [s]",
        "ranks",
    )
    assert (lower.get_xscale(), lower.get_yscale(), upper.get_yscale()) == ("log", "log", "linear")
    for axes, medians, ends in ((upper, [1.0, 0.4], [0.3, 0.5]), (lower, [100, 12], [9, 15])):
        assert axes.lines[0].get_xydata().tolist() == [[1, medians[0]], [10_000, medians[1]]]
        corners = axes.collections[0].get_paths()[0].vertices
        assert sorted(set(corners[corners[:, 0] == 10_000, 1])) == ends
    assert np.array_equal(lower.lines[1].get_ydata(), [100.0, 11.0])
    assert lower.get_legend_handles_labels()[1][-1].startswith("bound")


def test_another_suffix_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a picture"):
        draw_efficiency(FORECASTS, "a job", "records", tmp_path / "x.gif")
    assert list(tmp_path.iterdir()) == []
