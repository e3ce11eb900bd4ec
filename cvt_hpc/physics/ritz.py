"""Discs with inertia: their eigenforms as Ritz functions (Bullinger et al. 2005, sec. 4.1, eqs 4-6).

The groove opens by y(phi, t) = sum_k (a_k cos(n_k phi) + b_k sin(n_k phi)). In axes that turn with the disc

    m_k (a'' + 2 zeta omega_k a' + omega_k^2 a) = sum_j cos(n_k phi_j) h_j f_j,    m_k = 1 / (c_k omega_k^2),

and so for b with sines: c_k is the modal flexibility [m/N], m_k the mass. At rest w_ij = sum_k c_k
cos(n_k (phi_i - phi_j)), eq. 10. A station's force falls linearly to both neighbours, and its opening is the
mean by the same weights: a factor sinc^2(n h / 2 r) on both sides, h being the length of a station.

A step is of Newmark's mean acceleration in the axes of the disc, which turn by omega dt: of second order,
without damping of its own. The force at its end comes in by B_k = 1 / (m_k (4 / dt^2 + 4 zeta omega_k / dt +
omega_k^2)), all else is known before, p_k. So the contact is that of `closed_set` with flexibilities B_k in
the place of c_k, and gaps that p_k opens. Modes above a limit frequency have no inertia: B_k = c_k, p_k = 0.
"""

from typing import NamedTuple

import numpy as np


class Modes(NamedTuple):
    """Modes of the discs of one wrap that have inertia: M, of H harmonics, at m stations."""

    shapes: np.ndarray  # cosines, then sines, of the harmonics, (2 H, m), with the factor above
    harmonics: np.ndarray  # their n, (H,)
    place: np.ndarray  # harmonic of each mode, (M,) int
    flexibility: np.ndarray  # c of discs of the reference stiffness, (M,) [m/N]
    pace: np.ndarray  # omega of these discs, (M,) [rad/s]
    damping: float  # zeta [1]
    step: float  # time step [s]


_NONE = np.empty(0)
NO_MODES = Modes(np.empty((0, 0)), _NONE, np.empty(0, dtype=np.int64), _NONE, _NONE, 0.0, 1.0)


def shapes(harmonics: np.ndarray, angle: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Cosines, then sines, of harmonics at stations, spread to their neighbours, (2 H, m).

    `harmonics` (H,) are waves around the disc, `angle` (m,) is the stations' place about the axis and `width`
    (m,) the angle that each stands for [rad].
    """
    spread = np.sinc(0.5 * harmonics[:, None] * width / np.pi) ** 2
    turned = harmonics[:, None] * angle
    return np.concatenate([spread * np.cos(turned), spread * np.sin(turned)])


def modal_flexibilities(
    harmonic: np.ndarray, flexibility: np.ndarray, angle: np.ndarray, width: np.ndarray
) -> np.ndarray:
    """Flexibilities w_ij (m, m) [m/N] at rest of modes of harmonics (M,) and c (M,) [m/N], at m stations.

    Angle and width as of `shapes`.
    """
    forms = shapes(np.asarray(harmonic, float), angle, width)
    return (forms * np.tile(flexibility, 2)[:, None]).T @ forms


def moving_modes(
    table: tuple[np.ndarray, np.ndarray, np.ndarray],
    limit: float,
    damping: float,
    step: float,
    wrap: tuple[np.ndarray, np.ndarray],
) -> Modes:
    """Return the modes of a table that have inertia: frequencies up to `limit` [Hz].

    The table holds harmonic, flexibility and mass, each (K,), without inertia where the mass is 0; `damping`
    is zeta [1], `step` the time step [s], and `wrap` angle and width of the stations as of `shapes`.
    """
    harmonic, flexibility, mass = (np.asarray(values, float) for values in table)
    squares = flexibility * mass * (2.0 * np.pi * limit) ** 2
    moving = np.flatnonzero((mass > 0.0) & (squares >= 1.0))
    if not moving.size:
        return NO_MODES
    own, place = np.unique(harmonic[moving], return_inverse=True)
    pace = 1.0 / np.sqrt(flexibility[moving] * mass[moving])
    return Modes(shapes(own, *wrap), own, place, flexibility[moving], pace, damping, step)
