"""The layout of maps of made-up studies: what runs along which axis, and what is said of the rest."""

import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.arrangement import arrange, ruler, value_text, with_spacings
from cvt_hpc.analysis.classes import OccurrenceClass, occurrence_classes
from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.errors import InputError
from cvt_hpc.variables import Status
from support.studies import study


def test_load_runs_along_x_gradient_along_y_and_stiffness_over_panels():
    chosen = arrange(study().transpose("load", "sheave_stiffness", ...), {}, "out/x")
    assert (chosen.x, chosen.y, chosen.panel, chosen.notes) == (
        "load",
        "friction_gradient",
        "sheave_stiffness",
        (),
    )


def with_axes(**axes):
    names = tuple(axes)
    shape = tuple(len(values) for values in axes.values())
    status = np.full(shape, Status.DONE, np.int8)
    return xr.Dataset(
        {"status": (names, status), "vibrates": (names, np.zeros(shape, np.int8))},
        {name: np.array(values) for name, values in axes.items()},
    )


@pytest.mark.parametrize(
    ("axes", "at", "expected"),
    [
        (("load",), {}, ("load", None, None)),
        (("sheave_stiffness",), {}, ("sheave_stiffness", None, None)),
        (("load", "sheave_stiffness"), {}, ("load", "sheave_stiffness", None)),
        (("ratio", "thrust"), {}, ("thrust", "ratio", None)),
        (("ratio", "load", "sheave_stiffness"), {}, ("load", "ratio", "sheave_stiffness")),
        (("sheave_stiffness", "load", "ratio"), {}, ("load", "ratio", "sheave_stiffness")),
        (("load_share", "ratio"), {}, ("load_share", "ratio", None)),
        (("friction_gradient", "load", "thrust"), {}, ("load", "friction_gradient", "thrust")),
        (
            ("friction_gradient", "sheave_stiffness", "load"),
            {"load": 2.0},
            ("sheave_stiffness", "friction_gradient", None),
        ),
        (
            ("friction_gradient", "sheave_stiffness", "load"),
            {"sheave_stiffness": "2"},
            ("load", "friction_gradient", None),
        ),
    ],
)
def test_other_axes_are_laid_out_sensibly(axes, at, expected):
    chosen = arrange(with_axes(**{name: [1.0, 2.0] for name in axes}), at, "out/x")
    assert (chosen.x, chosen.y, chosen.panel) == expected
    assert set(chosen.dataset["status"].dims) == {name for name in expected if name}


def test_texts_are_no_x_axis_where_there_are_numbers():
    dataset = with_axes(load_history=["constant", "ramp"], ratio=[1.0, 2.0])
    assert (arrange(dataset, {}, "out/x").x, arrange(dataset, {}, "r").y) == ("ratio", "load_history")
    assert arrange(dataset, {"ratio": 1.0}, "out/x").x == "load_history"
    assert arrange(dataset, {"load_history": "ramp"}, "out/x").notes == ("load history = ramp",)
    flags_as_axis = with_axes(refined=[False, True], ratio=[1.0, 2.0])
    assert arrange(flags_as_axis, {"refined": True}, "out/x").notes == ("refined = True",)


def test_what_is_fixed_is_said():
    dataset = with_axes(
        ratio=[2.5, 1.0], thrust=[2e4, 3e4], friction_gradient=[-1.0], sheave_stiffness=[1.0], load=[5.0]
    )
    dataset["thrust"].attrs["units"] = "N"
    dataset["status"][0, 1] = Status.TIMED_OUT
    chosen = arrange(dataset, {"thrust": 3e4}, "out/x")
    assert chosen.notes == ("thrust = 30 kN", "ratio = 2.5 (first of 2)")
    assert chosen.dataset["status"].values.tolist() == [[[Status.TIMED_OUT]]]


def test_panels_and_rows_are_sorted_with_their_values():
    turned = study(gradients=(-0.8, -2.4), stiffnesses=(np.inf, 1.0), loads=(200.0, 120.0, 20.0))
    chosen = arrange(turned, {}, "out/x")
    assert chosen.dataset["sheave_stiffness"].values.tolist() == [1.0, np.inf]
    assert chosen.dataset["load"].values.tolist() == [20.0, 120.0, 200.0]
    classes = occurrence_classes(chosen.dataset)
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=1.0, load=120) == OccurrenceClass.VIBRATING


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ({"lod": 20.0}, "at lod: unknown axis of the results; did you mean load?"),
        ({"load": 21.0}, "at load: expected a value of that axis: 20, 40, .* \\[N m\\], found 21 N m"),
        ({"load": "much"}, 'found "much"'),
        (
            {"load": 20, "friction_gradient": -2.4, "sheave_stiffness": 1},
            "expected results over one axis or more to be drawn, found a single run",
        ),
    ],
)
def test_what_cannot_be_fixed_is_refused(at, message, tmp_path):
    out = tmp_path / "map.png"
    with pytest.raises(InputError, match=f"^out/x: .*{message}"):
        draw(lambda: map_figure(study(), at, "out/x"), out)
    assert not any(tmp_path.iterdir())


def test_of_many_values_the_error_names_a_few():
    dataset = with_axes(load=np.arange(1.0, 101.0), refined=[False, True])
    with pytest.raises(InputError, match=r"axis: 1, 2, .* 11, [.]{3}, 100, found 0.5"):
        arrange(dataset, {"load": 0.5}, "out/x")
    with pytest.raises(InputError, match='axis: False, True, found "maybe"'):
        arrange(dataset, {"refined": "maybe"}, "out/x")


@pytest.mark.parametrize(
    ("unit", "value", "shown"),
    [
        ("N m", 120.0, "120 N m"),
        ("s m-1", -2.4, "−2.4 s/m"),
        ("s/m", -2.4, "−2.4 s/m"),
        ("N", 5e4, "50 kN"),
        ("rad s-1", 100 * np.pi, "3000 rpm"),
        ("rad/s", 100 * np.pi, "3000 rpm"),
        ("m", 0.155, "155 mm"),
        ("s", 3e-4, "0.3 ms"),
        ("1", 1.5, "1.5"),
        ("N m rad-1", 4e5, "400000 N m/rad"),
        ("N s m-2", 5.0, "5 N s/m²"),
        ("s-1", 2.0, "2 1/s"),
    ],
)
def test_values_are_shown_in_units_for_people(unit, value, shown):
    assert value_text(coordinate("x", [value], unit), 0) == shown


@pytest.mark.parametrize(
    ("unit", "in_job", "value", "shown"),
    [
        ("N", "N", 5e4, "50000 N"),
        ("m/s", "mm/s", 0.015, "15 mm/s"),
        ("N m", "kN m", 120.0, "0.12 kN m"),
        ("N", "rpm", 5e4, "50000 N"),  # of a file that somebody has made up
        ("1", "%", 0.25, "25 %"),
    ],
)
def test_what_the_job_gives_in_a_unit_is_shown_in_it(unit, in_job, value, shown):
    assert value_text(coordinate("x", [value], unit, in_job), 0) == shown
    number, _, shown_in = shown.partition(" ")
    drawn = ruler(coordinate("x", [value], unit, in_job))
    assert (drawn.centres.tolist(), drawn.label) == ([pytest.approx(float(number))], f"x [{shown_in}]")


def test_an_axis_is_fixed_and_refused_in_the_unit_of_the_job():
    dataset = with_axes(driving_speed=[100 * np.pi, 200 * np.pi], load=[20.0, 40.0])
    dataset["driving_speed"].attrs = {"units": "rad/s", "job_units": "rpm"}
    assert arrange(dataset, {"driving_speed": 100 * np.pi}, "x").notes == ("driving speed = 3000 rpm",)
    message = r"of that axis: 3000, 6000 \[rpm\], found 28647\.88976 rpm \(3000 rad/s\)$"
    with pytest.raises(InputError, match=message):
        arrange(dataset, {"driving_speed": 3000.0}, "x")


def test_a_value_is_found_by_number_or_text():
    third = 0.1 + 0.2  # not 0.3, as results of arithmetic are
    dataset = with_axes(load=[1.0, 2.0], ratio=[0.1, third], sheave_stiffness=[1.0, np.inf])
    dataset["status"][:, 1, 1] = Status.TIMED_OUT
    for ratio, stiffness in ((0.3, np.inf), ("0.3", "inf")):
        chosen = arrange(dataset, {"ratio": ratio, "sheave_stiffness": stiffness}, "out/x")
        assert (chosen.dataset["status"] == Status.TIMED_OUT).all()
        assert "sheave stiffness = rigid" in chosen.notes


def coordinate(name, values, units="1", in_job=None):
    told = {"units": units} | ({"job_units": in_job} if in_job else {})
    return xr.DataArray(np.array(values), dims=name, name=name, attrs=told)


def test_cells_reach_halfway_to_their_neighbours():
    uneven = ruler(coordinate("load", [10.0, 20.0, 50.0], "N m"))
    assert uneven.centres.tolist() == [10, 20, 50]
    assert uneven.edges.tolist() == [5, 15, 35, 65]
    assert uneven.label == "load [N m]"
    assert ruler(coordinate("thrust", [2e4, 3e4], "N")).edges == pytest.approx([15, 25, 35])
    (low, high) = ruler(coordinate("load", [40.0], "N m")).edges
    assert low < 40 < high and low + high == pytest.approx(80)
    assert np.ptp(ruler(coordinate("load", [0.0], "N m")).edges) > 0


def test_rigid_sheaves_lie_behind_the_stiffest_ones():
    placed = ruler(coordinate("sheave_stiffness", [1.0, 1.5, 2.0, np.inf]))
    assert placed.centres.tolist() == [1, 1.5, 2, 2.5]
    assert placed.tick_labels == ("1", "1.5", "2", "rigid")
    assert np.isfinite(ruler(coordinate("sheave_stiffness", [np.inf])).edges).all()
    texts = ruler(coordinate("load_history", ["constant", "ramp"], ""))
    assert texts.tick_labels == ("constant", "ramp") and texts.centres.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("values", "is_log"),
    [
        ([1.0, 10.0, 100.0], True),
        ([1.0, 3.0, 10.0, 30.0], True),
        (np.geomspace(100.0, 1e4, 7), True),
        ([10.0, 20.0, 50.0], False),
        ([10.0, 20.0, 30.0, 40.0], False),
        ([1.0, 1.2, 1.44, 1.728], False),  # as good as even
        ([0.0, 1.0, 10.0, 100.0], False),
    ],
)
def test_geometric_values_lie_on_a_logarithmic_axis(values, is_log):
    laid = ruler(coordinate("damping", list(values), "1"))
    np.testing.assert_allclose(laid.centres, np.log10(values) if is_log else values)
    middles = np.sqrt(np.multiply(values[1:], values[:-1])) if is_log else np.add(values[1:], values[:-1]) / 2
    np.testing.assert_allclose(laid.edges[1:-1], np.log10(middles) if is_log else middles)


def test_a_logarithmic_axis_has_ticks_at_round_values():
    laid = ruler(coordinate("damping", list(np.geomspace(100.0, 1e4, 7)), "1"))
    assert laid.tick_labels == ("100", "200", "500", "1000", "2000", "5000", "10000")
    np.testing.assert_allclose(10.0**laid.ticks, [100, 200, 500, 1000, 2000, 5000, 10000])
    wide = ruler(coordinate("damping", list(np.geomspace(1.0, 1e6, 7)), "1"))
    assert wide.tick_labels == ("1", "10", "100", "1000", "10000", "100000", "1e+06")
    rigid = ruler(coordinate("sheave_stiffness", [1.0, 10.0, 100.0, np.inf], "1"))
    np.testing.assert_allclose(rigid.centres, [0.0, 1.0, 2.0, 3.0])
    assert rigid.tick_labels == ("1", "10", "100", "rigid")


def test_negative_geometric_values_are_mirrored():
    values = [-10.0, -3.0, -1.0, -0.3, -0.1]
    laid = ruler(coordinate("friction_gradient", values, "s/m"))
    np.testing.assert_allclose(laid.centres, [-1.0, -np.log10(3.0), 0.0, -np.log10(0.3), 1.0])
    widths = np.diff(laid.edges)
    assert (widths > 0.0).all() and widths.max() < 1.2 * widths.min()  # no slivers
    assert laid.tick_labels == ("−10", "−3", "−1", "−0.3", "−0.1")
    many = ruler(coordinate("friction_gradient", list(-np.geomspace(1e3, 1e-1, 9)), "s/m"))
    assert many.tick_labels == ("−1000", "−100", "−10", "−1", "−0.1")
    np.testing.assert_allclose(many.ticks, [-3.0, -2.0, -1.0, 0.0, 1.0], atol=1e-12)


def test_an_axis_is_logarithmic_or_linear_as_told():
    dataset = with_axes(load=[10.0, 20.0, 30.0, 40.0], ratio=[1.0, 10.0, 100.0], mass=[0.0, 1.0])
    told = with_spacings(dataset, {"load": "log", "ratio": "linear"}, "x")
    np.testing.assert_allclose(ruler(told["load"]).centres, np.log10([10.0, 20.0, 30.0, 40.0]))
    assert ruler(told["ratio"]).centres.tolist() == [1.0, 10.0, 100.0]
    assert "spacing" not in dataset["load"].attrs
    for spacings, found in (
        ({"loads": "log"}, "spacing of loads: unknown axis of the results; did you mean load?"),
        ({"load": "even"}, 'spacing of load: expected log or linear, found "even"'),
        ({"mass": "log"}, "spacing of mass: expected numbers of one sign on a logarithmic axis, found 0, 1"),
    ):
        with pytest.raises(InputError, match=f"^x: {re.escape(found)}"):
            with_spacings(dataset, spacings, "x")


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([100.0, 200.0, 300.0], ("955", "1910", "2865")),  # of rad/s, in rpm
        ([131.0, 132.0], ("1251", "1260.5")),
    ],
)
def test_numbers_on_an_axis_have_the_decimals_that_tell_them_apart(values, texts):
    assert ruler(coordinate("driving_speed", values, "rad/s")).tick_labels == texts


def test_ticks_whose_labels_would_touch_are_left_out_alike():
    panel = Figure((6.0, 1.0)).add_axes((0.0, 0.0, 1.0, 1.0))
    laid = ruler(coordinate("load", list(np.linspace(1000.0, 12000.0, 12)), "N m"))
    panel.set_xlim(laid.edges[[0, -1]])
    laid.lay_out(panel.xaxis)
    assert panel.get_xticks().tolist() == laid.centres.tolist()
    narrow = Figure((1.5, 1.0)).add_axes((0.0, 0.0, 1.0, 1.0))
    narrow.set_xlim(laid.edges[[0, -1]])
    laid.lay_out(narrow.xaxis)
    kept = narrow.get_xticks()
    assert kept.size > 1 and len(set(np.diff(kept))) == 1 and np.diff(kept)[0] > 1000.0
