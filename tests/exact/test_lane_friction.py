"""The friction laws in lanes against the plain ones, which are tested against their formulas."""

import numpy as np
import pytest

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.physics.friction import Law, friction_coefficient, friction_law, saturation
from cvt_hpc.physics.lane_friction import lane_coefficient, lane_law, lane_saturation, lane_table

WIDTHS = {np.float64: 8, np.float32: 16}
# A formula of some ten operations and an exponential on numbers of order 1, of which it may take differences.
ROUND_OFF = {np.float64: 2e-14, np.float32: 1e-5}
MU, GRADIENT, SCALE, SPEED, FORCE, FOUND = range(6)
TABLE = (
    (1e4, 3e4, 2e5),
    (0.0, 0.05, 0.1, 0.8),
    ((0.10, 0.20, 0.15, 0.08), (0.5, 0.3, 0.2, 0.1), (0.07, 0.09, 0.3, 0.2)),
)
ONE_SPEED = ((1e4, 3e4), (0.1, 0.3), ((0.1, 0.2), (0.3, 0.2)))


@kernel
def formulas(kind: int, rows: int, a: LaneArray) -> None:
    for j in range(rows):
        kinetic, fall, per_scale = lane_law(kind, a[j, MU], a[j, GRADIENT], a[j, SCALE])
        a[j, FOUND] = lane_coefficient(kind, kinetic, fall, per_scale, a[j, SPEED])


@kernel
def saturations(rows: int, a: LaneArray) -> None:
    for j in range(rows):
        a[j, FOUND] = lane_saturation(a[j, SPEED], 1.0 / a[j, SCALE])


@kernel
def tables(table: tuple[np.ndarray, np.ndarray, np.ndarray], rows: int, a: LaneArray) -> None:
    for j in range(rows):
        a[j, FOUND] = lane_table(table, a[j, SPEED], a[j, FORCE])


def arguments(dtype, rows=500):
    """Coefficients and speeds of each lane, at rest and at the laws' kinks too."""
    random, lanes = np.random.default_rng(1), WIDTHS[dtype]
    a = LaneArray(rows, 6, lanes, dtype)
    shape = rows, lanes
    a.data[:, MU] = random.uniform(0.01, 0.3, shape)
    a.data[:, GRADIENT] = random.uniform(-5.0, 0.0, shape)
    a.data[:, SCALE] = random.uniform(1e-3, 1.0, shape)
    share = random.uniform(0.0, 3.0, shape)
    share[:, 0], share[0], share[1] = 0.0, 1.0, np.sqrt(3.0)
    a.data[:, SPEED] = share * a.data[:, SCALE]
    a.data[:, FORCE] = random.uniform(0.0, 3e5, shape)
    return a


def each(a):
    """All places of the array, one after the other, in double precision."""
    return a.data.astype(float).transpose(0, 2, 1).reshape(-1, 6)


@pytest.mark.parametrize("dtype", WIDTHS)
@pytest.mark.parametrize("law", [law for law in Law if law is not Law.TABLE], ids=lambda law: law.name)
def test_laws_are_the_plain_ones(law, dtype):
    a = arguments(dtype)
    formulas(int(law), a.data.shape[0], a)
    for mu, gradient, scale, speed, force, found in each(a):
        kept = friction_law(law.name.lower(), mu, gradient, scale)
        expected, _ = friction_coefficient(kept, speed, force)
        # parts as large as g v_s x^3 are subtracted from each other
        third = min(speed / scale, 2.0) ** 3
        assert found == pytest.approx(
            expected, abs=ROUND_OFF[dtype] * (mu - gradient * scale * (1.0 + third))
        )


@pytest.mark.parametrize("dtype", WIDTHS)
@pytest.mark.parametrize("table", [TABLE, ONE_SPEED], ids=["table", "table from a speed on"])
def test_tables_are_the_plain_ones(table, dtype):
    a = arguments(dtype)
    # at every knot, and outside
    knots = [(speed, force) for speed in (*table[1], 0.0, 99.0) for force in (*table[0], 0.0, 1e9)]
    for j, (speed, force) in enumerate(knots):
        a.data[j, SPEED, 0], a.data[j, FORCE, 0] = speed, force
    tables(tuple(np.array(part, dtype) for part in table), a.data.shape[0], a)
    law = friction_law("table", 0.08, 0.0, 0.05, *table)
    for _, _, _, speed, force, found in each(a):
        expected, _ = friction_coefficient(law, speed, force)
        # sums over intervals; single precision knows knots to 6e-8, on slopes of 6 s/m
        assert found == pytest.approx(expected, abs=ROUND_OFF[dtype])


@pytest.mark.parametrize("dtype", WIDTHS)
def test_saturation_is_the_plain_one(dtype):
    a = arguments(dtype)
    a.data[1, SPEED] = 1e6  # what is left there is held within the exponent's range
    saturations(a.data.shape[0], a)
    for _, _, width, speed, _, factor in each(a):
        assert factor == pytest.approx(saturation(speed, width)[0], abs=ROUND_OFF[dtype])
