"""Steps of RCM chains: their order, the limit of the explicit one, and that the implicit one has none there."""

import numpy as np
import pytest

from cvt_hpc.multibody.rcm_beam import RcmBeam
from support.rcm import advance, straight_beam


def end(theta, steps):
    """A falling, turning beam after 10 ms."""
    chain = straight_beam(RcmBeam(0.1, 0.5, 2000.0, 0.002, 2.0, 0.001, (0.0, -9.81)), 3)
    chain.u[:] = np.random.default_rng(2).normal(size=chain.u.size)
    assert advance(chain, 0.01 / steps, theta, steps) == steps
    return chain.q


@pytest.mark.parametrize("theta", [0.0, 0.5, 1.0])
def test_order_one(theta):
    q = [end(theta, steps) for steps in (4000, 8000, 16000)]
    ratio = np.linalg.norm(q[1] - q[0]) / np.linalg.norm(q[2] - q[1])
    assert np.log2(ratio) == pytest.approx(1.0, abs=0.05)


STEEL = RcmBeam(0.007, 7800 * 1e-5, 2.1e11 * 1e-5, 1e-6)  # 10 mm^2, so thin that bending is slow
LIMIT = 0.007 / np.sqrt(3.0 * 2.1e11 / 7800)  # [s]: 2 / omega_max


def growth(theta, dt, steps=200):
    """By what factor the fastest axial vibration of a free beam has grown."""
    chain = straight_beam(STEEL, 4)
    chain.u[0::5] = 1e-9 * (-1.0) ** np.arange(5)
    advance(chain, dt, theta, steps)
    return abs(chain.u).max() / 1e-9


def test_limit_of_the_explicit_step():
    # at the limit the factor of a step is -1; 1 % above it is -1.33
    assert growth(0.0, 0.99 * LIMIT) < 10
    assert growth(0.0, 1.01 * LIMIT) > 1e6


def test_no_limit_of_the_implicit_step():
    # at 30 limits 1/2 lets the vibration beat slowly, and 1 leaves none of it but rounding
    assert 0.1 < growth(0.5, 30 * LIMIT, 200) < 60
    assert 0.1 < growth(0.5, 30 * LIMIT, 2000) < 60
    assert growth(1.0, 30 * LIMIT) < 1e-3
