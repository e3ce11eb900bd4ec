"""Size of a scene beside the default one: limits with a unit scale with it, whatever its units are."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.parameters import Parameters
from cvt_hpc.variator.scene import SCENE


class Measures(NamedTuple):
    """A scene's thrust, time of a radian of the driving pulley, and distance of shafts over the default's."""

    force: float
    time: float
    length: float


def measures(parameters: Parameters) -> Measures:
    """Measures of a scene, by flat values [SI] of a run: all 1 for the default one."""
    p = parameters
    thrust, speed, distance = (
        p[key] / SCENE[key].default for key in ("thrust", "driving_speed", "centre_distance")
    )
    return Measures(thrust, 1.0 / speed, distance)


def rounded(share: float) -> float:
    """The power of 2 next to a share: for limits of rounding, of which the order of magnitude counts.

    Scenes that differ by powers of 2 in their units alone then have the same digits to the last.
    """
    return float(2.0 ** np.rint(np.log2(share)))
