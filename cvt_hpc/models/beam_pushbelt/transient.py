"""A transient run of the pushbelt on a ring of beams, recorded as one of `pushbelt`.

A run starts from the geometry of its path. State and work space are as the kernels take them. An element
takes the fields of `pushbelt.belt`, so that both models are read off alike, and those below.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt.parameters import as_pushbelt
from cvt_hpc.models.beam_pushbelt.step import advance
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt import transient as pushbelt
from cvt_hpc.models.pushbelt.belt import Belt, belt_of, equal_chords, pitch_line
from cvt_hpc.models.pushbelt.readings import Reading
from cvt_hpc.models.pushbelt.run import OF_LOSS
from cvt_hpc.models.sampled import MOST_UNSOLVED
from cvt_hpc.multibody.rcm_beam import RcmBeam, energies, line_point, mean_strain
from cvt_hpc.multibody.rcm_chain import PER_ELEMENT, Chain, close, relaxed_ring
from cvt_hpc.physics.geometry import Variator
from cvt_hpc.solvers.cyclic_blocks import empty_columns
from cvt_hpc.variables import Status
from cvt_hpc.variator.history import points_at

UNIT_IMPULSES = 16  # on the ring, that are solved for at a time: two registers

CHANNELS = pushbelt.CHANNELS


class Proximal(NamedTuple):
    """How the set-valued laws of a step are solved, and how implicit the ring is.

    Attributes
    ----------
    theta : float
        0: the ring's elasticity is explicit; 1/2 to 1: linearly implicit (`step`).
    tolerance : float
        Speed up to which a law counts as fulfilled [m/s]; impulses count by the speed that they change.
    most_sweeps : int
        Sweeps over all contacts in a step.
    free_sweeps : int
        Sweeps in which the bounds of ring friction follow its normal forces.
    most_failures : int
        Unsolved steps in a row with which a run ends.
    """

    theta: float = 0.5
    tolerance: float = 1e-5
    most_sweeps: int = 500
    free_sweeps: int = 200
    most_failures: int = 20


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on.

    Attributes
    ----------
    ring : Chain
        The ring, and the work space of its equations.
    elements : (n, FIELDS) array
        In the order of the belt.
    pulleys : (4,) array
        As `pushbelt.belt.BeltState` has them.
    totals : (TOTALS,) array
        Likewise.
    counters : (COUNTERS,) int array
        Work done, and how the last call ended.
    """

    ring: Chain
    elements: np.ndarray
    pulleys: np.ndarray
    totals: np.ndarray
    counters: np.ndarray


class Workspace(NamedTuple):
    """Work space of `step.advance`, which is not needed afterwards.

    Attributes
    ----------
    step : (n, STEP_FIELDS) array
        Geometry and impulses of a step.
    beams : (n,) int array
        On which beam an element is.
    rows : (n, ROWS, 8) array
        Rows of the ring's coordinates at the elements.
    middle : (5 k + 3,) array
        Coordinates of the ring at mid step.
    columns : (k + 1, 5) LaneArray
        Unit impulses on the ring, as many at a time as it has lanes.
    coupling : (n, 2, m) array
        Speeds of the ring at an element, across and along, by impulses on it: columns 2 f and 2 f + 1 are
        those across and along at element f; m is 2 n up to whole lanes [1/kg].
    impulses : (m,) array
        Impulses that friction has added to those of the last step [N s].
    free : (n, 3) array
        Both speeds of the ring at the elements without them [m/s], and the saddles' impulses [N s].
    inputs : (INPUTS,) array
        Inputs of the step.
    """

    step: np.ndarray
    beams: np.ndarray
    rows: np.ndarray
    middle: np.ndarray
    columns: LaneArray
    coupling: np.ndarray
    impulses: np.ndarray
    free: np.ndarray
    inputs: np.ndarray


class Transient(pushbelt.Transient):
    """One run, as `pushbelt.transient.Transient` has it."""

    def _begin(self, p: Mapping[str, Any]) -> None:
        self._advance = called_alike(advance)
        self._belt, self._state = start(pushbelt.given(as_pushbelt(p)))
        self._work = workspace(self._state.ring, p["elements"])
        self._method = Proximal(p["theta"], p["law_tolerance"], p["most_sweeps"])

    def _reached(self) -> tuple[np.ndarray, ...]:
        elements, ring = self._state.elements, self._state.ring
        return elements, ring.q, ring.u, *self._state[2:], *self._recorded()

    def _elements(self) -> np.ndarray:
        return self._state.elements

    def _by_field(self) -> np.ndarray:
        return self._state.elements.T

    def _stored_energy(self, found: Reading) -> float:
        e, belt, ring = self._state.elements, self._belt, self._state.ring
        kinetic = belt.mass * (e[:, [f.U_Y, f.U_Z]] ** 2).sum()
        kinetic += belt.inertia * (e[:, f.OMEGA] ** 2).sum()
        kinetic += belt.driven_inertia * self._state.pulleys[f.DRIVEN_SPEED] ** 2
        pressed = (e[:, [f.EDGE, f.HEAD]] ** 2).sum() / belt.contact_stiffness
        pressed += 2.0 * (e[:, f.FLANK] ** 2).sum() / belt.flank_stiffness
        parts = range(0, ring.q.size - 3, 5)
        of_ring = sum(sum(energies(ring.beam, ring.q[i : i + 8], ring.u[i : i + 8])) for i in parts)
        return of_ring + 0.5 * float(kinetic + pressed)

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """As of `pushbelt`; but the balance holds the damping of steps, which is free for theta above 1/2."""
        unsolved, flow = record["unsolved_share"], max(abs(record["driving_power"]), record["loss"])
        either = (self._most_damped() + OF_LOSS * record["loss"]) / flow
        most = either if self._method.theta <= 0.5 else np.inf
        if not unsolved <= MOST_UNSOLVED:
            why = f"{unsolved:.1%} of the steps were not solved, the last {self._fault()}"
        elif not -either <= record["power_residual"] <= most:
            why = f"the power balance is open by {record['power_residual']:.3g}, not by {either:.3g} or less"
        else:
            return None
        return Status.FAILED_NUMERICS, why

    def counters(self) -> dict[str, int]:
        """Work done so far: steps, sweeps as iterations, unsolved steps, corrections of impulses."""
        return super().counters() | {"corrections": int(self._state.counters[b.CORRECTIONS])}


batch = batches_of_one(Transient)
forget = pushbelt.forget


def ring_on_path(
    path: Variator, centre_distance: float, beam: RcmBeam, beams: int, strain: float, speed: float
) -> Chain:
    """A ring that lies along a path, stretched alike everywhere.

    Parameters
    ----------
    path : Variator
        The line of the ring.
    centre_distance : float
        [m]
    beam : RcmBeam
        Constants of a beam; the length is found here.
    beams : int
        Their number.
    strain : float
        Of each beam.
    speed : float
        With which the ring runs along the path [m/s].

    Returns
    -------
    Chain
        Nodes and quarter points on the path.
    """
    around = path.path_length
    nodes = np.arange(beams + 1) * around / beams
    length = around / beams / (1.0 + strain)
    for _ in range(100):
        q = _coordinates(path, centre_distance, nodes)
        strains = np.array([mean_strain(length, q[5 * i : 5 * i + 8]) for i in range(beams)])
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
    change[2::PER_ELEMENT] = np.mod(change[2::PER_ELEMENT] + np.pi, 2.0 * np.pi) - np.pi
    ring.u[:] = speed * change / (2.0 * ahead)
    close(ring)
    return ring


def _coordinates(path: Variator, centre_distance: float, nodes: np.ndarray) -> np.ndarray:
    """Coordinates of a ring (5 k + 3,) with its nodes at path coordinates (k + 1,) [m]."""
    quarters = 0.25 * np.diff(nodes)
    ends, angles, _ = points_at(path, centre_distance, nodes)
    angles = angles[0] + np.concatenate(
        [[0.0], np.cumsum(np.mod(np.diff(angles) + np.pi, 2.0 * np.pi) - np.pi)]
    )
    normals = np.stack([-np.sin(angles), np.cos(angles)], 1)
    first, _, _ = points_at(path, centre_distance, nodes[:-1] + quarters)
    second, _, _ = points_at(path, centre_distance, nodes[1:] - quarters)
    q = np.zeros((len(nodes), PER_ELEMENT))
    q[:, :2], q[:, 2] = ends, angles
    q[:-1, 3] = ((first - ends[:-1]) * normals[:-1]).sum(axis=1)
    q[:-1, 4] = ((second - ends[1:]) * normals[1:]).sum(axis=1)
    return q.ravel()[: 5 * len(nodes) - 2]


def start(given: Mapping[str, Any]) -> tuple[Belt, BeltState]:
    """Constants and a state from which a belt can run in: a ring along the ideal path, at its speed.

    Parameters
    ----------
    given : mapping
        Values [SI] as `pushbelt.start.start` takes them; beside them `ring_beams`, their number, and
        `ring_bending_stiffness` [N m^2].

    Returns
    -------
    Belt, BeltState
        Elements with equal chords; the ring has the strain `ring_strain`, and without load it is a circle.
    """
    g, pitch = given, pitch_line(given)
    belt, path, speed = belt_of(g, pitch.chord), pitch.path, pitch.speed
    depth = belt.pitch_depth
    line = Variator(
        path.driving_radius + depth,
        path.driven_radius + depth,
        path.driving_wrap,
        path.driven_wrap,
        path.strand_length,
    )
    around = line.path_length
    line_mass = g["ring_mass"] * (1.0 + g["ring_strain"]) / around
    beam = RcmBeam(
        around / g["ring_beams"],
        line_mass,
        g["ring_stiffness"],
        g["ring_bending_stiffness"],
        2.0 * np.pi * (1.0 + g["ring_strain"]) / around,
    )
    running = speed * around / path.path_length
    ring = ring_on_path(line, belt.centre_distance, beam, g["ring_beams"], g["ring_strain"], running)
    elements = _elements(belt, ring, g["elements"], speed)
    return belt, BeltState(ring, elements, pitch.pulleys, np.zeros(f.TOTALS), np.zeros(b.COUNTERS, np.int64))


def _elements(belt: Belt, ring: Chain, n: int, speed: float) -> np.ndarray:
    """Fields (n, FIELDS) of elements with equal chords on a ring, at a speed of the pitch line [m/s]."""
    around = ring.beam.length * (ring.q.size // PER_ELEMENT)
    rows = np.zeros((2, 8))

    def on_ring(place: float) -> tuple[Any, np.ndarray]:
        beam = min(int(place / ring.beam.length), ring.q.size // PER_ELEMENT - 1)
        q = ring.q[5 * beam : 5 * beam + 8]
        local = place - (beam + 0.5) * ring.beam.length
        return line_point(ring.beam.length, q, local, *rows), ring.u[5 * beam : 5 * beam + 8]

    def pitch_points(places: np.ndarray) -> np.ndarray:
        points = [on_ring(place)[0] for place in places]
        return np.array([(p.x - belt.pitch_depth * p.sin, p.y + belt.pitch_depth * p.cos) for p in points])

    places, _ = equal_chords(pitch_points, around, n)
    pitch = pitch_points(places)
    along = np.roll(pitch, -1, axis=0) - np.roll(pitch, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    e = np.zeros((n, b.FIELDS))
    e[:, b.PLACE], e[:, f.LENGTH] = places, np.diff(np.append(places, around))
    e[:, [f.HEADING_Y, f.HEADING_Z]] = along
    for j in range(n):
        p, u = on_ring(places[j])
        bend = p.bend / p.stretch
        c, w, z = speed * (1.0 + belt.pitch_depth * bend), rows[1] @ u, rows[0] @ u
        e[j, [f.Y, f.Z]] = p.x, p.y
        e[j, [f.U_Y, f.U_Z]] = c * p.cos - w * p.sin, c * p.sin + w * p.cos
        e[j, f.OMEGA], e[j, f.V], e[j, b.PLACE_RATE] = speed * bend, z, (c - z) / p.stretch
    return e


def workspace(ring: Chain, elements: int) -> Workspace:
    """Work space for so many elements on a ring."""
    n, nodes = elements, ring.blocks.data.shape[0] - 1
    whole = -(-2 * n // UNIT_IMPULSES) * UNIT_IMPULSES
    return Workspace(
        step=np.zeros((n, b.STEP_FIELDS)),
        beams=np.zeros(n, np.int64),
        rows=np.zeros((n, b.ROWS, 8)),
        middle=np.zeros(ring.q.size),
        columns=empty_columns(nodes, PER_ELEMENT, UNIT_IMPULSES),
        coupling=np.zeros((n, 2, whole)),
        impulses=np.zeros(whole),
        free=np.zeros((n, 3)),
        inputs=np.zeros(f.INPUTS),
    )
