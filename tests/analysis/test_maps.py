"""Maps of made-up studies: the classes value by value, the layout, and what the picture shows where."""

import subprocess
import sys

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image
from studies import GRADIENTS, LOADS, STIFFNESSES, flags, study

from cvt_hpc.analysis.arrangement import arrange, ruler, value_text
from cvt_hpc.analysis.cells import AMPLITUDE_COLOURS, FREQUENCY_COLOURS, STYLES
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, occurrence_classes
from cvt_hpc.analysis.figures import STYLE
from cvt_hpc.analysis.maps import draw_map, map_figure
from cvt_hpc.errors import InputError
from cvt_hpc.variables import Status, Vibrates

LIMIT = 300_000  # bytes that a picture may have
FINE = {"gradients": np.linspace(-2.4, -0.4, 6), "loads": np.linspace(5, 200, 40)}
QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN = OccurrenceClass


def figure_of(dataset, at=()):
    with matplotlib.rc_context(STYLE):
        return map_figure(arrange(dataset, dict(at)))


def panels_of(figure):
    """The axes that hold cells."""
    return [axes for axes in figure.axes if axes.axison and axes.get_label() != "<colorbar>"]


def bars_of(figure):
    return [axes.get_ylabel() for axes in figure.axes if axes.get_label() == "<colorbar>"]


# Classes


def two_flags(status, vibrates):
    dims = ("load",)
    return xr.Dataset(
        {"status": (dims, status), "vibrates": (dims, vibrates)}, {"load": np.arange(float(len(status)))}
    )


CLASS_TABLE = [
    (Status.NOT_RUN, {v: NOT_RUN for v in Vibrates}),
    (Status.DONE, {Vibrates.NO: QUIET, Vibrates.YES: VIBRATING, Vibrates.UNDECIDED: UNDECIDED, 7: UNDECIDED}),
    (Status.FAILED_NUMERICS, {v: FAILED for v in Vibrates}),
    (Status.FAILED_ERROR, {v: FAILED for v in Vibrates}),
    (Status.TIMED_OUT, {v: FAILED for v in Vibrates}),
    (9, {v: FAILED for v in Vibrates}),
    (-1, {v: FAILED for v in Vibrates}),
    (np.nan, {v: NOT_RUN for v in Vibrates}),
]


@pytest.mark.parametrize(("status", "expected"), CLASS_TABLE)
def test_class_of_every_pair_of_flags(status, expected):
    found = occurrence_classes(two_flags([status] * len(expected), [int(v) for v in expected]))
    assert found.dims == ("load",)
    assert [OccurrenceClass(c) for c in found.values] == list(expected.values())


def test_every_status_and_verdict_is_in_the_table():
    told = {status: set(expected) for status, expected in CLASS_TABLE}
    assert all(set(Vibrates) <= told[status] for status in Status)


def test_classes_of_a_study_follow_its_flags_in_any_order_of_dimensions():
    dataset = study()
    classes = occurrence_classes(dataset)
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=1.0, load=200) == FAILED
    assert classes.sel(friction_gradient=-0.8, sheave_stiffness=1.0, load=40) == FAILED
    assert classes.sel(friction_gradient=-0.8, sheave_stiffness=np.inf, load=200) == NOT_RUN
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=1.0, load=120) == VIBRATING
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=np.inf, load=120) == QUIET
    turned = dataset.assign(vibrates=dataset["vibrates"].transpose("load", ...))
    xr.testing.assert_identical(occurrence_classes(turned), classes)


def test_the_strongest_strand_is_shown_and_a_missing_one_does_not_count():
    dims = ("load", "strand")
    dataset = two_flags([1, 1, 1], [1, 1, 1])
    dataset["amplitude"] = dims, [[2.0, 1.0], [1.0, 3.0], [np.nan, 1.0]]
    dataset["frequency"] = dims, [[500.0, 600.0], [501.0, 601.0], [502.0, 602.0]]
    assert at_strongest_strand(dataset, "amplitude").values.tolist() == [2.0, 3.0, 1.0]
    assert at_strongest_strand(dataset, "frequency").values.tolist() == [500.0, 601.0, 602.0]
    assert np.isnan(at_strongest_strand(dataset, "growth_rate").values).all()


# Layout


def test_load_runs_along_x_gradient_along_y_and_stiffness_over_panels():
    chosen = arrange(study().transpose("load", "sheave_stiffness", ...), {})
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
    chosen = arrange(with_axes(**{name: [1.0, 2.0] for name in axes}), at)
    assert (chosen.x, chosen.y, chosen.panel) == expected
    assert set(chosen.dataset["status"].dims) == {name for name in expected if name}


def test_texts_are_no_x_axis_where_there_are_numbers():
    dataset = with_axes(load_history=["constant", "ramp"], ratio=[1.0, 2.0])
    assert (arrange(dataset, {}).x, arrange(dataset, {}).y) == ("ratio", "load_history")
    assert arrange(dataset, {"ratio": 1.0}).x == "load_history"
    assert arrange(dataset, {"load_history": "ramp"}).notes == ("load history = ramp",)
    flags_as_axis = with_axes(refined=[False, True], ratio=[1.0, 2.0])
    assert arrange(flags_as_axis, {"refined": True}).notes == ("refined = True",)


def test_what_is_fixed_is_said():
    dataset = with_axes(
        ratio=[2.5, 1.0], thrust=[2e4, 3e4], friction_gradient=[-1.0], sheave_stiffness=[1.0], load=[5.0]
    )
    dataset["thrust"].attrs["units"] = "N"
    dataset["status"][0, 1] = Status.TIMED_OUT
    chosen = arrange(dataset, {"thrust": 3e4})
    assert chosen.notes == ("thrust = 30 kN", "ratio = 2.5 (first of 2)")
    assert chosen.dataset["status"].values.tolist() == [[[Status.TIMED_OUT]]]


def test_panels_and_rows_are_sorted_with_their_values():
    chosen = arrange(study(gradients=(-0.8, -2.4), stiffnesses=(np.inf, 1.0), loads=(200.0, 120.0, 20.0)), {})
    assert chosen.dataset["sheave_stiffness"].values.tolist() == [1.0, np.inf]
    assert chosen.dataset["load"].values.tolist() == [20.0, 120.0, 200.0]
    classes = occurrence_classes(chosen.dataset)
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=1.0, load=120) == VIBRATING


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ({"lod": 20.0}, "unknown axis of the results; did you mean load?"),
        ({"load": 21.0}, "at load: expected a value of that axis: 20, 40, .* \\[N m\\], found 21.0"),
        ({"load": "much"}, "found 'much'"),
        (
            {"load": 20, "friction_gradient": -2.4, "sheave_stiffness": 1},
            "one axis or more, found a single run",
        ),
    ],
)
def test_what_cannot_be_fixed_is_refused(at, message, tmp_path):
    out = tmp_path / "map.png"
    with pytest.raises(InputError, match=message):
        draw_map(study(), out, at)
    assert not any(tmp_path.iterdir())


def test_of_many_values_the_error_names_a_few():
    dataset = with_axes(load=np.arange(1.0, 101.0), refined=[False, True])
    with pytest.raises(InputError, match=r"axis: 1, 2, .* 11, [.]{3}, 100, found 0.5"):
        arrange(dataset, {"load": 0.5})
    with pytest.raises(InputError, match="axis: False, True, found 'maybe'"):
        arrange(dataset, {"refined": "maybe"})


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
        ("N m rad-1", 4e5, "400000 N m rad-1"),
    ],
)
def test_values_are_shown_in_units_for_people(unit, value, shown):
    assert value_text(coordinate("x", [value], unit), 0) == shown


def test_a_value_is_found_by_number_or_text():
    third = 0.1 + 0.2  # not 0.3, as results of arithmetic are
    dataset = with_axes(load=[1.0, 2.0], ratio=[0.1, third], sheave_stiffness=[1.0, np.inf])
    dataset["status"][:, 1, 1] = Status.TIMED_OUT
    for ratio, stiffness in ((0.3, np.inf), ("0.3", "inf")):
        chosen = arrange(dataset, {"ratio": ratio, "sheave_stiffness": stiffness})
        assert (chosen.dataset["status"] == Status.TIMED_OUT).all()
        assert "sheave stiffness = rigid" in chosen.notes


def coordinate(name, values, units="1"):
    return xr.DataArray(np.array(values), dims=name, name=name, attrs={"units": units})


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


# Picture


def pixel(figure, axes, x, y):
    """Colour of the picture at a place in data coordinates."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())
    column, row = axes.transData.transform((x, y)).round().astype(int)
    return picture[picture.shape[0] - 1 - row, column, :3].astype(int)


def lightness(rgb):
    return np.asarray(rgb) @ (0.299, 0.587, 0.114)


def test_cells_show_their_class_at_their_place():
    dataset = study(stiffnesses=(1.0, np.inf))
    figure = figure_of(dataset)
    soft, rigid = panels_of(figure)
    assert soft.get_title(loc="left") == "sheave stiffness: 1"
    assert rigid.get_title(loc="left") == "sheave stiffness: rigid"
    # beside the mark, 5 N m from the grid point in cells of 20 N m
    quiet = lightness(pixel(figure, rigid, 125, -2.4))
    large = lightness(pixel(figure, soft, 125, -2.4))
    small = lightness(pixel(figure, soft, 65, -0.8))
    assert quiet > 220
    assert large < small < 170
    assert large < 40
    white = pixel(figure, rigid, 205, -0.8)
    assert white.tolist() == [255, 255, 255]  # not run


@pytest.mark.parametrize("kind", OccurrenceClass)
def test_each_class_alone_is_drawn_as_what_it_is(kind):
    status = {FAILED: Status.FAILED_ERROR, NOT_RUN: Status.NOT_RUN}.get(kind, Status.DONE)
    vibrates = {QUIET: Vibrates.NO, VIBRATING: Vibrates.YES}.get(kind, Vibrates.UNDECIDED)
    figure = figure_of(two_flags([status] * 3, [vibrates] * 3))
    (axes,) = panels_of(figure)
    fills = {tuple(colour) for cells in axes.collections for colour in np.atleast_2d(cells.get_facecolor())}
    assert matplotlib.colors.to_rgba(STYLES[kind].fill) in fills
    hatches = {cells.get_hatch() for cells in axes.collections if len(cells.get_paths()) == 3}
    assert (STYLES[kind].hatch or None) in hatches
    assert f"3 {kind.label}" in figure.get_suptitle()
    assert bars_of(figure) == []


def test_classes_differ_in_grey_and_in_their_marks():
    grey = [lightness(matplotlib.colors.to_rgb(STYLES[kind].fill)) for kind in (NOT_RUN, QUIET, UNDECIDED)]
    assert grey == sorted(grey, reverse=True)
    for colours in (AMPLITUDE_COLOURS, FREQUENCY_COLOURS):
        scale = lightness(colours(np.linspace(0, 1, 24))[:, :3])
        assert np.all(np.diff(scale) < 0)
        assert scale[0] < grey[-1] - 0.1
    looks = {(style.hatch, style.mark, style.fill) for style in STYLES.values()}
    assert len(looks) == len(STYLES) == len(OccurrenceClass)
    assert STYLES[FAILED].hatch and STYLES[UNDECIDED].hatch
    assert STYLES[FAILED].mark not in {style.mark for kind, style in STYLES.items() if kind != FAILED}


def test_counts_and_all_classes_are_told():
    figure = figure_of(study())
    assert "Vibration occurrence: occurrence" in figure.get_suptitle()
    assert "120 runs: 53 quiet, 59 vibrating, 3 undecided, 4 failed, 1 not run" in figure.get_suptitle()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [kind.label for kind in OccurrenceClass]
    assert panels_of(figure)[-1].get_xlabel() == "load [N m]"
    assert figure.get_supylabel() == "friction gradient [s/m]"


@pytest.mark.parametrize("stiffnesses", [(1.0,), (1.0, 1.5, np.inf), STIFFNESSES, (1, 2, 3, 4, 5, 6, 7)])
def test_a_panel_for_each_stiffness(stiffnesses):
    few = study(stiffnesses=stiffnesses, loads=LOADS[:3])
    assert len(panels_of(figure_of(few))) == len(stiffnesses)
    figure = figure_of(study(stiffnesses=stiffnesses, **FINE))
    assert len(panels_of(figure)) == 2 * len(stiffnesses)  # the frequency has no room in the cells
    assert bars_of(figure) == ["amplitude [µm]", "dominant frequency [Hz]"]


def test_frequencies_are_written_where_there_is_room():
    dataset = study(stiffnesses=(1.0,))
    figure = figure_of(dataset)
    (axes,) = panels_of(figure)
    classes = occurrence_classes(dataset)
    expected = at_strongest_strand(dataset, "frequency").values[classes.values == VIBRATING]
    assert sorted(int(text.get_text()) for text in axes.texts) == sorted(np.round(expected).astype(int))
    assert "dominant frequency [Hz]" in figure.get_suptitle()
    assert bars_of(figure) == ["amplitude [µm]"]


def test_every_grid_point_is_marked_at_its_true_place():
    loads = (10.0, 20.0, 25.0, 60.0)
    figure = figure_of(study(stiffnesses=(1.0,), loads=loads))
    (axes,) = panels_of(figure)
    points = [tuple(point) for line in axes.lines for point in line.get_xydata()]
    assert sorted(points) == sorted((load, gradient) for load in loads for gradient in GRADIENTS)


def test_only_vibrating_runs_set_the_scale():
    dataset = study(stiffnesses=(1.0,))
    largest = 1e6 * float(dataset["amplitude"].where(dataset["vibrates"] == Vibrates.YES).max())
    other = dataset["vibrates"] != Vibrates.YES
    dataset["amplitude"] = dataset["amplitude"].where(~other, 1.0)
    (bar,) = [axes for axes in figure_of(dataset).axes if axes.get_label() == "<colorbar>"]
    assert bar.get_ylim() == pytest.approx((0, largest))


def test_what_is_fixed_stands_in_the_title():
    title = figure_of(study(), {"sheave_stiffness": np.inf, "friction_gradient": -1.6}).get_suptitle()
    assert (
        "sheave stiffness = rigid" in title and "friction gradient = −1.6 s/m" in title and "10 runs" in title
    )


def test_one_axis_gives_one_row():
    line = study().isel(friction_gradient=0, sheave_stiffness=0, drop=True)
    figure = figure_of(line)
    (axes,) = panels_of(figure)
    assert axes.get_yticks().size == 0 and figure.get_supylabel() == ""
    assert "10 runs" in figure.get_suptitle()


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_are_small_in_every_format(suffix, tmp_path):
    out = tmp_path / "new" / f"map{suffix}"
    assert draw_map(study(**FINE), out) == out
    # 960 runs shown twice; an SVG, whose letters and pictures are written as text, may have a third more.
    assert out.stat().st_size < (4 / 3 * LIMIT if suffix == ".svg" else LIMIT)
    start = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix]
    assert out.read_bytes().startswith(start)
    assert [path.name for path in out.parent.iterdir()] == [out.name]


def test_the_file_is_as_wide_as_a_telephone_and_the_same_every_time(tmp_path):
    first, second = (draw_map(study(), tmp_path / name).read_bytes() for name in ("a.png", "b.png"))
    assert first == second
    with Image.open(tmp_path / "a.png") as picture:
        assert 1000 <= picture.width <= 1300
        assert 150 <= picture.info["dpi"][0] <= 200


def test_a_picture_that_cannot_be_drawn_leaves_the_old_one(tmp_path):
    out = tmp_path / "map.png"
    out.write_text("old")
    with pytest.raises(InputError, match="the variable status"):
        draw_map(xr.Dataset({"load": ("x", [1.0])}), out)
    with pytest.raises(InputError, match=r"[.]png, [.]svg, [.]pdf, found [.]jpg"):
        draw_map(study(), tmp_path / "map.jpg")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected to be able to write"):
        draw_map(study(), tmp_path / "file" / "map.png")
    assert out.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "map.png"]


def test_the_plotting_library_keeps_its_state(tmp_path):
    with matplotlib.rc_context({"font.size": 7.25, "hatch.linewidth": 3.5}):
        before = dict(matplotlib.rcParams)
        draw_map(study(loads=LOADS[:2]), tmp_path / "map.png")
        assert dict(matplotlib.rcParams) == before
    script = "import sys, cvt_hpc.analysis.maps, cvt_hpc.analysis.histories; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_results_read_back_from_a_file_give_the_same_map(tmp_path):
    dataset = study()
    dataset.to_netcdf(tmp_path / "results.nc", engine="netcdf4")
    with xr.open_dataset(tmp_path / "results.nc", engine="netcdf4") as stored:
        drawn = draw_map(stored, tmp_path / "a.png").read_bytes()
    assert drawn == draw_map(dataset, tmp_path / "b.png").read_bytes()


def test_flags_of_the_made_up_study_are_those_of_results():
    _, values, attributes = flags([1], ("load",), Status, "")
    assert values.dtype == np.int8 and attributes["flag_meanings"].split()[values[0]] == "done"
