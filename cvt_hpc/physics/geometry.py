"""Geometry of a two-pulley variator with a belt of constant length on its pitch line."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from cvt_hpc.parameters import Parameters, Problem


@dataclass(frozen=True)
class Variator:
    """The reference path, as the belt travels: driving arc, strand t1, driven arc, strand t2."""

    driving_radius: float  # pitch radius [m]
    driven_radius: float  # pitch radius [m]
    driving_wrap: float  # wrap angle [rad]
    driven_wrap: float  # wrap angle [rad]
    strand_length: float  # of each free strand [m]

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
    """Geometry from the speed ratio i = omega_driving / omega_driven = driven radius / driving radius [1].

    With the pitch radius of the belt on the driven pulley and the distance a of the shafts [m], sin(psi) =
    (r_dn - r_dr) / a, wraps are pi -/+ 2 psi and strands a cos(psi). ValueError if the pulleys' pitch circles
    overlap.
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


def driven_radius(ratio: float, belt_length: float, centre_distance: float) -> float:
    """Pitch radius on the driven pulley [m] at which a belt of given length on its pitch line closes.

    The length of the closed path grows with the driving radius r; i is the ratio, a the centre distance [m]:

        L(r) = r (pi - 2 psi) + i r (pi + 2 psi) + 2 a cos(psi),    sin(psi) = (i - 1) r / a,
        dL/dr = (pi - 2 psi) + i (pi + 2 psi) > 0.

    L is convex, too. Newton's iteration from the largest radius, at which the pitch circles touch, therefore
    comes down to the root without overshooting it, and ends where rounding lets it descend no further.
    ValueError if no pulleys fit; the text states the possible lengths.
    """

    def residual_and_slope(radius: float) -> tuple[float, float]:
        psi = math.asin((ratio - 1.0) * radius / centre_distance)
        slope = (math.pi - 2.0 * psi) + ratio * (math.pi + 2.0 * psi)
        return radius * slope + 2.0 * centre_distance * math.cos(psi) - belt_length, slope

    radius = centre_distance / (1.0 + ratio)
    residual, slope = residual_and_slope(radius)
    if not (residual > 0.0 and belt_length > 2.0 * centre_distance):
        raise ValueError(
            f"more than {2.0 * centre_distance:g} m, twice the centre distance, and less than "
            f"{belt_length + residual:.6g} m, where the pulleys touch"
        )
    while (lower := radius - residual / slope) < radius:
        radius = lower
        residual, slope = residual_and_slope(radius)
    return ratio * radius


# Way from a tangent point over which cells become longer, as a share of the centre distance: 8 mm, some two
# lengths over which a belt settles on its bedding
_REFINED_WAY = 0.05


@lru_cache(maxsize=64)  # all points of a grid have the same few paths
def cut_path(path: Variator, cells: int, refinement: float = 1.0) -> tuple[np.ndarray, ...]:
    """Cut each region of a path into cells, by region their lengths [m]: the shorter the nearer to its ends.

    The number of cells per length is 1 + (r - 1) / (1 + (x / l)^2) for each end of the region, x from there,
    times what gives their number `cells` all around; l = _REFINED_WAY of the centre distance. A length has
    r = `refinement` times as many cells at the tangent points as far from them; 1: even cells. Each region
    has four cells or more; the driven arc takes what rounding leaves. The arrays cannot be written to.
    """
    centre_distance = math.hypot(path.strand_length, path.driven_radius - path.driving_radius)
    way = _REFINED_WAY * centre_distance

    def upto(x: np.ndarray | float, length: float) -> Any:
        ends = np.arctan(x / way) + np.arctan(length / way) - np.arctan((length - x) / way)
        return x + (refinement - 1.0) * way * ends

    wholes = [upto(length, length) for length in path.lengths]
    driving, strand, _, _ = (max(round(cells * part / sum(wholes)), 4) for part in wholes)
    strand = min(strand, (cells - 8) // 2)
    driving = min(driving, cells - 2 * strand - 4)
    counts = (driving, strand, cells - driving - 2 * strand, strand)
    found = []
    for length, whole, count in zip(path.lengths, wholes, counts, strict=True):
        fine = np.linspace(0.0, length, 100 * count + 1)
        found.append(np.diff(np.interp(np.linspace(0.0, whole, count + 1), upto(fine, length), fine)))
        found[-1].flags.writeable = False
    return tuple(found)


def variator_problems(parameters: Parameters) -> list[Problem]:
    """Problems of a variator's geometry, (key, expected, found), by the values [SI] of `variator`."""
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
