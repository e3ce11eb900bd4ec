"""What is recorded of the belt at each sampling instant, and when a run has to be stopped."""

from __future__ import annotations

from enum import IntEnum
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import (
    DRIVEN_POSITION,
    DRIVEN_SPEED,
    REGIONS,
    TIME,
    V_ELEMENT,
    Belt,
    Mesh,
    State,
    W,
)
from cvt_hpc.models.elastic_belt.power import POWERS, audit
from cvt_hpc.models.elastic_belt.record import MODES
from cvt_hpc.models.elastic_belt.rhs import contact_forces, load_at, strains
from cvt_hpc.physics.compliance import ContactState, Sheaves

SCALARS = (
    "load",
    "driven_speed",
    "driven_position",
    "ring_tension t1",
    "ring_tension t2",
    "push_force t1",
    "push_force t2",
    "axial_force driving",
    "axial_force driven",
    "slip driving",
    "slip driven",
    "open_share driving",
    "open_share driven",
    "least_strand_force",
)
CHANNELS = SCALARS + POWERS
PROFILES = ("ring_tension", "push_force", "contact_force", "mean_displacement")

LARGEST_DISPLACEMENT = 10e-3  # [m]: the belt has left its grooves
LARGEST_STRAIN = 0.05  # of the rings, which break at 1 %
LARGEST_ELEMENT_STRAIN = 0.2  # gaps of a fifth: all the play in a few cells
LEAST_SPEED = 0.5  # of the driven pulley's nominal speed: beyond the torque that friction carries


class Outcome(IntEnum):
    """Why a march ended."""

    OK = 0
    NO_CONTACT_SOLUTION = 1
    NOT_FINITE = 2
    LEFT_THE_GROOVES = 3
    OVERSTRAINED = 4
    SLIPPED_THROUGH = 5


class Sensors(NamedTuple):
    """Where displacement is sensed.

    Attributes
    ----------
    matrix : (S, N) array
        Weights of the stations' displacement: first the probes, then MODES sine amplitudes of each strand,
        measured from the chord between its ends.
    middles : (2,) int array
        Cell in the middle of each strand.
    starts, stops : (2,) int arrays
        First cell of each strand and the one behind its last.
    """

    matrix: np.ndarray
    middles: np.ndarray
    starts: np.ndarray
    stops: np.ndarray


class Probe(NamedTuple):
    """A place on the path: label, that begins with the region, and path coordinate s [m]."""

    label: str
    position: float


def probes(grid: Mesh, per_strand: int, per_arc: int) -> tuple[Probe, ...]:
    """Equally spaced probes of all regions, strands first.

    Parameters
    ----------
    grid : Mesh
        The belt's mesh.
    per_strand, per_arc : int
        Their number in each region, the region's ends excluded.
    """
    places = []
    for region in (1, 3, 0, 2):
        count = per_strand if region % 2 else per_arc
        start, length = grid.position[grid.starts[region]], grid.path.lengths[region]
        for k in range(1, count + 1):
            share = Fraction(k, count + 1)
            places.append(Probe(f"{REGIONS[region]} {share}", start + float(share) * length))
    return tuple(places)


def sensors(grid: Mesh, places: tuple[Probe, ...]) -> Sensors:
    """Weights that turn the stations' displacement into that of probes and of the strands' modes."""
    n = grid.cell.size
    ends = np.append(grid.position, grid.path.path_length)
    rows = []
    for place in places:
        row = np.zeros(n)
        j = min(int(np.searchsorted(ends, place.position, side="right")) - 1, n - 1)
        share = (place.position - ends[j]) / grid.cell[j]
        row[j], row[(j + 1) % n] = 1.0 - share, share
        rows.append(row)
    for region in (1, 3):
        first, count = grid.starts[region], grid.counts[region]
        x = np.arange(count) / count
        for k in range(1, MODES + 1):
            shape = np.sin(k * np.pi * x) * 2.0 / count
            row = np.zeros(n)
            row[first : first + count] = shape
            row[first] -= shape @ (1.0 - x)
            row[(first + count) % n] -= shape @ x
            rows.append(row)
    starts = np.array([grid.starts[1], grid.starts[3]])
    stops = starts + np.array([grid.counts[1], grid.counts[3]])
    return Sensors(np.array(rows), (starts + stops) // 2, starts, stops)


@kernel
def sample(
    belt: Belt,
    state: State,
    contacts: tuple[ContactState, ContactState],
    sensing: Sensors,
    row: np.ndarray,
    profiles: np.ndarray,
    scratch: np.ndarray,
) -> int:
    """Record a state.

    Parameters
    ----------
    belt, state, contacts
        Constants, state and the contact solver's memory.
    sensing : Sensors
        S rows.
    row : (S + C,) array
        Result: the sensors, then CHANNELS.
    profiles : (4, N) array
        PROFILES of this state are added to it; those of cells are averaged onto stations.
    scratch : (3, N) array
        Work space.

    Returns
    -------
    int
        An `Outcome`.
    """
    n, count = belt.cell.size, sensing.matrix.shape[0]
    w = state.fields[W]
    for j in range(n):
        for field in range(state.fields.shape[0]):
            if not np.isfinite(state.fields[field, j]):
                return 2
        if abs(w[j]) > LARGEST_DISPLACEMENT:
            return 3
    driven_speed = state.scalars[DRIVEN_SPEED]
    if not (np.isfinite(driven_speed) and np.isfinite(state.scalars[DRIVEN_POSITION])):
        return 2
    if driven_speed < LEAST_SPEED * belt.driving_speed / belt.ratio:
        return 5
    force, eps = scratch[0], scratch[1:3]
    if contact_forces(belt, state, contacts, force) == 0:
        return 1
    strains(belt, state.fields, eps)
    for j in range(n):
        if abs(eps[1, j]) > LARGEST_STRAIN or abs(eps[0, j]) > LARGEST_ELEMENT_STRAIN:
            return 4
    for k in range(count):
        total = 0.0
        for j in range(n):
            total += sensing.matrix[k, j] * w[j]
        row[k] = total
    out = row[count:]
    out[0] = load_at(belt, state.scalars[TIME])
    out[1], out[2] = driven_speed, state.scalars[DRIVEN_POSITION]
    centrifugal = belt.mass * belt.belt_speed * belt.belt_speed
    least = np.inf
    for strand in range(2):
        middle = sensing.middles[strand]
        out[3 + strand] = belt.ring_stiffness * eps[1, middle]
        out[5 + strand] = max(-belt.element_stiffness * eps[0, middle], 0.0)
        for c in range(sensing.starts[strand], sensing.stops[strand]):
            net = belt.ring_stiffness * eps[1, c] + belt.element_stiffness * min(eps[0, c], 0.0)
            least = min(least, net - centrifugal)
    out[13] = least
    out[7], out[9], out[11] = _wrap(belt, belt.driving, state, force, 0)
    out[8], out[10], out[12] = _wrap(belt, belt.driven, state, force, belt.driven_start)
    audit(belt, state, force, eps, out[8], out[14:])
    for j in range(n):
        a = j - 1 if j > 0 else n - 1
        profiles[0, j] += 0.5 * belt.ring_stiffness * (eps[1, a] + eps[1, j])
        profiles[1, j] -= 0.5 * belt.element_stiffness * (min(eps[0, a], 0.0) + min(eps[0, j], 0.0))
        profiles[2, j] += force[j]
        profiles[3, j] += w[j]
    return 0


@kernel
def _wrap(
    belt: Belt, sheave: Sheaves, state: State, force: np.ndarray, first: int
) -> tuple[float, float, float]:
    """Axial force [N], force-weighted tangential sliding over belt speed, share of open stations."""
    axial = sliding = open_length = length = 0.0
    for k in range(sheave.weight.size):
        j = first + k
        weight = sheave.weight[k]
        if first > 0:
            surface = state.scalars[DRIVEN_SPEED] * (belt.driven_radius + state.fields[W, j])
        else:
            surface = belt.driving_speed * (belt.driving_radius + state.fields[W, j])
        axial += weight * force[j]
        sliding += weight * force[j] * (state.fields[V_ELEMENT, j] - surface)
        open_length += weight * (force[j] == 0.0)
        length += weight
    return axial, sliding / (max(axial, 1e-9) * belt.belt_speed), open_length / length
