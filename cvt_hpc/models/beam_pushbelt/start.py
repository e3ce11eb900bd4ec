"""Start of a pushbelt on a ring of beams from the geometry of its path."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt.belt import BeltState, Workspace
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import Belt
from cvt_hpc.models.pushbelt.start import belt_of, equal_chords, pitch_line
from cvt_hpc.multibody.rcm_beam import RcmBeam, line_point, mean_strain
from cvt_hpc.multibody.rcm_chain import PER_ELEMENT, Chain, close, relaxed_ring
from cvt_hpc.physics.geometry import Variator
from cvt_hpc.solvers.cyclic_blocks import empty_columns
from cvt_hpc.variator.history import points_at

UNIT_IMPULSES = 16  # on the ring, that are solved for at a time: two registers


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
