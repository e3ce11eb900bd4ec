"""RCM rings and beams that nothing holds: momentum, angular momentum and energy."""

import numpy as np
import pytest

from cvt_hpc.multibody.rcm_beam import RcmBeam
from cvt_hpc.multibody.rcm_chain import close, relaxed_ring
from support.rcm import advance, conserved, straight_beam

GRAVITY = np.array([2.0, -9.81])


def tumbling(make, gravity=(0.0, 0.0)):
    """Thrown, turning, bent and stretched: 0.5 kg/m, 0.1 m elements, waves of 63 m/s along them."""
    chain = make(RcmBeam(0.1, 0.5, 2000.0, 0.05, 5.0, 0.0, gravity), 6)
    draw = np.random.default_rng(1)
    chain.u[0::5], chain.u[1::5] = 1.0 - 8.0 * chain.q[1::5], 2.0 + 8.0 * chain.q[0::5]
    chain.u[2::5] = 8.0
    chain.u[:] += 0.3 * draw.normal(size=chain.u.size)
    if chain.turn:
        close(chain)
    return chain


def moved(make, theta, dt, gravity=(0.0, 0.0), duration=0.02):
    chain = tumbling(make, gravity)
    before = conserved(chain)
    steps = round(duration / dt)
    assert advance(chain, dt, theta, steps) == steps
    return before, conserved(chain)


@pytest.mark.parametrize("make", [relaxed_ring, straight_beam])
@pytest.mark.parametrize("theta", [0.0, 0.5])
def test_free_flight(make, theta):
    # a step of first order errs by its size: up to 2e-4 of what there is at 5 us, half of that at 2.5 us
    before, after = moved(make, theta, 5e-6)
    error = after - before
    assert abs(error / before).max() < 2e-4
    assert abs(error[:3]).max() > 1e-6  # far above rounding: the halving is seen
    half = moved(make, theta, 2.5e-6)[1] - before
    np.testing.assert_allclose(half, 0.5 * error, rtol=0.2, atol=2e-7)


def test_free_fall():
    before, after = moved(relaxed_ring, 0.0, 5e-6, tuple(GRAVITY))
    weight = 0.5 * 0.6 * GRAVITY
    np.testing.assert_allclose(after[:2], before[:2] + 0.02 * weight, rtol=0, atol=1e-4)
    assert after[3] == pytest.approx(before[3], rel=1e-4)
