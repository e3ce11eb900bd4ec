"""What is read off the elements of a spatial pushbelt at a sample: displacement, forces and their places.

In arrays of an element's points the flanks are left low, left high, right low, right high; the contacts to
the next element edge left, edge right, head left, head right (`belt`).
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.models.pushbelt.belt import DRIVEN_RADIUS, DRIVEN_SPEED, DRIVING_RADIUS, DRIVING_SPEED
from cvt_hpc.models.pushbelt.readings import PROFILES as PLANAR_PROFILES
from cvt_hpc.models.pushbelt.readings import SCALARS as PLANAR_SCALARS
from cvt_hpc.models.pushbelt.readings import OnPath, Readings
from cvt_hpc.models.spatial_pushbelt import belt as f
from cvt_hpc.models.spatial_pushbelt.belt import POINTS, Belt
from cvt_hpc.variator import PULLEYS, STRANDS

SIDES = ("left", "right")
SHEAVES = tuple(f"{pulley} {side}" for pulley in PULLEYS for side in SIDES)
ANGLES = ("roll", "yaw", "pitch")
EXTREMES = (*ANGLES, "nose_force")  # the largest of any element
LATERAL = tuple(f"{strand}_lateral" for strand in STRANDS)  # where probes have lateral displacement
SCALARS = (
    *PLANAR_SCALARS,
    *(f"sheave_force {sheave}" for sheave in SHEAVES),
    *(f"sheave_loss {sheave}" for sheave in SHEAVES),
    "axial_offset",
    *(f"extreme_{what}" for what in EXTREMES),
    *(f"tension_difference {strand}" for strand in STRANDS),
)
_LEAST_FORCE = 1e-9  # [N]: what presses less does not press
_FLANK = "mean line force of the flank"
PROFILES = {
    **PLANAR_PROFILES,
    **{f"contact_force_{side}": (f"contact force {side}", "N m-1", _FLANK) for side in SIDES},
    **{
        f"outer_contact_force_{side}": (f"contact force {side} outside", "N m-1", f"{_FLANK}'s outer point")
        for side in SIDES
    },
    **{
        f"{name}_{side}": (f"{words} {side}", "N m-1", f"{_FLANK}, against sliding {way}")
        for name, words, way in (
            ("radial_friction", "friction along the meridian", "outwards"),
            ("tangential_friction", "friction along the belt", "forwards"),
        )
        for side in SIDES
    },
    **{
        f"{name}_{side}": (f"{words} {side}", "m s-1", f"mean of its points that are pressed, {way}")
        for name, words, way in (
            ("radial_slip", "radial sliding of the flank", "outwards; 0 where none is"),
            ("flank_slip", "sliding of the flank", "forwards over the sheave; 0 where none is"),
        )
        for side in SIDES
    },
    **{f"push_force_{side}": (f"push force {side}", "N", "mean, at rocking edge and head") for side in SIDES},
    "head_force": ("push force at the heads", "N", "mean"),
    **{
        f"head_force_{side}": (f"push force at {side} head", "N", f"mean, part of push_force_{side}")
        for side in SIDES
    },
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
    return elements[:, first : first + POINTS]


def _vectors(elements: np.ndarray, first: int) -> np.ndarray:
    return elements[:, first : first + 3]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=1)


def _unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a, axis=1)[:, None]


def angles(elements: np.ndarray) -> np.ndarray:
    """Sines of ANGLES: lateral lean, yaw out of the plane and tilt against the rings, (3, n).

    Parameters
    ----------
    elements : (n, fields) array
        In the order of the belt.
    """
    position, o = _vectors(elements, f.POSITION), _vectors(elements, f.OUTWARD)
    chord = np.roll(position, -1, axis=0) - np.roll(position, 1, axis=0)
    return np.array([o[:, 2], elements[:, f.HEADING + 2], -_dot(_unit(chord), o)])


class Reading:
    """What is read at one sample.

    Parameters
    ----------
    where : Readings
        Where it is read.
    elements : (n, fields) array
        In the order of the belt.
    pulleys : (PULLEY_FIELDS,) array
        State of the pulleys.
    loads : (LOADS,) array
        Axial forces on the sheaves.
    """

    def __init__(self, where: Readings, elements: np.ndarray, pulleys: np.ndarray, loads: np.ndarray) -> None:
        e = elements
        self._where, self._elements, self._pulleys, self._loads = where, e, pulleys, loads
        self._position, self._x, self._o = (_vectors(e, k) for k in (f.POSITION, f.HEADING, f.OUTWARD))
        self._path = OnPath(where, self._position[:, :2])
        self._push = _points(e, f.PUSH)
        self._angles = angles(e)

    def displacement(self) -> np.ndarray:
        """Displacement at the probes, outwards and to the right, (4 p,) [m]."""
        return np.concatenate([self._path.at_probes(w) for w in (self._path.offset, self._position[:, 2])])

    def scalars(self) -> list[float]:
        """SCALARS."""
        e, pulleys, loads, path = self._elements, self._pulleys, self._loads, self._where.path
        driven = e[:, f.DRIVEN]
        both = np.stack([1.0 - driven, driven])
        normal, slip = _points(e, f.FLANK), _points(e, f.FLANK_SLIP_T)
        lost = _points(e, f.FLANK_FRICTION_M) * _points(e, f.FLANK_SLIP_M)
        lost += _points(e, f.FLANK_FRICTION_T) * slip
        loss = both @ lost.reshape(-1, 2, 2).sum(axis=2)  # by pulley and side
        pressed = (both @ normal).sum(axis=1)
        weights = both * normal.sum(axis=1) / np.maximum(pressed, _LEAST_FORCE)[:, None]
        running = np.where(pressed > 0.0, weights @ self._contact_radii(), np.nan)
        sliding = (both @ (normal * slip)).sum(axis=1) / np.maximum(pressed, _LEAST_FORCE)
        middles = self._path.middles()
        speeds = np.linalg.norm(_vectors(e, f.SPEED), axis=1).sum()
        line = np.linalg.norm(np.roll(self._position, -1, axis=0) - self._position, axis=1).sum()
        sheaves = loads[[f.DRIVING_LEFT, f.DRIVING_RIGHT, f.DRIVEN_LEFT, f.DRIVEN_RIGHT]]
        groups = (
            pulleys[[DRIVEN_SPEED, DRIVING_RADIUS, DRIVEN_RADIUS]],
            middles @ self._push.sum(axis=1),
            middles @ e[:, f.TENSION],
            sheaves.reshape(2, 2).mean(axis=1),
            running,
            sliding / (pulleys[DRIVING_SPEED] * path.driving_radius),
            loss.sum(axis=1),
            [e[:, f.RING_FRICTION] @ e[:, f.RING_SLIP], speeds / line],
            sheaves,
            loss.ravel(),
            [pulleys[f.DRIVEN_MIDDLE] - pulleys[f.DRIVING_MIDDLE]],
            np.abs(self._angles).max(axis=1),
            [e[:, f.PIN].max()],
            middles @ e[:, f.TENSION_DIFFERENCE] if self._has_two_flows() else [np.nan] * len(STRANDS),
        )
        return [float(value) for group in groups for value in group]

    def _has_two_flows(self) -> bool:
        return self._elements.shape[1] == f.WIDE_STATE_FIELDS

    def _contact_radii(self) -> np.ndarray:
        """Distances of the flanks' pitch points from the shaft of the nearer pulley, (n,) [m]."""
        where = self._where
        pitch_point = self._position - where.belt.pitch_depth * self._o
        y = pitch_point[:, 0] - self._elements[:, f.DRIVEN] * where.centre_distance
        return np.hypot(y, pitch_point[:, 1])

    def profiles(self) -> np.ndarray:
        """Sums over the elements at each place: PROFILES, and their number, (profile + 1, place).

        With two flows OF_TWO_FLOWS come before the number.
        """
        e, pitch = self._elements, self._where.pitch
        normal, grip_m, grip_t, slip_m, slip_t = (
            _points(e, k)
            for k in (f.FLANK, f.FLANK_FRICTION_M, f.FLANK_FRICTION_T, f.FLANK_SLIP_M, f.FLANK_SLIP_T)
        )
        pairs = [slice(0, 2), slice(2, 4)]
        rows = [
            self._push.sum(axis=1),
            e[:, f.TENSION],
            *(0.5 * values.sum(axis=1) / pitch for values in (normal, grip_m, grip_t)),
            e[:, f.SADDLE] / pitch,
            e[:, f.RING_SLIP],
            slip_t.mean(axis=1),
            e[:, f.PIN],
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
            e[:, f.SLOPE],
        ]
        if self._has_two_flows():
            rows += [e[:, f.TENSION_DIFFERENCE], 2.0 * e[:, f.HALF_SPEED]]
        return self._path.sums(rows)

    def stored_energy(self, openings: np.ndarray, leans: np.ndarray) -> float:
        """Kinetic and elastic energy of belt, driven pulley and sheaves [J].

        Parameters
        ----------
        openings, leans : (2, modes) arrays
            Of the sheaves: of both alike, and of the right one against the left one [m].
        """
        e, belt = self._elements, self._where.belt
        x, o = self._x, self._o
        a = np.cross(o, x)
        u, omega = _vectors(e, f.SPEED), _vectors(e, f.OMEGA)
        kinetic = belt.mass * (u**2).sum() + belt.driven_inertia * self._pulleys[DRIVEN_SPEED] ** 2
        for inertia, axis in ((belt.roll_inertia, x), (belt.yaw_inertia, o), (belt.pitch_inertia, a)):
            kinetic += inertia * (_dot(omega, axis) ** 2).sum()
        kinetic += belt.ring_mass * (e[:, f.V] ** 2).sum()
        kinetic += belt.ring_rotary_inertia * (e[:, f.SLOPE_RATE] ** 2).sum()
        for side in (-1.0, 1.0):  # the rings move with the elements across their lines only
            arm = side * belt.package_distance * a
            line = self._position + arm
            t = _unit(np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0))
            w = u + np.cross(omega, arm)
            kinetic += 0.5 * belt.ring_mass * ((w**2).sum() - (_dot(t, w) ** 2).sum())

        elastic = (e[:, f.TENSION] ** 2 * e[:, f.LENGTH]).sum() / belt.ring_stiffness
        if self._has_two_flows():
            tension, difference = e[:, f.TENSION], e[:, f.TENSION_DIFFERENCE]
            mixed = difference * (difference * e[:, f.LENGTH] + 2.0 * tension * e[:, f.HALF_LENGTH])
            elastic += mixed.sum() / belt.ring_stiffness
            kinetic += belt.ring_mass * (e[:, f.HALF_SPEED] ** 2).sum()
        elastic += 2.0 * (self._push**2).sum() / belt.contact_stiffness
        elastic += (e[:, f.PIN] ** 2).sum() / belt.pin_stiffness
        elastic += 2.0 * (_points(e, f.FLANK) ** 2).sum() / belt.flank_stiffness
        elastic += 2.0 * (belt.modal_stiffness * (openings**2 + leans**2)).sum()
        ahead = np.roll(e, -1, axis=0)
        chord = np.roll(self._position, -1, axis=0) - self._position
        for end in (o, np.roll(o, -1, axis=0)):  # half of the pitch's stiffness at each end of a segment
            elastic += 0.5 * belt.angle_stiffness * (_dot(_unit(chord), end) ** 2).sum()
        elastic += belt.yaw_stiffness * ((x[:, 2] - e[:, f.SLOPE]) ** 2).sum()
        shear = chord[:, 2] / belt.pitch - 0.5 * (e[:, f.SLOPE] + ahead[:, f.SLOPE])
        elastic += belt.ring_shear * belt.pitch * (shear**2).sum()
        elastic += belt.ring_bending / belt.pitch * ((ahead[:, f.SLOPE] - e[:, f.SLOPE]) ** 2).sum()
        return 0.5 * float(kinetic + elastic)


def _edge_gap(e: np.ndarray, belt: Belt) -> np.ndarray:
    """Distance of neighbours at the middle of the rocking edge, (n,) [m]; negative where they are pressed."""
    ahead = np.roll(e, -1, axis=0)
    y = _vectors(ahead, f.HEADING)
    edge = _vectors(e, f.POSITION) + 0.5 * belt.thickness * _vectors(e, f.HEADING)
    edge -= belt.pitch_depth * _vectors(e, f.OUTWARD)
    return _dot(_vectors(ahead, f.POSITION) - 0.5 * belt.thickness * y - edge, y)
