"""Falling friction so steep that an implicit step has more than one solution, and what the program says.

The mass slides steadily on friction that falls at the rate s = N |g| / m, as an unstable state, w the
frequency of its spring. The equations of a stage of length a = (coefficient) step have one solution while 1 -
s a + w^2 a^2 > 0: with a soft spring up to step s = 1 / coefficient.
"""

import numpy as np
import pytest

from cvt_hpc.steppers.facts import MESSAGES, Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.variables import Status
from support.scripted import TWO_MASSES, Script, system
from support.small_systems import IMPLICIT, begin, bisect, scene

FALL, FREQUENCY = 200.0, 5.0
STEEP = scene(
    "oscillator",
    friction_law="linear",
    friction_gradient=-FALL,
    stribeck_velocity=1.0,
    kinetic_friction=10.0,
    belt_speed=0.5,
    stiffness=FREQUENCY**2,
)
PULL = (10.0 + FALL * 0.5) / FREQUENCY**2
STEEP |= {"initial_displacement": PULL, "initial_speed": 1e-9}
COEFFICIENTS = {
    "theta": lambda p: p["theta"],
    "generalised_alpha": lambda p: 2.0 / ((1 + p["spectral_radius"]) * (3 - p["spectral_radius"])),
    # refused before its pole at 0.436: there growth is turned into decay
    "sdirk": lambda p: 1.0 / 1.4554,
    "rosenbrock_w": lambda p: 1.0 - np.sqrt(0.5),
}
CASES = [
    ("theta", {"theta": 1.0}),
    ("theta", {"theta": 0.5}),
    ("generalised_alpha", {"spectral_radius": 0.0}),
    ("generalised_alpha", {"spectral_radius": 1.0}),
    ("sdirk", {}),
    ("rosenbrock_w", {}),
]


def first_step(stepper, step, **options):
    """What the first step gives."""
    run = begin("oscillator", stepper, STEEP | options | {"step": step, "sampling_rate": 1.0 / step})
    return run.advance(1)


@pytest.mark.parametrize(("stepper", "options"), CASES)
def test_the_step_from_which_there_are_several_solutions(stepper, options):
    def refused(step):
        failure = first_step(stepper, step, **options)
        return failure is not None and failure[1].startswith(MESSAGES[Result.NOT_UNIQUE])

    measured = bisect(refused, 0.3 / FALL, 6.0 / FALL, times=20)
    coefficient = COEFFICIENTS[stepper](STEEP | options)
    roots = np.roots([FREQUENCY**2, -FALL, 1.0])
    assert measured == pytest.approx(roots.min() / coefficient, rel=1e-3)
    assert measured == pytest.approx(1.0 / (coefficient * FALL), rel=1e-2)
    assert first_step(stepper, 1.05 * measured, **options)[0] == Status.FAILED_NUMERICS


@pytest.mark.parametrize("share", [0.5, 0.9, 0.999])
def test_sdirk_lets_grow_what_grows_up_to_its_limit(share):
    # two masses driven each by its own speed, without a spring worth the name: a step multiplies their speed by R
    z = share * 1.4554
    g = 0.43586652150845899942
    factor = (1 + (1 - 3 * g) * z + (0.5 - 3 * g + 3 * g * g) * z * z) / (1 - g * z) ** 3
    rate = 1e4
    equations, parameters = system(Script(TWO_MASSES, rate), [1.0] * 4), {"solver_tolerance": 1e-12}
    march = Marching(
        "sdirk", parameters | {"step": z / rate}, equations, np.array([0, 0, 1e-3, 2e-3]), z / rate
    )
    row = np.empty((1, 4))
    assert march.advance(row) == Result.OK
    # the spring's pull is of the order of rate^-2; where R falls to 1, it does so steeply
    assert row[0, 2:] / [1e-3, 2e-3] == pytest.approx(factor, rel=1e-4)
    assert factor > 1.0
    assert (factor < 1.03) == (share > 0.99)


def test_all_implicit_methods_are_asked():
    assert set(IMPLICIT) == {stepper for stepper, _ in CASES}


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
def test_towards_the_limit_a_step_grows_beyond_all_bounds(share):
    # implicit Euler: v1 = v0 / (1 - s step + (w step)^2); an unnoticed solution beyond the pole throws the mass
    # to the other side of its start
    step, speed = share / FALL, 1e-3
    p = STEEP | {"theta": 1.0, "initial_speed": speed, "step": step, "sampling_rate": 1.0 / step}
    run = begin("oscillator", "theta", p)
    assert run.advance(1) is None
    pole = 1.0 - FALL * step + (FREQUENCY * step) ** 2
    # the law is linear, so that one iteration leaves round-off: of the spring's force, 1e5 times that of the speed
    assert run.channel("speed")[0] == pytest.approx(speed / pole, rel=1e-10)


@pytest.mark.parametrize(("share", "expected"), [(0.9, Result.OK), (1.1, Result.NOT_UNIQUE)])
@pytest.mark.parametrize("drive", [(FALL, 0.0), (0.0, FALL)])
def test_two_masses_at_once_are_noticed(drive, share, expected):
    # each driven by itself: the determinant turns its sign twice; by each other: no unknown shows it alone
    equations = system(Script(TWO_MASSES, *drive), [1.0] * 4)
    step = share / FALL
    parameters = {"step": step, "theta": 1.0, "solver_tolerance": 1e-10}
    march = Marching("theta", parameters, equations, np.full(4, 1e-3), step)
    assert march.advance(np.zeros((1, 4))) == expected


def test_a_narrow_hump_of_friction_at_rest_falls_too_steeply():
    # stick-slip with the level at rest smoothed: the hump's other side falls by 2 / e of (mu_s - mu_k) N over
    # 6 v_reg; implicit Euler takes it up to step = 6 m v_reg e / (2 (mu_s - mu_k) N)
    width = 1e-3
    limit = 6.0 * width * np.exp(1.0) / (2.0 * 0.4)
    p = scene("oscillator", friction_speed=width, theta=1.0, duration=30.0, sampling_rate=10.0)

    def end(share):
        run = begin("oscillator", "theta", p | {"step": share * limit})
        return run.advance(run.samples)

    assert [end(share) for share in (0.3, 0.5, 0.7, 0.9)] == [None] * 4
    # longer steps may find the slope between sticking and slip, or leap over it
    beyond = [failure for failure in map(end, np.linspace(1.5, 5.0, 15)) if failure]
    assert beyond and all(reason.startswith(MESSAGES[Result.NOT_UNIQUE]) for _, reason in beyond)
