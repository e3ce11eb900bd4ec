"""Signals over time of a kept run, their levels in dB and their third octaves.

Signals are motion of the belt, speeds, torques and forces; what a casing radiates is no part of any model
here. The force of the belt on a shaft follows from both strands: with the tension T of the rings, the push
force P and the flux of momentum m u^2 it is the sum of T - P - m u^2 along both strands, away from the
pulley. This is the balance of momentum of the pulley with the belt on its arc. It leaves out what the belt on
the arc stores of momentum, and what the ends of a swinging strand pull across it.

A level is 20 log10 of the rms over its reference: 1 um of a displacement, 1 mm/s of a velocity, else the unit
of the quantity. Bands are those of IEC 61260-1:2014 to base ten: centres 1000 Hz 10^(x/10), edges 10^(+-1/20)
times the centre.
"""

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.histories import settings_of
from cvt_hpc.analysis.telling_apart import entitle_runs, named, told_apart
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.physics.geometry import variator
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.vibration.settings import SHORTEST_SEGMENT
from cvt_hpc.vibration.signals import DRIFT_DEGREE

Array = NDArray[np.float64]

SHAFT_FORCES = tuple(f"shaft_force_{pulley}_{side}" for pulley in PULLEYS for side in "yz")
NEEDED = (
    "push force and ring tension of both strands over time: of a pushbelt, or of an elastic belt with "
    "[record] profile_duration"
)
REFERENCES = {"m": (1e-6, "µm"), "m s-1": (1e-3, "mm/s")}
NOMINAL = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)  # of the ten bands of a decade
_LEAST_LINES = 4  # of the spectrum in a band: Hann's main lobe between its zeros
DEEPEST = 80.0  # [dB] below the highest band, that are drawn
_HEIGHTS = 1.5, 2.5  # [inch]: a panel, at least and else


class Signal(NamedTuple):
    """A quantity over time."""

    name: str  # such as "displacement t1 1/2"
    unit: str  # such as "m"
    times: Array  # (n,) [s], evenly spaced
    values: Array  # (n,) in the unit
    judged: int  # first sample of the part that is judged

    @property
    def rate(self) -> float:
        """Of samples [Hz]."""
        return float((self.times.size - 1) / np.ptp(self.times))

    @property
    def words(self) -> str:
        """Name for a picture."""
        return self.name.removeprefix("displacement ").replace("_", " ")

    @property
    def vibration(self) -> Array:
        """The judged part less its mean and slow drift, a cubic."""
        part = self.values[self.judged :]
        at = np.linspace(-1.0, 1.0, part.size)
        return part - np.polynomial.Polynomial.fit(at, part, DRIFT_DEGREE)(at)


class Bands(NamedTuple):
    """Third octaves of a signal by their numbers x (band,), with the rms (band,) of each and its unit."""

    numbers: NDArray[np.int64]
    rms: Array
    unit: str


def known_signals(history: xr.Dataset) -> list[str]:
    """Names of the signals that a history holds over `time`, the forces on shafts included."""
    courses = [str(name) for name, values in history.items() if values.dims == ("time",)]
    forces = SHAFT_FORCES if [one.dims for one in _net_forces(history)][:1] == [("time",)] else ()
    return [*_probes(history), *courses, *forces]


def read_signal(history: xr.Dataset, of: str, source: str = "history", *, velocity: bool = False) -> Signal:
    """Read a signal, as far as its values are finite.

    Parameters
    ----------
    history, source
        As of all pictures of runs (`figures.py`); InputError unless it has the signal, and enough of it.
    of : str
        A probe, as "t1 1/2"; a strand, for the probe of it that moves most in the judged part; a variable
        over time; or one of SHAFT_FORCES [N]: y from the driving to the driven shaft, z across, t2's side.
    velocity : bool
        Whether it has to be a displacement, as its velocity is wanted.
    """
    probes = _probes(history)
    if of in STRANDS and (places := [name for name in probes if name.split()[0] == of]):
        signals = [read_signal(history, name, source) for name in places]
        return max(signals, key=lambda one: float(one.vibration.std()))
    if of in probes:
        name, array = f"displacement {of}", history["displacement"].isel(probe=probes.index(of))
    elif of in SHAFT_FORCES:
        name, array = of, _shaft_force(history, of, source)
    elif of in history and history[of].dims == ("time",):
        name, array = of, history[of]
    else:
        raise unknown(f"{source}: {of}", "signal", of, known_signals(history))
    unit, (axis,) = str(array.attrs.get("units", "1")), array.dims
    if velocity and unit != "m":
        raise mismatch(f"{source}: {name}", "a displacement [m] for a velocity", f"one in {unit}")
    values, times = np.asarray(array.values, float), np.asarray(history[axis].values, float)
    finite = np.isfinite(values)
    count = values.size if finite.all() else int(np.argmin(finite))
    share = settings_of(history)[0]["judged_fraction"]
    judged = int(np.searchsorted(times[:count], (1.0 - share) * times[count - 1])) if count else 0
    if count - judged < SHORTEST_SEGMENT:
        raise mismatch(f"{source}: {of}", f"{SHORTEST_SEGMENT} judged samples or more", str(count - judged))
    return Signal(name, unit, times[:count], values[:count], judged)


def _probes(history: xr.Dataset) -> list[str]:
    if "displacement" not in history or history["displacement"].dims != ("time", "probe"):
        return []
    return [str(name) for name in history["probe"].values]


def _net_forces(history: xr.Dataset) -> list[xr.DataArray]:
    """Ring tension less push force of t1 and t2 over time [N]; empty where they are not known."""
    names = [[f"{name}_{strand}" for strand in STRANDS] for name in ("ring_tension", "push_force")]
    if all(name in history for pair in names for name in pair):
        return [history[tension] - history[push] for tension, push in zip(*names, strict=True)]
    momentary = [f"momentary_{name}" for name in ("ring_tension", "push_force")]
    if not {*momentary, "region"} <= {*map(str, history.variables)}:
        return []
    net, found = history[momentary[0]] - history[momentary[1]], []
    for strand in STRANDS:
        places = np.flatnonzero(history["region"].values.astype(str) == strand)
        quarter = places.size // 4
        found.append(net.isel(position=places[quarter : places.size - quarter]).mean("position"))
    return found


def _shaft_force(history: xr.Dataset, of: str, source: str) -> xr.DataArray:
    """One of SHAFT_FORCES over time."""
    if not (net := _net_forces(history)):
        raise mismatch(f"{source}: {of}", NEEDED, "none")
    point = json.loads(history.attrs.get("point", "{}"))
    try:
        path = variator(*(point[key] for key in ("ratio", "driven_radius", "centre_distance")))
        mass = point["element_mass"] + point["ring_mass"]
    except (KeyError, TypeError, ValueError):
        expected = "a run with ratio, driven_radius, centre_distance, element_mass and ring_mass"
        raise mismatch(f"{source}: {of}", expected, "another one") from None
    times = history[str(net[0].dims[0])].values
    speed = path.driving_radius * np.interp(times, history["time"].values, history["driving_speed"].values)
    t1, t2 = (force - mass * speed**2 for force in net)
    tilt = 0.5 * (path.driven_wrap - np.pi)  # t1, the lower strand, runs downwards for it > 0
    along = (t1 + t2) * np.cos(tilt) if of.endswith("y") else (t2 - t1) * np.sin(tilt)
    return (along if "driving" in of else -along).assign_attrs(units="N")


def shown_in(unit: str) -> tuple[float, str]:
    """Reference of a quantity with this SI unit, in which its amplitudes are shown, and its name."""
    return REFERENCES.get(unit, (1.0, "" if unit == "1" else figures.as_fraction(unit)))


def level(rms: ArrayLike, unit: str) -> Array:
    """Level of an rms [dB re the reference of its unit]; -inf of zero."""
    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(np.asarray(rms, float) / shown_in(unit)[0]), float)


def level_label(unit: str) -> str:
    """Label of an axis of levels."""
    return f"RMS level [dB re 1{' ' * bool(name := shown_in(unit)[1])}{name}]"


def centre(number: ArrayLike) -> Array:
    """Centre of a third octave [Hz] by its number x."""
    return 1000.0 * 10.0 ** (np.asarray(number, float) / 10.0)


def nominal(number: int) -> str:
    """Nominal centre of a third octave [Hz], as "1250"."""
    return f"{NOMINAL[number % 10] * 10.0 ** (3 + number // 10):g}"


def third_octaves(values: ArrayLike, rate: float, unit: str = "1", *, velocity: bool = False) -> Bands:
    """Sum the power of a signal (time,), sampled at a rate [Hz], in third octaves.

    The power density of one Hann window over the whole signal is constant within 1/2 line about each line; a
    band has the parts of lines that lie in it. So all bands together have the power between the outer edges.
    Of the velocity of a displacement it is (2 pi f)^2 times as large.

    Returns
    -------
    Bands
        Those of _LEAST_LINES lines or more, below half the sampling rate. A steady sine of amplitude A has
        the rms A / sqrt(2) in its band, less what lies beyond an edge within two lines.
    """
    from scipy.signal import periodogram  # scipy.signal takes long to load

    lines, density = periodogram(values, rate, "hann")
    if velocity:
        density = density * (2.0 * np.pi * lines) ** 2
    width, half = lines[1], 10.0**0.05
    first = np.ceil(10.0 * np.log10(_LEAST_LINES * width / (half - 1.0 / half) / 1000.0) - 1e-9)
    last = np.floor(10.0 * np.log10(0.5 * rate / half / 1000.0) + 1e-9)
    numbers = np.arange(int(first), int(last) + 1)
    borders = np.append(lines - 0.5 * width, lines[-1] + 0.5 * width)
    power = np.append(0.0, np.cumsum(density) * width)
    edges = centre(np.append(numbers, numbers[-1:] + 1)) / half
    powers = np.diff(np.interp(edges, borders, power))
    return Bands(numbers, np.sqrt(powers), "m s-1" if velocity else unit)


@figures.styled
def third_octaves_figure(
    histories: Sequence[xr.Dataset],
    quantities: Sequence[str] = STRANDS,
    sources: Sequence[str] = (),
    velocity: bool = False,
) -> Figure:
    """Draw third-octave levels of the judged part: a panel for each signal, a line for each run.

    Arguments as of all pictures of runs (`figures.py`). `quantities` are signals as of `read_signal`; of
    displacements `velocity` gives levels of their velocities.
    """
    names = named(histories, sources)
    figure, panels = in_a_column(len(quantities), names[0], "name fewer quantities")
    _, labels = told_apart(histories, names)
    for axes, of in zip(panels, quantities, strict=True):
        kinds: list[str] = []
        for k, (history, name, label) in enumerate(zip(histories, names, labels, strict=True)):
            signal = read_signal(history, of, name, velocity=velocity)
            bands = third_octaves(signal.vibration, signal.rate, signal.unit, velocity=velocity)
            if not bands.numbers.size:
                expected = "a judged part long enough for a third octave"
                raise mismatch(f"{name}: {signal.name}", expected, "a shorter one")
            kinds.append(signal.words)
            _draw_bands(axes, bands, k, f"{label}, " if len(histories) > 1 else "")
        low, high = axes.dataLim.intervalx
        numbers = np.arange(low + 0.5, high)
        figures.put_ticks(axes.xaxis, numbers, [nominal(int(number)) for number in numbers])
        cut_off(axes)
        axes.set(xlim=(low, high), ylabel=level_label(bands.unit))
        axes.set_title(f"{'velocity of ' * velocity}{' and '.join(dict.fromkeys(kinds))}", loc="left")
        axes.legend(loc="best")
    panels[-1].set_xlabel("nominal centre of the third octave [Hz]")
    note = "judged part, Hann window; not of radiated sound, since no casing is modelled"
    entitle_runs(figure, histories, "Third octaves", note, width=72)
    return figure


def _draw_bands(axes: Axes, bands: Bands, k: int, told: str) -> None:
    """Levels of the k-th run as steps over the bands, with the level of all bands together."""
    style, total = figures.line_style(k), float(level(np.hypot.reduce(bands.rms), bands.unit))
    levels, edges = level(bands.rms, bands.unit), np.append(bands.numbers, bands.numbers[-1] + 1) - 0.5
    shown = np.where(np.isfinite(levels), levels, np.nan)
    label = f"{told}all bands {figures.number(total, '.1f')} dB"
    axes.stairs(shown, edges, baseline=None, color=style["color"], ls=style["ls"], lw=1.4, label=label)


def in_a_column(count: int, source: str, then: str, **sharing: Any) -> tuple[Figure, figures.Panels]:
    """Figure with panels below each other; InputError, with what to do `then`, if no page holds them."""
    figure, panels, _ = figures.panels_on_a_page(count, (1,), _HEIGHTS, 1.5, source, then, **sharing)
    for axes in panels.flat:
        axes.grid(lw=0.4, alpha=0.5)
    return figure, panels[:, 0]


def cut_off(axes: Axes) -> None:
    """Let an axis of levels, or one of amplitudes on decades, end DEEPEST below its upper end."""
    low, high = axes.get_ylim()
    is_log = axes.get_yscale() == "log"
    axes.set_ylim(max(low, high * 10.0 ** (-DEEPEST / 20.0) if is_log else high - DEEPEST))
