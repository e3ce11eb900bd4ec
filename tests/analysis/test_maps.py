"""Maps of made-up studies: what the picture shows where."""

import os
import subprocess
import sys
import time
from functools import cache, partial
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from PIL import Image

import cvt_hpc
from cvt_hpc.analysis.cells import AMPLITUDE_COLOURS, FREQUENCY_COLOURS, STYLES
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, occurrence_classes
from cvt_hpc.analysis.figures import STYLE, draw
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.errors import InputError
from cvt_hpc.variables import Status, Vibrates
from support.studies import GRADIENTS, LOADS, STIFFNESSES, fills_of, flags, study, two_flags

LIMIT = 300_000  # bytes that a picture may have
FINE = {"gradients": np.linspace(-2.4, -0.4, 6), "loads": np.linspace(5, 200, 40)}
QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN, SLIPPING, IRREGULAR = OccurrenceClass
VERDICTS = {
    QUIET: Vibrates.NO,
    VIBRATING: Vibrates.YES,
    SLIPPING: Vibrates.SLIPS,
    IRREGULAR: Vibrates.IRREGULAR,
}


def figure_of(dataset, at=()):
    return map_figure(dataset, dict(at), "out/x")


def panels_of(figure):
    """The axes that hold cells."""
    return [axes for axes in figure.axes if axes.axison and axes.get_label() != "<colorbar>"]


def bars_of(figure):
    return [axes.get_ylabel() for axes in figure.axes if axes.get_label() == "<colorbar>"]


def picture_of(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def pixel(picture, axes, x, y):
    """Colour of the picture at a place in data coordinates."""
    column, row = axes.transData.transform((x, y)).round().astype(int)
    return picture[picture.shape[0] - 1 - row, column, :3].astype(int)


def lightness(rgb):
    return np.asarray(rgb) @ (0.299, 0.587, 0.114)


def small_study():
    """Of two panels."""
    return study(stiffnesses=(1.0, np.inf))


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The picture of the small study, as a file."""
    return draw(lambda: map_figure(small_study()), tmp_path_factory.mktemp("plain") / "map.png")


def test_cells_show_their_class_at_their_place():
    figure = figure_of(small_study())
    soft, rigid = panels_of(figure)
    assert soft.get_title(loc="left") == "sheave stiffness: 1"
    assert rigid.get_title(loc="left") == "sheave stiffness: rigid"
    picture = picture_of(figure)
    # beside the mark, 5 N m from the grid point in cells of 20 N m
    quiet = lightness(pixel(picture, rigid, 125, -2.4))
    large = lightness(pixel(picture, soft, 125, -2.4))
    small = lightness(pixel(picture, soft, 65, -0.8))
    assert quiet > 220
    assert large < small < 170
    assert large < small - 40
    white = pixel(picture, rigid, 205, -0.8)
    assert white.tolist() == [255, 255, 255]  # not run


@pytest.mark.parametrize("kind", OccurrenceClass)
def test_each_class_alone_is_drawn_as_what_it_is(kind):
    status = {FAILED: Status.FAILED_ERROR, NOT_RUN: Status.NOT_RUN}.get(kind, Status.DONE)
    vibrates = VERDICTS.get(kind, Vibrates.UNDECIDED)
    figure = figure_of(two_flags([status] * 3, [vibrates] * 3))
    (axes,) = panels_of(figure)
    assert fills_of(axes) == {STYLES[kind].fill: 3}
    assert [cells.get_hatch() for cells in axes.patches] == [STYLES[kind].hatch] * bool(STYLES[kind].hatch)
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
    of_any_map = [kind.label for kind in (QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN)]
    assert [text.get_text() for text in legend.get_texts()] == [*of_any_map, "onset of vibration ± 10 N m"]
    assert panels_of(figure)[-1].get_xlabel() == "load [N m]"
    assert figure.get_supylabel() == "friction gradient [s/m]"


def special_runs():
    """A study in which the highest loads slip, and the lowest but one is irregular."""
    dataset = study(stiffnesses=(1.0,))
    dataset["status"].values[:] = Status.DONE
    dataset["vibrates"].values[..., -2:] = Vibrates.SLIPS
    dataset["amplitude"].values[..., -1, :] = np.nan  # slipped through
    dataset["vibrates"].values[..., 1] = Vibrates.IRREGULAR
    dataset["amplitude"].values[..., 1, :] = 4.2e-6
    return dataset


def test_slipping_and_irregular_runs_are_in_the_legend_where_they_occur():
    figure = figure_of(special_runs())
    (legend,) = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words == [
        "quiet",
        "vibrating",
        "undecided",
        "slipping",
        "irregular",
        "onset of vibration ± 10 N m",
    ]
    assert "6 slipping, 3 irregular" in figure.get_suptitle()
    figure.draw_without_rendering()
    extent = legend.get_window_extent()
    assert 0.0 <= extent.x0 < extent.x1 <= figure.bbox.width and extent.y0 >= 0.0


def test_irregular_cells_tell_their_amplitude():
    figure = figure_of(special_runs())
    (axes,) = panels_of(figure)
    assert [text.get_text() for text in axes.texts].count("4.2") == 3
    assert "in irregular cells: amplitude [µm]" in figure.get_suptitle()
    assert "irregular cells" not in figure_of(study()).get_suptitle()


@pytest.mark.parametrize("stiffnesses", [(1.0,), STIFFNESSES])
def test_a_panel_for_each_stiffness(stiffnesses):
    few = study(stiffnesses=stiffnesses, loads=LOADS[:3])
    assert len(panels_of(figure_of(few))) == len(stiffnesses)
    figure = figure_of(study(stiffnesses=stiffnesses, **FINE))
    assert len(panels_of(figure)) == 2 * len(stiffnesses)  # the frequency has no room in the cells
    assert bars_of(figure) == ["amplitude [µm]", "frequency [Hz]"]


def test_frequencies_are_written_where_there_is_room():
    dataset = study(stiffnesses=(1.0,))
    figure = figure_of(dataset)
    (axes,) = panels_of(figure)
    classes = occurrence_classes(dataset)
    expected = at_strongest_strand(dataset, "frequency").values[classes.values == VIBRATING]
    assert sorted(int(text.get_text()) for text in axes.texts) == sorted(np.round(expected).astype(int))
    assert "frequency [Hz]" in figure.get_suptitle()
    assert bars_of(figure) == ["amplitude [µm]"]


def test_cells_whose_harmonics_lead_are_marked():
    dataset = study(stiffnesses=(1.0,))
    (legend,) = figure_of(dataset.assign(strongest_frequency=dataset["frequency"])).legends
    assert "harmonics lead" not in [text.get_text() for text in legend.get_texts()]
    leading = (dataset["load"] == LOADS[4]) & (dataset["strand"] == "t1")
    other = (dataset["load"] == LOADS[5]) & (dataset["strand"] == "t2")  # which moves less
    strongest = dataset["frequency"] * xr.where(leading | other, 2.0, 1.0)
    figure = figure_of(dataset.assign(strongest_frequency=strongest.transpose(*dataset["frequency"].dims)))
    (axes,) = panels_of(figure)
    marked = {tuple(p) for line in axes.lines if line.get_marker() == "D" for p in line.get_xydata()}
    vibrating = occurrence_classes(dataset).isel(sheave_stiffness=0) == VIBRATING
    assert marked == {(LOADS[4], g) for g in GRADIENTS if vibrating.sel(friction_gradient=g, load=LOADS[4])}
    assert marked and "harmonics lead" in [text.get_text() for text in figure.legends[0].get_texts()]


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
    (bar,) = [axes for axes in map_figure(dataset, vmax="fit").axes if axes.get_label() == "<colorbar>"]
    assert bar.get_ylim() == pytest.approx((0, largest))


def test_maps_have_one_scale_of_amplitudes_and_mark_what_lies_beyond():
    dataset, colours = study(stiffnesses=(1.0,), gradients=(-2.4,)), []
    for factor, extend in ((1.0, "neither"), (20.0, "max"), (0.2, "min")):
        larger = dataset.assign(amplitude=factor * dataset["amplitude"])
        figure = map_figure(larger)
        (bar,) = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
        assert bar.get_ylim() == pytest.approx((2.0, 200.0)) and bar.get_yscale() == "log"
        labels = [label.get_text() for label in bar.get_yticklabels()]
        assert labels == ["2", "5", "10", "20", "50", "100", "200"] and bar._colorbar.extend == extend
        colours.append(fills_of(panels_of(figure)[0]))
    beyond = map_figure(dataset.assign(amplitude=300.0 * dataset["amplitude"]))
    assert to_hex(AMPLITUDE_COLOURS(1.0)) in fills_of(panels_of(beyond)[0])
    assert colours[0] != colours[1]
    with pytest.raises(InputError, match='vmax: expected a number or "fit", found "most"'):
        map_figure(dataset, vmax="most")


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


@cache
def fine():
    return map_figure(study(**FINE))


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_are_small_in_every_format(suffix, tmp_path):
    out = tmp_path / "new" / f"map{suffix}"
    assert draw(fine, out) == out
    # 960 runs shown twice; an SVG, whose letters and pictures are written as text, may have a third more.
    assert out.stat().st_size < (4 / 3 * LIMIT if suffix == ".svg" else LIMIT)
    start = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix]
    assert out.read_bytes().startswith(start)
    assert [path.name for path in out.parent.iterdir()] == [out.name]


def test_the_file_is_as_wide_as_a_telephone_and_the_same_every_time(plain, tmp_path):
    assert draw(lambda: map_figure(small_study()), tmp_path / "again.png").read_bytes() == plain.read_bytes()
    with Image.open(plain) as picture:
        assert 1000 <= picture.width <= 1300
        assert 150 <= picture.info["dpi"][0] <= 200


def test_a_picture_that_cannot_be_drawn_leaves_the_old_one(tmp_path):
    out = tmp_path / "map.png"
    out.write_text("old")
    many = xr.Dataset({f"v{i}": ("x", [1.0]) for i in range(30)})
    for dataset, found in (
        (many, "v0, v1, v2, v3, v4, ..., v29"),
        (many[["v1"]], "v1"),
        (many[[]], "no variables"),
    ):
        message = f"^x.nc: expected results of a study, with the variable status, found {found}$"
        with pytest.raises(InputError, match=message):
            draw(partial(map_figure, dataset, source="x.nc"), out)
    with pytest.raises(InputError, match=r"[.]png, [.]svg, [.]pdf, found [.]jpg"):
        draw(lambda: map_figure(study()), tmp_path / "map.jpg")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected to be able to write"):
        draw(lambda: map_figure(study()), tmp_path / "file" / "map.png")
    assert out.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "map.png"]


def test_the_plotting_library_keeps_its_state(tmp_path):
    with matplotlib.rc_context({"font.size": 7.25, "hatch.linewidth": 3.5}):
        before = dict(matplotlib.rcParams)
        draw(lambda: map_figure(study(loads=LOADS[:2])), tmp_path / "map.png")
        assert dict(matplotlib.rcParams) == before


def test_results_read_back_from_a_file_give_the_same_map(plain, tmp_path):
    small_study().to_netcdf(tmp_path / "results.nc", engine="netcdf4")
    with xr.open_dataset(tmp_path / "results.nc", engine="netcdf4") as stored:
        drawn = draw(lambda: map_figure(stored), tmp_path / "a.png").read_bytes()
    assert drawn == plain.read_bytes()


def test_flags_of_the_made_up_study_are_those_of_results():
    _, values, attributes = flags([1], ("load",), Status, "")
    assert values.dtype == np.int8 and attributes["flag_meanings"].split()[values[0]] == "done"


DRAW = """
import sys
import cvt_hpc.analysis.histories, cvt_hpc.experiments.branch, cvt_hpc.experiments.chart, cvt_hpc.experiments.ladder.making
import xarray as xr
from pathlib import Path
from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.maps import map_figure
draw(lambda: map_figure(xr.open_dataset(sys.argv[1])), Path("map.png"))
sys.exit("matplotlib.pyplot" in sys.modules)
"""


def test_a_matplotlibrc_that_cannot_be_read_changes_nothing_and_pyplot_is_left_alone(plain, tmp_path):
    small_study().to_netcdf(tmp_path / "results.nc")
    (tmp_path / "matplotlibrc").write_bytes(b"font.size: 30\nfont.family: \xff\xfe\n")
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(cvt_hpc.__file__).parents[1]),
        "MPLBACKEND": "nonsense",
    }
    command = [sys.executable, "-c", DRAW, str(tmp_path / "results.nc")]
    finished = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert (tmp_path / "map.png").read_bytes() == plain.read_bytes()


def test_settings_of_the_plotting_library_change_nothing(tmp_path):
    small = study(stiffnesses=(1.0,))
    plain = draw(lambda: map_figure(small), tmp_path / "plain.svg").read_bytes()
    odd = {"text.usetex": True, "font.family": "Nowhere", "svg.fonttype": "none", "axes.facecolor": "red"}
    with matplotlib.rc_context(odd):
        assert draw(lambda: map_figure(small), tmp_path / "odd.svg").read_bytes() == plain


def test_a_large_map_is_drawn_in_a_second_and_its_small_cells_are_not_hidden():
    large = {
        "gradients": np.linspace(-2.4, -0.4, 250),
        "loads": np.linspace(20, 200, 400),
        "stiffnesses": (1.0,),
    }
    dataset = study(**large)
    began = time.process_time()
    figure = figure_of(dataset)
    picture = picture_of(figure)
    # 0.7 s on an idle core, 28 s with an object for each cell; a busy machine may take several times as long
    assert time.process_time() - began < 6.0
    axes = panels_of(figure)[0]
    assert not axes.lines  # marks
    for load, gradient in ((30, -1), (110, -1.4), (190, -2)):
        place = int(np.argmin(abs(large["gradients"] - gradient))), int(np.argmin(abs(large["loads"] - load)))
        expected = axes.images[0].get_array()[place][:3].astype(int)
        found = pixel(picture, axes, large["loads"][place[1]], large["gradients"][place[0]])
        assert np.abs(found - expected).max() <= 2, (load, gradient)


def test_a_figure_for_a_notebook_has_the_style_of_the_picture_and_leaves_the_users():
    with matplotlib.rc_context({"font.size": 31.0}):
        figure = cvt_hpc.map_figure(study(), {"sheave_stiffness": 1.5})
        assert matplotlib.rcParams["font.size"] == 31.0
    (panel,) = panels_of(figure)
    assert {label.get_fontsize() for label in panel.get_xticklabels()} == {STYLE["xtick.labelsize"]}
    assert panel.get_xlabel() == "load [N m]" and "sheave stiffness = 1.5" in figure.get_suptitle()
    with pytest.raises(InputError, match="results: at slip: "):
        cvt_hpc.map_figure(study(), {"slip": 1.0})
