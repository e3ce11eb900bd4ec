"""What each stepper does to the energy of a free vibration, and to what is too fast for its step."""

import numpy as np
import pytest

from cvt_hpc.models.moving_string import transient as motion
from cvt_hpc.steppers import symplectic_euler
from cvt_hpc.steppers.facts import COUNTERS
from support.small_systems import FACTS, begin, scene

CELLS = 16
STRING = scene("moving_string", belt_speed=0.0, mode=2, cells=CELLS, strand_probes=3, solver_tolerance=1e-13)
CELL = STRING["length"] / CELLS
FREQUENCY = (
    2.0
    / CELL
    * np.sqrt(STRING["tension"] / STRING["line_mass"])
    * np.sin(0.5 * CELL * np.pi * STRING["mode"] / STRING["length"])
)  # of the mode of these cells [rad/s]


def marched(model, stepper, parameters):
    """A run at its end, whatever the program says of its damping."""
    run = begin(model, stepper, parameters)
    run.advance(run.samples)
    assert run.done == run.samples
    return run


def vibrating(stepper, step, samples=100, steps_per_sample=10, **changes):
    """A string at rest but for its vibration, with `step` in units of 1 / frequency."""
    interval = steps_per_sample * step / FREQUENCY
    p = STRING | {"step": step / FREQUENCY * (1 + 1e-12), "sampling_rate": 1.0 / interval}
    return marched("moving_string", stepper, p | {"duration": samples * interval} | changes)


# rate of decay over frequency: coefficient of (step frequency)^power
DAMPING = [
    ("runge_kutta_4", {}, 1.0 / 144.0, 5),
    ("theta", {"theta": 1.0}, 0.5, 1),
    ("theta", {"theta": 0.6}, 0.1, 1),
    ("generalised_alpha", {"spectral_radius": 0.0}, 0.25, 3),
    ("generalised_alpha", {"spectral_radius": 0.5}, 1.0 / 108.0, 3),
    ("sdirk", {}, 0.0259, 3),
    ("rosenbrock_w", {}, 0.0037, 3),
]


@pytest.mark.parametrize(("stepper", "options", "coefficient", "power"), DAMPING)
def test_vibrations_decay_as_stated(stepper, options, coefficient, power):
    step = 0.1
    run = vibrating(stepper, step, **options)
    energy = run.channel("energy")
    rate = -0.5 * np.log(energy[-1] / energy[0]) / (run.times[-1] - run.times[0])
    # the next terms are (step frequency)^2 = 1 % of the first, times numbers of order 1
    assert rate / FREQUENCY == pytest.approx(coefficient * step**power, rel=0.03)


@pytest.mark.parametrize(
    ("stepper", "options"), [("theta", {}), ("generalised_alpha", {"spectral_radius": 1.0})]
)
def test_undamped_methods_keep_the_energy(stepper, options):
    # equations solved to 1e-13 of the motion, 20 000 times
    energy = vibrating(stepper, 0.5, samples=100, steps_per_sample=200, **options).channel("energy")
    assert np.ptp(energy) < 1e-10 * energy[0]


def test_symplectic_euler_keeps_an_energy_near_the_true_one():
    # For a linear system with stiffness K it keeps E - step / 2 u K w. A pulse, so that every mode takes part.
    run = vibrating("symplectic_euler", 0.2, samples=1000, steps_per_sample=200, shape="pulse")
    w, u = np.split(run.rows, 2, axis=1)
    outer = np.pad(w, ((0, 0), (1, 1)))
    force = STRING["tension"] / CELL**2 * (outer[:, :-2] - 2.0 * w + outer[:, 2:])
    energy = run.channel("energy")
    kept = energy + 0.5 * run.step * CELL * np.sum(u * force, axis=1)
    # 200 000 steps: the true energy goes up and down, the kept one by the steps' round-off alone
    assert np.ptp(energy) > 0.05 * energy[0]
    assert np.ptp(kept) < 1e-11 * energy[0]


def test_symplectic_euler_feeds_gyroscopic_motion():
    # growth of the fastest growing mode of the one-step map; gyroscopic frequencies reach 2 v / h
    p = STRING | {"belt_speed": 20.0, "step": 1e-6}
    system = motion.system(p)
    states = np.eye(system.scale.size)
    for y in states:
        outcome = symplectic_euler.march(
            system,
            symplectic_euler.control(p),
            p["step"],
            np.zeros((1, y.size)),
            np.zeros(1),
            y,
            symplectic_euler.work(system),
            np.zeros(len(COUNTERS), dtype=np.int64),
        )
        assert outcome == 0
    growth = np.log(np.abs(np.linalg.eigvals(states.T)).max()) / p["step"]
    largest = 2.0 * p["belt_speed"] / CELL * np.cos(np.pi / CELLS)
    assert growth == pytest.approx(0.5 * p["step"] * largest**2, rel=0.02)


# A mass at rest under smoothed friction that is pushed: a decay a thousand times faster than the step.
PUSH, FAST = 1e-7, 1000.0
RESTING = scene(
    "oscillator",
    belt_speed=0.0,
    static_friction=0.6,
    initial_speed=PUSH,
    friction_speed=1e-4,
    solver_tolerance=1e-13,
)
FACTORS = [
    ("theta", {}, (1 - FAST / 2) / (1 + FAST / 2)),
    ("theta", {"theta": 1.0}, 1 / (1 + FAST)),
    ("sdirk", {}, 0.0),
    ("rosenbrock_w", {}, 0.0),
]


def pushed(stepper, **options):
    """Speeds after each of eight steps, in units of the first."""
    step = FAST * RESTING["friction_speed"] / 0.6
    p = RESTING | options | {"step": step * (1 + 1e-12), "sampling_rate": 1.0 / step, "duration": 8 * step}
    return marched("oscillator", stepper, p).channel("speed") / PUSH


@pytest.mark.parametrize(("stepper", "options", "factor"), FACTORS)
def test_what_is_too_fast_for_the_step(stepper, options, factor):
    # gone but for 1 / FAST where it goes; else turned about, undamped: the trapezoidal rule rings
    tail = 6.0 / FAST if FACTS[stepper].l_stable else 1e-4
    assert pushed(stepper, **options) == pytest.approx(factor ** np.arange(1, 9), abs=tail)


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.6])
def test_generalised_alpha_shrinks_it_by_its_radius(radius):
    # a double eigenvalue: n r^(n-1) beside r^n
    speeds, n = np.abs(pushed("generalised_alpha", spectral_radius=radius)), np.arange(1, 9)
    assert np.all(speeds < 3.0 * n * (radius + 0.05) ** (n - 1) + 1.0 / FAST)
    assert speeds[0] > 0.3
