"""What is read off a belt drive at a sample: displacement, tensions, sliding, forces along the path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.belt_drive.drive import Drive, State
from cvt_hpc.multibody.ancf_beam import SHAPES, WEIGHTS, at_places, energies, tensions
from cvt_hpc.physics.geometry import variator
from cvt_hpc.variator.path import along

SCALARS = ("driven_speed", "tension t1", "tension t2", "slip driving", "slip driven")
PROFILES = {
    "tension": ("tension", "N", "mean"),
    "normal_force": ("normal force", "N m-1", "mean line force, outwards"),
    "friction_force": ("friction force", "N m-1", "mean line force on the belt, forwards"),
    "mean_displacement": ("mean displacement", "m", "off the reference path, outward"),
}
PLACES = 240  # along the path, at which profiles are recorded: 5 mm of a belt of 1.2 m


class Readings:
    """Where displacement and forces of a run are read.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].

    Attributes
    ----------
    path : Variator
        The reference path.
    centre_distance : float
        [m]
    probes : (2, p) array
        Path coordinates on both strands [m].
    places : (PLACES,) array
        Path coordinates of profiles [m].
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p = parameters
        self.path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
        self.centre_distance = p["centre_distance"]
        driving, strand, driven, _ = self.path.lengths
        starts = np.array([driving, driving + strand + driven])
        shares = np.arange(1, p["strand_probes"] + 1) / (p["strand_probes"] + 1.0)
        self.probes = starts[:, None] + strand * shares
        self._middles = starts + 0.5 * strand
        self.places = (np.arange(PLACES) + 0.5) * (self.path.path_length / PLACES)

    def mean_tension(self, drive: Drive, state: State) -> float:
        """Mean tension of both strands [N]."""
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
        points = at_places(drive.beam, state.chain.q, SHAPES[:, 0]).reshape(-1, 2)
        self._position, self._offset = along(where.path, where.centre_distance, points)
        self._tension = tensions(drive.beam, state.chain.q).ravel()
        self._weight = (drive.beam.lengths[:, None] * WEIGHTS).ravel()

    def displacement(self) -> np.ndarray:
        """Displacement at the probes, outwards, (2 p,) [m]."""
        order, length = np.argsort(self._position), self._where.path.path_length
        return np.interp(
            self._where.probes.ravel(), self._position[order], self._offset[order], period=length
        )

    def strand_tensions(self) -> np.ndarray:
        """Mean tension over the middle half of both strands, (2,) [N]."""
        quarter = 0.25 * self._where.path.strand_length
        inside = np.abs(self._position - self._where._middles[:, None]) < quarter
        weights = inside * self._weight
        return weights @ self._tension / weights.sum(axis=1)

    def scalars(self) -> list[float]:
        """SCALARS."""
        touch, path = self._state.touch, self._where.path
        driving, driven = self._state.wheels.speed[0]
        pressed = np.maximum(touch.normal.sum(axis=(1, 2)), 1e-9)
        slip = (touch.normal * touch.memory.slip).sum(axis=(1, 2)) / pressed / (driving * path.driving_radius)
        return [float(driven), *self.strand_tensions(), *slip]

    def profiles(self) -> np.ndarray:
        """Sums at each place, (6, place): length, tension and offset by it, forces, and samples."""
        where, touch = self._where, self._state.touch
        width = where.path.path_length / PLACES
        place = np.minimum((self._position / width).astype(int), PLACES - 1)
        weight = self._weight
        rows = [
            np.bincount(place, row, PLACES) for row in (weight, weight * self._tension, weight * self._offset)
        ]
        contacts = self._contacts()
        for forces in (touch.normal, touch.tangential):
            rows.append(np.bincount(contacts, forces.sum(axis=0).ravel() / width, PLACES))
        return np.array([*rows, np.ones(PLACES)])

    def _contacts(self) -> np.ndarray:
        """Places of the contact points, (k C,)."""
        points = at_places(self._drive.beam, self._state.chain.stage_q, self._drive.contact.shape)
        position, _ = along(self._where.path, self._where.centre_distance, points.reshape(-1, 2))
        share = position / self._where.path.path_length
        return np.minimum((share * PLACES).astype(int), PLACES - 1)

    def stored_energy(self) -> float:
        """Kinetic and elastic energy of belt and driven pulley [J], without what contacts store."""
        kinetic, elastic, _ = energies(self._drive.beam, self._state.chain.q, self._state.chain.v)
        driven = 0.5 * self._drive.pulleys.inertia[1] * self._state.wheels.speed[0, 1] ** 2
        return kinetic + elastic + float(driven)
