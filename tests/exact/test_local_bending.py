"""Local bending that spreads along the sheaves of the pushbelts: against dense problems and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.pushbelt.local_bending import axial_excess, spread_bending
from support.complementarity import solve_lcp

STIFFNESS = 1e8  # [N/m] of an element's flank, bending in series


def spread(depths, driven, compliance, decay, presumed=0.0):
    """The spread (elements,) [m] by depths (elements, points) [m]."""
    nodes, points = depths.shape
    array = in_lanes(np.column_stack([driven, depths, np.full(nodes, presumed)]))
    found = array.data[:, 1 + points]
    work = np.zeros((nodes, 4))
    spread_bending(
        array.data[:, 0], array.data[:, 1 : 1 + points], found, work, compliance, STIFFNESS / points, decay
    )
    return of_lanes(array)[:, 1 + points]


def kernel_of(driven, decay):
    """K of a dense matrix: y = b K F, by its inverse."""
    nodes, link = driven.size, decay / (1.0 - decay) ** 2
    inverse = np.eye(nodes)
    for i in range(nodes):
        j = (i + 1) % nodes
        if driven[i] == driven[j]:
            inverse[i, i] += link
            inverse[j, j] += link
            inverse[i, j] -= link
            inverse[j, i] -= link
    return np.linalg.inv(inverse)


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from([6, 8, 16, 20]), st.sampled_from([1, 2]), st.floats(0.05, 0.95), st.floats(0.1, 0.97),
    st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_forces_are_those_of_the_dense_contact_problem(nodes, points, decay, share, seed):
    """w = F / k_p + z - depth, F >= 0, w >= 0, F.w = 0, with z = b (K - 1) F of an element's points."""
    random = np.random.default_rng(seed)
    driven = np.roll(np.arange(nodes) < random.integers(2, nodes - 1), random.integers(nodes)).astype(float)
    depths = 2e-5 * (random.normal(size=(nodes, points)) + random.choice([-1.0, 0.0, 1.0]))
    compliance = share / STIFFNESS
    found = spread(depths, driven, compliance, decay, 2e-5 * random.normal())
    force = STIFFNESS / points * np.maximum(depths - found[:, None], 0.0)

    summed = np.kron(np.eye(nodes), np.ones((1, points)))
    bend = compliance * (kernel_of(driven, decay) - np.eye(nodes))
    matrix = points / STIFFNESS * np.eye(nodes * points) + summed.T @ bend @ summed
    expected = solve_lcp(matrix * STIFFNESS, -depths.ravel()) * STIFFNESS
    assert force.ravel() == pytest.approx(expected, abs=1e-9 * STIFFNESS * np.abs(depths).max())


def test_a_force_deflects_its_surroundings_by_an_exponential_and_alike_forces_as_a_bedding():
    nodes, decay, compliance = 256, 0.8, 0.5 / STIFFNESS
    driven = (np.arange(nodes) >= 128).astype(float)
    depths = np.full((nodes, 1), -1.0)
    depths[64] = 1e-5
    z = spread(depths, driven, compliance, decay)
    force = STIFFNESS * (1e-5 - z[64])
    away = np.abs(np.arange(128) - 64)
    expected = compliance * force * ((1.0 - decay) / (1.0 + decay) * decay**away - (away == 0))
    # at the ends, where the sheave is free, 0.8^63 of the peak is thrown back
    assert z[:128] == pytest.approx(expected, abs=1e-6 * compliance * force)
    assert z[128:] == pytest.approx(0.0, abs=1e-30)
    assert spread(np.full((nodes, 1), 1e-5), driven, compliance, decay) == pytest.approx(0.0, abs=1e-18)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_slope_along_the_axis_is_half_way_between_those_of_the_longest_and_the_shortest_waves(share):
    nodes, decay, compliance = 256, 0.97, share / STIFFNESS
    driven = (np.arange(nodes) >= 128).astype(float)
    taken, slopes = STIFFNESS + axial_excess(compliance, STIFFNESS), []
    for wave in (np.ones(nodes), (-1.0) ** np.arange(nodes)):
        depths = 1e-5 + 1e-6 * wave
        force = STIFFNESS * (depths - spread(depths[:, None], driven, compliance, decay))
        slopes.append((force[64] - STIFFNESS * 1e-5) / (1e-6 * wave[64]))
    # S of the wave from element to element, 4 a = 4313, is a little below K / (1 - b K);
    # the ends of the arc are felt by up to 1e-4
    short = 4.0 * decay / (1.0 - decay) ** 2
    assert slopes == pytest.approx(
        [STIFFNESS, STIFFNESS * (1.0 + short) / (1.0 + (1.0 - share) * short)], rel=3e-4
    )
    # the part of an error that an iteration leaves, alike and of either sign
    left = share / (2.0 - share)
    assert 1.0 - np.array(slopes) / taken == pytest.approx([left, -left], abs=5e-3)
