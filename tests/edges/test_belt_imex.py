"""The fast step on the belt: what it treats explicitly limits it, by formula; beyond, the run fails and says so."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt.step_choice import transverse_limit
from cvt_hpc.variables import Status
from support.belts import point
from support.lone import Transient

CASES = {
    "bending": {"bending_stiffness": 200.0, "stations": 64},
    "bending, half the mesh": {"bending_stiffness": 20.0, "stations": 128},
    "contact": {"flank_stiffness": 1e12},
}
RIGID = {
    "sheave_stiffness": np.inf,
    "stiffness_of": "sheave",
    "friction_gradient": 0.0,
    "lag_stiffness": 1e11,
}


def limit(values):
    """2 / w of the shortest wave across the belt: bending, tension and, in the grooves, the elements' flanks."""
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
    # Bending has no damper worth the name at the shortest wave: measured between 1.00 and 1.05 of the formula.
    # Contact has friction, and opens instead of swinging on: 1.1 to 1.2.
    status, reason = outcome(1.3 * step, values)[0]
    assert status == Status.FAILED_NUMERICS and reason
    assert quiet < 1e-4
