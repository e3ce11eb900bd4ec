"""Quantities along the belt drawn on the variator, and the powers in and out around it.

The power balance of a run says what the pulleys put in and take out, and where the rest goes.
"""

import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.cells import colours_of
from cvt_hpc.analysis.followed_drawing import lengths_of
from cvt_hpc.analysis.history_panels import FEEDS
from cvt_hpc.analysis.profiles import check_along_belt, regions, shown_unit
from cvt_hpc.analysis.telling_apart import entitle_runs
from cvt_hpc.errors import mismatch
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.physics.belt_path import BeltPath, belt_path, points_at
from cvt_hpc.variator import PULLEYS, STRANDS

_IN, OUT, LOST, KEPT = "#0072b2", "#d55e00", "#8a8a8a", "#e4e8ec"
_KILOWATTS = 1e4  # [W]: from here on powers are in kW

DEFAULT = "push_force", "tension"  # what is drawn, the first that there is
_PULLEY, INK = "#e4e8ec", "#333333"
LARGEST = 0.16  # of the largest distance of two shafts: the longest bar
ONE_SIGN, TWO_SIGNS = colours_of("viridis_r", 0.05, 0.95), colours_of("PuOr", 0.02, 0.98)
_HATCHES = ("", "///", "...")
_NAMED_AT, INSIDE = 0.35, 0.36  # of a strand, and of the smallest radius: where its name stands
NEAREST, NEAR = 0.75, 0.05  # of the way to the line of centres; of the path, bars beside a name
PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0}  # under names on bars
LEAST, HEIGHT, FRAME = 1.6, 3.1, 0.7  # [inch]: a variator, and what stands above all
_BALANCE, _WHOLE_BELT = 1.3, "#8a8a8a"  # [inch]: what goes in and out; colour of what has no region
_WATTS = 0.02  # of the largest bar: what is smaller has no number


class Drive(NamedTuple):
    """The pulleys of a run and its belt, as they are drawn."""

    path: BeltPath  # tensioners stand as at rest
    pulleys: tuple[str, ...]  # names
    strands: tuple[str, ...]  # likewise; a strand is behind its pulley

    @property
    def size(self) -> float:
        """Largest distance of two shafts [m]."""
        centre = self.path.centre
        return float(np.hypot(*(centre[:, None] - centre).T).max())


def run_geometry(history: xr.Dataset) -> Drive | None:
    """The drive of a run: a variator, or a belt drive of any number of pulleys; None of another run."""
    try:
        point = json.loads(history.attrs["point"])
        if "pulley_x" in point:
            drawn = layout(point)
            return Drive(drawn.path, drawn.pulleys, drawn.spans)
        ratio, driven, distance = (float(point[key]) for key in ("ratio", "driven_radius", "centre_distance"))
        if not all(0.0 < value < np.inf for value in (ratio, driven, distance)):
            return None
        centre = np.array([[0.0, 0.0], [distance, 0.0]])
        return Drive(belt_path(centre, np.array([driven / ratio, driven]), np.ones(2)), PULLEYS, STRANDS)
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, RecursionError):
        return None


def draw_pulleys(axes: Axes, drive: Drive, inwards: Sequence[float] = (0.0, 0.0)) -> None:
    """Draw all pulleys, their names, and those of two strands [mm], clear of bars that reach inwards [m]."""
    path, named = drive.path, {"ha": "center", "va": "center", "fontsize": 9, "zorder": 5}
    for centre, radius, name in zip(1e3 * path.centre, 1e3 * path.radius, drive.pulleys, strict=True):
        axes.add_patch(Circle(tuple(centre), radius, color=_PULLEY, zorder=0))
        axes.text(*centre, name, **named, bbox=PAPER | {"facecolor": _PULLEY})
    for name, at, depth in zip(drive.strands, _named_at(drive), inwards, strict=False):
        place, angle, _ = points_at(path, np.array([at]))
        most = NEAREST * abs(place[0, 1] - path.centre[:, 1].mean())
        off = min(INSIDE * path.radius.min() + depth, most) * np.array([-np.sin(angle[0]), np.cos(angle[0])])
        axes.text(*(1e3 * (place[0] + off)), name, **named, bbox=PAPER)
    axes.set(aspect="equal", xlabel="y [mm]", ylabel="z [mm]")


def _named_at(drive: Drive) -> list[float]:
    """Path coordinates of the names of two strands [m], both nearer to the driving pulley.

    Names such as P1-P2 of more strands follow from those of the pulleys.
    """
    path, shares = drive.path, (_NAMED_AT, 1.0 - _NAMED_AT) if len(drive.strands) == 2 else ()
    return [float(path.ends[2 * k] + share * path.spans[k]) for k, share in enumerate(shares)]


@figures.styled
def variator_figure(history: xr.Dataset, quantities: Sequence[str] = (), source: str = "history") -> Figure:
    """Draw quantities along the belt on the variator: the belt by colour, and bars outwards from it.

    Arguments as of all pictures of runs (`figures.py`); the run is that of a variator or of a belt drive.
    `quantities` are variables over `position` [m], such as forces, sliding and power; each has a panel.
    Negative values point inwards. By default the push force, or the tension of a belt without one.
    """
    found = run_geometry(history)
    if found is None or "position" not in history.coords:
        raise mismatch(source, "the history of a run of a variator or belt drive, over position", "another")
    quantities = quantities or [next((name for name in DEFAULT if name in history), DEFAULT[0])]
    check_along_belt(history, quantities, source)
    page = len(quantities), (1, 2), (LEAST, HEIGHT), FRAME, source, "name fewer quantities"
    figure, panels, _ = figures.panels_on_a_page(*page)
    for axes, name in zip(panels.flat, quantities, strict=False):
        _draw_belt(figure, axes, history[name], found)
    entitle_runs(figure, [history], "On the pulleys", width=72)
    return figure


def _draw_belt(figure: Figure, axes: Axes, array: xr.DataArray, drive: Drive) -> None:
    """The belt in colours, with a bar at each station; of what is not known there is a thin line."""
    factor, unit = shown_unit(array)
    values = factor * array.values
    position = array["position"].values
    points, angle, _ = points_at(drive.path, position)
    points = 1e3 * points
    outwards = np.stack([np.sin(angle), -np.cos(angle)], 1)
    closed = np.vstack([points, points[:1]])
    axes.plot(*closed.T, color="#8a8a8a", lw=0.8, zorder=1)
    is_known = np.isfinite(values)
    largest = float(np.abs(values[is_known]).max(initial=0.0)) or 1.0
    both = bool((values[is_known] < 0.0).any())
    near = [is_known & (np.abs(position - at) < NEAR * drive.path.path_length) for at in _named_at(drive)]
    longest = LARGEST * drive.size / largest
    draw_pulleys(axes, drive, [longest * float(np.max(-values[here], initial=0.0)) for here in near])
    norm = TwoSlopeNorm(0.0, -largest, largest) if both else Normalize(0.0, largest)
    ends = points + (1e3 * longest * np.where(is_known, values, 0.0))[:, None] * outwards
    colours = TWO_SIGNS if both else ONE_SIGN
    style = {"cmap": colours, "norm": norm, "array": values[is_known]}
    bars = np.stack([points, ends], 1)[is_known]
    axes.add_collection(LineCollection(list(bars), linewidths=2.0, **style, zorder=2))
    belt = np.stack([closed[:-1], closed[1:]], 1)[is_known]
    drawn = axes.add_collection(LineCollection(list(belt), linewidths=4.0, **style, zorder=3))
    axes.plot(*np.vstack([ends, ends[:1]]).T, color=INK, lw=0.7, zorder=4)  # readable in grey
    margin = 1.15e3 * LARGEST * drive.size
    for column, set_limits in enumerate((axes.set_xlim, axes.set_ylim)):
        set_limits(points[:, column].min() - margin, points[:, column].max() + margin)
    figure.colorbar(drawn, ax=axes, label=figures.axis_label(array, unit), pad=0.02)


def region_powers(history: xr.Dataset) -> xr.DataArray:
    """Return the power fed into the fluctuations over `cause` and `region` of the belt [W]; negative: taken.

    It is the sum over the stations of `flank_feed`, `stress_feed` and `damping_feed` [W/m], of which those
    without a finite value are left out.
    """
    lengths, region = lengths_of(history), history["region"].values.astype(str)
    names = [name for _, _, name in regions(history)]
    causes = [name for name in FEEDS if name in history and np.isfinite(history[name]).all()]
    powers = [[float((lengths * history[c].values)[region == name].sum()) for name in names] for c in causes]
    shape = np.reshape(powers, (len(causes), len(names)))
    return xr.DataArray(shape, {"cause": causes, "region": names}, ("cause", "region"), attrs={"units": "W"})


@figures.styled
def energy_figure(history: xr.Dataset, source: str = "history") -> Figure:
    """Draw what the pulleys put in and take out, what is lost, and what feeds the vibration [W].

    Arguments as of all pictures of runs (`figures.py`), with what `_balance_of` takes, `part_flank_loss` [W]
    over `pulley` and `arc_part`, or what `region_powers` takes.
    """
    powers = region_powers(history) if {"position", "region"} <= {*map(str, history.coords)} else None
    has_feeds = powers is not None and powers.sizes["cause"] > 0
    has_loss = "part_flank_loss" in history and bool(np.isfinite(history["part_flank_loss"]).any())
    balance = _balance_of(history)
    heights = [_BALANCE, 0.7 + 0.18 * balance.bars] if balance else []
    heights += [2.1] * (has_feeds + has_loss)
    if not heights:
        needed = "driving_power, flank_feed or part_flank_loss, known at constant load and speed"
        raise mismatch(source, f"a history with {needed}", "none that is known")
    figure = Figure((figures.WIDTH, sum(heights) + 0.9), layout="constrained")
    panels = list(figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0])
    if balance is not None:
        _draw_balance(panels.pop(0), panels.pop(0), balance)
    if has_loss:
        axes, loss = panels.pop(0), history["part_flank_loss"].transpose("pulley", "arc_part")
        count = loss.sizes["arc_part"]
        labels = [f"{pulley}\n{k + 1}/{count}" for pulley in loss["pulley"].values for k in range(count)]
        colours = np.repeat(["#0072b2", "#d55e00"], count)[: loss.size]
        bars = axes.bar(labels, loss.values.ravel(), 0.7, color=colours, edgecolor=INK, lw=0.6)
        axes.bar_label(bars, fmt="{:.3g}", fontsize=8, padding=1)
        axes.set_title("out: friction of the flanks, by quarter of the arc from its inlet", loc="left", pad=4)
        axes.margins(y=0.15)
        axes.set_ylabel("power [W]")
    if has_feeds and powers is not None:
        _draw_feeds(panels[0], powers, _whole_powers(history))
    entitle_runs(figure, [history], "Energy around the belt", width=72)
    return figure


def _whole_powers(history: xr.Dataset) -> dict[str, float]:
    """Further powers of the whole belt's fluctuations [W] by name; negative: taken.

    With what `region_powers` sums up it is 0. "left open" is what the numerics, and a vibration that still
    grows or decays, leave over. Empty where a term is not known.
    """
    taken = {"layer_taken": "layer\ndampers", "lag_taken": "sheave\nlag"}
    taken |= {"carried_power": "mean\nmotion", "fluctuation_remainder": "left\nopen"}
    found = {words: -float(history.get(name, np.nan)) for name, words in taken.items()}
    return found if np.isfinite(list(found.values())).all() else {}


def _draw_feeds(axes: Axes, powers: xr.DataArray, whole: dict[str, float]) -> None:
    """Bars of each cause in each region, into the vibration above zero and out of it below; then the rest."""
    names, causes = [*powers["region"].values, *whole], powers["cause"].values
    places, width = np.arange(len(names)), 0.8 / max(causes.size, 1)
    regions = powers.sizes["region"]
    largest = max([float(np.abs(powers.values).max()), *map(abs, whole.values())]) or 1.0
    drawn: list[tuple[np.ndarray, np.ndarray, tuple[str, str], int]] = [
        (places[:regions] + (k - 0.5 * (causes.size - 1)) * width, powers.values[k], FEEDS[str(cause)][:2], k)
        for k, cause in enumerate(causes)
    ]
    if whole:
        drawn.append((places[regions:], np.array(list(whole.values())), ("whole belt", _WHOLE_BELT), 0))
    for at, values, (label, colour), k in drawn:
        least = _WATTS * largest if at[0] < regions - 0.5 else 0.0
        style = {"color": colour, "edgecolor": "#ffffff", "hatch": _HATCHES[k % len(_HATCHES)], "lw": 0.6}
        bars = axes.bar(at, values, 0.9 * width, label=label, **style)
        texts = [figures.number(p, "+.2g") if abs(p) > least else "" for p in values]
        axes.bar_label(bars, texts, fontsize=8, padding=1)
    axes.axhline(0.0, color=INK, lw=0.8)
    told = "0 W with what is left open" if whole else "not all terms known"
    axes.set_title(f"into (+) and out of (−) the vibration, {told}", loc="left", pad=4)
    axes.set_xticks(places, names)
    axes.set_ylabel("power [W]")
    axes.margins(y=0.2)
    axes.figure.legend(loc="outside lower center", ncols=2, frameon=False)


class Balance(NamedTuple):
    """Mean powers of a run [W], of which `put_in` less all others is nothing.

    The rest is neither lost nor taken out: work on moving sheaves, stored energy, damping of the time step,
    and "left open", what the balance of the record does not close.
    """

    put_in: float  # by the driving pulley, negative where power flows backwards
    taken_out: float  # by the load of the driven ones, likewise
    losses: dict[str, float]  # by their names in words
    rest: dict[str, float]

    @property
    def bars(self) -> int:
        """Number of losses and of what else there is."""
        return len(self.losses) + len(self.rest)


def _balance_of(history: xr.Dataset) -> Balance | None:
    """Return the balance of a run by its record; None where it has none that is known.

    The record has `driving_power`, `load_power` and `loss` [W], losses by cause named `..._loss` [W], and
    `thrust_power`, `storing_power`, `numerical_damping` [W] where the model has them.
    """
    known = [_power(history, name) for name in ("driving_power", "load_power", "loss")]
    if None in known:
        return None
    driving, load, loss = map(float, known)  # type: ignore[arg-type]  # none is None
    powers = {str(k): v for k, v in history.data_vars.items() if v.attrs.get("units") == "W"}
    causes = [k for k, v in powers.items() if k.endswith("_loss") and set(v.dims) <= {"pulley"}]
    losses: dict[str, float] = {}
    for name in causes:
        for place in np.atleast_1d(history.get("pulley", "")) if history[name].dims else [""]:
            part = history[name].sel(pulley=place) if place else history[name]
            losses[f"{figures.in_words(history[name])}, {place}".removesuffix(", ")] = float(part)
    others = loss - sum(losses.values())
    if abs(others) > 1e-9 * abs(loss):
        losses["other losses"] = others
    names = {"thrust_power": "moving sheaves", "storing_power": "stored", "numerical_damping": "time step"}
    rest = {words: power for name, words in names.items() if (power := _power(history, name)) is not None}
    rest["left open"] = driving - load - loss - sum(rest.values())
    return Balance(driving, load, losses, rest)


def _power(history: xr.Dataset, name: str) -> float | None:
    """The sum of a power over its places [W]; None where it is missing or not known."""
    if name not in history:
        return None
    total = float(history[name].sum(skipna=False))
    return total if np.isfinite(total) else None


def _draw_balance(whole: Axes, parts: Axes, balance: Balance) -> None:
    """Draw what goes in and out, and below it, enlarged, what is lost, by cause, and the rest."""
    lost, rest = sum(balance.losses.values()), sum(balance.rest.values())
    is_large = max(abs(balance.put_in), abs(balance.taken_out)) >= _KILOWATTS
    factor, unit = (1e-3, "kW") if is_large else (1.0, "W")
    powers = {"driving pulley, in": balance.put_in, "load, out": balance.taken_out}
    powers |= {"all losses": lost, "all of the rest": rest}
    _draw_bars(whole, {name: factor * power for name, power in powers.items()}, (_IN, OUT, LOST, KEPT), unit)
    whole.set_title("in = out + losses + rest", loc="left", pad=4)
    colours = [LOST] * len(balance.losses) + [KEPT] * len(balance.rest)
    _draw_bars(parts, balance.losses | balance.rest, colours, "W")
    parts.set_title("losses by cause, and the rest", loc="left", pad=4)


def _draw_bars(axes: Axes, powers: dict[str, float], colours: Sequence[str], unit: str) -> None:
    """A bar for each power, below each other; its number stands with its name, where no bar reaches."""
    names = [f"{name}  {figures.number(power, '.4g')}" for name, power in powers.items()]
    axes.barh(names, list(powers.values()), 0.7, color=colours, edgecolor=INK, lw=0.6)
    axes.axvline(0.0, color=INK, lw=0.8)
    axes.invert_yaxis()
    axes.set_xlabel(f"power [{unit}]")
