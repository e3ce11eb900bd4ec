"""Readings of the elements of a pushbelt at a sample: displacement, forces, losses and their places."""

from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np

from cvt_hpc.models.pushbelt import fields
from cvt_hpc.models.pushbelt.belt import Belt
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import variator
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.variator.history import ALONG, along, of_means

SCALARS = (
    *("driven_speed", "driving_radius", "driven_radius"),
    *(f"push_force {strand}" for strand in STRANDS),
    *(f"ring_tension {strand}" for strand in STRANDS),
    *(f"axial_force {pulley}" for pulley in PULLEYS),
    *(f"running_radius {pulley}" for pulley in PULLEYS),
    *(f"slip {pulley}" for pulley in PULLEYS),
    *(f"{pulley}_flank_loss" for pulley in PULLEYS),
    *("ring_loss", "passing_frequency"),
)
_OUTWARDS = "mean line force of one flank, against sliding outwards"
_FORWARDS = "mean line force of one flank, against sliding forwards"
PROFILES = {
    "push_force": of_means(ALONG["push_force"]),
    "ring_tension": of_means(ALONG["ring_tension"]),
    "contact_force": ("contact force", "N m-1", "mean normal line force of one flank"),
    "radial_friction": ("friction along the meridian", "N m-1", _OUTWARDS),
    "tangential_friction": ("friction along the belt", "N m-1", _FORWARDS),
    "saddle_force": ("force of the rings on the saddles", "N m-1", "mean line force"),
    "ring_slip": ("sliding of the rings", "m s-1", "mean, forwards over the elements"),
    "flank_slip": ("sliding of the flanks", "m s-1", "mean, forwards over the sheave"),
    "nose_force": ("force of noses", "N", "mean size, of the next element's hole on a nose"),
    "gap": ("gap", "m", "mean, between neighbours at the rocking edge"),
    "tilt": ("tilt of elements", "rad", "mean, against the rings"),
    "mean_displacement": ALONG["mean_displacement"],
}


class RollingBelt(Protocol):
    """Constants of a belt of elements, in its plane or in space."""

    @property
    def pitch_depth(self) -> float:
        """Distance of the rocking edge below the saddle [m]."""


AnyBelt = TypeVar("AnyBelt", bound=RollingBelt, covariant=True)


class Readings(Generic[AnyBelt]):
    """Places where displacement and forces of a run are read.

    Attributes
    ----------
    path : Variator
        The reference path.
    centre_distance, pitch : float
        [m]
    probes : (2, p) array
        Path coordinates on both strands [m].
    middles, places : (2,) and (place,) arrays
        Path coordinates of the middles of the strands, and of profiles [m].
    """

    def __init__(self, parameters: Parameters, belt: AnyBelt) -> None:
        p = parameters
        self.belt = belt
        self.path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
        self.centre_distance = p["centre_distance"]
        self.pitch = self.path.path_length / p["elements"]
        driving, strand, driven, _ = self.path.lengths
        starts = np.array([driving, driving + strand + driven])
        shares = np.arange(1, p["strand_probes"] + 1) / (p["strand_probes"] + 1.0)
        self.probes = starts[:, None] + strand * shares
        self.middles = starts + 0.5 * strand
        places = p["profile_places"]
        self.places = (np.arange(places) + 0.5) * (self.path.path_length / places)


class OnPath:
    """Elements on the path at one sample, and what is read there of their values.

    From their saddle points, (n, 2) in the order of the belt [m]: path coordinates `position`, and `offset`
    outwards of the path, (n,) each [m].
    """

    def __init__(self, where: Readings[RollingBelt], saddles: np.ndarray) -> None:
        self._path, self._probes, self._middles = where.path, where.probes, where.middles
        self._places = where.places.size
        self.position, offset = along(where.path, where.centre_distance, saddles)
        self.offset = offset - where.belt.pitch_depth  # the path is that of the pitch line

    def at_probes(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) interpolated at the probes, (2 p,)."""
        order, length = np.argsort(self.position), self._path.path_length
        return np.interp(self._probes.ravel(), self.position[order], values[order], period=length)

    def middles(self) -> np.ndarray:
        """Weights of the elements in means over the middle half of each strand, (2, n)."""
        quarter = 0.25 * self._path.strand_length
        inside = (np.abs(self.position - self._middles[:, None]) < quarter).astype(float)
        return inside / inside.sum(axis=1, keepdims=True)

    def sums(self, rows: Sequence[np.ndarray]) -> np.ndarray:
        """Sums of values (n,) over the elements at each place, and their number, (rows + 1, place)."""
        share = self.position / self._path.path_length
        place = np.minimum((share * self._places).astype(int), self._places - 1)
        return np.array([np.bincount(place, row, self._places) for row in (*rows, np.ones(place.size))])


class Reading:
    """Readings of one sample, from the elements' fields in the order of the belt and the pulleys' state."""

    def __init__(self, where: Readings[Belt], elements: np.ndarray, pulleys: np.ndarray) -> None:
        self._where, self._elements, self._pulleys = where, elements, pulleys
        self._path = OnPath(where, elements[:, [fields.Y, fields.Z]])
        self._push = elements[:, fields.EDGE] + elements[:, fields.HEAD]

    def displacement(self) -> np.ndarray:
        """Displacement at the probes, outwards, (2 p,) [m]."""
        return self._path.at_probes(self._path.offset)

    def scalars(self) -> list[float]:
        """SCALARS."""
        e, pulleys, belt = self._elements, self._pulleys, self._where.belt
        driven = e[:, fields.DRIVEN]
        both = np.stack([1.0 - driven, driven])
        thrust = e[:, fields.FLANK] * belt.cosine + e[:, fields.FLANK_FRICTION_M] * belt.sine
        # the meridian's speed is the radial one over the cosine, its force in radial direction has the cosine
        loss = belt.cosine**2 * e[:, fields.FLANK_FRICTION_M] * e[:, fields.FLANK_SLIP_M]
        loss = 2.0 * (loss + e[:, fields.FLANK_FRICTION_T] * e[:, fields.FLANK_SLIP_T])
        weights = both * e[:, fields.FLANK]
        pressed = weights.sum(axis=1)
        weights /= np.maximum(pressed, 1e-9)[:, None]
        belt_speed = pulleys[fields.DRIVING_SPEED] * self._where.path.driving_radius
        inside, places = self._path.middles(), e[:, [fields.Y, fields.Z]]
        # elements over the time of a revolution: their speeds over the length of their line
        speeds = np.hypot(e[:, fields.U_Y], e[:, fields.U_Z]).sum()
        line = np.hypot(*np.diff(places, axis=0, prepend=places[-1:]).T).sum()
        groups = (
            pulleys[[fields.DRIVEN_SPEED, fields.DRIVING_RADIUS, fields.DRIVEN_RADIUS]],
            inside @ self._push,
            inside @ e[:, fields.TENSION],
            both @ thrust,
            np.where(pressed > 0.0, weights @ self._contact_radii(), np.nan),
            weights @ e[:, fields.FLANK_SLIP_T] / belt_speed,
            both @ loss,
            [e[:, fields.RING_FRICTION] @ e[:, fields.RING_SLIP], speeds / line],
        )
        return [float(value) for group in groups for value in group]

    def _contact_radii(self) -> np.ndarray:
        """Distances of the flanks' contact points from the shaft of the nearer pulley, (n,) [m]."""
        e, depth = self._elements, self._where.belt.pitch_depth
        y = e[:, fields.Y] - depth * e[:, fields.HEADING_Z]
        y -= e[:, fields.DRIVEN] * self._where.centre_distance
        return np.hypot(y, e[:, fields.Z] + depth * e[:, fields.HEADING_Y])

    def profiles(self) -> np.ndarray:
        """Sums over the elements at each place: PROFILES, and their number, (profile + 1, place)."""
        e, where = self._elements, self._where
        ahead = np.roll(e, -1, axis=0)
        across = ahead[:, [fields.Y, fields.Z]] - np.roll(e[:, [fields.Y, fields.Z]], 1, axis=0)
        length = np.hypot(*across.T)
        rising = (e[:, fields.HEADING_Y] * across[:, 1] - e[:, fields.HEADING_Z] * across[:, 0]) / length
        rows = [
            self._push,
            e[:, fields.TENSION],
            e[:, fields.FLANK] / where.pitch,
            e[:, fields.FLANK_FRICTION_M] / where.pitch,
            e[:, fields.FLANK_FRICTION_T] / where.pitch,
            e[:, fields.SADDLE] / where.pitch,
            e[:, fields.RING_SLIP],
            e[:, fields.FLANK_SLIP_T],
            np.abs(e[:, fields.NOSE]),
            _edge_gap(e, ahead, where.belt),
            -rising,
            self._path.offset,
        ]
        return self._path.sums(rows)

    def stored_energy(self, openings: np.ndarray) -> float:
        """Kinetic and elastic energy of belt, driven pulley and sheaves with `openings` (2, modes) [J]."""
        e, belt = self._elements, self._where.belt
        ahead = np.roll(e, -1, axis=0)
        segment = ahead[:, [fields.Y, fields.Z]] - e[:, [fields.Y, fields.Z]]
        t = segment + np.roll(segment, 1, axis=0)
        t /= np.hypot(*t.T)[:, None]
        segment /= np.hypot(*segment.T)[:, None]
        u = e[:, [fields.U_Y, fields.U_Z]]
        outward = u[:, 0] * t[:, 1] - u[:, 1] * t[:, 0]
        kinetic = belt.mass * (u**2).sum() + belt.inertia * (e[:, fields.OMEGA] ** 2).sum()
        kinetic += belt.ring_mass * (e[:, fields.V] ** 2 + outward**2).sum()
        kinetic += belt.driven_inertia * self._pulleys[fields.DRIVEN_SPEED] ** 2
        elastic = (e[:, fields.TENSION] ** 2 * e[:, fields.LENGTH]).sum() / belt.ring_stiffness
        elastic += (e[:, fields.EDGE] ** 2 + e[:, fields.HEAD] ** 2).sum() / belt.contact_stiffness
        elastic += (e[:, fields.NOSE] ** 2).sum() / belt.nose_stiffness
        elastic += 2.0 * (e[:, fields.FLANK] ** 2).sum() / belt.flank_stiffness
        elastic += 2.0 * (e[:, fields.FLANK] * e[:, fields.SPREAD]).sum()
        elastic += 2.0 * (belt.modal_stiffness * openings**2).sum()
        elastic += 2.0 * e[:, fields.BENDING].sum()
        for end in (e, ahead):  # half of the angle's stiffness at each end of a segment
            cosine = (segment * end[:, [fields.HEADING_Y, fields.HEADING_Z]]).sum(axis=1)
            elastic += belt.angle_stiffness * (1.0 - cosine).sum()
        return 0.5 * float(kinetic + elastic)


def _edge_gap(e: np.ndarray, ahead: np.ndarray, belt: Belt) -> np.ndarray:
    """Distance of neighbours at the rocking edge, (n,) [m]; negative where they press on each other."""
    x, y = e[:, [fields.HEADING_Y, fields.HEADING_Z]], ahead[:, [fields.HEADING_Y, fields.HEADING_Z]]
    outward = np.stack([x[:, 1], -x[:, 0]], 1)
    edge = e[:, [fields.Y, fields.Z]] + 0.5 * belt.thickness * x - belt.pitch_depth * outward
    face = ahead[:, [fields.Y, fields.Z]] - 0.5 * belt.thickness * y
    return ((face - edge) * y).sum(1)
