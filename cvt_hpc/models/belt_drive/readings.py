"""Readings of a belt drive at a sample: displacement, tensions, sliding, forces along the path."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.belt_drive.along_belt import empty_line, empty_sample, read
from cvt_hpc.models.belt_drive.contact import contact_slopes
from cvt_hpc.models.belt_drive.drive import Drive, State
from cvt_hpc.models.belt_drive.layout import Layout
from cvt_hpc.models.belt_drive.pulleys import arms_energy, axes
from cvt_hpc.multibody.ancf_beam import energies
from cvt_hpc.physics.belt_path import directions, span_starts, tangents
from cvt_hpc.physics.nearest_on_path import way

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
    """Where displacement and forces of a run are read.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    drawn : Layout
        Its pulleys.

    Attributes
    ----------
    drawn : Layout
        With the reference path.
    belt_speed : float
        Of the driving pulley's rim at the speed that the job gives [m/s].
    probes : (P, p) array
        Path coordinates on the strands [m].
    places : (PLACES,) array
        Path coordinates of profiles [m].
    """

    def __init__(self, parameters: Mapping[str, Any], drawn: Layout) -> None:
        p, path = parameters, drawn.path
        self.drawn, self.belt_speed = drawn, p["driving_speed"] * float(path.radius[0])
        starts = path.ends[::2]
        shares = np.arange(1, p["strand_probes"] + 1) / (p["strand_probes"] + 1.0)
        self.probes = starts[:, None] + path.spans[:, None] * shares
        self._way, self._line = way(path), empty_line(p["elements"])
        self._sample = empty_sample(self.probes.size, len(path.radius))
        self._read = called_alike(read)
        self._slopes = contact_slopes(p["contact_points"])
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

    Parameters
    ----------
    where : Readings
        Where it is read.
    drive, state : Drive, State
        The moving parts, and their motion.
    sums : (6, PLACES) array, optional
        To which profiles are added: length, tension and offset by it, forces, and samples at each place.

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
        belt, contacts = (drive.beam, state.chain), (drive.contact, state.touch)
        found, points = where._sample, (where._slopes, where.probes.ravel())
        where._read(where._way, *belt, *contacts, *points, where._line, found, sums)
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
