"""The belt as a moving picture."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from cvt_hpc.analysis import animation
from cvt_hpc.analysis.animation import FRAMES, PERIODS, _along_belt, _last_periods, draw_animation
from cvt_hpc.errors import InputError
from cvt_hpc.physics.geometry import variator

FEW = 4  # frames of a period
POINT = {"ratio": 2.5, "driven_radius": 0.075, "centre_distance": 0.155}


def history(frequency=500.0):
    """A standing wave of t1, 20 um about an offset of 1 mm, which the picture leaves out."""
    path = variator(**POINT)
    start = path.lengths[0]
    position = start + path.strand_length * np.array([1, 2, 3, 4, 5]) / 6
    position = np.append(position, [0.0, start + 2.0 * path.strand_length])
    time = np.arange(4000) / 20e3
    shape = np.append(np.sin(np.pi * np.array([1, 2, 3, 4, 5]) / 6), [0.0, 0.0])
    motion = 1e-3 + 20e-6 * np.sin(2 * np.pi * frequency * time)[:, None] * shape
    return xr.Dataset(
        {"displacement": (("time", "probe"), motion)},
        {"time": time, "probe_position": ("probe", position)},
        {"point": json.dumps(POINT), "judged_fraction": 0.5, "job_name": "wave"},
    )


def test_the_picture_shows_the_last_periods_at_the_probes_and_between():
    run = history()
    time, motion, period = _last_periods(run)
    assert period == pytest.approx(1 / 500, rel=1e-3)
    assert time.size == PERIODS * FRAMES and np.ptp(time) == pytest.approx(PERIODS * period)
    expected = 20e-6 * np.sin(2 * np.pi * 500 * time)
    np.testing.assert_allclose(motion[:, 2], expected, atol=1e-8)  # the spline over 40 samples a period
    length = variator(**POINT).path_length
    along = _along_belt(run, motion, run.probe_position.values, length)
    np.testing.assert_allclose(along, motion, atol=1e-12)


def test_the_frequency_is_that_of_the_record_where_it_has_one():
    """A slow drift would else be taken for the vibration."""
    run = history(495.0)
    run["displacement"] = run["displacement"] + 1e-3 * run["time"] / run["time"][-1]
    assert 1 / _last_periods(run)[2] < 20.0
    recorded = run.assign(amplitude=("strand", [20e-6, 1e-6]), frequency=("strand", [495.0, 700.0]))
    assert 1 / _last_periods(recorded)[2] == pytest.approx(495.0)
    unknown = run.assign(amplitude=("strand", [np.nan] * 2), frequency=("strand", [np.nan] * 2))
    assert _last_periods(unknown)[2] == _last_periods(run)[2]


@pytest.mark.parametrize("fraction", [0.0, 2.0, "half", np.nan])
def test_without_a_judged_part_the_last_half_is_taken(fraction):
    expected = _last_periods(history())
    found = _last_periods(history().assign_attrs(judged_fraction=fraction))
    np.testing.assert_array_equal(found[1], expected[1])


def test_a_belt_at_rest_is_drawn_at_rest(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 1)
    titles, at_rest = [], history()
    at_rest["displacement"][:] = 0.0
    monkeypatch.setattr(Axes, "set_title", lambda axes, text, **options: titles.append(text))
    draw_animation(at_rest, tmp_path / "belt.gif")
    assert "at most 0 µm" in titles[0]


def test_a_scale_tells_how_large_the_motion_is_drawn(tmp_path, monkeypatch):
    """Of 20 um and some more, by the spline between the samples: a bar of 20 um, magnified as the belt is."""
    monkeypatch.setattr(animation, "FRAMES", 1)
    scales = []
    monkeypatch.setattr(animation, "_draw_scale", lambda axes, size, factor: scales.append((size, factor)))
    draw_animation(history(), tmp_path / "belt.gif")
    ((size, factor),) = scales
    assert factor * size == pytest.approx(animation.LARGEST * POINT["centre_distance"])
    monkeypatch.undo()
    axes = Figure().subplots()
    axes.set(xlim=(0.0, 300.0), ylim=(0.0, 100.0))
    animation._draw_scale(axes, 37e-6, 500.0)
    (bar,), (text,) = axes.lines, axes.texts
    assert text.get_text() == "20 µm of motion"
    assert np.ptp(bar.get_xdata()) == pytest.approx(1e3 * 500.0 * 20e-6) and np.ptp(bar.get_ydata()) == 0.0
    animation._draw_scale(axes, 1.5e-3, 10.0)
    assert axes.texts[-1].get_text() == "1 mm of motion"


def test_a_belt_drive_moves_on_its_pulleys(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 1)
    lists = {f"pulley_{name}": [] for name in ("x", "y", "radius", "turn", "inertia", "load")}
    point = POINT | lists | {"driven_inertia": 0.01, "crossed": True}
    path = draw_animation(history().assign_attrs(point=json.dumps(point)), tmp_path / "belt.gif")
    assert path.stat().st_size > 0


def test_a_name_is_no_formula(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 1)
    draw_animation(history().assign_attrs(job_name=r"$\frac{1$"), tmp_path / "belt.gif")


def without_a_number():
    run = history()
    run["displacement"][3, 2] = np.nan
    return run


def test_a_moving_picture_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", FEW)
    with Image.open(draw_animation(history(), tmp_path / "belt.gif")) as picture:
        assert picture.n_frames == PERIODS * FEW
    assert [path.name for path in tmp_path.iterdir()] == ["belt.gif"]
    assert (tmp_path / "belt.gif").stat().st_size < 1e6


def test_a_moving_picture_is_written_as_mp4(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", FEW)
    if (ffmpeg := animation.encoder()) is None:
        pytest.skip("no ffmpeg here")
    out = draw_animation(history(), tmp_path / "belt.mp4")
    told = subprocess.run(
        [ffmpeg, "-i", out, "-map", "0:v", "-f", "null", "-"], capture_output=True, text=True, check=True
    )
    frames = re.findall(r"frame= *(\d+)", told.stderr)
    assert int(frames[-1]) == PERIODS * FEW and "Video: h264" in told.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["belt.mp4"]


def test_without_an_encoder_mp4_is_refused_with_what_brings_one(tmp_path, monkeypatch):
    monkeypatch.setattr(animation.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r'found none on this machine; .*pip install "cvt_hpc\[mp4\]"'):
        draw_animation(history(), tmp_path / "belt.mp4")


@pytest.mark.parametrize(
    ("made", "name", "told"),
    [
        (history, "belt.png", "expected a moving picture: .gif, .mp4"),
        (lambda: history().drop_attrs(), "belt.gif", "expected the history of a run of a variator"),
        (lambda: history().drop_vars("displacement"), "belt.gif", "with displacement at probes"),
        (
            lambda: history().assign_attrs(point="[" * 100_000),
            "belt.gif",
            "the history of a run of a variator",
        ),
        (
            lambda: history().assign_attrs(point=json.dumps(POINT | {"ratio": -1.0})),
            "belt.gif",
            "the history of a run of a variator",
        ),
        (lambda: history().isel(time=slice(1)), "belt.gif", "finite displacements at 8 times at least"),
        (without_a_number, "belt.gif", "finite displacements"),
        (
            lambda: xr.Dataset(attrs={"point": "[]"}),
            "belt.gif",
            "expected the history of a run of a variator",
        ),
    ],
)
def test_what_cannot_be_drawn_is_refused(made, name, told, tmp_path):
    with pytest.raises(InputError, match=told):
        draw_animation(made(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []
