"""The fast step on the belt: what it treats explicitly limits it, by formula; beyond, the run fails and says so."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt.belt import belt_constants
from cvt_hpc.models.elastic_belt.step_choice import transverse_limit
from cvt_hpc.variables import Status
from support.belts import point
from support.lone import Transient

CASES = {
    "tension": {"bending_stiffness": 0.0, "thrust": 2e5, "end_refinement": 1.0, "stations": 512},
    "contact": {"flank_stiffness": 1e12},
}
RIGID = {
    "sheave_stiffness": np.inf,
    "stiffness_of": "sheave",
    "friction_gradient": 0.0,
    "lag_stiffness": 1e11,
}


def limit(values):
    """2 / w of the shortest wave across the belt: tension and, in the grooves, the elements' flanks."""
    return transverse_limit(point("imex", **values))


def outcome(step, values):
    """How 20 ms by the fast step end; steps of the very length asked for."""
    p = point("imex", **values, step=step, sampling_rate=1.0 / (step * max(round(50e-6 / step), 1)))
    run = Transient(p, "imex")
    return run.advance(round(0.02 / run.interval)), run


@pytest.mark.parametrize("case", CASES)
def test_the_limit_is_that_of_the_shortest_wave(case):
    values = RIGID | CASES[case]
    step = limit(values)
    found, run = outcome(0.95 * step, values)
    assert found is None
    quiet = np.abs(run.displacement).max()
    # contact fails from 1.1 to 1.2 of the formula on, strands from 1.3 to 1.6
    status, reason = outcome(1.6 * step, values)[0]
    assert status == Status.FAILED_NUMERICS and reason
    assert quiet < 2e-4


@pytest.mark.parametrize("damper", ["element_damping", "ring_damping"])
def test_the_dampers_of_the_layers_limit_it(damper):
    """Explicit across the belt: arcs of elastic sheaves that breathe; at the default step they leave the path."""
    values = {damper: 10e3, "stations": 96, "load": 60.0}
    step = limit(values)
    assert step == pytest.approx(2.0 * limit(values | {damper: 20e3}), rel=1e-2)
    assert outcome(0.75 * step, values)[0] is None
    status, reason = outcome(4.6e-6, values)[0]
    assert status == Status.FAILED_NUMERICS and reason


@pytest.mark.parametrize("bending", [0.05, 20.0])
def test_bending_limits_no_step(bending):
    """At the step that a scene has anyway, ten and more times as long as explicit bending bears."""
    values = RIGID | {"bending_stiffness": bending, "stations": 128, "end_refinement": 10.0, "step": 4.6e-6}
    p = point("imex", **values)
    cell = belt_constants(p).cell.min()
    assert 4.6e-6 > 2.0 * cell**2 / np.sqrt(16.0 * bending / (p["element_mass"] + p["ring_mass"]))
    run = Transient(p, "imex")
    assert run.advance(round(0.02 / run.interval)) is None
    assert np.abs(run.displacement).max() < 1e-4
