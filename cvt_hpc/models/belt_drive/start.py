"""The static start: a belt around its pulleys at a given tension, then moving along itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.belt_drive.contact import Contact, contact_shapes
from cvt_hpc.models.belt_drive.drive import UNSOLVED, Drive, State, advance, state
from cvt_hpc.models.belt_drive.friction import Friction, Treatment
from cvt_hpc.models.belt_drive.pulleys import Pulleys, no_arms
from cvt_hpc.multibody.ancf_beam import beam, random_lengths
from cvt_hpc.physics.friction import friction_law, given_law
from cvt_hpc.physics.geometry import variator
from cvt_hpc.solvers.generalised_alpha import Scheme
from cvt_hpc.variator.path import points_at

IMPLICIT_EULER = Scheme(1.0, 1.0, 1.0)
# Steps towards equilibrium [s]: the first is short, as contacts close; a step that is solved is followed by a
# longer one, else by a shorter one; the longest leaves nothing to settle
FIRST, LONGEST = 1e-5, 1.0
LONGER, SHORTER = 4.0, 0.25
MOST_STEPS = 500  # common belts need 20
SETTLED, MOST_ITERATIONS = 1e-8, 30  # [m/s]
FRICTIONLESS = friction_law("coulomb", 1e-9, 0.0, 1.0)
# Of contacts that stick [m/s]: the speed at which their grip has the normal force of a belt at rest. At less
# the five points of an element, which adds four coordinates, change without end; more costs iterations.
GRIP_SPEED = 1e-4
# Of the belt's length by its tension: they leave 0.2 % of this on the softest contacts, 1e-5 on common ones
CORRECTIONS = 3


def start(
    parameters: Mapping[str, Any], tension_of: Callable[[Drive, State], float]
) -> tuple[Drive, State, bool]:
    """Constants and first state of a run.

    Parameters
    ----------
    parameters : mapping
        Flat parameters of a run [SI].
    tension_of : callable
        Mean tension of both strands [N], from a drive and its state.

    Returns
    -------
    (Drive, State, bool)
        Belt and pulleys, which move as if nothing slid, and whether equilibria were found.
    """
    p = parameters
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    # belt and contacts in series: contacts sink in by tension / (R stiffness), over the angle of an arc
    arcs = ((path.lengths[0], path.driving_radius), (path.lengths[2], p["driven_radius"]))
    give = sum(arc / radius**2 for arc, radius in arcs) / p["contact_stiffness"]
    compliance = 1.0 / p["axial_stiffness"] + give / path.path_length
    length = (path.path_length - give * p["tension"]) / _stretch(p["tension"], p["axial_stiffness"])
    for correction in range(CORRECTIONS + 1):
        drive = _drive(p, length)
        found, is_settled = _settled(drive, p)
        if not is_settled:
            break
        if correction < CORRECTIONS:
            length *= 1.0 + (tension_of(drive, found) - p["tension"]) * compliance
    return drive, _moving(drive, found, p), is_settled


def _stretch(tension: float, stiffness: float) -> float:
    """Length under a tension over that without: the root of EA (x^2 - 1) x / 2 = T."""
    x = 1.0 + tension / stiffness
    for _ in range(20):
        x -= (0.5 * (x**2 - 1.0) * x - tension / stiffness) / (1.5 * x**2 - 0.5)
    return x


def _drive(p: Mapping[str, Any], length: float) -> Drive:
    belt = beam(
        random_lengths(length, p["elements"], p["length_scatter"], p["seed"]),
        p["line_mass"],
        p["axial_stiffness"],
        p["bending_stiffness"],
        p["axial_damping"],
        p["mass_damping"],
        p["bending_damping"],
    )
    pulleys = Pulleys(
        np.array([[0.0, 0.0], [p["centre_distance"], 0.0]]),
        np.array([p["driven_radius"] / p["ratio"], p["driven_radius"]]),
        np.array([0.0, p["driven_inertia"]]),
        np.full(2, -1),
        no_arms(),
    )
    contact = Contact(
        contact_shapes(p["contact_points"]),
        p["contact_stiffness"],
        p["contact_damping"],
        _friction(p),
    )
    return Drive(belt, pulleys, contact)


def _friction(p: Mapping[str, Any]) -> Friction:
    smaller = p["driven_radius"] * min(1.0, 1.0 / p["ratio"])
    grip = p["tension"] / smaller / GRIP_SPEED
    treatment = Treatment[p["friction_treatment"].upper()]
    return Friction(
        treatment, given_law(p), p["friction_speed"], grip, p["speed_tolerance"], p["shear_stiffness"]
    )


def _settled(drive: Drive, p: Mapping[str, Any]) -> tuple[State, bool]:
    """At rest in equilibrium, without friction; and whether that was found."""
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    lengths = drive.beam.lengths
    share = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) / lengths.sum()
    points, angle, _ = points_at(path, p["centre_distance"], share * path.path_length)
    along = path.path_length / lengths.sum() * np.stack([np.cos(angle), np.sin(angle)], 1)
    q = np.concatenate([points, along], 1)
    friction = drive.contact.friction._replace(treatment=Treatment.REGULARISED, law=FRICTIONLESS)
    smooth = drive._replace(contact=drive.contact._replace(friction=friction))
    found = state(smooth, q, np.zeros_like(q), np.zeros(2))
    step = FIRST
    for _ in range(MOST_STEPS):
        before = found.chain.q.copy()
        for numbers in (found.chain.v, found.wheels.speed, found.touch.memory.dual, found.counters):
            numbers[:] = 0
        at_rest = np.zeros((2, 2))
        finite = advance(smooth, found, IMPLICIT_EULER, at_rest, step, 1, SETTLED, MOST_ITERATIONS)
        if finite and found.counters[UNSOLVED] == 0:
            if step >= LONGEST:
                return found, True
            step *= LONGER
        else:
            found.chain.q[:] = before
            step *= SHORTER
    return found, False


def _moving(drive: Drive, settled: State, p: Mapping[str, Any]) -> State:
    """The same line, along which the belt runs with the driving pulley."""
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    q, lengths = settled.chain.q, drive.beam.lengths
    stretch = path.path_length / lengths.sum()
    share = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) / lengths.sum()
    _, angle, curvature = points_at(path, p["centre_distance"], share * path.path_length)
    bend = stretch**2 * curvature[:, None] * np.stack([-np.sin(angle), np.cos(angle)], 1)
    speed = p["driving_speed"] * path.driving_radius / stretch
    v = speed * np.concatenate([q[:, 2:], bend], 1)
    return state(drive, q, v, p["driving_speed"] * np.array([1.0, 1.0 / p["ratio"]]))
