"""Readings of the elements of a spatial pushbelt at a sample: displacement, forces and their places.

In arrays of an element's points the flanks are left low, left high, right low, right high; the contacts to
the next element edge left, edge right, head left, head right (`belt`).
"""

import numpy as np

from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.belt import of_lanes
from cvt_hpc.models.pushbelt.readings import PROFILES as PLANAR_PROFILES
from cvt_hpc.models.pushbelt.readings import SCALARS as PLANAR_SCALARS
from cvt_hpc.models.pushbelt.readings import OnPath, Readings
from cvt_hpc.models.spatial_pushbelt import fields
from cvt_hpc.models.spatial_pushbelt.belt import Belt, BeltState
from cvt_hpc.variator import PULLEYS, STRANDS

SIDES = ("left", "right")
SHEAVES = tuple(f"{pulley} {side}" for pulley in PULLEYS for side in SIDES)
ANGLES = ("roll", "yaw", "pitch")
_EXTREMES = (*ANGLES, "nose_force")  # the largest of any element
LATERAL = tuple(f"{strand}_lateral" for strand in STRANDS)  # where probes have lateral displacement
SCALARS = (
    *PLANAR_SCALARS,
    *(f"sheave_force {sheave}" for sheave in SHEAVES),
    *(f"sheave_loss {sheave}" for sheave in SHEAVES),
    "axial_offset",
    *(f"extreme_{what}" for what in _EXTREMES),
    *(f"tension_difference {strand}" for strand in STRANDS),
)
_LEAST_FORCE = 1e-9  # [N]: what presses less does not press
_FLANK, _PRESSED = "mean line force of the flank", "mean of its points that are pressed"


def _of_sides(name: str, words: str, units: str, comment: str) -> dict[str, tuple[str, str, str]]:
    """A profile of each side of the elements."""
    return {name.format(k): (words.format(k), units, comment.format(k)) for k in SIDES}


PROFILES = {
    **PLANAR_PROFILES,
    **_of_sides("contact_force_{}", "contact force {}", "N m-1", _FLANK),
    **_of_sides("outer_contact_force_{}", "contact force {} outside", "N m-1", f"{_FLANK}'s outer point"),
    **_of_sides(
        "radial_friction_{}", "friction along the meridian {}", "N m-1", f"{_FLANK}, against sliding outwards"
    ),
    **_of_sides(
        "tangential_friction_{}", "friction along the belt {}", "N m-1", f"{_FLANK}, against sliding forwards"
    ),
    **_of_sides(
        "radial_slip_{}", "radial sliding of the flank {}", "m s-1", f"{_PRESSED}, outwards; 0 where none is"
    ),
    **_of_sides(
        *("flank_slip_{}", "sliding of the flank {}", "m s-1"),
        f"{_PRESSED}, forwards over the sheave; 0 where none is",
    ),
    **_of_sides("push_force_{}", "push force {}", "N", "mean, at rocking edge and head"),
    "head_force": ("push force at the heads", "N", "mean"),
    **_of_sides("head_force_{}", "push force at {} head", "N", "mean, part of push_force_{}"),
    "lateral_position": ("lateral position", "m", "mean, to the right"),
    "roll": ("roll of elements", "rad", "mean, heads to the right"),
    "yaw": ("yaw of elements", "rad", "mean, running to the right"),
    "ring_slope": ("slope of the rings", "rad", "mean, running to the right"),
}
OF_TWO_FLOWS = {
    "tension_difference": ("tension of the right package less the left one's", "N", "mean"),
    "flow_difference": ("speed of the right package less the left one's", "m s-1", "mean"),
}


def _points(elements: np.ndarray, first: int) -> np.ndarray:
    return elements[:, first : first + fields.POINTS]


def _vectors(elements: np.ndarray, first: int) -> np.ndarray:
    return elements[:, fields.vector(first)]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=1)


def _unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a, axis=1)[:, None]


def angles(elements: np.ndarray) -> np.ndarray:
    """Sines of ANGLES, (3, n): lateral lean, yaw out of the plane and tilt against the rings of elements."""
    position, o = _vectors(elements, fields.POSITION), _vectors(elements, fields.OUTWARD)
    chord = np.roll(position, -1, axis=0) - np.roll(position, 1, axis=0)
    return np.array([o[:, 2], elements[:, fields.HEADING + fields.AXIAL], -_dot(_unit(chord), o)])


class Reading:
    """Readings of the sample that a state has reached."""

    def __init__(self, where: Readings[Belt], state: BeltState) -> None:
        self._where, self._pulleys, self._loads = where, state.pulleys, state.loads
        self._elements = e = of_lanes(state.elements)
        self._position, self._x, self._o = (
            _vectors(e, k) for k in (fields.POSITION, fields.HEADING, fields.OUTWARD)
        )
        self._path = OnPath(where, self._position[:, :2])
        self._push = _points(e, fields.PUSH)
        self._angles = angles(e)

    def displacement(self) -> np.ndarray:
        """Displacement at the probes, outwards and to the right, (4 p,) [m]."""
        return np.concatenate([self._path.at_probes(w) for w in (self._path.offset, self._position[:, 2])])

    def scalars(self) -> list[float]:
        """SCALARS."""
        e, pulleys, loads, path = self._elements, self._pulleys, self._loads, self._where.path
        driven = e[:, fields.DRIVEN]
        both = np.stack([1.0 - driven, driven])
        normal, slip = _points(e, fields.FLANK), _points(e, fields.FLANK_SLIP_T)
        lost = _points(e, fields.FLANK_FRICTION_M) * _points(e, fields.FLANK_SLIP_M)
        lost += _points(e, fields.FLANK_FRICTION_T) * slip
        loss = both @ lost.reshape(-1, 2, 2).sum(axis=2)  # by pulley and side
        pressed = (both @ normal).sum(axis=1)
        weights = both * normal.sum(axis=1) / np.maximum(pressed, _LEAST_FORCE)[:, None]
        running = np.where(pressed > 0.0, weights @ self._contact_radii(), np.nan)
        sliding = (both @ (normal * slip)).sum(axis=1) / np.maximum(pressed, _LEAST_FORCE)
        middles = self._path.middles()
        speeds = np.linalg.norm(_vectors(e, fields.SPEED), axis=1).sum()
        line = np.linalg.norm(np.roll(self._position, -1, axis=0) - self._position, axis=1).sum()
        sheaves = loads[[fields.DRIVING_LEFT, fields.DRIVING_RIGHT, fields.DRIVEN_LEFT, fields.DRIVEN_RIGHT]]
        groups = (
            pulleys[[planar.DRIVEN_SPEED, planar.DRIVING_RADIUS, planar.DRIVEN_RADIUS]],
            middles @ self._push.sum(axis=1),
            middles @ e[:, fields.TENSION],
            sheaves.reshape(2, 2).mean(axis=1),
            running,
            sliding / (pulleys[planar.DRIVING_SPEED] * path.driving_radius),
            loss.sum(axis=1),
            [e[:, fields.RING_FRICTION] @ e[:, fields.RING_SLIP], speeds / line],
            sheaves,
            loss.ravel(),
            [pulleys[fields.DRIVEN_MIDDLE] - pulleys[fields.DRIVING_MIDDLE]],
            np.abs(self._angles).max(axis=1),
            [e[:, fields.PIN].max()],
            middles @ e[:, fields.TENSION_DIFFERENCE] if self._has_two_flows() else [np.nan] * len(STRANDS),
        )
        return [float(value) for group in groups for value in group]

    def _has_two_flows(self) -> bool:
        return self._elements.shape[1] == fields.WIDE_STATE_FIELDS

    def _contact_radii(self) -> np.ndarray:
        """Distances of the flanks' pitch points from the shaft of the nearer pulley, (n,) [m]."""
        where = self._where
        pitch_point = self._position - where.belt.pitch_depth * self._o
        y = pitch_point[:, 0] - self._elements[:, fields.DRIVEN] * where.centre_distance
        return np.hypot(y, pitch_point[:, 1])

    def profiles(self) -> np.ndarray:
        """Sums over the elements at each place: PROFILES, and their number, (profile + 1, place).

        With two flows OF_TWO_FLOWS come before the number.
        """
        e, pitch = self._elements, self._where.pitch
        at_flanks = fields.FLANK, fields.FLANK_FRICTION_M, fields.FLANK_FRICTION_T
        normal, grip_m, grip_t = (_points(e, k) for k in at_flanks)
        slip_m, slip_t = _points(e, fields.FLANK_SLIP_M), _points(e, fields.FLANK_SLIP_T)
        pairs = [slice(0, 2), slice(2, 4)]
        rows = [
            self._push.sum(axis=1),
            e[:, fields.TENSION],
            *(0.5 * values.sum(axis=1) / pitch for values in (normal, grip_m, grip_t)),
            e[:, fields.SADDLE] / pitch,
            e[:, fields.RING_SLIP],
            slip_t.mean(axis=1),
            e[:, fields.PIN],
            _edge_gap(e, self._where.belt),
            self._angles[2],
            self._path.offset,
            *(normal[:, side].sum(axis=1) / pitch for side in pairs),
            *(normal[:, k] / pitch for k in (1, 3)),
            *(grip[:, side].sum(axis=1) / pitch for grip in (grip_m, grip_t) for side in pairs),
            *(
                (normal[:, side] * slip[:, side]).sum(axis=1)
                / np.maximum(normal[:, side].sum(axis=1), _LEAST_FORCE)
                for slip in (slip_m, slip_t)
                for side in pairs
            ),
            *(self._push[:, [k, k + 2]].sum(axis=1) for k in (0, 1)),
            self._push[:, 2:].sum(axis=1),
            *self._push[:, 2:].T,
            self._position[:, 2],
            self._o[:, 2],
            self._x[:, 2],
            e[:, fields.SLOPE],
        ]
        if self._has_two_flows():
            rows += [e[:, fields.TENSION_DIFFERENCE], 2.0 * e[:, fields.HALF_SPEED]]
        return self._path.sums(rows)

    def stored_energy(self, openings: np.ndarray, leans: np.ndarray) -> float:
        """Kinetic and elastic energy of belt, driven pulley and sheaves [J].

        Of the sheaves by what both alike open, and the right one against the left one, (2, modes) [m].
        """
        e, belt = self._elements, self._where.belt
        x, o = self._x, self._o
        a = np.cross(o, x)
        u, omega = _vectors(e, fields.SPEED), _vectors(e, fields.OMEGA)
        kinetic = belt.mass * (u**2).sum() + belt.driven_inertia * self._pulleys[planar.DRIVEN_SPEED] ** 2
        for inertia, axis in ((belt.roll_inertia, x), (belt.yaw_inertia, o), (belt.pitch_inertia, a)):
            kinetic += inertia * (_dot(omega, axis) ** 2).sum()
        kinetic += belt.ring_mass * (e[:, fields.V] ** 2).sum()
        kinetic += belt.ring_rotary_inertia * (e[:, fields.SLOPE_RATE] ** 2).sum()
        for side in (-1.0, 1.0):  # the rings move with the elements across their lines only
            arm = side * belt.package_distance * a
            line = self._position + arm
            t = _unit(np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0))
            w = u + np.cross(omega, arm)
            kinetic += 0.5 * belt.ring_mass * ((w**2).sum() - (_dot(t, w) ** 2).sum())

        elastic = (e[:, fields.TENSION] ** 2 * e[:, fields.LENGTH]).sum() / belt.ring_stiffness
        elastic += 2.0 * e[:, fields.BENDING].sum()
        if self._has_two_flows():
            tension, difference = e[:, fields.TENSION], e[:, fields.TENSION_DIFFERENCE]
            mixed = difference * (difference * e[:, fields.LENGTH] + 2.0 * tension * e[:, fields.HALF_LENGTH])
            elastic += mixed.sum() / belt.ring_stiffness
            kinetic += belt.ring_mass * (e[:, fields.HALF_SPEED] ** 2).sum()
        elastic += 2.0 * (self._push**2).sum() / belt.contact_stiffness
        elastic += (e[:, fields.PIN] ** 2).sum() / belt.pin_stiffness
        elastic += 2.0 * (_points(e, fields.FLANK) ** 2).sum() / belt.flank_stiffness
        sides = _points(e, fields.FLANK).reshape(-1, 2, 2).sum(axis=2)
        elastic += (sides * e[:, fields.SPREAD : fields.SPREAD + 2]).sum()
        elastic += 2.0 * (belt.modal_stiffness * (openings**2 + leans**2)).sum()
        ahead = np.roll(e, -1, axis=0)
        chord = np.roll(self._position, -1, axis=0) - self._position
        for end in (o, np.roll(o, -1, axis=0)):  # half of the pitch's stiffness at each end of a segment
            elastic += 0.5 * belt.angle_stiffness * (_dot(_unit(chord), end) ** 2).sum()
        elastic += belt.yaw_stiffness * ((x[:, 2] - e[:, fields.SLOPE]) ** 2).sum()
        shear = chord[:, 2] / belt.pitch - 0.5 * (e[:, fields.SLOPE] + ahead[:, fields.SLOPE])
        elastic += belt.ring_shear * belt.pitch * (shear**2).sum()
        elastic += belt.ring_bending / belt.pitch * ((ahead[:, fields.SLOPE] - e[:, fields.SLOPE]) ** 2).sum()
        return 0.5 * float(kinetic + elastic)


def _edge_gap(e: np.ndarray, belt: Belt) -> np.ndarray:
    """Distance of neighbours at the middle of the rocking edge, (n,) [m]; negative where they are pressed."""
    ahead = np.roll(e, -1, axis=0)
    y = _vectors(ahead, fields.HEADING)
    edge = _vectors(e, fields.POSITION) + 0.5 * belt.thickness * _vectors(e, fields.HEADING)
    edge -= belt.pitch_depth * _vectors(e, fields.OUTWARD)
    return _dot(_vectors(ahead, fields.POSITION) - 0.5 * belt.thickness * y - edge, y)
