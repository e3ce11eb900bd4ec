"""Geometry of a two-pulley variator with a belt of constant length on its pitch line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Variator:
    """The reference path: driving arc, strand t1, driven arc, strand t2, in the belt's direction of travel.

    Attributes
    ----------
    driving_radius, driven_radius : float
        Pitch radii [m].
    driving_wrap, driven_wrap : float
        Wrap angles [rad].
    strand_length : float
        Length of each free strand [m].
    """

    driving_radius: float
    driven_radius: float
    driving_wrap: float
    driven_wrap: float
    strand_length: float

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """Lengths of the four regions of the path [m]."""
        driving, driven = self.driving_radius * self.driving_wrap, self.driven_radius * self.driven_wrap
        return driving, self.strand_length, driven, self.strand_length

    @property
    def path_length(self) -> float:
        """Length of the closed pitch line [m]."""
        return sum(self.lengths)


def variator(ratio: float, driven_radius: float, centre_distance: float) -> Variator:
    """Geometry from the speed ratio.

    Parameters
    ----------
    ratio : float
        Speed ratio i = omega_driving / omega_driven = driven radius / driving radius [1].
    driven_radius : float
        Pitch radius of the belt on the driven pulley [m].
    centre_distance : float
        Distance of the shafts [m].

    Returns
    -------
    Variator
        With sin(psi) = (r_dn - r_dr) / a, wraps pi -/+ 2 psi and strands a cos(psi).

    Raises
    ------
    ValueError
        If the pulleys' pitch circles overlap.
    """
    driving_radius = driven_radius / ratio
    if driving_radius + driven_radius >= centre_distance:
        raise ValueError("the pitch circles of the pulleys overlap")
    psi = np.arcsin((driven_radius - driving_radius) / centre_distance)
    return Variator(
        driving_radius,
        driven_radius,
        np.pi - 2.0 * psi,
        np.pi + 2.0 * psi,
        centre_distance * np.cos(psi),
    )


def variator_problems(parameters: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Problems of a variator's geometry, in the form of a model's check: (key, expected, found).

    Parameters
    ----------
    parameters : mapping
        Values by name [SI], of which those that `variator` takes count.
    """
    p = parameters
    try:
        variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    except ValueError:
        expected = (
            "pulleys that do not overlap: driven_radius (1 + 1 / ratio) < centre_distance "
            f"{p['centre_distance']:g} m"
        )
        radius = p["driven_radius"] / p["ratio"]
        found = f"ratio {p['ratio']:g}, radii {radius:g} m and {p['driven_radius']:g} m"
        return [("ratio", expected, found)]
    return []
