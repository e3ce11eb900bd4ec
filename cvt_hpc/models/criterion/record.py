"""Result of the criterion: whether small motions are fed, their growth, and energy over amplitude.

A metre of flank that slides: its radial frequency and damping, and the energy that a cycle gains.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from cvt_hpc.physics import friction as laws
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates

PHASES = 512  # of a cycle: errors of its square at a corner of the law, of 1/512 at a jump (v_reg -> 0)
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
    w = f.angular_frequency
    swing = np.multiply.outer(w * amplitudes, _SWING)
    radial = f.radial_speed + swing
    tangential = f.speed**2 - f.radial_speed**2
    speed = np.sqrt(radial * radial + tangential)
    mu = _friction(f, speed)
    left = np.exp(speed * (-2.0 / f.width))
    # radial share of sliding times tanh(speed / width); at rest there is none
    share = radial * ((1.0 - left) / ((1.0 + left) * np.maximum(speed, _LEAST_SPEED)))
    friction = 2.0 * f.contact_force * np.einsum("ak,ak,ak->a", mu, share, swing) / PHASES
    return -2.0 * np.pi / w * (0.5 * f.damping[0] * (w * amplitudes) ** 2 + friction)


def _friction(f: Flank, speed: np.ndarray) -> np.ndarray:
    """Coefficients of friction at the phases of _SWING, of which both ways through its middle are added up.

    Sliding speeds (n, PHASES // 2 + 1) are alike on both ways; what friction remembers of them is not.
    """
    around = np.concatenate([speed, speed[:, -2:0:-1]], axis=1)
    memory = 1.0 / (1.0 + 1j * _HARMONICS * (f.angular_frequency * f.memory))
    # where sliding comes to rest, the cut-off harmonics of a speed that is 0 there may leave less
    remembered = np.maximum(np.fft.irfft(np.fft.rfft(around) * memory, PHASES), 0.0)
    forces = np.full(remembered.size, f.normal_force)
    mu = laws.friction_coefficients(f.law, remembered.ravel(), forces).reshape(remembered.shape)
    both = mu[:, : PHASES // 2 + 1]
    both[:, 1:-1] += mu[:, : PHASES // 2 : -1]
    return both


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
    """Core-seconds of a run."""
    return 1e-3


def solve(parameters: Mapping[str, Any]) -> Solution:
    """Apply the criterion to the parameters of a run [SI]."""
    f = flank(parameters)
    energy = np.full(RELATIVE_AMPLITUDES.size, np.nan)
    if f.stiffness > 0.0:
        energy = energy_per_cycle(f, RELATIVE_AMPLITUDES * f.speed / f.angular_frequency)
    return Solution(f, energy, parameters["undecided_margin"])


def judge(solution: Solution) -> dict[str, Any]:
    """The record of a run, its cost apart.

    Parameters
    ----------
    solution : Solution
        As `solve` returns it.
    """
    f = solution.flank
    if f.stiffness <= 0.0:
        reason = "nothing brings the belt back: friction outweighs the wedge, and there is no frequency"
        return {"status": Status.DONE, "vibrates": Vibrates.UNDECIDED, "reason": reason}
    fed, taken = -f.damping[f.damping < 0.0].sum(), f.damping[f.damping > 0.0].sum()
    balance = (fed - taken) / (fed + taken) if fed + taken > 0.0 else 0.0
    is_fed = solution.energy > _rounding(f)
    vibrates, reason = _verdict(balance, solution.margin, RELATIVE_AMPLITUDES[is_fed])
    w, damping = f.angular_frequency, f.damping.sum()
    ratio = damping / (2.0 * f.mass * w)
    if ratio < -HARMONIC:
        reason += f"; amplitude and frequency are rough at a damping ratio of {ratio:.2g}"
    return {
        "status": Status.DONE,
        "vibrates": vibrates,
        "reason": reason,
        "amplitude": _limit_amplitude(f, solution.energy, is_fed),
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


def _limit_amplitude(f: Flank, energy: np.ndarray, is_fed: np.ndarray) -> float:
    """Largest amplitude [m] beyond which motions are no longer fed; nan where there is none."""
    ends = np.flatnonzero(is_fed[:-1] & ~is_fed[1:])
    if not ends.size:
        return np.nan
    around = slice(ends[-1], ends[-1] + 2)
    low, high = (RELATIVE_AMPLITUDES[around] * f.speed / f.angular_frequency).tolist()
    known = dict(zip((low, high), energy[around].tolist(), strict=True))

    if known[high] >= 0.0:  # by less than rounding
        return high

    def gained(amplitude: float) -> float:
        return known[amplitude] if amplitude in known else energy_per_cycle(f, np.array([amplitude]))[0]

    return brentq(gained, low, high, xtol=1e-12 * high, rtol=1e-9)


def _critical_gradient(f: Flank) -> float:
    """Slope of friction [s/m] at which small motions neither grow nor decay."""
    others = f.damping[0] + f.damping[3]
    with np.errstate(divide="ignore"):
        return float(-others / np.float64(2.0 * f.contact_force * f.radial_share**2))
