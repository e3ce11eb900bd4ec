"""A ring of RCM beams that nothing holds: momentum, angular momentum and energy."""

import numpy as np

from cvt_hpc.models.beam_pushbelt.rcm import RcmBeam
from cvt_hpc.models.beam_pushbelt.ring import close, relaxed_ring
from support.rcm import advance, conserved


def tumbling():
    """Thrown, turning, bent and stretched: 0.5 kg/m, 0.1 m beams, waves of 63 m/s along them."""
    ring = relaxed_ring(RcmBeam(0.1, 0.5, 2000.0, 0.05, 5.0), 6)
    draw = np.random.default_rng(1)
    ring.u[0::5], ring.u[1::5] = 1.0 - 8.0 * ring.q[1::5], 2.0 + 8.0 * ring.q[0::5]
    ring.u[2::5] = 8.0
    ring.u[:] += 0.3 * draw.normal(size=ring.u.size)
    close(ring)
    return ring


def change(dt):
    """What changes in 20 ms of what is conserved, and its size."""
    ring = tumbling()
    before = conserved(ring)
    assert advance(ring, dt, round(0.02 / dt))
    return conserved(ring) - before, before


def test_free_flight():
    # a step of first order errs by its size: up to 2e-4 of what there is at 5 us, half of that at 2.5 us
    error, before = change(5e-6)
    assert abs(error / before).max() < 2e-4
    assert abs(error[:3]).max() > 1e-6  # far above rounding: the halving is seen
    np.testing.assert_allclose(change(2.5e-6)[0], 0.5 * error, rtol=0.2, atol=2e-7)
