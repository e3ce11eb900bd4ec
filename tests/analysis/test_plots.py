"""Pictures of spectra, curves and forces over the wrap: what is drawn where, and what is refused."""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text

from cvt_hpc.analysis.arrangement import Sides
from cvt_hpc.analysis.curves import MARKS, curve_figure, curve_panels_figure
from cvt_hpc.analysis.figures import STYLE
from cvt_hpc.analysis.profiles import profile_figure, wrap_figure
from cvt_hpc.analysis.value_maps import value_map_figure
from cvt_hpc.analysis.waterfall import waterfall_figure
from cvt_hpc.errors import InputError
from cvt_hpc.picture_kinds import KINDS, RESULTS, compose
from cvt_hpc.variables import Status, Vibrates
from support import pictured

LOADS, SPEEDS, BINS = [0.0, 2.0, 4.0], [20.0, 60.0], np.arange(0.0, 110.0, 10.0)


@pytest.fixture
def results():
    """Of six runs, with a ridge of the spectrum at 30 Hz; the last run has slipped through."""
    draw = np.random.default_rng(1)
    shape = (len(SPEEDS), len(LOADS))
    spectrum = np.full((*shape, 2, BINS.size), 1e-7)
    spectrum[..., 3] = 1e-5
    spectrum[-1, -1] = np.nan
    over = ("driving_speed", "load")
    loss = draw.random(shape)
    loss[-1, -1] = np.nan
    variables = {
        "status": (over, np.ones(shape, np.int8)),
        "vibrates": (over, np.zeros(shape, np.int8)),
        "spectrum": ((*over, "strand", "frequency_bin"), spectrum, {"units": "m"}),
        "eigenfrequency": (
            (*over, "strand", "half_waves"),
            [20.0, 60.0] + 30.0 * draw.random((*shape, 2, 2)),
        ),
        "speed_loss": (over, loss, {"units": "1"}),
        "expected_speed_loss": (
            over,
            draw.random(shape),
            {"units": "1", "long_name": "creep and compliance"},
        ),
        "strand_tension": ((*over, "strand"), draw.random((*shape, 2)), {"units": "N"}),
    }
    coordinates = {
        "driving_speed": ("driving_speed", SPEEDS, {"units": "rad s-1"}),
        "load": ("load", LOADS, {"units": "N m"}),
        "strand": ["t1", "t2"],
        "frequency_bin": ("frequency_bin", BINS, {"units": "Hz"}),
        "half_waves": [1, 2],
    }
    return xr.Dataset(variables, coordinates, {"job_name": "test"})


def test_a_waterfall_shows_each_spectrum_at_its_place(results):
    results["vibrates"][-1, -1] = Vibrates.SLIPS
    figure = waterfall_figure(results, {"driving_speed": 60.0})
    first, second, bar = figure.axes
    assert [axes.get_title(loc="left") for axes in (first, second)] == ["strand t1", "strand t2"]
    assert (first.get_xlabel(), first.get_ylabel()) == ("load [N m]", "frequency [Hz]")
    assert bar.get_ylabel() == "amplitude [µm]"
    for axes in (first, second):
        (mesh,) = axes.collections
        shown = mesh.get_array().reshape(BINS.size, len(LOADS))
        assert shown.mask[:, -1].all() and not shown.mask[:, :-1].any()
        assert (shown[:, :-1].argmax(axis=0) == 3).all() and shown.max() == pytest.approx(10.0)
        top, left = mesh.get_coordinates()[-1, 0], mesh.get_coordinates()[0, 0]
        assert (left[0], top[1]) == (-1.0, 105.0)  # cells reach halfway to their neighbours
    assert "grey: no spectrum (slips or lifts off)" in figure.get_suptitle()


def test_eigenfrequencies_lie_over_the_spectra(results):
    figure = waterfall_figure(results, {"driving_speed": 20.0})
    for strand, axes in zip(("t1", "t2"), figure.axes, strict=False):
        wanted = results["eigenfrequency"].sel(driving_speed=20.0, strand=strand)
        lines = [line.get_ydata() for line in axes.lines]
        np.testing.assert_array_equal(lines, wanted.transpose("half_waves", "load"))
        assert [text.get_text() for text in axes.texts] == ["1", "2"]
    assert not waterfall_figure(results.drop_vars("eigenfrequency")).axes[0].lines


def test_a_curve_has_marks_of_runs_and_lines_of_theory(results):
    results["status"][0, 0] = 2  # what a failed run has left is no result
    results["vibrates"][-1, -1] = Vibrates.SLIPS
    figure = curve_figure(results, ["speed_loss", "expected_speed_loss"])
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "driving speed 190.986 rpm",
        "driving speed 572.958 rpm",
    ]
    for k, axes in enumerate(figure.axes):
        marks, line, *above = axes.lines
        assert [(mark.get_label(), mark.get_xdata().tolist()) for mark in above] == [
            ("slips or lifts off", [4.0]) if k else ("failed", [0.0])
        ]
        assert above[0].get_ydata() == 1.0 and above[0].get_transform() == axes.get_xaxis_transform()
        assert axes.get_xlim()[0] < 0.0 and axes.get_xlim()[1] > 4.0
        assert (marks.get_linestyle(), line.get_linestyle()) == ("None", "-")
        np.testing.assert_array_equal(line.get_ydata(), results["expected_speed_loss"][k])
        known = results["speed_loss"][k].where(results["status"][k] == 1)
        np.testing.assert_array_equal(marks.get_ydata(), known)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["speed loss", "creep and compliance", "failed", "slips or lifts off"]
    assert figure.get_suptitle() == "Speed loss: test"


def test_small_numbers_have_their_power_of_ten_on_the_axis(results):
    results["speed_loss"] = (1e-4 * results["speed_loss"]).assign_attrs(units="1")
    axes = curve_figure(results, ["speed_loss"], {"driving_speed": 20.0}).axes[0]
    assert axes.get_ylabel() == "speed loss [10⁻⁶]"
    np.testing.assert_allclose(axes.lines[0].get_ydata(), 1e6 * results["speed_loss"].sel(driving_speed=20.0))


@pytest.mark.parametrize(
    ("unit", "factor", "shown"), [("m", 1e-4, "µm"), ("N m", 1e6, "kN m"), ("s-1", 1e-4, "10⁻⁶ s-1")]
)
def test_a_power_of_ten_is_a_prefix_where_the_unit_takes_one(results, unit, factor, shown):
    results["speed_loss"] = (factor * results["speed_loss"]).assign_attrs(units=unit)
    assert curve_figure(results, ["speed_loss"]).axes[0].get_ylabel() == f"speed loss [{shown}]"


def test_a_quantity_of_each_strand_gives_a_curve_of_each(results):
    figure = curve_figure(results, ["strand_tension"], {"driving_speed": 20.0})
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["t1", "t2"]
    assert figure.axes[0].get_ylabel() == "strand tension [N]"


def test_many_curves_differ_in_their_marks_and_have_a_legend_on_the_page(results):
    many = xr.concat([results["strand_tension"]] * 7, "strand", join="override", combine_attrs="override")
    names = [f"P{k}-P{k + 1}" for k in range(14)]
    results = results.drop_dims("strand").assign(strand_tension=many.assign_coords(strand=names))
    figure = curve_figure(results, ["strand_tension"], {"driving_speed": 20.0})
    looks = {(line.get_marker(), line.get_fillstyle()) for line in figure.axes[0].lines}
    assert len(looks) == 14 and not any(mark == ">" for mark, _ in looks)
    figure.draw_without_rendering()
    legend = figure.legends[0].get_window_extent()
    assert figure.bbox.x0 <= legend.x0 and legend.x1 <= figure.bbox.x1


@pytest.fixture
def history():
    """A belt that slides over the last part of both wraps."""
    angle = np.concatenate([np.linspace(0.1, 3.0, 9), [np.nan] * 3, np.linspace(0.1, 3.0, 9), [np.nan] * 3])
    names = ["driving"] * 9 + ["t1"] * 3 + ["driven"] * 9 + ["t2"] * 3
    places = np.arange(angle.size)
    forces = {
        key: ("position", 1e3 * places, {"units": "N m-1"}) for key in ("normal_force", "friction_force")
    }
    forces |= {"tension": ("position", 2.0 * places), "sliding_tension": ("position", 3.0 * places)}
    forces["wrap_angle"] = ("position", angle)
    return xr.Dataset(forces, {"position": 0.01 * places, "region": ("position", names)})


def test_forces_are_drawn_over_the_wrap_of_each_pulley(history):
    figure = wrap_figure([history, history], ["one", "two"])
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == ["driving pulley", "driven pulley"]
    normal, tension = figure.axes[1], figure.axes[5]
    assert normal.get_ylabel() == "" and figure.axes[0].get_ylabel() == "normal [N/mm]"
    angle, force = normal.lines[0].get_data()
    np.testing.assert_allclose(angle, np.degrees(np.linspace(0.1, 3.0, 9)))
    np.testing.assert_allclose(force, np.arange(12, 21))
    assert len(normal.lines) == 2 and len(tension.lines) == 4
    for line in tension.lines[2:]:
        np.testing.assert_allclose(line.get_ydata(), 3.0 * np.arange(12, 21))
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["one", "two", "Euler and Eytelwein"]
    figure.draw_without_rendering()
    common = next(part for part in figure.findobj(Text) if part.get_text() == "wrap angle from inlet [°]")
    assert not common.get_window_extent().overlaps(figure.legends[0].get_window_extent())


def test_several_runs_are_told_apart_by_their_points(history, monkeypatch):
    monkeypatch.setattr("cvt_hpc.analysis.telling_apart.place_of", lambda attributes: attributes["place"])
    runs = [history.assign_attrs(place=["driving_speed 60 rad/s", f"load {load} N m"]) for load in (8, 16)]
    figure = wrap_figure(runs, ["one", "two"])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["load 8 N m", "load 16 N m", "Euler and Eytelwein"]
    assert figure.get_suptitle().replace("\u00a0", " ").splitlines()[1] == "driving_speed 60 rad/s"


def test_of_many_pulleys_those_with_torque_are_drawn(history):
    regions = [f"{name} 2" for name in history["region"].values]
    second = history.assign_coords(region=("position", regions))
    second = second.assign(friction_force=1e-3 * second["friction_force"])
    both = xr.concat([history, second.assign_coords(position=second["position"] + 1.0)], "position")
    figure = wrap_figure([both])
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == ["driving pulley", "driven pulley"]
    assert "without torque, not drawn: driving 2, driven 2" in figure.get_suptitle()
    assert figure.axes[0].lines[0].get_marker() == "."  # of few places


@pytest.mark.parametrize(
    ("compose", "message"),
    [
        (
            lambda d, h: waterfall_figure(d.drop_vars("spectrum")),
            "results: expected results with the variable spectrum, found status, vibrates, "
            "eigenfrequency, speed_loss, expected_speed_loss, strand_tension; runs of a belt that marches in time "
            "record it, up to band_high in [vibration]",
        ),
        (lambda d, h: waterfall_figure(d, {"load": 3.0}), "results: at load: expected a value of that axis"),
        (lambda d, h: curve_figure(d, ["loss"]), "results: loss: unknown numeric variable of the results"),
        (
            lambda d, h: curve_figure(d, ["speed_loss", "strand_tension"]),
            "results: strand_tension: expected the unit of speed_loss, 1, found N",
        ),
        (
            lambda d, h: curve_figure(
                xr.concat([d, d.assign_coords(driving_speed=d["driving_speed"] + 1.0)], "driving_speed"),
                ["speed_loss"],
            ),
            "results: driving_speed: expected at most 3 values, or one that --at fixes, found 4",
        ),
        (lambda d, h: wrap_figure([]), "wrap: expected one history or more, found none"),
        (
            lambda d, h: wrap_figure([h.drop_vars("wrap_angle")], ["h.nc"]),
            "h.nc: expected the history of a run with normal_force and wrap_angle, found no wrap_angle",
        ),
        (
            lambda d, h: profile_figure([h.drop_dims("position")], sources=["h.nc"]),
            "h.nc: expected the history of a run with quantities along the belt, found none",
        ),
    ],
)
def test_what_cannot_be_drawn_is_refused(results, history, compose, message):
    with matplotlib.rc_context(STYLE), pytest.raises(InputError) as caught:
        compose(results, history)
    assert str(caught.value).startswith(message)


BLANK = {
    "curve": ({"quantities": ["efficiency"]}, {"ratio": 1.0, "driving_speed": 100.0}),
    "strands": ({}, {"driving_speed": 100.0}),
}


@pytest.mark.parametrize(
    "name", sorted(set(KINDS) - {"hysteresis", "onset_bands", "sensitivity"})
)  # ramps may be quiet, samples missing
def test_a_picture_without_data_is_refused_by_what_it_lacks(name):
    options, at = BLANK.get(name, ({}, None))
    ramped = {"ramp": "load", "spectrogram": "driving_speed"}.get(name)
    whole = pictured.results() if KINDS[name].subject == RESULTS else pictured.history(ramped=ramped)
    floats = [key for key, array in whole.data_vars.items() if array.dtype.kind == "f"]
    kept = {"load", "driving_speed", "wrap_angle", "momentary_element_speed"}
    nothing = whole.assign({key: np.nan * whole[key] for key in set(floats) - kept})
    for lacking in (nothing, whole.drop_vars(floats)):
        with pytest.raises(InputError) as caught:
            compose(name, [lacking], at, ["x.nc"], **options)
        assert str(caught.value).startswith("x.nc: ") and "\n" not in str(caught.value)
    assert compose(name, [whole], at, ["x.nc"], **options).axes


def test_a_wrap_ends_where_the_strand_begins_and_strands_have_no_panel(history):
    """The end of an arc is the first station of the strand behind it."""
    angle = history["wrap_angle"].values
    angle[[9, 21]] = 3.2
    figure = wrap_figure([history])
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == ["driving pulley", "driven pulley"]
    for axes in figure.axes[:2]:
        np.testing.assert_allclose(axes.lines[0].get_xdata()[-2:], np.degrees([3.0, 3.2]))


def test_a_map_of_quantities_has_a_panel_for_each_and_tells_their_numbers(results):
    results["status"][0, 0] = 2  # failed: what it has left is no result
    results["vibrates"][-1, -1] = Vibrates.SLIPS
    results["speed_loss"] = results["speed_loss"].fillna(0.5)
    figure = value_map_figure(results, ["speed_loss", "strand_tension"])
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>" and axes.axison]
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == ["speed loss", "strand tension [N], t1", "strand tension [N], t2"]  # of 1 N at most
    assert (panels[0].get_ylabel(), panels[-1].get_xlabel()) == ("driving speed [rpm]", "load [N m]")
    texts = [text.get_text() for text in panels[0].texts]
    shown = results["speed_loss"].values.ravel()[1:]
    assert texts == [f"{value:.3g}" if value >= 0.1 else f"{value:.2g}" for value in shown]
    assert "6 runs, of them 1 failed, 1 slipping" in figure.get_suptitle()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["slipping", "failed"]
    with pytest.raises(InputError, match="speed_los: "):
        value_map_figure(results, ["speed_los"])


def test_values_of_both_signs_have_colours_about_zero(results):
    results["force"] = results["speed_loss"].dims, [[-2.0, 0.0, 8.0], [-8.0, 1.0, 3.0]], {"units": "W"}
    axes, bar = value_map_figure(results, ["force"]).axes
    low, high = bar.get_ylim()
    assert low == -high
    shown = axes.images[0].get_array()
    assert np.ptp(shown[0, 1, :3]) < 10  # none is white or grey
    results["force"] = np.abs(results["force"])
    assert value_map_figure(results, ["force"]).axes[1].get_ylim()[0] >= 0.0


def test_negative_values_are_hatched_where_there_are_no_numbers(results):
    loads = np.linspace(0.0, 40.0, 60)
    dims = ("driving_speed", "load")
    fine = xr.Dataset(
        {
            name: (dims, np.full((2, loads.size), value, np.int8))
            for name, value in (("status", 1), ("vibrates", 0))
        },
        {"driving_speed": SPEEDS, "load": loads},
    )
    fine["force"] = (dims, np.stack([loads - 20.0, 20.0 - loads]), {"units": "W"})
    figure = value_map_figure(fine, ["force"])
    (hatched,) = figure.axes[0].patches
    for load, speed, is_negative in ((5.0, 20.0, True), (35.0, 20.0, False), (35.0, 60.0, True)):
        assert hatched.get_path().contains_point((load, speed)) == is_negative
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["below zero"]
    assert not value_map_figure(fine.isel(load=[0, 59]), ["force"]).axes[0].patches  # numbers tell


def test_all_panels_of_a_quantity_have_one_scale_of_colours(results):
    sizes = [[[2e-6, 6e-6]], [[20e-6, 50e-6]]] * np.ones((1, len(LOADS), 1))  # by speed and strand
    results["motion"] = results["strand_tension"].dims, sizes, {"units": "m"}
    both = xr.concat([results, results], xr.Variable("wear", [1, 2])).transpose("wear", ...)
    both["motion"][1] *= 1.5
    both["vibrates"].attrs = results["vibrates"].attrs
    figure = value_map_figure(both, ["motion"], sides=Sides("load", "driving_speed", "wear"))
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>" and axes.axison]
    titles = [f"motion [µm], {strand}, wear {wear}" for strand in ("t1", "t2") for wear in (1, 2)]
    assert [axes.get_title(loc="left") for axes in panels] == titles
    bars = [axes.get_ylim() for axes in figure.axes if axes.get_label() == "<colorbar>"]
    assert bars == [pytest.approx((2.0, 75.0))] * 4


def test_a_quantity_that_does_not_vary_has_one_colour(results):
    results["speed_loss"] = 0.0 * results["speed_loss"].fillna(0.0) + 50e3
    results["speed_loss"][0, 0] += 1e-6
    (image,) = value_map_figure(results, ["speed_loss"]).axes[0].images
    assert len({tuple(colour) for colour in image.get_array().reshape(-1, 4)}) == 1


def test_two_dollars_in_a_name_begin_no_formula(results):
    results = results.assign_attrs(job_name=r"5 $ \frac 6 $").rename(load="wear")
    results["wear"].attrs["long_name"] = r"$\odd$ wear"
    results = results.assign_coords(driving_speed=[r"$\a$", r"$\b$"])
    figure = waterfall_figure(results, {"driving_speed": r"$\b$"})
    figure.draw_without_rendering()
    assert r"$\frac" in figure.get_suptitle() or r"\frac 6" in figure.get_suptitle()
    ticks = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert any("10^{" in text for text in ticks)  # of the colours these remain powers
    figure = value_map_figure(results, ["speed_loss"])
    figure.draw_without_rendering()
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == [r"$\a$", r"$\b$"]


def many_runs(results, count=60):
    """The results at one speed over many loads."""
    loads = xr.Variable("load", np.linspace(0.0, 100.0, count), {"units": "N m"})
    one = results.isel(driving_speed=0, load=0, drop=True)
    return one.expand_dims(load=loads).copy(deep=True)


def test_one_harmonic_or_one_run_does_not_flatten_spectra(results):
    runs = many_runs(results)
    runs["spectrum"][:] = 1e-9
    runs["spectrum"][..., 3] = 1e-6 * (1.0 + np.linspace(0.0, 1.0, 60))[:, None]
    bar = waterfall_figure(runs).axes[-1]
    assert bar.get_ylim() == pytest.approx((1e-3, 2.0))  # from what nine in ten lines have
    runs["spectrum"][..., 7] = 1e-3  # a harmonic in all runs, 500 times as large
    harmonic = waterfall_figure(runs).axes[-1].get_ylim()
    assert harmonic[1] == pytest.approx(1e3) and harmonic[0] < 2.0  # the ridge is between
    runs["spectrum"][..., 7] = 1e-9
    runs["spectrum"][30, :, 3] = 1e-3  # one run
    figure = waterfall_figure(runs)
    assert figure.axes[-1].get_ylim()[1] < 3.0
    assert waterfall_figure(runs, vmax=5e-6).axes[-1].get_ylim()[1] == pytest.approx(5.0)


def test_outliers_on_both_sides_do_not_flatten_a_map(results):
    runs = many_runs(results)
    runs["speed_loss"] = ("load", np.linspace(1.0, 2.0, 60), {"units": "1"})
    runs["speed_loss"][0], runs["speed_loss"][-1] = -500.0, 700.0
    bar = value_map_figure(runs, ["speed_loss"]).axes[-1]
    assert 0.9 < bar.get_ylim()[0] < 1.2 and 1.8 < bar.get_ylim()[1] < 2.1
    steady = many_runs(results)
    steady["speed_loss"] = ("load", np.linspace(1.0, 2.0, 60), {"units": "1"})
    assert value_map_figure(steady, ["speed_loss"]).axes[-1].get_ylim() == pytest.approx((1.0, 2.0))


def test_a_waterfall_has_a_row_of_panels_for_each_value_of_an_axis(results):
    figure = waterfall_figure(results, sides=Sides("load", panel="driving_speed"))
    titles = [axes.get_title(loc="left") for axes in figure.axes[:4]]
    assert titles == [
        f"strand {s}, driving speed {v} rpm" for v in ("190.986", "572.958") for s in ("t1", "t2")
    ]
    for k, axes in enumerate(figure.axes[:4]):
        wanted = results["eigenfrequency"].isel(driving_speed=k // 2, strand=k % 2)
        lines = [line.get_ydata() for line in axes.lines]
        np.testing.assert_array_equal(lines, wanted.transpose("half_waves", "load"))
    with pytest.raises(InputError, match="results: panel wear: unknown axis of the results"):
        waterfall_figure(results, sides=Sides(panel="wear"))


def test_panels_of_quantities_have_a_curve_for_each_value_of_an_axis(results):
    results["status"][0, 1] = Status.FAILED_NUMERICS
    groups = [["speed_loss", "expected_speed_loss"], ["strand_tension"]]
    figure = curve_panels_figure(results, groups, "driving_speed")
    first, *strands = figure.axes
    assert [axes.get_title(loc="left") for axes in strands] == [
        "strand tension t1 [N]",
        "strand tension t2 [N]",
    ]
    assert first.get_title(loc="left") == "speed loss" and first.get_xlabel() == "load [N m]"
    expected = results["speed_loss"].values.copy()
    expected[0, 1] = np.nan  # a run that failed has no mark
    marks = [line for line in first.lines if line.get_marker() in MARKS]
    np.testing.assert_array_equal([line.get_ydata() for line in marks], expected)
    beside = [line for line in first.lines if line.get_marker() == "None"]
    wanted = np.where(
        np.isfinite(expected) | (results["status"] == Status.DONE), results["expected_speed_loss"], np.nan
    )
    np.testing.assert_array_equal([line.get_ydata() for line in beside], wanted)
    assert [line.get_color() for line in beside] == [line.get_color() for line in marks]
    for axes, strand in zip(strands, ("t1", "t2"), strict=True):
        second = [line.get_ydata() for line in axes.lines if line.get_marker() in MARKS][1]
        np.testing.assert_array_equal(second, results["strand_tension"].sel(strand=strand)[1])
    (legend,) = figure.legends
    told = [text.get_text() for text in legend.get_texts()]
    assert told[:3] == ["driving speed 190.986 rpm", "driving speed 572.958 rpm", "creep and compliance"]
    assert "failed" in told[3]


def test_panels_of_unlike_quantities_are_refused(results):
    cases = {
        r"results: strand_tension: expected the unit of speed_loss, 1, found N": [
            ["speed_loss", "strand_tension"]
        ],
        r"results: speed_loss: expected the dimensions of strand_loss: strand, found none": [
            ["strand_loss", "speed_loss"]
        ],
        r"results: panels: expected at most 12, found 13": [["speed_loss"]] * 13,
    }
    results["strand_loss"] = results["strand_tension"].assign_attrs(units="1")
    for words, groups in cases.items():
        with pytest.raises(InputError, match=words):
            curve_panels_figure(results, groups, "driving_speed")
    with pytest.raises(
        InputError, match="results: y sped: unknown axis of the results; known: driving_speed"
    ):
        curve_panels_figure(results, [["speed_loss"]], "sped")
