"""The explicit step on the belt: its limit by formula, by eigenvalues and as measured; and that it is named.

Measured is the step from which a tiny difference grows, on the step's own map from a settled state. Beyond it
nothing diverges at first: friction saturates, stations hum from step to step, and the strands are wrong.
"""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt.one_system import unpack
from cvt_hpc.models.elastic_belt.rhs import ring_drag
from cvt_hpc.steppers.fastest_rate import STABLE, fastest_rate
from cvt_hpc.variables import Status
from support.belts import eigenvalues, general, longest_stable_step, settled

# even cells: the formulas are those of layers in which all cells swing or are damped alike
SMOOTH = {"ring_friction": 0.0, "friction_speed": 0.5, "friction_gradient": -0.05, "end_refinement": 1.0}
CASES = {
    "ring friction": {"ring_friction_speed": 0.003},
    "flank friction": {"ring_friction": 0.0, "friction_speed": 0.01},
    "waves": SMOOTH | {"element_damping": 0.0, "ring_damping": 0.0},
    "layer damper": SMOOTH | {"element_damping": 200.0, "ring_damping": 0.0},
    # a slow sheave and next to no friction: else these come first where contact is stiff
    "contact": SMOOTH
    | {
        "flank_stiffness": 1e13,
        "sheave_stiffness": np.inf,
        "stiffness_of": "sheave",
        "friction_speed": 50.0,
        "load": 0.0,
    }
    | {"lag_stiffness": 1e12},
}


def state_of(values):
    whole, y = settled(**values)
    flat = whole.constants
    assert whole.rates(flat, 1.0, y, np.empty_like(y))
    unpack(flat, 1.0, y)
    return flat, flat.state


def by_formula(case, values):
    """Bound of the fastest rate [1/s] by what is known on paper; where it is friction, of sticking stations."""
    flat, state = state_of(values)
    belt = flat.belt
    cell = belt.cell.min()
    if case == "ring friction":
        stations = np.flatnonzero(belt.arc_curvature)
        far = [
            ring_drag(belt, j, j - 1, flat.eps, 1e3, 0.0, 1.0, 0.0)[0] for j in stations
        ]  # mu_r x pressure
        return max(far) / belt.ring_friction_speed * (1.0 / belt.ring_mass.min() + 1.0 / belt.element_mass)
    if case == "flank friction":
        static = belt.law.kinetic - belt.law.gradient * belt.law.speed
        normal = flat.force.max() / np.cos(belt.half_wedge_angle)
        return 2.0 * normal * static / (belt.element_mass * belt.friction_speed)
    wave = 2.0 / cell * np.sqrt(max(belt.element_stiffness / belt.element_mass, belt.ring_stiffness / 0.3))
    if case == "waves":
        return wave
    if case == "layer damper":
        return 4.0 * belt.element_damping / (belt.element_mass * cell**2)
    return 2.0 * np.tan(belt.half_wedge_angle) * np.sqrt(belt.driven.element_stiffness / belt.mass)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_limit_is_that_of_formula_and_eigenvalue(case):
    values = CASES[case]
    found = eigenvalues(**values)
    fastest = found[np.abs(found).argmax()]
    # waves and contact swing, all else decays
    assert (abs(fastest.imag) > 3.0 * abs(fastest.real)) == (case in ("waves", "contact"))
    share = abs(fastest) / by_formula(case, values)
    # Friction: the formula is that of the largest force on a station that sticks, some slide slowly. Else
    # layers and contact swing with their neighbours, tension and bending add to the contact's stiffness.
    assert (0.2 if "friction" in case else 0.9) < share < (1.0 if "friction" in case else 1.15)
    # velocities first: a decay d and a frequency w are stable to 2 d dt + (w dt)^2 = 4
    swing = abs(fastest) ** 2 if abs(fastest.imag) > 0.0 else 0.0
    decay = -2.0 * fastest.real if swing else -fastest.real
    limit = 2.0 / decay if not swing else (np.sqrt(decay**2 + 4.0 * swing) - decay) / swing
    measured = longest_stable_step("symplectic_euler", limit, **values)
    # a decay that is not alone, as a damper with its spring, has its limit a little below 2 / d
    assert measured == pytest.approx(limit, rel=0.1)


def test_the_power_method_finds_the_fastest_rate():
    for case in ("flank friction", "waves"):
        whole, y = settled(**CASES[case])
        direction = np.random.default_rng(2).normal(size=y.size)
        rate = [fastest_rate(whole, 1.0, y, direction) for _ in range(4)][-1]
        expected = np.abs(eigenvalues(**CASES[case])).max()
        # from below, pairs of waves lie close
        assert 0.95 * expected < rate < 1.02 * expected, case


def test_a_step_beyond_is_named_though_nothing_diverges():
    # sliding saturates friction: no number overflows, and the displacements look like a vibration of 10 um
    values = CASES["flank friction"]
    limit = STABLE["symplectic_euler"] / np.abs(eigenvalues(**values)).max()
    run = general("symplectic_euler", step=3.0 * limit, **values)
    status, reason = run.advance(220)
    assert status == Status.FAILED_NUMERICS
    assert "is beyond what is stable" in reason
    assert np.all(np.isfinite(run.displacement))


def test_a_step_within_is_not():
    run = general("symplectic_euler", step=1e-7)
    assert run.advance(10) is None
