"""Elastic sheaves under one wrap: the constants of its contact, whose equations stand in `compliance.py`."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.physics.ritz import NO_MODES, Modes

STIFFNESS_OF = ("disc", "sheave")  # the parts that `sheave_stiffness` scales


class Sheaves(NamedTuple):
    """Constants of the contact of one wrap of m stations."""

    weight: np.ndarray  # length h that each station stands for, (m,) [m]
    # about the pulley's axis from the inlet's tangent point, (m,) [rad], negative before it
    angle: np.ndarray
    # distance from the axis beyond the pitch radius, rho - R, of the reference path, (m,) [m], 0 on the arc
    rise: np.ndarray
    upright: np.ndarray  # its slope with the belt's displacement, R / rho, (m,)
    element_stiffness: float  # c_e [N/m^2]
    compliance: float  # a [1] of disc and collar together, 0 where both are rigid
    disc_compliance: float  # b [1] of the disc alone, 0 where it is rigid
    diagonal: np.ndarray  # diagonal of the inverse of the local kernel, (m,) [N/m]
    off_diagonal: np.ndarray  # its entry between a station and the one behind it, (m,) [N/m]; the first is 0
    tilt: np.ndarray  # U, (2, m) [1]: rho / R times cosine and sine of the angle
    tilt_compliance: float  # r^2 / c_tilt [m/N]
    # W (m, m) [m/N] in the place of the local kernel, of discs of the reference stiffness: opening at one
    # station under a force at another; empty: the kernel
    flexibilities: np.ndarray
    modes: Modes  # discs whose inertia counts; W has them at rest
    clearance: float = 0.0  # opening of the groove by which collar and shaft tilt before they bear [m]
    line_forces: float = 1.0  # size of the axial line forces over that of the default scene [1]


def sheaves(
    weight: np.ndarray,
    angle: np.ndarray,
    rise: np.ndarray,
    radius: float,
    sheave_stiffness: float,
    tilt_stiffness: float,
    local_stiffness: float,
    local_length: float,
    element_stiffness: float,
    disc_stiffness: float = 1.0,
) -> Sheaves:
    """Constants of the contact over one wrap, for `plain_contact` and `lane_contact`.

    The kernel of local bending, exp(-|s - s'| / l) / (2 l k) with s = R times the angle, is that of a Markov
    process: its inverse over any stations is tridiagonal. With e_j = exp(-(s_j - s_j-1) / l) the pair of
    stations j - 1 and j gives 2 l k / (1 - e_j^2) to both diagonals and -2 l k e_j / (1 - e_j^2) beside them;
    a station between two others counts 2 l k less.

    Arguments as of `Sheaves`, the angles ascending, and: the pitch radius [m]; `sheave_stiffness`, multiple
    of the reference stiffness of disc and collar together, and `disc_stiffness`, that of the disc alone [1],
    inf: rigid; c_tilt of the reference [N m/rad], inf: a collar without tilt; k [N/m^2] and l [m] of its
    kernel.
    """
    scale = 2.0 * local_length * local_stiffness
    decay = np.exp(-np.diff(angle) * radius / local_length)
    pair = scale / (1.0 - decay * decay)
    diagonal = np.append(pair, scale) + np.insert(pair, 0, scale) - scale
    return Sheaves(
        weight,
        angle,
        rise,
        radius / (radius + rise),
        element_stiffness,
        1.0 / sheave_stiffness,
        1.0 / disc_stiffness,
        diagonal,
        np.insert(-pair * decay, 0, 0.0),
        (1.0 + rise / radius) * np.array([np.cos(angle), np.sin(angle)]),
        radius * radius / tilt_stiffness,
        np.empty((0, 0)),
        NO_MODES,
    )


def stiffness_factors(parameters: Mapping[str, Any]) -> tuple[float, float]:
    """Multiples of the reference stiffness of disc and collar together, and of the disc alone [1].

    By `sheave_stiffness` and `stiffness_of`. Lebrecht et al. 2004 vary "the stiffness parameters of the
    FE-model" (sec. 3.6), which is that of the discs; the tilt of the shaft-to-collar connection belongs to
    their rigid bodies (sec. 2.1.1) and stays.
    """
    factor = parameters["sheave_stiffness"]
    return (1.0, factor) if parameters["stiffness_of"] == "disc" else (factor, 1.0)


def axial_element_stiffness(parameters: Mapping[str, Any]) -> float:
    """Return c_e [N/m^2] by `flank_stiffness` and `element_factor`."""
    return float(parameters["flank_stiffness"] * parameters["element_factor"])


def flexibility(sheave: Sheaves) -> np.ndarray:
    """Dense matrix C (m, m) [m^2/N] of g = G + C f, force per length in, gap out; C diag(1/h) is symmetric.

    For comparison with general solvers.
    """
    m = sheave.weight.size
    return np.eye(m) / sheave.element_stiffness + elastic_matrix(sheave) * sheave.weight


def disc_factor(sheave: Sheaves) -> float:
    """Compliance of the discs, multiple of the reference [1]; 0: rigid."""
    return sheave.compliance * sheave.disc_compliance


def elastic_matrix(sheave: Sheaves) -> np.ndarray:
    """Symmetric a (b W + r^2 / c_tilt U^T U), (m, m) [m/N]: force in, opening of disc and collar out."""
    local = sheave.flexibilities
    if not local.size:
        inverse = np.diag(sheave.diagonal)
        beside = np.diag(sheave.off_diagonal[1:], 1)
        inverse += beside + beside.T
        local = np.linalg.inv(inverse)
    elastic = sheave.disc_compliance * local + sheave.tilt_compliance * sheave.tilt.T @ sheave.tilt
    return sheave.compliance * elastic
