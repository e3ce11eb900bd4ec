"""Signals over time of a kept run, of which levels, orders and sound are made: motion, forces, speeds.

The force of the belt on a shaft follows from both strands: with the tension T of the rings, the push force P
and the flux of momentum m u^2 it is the sum of T - P - m u^2 along both strands, away from the pulley. This
is the balance of momentum of the pulley with the belt on its arc. It leaves out what the belt on the arc
stores of momentum, and what the ends of a swinging strand pull across it.
"""

import json
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.histories import settings_of
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


class Signal(NamedTuple):
    """A quantity over time.

    Attributes
    ----------
    name, unit : str
        Such as "displacement t1 1/2" and "m".
    times, values : (n,) arrays
        Evenly spaced [s], and in the unit.
    judged : int
        First sample of the part that is judged.
    """

    name: str
    unit: str
    times: Array
    values: Array
    judged: int

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


def known_signals(history: xr.Dataset) -> list[str]:
    """Names of the signals that a history holds over `time`, the forces on shafts included."""
    courses = [str(name) for name, values in history.items() if values.dims == ("time",)]
    forces = SHAFT_FORCES if [one.dims for one in _net_forces(history)][:1] == [("time",)] else ()
    return [*_probes(history), *courses, *forces]


def read_signal(history: xr.Dataset, of: str, source: str = "history") -> Signal:
    """Read a signal, as far as its values are finite.

    Parameters
    ----------
    history : Dataset
        As `simulate` returns it.
    of : str
        A probe, as "t1 1/2"; a strand, for the probe of it that moves most in the judged part; a variable
        over time; or one of SHAFT_FORCES [N]: y from the driving to the driven shaft, z across, t2's side.
    source : str
        Where the history is from, for the errors.

    Raises
    ------
    InputError
        The history has no such signal, or too little of it.
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
        raise unknown(source, "signal", of, known_signals(history))
    (axis,) = array.dims
    values, times = np.asarray(array.values, float), np.asarray(history[axis].values, float)
    finite = np.isfinite(values)
    count = values.size if finite.all() else int(np.argmin(finite))
    share = settings_of(history)[0]["judged_fraction"]
    judged = int(np.searchsorted(times[:count], (1.0 - share) * times[count - 1])) if count else 0
    if count - judged < SHORTEST_SEGMENT:
        raise mismatch(f"{source}: {of}", f"{SHORTEST_SEGMENT} judged samples or more", str(count - judged))
    return Signal(name, str(array.attrs.get("units", "1")), times[:count], values[:count], judged)


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
