"""The vibrating belt as a moving picture, magnified, with its scale."""

import shutil
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cvt_hpc.analysis.figures import STYLE, as_written
from cvt_hpc.analysis.on_variator import Drive, draw_pulleys, run_geometry
from cvt_hpc.errors import mismatch, one_line
from cvt_hpc.physics.belt_path import points_at
from cvt_hpc.storage.files import written_aside

FORMATS = (".gif", ".mp4")
PERIODS, FRAMES = 2, 24  # of the vibration, and pictures of each
LEAST_SAMPLES = 8  # of which a period and splines can be had
RATE = 12  # pictures a second: a period takes two seconds
LARGEST = 0.12  # of the distance of the shafts: the largest displacement that is drawn
PLACES = 400  # along the belt
BELT, REST, INK = "#d55e00", "#8a8a8a", "#333333"


def check_animation(out: Path) -> None:
    """Raise InputError unless the suffix names a moving picture that this machine can write."""
    if out.suffix.lower() not in FORMATS:
        raise mismatch(str(out), f"a moving picture: {', '.join(FORMATS)}", out.suffix or "no suffix")
    if out.suffix.lower() == ".mp4" and encoder() is None:
        then = 'install ffmpeg, or `pip install "cvt_hpc[mp4]"`, which brings one'
        raise mismatch(str(out), "ffmpeg, which writes .mp4, or a name in .gif", "none on this machine", then)


def encoder() -> str | None:
    """The program ffmpeg, that of this machine or of the package imageio-ffmpeg; None where there is none."""
    if found := shutil.which("ffmpeg"):
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return None


@dataclass(frozen=True)
class Animation:
    """A moving picture: notebooks show it, and `save` writes it."""

    figure: Figure  # with the first picture
    draw: Callable[[int], tuple]  # puts the picture of a number into it, and returns what has changed
    frames: int  # number of pictures

    def save(self, out: str | Path) -> Path:
        """Write it, with a name in .gif, or in .mp4 where there is ffmpeg; its folder is made if needed.

        InputError if the suffix names no moving picture, there is no ffmpeg for .mp4, or the system refuses.
        """
        out = Path(out)
        check_animation(out)
        moving = FuncAnimation(self.figure, self.draw, frames=self.frames, blit=False)
        writer = PillowWriter(RATE) if out.suffix.lower() == ".gif" else FFMpegWriter(RATE)
        settings = {**STYLE, "animation.ffmpeg_path": encoder() or "ffmpeg"}
        with matplotlib.rc_context(settings), written_aside(out, parents=True) as aside:
            named = aside.with_name(f"{aside.name}{out.suffix.lower()}")  # the writer goes by the suffix
            try:
                moving.save(named, writer=writer, dpi=100)
                named.replace(aside)
            finally:
                named.unlink(missing_ok=True)
        return out

    def _repr_html_(self) -> str:
        with TemporaryDirectory() as folder:
            picture = b64encode(self.save(Path(folder) / "belt.gif").read_bytes()).decode()
        return f'<img alt="the vibrating belt" src="data:image/gif;base64,{picture}">'


def draw_animation(history: xr.Dataset, out: Path, source: str = "history") -> Path:
    """Write the moving picture of `animation`, with its errors, as `Animation.save` does."""
    check_animation(Path(out))
    return animation(history, source).save(out)


def animation(history: xr.Dataset, source: str = "history") -> Animation:
    """Compose a moving picture of the belt in the last periods of a run, magnified.

    Arguments as of all pictures of runs (`figures.py`); the run is that of a variator or of a belt drive,
    with `displacement` [m] over `time` and `probe`, and `probe_position` [m].
    """
    drive = _geometry(history, source)
    # probes of the motion out of the plane lie behind those in it, at the same places
    _, in_plane = np.unique(history["probe_position"].values, return_index=True)
    history = history.isel(probe=np.sort(in_plane))
    time, motion, period = _last_periods(history)
    size = float(np.abs(motion).max())
    factor = LARGEST * drive.size / size if size else 0.0
    length = drive.path.path_length
    places = np.linspace(0.0, length, PLACES)
    rest, angle, _ = points_at(drive.path, places)
    normal = np.stack([np.sin(angle), -np.cos(angle)], 1)  # outwards
    shapes = _along_belt(history, motion, places, length)
    with matplotlib.rc_context(STYLE):
        figure = Figure((6.4, 3.9), layout="constrained")
        axes = figure.subplots()
        draw_pulleys(axes, drive)
        axes.plot(*(1e3 * rest.T), color=REST, lw=0.8, ls="--")
        (belt,) = axes.plot(*(1e3 * rest.T), color=BELT, lw=2.0)
        margin = 1.3e3 * LARGEST * drive.size
        axes.set_xlim(1e3 * rest[:, 0].min() - margin, 1e3 * rest[:, 0].max() + margin)
        axes.set_ylim(1e3 * rest[:, 1].min() - margin, 1e3 * rest[:, 1].max() + margin)
        name = one_line(str(history.attrs.get("job_name", "")))
        size_told = f"at most {1e6 * size:.3g} µm, drawn {factor:.0f} times as large"
        axes.set_title(f"{name}: {1.0 / period:.0f} Hz, {size_told}".removeprefix(": "), fontsize=10)
        if size:
            _draw_scale(axes, size, factor)
        clock = axes.text(0.99, 0.02, "", transform=axes.transAxes, ha="right", fontsize=9)

        as_written(figure).draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once, for all pictures

        def draw(frame: int) -> tuple:
            moved = rest + factor * shapes[frame][:, None] * normal
            belt.set_data(*(1e3 * moved.T))
            clock.set_text(f"{1e3 * (time[frame] - time[0]):.2f} ms")
            return belt, clock

        return Animation(figure, draw, len(time))


def _draw_scale(axes: Axes, size: float, factor: float) -> None:
    """Draw the round length of a displacement as it is magnified, the largest below `size` [m], with caps."""
    decade = 10.0 ** np.floor(np.log10(size))
    shown = max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= size)
    long, (left, right), (low, high) = 1e3 * factor * shown, axes.get_xlim(), axes.get_ylim()
    apart = 0.02 * (right - left)
    x, y = left + apart, low + 0.06 * (high - low)
    axes.plot([x, x + long], [y, y], color=INK, lw=1.5, marker="|", ms=7)
    unit, per = ("mm", 1e3) if shown >= 1e-3 else ("µm", 1e6)
    axes.text(x + long + apart, y, f"{per * shown:.3g} {unit} of motion", va="center", fontsize=9)


def _geometry(history: xr.Dataset, source: str) -> Drive:
    """Pulleys and path of the belt of a run whose motion can be drawn."""
    found = run_geometry(history)
    if found is None or not {"displacement", "probe_position"} <= {*map(str, history.variables)}:
        expected = "the history of a run of a variator or belt drive, with displacement at probes"
        raise mismatch(source, expected, "another")
    if history.sizes["time"] < LEAST_SAMPLES or not np.isfinite(history["displacement"]).all():
        expected = f"finite displacements at {LEAST_SAMPLES} times at least"
        raise mismatch(source, expected, f"{history.sizes['time']} times, or others")
    return found


def _last_periods(history: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Times [s] of the pictures, the motion at them about its mean (time, probe) [m], and the period [s]."""
    time = history["time"].values
    motion = history["displacement"].transpose("time", "probe").values
    judged = motion[-max(int(_judged_fraction(history) * len(time)), LEAST_SAMPLES) :]
    motion = motion - judged.mean(0)
    period = 1.0 / (_recorded_frequency(history) or _main_frequency(time, judged))
    shown = np.linspace(max(time[-1] - PERIODS * period, time[0]), time[-1], PERIODS * FRAMES)
    return shown, CubicSpline(time, motion)(shown), period


def _recorded_frequency(history: xr.Dataset) -> float:
    """Return the frequency [Hz] that the run's record has of the strongest strand; 0 where it has none."""
    if "frequency" not in history or "amplitude" not in history:
        return 0.0
    pairs = zip(history["amplitude"].values, history["frequency"].values, strict=True)
    found = [pair for pair in pairs if np.isfinite(pair[0]) and 0.0 < pair[1] < np.inf]
    return float(max(found, default=(0.0, 0.0))[1])


def _main_frequency(time: NDArray[np.float64], judged: NDArray[np.float64]) -> float:
    """Return the frequency [Hz] of the highest line of the strongest probe's spectrum."""
    strongest = int(np.abs(judged - judged.mean(0)).max(0).argmax())
    signal = judged[:, strongest] - judged[:, strongest].mean()
    interval = float(np.diff(time).mean())
    spectrum = np.abs(np.fft.rfft(signal * np.hanning(signal.size)))
    return float(np.fft.rfftfreq(signal.size, interval)[int(spectrum[1:].argmax()) + 1])


def _judged_fraction(history: xr.Dataset) -> float:
    """Return the last part of the run that was judged; a half where the history has no such number."""
    try:
        fraction = float(history.attrs.get("judged_fraction", 0.5))
    except (TypeError, ValueError):
        return 0.5
    return fraction if 0.0 < fraction <= 1.0 else 0.5


def _along_belt(
    history: xr.Dataset, motion: NDArray[np.float64], places: NDArray[np.float64], length: float
) -> NDArray[np.float64]:
    """Displacement (time, place) between the probes, by a periodic spline around the belt [m]."""
    position = history["probe_position"].values
    order = np.argsort(position)
    closed = np.append(position[order], position[order[0]] + length)
    values = np.concatenate([motion[:, order], motion[:, order[:1]]], 1)
    spline = CubicSpline(closed, values, axis=1, bc_type="periodic")
    return spline(closed[0] + np.mod(places - closed[0], length))
