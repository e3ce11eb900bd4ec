"""The power balance of a run: what the pulleys put in and take out, and where the rest goes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from cvt_hpc.analysis.figures import in_words
from cvt_hpc.analysis.ticks import number

IN, OUT, LOST, KEPT = "#0072b2", "#d55e00", "#8a8a8a", "#e4e8ec"
INK = "#333333"
KILOWATTS = 1e4  # [W]: from here on powers are in kW


class Balance(NamedTuple):
    """Mean powers of a run [W], of which `put_in` less all others is nothing.

    Attributes
    ----------
    put_in, taken_out : float
        By the driving pulley, and by the load of the driven ones; negative where power flows backwards.
    losses : dict
        By their names in words.
    rest : dict
        What is neither: work on moving sheaves, stored energy, damping of the time step, and "left open",
        what the balance of the record does not close.
    """

    put_in: float
    taken_out: float
    losses: dict[str, float]
    rest: dict[str, float]

    @property
    def bars(self) -> int:
        """Number of losses and of what else there is."""
        return len(self.losses) + len(self.rest)


def balance_of(history: xr.Dataset) -> Balance | None:
    """Return the balance of a run by its record; None where it has none that is known.

    Parameters
    ----------
    history : Dataset
        With `driving_power`, `load_power` and `loss` [W], losses by cause named `..._loss` [W], and
        `thrust_power`, `storing_power`, `numerical_damping` [W] where the model has them.
    """
    known = [_power(history, name) for name in ("driving_power", "load_power", "loss")]
    if None in known:
        return None
    driving, load, loss = map(float, known)  # type: ignore[arg-type]  # none is None
    causes = [
        str(name)
        for name, array in history.data_vars.items()
        if str(name).endswith("_loss") and array.attrs.get("units") == "W" and set(array.dims) <= {"pulley"}
    ]
    losses: dict[str, float] = {}
    for name in causes:
        for place in np.atleast_1d(history.get("pulley", "")) if history[name].dims else [""]:
            part = history[name].sel(pulley=place) if place else history[name]
            losses[f"{in_words(history[name])}, {place}".removesuffix(", ")] = float(part)
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


def draw_balance(whole: Axes, parts: Axes, balance: Balance) -> None:
    """Draw what goes in and out, and below it, enlarged, what is lost, by cause, and the rest."""
    lost, rest = sum(balance.losses.values()), sum(balance.rest.values())
    is_large = max(abs(balance.put_in), abs(balance.taken_out)) >= KILOWATTS
    factor, unit = (1e-3, "kW") if is_large else (1.0, "W")
    powers = {"driving pulley, in": balance.put_in, "load, out": balance.taken_out}
    powers |= {"all losses": lost, "all of the rest": rest}
    _draw_bars(whole, {name: factor * power for name, power in powers.items()}, (IN, OUT, LOST, KEPT), unit)
    whole.set_title("in = out + losses + rest", loc="left", pad=4)
    colours = [LOST] * len(balance.losses) + [KEPT] * len(balance.rest)
    _draw_bars(parts, balance.losses | balance.rest, colours, "W")
    parts.set_title("losses by cause, and the rest", loc="left", pad=4)


def _draw_bars(axes: Axes, powers: dict[str, float], colours: Sequence[str], unit: str) -> None:
    """A bar for each power, below each other; its number stands with its name, where no bar reaches."""
    names = [f"{name}  {number(power, '.4g')}" for name, power in powers.items()]
    axes.barh(names, list(powers.values()), 0.7, color=colours, edgecolor=INK, lw=0.6)
    axes.axvline(0.0, color=INK, lw=0.8)
    axes.invert_yaxis()
    axes.set_xlabel(f"power [{unit}]")
