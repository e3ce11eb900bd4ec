"""Implicit bending of the fast step: its system against dense ones, and no growth of the shortest waves."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state
from cvt_hpc.models.elastic_belt.bending import second_difference
from cvt_hpc.models.elastic_belt.imex_stations import (
    DAMPED,
    IMPLICIT,
    LAG_SHARE,
    move_across,
    move_with_layers,
)
from cvt_hpc.models.elastic_belt.lane_belt import (
    Work,
    lane_belt,
    lane_state,
    parted,
    parted_state,
    split,
    work_space,
)
from support.fast_runs import FastRuns
from support.settled import DEFAULTS
from support.straight import moving_straight, straight_belt

STATIONS = 96
BELT = belt_constants(DEFAULTS | {"stations": STATIONS})
STIFFER = BELT._replace(bending_stiffness=5.0)


def gyroscopic(belt):
    """Force by the increments of u: -m v (u_ahead - u_behind) over both cells."""
    unit = np.eye(STATIONS)
    return (
        -belt.mass * belt.belt_speed * belt.per_span[:, None] * (np.roll(unit, 1, 1) - np.roll(unit, -1, 1))
    )


def expected(belt, step, force, heavy, cross, layers):
    second = second_difference(belt.cell, belt.dual)
    whole = np.diag(heavy) + IMPLICIT * step * belt.bending_stiffness * second @ second
    turning = gyroscopic(belt)
    alone = np.linalg.solve(whole, force)
    pushed = np.linalg.solve(whole, force + turning @ alone)
    return pushed, np.linalg.solve(whole, force + turning @ pushed - cross * layers)


@pytest.mark.parametrize("step", [1e-6, 8e-6, 5e-5])
@pytest.mark.parametrize("parts", [1, 8])
def test_increments_are_those_of_the_dense_system(step, parts):
    random = np.random.default_rng(0)
    force, cross, layers = random.normal(size=(3, STATIONS))
    heavy = (
        BELT.mass / step * np.exp(2.0 * random.normal(size=STATIONS))
    )  # where friction holds, and where not
    belts = [BELT] if parts > 1 else [BELT, STIFFER] * 4
    belt, state = lane_belt(belts, np.float64), None
    state = lane_state(
        belts, [initial_state(DEFAULTS | {"stations": STATIONS}, BELT)] * len(belts), np.float64
    )
    state.time[0] = 1.0
    work = work_space(state, lf.FIELDS_OF_WORK)
    if parts > 1:
        belt, state, work = parted(belt, parts), parted_state(state, parts), Work(split(work.stations, parts))
    stations = work.stations.data

    def put(field, values):
        stations[:, field] = values.reshape(parts, -1).T if parts > 1 else values[:, None]

    def found(field):
        return stations[:, field].T.reshape(-1, STATIONS)

    for field, values in ((lf.ACROSS, force), (lf.MASS_ACROSS, heavy), (lf.CROSS, cross)):
        put(field, values)
    coupled = move_across(belt, state, work.stations, step)
    first, right = found(lf.PUSH).copy(), found(lf.Y_0).copy()
    put(lf.DV_0, layers)
    move_with_layers(belt, state, work.stations, coupled)
    for one, pushed, share, both in zip(belts, first, right, found(lf.PUSH), strict=True):
        wanted = expected(one, step, force, heavy, cross, layers)
        size = np.abs(wanted).max()
        assert pushed == pytest.approx(wanted[0], abs=1e-13 * size)
        assert both == pytest.approx(wanted[1], abs=1e-13 * size)
        assert share == pytest.approx(-one.dual * cross * wanted[0], abs=1e-13 * size)


def largest_share(lag_share, seed):
    """Largest (1 + 2 DAMPED) dt/4 x.K x over x.M x of the step's mass M, in random friction on any mesh; stable to 1."""
    random = np.random.default_rng(seed)
    n, inertia, other = 40, 1.0, 0.9
    cell = np.exp(0.2 * random.normal(size=n))
    second = second_difference(cell, 0.5 * (cell + np.roll(cell, 1)))
    symmetric = np.diag(0.5 * (cell + np.roll(cell, 1))) @ second @ second
    lengths = 0.5 * (cell + np.roll(cell, 1))
    bending = 10.0 ** random.uniform(-1.0, 4.0) * symmetric  # dt K
    one, two = 10.0 ** random.uniform(-3.0, 4.0, (2, n))  # slopes along and across the sliding
    turn = random.uniform(0.0, np.pi, n)
    radial = one * np.cos(turn) ** 2 + two * np.sin(turn) ** 2
    along = one * np.sin(turn) ** 2 + two * np.cos(turn) ** 2
    cross = (one - two) * np.cos(turn) * np.sin(turn)
    heavy, own = (inertia + radial) * lengths, (other + along) * lengths
    cross = cross * lengths
    whole = np.diag(heavy) + IMPLICIT * bending
    inner = np.diag(own - lag_share * cross**2 / heavy) + cross[:, None] * np.linalg.inv(whole) * cross
    mass = np.block([[whole, np.diag(cross)], [np.diag(cross), inner]])
    elastic = np.block([[0.25 * (1.0 + 2.0 * DAMPED) * bending, np.zeros((n, n))], [np.zeros((n, 2 * n))]])
    return np.linalg.eigvals(np.linalg.solve(mass, elastic)).real.max(), np.linalg.eigvalsh(mass).min()


def test_the_mass_of_a_step_outweighs_bending_whatever_friction_does():
    shares, least = zip(*(largest_share(LAG_SHARE, seed) for seed in range(100)), strict=True)
    assert max(shares) < 1.0 and min(least) > 0.0
    # were the elements' block to contain the whole coupling, some would grow
    assert max(largest_share(1.0, seed)[0] for seed in range(100)) > 1.0


@pytest.mark.parametrize("cells", [40, 160])
def test_short_waves_of_a_strand_do_not_grow(cells):
    """At steps 5 and 80 times as long as explicit bending allows."""
    belt = straight_belt(cells, 9.4, 0.5, 0.0, 4.0)
    state = moving_straight(belt)
    state.fields[f.U] += 1e-4 * np.random.default_rng(0).normal(size=belt.cell.size)
    run, before = FastRuns([belt], [state]), np.abs(state.fields[f.U]).max()
    run.advance(4000, 4.6e-6)
    assert 0.0 < np.abs(run.state().fields[f.U]).max() < 3.0 * before
