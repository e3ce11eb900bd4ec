"""The Ritz model of a running strand, in sines: its matrices, eigenfrequencies and critical speed."""

from typing import NamedTuple

import numpy as np


class Strand(NamedTuple):
    """A running strand.

    Attributes
    ----------
    length : float
        Between its pinned ends [m].
    line_mass : float
        Mass per length [kg/m].
    speed : float
        At which it runs [m/s].
    net_force : float
        Ring tension less push force [N].
    bending_stiffness : float
        EI [N m^2].
    """

    length: float
    line_mass: float
    speed: float
    net_force: float
    bending_stiffness: float

    @property
    def critical_speed(self) -> float:
        """Speed from which it does not hold its shape [m/s]; 0 where it buckles at rest."""
        wave = np.pi / self.length
        held = self.net_force + self.bending_stiffness * wave**2
        return float(np.sqrt(max(held, 0.0) / self.line_mass))


def ritz_matrices(strand: Strand, functions: int) -> tuple[np.ndarray, np.ndarray]:
    """Matrices of q'' + G q' + K q = 0.

    Parameters
    ----------
    strand : Strand
        The strand.
    functions : int
        Number of sines.

    Returns
    -------
    gyroscopic : (n, n) array
        G [1/s], skew.
    stiffness : (n,) array
        Diagonal of K [1/s^2].
    """
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
    """Eigenfrequencies below the critical speed, ascending.

    With p = sqrt(K) q the equations are z' = A z, z = (p, q'), and A is skew: i A is Hermitian, and its
    eigenvalues come in pairs +-w.

    Parameters
    ----------
    strand : Strand
        The strand.
    functions : int
        Number of sines.

    Returns
    -------
    (functions,) array
        [Hz]; nan beyond the critical speed.
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
