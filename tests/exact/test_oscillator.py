"""The oscillator's closed forms against published numbers, its equations, and each other."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cvt_hpc.errors import InputError
from cvt_hpc.models.oscillator.exact import exact, phases
from cvt_hpc.models.oscillator.motion import largest_rate, oscillator, regularised_friction, system
from support.small_systems import finished, order, scene

STICK_SLIP = scene("oscillator")
# a mass on slowly falling friction, which slides at 0.1 to 0.5 m/s all the while
LINEAR = scene(
    "oscillator",
    friction_law="linear",
    friction_gradient=-0.5,
    stribeck_velocity=0.6,
    kinetic_friction=0.2,
    belt_speed=0.3,
    normal_load=2.0,
    stiffness=50.0,
    mass=0.5,
    initial_displacement=0.013,
    initial_speed=0.02,
)


def test_stick_slip_of_unit_mass_and_stiffness():
    # numbers for v = 0.2, F_s = 1, F_d = 0.6, from the formulas of the closed form by hand
    found = phases(STICK_SLIP, 40.0)
    starts = np.array([piece.start for piece in found])
    stuck = np.array([np.isnan(piece.centre) for piece in found])
    assert np.all(stuck == (np.arange(len(found)) % 2 == 0))
    lasted = np.diff(starts)
    assert lasted[0] == pytest.approx(5.0)  # from displacement 0 instead of 0.2
    assert lasted[2::2] == pytest.approx(np.full(4, 4.0))
    assert lasted[1::2] == pytest.approx(np.full(lasted[1::2].size, 4.068887871591), abs=1e-11)
    assert [piece.x for piece in found[2::2]] == pytest.approx([0.2] * len(found[2::2]))
    times = np.linspace(10.0, 40.0, 300_001)
    assert np.ptp(exact(STICK_SLIP, times)) / 2.0 == pytest.approx(0.447213595500, abs=1e-9)


def test_exact_stick_slip_satisfies_its_equations():
    h = 1e-4
    times = np.linspace(h, 24.0, 4801)
    before, x, after = (exact(STICK_SLIP, times + shift)[:, 0] for shift in (-h, 0.0, h))
    speed, acceleration = (after - before) / (2 * h), (after - 2 * x + before) / h**2
    starts = np.array([piece.start for piece in phases(STICK_SLIP, 25.0)])
    smooth = np.abs(times[:, None] - starts).min(axis=1) > 2 * h
    friction = acceleration + x
    stuck = np.abs(speed - 0.2) < 1e-7
    assert np.all(np.abs(friction[smooth & stuck]) < 1.0 + 1e-6)
    # second differences of x with an error of round-off / h^2 = 1e-8, and h^2
    assert friction[smooth & ~stuck] == pytest.approx(0.6, abs=1e-6)
    assert 1000 < np.sum(stuck) < 3000


@pytest.mark.parametrize(("x0", "v0"), [(3.5, -1.0), (-4.0, 0.3), (0.9, 0.9), (0.0, 0.0)])
def test_exact_motion_from_anywhere_is_that_of_moreau(x0, v0):
    # slip both ways, passages through the belt's speed, sticking: against the method that needs no closed form
    p = STICK_SLIP | {"initial_displacement": x0, "initial_speed": v0, "duration": 20.0, "sampling_rate": 5.0}
    steps = (2e-3, 5e-4)
    errors = []
    for step in steps:
        run = finished("oscillator", "moreau", p | {"step": step})
        errors.append(np.abs(run.displacement - exact(p, run.times)).max())
    assert errors[1] < 2e-3
    assert errors[1] < errors[0] or errors[0] < 1e-4


def test_motion_under_the_linear_law():
    times = np.linspace(0.05, 2.0, 40)
    o = oscillator(LINEAR)

    def rates(t, y):
        friction = o.normal_load * (0.2 - 0.5 * (o.belt_speed - y[1] - 0.6))
        return [y[1], (friction - o.stiffness * y[0]) / o.mass]

    right = solve_ivp(rates, (0.0, 2.0), [0.013, 0.02], "DOP853", times, rtol=1e-12, atol=1e-14).y[0]
    assert exact(LINEAR, times)[:, 0] == pytest.approx(right, abs=1e-11)
    run = finished(
        "oscillator", "runge_kutta_4", LINEAR | {"duration": 1.0, "step": 1e-3, "sampling_rate": 20.0}
    )
    assert run.displacement == pytest.approx(exact(LINEAR, run.times), abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"friction_law": "stribeck", "friction_gradient": -1.0}, "stribeck"),
        ({"damping": 0.1}, "coulomb with damping 0.1"),
        ({**{key: LINEAR[key] for key in LINEAR}, "initial_speed": 0.4}, "sliding between"),
    ],
)
def test_other_motions_have_no_closed_form(changes, found):
    with pytest.raises(InputError, match=found):
        exact(STICK_SLIP | changes, np.linspace(0.1, 5.0, 50))


@pytest.mark.parametrize(("speed", "sign"), [(0.185, 1.0), (0.196, -1.0)])
def test_onset_of_an_exponential_stribeck_law(speed, sign):
    # Veraszto and Stepan 2017: m .538, b0 5.746, k 6957, C 2, C0 6, c_v 10, b_s .2: v_Hopf = 0.190616 m/s
    p = scene(
        "oscillator",
        friction_law="stribeck",
        friction_gradient=-40.0,
        kinetic_friction=2.0,
        stribeck_velocity=0.1,
        mass=0.538,
        stiffness=6957.0,
        damping=5.946,
        belt_speed=speed,
    )
    pull = 2.0 + 4.0 * np.exp(-10.0 * speed)
    start = {"initial_displacement": pull / 6957.0 + 1e-6, "initial_speed": 0.0}
    run = finished(
        "oscillator", "runge_kutta_4", p | start | {"duration": 4.0, "step": 2e-4, "sampling_rate": 2e3}
    )
    swing = np.abs(run.displacement[:, 0] - pull / 6957.0).reshape(8, -1).max(axis=1)
    growth = np.polyfit(0.5 * np.arange(8), np.log(swing), 1)[0]
    predicted = (40.0 * np.exp(-10.0 * speed) - 5.946) / (2 * 0.538)
    assert np.sign(growth) == sign
    # peaks are caught 35 times a period; nonlinearity of swings of 2 mm/s at most
    assert growth == pytest.approx(predicted, abs=0.02)
    assert np.log(10.0 * 4.0 / 5.946) / 10.0 == pytest.approx(0.190616, abs=1e-6)


def test_smoothed_friction_has_its_levels_and_slope():
    p = STICK_SLIP | {"friction_speed": 1e-3}
    o = oscillator(p)
    sliding = np.linspace(0.0, 0.05, 50_001)
    friction = np.array([regularised_friction(o, s, 1.0) for s in sliding])
    assert friction.max() == pytest.approx(1.0, abs=1e-4)
    assert friction[-1] == pytest.approx(0.6, abs=1e-12)
    assert regularised_friction(o, -0.004, 1.0) == -regularised_friction(o, 0.004, 1.0)
    tiny = 1e-9
    assert largest_rate(o) == pytest.approx(regularised_friction(o, tiny, 1.0) / tiny, rel=1e-6)
    rates = np.zeros(2)
    assert system(p).rates(o, 0.0, np.array([0.3, 0.1]), rates)
    assert rates == pytest.approx([0.1, 0.6 - 0.3])


def test_widths_of_smoothing_vanish_from_the_motion():
    # Coulomb friction with one level, sliding to rest: no fold at the hump, so the first order in the width
    p = STICK_SLIP | {"static_friction": 0.6, "initial_displacement": 2.5, "initial_speed": 0.0}
    p |= {"duration": 15.0, "sampling_rate": 2.0, "tolerance": 1e-9}
    widths, errors = np.geomspace(1e-2, 1e-4, 3), []
    for width in widths:
        run = finished("oscillator", "scipy_radau", p | {"friction_speed": width})
        errors.append(np.abs(run.displacement - exact(p, run.times)).max())
    assert order(widths, errors) == pytest.approx(1.0, abs=0.1)
