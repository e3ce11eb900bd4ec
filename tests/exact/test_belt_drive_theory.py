"""What theory says of the belt drive, against its definitions and an exact solution; the kick of its strands."""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import newton

from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive import theory
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.models.belt_drive.theory import MIDDLE, WIDTH, answers, kick
from cvt_hpc.multibody.ancf_beam import SHAPES, WEIGHTS, at_places, beam
from cvt_hpc.physics.belt_path import points_at, regions
from cvt_hpc.physics.nearest_on_path import along

TENSION = np.array([230.0, 395.0])


def scene(**values):
    p = build_job({"name": "x", "model": "belt_drive"}, "x", values).point(0)
    return p, layout(p)


def clamped_frequency(p, length, tension, speed, guess):
    """Of a running beam between clamps [Hz]: EI k^4 + (T - m v^2) k^2 - 2 m v w k - m w^2 = 0 has four k."""
    m, stiffness = p["line_mass"], p["bending_stiffness"]

    def determinant(w):
        k = np.roots([stiffness, 0.0, tension - m * speed**2, -2.0 * m * speed * w, -m * w**2])
        rows = [np.ones(4), k, np.exp(1j * k * length), k * np.exp(1j * k * length)]
        # over the differences of the roots their order does not matter
        return np.linalg.det(rows) / np.prod([a - b for a, b in combinations(k, 2)])

    return newton(determinant, 2.0 * np.pi * guess + 0j, tol=1e-9).real / (2.0 * np.pi)


@pytest.mark.parametrize("speed", ["0.0001 rad/s", "300 rad/s"])
def test_a_strand_pinned_at_the_tangents_is_one_clamped_where_bending_lifts_it(speed):
    """It is longer by d at both ends, and a clamp shortens by d what vibrates: third order of k d is left."""
    p, drawn = scene(driving_speed=speed)
    length, m = float(drawn.path.spans[0]), p["line_mass"]
    v = p["driving_speed"] * drawn.path.radius[0]
    found = theory.strand_frequencies(p, drawn.path, TENSION)
    for tension, row in zip(TENSION, found, strict=True):
        lift = np.sqrt(p["bending_stiffness"] / (tension - m * v**2))
        for n, frequency in enumerate(row[:3], start=1):
            exact = clamped_frequency(p, length + 2.0 * lift, tension, v, frequency)
            order = (n * np.pi * lift / length) ** 3 / (n * np.pi)
            assert abs(frequency / exact - 1.0) < 2.0 * order
            shorter = clamped_frequency(p, length, tension, v, exact * (1.0 + 2.0 * lift / length))
            assert shorter / exact - 1.0 == pytest.approx(2.0 * lift / length, rel=0.15)


TWO_LISTED = {
    "pulley_x": (0.0, 0.45),
    "pulley_y": (0.0, 0.0),
    "pulley_radius": (0.04, 0.08),
    "pulley_turn": (1.0, 1.0),
    "pulley_inertia": (0.0, 0.013),
    "pulley_load": (0.0, 1.0),
    "elements": 64,
}


@pytest.mark.parametrize(
    ("values", "torque"),
    [
        ({"load": 8.0}, 8.0),
        ({"load": 8.0, "profile_time": (0.05, 0.1), "load_profile": (1.0, 0.5)}, 4.0),
        (TWO_LISTED | {"load": 8.0}, 4.0),  # the load is the driven pulley's, of twice the radius
        (TWO_LISTED | {"load": 8.0, "pulley_load": (0.0, -1.0)}, -4.0),
    ],
)
def test_creep_by_torque_is_that_by_tensions(values, torque):
    """Speeds are as the lengths 1 + T / EA under tensions that the torque at the end sets apart."""
    p, drawn = scene(**values)
    pull = torque / drawn.path.radius[0]
    slack, tight = 1.0 + (p["tension"] + np.array([-0.5, 0.5]) * pull) / p["axial_stiffness"]
    assert theory.creep_loss(p, drawn) == pytest.approx(1.0 - slack / tight, rel=1e-9)


def test_the_loss_of_a_hard_drive_is_creep():
    """(T2 - T1) / EA to the first order, without sinking in."""
    p, drawn = scene(load=8.0, contact_stiffness=1e13, driving_speed=1.0)
    pull = 8.0 / drawn.path.radius[0]
    tension = p["tension"] + np.array([-0.5, 0.5]) * pull
    # less by 4 T / EA: 3 by the square in the strain, 1 by the stretch that speeds are taken over
    second = 1.0 - 4.0 * p["tension"] / p["axial_stiffness"]
    wanted = pull / p["axial_stiffness"] * second
    assert theory.expected_loss(p, drawn, tension) == pytest.approx(wanted, rel=1e-3)


def test_the_loss_is_that_of_the_loaded_pulley():
    """Of three pulleys the third one, by the tensions that run onto it and onto the first one."""
    listed = {
        "pulley_x": (0.0, 0.45, 0.2),
        "pulley_y": (0.0, 0.0, 0.3),
        "pulley_radius": (0.04, 0.05, 0.08),
        "pulley_turn": (1.0, 1.0, 1.0),
        "pulley_inertia": (0.0, 0.01, 0.01),
        "pulley_load": (0.0, 0.1, 1.0),
    }
    p, drawn = scene(**listed, elements=96, contact_stiffness=1e13, driving_speed=1.0)
    assert drawn.driven == 2
    even = theory.expected_loss(p, drawn, np.full(3, p["tension"]))
    assert even == pytest.approx(0.0, abs=2e-8)  # 300 N / (R^2 k)
    loss = theory.expected_loss(p, drawn, p["tension"] + np.array([0.0, -30.0, 60.0]))
    assert loss == pytest.approx(90.0 / p["axial_stiffness"], rel=0.01)  # 4 T / EA of it


def test_a_belt_sinks_in_by_the_tension_above_that_of_its_running():
    """Of (T - m v^2) / (R^2 k) of a radius: without it the belt of other radii has no loss."""
    p, drawn = scene(ratio=1.25, driving_speed=300.0, contact_stiffness=1e8)
    running = p["line_mass"] * (300.0 * drawn.path.radius[0]) ** 2
    assert theory.expected_loss(p, drawn, np.full(2, running)) == pytest.approx(0.0, abs=1e-15)
    sunk = 100.0 / (drawn.path.radius**2 * 1e8)
    loss = theory.expected_loss(p, drawn, np.full(2, running + 100.0))
    assert loss == pytest.approx(sunk[0] - sunk[1], rel=2.0 * sunk.max())


def test_the_rubber_gives_way_by_more_where_the_tight_strand_runs_on():
    """(T2 - T1) / (R^2 k) more than by creep; speed takes the same of both."""
    p, drawn = scene(contact_stiffness=1e8)
    hard = theory.expected_loss(p | {"contact_stiffness": 1e13}, drawn, TENSION)
    soft = theory.expected_loss(p, drawn, TENSION)
    assert soft - hard == pytest.approx(np.diff(TENSION)[0] / (drawn.path.radius[0] ** 2 * 1e8), rel=2e-3)


def test_a_sliding_belt_has_tensions_by_euler_and_eytelwein():
    p, drawn = scene(ratio=1.25, driving_speed=100.0)
    path = drawn.path
    position = np.linspace(0.0, path.path_length, 4000, endpoint=False)
    found = theory.sliding_tension(p, path, TENSION, position)
    region, angle = regions(path, position), theory.wrap_angles(path, position)
    assert (np.isnan(found) == (region % 2 == 1)).all()
    centrifugal = p["line_mass"] * (100.0 * path.radius[0]) ** 2
    for arc, (inlet, outlet) in ((0, TENSION[::-1]), (2, TENSION)):
        tension, phi = found[region == arc], angle[region == arc]
        assert (tension[0], tension[-1]) == pytest.approx((inlet, outlet), rel=1e-12)
        slope = np.diff(np.log(tension - centrifugal)) / np.diff(phi)
        slides = np.abs(slope) > 0.25
        assert np.allclose(slope[slides][1:-1], np.sign(outlet - inlet) * p["kinetic_friction"])
        wanted = np.log((TENSION[1] - centrifugal) / (TENSION[0] - centrifugal)) / p["kinetic_friction"]
        assert slides.sum() * np.diff(phi).mean() == pytest.approx(wanted, rel=0.01)
    other = p | {"friction_law": "stribeck"}
    assert np.isnan(theory.sliding_tension(other, path, TENSION, position)).all()


def test_a_kick_is_an_impulse_outwards_on_each_strand():
    p, drawn = scene(ratio=1.25)
    path = drawn.path
    lengths = np.full(192, path.path_length / 192)
    points, angle, _ = points_at(path, np.cumsum(lengths) - lengths)
    q, v = np.concatenate([points, np.cos(angle)[:, None], np.sin(angle)[:, None]], 1), np.zeros((192, 4))
    kick(path, p["line_mass"], 0.02, q, v)
    body = beam(lengths, p["line_mass"], 1.0, 1.0)
    place, slope = (at_places(body, q, SHAPES[:, k]).reshape(-1, 2) for k in (0, 1))
    speed = at_places(body, v, SHAPES[:, 0]).reshape(-1, 2)
    where, _ = along(path, place, slope)
    momentum = p["line_mass"] * (lengths[:, None] * WEIGHTS).ravel()[:, None] * speed
    for strand, start in enumerate(path.ends[::2]):
        inside = regions(path, where) == 2 * strand + 1
        outward = np.array([np.sin(path.leaving[strand]), -np.cos(path.leaving[strand])])
        assert outward[1] * (-1.0, 1.0)[strand] > 0.9  # t1 is below
        np.testing.assert_allclose(momentum[inside].sum(0), 0.02 * outward, atol=2e-5)
        middle = start + MIDDLE * path.spans[strand]
        assert (momentum[inside] @ outward) @ where[inside] / 0.02 == pytest.approx(middle, rel=1e-3)
        phase = 2.0 * np.pi * (where[inside] - middle) / (WIDTH * path.spans[strand])
        bell = np.where(np.abs(phase) < np.pi, 1.0 + np.cos(phase), 0.0)
        most = 2.0 * 0.02 / (p["line_mass"] * WIDTH * path.spans[strand])
        np.testing.assert_allclose(speed[inside] @ outward, 0.5 * most * bell, atol=2e-3 * most)
        beyond = np.abs(where - middle) > 0.5 * WIDTH * path.spans[strand] + lengths[0]
        assert (speed[inside & beyond] == 0.0).all()


def test_answers_are_peaks_that_exceed_the_unrest_before():
    time = np.arange(0.0, 0.5, 1e-3)
    tone = np.sin(2.0 * np.pi * 63.0 * time)[:, None] * [1.0, 0.5]
    unrest = 0.2 * np.sin(2.0 * np.pi * 118.0 * time)[:, None] * [1.0, 1.0]
    found = answers(unrest, tone + 2.0 * unrest, 1e3, np.array([60.0, 120.0, 600.0]))
    assert found[0] == pytest.approx(63.0, abs=0.05) and np.isnan(found[1:]).all()


@pytest.mark.parametrize(("inlet", "outlet"), [(400.0, 235.0), (235.0, 400.0), (300.0, 320.0)])
@pytest.mark.parametrize("stiffness", [2e7, 2e8])
def test_rubber_that_shears_takes_the_tension_from_inlet_to_outlet(inlet, outlet, stiffness):
    """Forwards by small steps, with the shear held at the bound."""
    p, drawn = scene(shear_stiffness=stiffness)
    radius, wrap = drawn.path.radius[0], drawn.path.wrap[0]
    apparent = theory.unsheared_tension(p, inlet, outlet, radius, wrap)
    compliance = 1.0 / p["axial_stiffness"] + 1.0 / (radius**2 * p["contact_stiffness"])
    count = 20000
    ds, tension, shear = radius * wrap / count, inlet, 0.0
    for _ in range(count):
        bound = p["kinetic_friction"] * tension / (radius * stiffness)
        shear = np.clip(shear + ds * compliance * (tension - apparent), -bound, bound)
        tension += ds * stiffness * shear
    assert tension == pytest.approx(outlet, rel=1e-3)


def test_more_than_friction_carries_has_no_tension_without_shear():
    p, drawn = scene()
    assert np.isnan(theory.unsheared_tension(p, 500.0, 500.0 * np.exp(-1.6), drawn.path.radius[0], np.pi))


@pytest.mark.parametrize("tension", [(300.0, -5.0), (-5.0, 300.0), (0.5, 300.0), (0.0, 300.0), (-5.0, -5.0)])
def test_a_strand_without_tension_presses_no_belt_on(tension):
    """0.5 N is less than m v^2."""
    p, drawn = scene(friction_treatment="bristle")
    assert np.isnan(theory.unsheared_tension(p, -5.0, 300.0, 0.05, np.pi))
    assert np.isnan(theory.expected_loss(p, drawn, np.array(tension)))
    position = np.linspace(0.0, drawn.path.path_length, 40, endpoint=False)
    with np.errstate(all="raise"):
        found = theory.sliding_tension(p, drawn.path, np.array(tension), position)
    assert np.isnan(found).all()
