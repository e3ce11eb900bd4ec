"""The Ritz model of a running strand, in sines: its matrices, eigenfrequencies and critical speed.

Net forces of the strands, T - P, from thrust and load: the belt as one band on two grooves.

Assumed: no radial sliding, so that the wedge carries G / r = 2 f tan(d) with G = F - m v^2 and f the axial
line force of a flank, whose sum is the thrust; on the driven pulley the belt sticks where it comes in and
slides on an arc before it leaves, where friction changes G by the factor exp(mu* angle), mu* = mu / sin(d)
(Euler and Eytelwein). Of the wrap phi that gives

    G_1 (phi - slip) + |G_2 - G_1| / mu* = 2 tan(d) thrust,    slip = |ln(G_2 / G_1)| / mu*,

1 the strand that comes in (t1), 2 the one that leaves (t2), and the driving torque r_dr (F_2 - F_1) = M. How
F is shared between rings and elements is left open: the strand's frequencies do not depend on it.

Sheaves that bend let the belt slide radially, which adds force to both strands: against the elastic belt
(`lebrecht_2004.toml`, no fall of friction to speak of) these forces are lower by 0.9-1.3 kN of 5-11 kN.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.physics.geometry import variator


class Strand(NamedTuple):
    """A running strand."""

    length: float  # between its pinned ends [m]
    line_mass: float  # mass per length [kg/m]
    speed: float  # at which it runs [m/s]
    net_force: float  # ring tension less push force [N]
    bending_stiffness: float  # EI [N m^2]

    @property
    def critical_speed(self) -> float:
        """Speed from which it does not hold its shape [m/s]; 0 where it buckles at rest."""
        wave = np.pi / self.length
        held = self.net_force + self.bending_stiffness * wave**2
        return float(np.sqrt(max(held, 0.0) / self.line_mass))


def ritz_matrices(strand: Strand, functions: int) -> tuple[np.ndarray, np.ndarray]:
    """Matrices of q'' + G q' + K q = 0 by n sines: G (n, n) [1/s], skew; diagonal of K (n,) [1/s^2]."""
    n = np.arange(1, functions + 1)
    wave = n * np.pi / strand.length
    force = strand.net_force / strand.line_mass - strand.speed**2
    stiffness = force * wave**2 + strand.bending_stiffness / strand.line_mass * wave**4
    j, k = np.meshgrid(n, n, indexing="ij")
    odd = (j + k) % 2 == 1
    gyroscopic = np.zeros((functions, functions))
    gyroscopic[odd] = 8.0 * strand.speed / strand.length * (j * k)[odd] / (j**2 - k**2)[odd]
    return gyroscopic, stiffness


def eigenfrequencies(strand: Strand, functions: int) -> np.ndarray:
    """Eigenfrequencies by n sines below the critical speed, ascending, (n,) [Hz]; nan beyond that speed.

    With p = sqrt(K) q the equations are z' = A z, z = (p, q'), and A is skew: i A is Hermitian, and its
    eigenvalues come in pairs +-w.
    """
    gyroscopic, stiffness = ritz_matrices(strand, functions)
    if stiffness.min() <= 0.0:
        return np.full(functions, np.nan)
    root = np.diag(np.sqrt(stiffness))
    skew = np.block([[np.zeros_like(root), root], [-root, -gyroscopic]])
    return np.linalg.eigvalsh(1j * skew)[functions:] / (2.0 * np.pi)


def resting_frequencies(strand: Strand, functions: int) -> np.ndarray:
    """Eigenfrequencies without the terms of the speed, (functions,) [Hz]; nan of modes that buckle."""
    stiffness = ritz_matrices(strand._replace(speed=0.0), functions)[1]
    return np.sqrt(np.where(stiffness > 0.0, stiffness, np.nan)) / (2.0 * np.pi)


def net_forces(parameters: Mapping[str, Any]) -> np.ndarray:
    """Net forces of t1 and t2, (2,) [N], from flat parameters [SI]."""
    p = parameters
    if p["strand_forces"] == "given":
        return np.array([p[f"ring_tension_{strand}"] - p[f"push_force_{strand}"] for strand in ("t1", "t2")])
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    speed = p["driving_speed"] * path.driving_radius
    rise = p["load"] / path.driving_radius
    friction = p["kinetic_friction"] / np.sin(p["half_wedge_angle"])
    wedge = 2.0 * np.tan(p["half_wedge_angle"]) * p["thrust"]
    first = _entering(rise, friction, wedge, path.driven_wrap)
    centrifugal = (p["element_mass"] + p["ring_mass"]) * speed**2
    return np.array([first, first + rise]) + centrifugal


def _entering(rise: float, friction: float, wedge: float, wrap: float) -> float:
    """G_1 [N] for G_2 - G_1, mu*, 2 tan(d) thrust, and phi."""
    if rise == 0.0:
        return wedge / wrap

    def excess(entering: float) -> float:
        slip = abs(np.log1p(rise / entering)) / friction
        return entering * (wrap - slip) + abs(rise) / friction - wedge

    from scipy.optimize import brentq  # takes long, and runs that know their forces do without

    # at the least force the whole wrap slides, at the largest none does
    least = rise / np.expm1(np.copysign(friction * wrap, rise))
    return brentq(excess, least, wedge / wrap + max(-rise, 0.0), xtol=1e-9, rtol=1e-14)
