"""Order of every stepper on two smooth motions, over many steps or tolerances.

An oscillator under the cubic law whose vibration grows to a limit cycle without coming to rest, against
DOP853 of SciPy, which is none of the steppers; a pulse on a moving string, against the exponential of the
matrix of its (linear) equations.
"""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cvt_hpc.models.moving_string import transient as string_motion
from cvt_hpc.models.oscillator import motion as oscillator_motion
from support.small_systems import ADAPTIVE, FACTS, FIXED, begin, finished, order, scene

SCENES = {
    # sliding between 0.3 and 1.6 m/s: the law is a cubic there, the smoothing at rest not felt
    "oscillator": scene(
        "oscillator",
        friction_law="cubic",
        friction_gradient=-1.0,
        stribeck_velocity=1.0,
        belt_speed=0.95,
        initial_displacement=0.7,
        initial_speed=0.0,
        duration=10.0,
        sampling_rate=0.5,
        solver_tolerance=1e-13,
    ),
    "moving_string": scene(
        "moving_string",
        shape="pulse",
        cells=16,
        duration=4e-3,
        sampling_rate=2.5e3,
        strand_probes=3,
        solver_tolerance=1e-13,
    ),
}
# Steps in a sampling interval: errors from some per cent down to where the shortest are still far above
# round-off (1e-11 of the motion).
STEPS = {"oscillator": (24, 240), "moving_string": (40, 200)}
CASES = [
    *((name, {}, FACTS[name].order) for name in FIXED),
    ("theta", {"theta": 1.0}, 1),
    ("theta", {"theta": 0.6}, 1),
    ("generalised_alpha", {"spectral_radius": 0.0}, 2),
    ("generalised_alpha", {"spectral_radius": 1.0}, 2),
]


@cache
def reference(model):
    """States at the samples."""
    p = SCENES[model]
    motion = {"oscillator": oscillator_motion, "moving_string": string_motion}[model]
    system, y = motion.system(p), motion.initial_state(p)
    interval, samples = 1.0 / p["sampling_rate"], round(p["duration"] * p["sampling_rate"])

    def rates(t, y):
        out = np.zeros_like(y)
        assert system.rates(system.constants, t, y, out)
        return out

    if model == "moving_string":
        matrix = np.column_stack([rates(0.0, unit) for unit in np.eye(y.size)])
        advance = expm(interval * matrix)
        return np.array([np.linalg.matrix_power(advance, k) @ y for k in range(1, samples + 1)])
    times = interval * np.arange(1, samples + 1)
    return solve_ivp(rates, (0.0, times[-1]), y, "DOP853", times, rtol=1e-13, atol=1e-14).y.T


def error(model, stepper, **changes):
    """Root mean square of the displacements' error against that of the displacements."""
    run = finished(model, stepper, SCENES[model] | changes)
    right = reference(model)[:, run._displacements]
    return np.sqrt(np.mean((run.displacement - right) ** 2) / np.mean(right**2))


@pytest.mark.parametrize(
    ("model", "stepper", "options", "stated"),
    [(model, *case) for model in SCENES for case in CASES if (model, case[0]) != ("moving_string", "moreau")],
)
def test_order_in_the_step(model, stepper, options, stated):
    least, most = STEPS[model]
    numbers = np.unique(np.geomspace(least, most, 20).astype(int))
    steps = 1.0 / (SCENES[model]["sampling_rate"] * numbers)
    errors = [error(model, stepper, step=step * (1 + 1e-12), **options) for step in steps]
    # neither round-off nor a step too long to be in the range of the order
    assert 1e-12 < errors[-1] < errors[0] < 0.5
    assert order(steps, errors) == pytest.approx(stated, abs=0.2)


@pytest.mark.parametrize("stepper", ADAPTIVE)
@pytest.mark.parametrize("model", SCENES)
def test_error_goes_with_the_tolerance(model, stepper):
    tolerances = np.geomspace(1e-4, 1e-9, 11)
    errors = np.array([error(model, stepper, tolerance=tolerance) for tolerance in tolerances])
    # what is allowed is made use of
    assert np.all(errors > 0.01 * tolerances)
    # SciPy's multistep methods change their order along the way: their slope is less sure
    assert order(tolerances, errors) == pytest.approx(1.0, abs=0.2)
    assert errors[-1] < 1e-6


def test_steps_at_a_tolerance_tell_the_order_of_the_pair():
    # error per step of order 5, held at the tolerance: steps go with tolerance^(-1/5)
    p = SCENES["oscillator"] | {"duration": 200.0, "sampling_rate": 0.005}
    tolerances = np.geomspace(1e-5, 1e-11, 7)
    steps = [finished("oscillator", "dormand_prince", p | {"tolerance": t}).steps for t in tolerances]
    assert order(tolerances, steps) == pytest.approx(-1.0 / 5.0, abs=0.02)


def test_moreau_is_of_second_order_where_forces_depend_on_positions():
    # kinetic friction is the same at every speed, and the mass stays slower than the belt
    p = SCENES["oscillator"] | {
        "friction_law": "coulomb",
        "friction_gradient": 0.0,
        "initial_displacement": 0.0,
        "initial_speed": 0.1,
    }
    x0, v0, pull = 0.0, 0.1, 0.6
    times = 2.0 * np.arange(1, 6)
    right = pull + (x0 - pull) * np.cos(times) + v0 * np.sin(times)
    steps = 2.0 / np.arange(24, 240, 20)
    errors = []
    for step in steps:
        run = begin("oscillator", "moreau", p | {"step": step})
        assert run.advance(5) is None
        errors.append(np.abs(run.displacement[:, 0] - right).max())
    assert order(steps, errors) == pytest.approx(2.0, abs=0.2)
