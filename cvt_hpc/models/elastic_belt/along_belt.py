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

Histories that are kept have them at each sample of a run's end, too (`Momentary`). Off by default: nothing is
then computed, nor held in memory. The kernel adds the profiles of each sample to the sums of the judged part;
here it adds them to zero first, sample by sample, which gives the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.elastic_belt.fluctuation import at_stations
from cvt_hpc.models.elastic_belt.sampling import PROFILES
from cvt_hpc.parameters import Parameters
from cvt_hpc.recording import sample_count
from cvt_hpc.variator.history import ALONG

if TYPE_CHECKING:
    from cvt_hpc.lanes import LaneArray

# quantities of a sample from which the quantities below follow
_OF_FRICTION = ("radial_friction", "tangential_friction", "radial_speed", "sliding_speed", "saddle_friction")
_OF_BELT = ("element_speed", "ring_tension", "push_force", "contact_force", "mean_displacement")
NEEDED = (*_OF_FRICTION, *_OF_BELT)
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


COLUMNS = [PROFILES.index(name) for name in NEEDED]
_PATH_SPEED = ("element speed", "m s-1", "rate of an element's path coordinate: v_0 / (1 + kappa w)")
WORDS = {**ELSEWHERE, **SLIDING, "element_speed": _PATH_SPEED}
PRECISION = np.dtype(np.float32)


def _profiled_samples(p: Parameters) -> int:
    """Samples of a run whose profiles are kept, the last ones."""
    return min(round(p["profile_duration"] * p["sampling_rate"]), sample_count(p))


def profile_bytes(parameters: Parameters) -> int:
    """Size of the profiles over time of one run [byte]: in memory, and at most in its history."""
    values = _profiled_samples(parameters) * parameters["stations"]
    return values * PRECISION.itemsize * max(len(NEEDED), len(WORDS))


class Momentary:
    """Profiles of the last samples of the runs of a batch, alike in sampling and duration, of N stations.

    Those whose profile_duration is 0 keep none. Before the first one that is kept there are `first` samples;
    all, where none is.
    """

    def __init__(self, points: Sequence[Parameters], stations: int) -> None:
        counts = [_profiled_samples(point) for point in points]
        self.first = sample_count(points[0]) - max(counts)
        self._kept = [lane for lane, count in enumerate(counts) if count]
        self._values = np.full((max(counts), len(self._kept), len(NEEDED), stations), np.nan, PRECISION)

    def note(self, sample: int, profiles: LaneArray) -> None:
        """Keep PROFILES of a sample."""
        self._values[sample - self.first] = profiles.data[:, COLUMNS][:, :, self._kept].transpose(2, 1, 0)

    def of(self, lane: int) -> np.ndarray | None:
        """NEEDED of the last samples of a run, (sample, quantity, N); None where none are kept."""
        return self._values[:, self._kept.index(lane)] if lane in self._kept else None
