"""Largest excitation by the mesh alone, whose elements are cubic and bend where they meet a pulley."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.belt_drive.theory import centrifugal
from cvt_hpc.physics.belt_path import BeltPath

# Of h^4 N / (EI R). 18 random drives (90 to 700 N, 0.005 to 0.15 N m^2, 20 to 150 rad/s) shake by 0.001 to
# 0.01 of it, at worst, where elements pass at a resonance, by 0.016
SHAKEN = 0.02


def mesh_amplitude(parameters: Mapping[str, Any], path: BeltPath, tension: np.ndarray) -> float:
    """Largest amplitude at which the passing elements may shake the strands [m].

    Where the belt runs on or off, its curvature changes from 0 to 1 / R along d = sqrt(EI / N), with
    N = T - m v^2. The fourth derivative of its shape is 1 / (R d^2) there, and an element of length h misses
    that shape by up to h^4 / (384 R d^2). As elements pass, this shakes the strands, more at their
    resonances: SHAKEN is measured.

    Parameters
    ----------
    parameters : mapping
        Flat parameters of a run [SI].
    path : BeltPath
        The reference path.
    tension : (P,) array
        Of the strands [N].
    """
    p = parameters
    pull = max(float(np.max(tension)) - centrifugal(p, path), 0.0)
    length = path.path_length / p["elements"]
    return float(SHAKEN * length**4 * pull / (p["bending_stiffness"] * path.radius.min()))
