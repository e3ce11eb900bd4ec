"""The belt's own length and its tension at rest: belt and contacts in series along the path.

At a tension T the belt is longer by the factor x with EA (x^2 - 1) x / 2 = T, and the contacts sink in by
T / (R k) on each arc, which shortens the path.
"""

from collections.abc import Mapping
from typing import Any

from scipy.optimize import brentq

from cvt_hpc.models.belt_drive.layout import PULLEY_LISTS, TENSIONER, TWO, layout, layout_problems
from cvt_hpc.parameters import Parameter, Substitute
from cvt_hpc.physics.belt_path import BeltPath

MOST_STRAIN = 0.5  # tension over axial_stiffness


def stretch(tension: float, stiffness: float) -> float:
    """Length under a tension over that without: the root of EA (x^2 - 1) x / 2 = T."""
    x = 1.0 + tension / stiffness
    for _ in range(20):
        x -= (0.5 * (x**2 - 1.0) * x - tension / stiffness) / (1.5 * x**2 - 0.5)
    return x


def contact_compliance(path: BeltPath, contact_stiffness: float) -> float:
    """By how much the contacts shorten a path for each newton of tension [m/N]."""
    return float((path.wrap / path.radius).sum()) / contact_stiffness


def length_at(path: BeltPath, tension: float, parameters: Mapping[str, Any]) -> float:
    """Length without load of the belt that has a tension [N] on a path, nearly [m]."""
    shortened = path.path_length - contact_compliance(path, parameters["contact_stiffness"]) * tension
    return shortened / stretch(tension, parameters["axial_stiffness"])


def _tension(parameters: Mapping[str, Any]) -> float:
    """Tension [N] that the belt of `free_length` has."""
    p = parameters
    if layout_problems(p):
        return 0.0  # which nobody reads: they are told first
    path, most = layout(p).path, MOST_STRAIN * p["axial_stiffness"]
    shortest = length_at(path, most, p)
    if not shortest < p["free_length"] < path.path_length:
        expected = f"more than {shortest:.6g} m, at half of axial_stiffness, and less than the path's"
        raise ValueError(f"{expected} {path.path_length:.6g} m")
    return float(brentq(lambda tension: length_at(path, tension, p) - p["free_length"], 0.0, most, xtol=1e-9))


def free_length() -> Parameter:
    """The parameter that gives the preload by the belt's own length."""
    needs = (*TWO, *PULLEY_LISTS, *TENSIONER, "axial_stiffness", "contact_stiffness")
    return Parameter(
        None,
        "m",
        "length of the belt without load, in the place of tension, which follows",
        minimum=0.0,
        exclusive=True,
        gives=Substitute("tension", needs, _tension),
        sensible=(0.1, 50.0),
    )
