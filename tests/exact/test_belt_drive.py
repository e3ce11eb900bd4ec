"""The belt drive at an instant: slopes and powers of its contacts, its static start, vibration of its strands."""

import numpy as np
import pytest
from scipy.linalg import eigh

from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive import contact, pulleys
from cvt_hpc.models.belt_drive.drive import Drive, state
from cvt_hpc.models.belt_drive.friction import Friction, Treatment
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.models.belt_drive.readings import PLACES, Reading, Readings
from cvt_hpc.models.belt_drive.start import FRICTIONLESS, start
from cvt_hpc.multibody.ancf_beam import SHAPES, WEIGHTS, at_places, beam, shapes, tensions
from cvt_hpc.physics.friction import friction_law
from cvt_hpc.physics.nearest_on_path import along
from support.ancf import mass_and_stiffness, ring, whole

TAU = 1e-4
LENGTHS = np.array([0.09, 0.1, 0.12, 0.08, 0.1, 0.11])


# in its stop, so that this has a slope too
PIVOT = np.array([[0.16, 0.07]])
STRUT = pulleys.struts(
    PIVOT, np.array([[0.3, 0.1]]), np.array([[0.12, 0.2]]), np.array([500.0]), np.array([3.0])
)
ARM = pulleys.Arms(PIVOT, *np.array([[0.003], [2.0], [30.0], [0.4], [-0.1], [-0.02]]), 500.0, STRUT)
ANGLE = np.array([0.05])
ROUND, ECCENTRIC = np.zeros(2), np.array([0.004, 0.006])  # run-out [m]
PHASE = np.array([0.4, -1.1])  # [rad]
ROUGH = 1e-3 * np.sin(np.arange(18.0)).reshape(6, 3)  # heights of the belt [m]
UNEVEN = [pytest.param(ROUND, 0.0 * ROUGH, id="smooth"), pytest.param(ECCENTRIC, ROUGH, id="uneven")]


def drive(treatment=Treatment.REGULARISED, run_out=ROUND, height=0.0 * ROUGH, **values):
    """A ring of 0.1 m radius that rubs on a pulley inside and on one on an arm that reaches in from outside."""
    law = friction_law("stribeck", 0.3, -0.5, 0.4)
    body = beam(LENGTHS, 0.9, 300.0, 2.0)
    centre, radius = np.array([[0.0, 0.0], [0.15, 0.01]]), np.array([0.11, 0.09])
    rubbing = Friction(treatment, law, 0.2, 1e6, 1e-9, 1e4)
    touching = contact.Contact(contact.contact_shapes(3), 4e4, 300.0, rubbing, height, height.max())
    wheels = pulleys.Pulleys(centre, radius, np.array([0.0, 0.02]), np.array([-1, 0]), ARM, run_out, PHASE)
    return Drive(body, wheels, touching._replace(**values))


def add(made, found, tau):
    """Add the contacts as those of a first iterate."""
    wheels, lengths = found.wheels, made.beam.lengths
    contact.add_contacts(made.contact, found.touch, lengths, found.chain, made.pulleys, wheels, tau, False)


def moving():
    draw = np.random.default_rng(5)
    q = ring(LENGTHS, 1.0)
    return q + 2e-3 * draw.normal(size=q.shape), 0.3 * draw.normal(size=q.shape), np.array([3.0, -2.0, 20.0])


def at(made, q, u, speeds):
    """A state in a stage, with the duals of friction that belong to it; speeds of pulleys and arm."""
    found = state(made, q, u, speeds[:2], ANGLE + TAU * speeds[2])
    chain, wheels, touch = found.chain, found.wheels, found.touch
    chain.stage_q[:], chain.stage_v[:], wheels.stage_speed[0] = q, u, speeds
    wheels.start_speed[0], wheels.stage_rotation[0] = moving()[2], 0.7 + TAU * speeds[:2]
    pulleys.place_axes(made.pulleys, wheels)
    bristles = touch.memory.shear_start
    bristles[:] = 2e-3 * np.sin(np.arange(bristles.size)).reshape(bristles.shape)
    add(made, found, TAU)
    touch.memory.dual[:] = np.tanh(touch.memory.slip / made.contact.friction.friction_speed)
    touch.memory.side[:] = np.sign(bristles.reshape(touch.normal.shape) + TAU * touch.memory.slip)
    touch.memory.side[..., 0] = 0
    chain.blocks.data[:], chain.columns.data[:], wheels.power[:] = 0.0, 0.0, 0.0
    pulleys.add_pulleys(made.pulleys, wheels, np.zeros((2, 2)), 0.0, TAU)
    add(made, found, TAU)
    return found


def forces(made, q, u, speeds):
    """On the coordinates of the belt, and the moments on the second pulley and the arm."""
    found = at(made, q, u, speeds)
    return np.append(found.chain.columns.data[:6, :, 2].ravel(), found.wheels.corner.data[0, :, 2])


@pytest.mark.parametrize(("run_out", "height"), UNEVEN)
@pytest.mark.parametrize("treatment", [Treatment.REGULARISED, Treatment.BRISTLE])
def test_slopes_of_contacts_are_those_of_their_forces(treatment, run_out, height, tell):
    """By central differences of a stage, in which positions follow speeds; friction does not fall with force."""
    made, (q, u, speeds) = drive(treatment, run_out, height), moving()
    found = at(made, q, u, speeds)
    assert (found.touch.normal.sum(axis=(1, 2)) > 1.0).all() and (found.touch.normal == 0.0).any()
    matrix = np.zeros((26, 26))
    matrix[:24, :24] = whole(found.chain.blocks)
    matrix[:24, 24:] = found.chain.columns.data[:6, :, :2].reshape(24, 2)
    matrix[24:, :24] = found.wheels.rows.transpose(1, 0, 2).reshape(2, 24)
    matrix[24:, 24:] = found.wheels.corner.data[0, :, :2]
    h = 3e-6  # contacts do not open or close within it
    for k in range(26):
        sides = []
        for side in (-h, h):
            step = np.zeros(24)
            if k < 24:
                step[k] = side
            turned = speeds + [0.0, side if k == 24 else 0.0, side if k == 25 else 0.0]
            step = step.reshape(6, 4)
            sides.append(forces(made, q + TAU * step, u + step, turned))
        slope = (sides[0] - sides[1]) / (2.0 * h)
        tell("slopes of forces by the contacts' kinematics [N s/m]", slope, matrix[:, k])
        # rounding of forces of some 10 N leaves 1e-8 N s/m, in proportion to 1 / h
        np.testing.assert_allclose(slope, matrix[:, k], rtol=0, atol=3e-7 * abs(matrix[:, k]).max())


@pytest.mark.parametrize(("run_out", "height"), UNEVEN)
def test_contacts_give_pulleys_what_they_take_of_the_belt_but_for_losses(run_out, height):
    """Contacts of dampers alone store nothing."""
    made, (q, u, speeds) = drive(run_out=run_out, height=height, stiffness=0.0), moving()
    zero = np.zeros(1)
    free = ARM._replace(moment=zero, stiffness=zero, damping=zero, stop=0.0, struts=pulleys.no_struts(1))
    made = made._replace(pulleys=made.pulleys._replace(arms=free))
    found = at(made, q, u, speeds)
    of_belt = (found.chain.columns.data[:6, :, 2] * u).sum()
    of_pulley = found.wheels.corner.data[0, 0, 2] * speeds[1]
    of_arm = found.wheels.corner.data[0, 1, 2] * speeds[2]
    power = found.wheels.power
    lost = power[pulleys.CONTACT_LOSS] + power[pulleys.FRICTION_LOSS :].sum()
    assert of_belt + of_pulley + of_arm - power[pulleys.WORK_IN] == pytest.approx(-lost, rel=1e-12)
    assert lost > 0.1 and abs(power[pulleys.WORK_IN]) > 0.01


def test_springs_of_uneven_contacts_store_the_power_that_they_take():
    """By the energy stiffness depth^2 / 2, a moment before and after, along the distance from the rim's middle.

    The rims are circles about a middle off the axis, which the contacts take to the first order of run-out over
    radius: here its square leaves 0.1 %.
    """
    sprung, (q, u, speeds) = drive(run_out=ECCENTRIC / 5, height=ROUGH, damping=0.0), moving()
    zero = np.zeros(1)
    free = ARM._replace(moment=zero, stiffness=zero, damping=zero, stop=0.0, struts=pulleys.no_struts(1))
    made = sprung._replace(pulleys=sprung.pulleys._replace(arms=free))
    found = at(made, q, u, speeds)
    power = found.wheels.power
    given = (found.chain.columns.data[:6, :, 2] * u).sum() - power[pulleys.WORK_IN]
    given += found.wheels.corner.data[0, :, 2] @ speeds[1:]
    touches = found.touch.normal > 0.0
    weight = LENGTHS[:, None] / 3.0

    def energy(time):
        wheels = state(made, q, u, speeds[:2], ANGLE + (TAU + time) * speeds[2]).wheels
        angle = 0.7 + (TAU + time) * speeds[:2] + PHASE
        middle = wheels.centre + (ECCENTRIC / 5 * np.array([np.cos(angle), np.sin(angle)])).T
        away = at_places(made.beam, q + time * u, made.contact.shape) - middle[:, None, None]
        depth = made.pulleys.radius[:, None, None] + ROUGH - np.hypot(*np.moveaxis(away, -1, 0))
        return (0.5 * made.contact.stiffness * weight * depth**2 * touches).sum()

    stored = (energy(1e-6) - energy(-1e-6)) / 2e-6
    lost = power[pulleys.FRICTION_LOSS :].sum()
    assert abs(stored) > 1.0 and given == pytest.approx(-stored - lost, rel=2e-3)


def test_an_arm_has_the_moment_by_its_energy_but_for_what_dashpots_take():
    """Moment by central differences of the energy, and power of the damping, at a rate of 0.7 rad/s."""
    made, h = drive(), 1e-6
    wheels = pulleys.wheels_at(made.pulleys, np.zeros(2), ANGLE, 1)
    wheels.stage_speed[0, 2] = wheels.start_speed[0, 2] = 0.7
    pulleys.add_pulleys(made.pulleys, wheels, np.zeros((2, 2)), 0.0, TAU)
    elastic = -(pulleys.arms_energy(ARM, ANGLE + h, 0.0) - pulleys.arms_energy(ARM, ANGLE - h, 0.0)) / (2 * h)
    damped = wheels.power[pulleys.ARM_LOSS] / 0.7
    assert damped > 0.4 * 0.7 and wheels.corner.data[0, 1, 2] == pytest.approx(elastic - damped, rel=1e-8)


@pytest.fixture(scope="module")
def rest():
    """A belt at rest on a smaller and a larger pulley without friction and damping, with its readings."""
    values = {"driven_radius": 0.08, "centre_distance": 0.3, "ratio": 1.25, "bending_stiffness": 0.01}
    p = build_job({"name": "x", "model": "belt_drive"}, "x", values).point(0)
    drawn = layout(p)
    where = Readings(p, drawn)
    made, begun, is_settled = start(p, drawn, where.mean_tension)
    assert is_settled
    body = made.beam._replace(axial_damping=0.0, mass_damping=0.0, bending_damping=0.0)
    friction = made.contact.friction._replace(law=FRICTIONLESS)
    # beside them an arm that holds no pulley, as in `drive`: one kernel adds the contacts of both
    wheels = made.pulleys._replace(arms=ARM)
    made = Drive(body, wheels, made.contact._replace(friction=friction, damping=0.0))
    found = state(made, begun.chain.q, np.zeros_like(begun.chain.q), np.zeros(2), ANGLE)
    found.chain.stage_q[:] = found.chain.q
    add(made, found, 1.0)
    return p, where, made, found


def test_a_sample_is_what_its_definition_reads(rest):
    """Offsets between the points before and behind a probe, tension over the middle half of a strand, forces."""
    _, where, made, found = rest
    sums = np.zeros((6, PLACES))
    read = Reading(where, made, found, sums)
    path, belt = where.drawn.path, made.beam
    points = (at_places(belt, found.chain.q, SHAPES[:, k]).reshape(-1, 2) for k in (0, 1))
    position, offset = along(path, *points)
    weight, order = (belt.lengths[:, None] * WEIGHTS).ravel(), np.argsort(position)
    tension = tensions(belt, found.chain.q).ravel()
    expected = np.interp(where.probes.ravel(), position[order], offset[order], period=path.path_length)
    np.testing.assert_allclose(read.displacement, expected, rtol=0, atol=1e-15)
    middle = (path.ends[::2] + 0.5 * path.spans)[:, None]
    inside = weight * (abs(position - middle) < 0.25 * path.spans[:, None])
    np.testing.assert_allclose(read.strand_tensions, inside @ tension / inside.sum(1), rtol=1e-12)
    share = path.path_length / PLACES
    assert sums[0].sum() == pytest.approx(weight.sum(), rel=1e-12)
    assert sums[1].sum() == pytest.approx(weight @ tension, rel=1e-12)
    assert sums[3].sum() * share == pytest.approx(found.touch.normal.sum(), rel=1e-12)
    assert (sums[5] == 1.0).all() and not read.lifted.any()


def test_an_element_that_is_left_out_touches_no_pulley():
    """Of random elements: what reaches into a circle, by 200 points of each, is never left out."""
    draw = np.random.default_rng(2)
    made, (still, _, speeds) = drive(), moving()
    wheels = state(made, still, 0.0 * still, speeds[:2], ANGLE).wheels
    body, at_200 = beam(np.array([0.1]), 1.0, 1.0, 1.0), shapes(np.linspace(0.0, 1.0, 200))[0]
    kept = reaching = 0
    for _ in range(300):
        q = draw.normal(scale=[0.3, 0.3, 1.5, 1.5], size=(2, 4))
        away = at_places(body, q, at_200)[0][:, None] - wheels.centre
        reaches = (np.hypot(*np.moveaxis(away, -1, 0)) < made.pulleys.radius).any()
        reach = contact._reach(q, 0, 1, 0.1)
        may = (np.hypot(*(q[0, :2] - wheels.centre).T) < made.pulleys.radius + reach).any()
        assert may or not reaches
        kept, reaching = kept + may, reaching + reaches
    assert 10 < reaching <= kept < 290


def test_the_static_start_has_its_tension(rest):
    p, where, made, found = rest
    t1, t2 = Reading(where, made, found).strand_tensions
    assert t1 == pytest.approx(t2, rel=1e-3)  # points of contact, unlike arcs, hold it a little
    assert 0.5 * (t1 + t2) == pytest.approx(p["tension"], rel=1e-4)


def test_pulleys_carry_both_strands(rest):
    """Along the line of the shafts, each the tension by the cosine of its tilt; 0.2 % by bending and mesh."""
    p, where, made, found = rest
    points = at_places(made.beam, found.chain.q, made.contact.shape)
    along = np.cos(0.5 * (where.drawn.path.wrap[1] - np.pi))
    for pulley, side in enumerate((-1.0, 1.0)):
        outward = points - made.pulleys.centre[pulley]
        outward /= np.hypot(*np.moveaxis(outward, -1, 0))[..., None]
        force = (found.touch.normal[pulley][..., None] * outward).sum((0, 1))
        np.testing.assert_allclose(force, [side * 2.0 * p["tension"] * along, 0.0], rtol=0, atol=1.2)


def test_strands_vibrate_as_stiff_strings(rest):
    """m w^2 = N k^2 + EI k^4 over the length between the pulleys.

    Bending where the strands leave these makes them shorter by less than sqrt(EI / N) at both ends together.
    """
    p, where, made, found = rest
    mass, stiffness = mass_and_stiffness(made.beam, found.chain.q)
    stiffness += whole(found.chain.blocks)
    squares = eigh(0.5 * (stiffness + stiffness.T), mass, eigvals_only=True)
    k = np.arange(1, 4) * np.pi / where.drawn.path.spans[0]
    exact = np.sqrt((p["tension"] * k**2 + p["bending_stiffness"] * k**4) / p["line_mass"])
    ratio = np.sqrt(squares[1:7]) / np.repeat(exact, 2)
    shorter = np.sqrt(p["bending_stiffness"] / p["tension"]) / where.drawn.path.spans[0]
    assert abs(squares[0]) < 0.2**2 * exact[0] ** 2  # the belt runs around
    assert (ratio > 1.0).all() and (ratio < 1.0 + shorter).all()
