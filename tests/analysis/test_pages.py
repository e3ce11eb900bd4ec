"""No picture is larger than a page, however much it shows: panels get lower, then columns, then it is refused."""

from functools import cache

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.arrangement import Sides
from cvt_hpc.analysis.comparison import compare
from cvt_hpc.analysis.comparison_drawing import draw_comparison
from cvt_hpc.analysis.figures import LONG, NARROW
from cvt_hpc.analysis.hysteresis_bands import hysteresis_figure
from cvt_hpc.analysis.maps import LEAST, map_figure
from cvt_hpc.analysis.on_variator import variator_figure
from cvt_hpc.analysis.profiles import profile_figure
from cvt_hpc.analysis.ramps import ramp_figure, spectrogram_figure
from cvt_hpc.analysis.value_maps import value_map_figure
from cvt_hpc.analysis.waterfall import waterfall_figure
from cvt_hpc.errors import InputError
from support import pictured
from support.studies import sampled, study

MARGIN = 0.01  # [inch]


def stiffnesses(count):
    return study(stiffnesses=tuple(np.linspace(1.0, 3.0, count)))


@cache
def map_of(count):
    return map_figure(stiffnesses(count))


def ratios(count):
    """The study over speed, load and ratio at so many ratios."""
    one = pictured.results().isel(ratio=[0], driving_speed=slice(3))
    return xr.concat([one.assign_coords(ratio=("ratio", [1.0 + 0.1 * k])) for k in range(count)], "ratio")


def ratios_of_ramps(count):
    one = pictured.ramps()
    return xr.concat([one] * count, xr.Variable("ratio", 1.0 + 0.1 * np.arange(count)))


def along_belt(count):
    """A run with so many quantities along the belt, and their names."""
    run, names = pictured.history(duration=0.1), [f"force_{k}" for k in range(count)]
    return run.assign({name: run["push_force"] for name in names}), names


WATERFALL = Sides(panel="ratio")
# by kind: the picture of so many panels, how many are still drawn, how many are not, and what the refusal says
KINDS = {
    "map": (map_of, 60, 61, "--at sheave_stiffness=VALUE.*--panel AXIS"),
    "value map": (
        lambda n: value_map_figure(ratios(n), ["efficiency"], sides=Sides(panel="ratio")),
        15,
        16,
        "--at ratio=VALUE.*--panel AXIS",
    ),
    "waterfall": (
        lambda n: waterfall_figure(ratios(n), sides=WATERFALL),
        14,
        15,
        "--at ratio=VALUE.*--panel",
    ),
    "hysteresis": (
        lambda n: hysteresis_figure(ratios_of_ramps(n), sides=Sides(panel="ratio")),
        18,
        19,
        "--at ratio=VALUE.*--panel AXIS",
    ),
    "variator": (lambda n: variator_figure(*along_belt(n)), 12, 13, "name fewer quantities"),
    "profile": (
        lambda n: profile_figure([along_belt(n)[0]], along_belt(n)[1]),
        9,
        10,
        "name fewer quantities by `--of`",
    ),
    "spectrogram": (
        lambda n: spectrogram_figure([pictured.history(duration=0.1)] * n),
        12,
        13,
        "name fewer histories",
    ),
    "ramp": (
        lambda n: ramp_figure([pictured.history(ramped="load", duration=0.1)] * n),
        8,
        9,
        "name fewer histories",
    ),
}


DRAWN = ("map", "spectrogram", "variator", "profile")  # others are arranged as one of these


def assert_on_a_page(figure):
    size = sorted(figure.get_size_inches())
    assert size[0] <= NARROW + MARGIN and size[1] <= LONG + MARGIN, size


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_page_holds_is_drawn_with_texts_apart_and_more_is_refused(kind, monkeypatch):
    compose, most, more, advice = KINDS[kind]
    if kind in DRAWN:
        figure = compose(most)
        assert_on_a_page(figure)
        assert pictured.faults_of(figure, monkeypatch) == []
    with pytest.raises(
        InputError, match=f"at most {most} panels, which one page holds, found {more}; .*{advice}"
    ):
        compose(more)


def test_a_map_of_many_panels_gives_its_frequencies_up_before_it_is_refused():
    few, many = map_of(6), map_of(60)
    bars = [[ax.get_ylabel() for ax in one.axes if ax.get_label() == "<colorbar>"] for one in (few, many)]
    assert bars == [["amplitude [µm]", "frequency [Hz]"], ["amplitude [µm]"]]
    assert many.get_size_inches()[1] > 7 * LEAST  # of seven rows


@pytest.mark.parametrize("dataset", [stiffnesses(30), sampled()])
def test_a_comparison_is_a_page(dataset, tmp_path, monkeypatch):
    drawn = []
    keep = lambda figure, out: drawn.append(figure) or out  # noqa: E731
    monkeypatch.setattr("cvt_hpc.analysis.figures.save_figure", keep)
    draw_comparison(compare(dataset, dataset), tmp_path / "x.png", ("A", "B"))
    assert_on_a_page(drawn[0])
