"""What is read off the elements of a pushbelt at a sample: displacement, forces, losses and their places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.pushbelt import belt as f
from cvt_hpc.models.pushbelt.belt import Belt, BeltState
from cvt_hpc.physics.geometry import variator
from cvt_hpc.variator.path import along

SCALARS = (
    "driven_speed",
    "driven_radius",
    "push_force t1",
    "push_force t2",
    "ring_tension t1",
    "ring_tension t2",
    "axial_force driving",
    "axial_force driven",
    "slip driving",
    "slip driven",
    "driving_flank_loss",
    "driven_flank_loss",
    "ring_loss",
)
PROFILES = {
    "push_force": ("push force", "N", "mean, between elements"),
    "ring_tension": ("ring tension", "N", "mean"),
    "contact_force": ("contact force", "N m-1", "mean normal line force of one flank"),
    "radial_friction": (
        "friction along the meridian",
        "N m-1",
        "mean line force of one flank, against sliding outwards",
    ),
    "tangential_friction": (
        "friction along the belt",
        "N m-1",
        "mean line force of one flank, against sliding forwards",
    ),
    "saddle_force": ("force of the rings on the saddles", "N m-1", "mean line force"),
    "ring_slip": ("sliding of the rings", "m s-1", "mean, forwards over the elements"),
    "flank_slip": ("sliding of the flanks", "m s-1", "mean, forwards over the sheave"),
    "gap": ("gap", "m", "mean, between neighbours at the rocking edge"),
    "tilt": ("tilt of elements", "rad", "mean, against the rings"),
    "mean_displacement": ("mean displacement", "m", "off the reference path, outward"),
}
PLACES = 220  # along the path, at which profiles are recorded: 3 mm of a common belt


class Readings:
    """Where displacement and forces of a run are read.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    belt : Belt
        Its constants.

    Attributes
    ----------
    path : Variator
        The reference path.
    probes : (2, p) array
        Path coordinates on both strands [m].
    places : (PLACES,) array
        Path coordinates of profiles [m].
    """

    def __init__(self, parameters: Mapping[str, Any], belt: Belt) -> None:
        p = parameters
        self.path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
        self._pitch = self.path.path_length / p["elements"]
        self._centre_distance = p["centre_distance"]
        driving, strand, driven, _ = self.path.lengths
        shares = np.arange(1, p["strand_probes"] + 1) / (p["strand_probes"] + 1.0)
        self._starts = np.array([driving, driving + strand + driven])
        self.probes = self._starts[:, None] + strand * shares
        self.places = (np.arange(PLACES) + 0.5) * (self.path.path_length / PLACES)
        self._belt_speed = p["driving_speed"] * self.path.driving_radius

    def read(
        self, elements: np.ndarray, state: BeltState, belt: Belt
    ) -> tuple[np.ndarray, list[float], np.ndarray]:
        """Displacement at the probes (2 p,) [m], SCALARS, and sums over elements (profile + 1, place).

        Parameters
        ----------
        elements : (n, fields) array
            In the order of the belt.
        state : BeltState
            Of which the pulleys are read.
        belt : Belt
            Constants.

        Returns
        -------
        displacement, scalars, profiles
            The last row of profiles counts elements.
        """
        e = elements
        position, offset = along(self.path, self._centre_distance, e[:, [f.Y, f.Z]])
        offset -= belt.pitch_depth  # of the saddles, the path being that of the pitch line
        order = np.argsort(position)
        moved = np.interp(self.probes.ravel(), position[order], offset[order], period=self.path.path_length)
        push = e[:, f.EDGE] + e[:, f.HEAD]
        on_driven = e[:, f.DRIVEN] > 0.5
        thrust = e[:, f.FLANK] * belt.cosine + e[:, f.FLANK_FRICTION_M] * belt.sine
        # the meridian's speed is the radial one over the cosine, its force in radial direction has the cosine
        loss = 2.0 * (
            belt.cosine**2 * e[:, f.FLANK_FRICTION_M] * e[:, f.FLANK_SLIP_M]
            + e[:, f.FLANK_FRICTION_T] * e[:, f.FLANK_SLIP_T]
        )
        pulleys = (~on_driven, on_driven)
        weight = [max(float(e[on, f.FLANK].sum()), 1e-9) for on in pulleys]
        slip = [
            float((e[on, f.FLANK] * e[on, f.FLANK_SLIP_T]).sum()) / w / self._belt_speed
            for on, w in zip(pulleys, weight, strict=True)
        ]
        middles = [
            np.abs(position - (start + 0.5 * self.path.strand_length)) < 0.25 * self.path.strand_length
            for start in self._starts
        ]
        scalars = [
            float(state.pulleys[f.DRIVEN_SPEED]),
            float(state.pulleys[f.DRIVEN_RADIUS]),
            *(float(push[middle].mean()) for middle in middles),
            *(float(e[middle, f.TENSION].mean()) for middle in middles),
            *(float(thrust[on].sum()) for on in pulleys),
            *slip,
            *(float(loss[on].sum()) for on in pulleys),
            float((e[:, f.RING_FRICTION] * e[:, f.RING_SLIP]).sum()),
        ]
        return moved, scalars, self._by_place(e, position, offset, push, belt)

    def _by_place(
        self, e: np.ndarray, position: np.ndarray, offset: np.ndarray, push: np.ndarray, belt: Belt
    ) -> np.ndarray:
        ahead = np.roll(e, -1, axis=0)
        across = ahead[:, [f.Y, f.Z]] - e[:, [f.Y, f.Z]]
        length = np.hypot(*across.T)
        rising = (e[:, f.HEADING_Y] * across[:, 1] - e[:, f.HEADING_Z] * across[:, 0]) / length
        gap = _edge_gap(e, ahead, belt)
        rows = [
            push,
            e[:, f.TENSION],
            e[:, f.FLANK] / self._pitch,
            e[:, f.FLANK_FRICTION_M] / self._pitch,
            e[:, f.FLANK_FRICTION_T] / self._pitch,
            e[:, f.SADDLE] / self._pitch,
            e[:, f.RING_SLIP],
            e[:, f.FLANK_SLIP_T],
            gap,
            -rising,
            offset,
            np.ones_like(gap),
        ]
        place = np.minimum((position / self.path.path_length * PLACES).astype(int), PLACES - 1)
        return np.array([np.bincount(place, row, PLACES) for row in rows])

    def stored_energy(self, elements: np.ndarray, state: BeltState, belt: Belt) -> float:
        """Kinetic and elastic energy of belt and driven pulley [J]."""
        e = elements
        ahead, behind = np.roll(e, -1, axis=0), np.roll(e, 1, axis=0)
        t = ahead[:, [f.Y, f.Z]] - behind[:, [f.Y, f.Z]]
        t /= np.hypot(*t.T)[:, None]
        u = e[:, [f.U_Y, f.U_Z]]
        outward = u[:, 0] * t[:, 1] - u[:, 1] * t[:, 0]
        kinetic = belt.mass * (u**2).sum() + belt.inertia * (e[:, f.OMEGA] ** 2).sum()
        kinetic += belt.ring_mass * (e[:, f.V] ** 2 + outward**2).sum()
        kinetic += belt.driven_inertia * state.pulleys[f.DRIVEN_SPEED] ** 2
        elastic = (e[:, f.TENSION] ** 2 * e[:, f.LENGTH]).sum() / belt.ring_stiffness
        elastic += (e[:, f.EDGE] ** 2 + e[:, f.HEAD] ** 2).sum() / belt.contact_stiffness
        elastic += 2.0 * (e[:, f.FLANK] ** 2).sum() / belt.flank_stiffness
        elastic += 2.0 * (belt.modal_stiffness * state.openings**2).sum()
        return 0.5 * float(kinetic + elastic)


def _edge_gap(e: np.ndarray, ahead: np.ndarray, belt: Belt) -> np.ndarray:
    """Distance of neighbours at the rocking edge, (n,) [m]; negative where they press on each other."""
    x, y = e[:, [f.HEADING_Y, f.HEADING_Z]], ahead[:, [f.HEADING_Y, f.HEADING_Z]]
    outward = np.stack([x[:, 1], -x[:, 0]], 1)
    edge = e[:, [f.Y, f.Z]] + 0.5 * belt.thickness * x - belt.pitch_depth * outward
    face = ahead[:, [f.Y, f.Z]] - 0.5 * belt.thickness * y
    return ((face - edge) * y).sum(1)
