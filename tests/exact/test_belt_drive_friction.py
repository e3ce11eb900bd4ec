"""Friction of the belt drive: Coulomb's law beside a linear complementarity problem, and bristles."""

import numpy as np
import pytest

from cvt_hpc.models.belt_drive import contact, friction, pulleys
from cvt_hpc.models.belt_drive.drive import Drive, advance, state
from cvt_hpc.models.belt_drive.friction import Friction, Treatment
from cvt_hpc.multibody.ancf_beam import at_places, beam
from cvt_hpc.physics.friction import friction_law
from cvt_hpc.solvers.generalised_alpha import Scheme, generalised_alpha
from support.ancf import equations, ring
from support.complementarity import solve_lcp

LENGTHS = np.array([0.09, 0.1, 0.12, 0.08, 0.1, 0.11])
MU, INERTIA, STIFFNESS, DAMPING = 0.3, 0.02, 4e4, 300.0
CENTRE, RADIUS = np.array([[0.0, 0.0], [0.15, 0.01]]), np.array([0.11, 0.09])
INPUTS = np.array([[3.0, 0.5], [3.0, 0.5]])  # speed of the first pulley, torque on the second
IMPLICIT_EULER, DT = Scheme(1.0, 1.0, 1.0), 2e-3


def drive(treatment, points=2, **values):
    """A ring of 0.1 m radius that rubs on a pulley inside and on one that reaches in from outside."""
    rubbing = Friction(treatment, friction_law("coulomb", MU, 0.0, 1.0), 1e-3, 1e6, 1e-9, 1e5)
    rubbing, flat = rubbing._replace(**values), np.zeros((len(LENGTHS), points))
    touching = contact.Contact(contact.contact_shapes(points), STIFFNESS, DAMPING, rubbing, flat, 0.0)
    none = np.zeros(0)
    arms = pulleys.Arms(np.zeros((0, 2)), *[none] * 6, 0.0, pulleys.no_struts(0))
    turning = pulleys.Pulleys(
        CENTRE, RADIUS, np.array([0.0, INERTIA]), np.array([-1, -1]), arms, *np.zeros((2, 2))
    )
    return Drive(beam(LENGTHS, 0.9, 300.0, 2.0), turning, touching)


def moving():
    draw = np.random.default_rng(5)
    q = ring(LENGTHS, 1.0)
    return q + 2e-3 * draw.normal(size=q.shape), 0.3 * draw.normal(size=q.shape), np.array([3.0, -2.0])


class Reference:
    """One implicit step as Cepon and Boltezar write it, with whole matrices.

    Contacts are those of the given points; w are the speeds of the belt (24) and of the second pulley.
    """

    def __init__(self, made, q, u, speeds, touching):
        self.made, self.q, self.u, self.speed = made, q, u, speeds[1]
        self.pulley, *at = touching
        self.at = tuple(at)
        units = np.eye(24).reshape(24, 6, 4)
        self.moved = np.stack([at_places(made.beam, one, made.contact.shape)[self.at] for one in units])

    def kinematics(self, w):
        """Normals, tangents, lever, and the speeds outwards and around, of the contacts that touch."""
        u = w[:24].reshape(6, 4)
        shape = self.made.contact.shape
        points = at_places(self.made.beam, self.q + DT * u, shape)[self.at] - CENTRE[self.pulley]
        rate = at_places(self.made.beam, u, shape)[self.at]
        lever = np.hypot(*points.T)
        normal = points / lever[:, None]
        tangent = np.stack([-normal[:, 1], normal[:, 0]], 1)
        turning = np.where(self.pulley == 0, INPUTS[0, 0], w[24])
        slip = (tangent * rate).sum(1) - turning * lever
        weight = LENGTHS[self.at[0]] / len(shape)
        depth = RADIUS[self.pulley] - lever
        pressed = weight * (STIFFNESS * depth - DAMPING * (normal * rate).sum(1))
        return normal, tangent, lever, slip, pressed

    def spread(self, forces):
        """Forces (contact, 2) at the points as those on the coordinates of the belt, (24,)."""
        return np.tensordot(self.moved, forces, 2)

    def smooth(self, w):
        """What is left of the equations without friction."""
        u = w[:24].reshape(6, 4)
        normal, _, _, _, pressed = self.kinematics(w)
        _, left = equations(self.made.beam, self.q + DT * u, u, self.u, DT)
        left = left + self.spread(normal * pressed[:, None])
        return np.append(left, INPUTS[0, 1] - INERTIA * (w[24] - self.speed) / DT)

    def directions(self, w):
        """Of friction on the belt, forwards: columns of the equations, (25, contact)."""
        _, tangent, lever, _, _ = self.kinematics(w)
        chosen = np.eye(len(lever))
        return np.stack(
            [
                np.append(self.spread(tangent * one[:, None]), -(one * lever)[self.pulley == 1].sum())
                for one in chosen
            ],
            1,
        )

    def solve(self, w):
        """Newton's method whose every step is a linear complementarity problem, by Lemke's pivoting.

        With the slip g = x_R - x_L and the friction T = y_R - mu N = mu N - y_L, where x and y are not negative:
        x_R y_R = x_L y_L = 0.
        """
        for _ in range(60):
            _, _, _, slip, pressed = self.kinematics(w)
            matrix = derivative(self.smooth, w)
            rate = derivative(lambda at: self.kinematics(at)[3], w)
            bound, across = MU * pressed, self.directions(w)
            coupling = -rate @ np.linalg.solve(matrix, across)
            free = slip - rate @ np.linalg.solve(matrix, self.smooth(w))
            n = len(slip)
            whole = np.block([[coupling, np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
            found = solve_lcp(whole, np.concatenate([free - coupling @ bound, 2.0 * bound]))
            force = found[:n] - bound
            change = np.linalg.solve(matrix, -self.smooth(w) - across @ force)
            w = w + change
            if abs(change).max() < 1e-11:
                break
        return w, force


def derivative(function, at):
    h = 1e-6
    return np.stack([(function(at + h * e) - function(at - h * e)) / (2.0 * h) for e in np.eye(len(at))], 1)


def test_set_valued_friction_is_the_solution_of_a_linear_complementarity_problem():
    made, (q, u, speeds) = drive(Treatment.SET_VALUED), moving()
    found = state(made, q, u, speeds)
    assert advance(made, found, IMPLICIT_EULER, INPUTS, DT, 1, 1e-10, 100) and found.counters[2] == 0
    touch = found.touch
    touching = np.nonzero(touch.normal)
    slides, slip = touch.memory.side[touching] != 0, touch.memory.slip[touching]
    assert slides.any() and not slides.all() and len(slip) > 5
    # the law itself, to the tolerances of the step
    friction_force, bound = touch.tangential[touching], MU * touch.normal[touching]
    assert abs(slip[~slides]).max() < 1e-9 and (abs(friction_force) <= bound * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(friction_force[slides], -np.sign(slip[slides]) * bound[slides], rtol=1e-12)
    reference = Reference(made, q, u, speeds, touching)
    w, force = reference.solve(np.append(u.ravel(), speeds[1]))
    np.testing.assert_allclose(found.chain.v.ravel(), w[:24], rtol=0, atol=1e-8)
    assert found.wheels.speed[0, 1] == pytest.approx(w[24], abs=1e-8)
    np.testing.assert_allclose(friction_force, force, rtol=0, atol=1e-5 * bound.max())


def rubbed(slip, dt, pressure=1e3, stiffness=1e5):
    """Friction of one contact with bristles in the stages of steps dt, whose slip [m/s] at a time is given."""
    scheme = generalised_alpha(0.6)
    made = Friction(Treatment.BRISTLE, friction_law("coulomb", MU, 0.0, 1.0), 1.0, 1.0, 1.0, stiffness)
    memory, normal = friction.empty_memory(1, 1, 1), np.ones((1, 1, 1))
    times = dt * (np.arange(round(1.0 / dt)) + scheme.alpha_f)
    forces = []
    for time in times:
        friction.begin_friction(made, memory, scheme, dt)
        for is_known in (False, True, True):  # sticks or slides as found in the first
            found = friction.rub(made, memory, 0, 0, 0, slip(time), pressure, stage(scheme, dt), is_known)
        forces.append(found.force)
        friction.finish_friction(made, memory, normal, scheme, dt)
    return times, np.array(forces)


def stage(scheme, dt):
    return scheme.alpha_f * scheme.gamma / scheme.alpha_m * dt


def test_bristles_follow_the_exact_law_of_an_elastic_rim_that_slides():
    """To and fro by x = A (1 - cos(2 pi t)) / 2: the force is a stop, 2 bound wide; each turn begins a new branch."""
    bound, amplitude, stiffness = MU * 1e3, 0.02, 1e5

    def way(time):
        return 0.5 * amplitude * (1.0 - np.cos(2.0 * np.pi * time))

    def exact(time):
        forth = np.minimum(stiffness * way(time), bound)
        back = np.maximum(bound - stiffness * (amplitude - way(time)), -bound)
        return np.where(time < 0.5, forth, back)

    errors = []
    for dt in (1e-2, 5e-3):
        times, forces = rubbed(lambda t: np.pi * amplitude * np.sin(2.0 * np.pi * t), dt)
        assert (abs(forces) <= bound * (1.0 + 1e-12)).all()
        errors.append(abs(forces - exact(times)).max())
    # within a step of the fastest rise that is not bounded, sqrt(bound (A k - bound)) 2 pi, and of order 1 at events
    assert errors[0] < 1e-2 * 2.0 * np.pi * np.sqrt(bound * (amplitude * stiffness - bound))
    assert errors[1] < 0.6 * errors[0]


def test_bristles_that_slid_come_back_alike_whether_for_long_or_not():
    """While the rim slides they stand still: what they do when it turns back is not set by how they came there."""
    dt, speed, after = 1e-2, 0.05, []
    for slid in (1, 2, 5):  # steps; the bound is reached in six
        back = (6 + slid) * dt

        def slip(time, back=back):
            return speed * np.sign(back - time)

        forces = rubbed(slip, dt)[1]
        assert forces[5] < forces[6] == MU * 1e3
        after.append(forces[6 + slid : 14 + slid])
    np.testing.assert_allclose(after[1:], [after[0], after[0]], rtol=0, atol=1e-9 * MU * 1e3)
    # as fast as the rim shears them, but for 0.03 of a step where the scheme rings down
    np.testing.assert_allclose(np.diff(after[0]), -1e5 * speed * dt, rtol=0.05)


def test_contacts_that_leave_the_pulley_forget_their_bristles():
    made = Friction(Treatment.BRISTLE, friction_law("coulomb", MU, 0.0, 1.0), 1.0, 1.0, 1.0, 1e5)
    memory, scheme = friction.empty_memory(1, 2, 1), generalised_alpha(0.6)
    friction.begin_friction(made, memory, scheme, 1e-3)
    for element in range(2):
        friction.rub(made, memory, 0, element, 0, 0.1, 1e3, 1e-3, False)
    friction.finish_friction(made, memory, np.array([[[1.0], [0.0]]]), scheme, 1e-3)
    assert memory.shear[0, 0] > 0.0 and memory.shear[0, 1] == 0.0
