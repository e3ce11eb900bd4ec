"""Result of the criterion: whether small motions are fed, their growth, and energy over amplitude.

A metre of flank that slides: its radial frequency and damping, and the energy that a cycle gains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, maximum
from cvt_hpc.models.criterion.root import Search, brent
from cvt_hpc.physics import friction as laws
from cvt_hpc.physics.friction_laws import TABLE_PARAMETERS, Law
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates

LANES = 64  # runs of a batch
PHASES = 512  # of a cycle: errors of its square at a corner of the law, of 1/512 at a jump (v_reg -> 0)
WIDTH = 8  # phases side by side in a register
_HARMONICS = np.arange(PHASES // 2 + 1)
_SWING = -np.cos(2.0 * np.pi * _HARMONICS / PHASES)  # of half a cycle, from one turning point to the other
_LEAST_SPEED = 1e-300  # [m/s]

# Speed of the vibration over that of sliding: above 1 radial sliding turns about, and at 2 friction takes
# energy whatever the law, since each speed that feeds then has its opposite
RELATIVE_AMPLITUDES = np.append(1e-3, np.arange(1, 41) / 20.0)
HARMONIC = 0.1  # damping ratio: a motion that grows by more than half in a cycle is no harmonic one
ROUNDING = 1e-12  # of the friction's work in a cycle: as little energy as that is none

VARIABLES = (
    Variable("amplitude", "m", "amplitude of the limit cycle in harmonic balance; none: nan", may_miss=True),
    Variable("frequency", "Hz", "frequency of the radial vibration"),
    Variable("growth_rate", "s-1", "growth rate of small motions, damping over twice the mass"),
    Variable("damping", "N s m-2", "radial damping per length of belt; negative: fed by friction"),
    Variable("damping_ratio", "1", "damping over its critical value"),
    Variable("energy_balance", "1", "(fed - taken) / (fed + taken) of small motions"),
    Variable("sliding_gradient", "s m-1", "slope of friction at the sliding speed, as far as in phase"),
    Variable("critical_gradient", "s m-1", "slope below which small motions grow; -inf: none is enough"),
    Variable(
        "energy_per_cycle",
        "J m-1",
        "energy that a cycle gains, per length of belt",
        dims=("relative_amplitude",),
    ),
)


class Flank(NamedTuple):
    """A metre of belt in steady sliding, both of its flanks together.

    Attributes
    ----------
    law : FrictionLaw
        Friction in steady sliding.
    width, memory : float
        Regularisation speed [m/s] and time constant of the filtered speed [s].
    normal_force : float
        Normal line force of one flank [N/m].
    contact_force : float
        Axial line force of one flank f_ax [N/m].
    radial_speed, speed : float
        v_r and |v| [m/s].
    mass, stiffness : float
        Per length: m [kg/m], and the stiffness against a radial displacement [N/m^2]; 0 or less: nothing
        brings it back.
    damping : (4,) array
        Shares of the radial damping [N s/m^2]: the belt's; of friction its present slope, its falling law in
        phase with the speed, and its turning with the direction of sliding.
    gradient : float
        Slope of friction over |v|, in phase with the speed [s/m].
    """

    law: laws.FrictionLaw
    width: float
    memory: float
    normal_force: float
    contact_force: float
    radial_speed: float
    speed: float
    mass: float
    stiffness: float
    damping: np.ndarray
    gradient: float

    @property
    def angular_frequency(self) -> float:
        """Angular frequency of the undamped radial vibration [rad/s]."""
        return np.sqrt(max(self.stiffness, 0.0) / self.mass)

    @property
    def radial_share(self) -> float:
        """sin(gamma) = v_r / |v|."""
        return self.radial_speed / self.speed


def flank(parameters: Mapping[str, Any]) -> Flank:
    """Steady sliding, from flat parameters [SI]."""
    p = parameters
    law = laws.given_law(p)
    tangent = np.tan(p["half_wedge_angle"])
    force = p["contact_force"]
    normal_force = force / np.cos(p["half_wedge_angle"])
    speed = float(np.hypot(p["radial_speed"], p["tangential_speed"]))
    share = p["radial_speed"] / speed
    value, fall = laws.friction_coefficient(law, speed, normal_force)
    factor, rise = laws.saturation(speed, 1.0 / p["friction_speed"])
    mu = value * factor
    mass = p["element_mass"] + p["ring_mass"]
    stiffness = p["belt_stiffness"] + 2.0 * p["contact_stiffness"] * tangent * (tangent + mu * share)
    delay = max(stiffness, 0.0) / mass * p["friction_memory"] ** 2
    slopes = np.array([value * rise, factor * fall / (1.0 + delay)])
    friction = 2.0 * force * np.append(slopes * share**2, mu / speed * (1.0 - share**2))
    return Flank(
        law,
        p["friction_speed"],
        p["friction_memory"],
        normal_force,
        force,
        p["radial_speed"],
        speed,
        mass,
        stiffness,
        np.append(p["transverse_damping"], friction),
        float(slopes.sum()),
    )


def energy_per_cycle(f: Flank, amplitudes: np.ndarray) -> np.ndarray:
    """Energy that a harmonic radial motion gains in a period, the friction law taken as it is.

    Parameters
    ----------
    f : Flank
        In steady sliding, with stiffness > 0.
    amplitudes : (n,) array
        Of the displacement [m].

    Returns
    -------
    (n,) array
        Energy per length of belt [J/m]; positive: fed.
    """
    return Flanks.of([f]).energy_per_cycle(amplitudes)


_OF_LAW = "kinetic", "gradient", "speed"
_MOTION = "angular_frequency", "radial_speed", "speed", "width", "memory"
_NUMBERS = attrgetter(*_MOTION, "normal_force", "contact_force")


class Flanks(NamedTuple):
    """Several flanks, whose laws share kind and table.

    Attributes
    ----------
    law : FrictionLaw
        Its numbers are arrays (flank,).
    numbers : (flank, 8) array
        Angular frequency [rad/s], radial and whole speed, width [m/s], memory [s], normal and contact
        force [N/m], and the belt's damping [N s/m^2].
    """

    law: Any
    numbers: np.ndarray

    @classmethod
    def of(cls, each: Sequence[Flank]) -> Flanks:
        """Put flanks side by side."""
        numbers = [[*_NUMBERS(f), f.damping[0]] for f in each]
        law: dict[str, Any] = {key: np.array([getattr(f.law, key) for f in each]) for key in _OF_LAW}
        return cls(each[0].law._replace(**law), np.array(numbers))

    def some(self, places: Sequence[int]) -> Flanks:
        """Return those at some places."""
        law, at = self.law, np.array(places)
        own = law._replace(kinetic=law.kinetic[at], gradient=law.gradient[at], speed=law.speed[at])
        return Flanks(own, self.numbers[at])

    def energy_per_cycle(self, amplitudes: np.ndarray) -> np.ndarray:
        """Energies (n,) as of `energy_per_cycle`, at one flank or at a flank each."""
        w, v_r, v, width, memory, normal_force, contact_force, damping = self.numbers.T
        swing = np.multiply.outer(w * amplitudes, _SWING)
        radial = v_r[:, np.newaxis] + swing
        speed = np.sqrt(radial * radial + (v * v - v_r * v_r)[:, np.newaxis])
        # sliding speeds are alike on both ways through the middle; what friction remembers of them is not
        around = np.concatenate([speed, speed[:, -2:0:-1]], axis=1)
        harmonics = np.fft.rfft(around)
        harmonics *= 1.0 / (1.0 + 1j * _HARMONICS * (w * memory)[:, np.newaxis])
        lanes = LaneArray(len(swing), PHASES // WIDTH, WIDTH)
        mu = np.fft.irfft(harmonics, PHASES, out=lanes.data.reshape(around.shape))
        _coefficients(self.law, normal_force, lanes)
        mu[:, 1 : PHASES // 2] += mu[:, : PHASES // 2 : -1]
        left = np.exp(speed * (-2.0 / width)[:, np.newaxis])
        # radial share of sliding times tanh(speed / width); at rest there is none
        share = radial * ((1.0 - left) / ((1.0 + left) * np.maximum(speed, _LEAST_SPEED)))
        work = np.einsum("ak,ak,ak->a", mu[:, : PHASES // 2 + 1], share, swing)
        friction = 2.0 * contact_force * work / PHASES
        return -2.0 * np.pi / w * (0.5 * damping * (w * amplitudes) ** 2 + friction)


@kernel
def _coefficients(law: Any, normal_force: np.ndarray, speeds: LaneArray) -> None:
    """Write coefficients of friction in the place of remembered speeds, at one flank or at a flank each."""
    table = law.table_force, law.table_speed, law.table_mu
    for a in range(speeds.rows):
        k = a if normal_force.size > 1 else 0
        numbers = laws.law_numbers(law.kinetic[k], law.gradient[k], law.speed[k])
        for i in range(PHASES // WIDTH):
            # where sliding comes to rest, the cut-off harmonics of a speed that is 0 there may leave less
            speed = maximum(speeds[a, i], 0.0)
            if law.kind == Law.TABLE:
                mu = laws.table_coefficient(table, speed, normal_force[k])[0]
            else:
                mu = laws.formula_coefficient(law.kind, numbers, speed)[0]
            speeds[a, i] = mu


class Solution(NamedTuple):
    """Steady sliding, the energy over RELATIVE_AMPLITUDES [J/m], and the margin of the verdict."""

    flank: Flank
    energy: np.ndarray
    margin: float


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, whatever the parameters."""
    text = "amplitude of the vibration's speed over the sliding speed"
    return {"relative_amplitude": Coordinate(RELATIVE_AMPLITUDES, "1", "relative amplitude", text)}


def cost(parameters: Mapping[str, Any], stepper: None) -> float:
    """Core-seconds of a batch."""
    return 4e-4 * LANES


def lanes(parameters: Mapping[str, Any], stepper: None) -> int:
    """Most runs of a batch: they share what a call takes."""
    return LANES


def lane_key(parameters: Mapping[str, Any]) -> tuple:
    """Values that all runs of one batch have in common."""
    return tuple(parameters[key] for key in ("friction_law", *TABLE_PARAMETERS))


def solve(parameters: Mapping[str, Any]) -> Solution:
    """Apply the criterion to the parameters of a run [SI]."""
    return solve_together([parameters])[0]


def solve_together(points: Sequence[Mapping[str, Any]]) -> list[Solution]:
    """Apply the criterion to runs of one batch."""
    found = []
    for p in points:
        f = flank(p)
        energy = np.full(RELATIVE_AMPLITUDES.size, np.nan)
        if f.stiffness > 0.0:
            # each on its own: these arrays are as large as the cache
            amplitudes = RELATIVE_AMPLITUDES * f.speed / f.angular_frequency
            energy = Flanks.of([f]).energy_per_cycle(amplitudes)
        found.append(Solution(f, energy, p["undecided_margin"]))
    return found


def judge(solution: Solution) -> dict[str, Any]:
    """The record of a run, its cost apart; see `judge_together`."""
    return judge_together([solution])[0]


def judge_together(solutions: Sequence[Solution]) -> list[dict[str, Any]]:
    """The records of runs of one batch, their cost apart.

    Parameters
    ----------
    solutions : sequence of Solution
        As `solve_together` returns them.
    """
    is_fed = [solution.energy > _rounding(solution.flank) for solution in solutions]
    amplitudes = limit_amplitudes(solutions, is_fed)
    return [_values(*each) for each in zip(solutions, is_fed, amplitudes, strict=True)]


def _values(solution: Solution, is_fed: np.ndarray, amplitude: float) -> dict[str, Any]:
    """The record of a run, by the amplitudes that are fed, and that of its limit cycle [m]."""
    f = solution.flank
    if f.stiffness <= 0.0:
        reason = "nothing brings the belt back: friction outweighs the wedge, and there is no frequency"
        return {"status": Status.DONE, "vibrates": Vibrates.UNDECIDED, "reason": reason}
    fed, taken = -f.damping[f.damping < 0.0].sum(), f.damping[f.damping > 0.0].sum()
    balance = (fed - taken) / (fed + taken) if fed + taken > 0.0 else 0.0
    vibrates, reason = _verdict(balance, solution.margin, RELATIVE_AMPLITUDES[is_fed])
    w, damping = f.angular_frequency, f.damping.sum()
    ratio = damping / (2.0 * f.mass * w)
    if ratio < -HARMONIC:
        reason += f"; amplitude and frequency are rough at a damping ratio of {ratio:.2g}"
    return {
        "status": Status.DONE,
        "vibrates": vibrates,
        "reason": reason,
        "amplitude": amplitude,
        "frequency": w / (2.0 * np.pi),
        "growth_rate": -damping / (2.0 * f.mass),
        "damping": damping,
        "damping_ratio": ratio,
        "energy_balance": balance,
        "sliding_gradient": f.gradient,
        "critical_gradient": _critical_gradient(f),
        "energy_per_cycle": solution.energy,
    }


def _rounding(f: Flank) -> np.ndarray:
    """Energies [J/m] at RELATIVE_AMPLITUDES that rounding may leave of none."""
    level = 2.0 * f.contact_force * RELATIVE_AMPLITUDES * f.speed + f.damping[0] * f.speed**2
    with np.errstate(divide="ignore"):
        return ROUNDING * 2.0 * np.pi / f.angular_frequency * level


def _verdict(balance: float, margin: float, fed: np.ndarray) -> tuple[Vibrates, str]:
    """Verdict and reason by the energy balance of small motions, and the relative amplitudes that are fed."""
    words = f"energy balance of small motions {balance:.3g}, margin {margin:.3g}"
    if abs(balance) <= margin:
        return Vibrates.UNDECIDED, words
    if balance > 0.0:
        return Vibrates.YES, words
    if fed.size:
        span = f"{fed[0]:.3g} to {fed[-1]:.3g} times the speed of sliding"
        return Vibrates.UNDECIDED, f"{words}; but vibrations of {span} are fed, so the start decides"
    return Vibrates.NO, f"{words}, and no larger vibration is fed"


def limit_amplitudes(solutions: Sequence[Solution], is_fed: Sequence[np.ndarray]) -> list[float]:
    """Largest amplitudes [m] beyond which motions are no longer fed; nan where there is none.

    The searches of all runs go on side by side, with one evaluation of the energies for all that are open.
    """
    found, open_ = [np.nan] * len(solutions), {}
    searches = list(map(_search, solutions, is_fed))
    flanks = Flanks.of([solution.flank for solution in solutions])

    def go_on(place: int, energy: float | None) -> None:
        try:
            open_[place] = searches[place].send(energy)
        except StopIteration as end:
            found[place] = end.value
            open_.pop(place, None)

    for place in range(len(solutions)):
        go_on(place, None)
    while places := list(open_):
        energies = flanks.some(places).energy_per_cycle(np.array([open_[place] for place in places]))
        for place, energy in zip(places, energies.tolist(), strict=True):
            go_on(place, energy)
    return found


def _search(solution: Solution, is_fed: np.ndarray) -> Search:
    """Look for the largest amplitude of one run."""
    f, ends = solution.flank, np.flatnonzero(is_fed[:-1] & ~is_fed[1:])
    if not ends.size:
        return np.nan
    around = slice(ends[-1], ends[-1] + 2)
    low, high = (RELATIVE_AMPLITUDES[around] * f.speed / f.angular_frequency).tolist()
    at_low, at_high = solution.energy[around].tolist()
    if at_high >= 0.0:  # by less than rounding
        return high
    return (yield from brent(low, high, at_low, at_high, 1e-12 * high, 1e-9))


def _critical_gradient(f: Flank) -> float:
    """Slope of friction [s/m] at which small motions neither grow nor decay."""
    others = f.damping[0] + f.damping[3]
    with np.errstate(divide="ignore"):
        return float(-others / np.float64(2.0 * f.contact_force * f.radial_share**2))
