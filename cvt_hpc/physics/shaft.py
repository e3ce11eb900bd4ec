"""Shafts that bend: stepped beams on elastic bearings, and the effect of their deflection on a groove.

**The beam** (Bullinger et al. 2005, sec. 4.2.2) has sections of constant cross section. Between its nodes
(ends of sections, bearings, places of loads) no load acts, so that deflection is a cubic there and beam
elements are exact. Sections are round and bearings isotropic: both planes bend by the same equations, each
under the loads in it.

**The groove.** Sheave A sits at z_A, sheave B at z_B, both rigid, the belt runs midway at z_b. In the plane
of phi = 0 the seats are displaced by v and turned by theta = dv/dz. A flank then moves axially, at the belt's
radius r, by -theta r cos(phi), and where it moves outwards by v + theta (z_b - z) it brings up its part
further inside, which lies nearer to the other flank:

    gap change = cos(phi) [ r (theta_A - theta_B) - tan(d0) (v_A + theta_A e + v_B - theta_B e) ]
               = cos(phi) b . x,     x = (v_A, theta_A, v_B, theta_B),   e = |z_b - z|,

d0 being the half wedge angle. A pulley that turns as one body leaves its gap: the slopes count by their
difference, the displacement by its mean. Axial line forces f_k load the seats with the forces and couples
b s, s = sum of cos(phi_k) h_k f_k, and with the flexibility S of the seats the gap opens by

    q cos(phi),    q = (b . S b) s,

and likewise with sin(phi): the shape of the collar's tilt, of which the law is q = (r^2 / c_tilt) s. So
shaft and collar in series are one compliance. Where the movable sheave sits, at A or B, does not matter to
the belt, which takes half of an axial misalignment and feels the sum of both sides only.

Beside the axial forces the belt pulls the shaft by its friction. That part is left out: it has no partner in
the gap, so that the contact would be no minimum of energy.

**Clearance.** A bearing with the radial clearance c gives way by c in the direction of its force before it
bears, a collar by its free angle. With the reactions rho_b of both bearings to s = 1 (a statically
determinate shaft) the law is q = kappa s + c_q s / |s|, c_q = sum of |rho_b| c_b + r delta_S: of two planes,
that is a dead zone of the radius c_q in series with a spring.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Bearing(NamedTuple):
    """A support of a shaft."""

    position: float  # along the shaft [m]
    stiffness: float  # radial [N/m]; inf: it does not give
    tilt_stiffness: float = 0.0  # against the slope [N m/rad]; inf with infinite stiffness: clamped


class Seats(NamedTuple):
    """Seats of a pulley's sheaves: the axial positions of both [m]."""

    fixed: float
    movable: float


def beam_flexibility(
    lengths: Sequence[float],
    diameters: Sequence[float],
    modulus: float,
    bearings: Sequence[Bearing],
    places: Sequence[float],
) -> np.ndarray:
    """Deflection and slope at k places of a shaft under forces and couples there, in one plane.

    The result (2 k, 2 k) is symmetric: rows deflection [m] and slope [rad] of each place, columns force [N]
    and couple [N m]. The shaft has sections of `lengths` and `diameters` [m], one after the other from
    position 0, and Young's `modulus` [N/m^2]; `places` are positions along it [m]. ValueError if the bearings
    do not hold it.
    """
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    own = [bearing.position for bearing in bearings]
    nodes = np.unique(np.concatenate([ends, own, places]))
    stiffness = np.zeros((2 * nodes.size, 2 * nodes.size))
    for k, (left, right) in enumerate(zip(nodes[:-1], nodes[1:], strict=True)):
        section = min(int(np.searchsorted(ends, 0.5 * (left + right))) - 1, len(lengths) - 1)
        bending = modulus * np.pi / 64.0 * diameters[section] ** 4
        stiffness[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += _element(right - left, bending)
    held = np.zeros(2 * nodes.size, dtype=bool)
    for bearing in bearings:
        node = int(np.searchsorted(nodes, bearing.position))
        for unknown, spring in ((2 * node, bearing.stiffness), (2 * node + 1, bearing.tilt_stiffness)):
            held[unknown] |= np.isinf(spring)
            stiffness[unknown, unknown] += 0.0 if np.isinf(spring) else spring
    free = np.flatnonzero(~held)
    if np.linalg.matrix_rank(_balanced(stiffness[np.ix_(free, free)])) < free.size:
        raise ValueError("bearings that hold the shaft: two, or a clamped one")
    flexibility = np.zeros_like(stiffness)
    flexibility[np.ix_(free, free)] = np.linalg.inv(stiffness[np.ix_(free, free)])
    loaded = [2 * int(np.searchsorted(nodes, place)) + k for place in places for k in (0, 1)]
    found = flexibility[np.ix_(loaded, loaded)]
    return 0.5 * (found + found.T)


def _element(length: float, bending: float) -> np.ndarray:
    """Stiffness of a beam between two nodes: deflection and slope at its left end, then at its right one."""
    a, b = 6.0 * length, length * length
    shape = [[12.0, a, -12.0, a], [a, 4.0 * b, -a, 2.0 * b], [-12.0, -a, 12.0, -a], [a, 2.0 * b, -a, 4.0 * b]]
    return bending / length**3 * np.array(shape)


def _balanced(matrix: np.ndarray) -> np.ndarray:
    """A symmetric matrix whose unknowns are measured so that its diagonal is 1."""
    size = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return size[:, None] * matrix * size


def gap_shares(seats: Seats, radius: float, half_wedge_angle: float) -> np.ndarray:
    """Shares b of the seats' deflections and slopes in the gap change b . x, (4,) in [1, m, 1, m].

    The belt runs midway between the seats, at the pitch radius [m]; the half wedge angle is in [rad].
    """
    tangent, half = np.tan(half_wedge_angle), 0.5 * abs(seats.movable - seats.fixed)
    lever = radius - tangent * half
    shares = np.array([-tangent, lever, -tangent, -lever])
    return shares if seats.fixed < seats.movable else shares[[2, 3, 0, 1]]


def shaft_compliance(flexibility: np.ndarray, seats: Seats, radius: float, half_wedge_angle: float) -> float:
    """Compliance b . S b of the groove by a shaft's bending [m/N].

    S (4, 4) is that of the seats, fixed and movable, as of `beam_flexibility`; all else as of `gap_shares`.
    """
    shares = gap_shares(seats, radius, half_wedge_angle)
    return float(shares @ flexibility @ shares)


def bearing_reactions(positions: Sequence[float], seats: Seats, half_wedge_angle: float) -> np.ndarray:
    """Radial forces on two bearings by s = 1, (2,) [1]: 2 tan(d0) midway between the seats, by levers."""
    left, right = positions
    middle = 0.5 * (seats.fixed + seats.movable)
    share = (middle - left) / (right - left)
    return 2.0 * np.tan(half_wedge_angle) * np.array([1.0 - share, share])


def free_opening(
    clearance: float, positions: Sequence[float], seats: Seats, half_wedge_angle: float
) -> float:
    """Opening of the groove by the radial clearance of two bearings, sum of |rho_b| c [m]."""
    return float(clearance * np.abs(bearing_reactions(positions, seats, half_wedge_angle)).sum())
