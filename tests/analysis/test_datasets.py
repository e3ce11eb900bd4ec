"""Datasets of this version and of earlier ones open, draw and report with the present program."""

import lzma
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import cvt_hpc
from cvt_hpc.accessor import open_results
from cvt_hpc.analysis import animation
from cvt_hpc.analysis.classes import count_classes
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.picture_kinds import KINDS, RESULTS
from cvt_hpc.variables import Status

VERSIONS = sorted(path for path in (Path(__file__).parents[1] / "datasets").iterdir() if path.is_dir())
OF_RUNS = ("waterfall", "curve", "strands")
FOUND = {  # classes of the cells, and what can be drawn beside the map
    "grid": ("2 quiet, 2 vibrating, 2 undecided", OF_RUNS),
    "speeds": ("1 quiet, 2 vibrating", (*OF_RUNS, "campbell", "order_cuts")),
    "traced": ("7 quiet, 9 vibrating, 2 undecided", OF_RUNS),
    "samples": ("6 quiet, 2 vibrating", OF_RUNS),
    "starts": ("1 quiet, 4 vibrating, 1 undecided", OF_RUNS),
    "ramps": ("4 vibrating", (*OF_RUNS, "hysteresis")),
    "auto": ("2 quiet, 1 vibrating, 1 undecided", OF_RUNS),
    "criterion": ("4 quiet, 2 vibrating", ("curve",)),
    "strand": ("6 undecided", ("curve",)),
}
DRAWN = {
    "elastic_belt": ("wrap", "profile", "element", "history", "phase", "energy", "variator", "third_octaves"),
    "elastic_belt_ramp": ("ramp", "spectrogram", "wrap", "profile", "history", "phase", "energy", "variator"),
    "pushbelt": ("profile", "history", "phase", "variator", "third_octaves"),
    "spatial_pushbelt": ("profile", "history", "phase", "variator", "flanks"),
    "belt_drive": ("wrap", "profile", "history", "phase"),
}


@pytest.fixture(scope="module", params=VERSIONS, ids=lambda path: path.name)
def datasets(request, tmp_path_factory):
    """A folder with the files of a version, as they were written."""
    folder = tmp_path_factory.mktemp(request.param.name)
    for path in request.param.glob("*.nc.xz"):
        (folder / path.stem).write_bytes(lzma.decompress(path.read_bytes()))
    return folder


def compose_all(dataset, kinds, applying):
    """Compose kinds of pictures; those that do not apply are refused in words."""
    for kind in kinds:
        try:
            getattr(dataset.cvt, kind)(*(["core_seconds"] if kind == "curve" else []))
        except InputError:
            assert kind not in applying


def test_this_version_has_its_datasets():
    assert cvt_hpc.__version__ in [path.name for path in VERSIONS]
    expected = {f"{name}.nc.xz" for name in (*FOUND, *(f"history_{name}" for name in DRAWN))}
    for version in VERSIONS:
        assert {path.name for path in version.glob("*.nc.xz")} == expected


@pytest.mark.usefixtures("unarranged")
@pytest.mark.parametrize("name", FOUND)
def test_results_open_draw_and_report(datasets, name, tmp_path, monkeypatch):
    monkeypatch.setattr("cvt_hpc.report.page._encoded", lambda compose: "AA==")
    classes, applying = FOUND[name]
    with open_results(datasets / f"{name}.nc") as results:
        results.load()
        assert count_classes(results.cvt.classes().values) == classes
        results.cvt.map()
        compose_all(results, [kind for kind in KINDS if KINDS[kind].subject == RESULTS], applying)
        page = results.cvt.report(tmp_path / "report.html").read_text()
    assert name in page and page.rstrip().endswith("</html>")


def test_onsets_are_found_again(datasets):
    with open_results(datasets / "traced.nc") as results:
        assert results.cvt.onset().values.tolist() == [50.0, 90.0]  # [N m], at -1.2 and -0.8 s/m
        assert (results.status == Status.NOT_RUN).any()  # so that cells without a run are among them


@pytest.mark.usefixtures("unarranged")
@pytest.mark.parametrize("name", DRAWN)
def test_histories_open_and_draw(datasets, name, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 1)
    with open_results(datasets / f"history_{name}.nc") as history:
        history.load()
        assert np.isfinite(history["displacement"]).all()
        compose_all(history, [kind for kind in KINDS if KINDS[kind].subject != RESULTS], DRAWN[name])
        assert history.cvt.animation()._repr_html_().count("image/gif;base64,") == 1


def test_the_command_line_draws_the_same_files(datasets, monkeypatch, capsys):
    monkeypatch.chdir(datasets)
    monkeypatch.setattr("cvt_hpc.analysis.figures.save_figure", lambda figure, out: out)
    assert main(["plot", "campbell", "speeds.nc", "--orders", "1", "2"]) == 0
    assert main(["plot", "curve", "grid.nc", "frequency", "amplitude", "--lines", "friction_gradient"]) == 0
    assert (
        main(["plot", "profile", "history_elastic_belt.nc", "history_pushbelt.nc", "--of", "push_force"]) == 0
    )
    assert main(["plot", "element", "history_elastic_belt.nc", "--data", "followed.nc"]) == 0
    assert main(["plot", "variator", "history_spatial_pushbelt.nc", "--of", "gap", "--of", "roll"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "picture: speeds_campbell.png",
        "picture: grid_curve_frequency_amplitude.png",
        "picture: history_elastic_belt_history_pushbelt_profile_push_force.png",
        "picture: history_elastic_belt_element.png",
        "data: followed.nc",
        "picture: history_spatial_pushbelt_variator_gap_roll.png",
    ]
    with xr.open_dataset("followed.nc") as followed:
        assert (np.diff(followed["travelled"]) > 0.0).all()
    Path("followed.nc").unlink()


def test_each_history_of_a_folder_has_its_own_files(datasets, monkeypatch, capsys):
    monkeypatch.chdir(datasets)
    assert main(["plot", "element", ".", "--data", "met.nc"]) == 1  # one history alone has profiles over time
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "picture: history_elastic_belt_element.png",
        "data: met_history_elastic_belt.nc",
    ]
    assert len(told.err.splitlines()) == len(DRAWN) - 1
    Path("met_history_elastic_belt.nc").unlink()  # for those who ask for all histories of the folder


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["ramp", "history_elastic_belt.nc"], "expected a run along a ramp of load or speed"),
        (["spectrogram", "history_elastic_belt.nc"], "expected a run of 0.08 s or more"),
        (
            ["spectrogram", "history_belt_drive.nc"],
            "expected a history of 3000 samples per second or more, found 1000",
        ),
        (["element", "history_elastic_belt.nc", "--region", "driven"], "profiles over a whole passage"),
        (
            ["element", "history_pushbelt.nc", "--region", "driven"],
            "expected a history with profiles over time",
        ),
    ],
)
def test_what_a_history_does_not_hold_is_told(datasets, words, told, capsys):
    kind, name, *options = words
    assert main(["plot", kind, str(datasets / name), *options]) == 2
    assert told in capsys.readouterr().err
