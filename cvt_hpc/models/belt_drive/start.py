"""The static start: a belt around its pulleys at a given tension, then moving along itself.

The length of the belt follows from its tension with the arms of tensioners as drawn. Then their springs get
the moments that hold them there; or, where these moments are given, the arms turn into equilibrium.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from cvt_hpc.models.belt_drive.contact import Contact, contact_shapes
from cvt_hpc.models.belt_drive.courses import contact_compliance, driving_speed, length_at
from cvt_hpc.models.belt_drive.drive import UNSOLVED, Drive, State, advance, state
from cvt_hpc.models.belt_drive.friction import Friction, Treatment
from cvt_hpc.models.belt_drive.layout import Layout, pulleys_of
from cvt_hpc.models.belt_drive.roughness import heights
from cvt_hpc.multibody.ancf_beam import at_places, beam, random_lengths
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.belt_path import points_at
from cvt_hpc.physics.friction import friction_law, given_law
from cvt_hpc.solvers.generalised_alpha import Scheme

IMPLICIT_EULER = Scheme(1.0, 1.0, 1.0)
# Steps towards equilibrium [s]: the first is short, as contacts close; a step that is solved is followed by a
# longer one, else by a shorter one; the longest leaves nothing to settle
_FIRST, _LONGEST = 1e-5, 1.0
_LONGER, _SHORTER = 4.0, 0.25
MOST_STEPS = 500  # common belts need 20
SETTLED, MOST_ITERATIONS = 1e-8, 30  # [m/s]
FRICTIONLESS = friction_law("coulomb", 1e-9, 0.0, 1.0)
# Of the belt's length by its tension: they leave 0.2 % of this on the softest contacts, 1e-5 on common ones
_CORRECTIONS = 3
# Of contacts that stick [m/s]: the speed at which their grip has the normal force of a belt at rest. At less
# the five points of an element, which adds four coordinates, change without end; more costs iterations.
_GRIP_SPEED = 1e-4
_HELD = 1e12  # [kg m^2]: an arm that stays where it is drawn, or a pulley whose rim is eccentric


def start(
    parameters: Parameters, drawn: Layout, tension_of: Callable[[Drive, State], float]
) -> tuple[Drive, State, bool]:
    """Constants and first state of a run, whose parts move as if nothing slid; whether equilibria were found.

    Flat parameters are [SI]; `tension_of` a drive and its state is the mean tension of all strands [N].
    """
    p, path = parameters, drawn.path
    of_contacts = contact_compliance(path, p["contact_stiffness"]) / path.path_length
    compliance = 1.0 / p["axial_stiffness"] + of_contacts
    length = length_at(path, p["tension"], p)
    for correction in range(_CORRECTIONS + 1):
        drive = _drive(p, drawn, length)
        found = _laid(drive, drawn)
        is_settled = _settle(_with_arms(drive, inertia=_HELD, stiffness=0.0, moment=0.0), found)
        if not is_settled:
            break
        if correction < _CORRECTIONS:
            length *= 1.0 + (tension_of(drive, found) - p["tension"]) * compliance
    if is_settled and p["tensioner_moment"]:
        is_settled = _settle(drive, found)
    elif is_settled:
        drive = _with_arms(drive, moment=-_moments(drive, found))
    return drive, _moving(drive, found, p, drawn), is_settled


def _drive(p: Parameters, drawn: Layout, length: float) -> Drive:
    lengths = random_lengths(length, p["elements"], p["length_scatter"], p["seed"])
    height = heights(p, lengths)
    stiffness = "line_mass", "axial_stiffness", "bending_stiffness"
    damping = "axial_damping", "mass_damping", "bending_damping"
    belt = beam(lengths, *(p[key] for key in (*stiffness, *damping)))
    shapes, across = contact_shapes(p["contact_points"]), (p["contact_stiffness"], p["contact_damping"])
    contact = Contact(shapes, *across, _friction(p, drawn), height, float(height.max()))
    return Drive(belt, pulleys_of(p, drawn), contact)


def _friction(p: Parameters, drawn: Layout) -> Friction:
    grip = p["tension"] / min(drawn.path.radius) / _GRIP_SPEED
    treatment, slack = Treatment[p["friction_treatment"].upper()], p["speed_tolerance"]
    return Friction(treatment, given_law(p), p["friction_speed"], grip, slack, p["shear_stiffness"])


def _with_arms(drive: Drive, **values: float | np.ndarray) -> Drive:
    """A drive with other constants of its arms."""
    arms = drive.pulleys.arms
    count = len(arms.pivot)
    changed: dict[str, Any] = {key: np.broadcast_to(value, count).copy() for key, value in values.items()}
    return drive._replace(pulleys=drive.pulleys._replace(arms=arms._replace(**changed)))


def _shares(drive: Drive) -> np.ndarray:
    """Places of the nodes along the belt, over its length."""
    lengths = drive.beam.lengths
    return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) / lengths.sum()


def _laid(drive: Drive, drawn: Layout) -> State:
    """State at rest along the path, evenly stretched."""
    path = drawn.path
    points, angle, _ = points_at(path, _shares(drive) * path.path_length)
    along = path.path_length / drive.beam.lengths.sum() * np.stack([np.cos(angle), np.sin(angle)], 1)
    q = np.concatenate([points, along], 1)
    return state(drive, q, np.zeros_like(q), np.zeros(len(path.radius)))


def _settle(drive: Drive, found: State) -> bool:
    """Bring a state to rest in equilibrium, without friction; and whether that was found."""
    friction = drive.contact.friction._replace(treatment=Treatment.REGULARISED, law=FRICTIONLESS)
    # without friction the belt's tension would turn an eccentric pulley to where the belt is shortest
    inertia = np.where(drive.pulleys.run_out > 0.0, _HELD, drive.pulleys.inertia)
    pulleys = drive.pulleys._replace(inertia=inertia)
    smooth = drive._replace(pulleys=pulleys, contact=drive.contact._replace(friction=friction))
    at_rest = np.zeros((2, len(drive.pulleys.radius)))
    step = _FIRST
    for _ in range(MOST_STEPS):
        before = found.chain.q.copy(), found.wheels.angle.copy()
        for numbers in (found.chain.v, found.wheels.speed, found.touch.memory.dual, found.counters):
            numbers[:] = 0
        finite = advance(smooth, found, IMPLICIT_EULER, at_rest, step, 1, SETTLED, MOST_ITERATIONS)
        if finite and found.counters[UNSOLVED] == 0:
            if step >= _LONGEST:
                return True
            step *= _LONGER
        else:
            found.chain.q[:], found.wheels.angle[:] = before
            step *= _SHORTER
    return False


def _moments(drive: Drive, settled: State) -> np.ndarray:
    """Moments of the belt on the arms, (A,) [N m]."""
    wheels, touch, pulleys = settled.wheels, settled.touch, drive.pulleys
    points = at_places(drive.beam, settled.chain.q, drive.contact.shape)
    found = np.zeros(len(pulleys.arms.pivot))
    for p in np.flatnonzero(pulleys.arm >= 0):
        outward = points - wheels.centre[p]
        outward /= np.hypot(*np.moveaxis(outward, -1, 0))[..., None]
        around = np.stack([-outward[..., 1], outward[..., 0]], -1)
        force = touch.normal[p][..., None] * outward + touch.tangential[p][..., None] * around
        found[pulleys.arm[p]] = -force.sum((0, 1)) @ wheels.lever[p]
    return found


def _moving(drive: Drive, settled: State, p: Parameters, drawn: Layout) -> State:
    """Set the line in motion: the belt runs along it with the driving pulley."""
    path, q = drawn.path, settled.chain.q
    stretch = path.path_length / drive.beam.lengths.sum()
    _, angle, curvature = points_at(path, _shares(drive) * path.path_length)
    bend = stretch**2 * curvature[:, None] * np.stack([-np.sin(angle), np.cos(angle)], 1)
    belt_speed = driving_speed(p, 0.0) * path.radius[0]
    v = belt_speed / stretch * np.concatenate([q[:, 2:], bend], 1)
    return state(drive, q, v, belt_speed * path.turn / path.radius, settled.wheels.angle[0])
