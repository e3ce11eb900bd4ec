"""Theory of a drive: speed loss, tension where the belt slides, frequencies of the strands.

Largest excitation by the mesh alone, whose elements are cubic and bend where they meet a pulley.

A kick across the strands of a running drive, and the frequencies at which they answer.
"""

import numpy as np
from scipy.optimize import brentq

from cvt_hpc.models.belt_drive.courses import load, stretch
from cvt_hpc.models.belt_drive.layout import Layout
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.belt_path import BeltPath, regions
from cvt_hpc.physics.nearest_on_path import along
from cvt_hpc.physics.running_strand import Strand, eigenfrequencies
from cvt_hpc.vibration.signals import band_amplitude, dominant_frequency

MIDDLE, WIDTH = 0.3, 0.25  # of the strand: there no shape of up to five half waves has a node
_NEAR = 0.15  # an answer is looked for within this share of a frequency
_LOUDER = 3.0  # than the belt's own unrest, else that may be its peak

MODES = 5
_FUNCTIONS = 24  # sines of the Ritz model: more change no recorded frequency by 1e-6

# Of h^4 N / (EI R). 18 random drives (90 to 700 N, 0.005 to 0.15 N m^2, 20 to 150 rad/s) shake by 0.001 to
# 0.01 of it, at worst, where elements pass at a resonance, by 0.016
_SHAKEN = 0.02


def creep_loss(parameters: Parameters, drawn: Layout) -> float:
    """Speed loss by creep alone, by tension at rest and torque at the end (Cepon and Boltezar 2011, eq. 4).

    1 - (2 T0 R + 2 R EA - M) / (2 T0 R + 2 R EA + M), with the radius of the driving pulley and its torque
    without losses; nan of more than two pulleys.
    """
    p = parameters
    if len(drawn.pulleys) > 2:
        return np.nan
    torque = load(p, p["duration"]) * float(drawn.load[1]) / drawn.ratio
    held = 2.0 * float(drawn.path.radius[0]) * (p["tension"] + p["axial_stiffness"])
    return 1.0 - (held - torque) / (held + torque)


def expected_loss(parameters: Parameters, drawn: Layout, tension: np.ndarray) -> float:
    """Speed loss by creep, radial compliance and shear of bristles, from the strands' tensions [N].

    The belt sticks where it runs onto a pulley. The rubber under its cord turns with the pulley, so that
    w (R - depth) / stretch is the same on all, with depth = (T - m v^2) / (R k) and the tension T of the
    strand that runs on; where bristles shear, with that of `unsheared_tension`.
    """
    p, radius = parameters, drawn.path.radius
    running_on, inertial = np.roll(tension, 1), centrifugal(p, drawn.path)
    if p["friction_treatment"] == "bristle":
        arcs = zip(running_on - inertial, tension - inertial, radius, drawn.path.wrap, strict=True)
        running_on = np.array([unsheared_tension(p, *arc) + inertial for arc in arcs])
    depth = (running_on - inertial) / (radius * p["contact_stiffness"])
    stretched = np.array([stretch(float(force), p["axial_stiffness"]) for force in running_on])
    per_angle = (radius - depth) / stretched
    return float(1.0 - drawn.ratio * per_angle[0] / per_angle[drawn.driven])


def unsheared_tension(
    parameters: Parameters, inlet: float, outlet: float, radius: float, wrap: float
) -> float:
    """Tension at which a belt of the same speed would run onto a pulley without shearing its rubber: N_c [N].

    Of N = T - m v^2 along the arc: dN/ds = q = shear_stiffness z and dz/ds = (N - N_c) C, where N_c is what
    is sought and C = 1 / EA + 1 / (R^2 k) of belt and contacts. From z = 0 at the inlet on

        N = N_c + (N_inlet - N_c) cosh(s sqrt(shear_stiffness C))

    up to where |q| = mu N / R, beyond which the rim slides, as by Euler and Eytelwein (Firbank 1970; the
    contacts' compliance acts as the belt's own).

    With N at inlet and outlet [N], radius [m] and angle of the wrap [rad]. It is nan where friction cannot
    carry the difference, its coefficient is not constant, or a strand does not press the belt on.
    """
    p, mu = parameters, parameters["kinetic_friction"]
    compliance = 1.0 / p["axial_stiffness"] + 1.0 / (radius**2 * p["contact_stiffness"])
    rate, length = np.sqrt(p["shear_stiffness"] * compliance), radius * wrap
    if not _has_one_coefficient(p) or not min(inlet, outlet) > 0.0:
        return np.nan
    if abs(np.log(outlet / inlet)) >= mu * wrap:
        return np.nan
    if outlet == inlet:
        return inlet
    side = mu * np.copysign(1.0, outlet - inlet) / radius  # of dN/ds over N where the rim slides

    def rise(stuck: float) -> tuple[float, float]:
        """Rise of N over the part that sticks: its value, and its value by the shear at the end."""
        last = outlet * np.exp(-side * (length - stuck))
        return last - inlet, side * last * np.tanh(0.5 * rate * stuck) / rate

    stuck = length
    if abs(rise(length)[0]) > abs(rise(length)[1]):
        stuck = brentq(lambda at: np.subtract(*rise(at)), 1e-9 * length, length)
    return inlet - rise(stuck)[0] / (np.cosh(rate * stuck) - 1.0)


def _has_one_coefficient(p: Parameters) -> bool:
    return bool(p["friction_law"] == "coulomb" and p["friction_gradient"] == 0.0)


def centrifugal(parameters: Parameters, path: BeltPath) -> float:
    """The part m v^2 of a tension, by which a running belt does not press [N]."""
    return float(parameters["line_mass"] * (parameters["driving_speed"] * path.radius[0]) ** 2)


def wrap_angles(path: BeltPath, position: np.ndarray) -> np.ndarray:
    """Angle of path coordinates (n,) [m] from the inlet of their arc [rad]; nan on spans."""
    where = regions(path, position)
    first = np.concatenate([[0.0], path.ends[:-1]])[where]
    angle: np.ndarray = np.where(where % 2 == 0, (position - first) / path.radius[where // 2], np.nan)
    return angle


def sliding_tension(
    parameters: Parameters, path: BeltPath, tension: np.ndarray, position: np.ndarray
) -> np.ndarray:
    """Tension (place,) [N] at path coordinates [m] of the wraps by Euler and Eytelwein.

    From the tensions of the strands [N]: up to where bending lifts the belt off a pulley
    d ln(T - m v^2) / dphi is the coefficient of friction, with the sign that takes T to that of the strand
    that leaves. Before, where the belt sticks, T is that of the strand that runs on. It is nan on strands, on
    pulleys that a strand does not press the belt on, and everywhere unless the coefficient of friction is
    constant.
    """
    p = parameters
    if not _has_one_coefficient(p):
        return np.full(len(position), np.nan)
    inertial, pulley = centrifugal(p, path), regions(path, position) // 2
    inlet, outlet = np.roll(tension, 1)[pulley] - inertial, np.asarray(tension)[pulley] - inertial
    outlet = np.where(np.minimum(inlet, outlet) > 0.0, outlet, np.nan)
    lifted = np.sqrt(p["bending_stiffness"] / outlet) / path.radius[pulley]
    left = path.wrap[pulley] - lifted - wrap_angles(path, position)
    grown = np.exp(p["kinetic_friction"] * np.maximum(left, 0.0))
    slid = np.where(outlet < inlet, np.minimum(outlet * grown, inlet), np.maximum(outlet / grown, inlet))
    found: np.ndarray = slid + inertial
    return found


def strand_frequencies(parameters: Parameters, path: BeltPath, tension: np.ndarray) -> np.ndarray:
    """Eigenfrequencies of the strands as running beams, pinned where the tangents touch the pulleys.

    Bending lifts the belt off a pulley by d = sqrt(EI / (T - m v^2)) before that point. There it is clamped,
    since the pulley holds its place and its slope, which shortens the vibrating part by d. Both together
    change the frequency of n half waves by about 5/3 (n pi d / L)^3 / (n pi).

    From the strands' tensions, (P,) [N]: (P, MODES) [Hz]; nan where a strand holds no shape.
    """
    p = parameters
    speed = float(p["driving_speed"] * path.radius[0])
    strands = [
        Strand(float(length), p["line_mass"], speed, float(force), p["bending_stiffness"])
        for length, force in zip(path.spans, tension, strict=True)
    ]
    return np.array([eigenfrequencies(strand, _FUNCTIONS)[:MODES] for strand in strands])


def mesh_amplitude(parameters: Parameters, path: BeltPath, tension: np.ndarray) -> float:
    """Largest amplitude [m] at which the passing elements may shake the strands, from their tensions [N].

    Where the belt runs on or off, its curvature changes from 0 to 1 / R along d = sqrt(EI / N), with
    N = T - m v^2. The fourth derivative of its shape is 1 / (R d^2) there, and an element of length h misses
    that shape by up to h^4 / (384 R d^2). As elements pass, this shakes the strands, more at their
    resonances: _SHAKEN is measured.
    """
    p = parameters
    pull = max(float(np.max(tension)) - centrifugal(p, path), 0.0)
    length = path.path_length / p["elements"]
    return float(_SHAKEN * length**4 * pull / (p["bending_stiffness"] * path.radius.min()))


def kick(path: BeltPath, line_mass: float, impulse: float, q: np.ndarray, v: np.ndarray) -> None:
    """Add the speeds of an impulse [N s] across each strand to the nodes' speeds `v`, in place.

    The impulse acts to the right of the belt's way on its `line_mass` [kg/m], spread as 1 + cos, so that
    elements of a tenth of the strand carry it.
    """
    position, _ = along(path, q[:, :2], q[:, 2:])
    region = regions(path, position)
    strand = region // 2
    width = WIDTH * path.spans[strand]
    start = np.concatenate([[0.0], path.ends[:-1]])[region]
    phase = 2.0 * np.pi * (position - start - MIDDLE * path.spans[strand]) / width
    hit = (region % 2 == 1) & (np.abs(phase) < np.pi)
    angle = path.leaving[strand]
    right = np.stack([np.sin(angle), -np.cos(angle)], 1)
    speed = np.where(hit, impulse / (line_mass * width), 0.0)
    v[:, :2] += (speed * (1.0 + np.cos(phase)))[:, None] * right
    v[:, 2:] -= (speed * 2.0 * np.pi / width * np.sin(phase))[:, None] * right


def answers(before: np.ndarray, after: np.ndarray, rate: float, expected: np.ndarray) -> np.ndarray:
    """Frequencies of a strand after a kick, each near an expected one, (mode,) [Hz].

    By the displacement before and after the kick, (time, probe) [m]: of the probe that moves most there; nan
    where it moves less than _LOUDER times as much as before.
    """
    found = np.full(len(expected), np.nan)
    for k, frequency in enumerate(expected):
        band = ((1.0 - _NEAR) * frequency, (1.0 + _NEAR) * frequency)
        if not band[1] < 0.5 * rate:
            continue
        amplitude = band_amplitude(after, rate, band)
        strongest = int(np.argmax(amplitude))
        if amplitude[strongest] > _LOUDER * band_amplitude(before[:, strongest], rate, band):
            found[k] = dominant_frequency(after[:, strongest], rate, band)
    return found
