"""A transient run of the pushbelt on a ring of beams, recorded as one of `pushbelt`.

A run starts from the geometry of its path. An element takes the fields of `pushbelt.belt`, so that both
models are read off alike, and those of `fields`.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.beam_pushbelt import as_pushbelt, rcm
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt.ring import PER_BEAM, Ring, close, relaxed_ring, stored_energy
from cvt_hpc.models.beam_pushbelt.step import advance
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt import transient as pushbelt
from cvt_hpc.models.pushbelt.belt import Belt, equal_chords, outset
from cvt_hpc.models.pushbelt.parameters import path_length
from cvt_hpc.models.pushbelt.readings import Reading
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import Variator
from cvt_hpc.solvers.cyclic_blocks import empty_columns
from cvt_hpc.variator.history import points_at

LAW_TOLERANCE = 1e-5  # [m/s]: up to this speed a set-valued law counts as fulfilled (`step.advance`)
_UNIT_IMPULSES = 16  # on the ring, that are solved for at a time: two registers

CHANNELS = pushbelt.CHANNELS


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on; the last three as `pushbelt.belt.BeltState` has them."""

    ring: Ring
    elements: np.ndarray  # (n, FIELDS), in the order of the belt
    pulleys: np.ndarray
    totals: np.ndarray
    counters: np.ndarray


class Workspace(NamedTuple):
    """Work space of `step.advance` for n elements on k beams; m is 2 n up to whole lanes."""

    step: np.ndarray  # (n, STEP_FIELDS): geometry and impulses of a step
    beams: np.ndarray  # (n,): on which beam an element is
    rows: np.ndarray  # (n, ROWS, 8): rows of the ring's coordinates at the elements
    middle: np.ndarray  # (5 k + 3,): coordinates of the ring at mid step
    columns: LaneArray  # (k + 1, 5): unit impulses on the ring, as many at a time as it has lanes
    # (n, 2, m): speeds of the ring at an element, across and along, by impulses across (column 2 f) and along
    # (2 f + 1) at element f [1/kg]
    coupling: np.ndarray
    impulses: np.ndarray  # (m,): that friction has added to those of the last step [N s]
    inputs: np.ndarray  # (INPUTS,): of the step


class Transient(pushbelt.Transient):
    """One run, as `pushbelt.transient.Transient` has it."""

    def _begin(self, p: Parameters) -> None:
        self._advance = called_alike(advance)
        self._belt, self._state = start(p)
        self._work = workspace(self._state.ring, p["elements"])
        self._method = LAW_TOLERANCE

    def _reached(self) -> tuple[np.ndarray, ...]:
        elements, ring = self._state.elements, self._state.ring
        return elements, ring.q, ring.u, *self._state[2:], *self._recorded()

    def _elements(self) -> np.ndarray:
        return self._state.elements

    def _by_field(self) -> np.ndarray:
        return self._state.elements.T

    def _stored_energy(self, found: Reading) -> float:
        e, belt = self._state.elements, self._belt
        kinetic = belt.mass * (e[:, [f.U_Y, f.U_Z]] ** 2).sum() + belt.inertia * (e[:, f.OMEGA] ** 2).sum()
        kinetic += belt.driven_inertia * self._state.pulleys[f.DRIVEN_SPEED] ** 2
        pressed = (e[:, [f.EDGE, f.HEAD]] ** 2).sum() / belt.contact_stiffness
        pressed += 2.0 * (e[:, f.FLANK] ** 2).sum() / belt.flank_stiffness
        return stored_energy(self._state.ring) + 0.5 * float(kinetic + pressed)

    def _most_open(self) -> float:
        return self._most_damped()  # the balance holds the damping of steps


batch = batches_of_one(Transient)
forget = pushbelt.forget


def ring_on_path(
    path: Variator, centre_distance: float, beam: rcm.RcmBeam, beams: int, strain: float, speed: float
) -> Ring:
    """A ring that lies along a path [m], nodes and quarter points on it, and runs along it at a speed [m/s].

    All beams have one `strain`; their length is found here, that of `beam` does not count.
    """
    around = path.path_length
    nodes = np.arange(beams + 1) * around / beams
    length = around / beams / (1.0 + strain)
    for _ in range(100):
        q = _coordinates(path, centre_distance, nodes)
        strains = np.array([rcm.mean_strain(length, q[5 * i : 5 * i + 8]) for i in range(beams)])
        if abs(strains - strain).max() < 1e-12:
            break
        # parts of the path in proportion to their missing length, and the length by the sum of these
        parts = np.diff(nodes) * (1.0 + strains.mean()) / (1.0 + strains)
        nodes = np.concatenate([[0.0], np.cumsum(parts * around / parts.sum())])
        length *= (1.0 + strains.mean()) / (1.0 + strain)
    else:
        raise ValueError("the ring's beams cannot all have one strain along this path")
    ring = relaxed_ring(beam._replace(length=length), beams)
    ring.q[:] = q
    ahead = 1e-6 * around  # of which all differences are above rounding
    forth, back = (_coordinates(path, centre_distance, nodes + shift) for shift in (ahead, -ahead))
    change = forth - back
    change[2::PER_BEAM] = np.mod(change[2::PER_BEAM] + np.pi, 2.0 * np.pi) - np.pi
    ring.u[:] = speed * change / (2.0 * ahead)
    close(ring)
    return ring


def _coordinates(path: Variator, centre_distance: float, nodes: np.ndarray) -> np.ndarray:
    """Coordinates of a ring (5 k + 3,) with its nodes at path coordinates (k + 1,) [m]."""
    quarters = 0.25 * np.diff(nodes)
    ends, angles, _ = points_at(path, centre_distance, nodes)
    turns = np.mod(np.diff(angles) + np.pi, 2.0 * np.pi) - np.pi
    angles = angles[0] + np.concatenate([[0.0], np.cumsum(turns)])
    normals = np.stack([-np.sin(angles), np.cos(angles)], 1)
    first, _, _ = points_at(path, centre_distance, nodes[:-1] + quarters)
    second, _, _ = points_at(path, centre_distance, nodes[1:] - quarters)
    q = np.zeros((len(nodes), PER_BEAM))
    q[:, :2], q[:, 2] = ends, angles
    q[:-1, 3] = ((first - ends[:-1]) * normals[:-1]).sum(axis=1)
    q[:-1, 4] = ((second - ends[1:]) * normals[1:]).sum(axis=1)
    return q.ravel()[: 5 * len(nodes) - 2]


def start(parameters: Parameters) -> tuple[Belt, BeltState]:
    """Constants and a state from which a belt can run in: a ring along the ideal path, at its speed.

    Elements have equal chords; the ring has an even strain, and without load it is a circle.
    """
    p, (belt, pitch, strain) = parameters, outset(as_pushbelt(parameters))
    path, depth, beams = pitch.path, belt.pitch_depth, p["ring_beams"]
    radii = path.driving_radius + depth, path.driven_radius + depth
    line = Variator(*radii, path.driving_wrap, path.driven_wrap, path.strand_length)
    around = line.path_length
    line_mass = p["ring_mass"] * path_length(p) * (1.0 + strain) / around
    curvature = 2.0 * np.pi * (1.0 + strain) / around
    beam = rcm.RcmBeam(around / beams, line_mass, p["ring_stiffness"], p["ring_bending_stiffness"], curvature)
    running = pitch.speed * around / path.path_length
    ring = ring_on_path(line, belt.centre_distance, beam, beams, strain, running)
    elements = _elements(belt, ring, p["elements"], pitch.speed)
    return belt, BeltState(ring, elements, pitch.pulleys, np.zeros(f.TOTALS), np.zeros(f.COUNTERS, np.int64))


def _elements(belt: Belt, ring: Ring, n: int, speed: float) -> np.ndarray:
    """Fields (n, FIELDS) of elements with equal chords on a ring, at a speed of the pitch line [m/s]."""
    length, beams = ring.beam.length, ring.q.size // PER_BEAM
    rows = np.zeros((2, 8))

    def on_ring(place: float) -> tuple[rcm.LinePoint, np.ndarray]:
        beam = min(int(place / length), beams - 1)
        its = slice(5 * beam, 5 * beam + 8)
        return rcm.line_point(length, ring.q[its], place - (beam + 0.5) * length, *rows), ring.u[its]

    def pitch_points(places: np.ndarray) -> np.ndarray:
        points = [on_ring(place)[0] for place in places]
        return np.array([(p.x - belt.pitch_depth * p.sin, p.y + belt.pitch_depth * p.cos) for p in points])

    places, _ = equal_chords(pitch_points, length * beams, n)
    pitch = pitch_points(places)
    along = np.roll(pitch, -1, axis=0) - np.roll(pitch, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    e = np.zeros((n, b.FIELDS))
    e[:, b.PLACE], e[:, f.LENGTH] = places, np.diff(np.append(places, length * beams))
    e[:, [f.HEADING_Y, f.HEADING_Z]] = along
    for j in range(n):
        p, u = on_ring(places[j])
        bend = p.bend / p.stretch
        c, w, z = speed * (1.0 + belt.pitch_depth * bend), rows[1] @ u, rows[0] @ u
        e[j, [f.Y, f.Z]] = p.x, p.y
        e[j, [f.U_Y, f.U_Z]] = c * p.cos - w * p.sin, c * p.sin + w * p.cos
        e[j, f.OMEGA], e[j, f.V], e[j, b.PLACE_RATE] = speed * bend, z, (c - z) / p.stretch
    return e


def workspace(ring: Ring, elements: int) -> Workspace:
    """Work space for so many elements on a ring."""
    n, whole = elements, -(-2 * elements // _UNIT_IMPULSES) * _UNIT_IMPULSES
    return Workspace(
        step=np.zeros((n, b.STEP_FIELDS)),
        beams=np.zeros(n, np.int64),
        rows=np.zeros((n, b.ROWS, 8)),
        middle=np.zeros(ring.q.size),
        columns=empty_columns(ring.blocks.data.shape[0] - 1, PER_BEAM, _UNIT_IMPULSES),
        coupling=np.zeros((n, 2, whole)),
        impulses=np.zeros(whole),
        inputs=np.zeros(f.INPUTS),
    )
