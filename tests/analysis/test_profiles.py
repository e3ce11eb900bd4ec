"""Quantities along the belt and strands' forces as pictures, and what papers say of them as checks."""

import json

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.paper_pictures import strand_bars_figure
from cvt_hpc.analysis.profiles import profile_figure
from cvt_hpc.errors import InputError
from cvt_hpc.papers import bullinger_along
from cvt_hpc.papers.verdicts import Kept, Verdict, judged

NAMES = np.repeat(["driving arc", "t1", "driven arc", "t2"], [10, 3, 10, 3])
AXES = json.dumps({"name": "two", "model": "pushbelt", "axes": {"load": [8, 16]}})


def belt(load, front=3, **values):
    """A belt whose elements press from a station of the driving arc on, up to the driven arc's exit."""
    angle = np.full(NAMES.size, np.nan)
    angle[:11] = angle[13:24] = np.linspace(0.0, 3.0, 11)
    push = np.zeros(NAMES.size)
    push[front:13] = np.minimum(100.0 * load * np.arange(1, 14 - front), 700.0 * load)
    push[13:24] = 700.0 * load * np.linspace(1.0, 0.0, 11)
    held = {"push_force": ("position", push, {"units": "N", "long_name": "push force"})}
    held["friction_force"] = ("position", 2e3 * np.sign(angle), {"units": "N m-1"})
    held["wrap_angle"] = ("position", angle, {"units": "rad"})
    places = {"position": 0.01 * np.arange(NAMES.size), "region": ("position", NAMES)}
    point = json.dumps({"load": load, "load_share": load / 20.0})
    return xr.Dataset(held, places, {"job": AXES, "point": point, "job_name": "two", **values})


@pytest.fixture
def runs(monkeypatch):
    place = "cvt_hpc.analysis.telling_apart.values_of"
    monkeypatch.setattr(
        place, lambda attributes: {"load": f"{json.loads(attributes['point'])['load']:g} N m"}
    )
    return [belt(8.0), belt(16.0, front=5)]


def test_quantities_are_drawn_over_the_path_of_all_runs(runs):
    figure = profile_figure(runs, ("push_force", "friction_force"))
    push, friction = figure.axes
    assert push.get_ylabel() == "push force\n[kN]" and friction.get_ylabel() == "friction force\n[kN/m]"
    assert friction.get_xlabel() == "position along the path [mm]"
    x, y = push.lines[1].get_data()
    np.testing.assert_allclose(x, 10.0 * np.arange(NAMES.size))
    np.testing.assert_allclose(y, 1e-3 * runs[1]["push_force"].values)
    assert [text.get_text() for text in push.texts] == ["driving", "t1", "driven", "t2"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["load 8 N m", "load 16 N m"]


def test_over_a_wrap_the_contact_beyond_its_ends_is_drawn(runs):
    run = runs[0]
    # a station on each side of both arcs lies in its groove; that before the driving inlet is the path's last
    angle = run["wrap_angle"].values
    angle[[25, 11, 12, 24]] = [-0.1, 3.2, -0.1, 3.2]
    for pulley, first in (("driving", 25), ("driven", 12)):
        shown, push = profile_figure([run], ("push_force",), pulley).axes[0].lines[0].get_data()
        np.testing.assert_allclose(shown, np.degrees([-0.1, *np.linspace(0.0, 3.0, 11), 3.2]))
        np.testing.assert_allclose(push, 1e-3 * np.roll(run["push_force"].values, -first)[:13])


def test_over_a_wrap_its_own_stations_are_drawn_with_both_ends(runs):
    figure = profile_figure(runs[:1], ("push_force",), "driven")
    angle, push = figure.axes[0].lines[0].get_data()
    np.testing.assert_allclose(angle, np.degrees(np.linspace(0.0, 3.0, 11)))
    np.testing.assert_allclose(push, 1e-3 * runs[0]["push_force"].values[13:24])


def test_an_axis_has_a_column_for_each_value(runs):
    figure = profile_figure(runs, ("push_force",), columns="load")
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["load 8 N m", "load 16 N m"]
    assert all(len(axes.lines) == 2 for axes in figure.axes)  # with the line of zero


def test_one_quantity_has_its_panels_row_by_row_and_models_are_told_apart(runs):
    each = [belt(load) for load in (2, 4, 6, 8)]
    other = belt(2)
    other.attrs["job"] = json.dumps({"model": "spatial_pushbelt", "axes": {"load": [2]}})
    figure = profile_figure([*each, other], ("push_force",), columns="load")
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title(loc="left") for axes in shown] == [f"load {load} N m" for load in (2, 4, 6, 8)]
    assert [len(axes.lines) for axes in shown] == [3, 2, 2, 2]  # with the line of zero
    assert [bool(axes.get_xlabel()) for axes in shown] == [False, True, True, True]
    assert shown[-1].get_ylabel() == "push force\n[kN]"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["pushbelt", "spatial pushbelt"]


def test_small_angles_are_shown_in_mrad_alike_for_all_runs(runs):
    small, large = belt(8), belt(16)
    for dataset, size in ((small, 5e-3), (large, 0.2)):
        dataset["yaw"] = ("position", np.full(NAMES.size, size), {"units": "rad"})
    (axes,) = profile_figure([small, large], ("yaw",)).axes
    assert axes.get_ylabel() == "yaw\n[mrad]"
    np.testing.assert_allclose([line.get_ydata()[0] for line in axes.lines], [5.0, 200.0, 0.0])
    (axes,) = profile_figure([large], ("yaw",)).axes
    assert axes.get_ylabel() == "yaw\n[°]"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (
            {"quantities": ("push",)},
            "history 1: push: unknown quantity along the belt",
        ),
        ({"region": "t3"}, "history 1: --region: expected a pulley of the belt's path, found t3; it has"),
        ({"columns": "ratio"}, "--columns: expected an axis in which the runs differ (load), found ratio"),
    ],
)
def test_what_is_not_there_is_refused(runs, asked, message):
    with pytest.raises(InputError) as error:
        profile_figure(runs, **{"quantities": ("push_force",)} | asked)
    assert message in str(error.value)


def test_bars_show_tension_above_and_push_below_zero():
    forces = {
        name: (("ratio", "load", "strand"), values * np.ones((2, 3, 2)), {"units": "N"})
        for name, values in (("mean_ring_tension", 5e3), ("mean_push_force", 2e3))
    }
    states = {name: (("ratio", "load"), np.ones((2, 3), np.int8)) for name in ("status", "vibrates")}
    axes = {
        "ratio": [0.5, 2.0],
        "load": ("load", [0.0, 20.0, 40.0], {"units": "N m"}),
        "strand": ["t1", "t2"],
    }
    figure = strand_bars_figure(xr.Dataset(forces | states, axes, {"job_name": "two"}))
    assert len(figure.axes) == 2
    heights = sorted({bar.get_height() for bar in figure.axes[0].patches})
    assert heights == pytest.approx([-2.0, 5.0])


def test_checks_tell_a_belt_that_does_from_one_that_does_not():
    shares = bullinger_along.ALL_RATIOS
    later = [belt(20.0 * share, front) for share, front in zip(shares, (2, 4, 6), strict=True)]
    sooner = [belt(20.0 * share, front) for share, front in zip(shares, (6, 4, 2), strict=True)]
    entered, appears = bullinger_along.FIGURE_20[0], bullinger_along.FIGURE_20[2]
    assert judged(entered, Kept(xr.Dataset(), later)).verdict is Verdict.REPRODUCED
    assert judged(appears, Kept(xr.Dataset(), later)).verdict is Verdict.REPRODUCED
    assert judged(appears, Kept(xr.Dataset(), sooner)).verdict is Verdict.NOT
    pressed = [history.assign(push_force=history["push_force"] + 50.0) for history in later]
    assert judged(entered, Kept(xr.Dataset(), pressed)).verdict is Verdict.NOT
