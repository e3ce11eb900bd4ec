"""Readings of a belt drive at a sample: displacement, tensions, sliding, forces along the path.

Kernels read a sample at points along the belt: places, tension, contacts.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import called_alike, kernel
from cvt_hpc.models.belt_drive.contact import contact_slopes
from cvt_hpc.models.belt_drive.drive import Drive, State
from cvt_hpc.models.belt_drive.layout import Layout
from cvt_hpc.models.belt_drive.pulleys import arms_energy, axes
from cvt_hpc.multibody.ancf_beam import POINTS, SHAPES, WEIGHTS, AncfBeam, energies, tension_of
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.belt_path import directions, span_starts, tangents
from cvt_hpc.physics.nearest_on_path import Way, nearest, way

PROFILES = {
    "tension": ("tension", "N", "mean"),
    "normal_force": ("normal force", "N m-1", "mean line force, outwards of the pulley"),
    "friction_force": ("friction force", "N m-1", "mean line force on the belt, forwards"),
    "mean_displacement": ("mean displacement", "m", "off the reference path, to the right of the belt's way"),
}
PLACES = 240  # along the path, at which profiles are recorded: 5 mm of a belt of 1.2 m


def scalars_of(drawn: Layout, arms: int) -> tuple[str, ...]:
    """Names of the readings of a sample beside displacement."""
    names = ["driven_speed", *(f"tension {span}" for span in drawn.spans)]
    names += [f"slip {pulley}" for pulley in drawn.pulleys]
    if len(drawn.pulleys) > 2:
        names += [f"speed {pulley}" for pulley in drawn.pulleys]
    return *names, *(f"arm T{a + 1}" for a in range(arms))


class Readings:
    """Places at which displacement and forces of a run are read.

    `belt_speed` is that of the driving pulley's rim at the speed that the job gives [m/s]. Path coordinates
    [m]: `probes`, (P, p), on the strands, and `places`, (PLACES,), of profiles.
    """

    def __init__(self, parameters: Parameters, drawn: Layout) -> None:
        p, path = parameters, drawn.path
        self.drawn, self.belt_speed = drawn, p["driving_speed"] * float(path.radius[0])
        starts = path.ends[::2]
        shares = np.arange(1, p["strand_probes"] + 1) / (p["strand_probes"] + 1.0)
        self.probes = starts[:, None] + path.spans[:, None] * shares
        self._places = Places(way(path), contact_slopes(p["contact_points"]), self.probes.ravel())
        self._line = Line(*np.zeros((3, p["elements"], POINTS)))
        self._sample = Sample(np.zeros(self.probes.size), *np.zeros((3, len(path.radius))))
        self._read = called_alike(read)
        self.places = (np.arange(PLACES) + 0.5) * (path.path_length / PLACES)

    def chords(self, drive: Drive, state: State) -> np.ndarray:
        """Offset from the drawn spans to the present ones at the probes, (P p,) [m]."""
        if not state.wheels.angle.size:
            return np.zeros(self.probes.size)
        path = self.drawn.path
        starts, ends = tangents(axes(drive.pulleys, state.wheels.angle[0]), path.radius, path.turn)
        forwards, right = directions(path.leaving), directions(path.leaving - 0.5 * np.pi)
        away = np.stack([starts, ends]) - span_starts(path)
        (first, last), (before, behind) = (away * forwards).sum(-1), (away * right).sum(-1)
        share = (self.probes - path.ends[::2, None] - first[:, None]) / (last - first)[:, None]
        return (before[:, None] + share * (behind - before)[:, None]).ravel()

    def mean_tension(self, drive: Drive, state: State) -> float:
        """Mean tension of all strands [N]."""
        return float(Reading(self, drive, state).strand_tensions.mean())


class Reading:
    """Readings of one sample, until the next one.

    To `sums`, (6, PLACES), profiles are added: length, tension and offset by it, forces, and samples at each
    place.

    Attributes
    ----------
    displacement : (P p,) array
        At the probes, to the right of the belt's way, off the tangents of the pulleys on their arms [m].
    strand_tensions : (P,) array
        Means over the middle half of the strands [N].
    lifted : (P,) array
        Whether no point of the belt touches a pulley.
    """

    def __init__(self, where: Readings, drive: Drive, state: State, sums: np.ndarray | None = None) -> None:
        self._where, self._drive, self._state = where, drive, state
        sums = np.zeros((len(PROFILES) + 2, 0)) if sums is None else sums
        found = where._sample
        where._read(drive, state, where._places, where._line, found, sums)
        self.strand_tensions, self._slip = found.tension, found.slip
        self.displacement = found.displacement - where.chords(drive, state)
        self.lifted = found.largest <= 0.0

    def scalars(self) -> list[float]:
        """Values of the names in `scalars_of`."""
        wheels, drawn = self._state.wheels, self._where.drawn
        speeds = drawn.path.turn * wheels.speed[0, : len(drawn.pulleys)]
        slip = drawn.path.turn * self._slip / self._where.belt_speed
        found = [float(speeds[drawn.driven]), *self.strand_tensions, *slip]
        return [*found, *(speeds if len(speeds) > 2 else ()), *wheels.angle[0]]


def stored_energy(drive: Drive, state: State) -> float:
    """Kinetic and elastic energy of belt, driven pulleys and arms [J], without that stored in contacts."""
    kinetic, elastic, _ = energies(drive.beam, state.chain.q, state.chain.v)
    pulleys, wheels = drive.pulleys, state.wheels
    count = len(pulleys.radius)
    turning = 0.5 * (pulleys.inertia[1:] * wheels.speed[0, 1:count] ** 2).sum()
    arms = arms_energy(pulleys.arms, wheels.angle[0], wheels.speed[0, count:])
    return kinetic + elastic + float(turning) + arms


class Places(NamedTuple):
    """Where a sample is read."""

    way: Way  # the reference path
    slopes: np.ndarray  # (C, 4): derivatives of the shapes at the contact points
    probes: np.ndarray  # (p,): path coordinates [m]


class Line(NamedTuple):
    """The belt at the Gauss points of its k elements, (k, POINTS) arrays."""

    # position, offset: path coordinate, and distance from the path to the right of the belt's way [m]
    position: np.ndarray
    offset: np.ndarray
    tension: np.ndarray  # [N]


class Sample(NamedTuple):
    """Readings of a belt on P pulleys at p probes."""

    displacement: np.ndarray  # shape (p,): to the right of the belt's way [m]
    tension: np.ndarray  # shape (P,): mean over the middle half of the spans [N]
    slip: np.ndarray  # shape (P,): mean sliding speed, counter-clockwise, weighed by normal forces [m/s]
    largest: np.ndarray  # shape (P,): normal force of the contact that is pressed most [N]


@kernel
def read(drive: Drive, state: State, places: Places, line: Line, sample: Sample, sums: np.ndarray) -> None:
    """Read a sample into `line` and `sample`.

    To `sums`, (6, place), profiles are added at equal shares of the path: length, tension and offset by it,
    normal force and force forwards per length, samples; none at no places.
    """
    beam, touch, way = drive.beam, state.touch, places.way
    _locate(way, beam, state.chain.q, line)
    _displace(line, places.probes, way.length, sample.displacement)
    for p in range(sample.tension.size):
        middle, quarter = way.begins[p, 1] + 0.5 * way.spans[p], 0.25 * way.spans[p]
        pull, length = 0.0, 0.0
        for i in range(beam.lengths.size):
            for c in range(POINTS):
                if abs(line.position[i, c] - middle) < quarter:
                    pull += beam.lengths[i] * WEIGHTS[c] * line.tension[i, c]
                    length += beam.lengths[i] * WEIGHTS[c]
        sample.tension[p] = pull / length
        pressed, slid, largest = 0.0, 0.0, 0.0
        for i in range(beam.lengths.size):
            for c in range(touch.normal.shape[2]):
                force = touch.normal[p, i, c]
                pressed += force
                slid += force * touch.memory.slip[p, i, c]
                largest = max(largest, force)
        sample.slip[p], sample.largest[p] = slid / max(pressed, 1e-9), largest
    if sums.shape[1] > 0:
        _add_profiles(drive, state, places, line, sums)


@kernel
def _locate(way: Way, beam: AncfBeam, q: np.ndarray, line: Line) -> None:
    """Fill a line, from the coordinates of the nodes (n, 4) [m], [1]."""
    n = q.shape[0]
    for i in range(beam.lengths.size):
        j, l0 = (i + 1) % n, beam.lengths[i]
        for c in range(POINTS):
            x, y = _at(SHAPES[c, 0], q, i, j, l0)
            sx, sy = _at(SHAPES[c, 1], q, i, j, l0)
            line.position[i, c], line.offset[i, c] = nearest(way, x, y, sx, sy)
            strain = 0.5 * ((sx * sx + sy * sy) / (l0 * l0) - 1.0)
            line.tension[i, c] = tension_of(beam.axial_stiffness, strain)


@kernel
def _at(shape: np.ndarray, q: np.ndarray, i: int, j: int, l0: float) -> tuple[float, float]:
    """Vector (x, y) by shapes (4,) of the element of length l0 [m] between nodes i and j of q (n, 4)."""
    x = shape[0] * q[i, 0] + shape[2] * q[j, 0] + l0 * (shape[1] * q[i, 2] + shape[3] * q[j, 2])
    y = shape[0] * q[i, 1] + shape[2] * q[j, 1] + l0 * (shape[1] * q[i, 3] + shape[3] * q[j, 3])
    return x, y


@kernel
def _displace(line: Line, probes: np.ndarray, length: float, found: np.ndarray) -> None:
    """Offsets (p,) at probes (p,) of a path of a length [m], linear between the points before and behind."""
    for p in range(probes.size):
        before, behind, of_before, of_behind = length, length, 0.0, 0.0
        for i in range(line.position.shape[0]):
            for c in range(POINTS):
                ahead = line.position[i, c] - probes[p]
                ahead = ahead + length if ahead < 0.0 else ahead
                if ahead < behind:
                    behind, of_behind = ahead, line.offset[i, c]
                if length - ahead < before:
                    before, of_before = length - ahead, line.offset[i, c]
        found[p] = (of_before * behind + of_behind * before) / (before + behind)


@kernel
def _add_profiles(drive: Drive, state: State, where: Places, line: Line, sums: np.ndarray) -> None:
    """Add a sample to the profiles, as `read` tells of them."""
    beam, contact, touch, way, q = drive.beam, drive.contact, state.touch, where.way, state.chain.stage_q
    places = sums.shape[1]
    per = places / way.length
    for i in range(beam.lengths.size):
        for c in range(POINTS):
            place, weight = min(int(line.position[i, c] * per), places - 1), beam.lengths[i] * WEIGHTS[c]
            sums[0, place] += weight
            sums[1, place] += weight * line.tension[i, c]
            sums[2, place] += weight * line.offset[i, c]
        j, l0 = (i + 1) % q.shape[0], beam.lengths[i]
        for c in range(contact.shape.shape[0]):
            normal, forwards = 0.0, 0.0
            for p in range(way.turn.size):
                normal += touch.normal[p, i, c]
                forwards += way.turn[p] * touch.tangential[p, i, c]
            if normal > 0.0:
                x, y = _at(contact.shape[c], q, i, j, l0)
                sx, sy = _at(where.slopes[c], q, i, j, l0)
                place = min(int(nearest(way, x, y, sx, sy)[0] * per), places - 1)
                sums[3, place] += per * normal
                sums[4, place] += per * forwards
    for place in range(places):
        sums[5, place] += 1.0
