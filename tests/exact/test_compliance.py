"""The sheaves' contact: the linear-time solver against Lemke on the dense matrix, and formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import ROUNDS_OF_BLOCK_FLIPS, plain_contact, solve_wrap
from cvt_hpc.physics.sheaves import flexibility, sheaves
from support.complementarity import solve_lcp
from support.wraps import places

# A wrap of the default belt: radius [m], element stiffness c_e [N/m^2], k [N/m^2], l [m], c_tilt [N m/rad]
RADIUS, ELEMENTS, LOCAL, LENGTH, TILT = 0.075, 3e10, 4e9, 0.012, 4e5


def wrap(
    stations=20, arc=0.27, stiffness=1.0, tilt=TILT, local=LOCAL, length=LENGTH, elements=ELEMENTS, disc=1.0
):
    return sheaves(*places(stations, arc, RADIUS), RADIUS, stiffness, tilt, local, length, elements, disc)


def contact(sheave, gap, closed=None):
    """Forces, and the number of solves; `closed` is the set that the search starts from."""
    state, force = plain_contact(sheave), np.full(gap.size, np.nan)
    if closed is not None:
        state.stations[:, compliance.CLOSED] = closed
    return force, solve_wrap(state, gap, force), state


wraps = st.builds(
    wrap,
    stations=st.integers(4, 24),
    arc=st.floats(0.05, 0.3),
    stiffness=st.sampled_from([0.3, 1.0, 3.0, np.inf]),
    tilt=st.sampled_from([4e4, TILT, np.inf]),
    length=st.floats(0.002, 0.05),
    disc=st.sampled_from([0.5, 1.0, np.inf]),
)


@st.composite
def contacts(draw):
    """A wrap, gaps of any mixture of overlap and clearance, and a set to start from."""
    sheave = draw(wraps)
    m = sheave.weight.size
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    depth = draw(st.sampled_from([-2.0, -0.5, 0.0, 0.5]))
    smooth = draw(st.booleans())
    shape = np.cos(random.uniform(1.0, 9.0) * np.linspace(0.0, 1.0, m)) if smooth else random.normal(size=m)
    return sheave, 2e-5 * (shape + depth), random.random(m) < draw(st.sampled_from([0.0, 0.5, 1.0]))


@given(wraps)
def test_flexibility_is_the_kernels_of_the_text(sheave):
    # built entry by entry from y and t of the module's text; its own way inverts a tridiagonal matrix, of a
    # condition up to (2 l / h)^2 = 10^3 here
    h, m = sheave.weight[1], sheave.weight.size
    x = h * np.arange(m)
    length = -h / np.log(-sheave.off_diagonal[1] / sheave.diagonal[0])
    apart = np.abs(x[:, None] - x)
    bending = np.exp(-apart / length) / (2.0 * length * LOCAL)
    elastic = sheave.disc_compliance * bending + sheave.tilt_compliance * np.cos(apart / RADIUS)
    weight = np.r_[0.5 * h, np.full(m - 2, h), 0.5 * h]
    expected = np.eye(m) / ELEMENTS + sheave.compliance * elastic * weight
    dense = flexibility(sheave)
    assert dense == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())
    symmetric = dense / sheave.weight
    assert symmetric == pytest.approx(symmetric.T, abs=1e-12 * np.abs(symmetric).max())
    # least eigenvalue: the elements' own, 1 / (c_e h); the sheaves only add to it
    assert np.linalg.eigvalsh(symmetric).min() >= 0.99 / (ELEMENTS * h)


@pytest.mark.parametrize("length", [0.004, 0.012, 0.03])
def test_parameters_reach_the_kernel(length):
    sheave = wrap(stations=9, length=length, tilt=np.inf, stiffness=2.0)
    h = sheave.weight[1]
    column = flexibility(sheave)[:, 4]
    expected = np.exp(-h * np.abs(np.arange(9) - 4) / length) / (2.0 * length * LOCAL) * h / 2.0
    expected[4] += 1.0 / ELEMENTS
    assert column == pytest.approx(expected, rel=1e-10)


@given(contacts())
@settings(max_examples=150)
def test_forces_against_lemke(tell, case):
    sheave, gap, closed = case
    dense = flexibility(sheave)
    force, solves, state = contact(sheave, gap, closed)
    assert solves > 0
    # Gaps times c_e are forces of up to 1e7 N/m. The solver lets stations be 1e-6 N/m wrong, the dense matrix
    # has a condition below 1e5: 1e7 times 1e5 eps is 1e-4.
    expected = solve_lcp(ELEMENTS * dense, ELEMENTS * gap)
    tell("contact force of a wrap by Lemke's algorithm [N/m]", force, expected)
    assert force == pytest.approx(expected, abs=1e-3)
    opening = gap + dense @ force
    # 0.01 N/m over c_e
    assert force.min() >= 0.0
    assert opening.min() >= -1e-12
    assert np.abs(force * opening).max() <= 1e-12 * max(force.max(), 1.0)
    assert not np.any(force[state.stations[:, compliance.CLOSED] == 0.0])


@given(contacts())
@settings(max_examples=50)
def test_a_second_call_needs_one_solve_and_changes_nothing(case):
    sheave, gap, closed = case
    force, _, state = contact(sheave, gap, closed)
    again = np.empty_like(force)
    assert solve_wrap(state, gap, again) == 1
    assert np.array_equal(again, force)
    # the history of sets leaves no trace in the forces beyond round-off
    state.stations[:, compliance.CLOSED], state.fresh[0] = 1.0 - state.stations[:, compliance.CLOSED], False
    assert solve_wrap(state, gap, again) > 0
    assert again == pytest.approx(force, abs=1e-5)


def test_single_flips_finish_where_block_flips_cycle():
    # rough gaps on sheaves far softer than any job's: some in a thousand cycle under block flips
    random = np.random.default_rng(0)
    solves = []
    for _ in range(1500):
        stations, arc, length = (
            int(random.integers(10, 60)),
            random.uniform(0.1, 0.22),
            random.uniform(0.02, 0.1),
        )
        sheave = wrap(stations, arc=arc, stiffness=0.1, tilt=0.01 * TILT, length=length)
        gap = 2e-5 * random.normal(size=sheave.weight.size)
        force, count, _ = contact(sheave, gap)
        solves.append(count)
        opening = gap + flexibility(sheave) @ force
        assert count > 0 and force.min() >= 0.0
        # 1e-6 N/m over c_e is 3e-17 m; the dense product of forces and soft sheaves loses more
        assert opening.min() >= -1e-12 and np.abs(opening[force > 0.0]).max(initial=0.0) <= 1e-12
    assert max(solves) > ROUNDS_OF_BLOCK_FLIPS


@given(contacts())
@settings(max_examples=30)
def test_rigid_sheaves_leave_the_elements_alone(case):
    _, gap, closed = case
    force, solves, _ = contact(wrap(gap.size, stiffness=np.inf), gap, closed)
    assert solves > 0
    assert force == pytest.approx(ELEMENTS * np.maximum(-gap, 0.0), rel=1e-13, abs=1e-6)


def test_overlapping_station_opens_behind_a_deep_one():
    # Bullinger et al. 2005, fig. 14: g~ < 0 is not sufficient for contact. Next to a deep dent, shallow
    # overlap opens.
    gap = np.full(15, 1e-5)
    gap[7], gap[8] = -1e-4, -1e-6
    force, _, state = contact(wrap(15, arc=0.03), gap)
    assert np.flatnonzero(force).tolist() == [7]
    assert state.stations[8, compliance.CLOSED] == 0.0


@given(contacts())
@settings(max_examples=30)
def test_a_stiff_disc_is_stiff_in_local_bending_alone(case):
    """Factors on disc and tilt are factors on their stiffnesses: two ways to one matrix, and to one solution."""
    _, gap, closed = case
    factored, _, _ = contact(wrap(gap.size, stiffness=2.0, tilt=3.0 * TILT, disc=1.5), gap, closed)
    expected, _, _ = contact(wrap(gap.size, tilt=6.0 * TILT, local=3.0 * LOCAL), gap, closed)
    assert factored == pytest.approx(expected, abs=1e-9 * expected.max())


def test_a_rigid_disc_tilts_as_a_body():
    # deep enough for all stations to be closed; with f = -c_e (G + U . t) the tilt solves a 2 x 2 system
    sheave, gap = wrap(60, tilt=100.0 * TILT, disc=np.inf), np.linspace(-3e-4, -2e-4, 60)
    force, _, _ = contact(sheave, gap)
    lever = ELEMENTS * sheave.tilt_compliance * sheave.weight * sheave.tilt
    tilt = np.linalg.solve(np.eye(2) + lever @ sheave.tilt.T, -lever @ gap)
    expected = -ELEMENTS * (gap + tilt @ sheave.tilt)
    assert expected.min() > 0.0
    assert force == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_gaps_that_are_no_numbers_fail(value):
    gap = np.full(8, -1e-5)
    gap[3] = value
    assert contact(wrap(8), gap)[1] == 0


def middle_pressure(stations, stiffness):
    """Line force in the middle of a long wrap under uniform overlap, no tilt [N/m]."""
    force, _, _ = contact(wrap(stations, stiffness=stiffness, tilt=np.inf), np.full(stations, -1e-5))
    return force[stations // 2]


@pytest.mark.parametrize("stiffness", [1.0, 1.5])
def test_uniform_pressure_far_from_the_ends(stiffness):
    # The kernel integrates to 1/k, so f (1/c_e + a/k) = overlap. 11 decay lengths to either end: exp(-11) =
    # 2e-5, less by the elements' share; the rest is the mesh's, (h/l)^2 / 12 of a/k.
    exact = 1e-5 / (1.0 / ELEMENTS + 1.0 / (stiffness * LOCAL))
    errors = [middle_pressure(stations, stiffness) / exact - 1.0 for stations in (61, 121, 241)]
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx([4.0, 4.0], abs=0.1)
    assert abs(errors[-1]) < 1e-3


@pytest.mark.parametrize("arc", [0.1, 0.27])
def test_flat_punch_carries_its_edges(arc):
    # Stiff elements pressed in uniformly: k l (1 - l^2 d2/dx2) inverts the kernel, so inside f = k g and each
    # end carries a line of k l g more. The sum of the mesh's forces tends to k g (L + 2 l) with the square of
    # h.
    exact = LOCAL * 1e-5 * (arc + 2.0 * LENGTH)
    errors = []
    for stations in (41, 81, 161):
        sheave = wrap(stations, arc=arc, tilt=np.inf, elements=1e17)
        force, _, _ = contact(sheave, np.full(stations, -1e-5))
        errors.append(sheave.weight @ force / exact - 1.0)
        # neighbour support: peaks at inlet and outlet
        assert force[0] == pytest.approx(force[-1], rel=1e-6) and force[0] > 2.0 * force[1]
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx([4.0, 4.0], abs=0.2)


def test_tilt_under_uniform_pressure():
    # A uniform line force f tilts the sheave by r f / c_tilt times the integral of r cos: the opening at the
    # middle of a wrap of angle b is 2 r^3 f sin(b/2) / c_tilt, at its ends cos(b/2) of that. No local
    # bending, trapezoidal sum.
    stations, arc = 201, 0.27
    sheave = wrap(stations, arc=arc, local=1e30)
    opening = flexibility(sheave) @ np.full(stations, 1e5) - 1e5 / ELEMENTS
    half = 0.5 * arc / RADIUS
    exact = 2.0 * RADIUS**3 * 1e5 * np.sin(half) / TILT
    # trapezoidal rule: (h/r)^2 / 12 = 3e-5
    assert opening[stations // 2] == pytest.approx(exact, rel=5e-5)
    assert opening[[0, -1]] == pytest.approx(np.cos(half) * exact, rel=5e-5)
