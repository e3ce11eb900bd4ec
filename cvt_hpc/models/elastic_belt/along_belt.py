"""Speeds and forces along the belt, as Lebrecht et al. 2004 and Bullinger et al. 2005 draw them.

They follow from the values that every sample holds of each station (`moments.py`), of a single instant or of
means.

The flank carries the normal force N = f_P,n and, along its meridian, the friction m N outward, with m =
-mu v_m/|v|. The axial force is f_ax = N cos d - m N sin d, the radial force of both flanks p_r = 2 (N sin d +
m N cos d) (`docs/guide/theory_belt.md`). Times cos d and sin d / 2 they add up to

    f_P,n = f_ax cos d + (p_r / 2) sin d,

whatever friction is. That is linear, so that the mean normal force follows from mean forces. A sample has p_r
less its frictionless part 2 f_ax tan d.

The sliding angle is that of Bullinger et al. 2005, eq. 36, against the running direction, positive where the
belt slides into the groove: from pi/2 to 3 pi/2 the pulley drives the belt, below pi/2 the belt the pulley.
Of means, sliding speed and angle are those of the mean sliding.
"""

from collections.abc import Mapping

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.elastic_belt.fluctuation import at_stations
from cvt_hpc.parameters import Parameters
from cvt_hpc.variator.history import ALONG

# quantities of a sample from which the quantities below follow
NEEDED = (
    "radial_friction",
    "tangential_friction",
    "radial_speed",
    "sliding_speed",
    "saddle_friction",
    "element_speed",
    "ring_tension",
    "push_force",
    "contact_force",
    "mean_displacement",
)
# long name, unit and comment by name; of all but the wrap angle nan where a station has no contact
SLIDING = {
    "radial_sliding": ("radial sliding", "m s-1", "of the belt on the sheaves, outward"),
    "tangential_sliding": ("tangential sliding", "m s-1", "of the elements on the sheaves, forward"),
    "sliding_speed": ("sliding speed", "m s-1", "in the plane of the flank"),
    "sliding_angle": (
        "sliding angle",
        "rad",
        "of sliding into the groove against the running direction; beyond pi/2 the pulley drives the belt",
    ),
    "normal_force": ("normal force", "N m-1", "of one flank, per length of the belt"),
    "friction_force": ("friction force", "N m-1", "of both flanks on the belt, forward"),
    "ring_friction": ("ring friction", "N m-1", "of the elements' saddles on the rings, forward"),
}
WRAP_ANGLE = ("wrap angle", "rad", "from the inlet of the arc; negative before it")
# everywhere, of an instant or of a state that does not change
ELSEWHERE = {**ALONG, "contact_force": ("contact force", "N m-1", "axial line force of one flank")}


def along_belt(sample: Mapping[str, np.ndarray], grid: Mesh, parameters: Parameters) -> dict[str, np.ndarray]:
    """Quantities of SLIDING at the stations, (..., N) by name.

    They follow from those of NEEDED, (..., N) each, of one instant or means, and the run's half wedge angle
    [SI].
    """
    angle = parameters["half_wedge_angle"]
    on_arc = at_stations(grid.cell * (grid.region % 2 == 0))  # length of a station's part on an arc
    axial = sample["contact_force"]
    touching = np.where((on_arc > 0.0) | (axial > 0.0), 1.0, np.nan)  # or in a groove that is open there
    radial, tangential = sample["radial_speed"] * touching, sample["sliding_speed"] * touching
    pressing = (2.0 * np.tan(angle) * axial + sample["radial_friction"]) * touching
    meridian = radial / np.cos(angle)
    return {
        "radial_sliding": radial,
        "tangential_sliding": tangential,
        "sliding_speed": np.hypot(meridian, tangential),
        "sliding_angle": sliding_angle(radial, tangential, angle),
        "normal_force": axial * np.cos(angle) + 0.5 * np.sin(angle) * pressing,
        "friction_force": sample["tangential_friction"] * touching,
        "ring_friction": sample["saddle_friction"] / np.where(on_arc > 0.0, on_arc, np.nan),
    }


def elsewhere(sample: Mapping[str, np.ndarray], grid: Mesh) -> dict[str, np.ndarray]:
    """Quantities of ELSEWHERE at the stations, (..., N) each, of a sample as `along_belt` takes it.

    A stress of the cells goes in a straight line from the middle of one to that of the next.
    """
    shares = grid.cell / (grid.cell + np.roll(grid.cell, 1))  # of the stress behind a station

    def between(stress: np.ndarray) -> np.ndarray:
        return stress + shares * (np.roll(stress, 1, axis=-1) - stress)

    stresses = {name: between(sample[name]) for name in ("ring_tension", "push_force")}
    return stresses | {name: sample[name] for name in ("contact_force", "mean_displacement")}


def sliding_angle(radial: np.ndarray, tangential: np.ndarray, half_wedge_angle: float) -> np.ndarray:
    """Sliding angle [rad], from -pi/2 to 3 pi/2, of radial sliding outward and of sliding forward [m/s]."""
    found = np.arctan2(-radial / np.cos(half_wedge_angle), tangential)
    return np.where(found < -0.5 * np.pi, found + 2.0 * np.pi, found)


def curvature_at_stations(grid: Mesh) -> np.ndarray:
    """Curvature of the reference path at the stations [1/m], (N,): at an arc's end that of its own length."""
    return at_stations(grid.cell * grid.curvature) / at_stations(grid.cell)


def wrap_angles(grid: Mesh) -> np.ndarray:
    """Angle of the stations from the inlet of their arc [rad], (N,); nan where no groove is looked for."""
    found = np.full(grid.cell.size, np.nan)
    for zone in (grid.zone(0), grid.zone(2)):
        found[zone.stations] = zone.angle
    return found
