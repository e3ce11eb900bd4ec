"""What is read off a belt drive at a sample: displacement, tensions, sliding, forces along the path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.belt_drive.drive import Drive, State
from cvt_hpc.models.belt_drive.layout import Layout
from cvt_hpc.models.belt_drive.pulleys import arms_energy
from cvt_hpc.multibody.ancf_beam import SHAPES, WEIGHTS, at_places, energies, shapes, tensions
from cvt_hpc.physics.belt_path import along

PROFILES = {
    "tension": ("tension", "N", "mean"),
    "normal_force": ("normal force", "N m-1", "mean line force, outwards of the pulley"),
    "friction_force": ("friction force", "N m-1", "mean line force on the belt, forwards"),
    "mean_displacement": ("mean displacement", "m", "off the reference path, to the right of the belt's way"),
}
PLACES = 240  # along the path, at which profiles are recorded: 5 mm of a belt of 1.2 m


def scalars_of(drawn: Layout, arms: int) -> tuple[str, ...]:
    """Names of what is read at a sample beside displacement."""
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
        self._middles = starts + 0.5 * path.spans
        self._contacts = shapes((np.arange(p["contact_points"]) + 0.5) / p["contact_points"])[1]
        self.places = (np.arange(PLACES) + 0.5) * (path.path_length / PLACES)

    def mean_tension(self, drive: Drive, state: State) -> float:
        """Mean tension of all strands [N]."""
        return float(np.mean(Reading(self, drive, state).strand_tensions()))


class Reading:
    """What is read at one sample.

    Parameters
    ----------
    where : Readings
        Where it is read.
    drive, state : Drive, State
        What moves, and its motion.
    """

    def __init__(self, where: Readings, drive: Drive, state: State) -> None:
        self._where, self._drive, self._state = where, drive, state
        self._path = where.drawn.path
        places = (at_places(drive.beam, state.chain.q, SHAPES[:, k]).reshape(-1, 2) for k in (0, 1))
        self._position, self._offset = along(self._path, *places)
        self._tension = tensions(drive.beam, state.chain.q).ravel()
        self._weight = (drive.beam.lengths[:, None] * WEIGHTS).ravel()

    def displacement(self) -> np.ndarray:
        """Displacement at the probes, to the right of the belt's way, (P p,) [m]."""
        order, length = np.argsort(self._position), self._path.path_length
        return np.interp(
            self._where.probes.ravel(), self._position[order], self._offset[order], period=length
        )

    def strand_tensions(self) -> np.ndarray:
        """Mean tension over the middle half of the strands, (P,) [N]."""
        quarter = 0.25 * self._path.spans[:, None]
        inside = np.abs(self._position - self._where._middles[:, None]) < quarter
        weights = inside * self._weight
        return weights @ self._tension / weights.sum(axis=1)

    def scalars(self) -> list[float]:
        """What `scalars_of` names."""
        touch, wheels, drawn = self._state.touch, self._state.wheels, self._where.drawn
        speeds = drawn.path.turn * wheels.speed[0, : len(drawn.pulleys)]
        pressed = np.maximum(touch.normal.sum(axis=(1, 2)), 1e-9)
        slid = (touch.normal * touch.slip).sum(axis=(1, 2)) / pressed
        slip = drawn.path.turn * slid / self._where.belt_speed
        found = [float(speeds[drawn.driven]), *self.strand_tensions(), *slip]
        return [*found, *(speeds if len(speeds) > 2 else ()), *wheels.angle[0]]

    def lifted(self) -> np.ndarray:
        """Whether no point of the belt touches a pulley, (P,)."""
        found: np.ndarray = self._state.touch.normal.max(axis=(1, 2)) <= 0.0
        return found

    def profiles(self) -> np.ndarray:
        """Sums at each place, (6, place): length, tension and offset by it, forces, and samples."""
        touch = self._state.touch
        width = self._path.path_length / PLACES
        place = np.minimum((self._position / width).astype(int), PLACES - 1)
        weight = self._weight
        rows = [
            np.bincount(place, row, PLACES) for row in (weight, weight * self._tension, weight * self._offset)
        ]
        contacts = self._contacts()
        forwards = self._path.turn[:, None, None] * touch.tangential
        for forces in (touch.normal, forwards):
            rows.append(np.bincount(contacts, forces.sum(axis=0).ravel() / width, PLACES))
        return np.array([*rows, np.ones(PLACES)])

    def _contacts(self) -> np.ndarray:
        """Places of the contact points, (k C,)."""
        q, both = self._state.chain.stage_q, (self._drive.contact.shape, self._where._contacts)
        places = (at_places(self._drive.beam, q, shape).reshape(-1, 2) for shape in both)
        share = along(self._path, *places)[0] / self._path.path_length
        return np.minimum((share * PLACES).astype(int), PLACES - 1)

    def stored_energy(self) -> float:
        """Kinetic and elastic energy of belt, driven pulleys and arms [J], without what contacts store."""
        kinetic, elastic, _ = energies(self._drive.beam, self._state.chain.q, self._state.chain.v)
        pulleys, wheels = self._drive.pulleys, self._state.wheels
        count = len(pulleys.radius)
        turning = 0.5 * (pulleys.inertia[1:] * wheels.speed[0, 1:count] ** 2).sum()
        arms = arms_energy(pulleys.arms, wheels.angle[0], wheels.speed[0, count:])
        return kinetic + elastic + float(turning) + arms
