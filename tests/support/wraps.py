"""Wraps and courses of gaps at random, for the tests of contact."""

import numpy as np

from cvt_hpc.physics.sheaves import sheaves

STATIONS, ARC, RADIUS = 20, 0.27, 0.075
ELEMENTS = 3e10  # c_e [N/m^2] in the middle of what is tried


def places(stations, arc, radius):
    """Weights, angles and rises of stations at equal distances on an arc, the first and last at its ends."""
    weight = np.full(stations, arc / (stations - 1))
    weight[[0, -1]] *= 0.5
    return weight, np.linspace(0.0, arc / radius, stations), np.zeros(stations)


def local_kernel(wrap):
    """Opening of the discs by local bending at each station per force at each other, (m, m)."""
    beside = np.diag(wrap.off_diagonal[1:], 1)
    return np.linalg.inv(np.diag(wrap.diagonal) + beside + beside.T)


def random_wrap(random, stiffness=None):
    """A wrap on the common stations, all else its own."""
    if stiffness is None:
        stiffness = random.choice([0.3, 1.0, 3.0, np.inf])
    return sheaves(
        *places(STATIONS, ARC, RADIUS),
        RADIUS,
        stiffness,
        random.choice([4e4, 4e5, np.inf]),
        random.uniform(2e9, 8e9),
        random.uniform(0.004, 0.04),
        ELEMENTS * random.uniform(0.5, 2.0),
        random.choice([0.5, 1.0, np.inf]),
    )


def courses(random, lanes, calls=8):
    """Gaps (calls, stations, lanes) [m] that change from call to call, so that stations open and close."""
    x = np.linspace(0.0, 1.0, STATIONS)[:, None]
    slow, fast = random.uniform(1.0, 9.0, lanes), random.uniform(0.0, 2.0, lanes)
    shapes = [
        np.cos(slow * x + fast * call) + 0.5 * random.normal(size=(STATIONS, lanes)) for call in range(calls)
    ]
    return 2e-5 * (np.array(shapes) + random.choice([-2.0, -0.5, 0.0], lanes))
