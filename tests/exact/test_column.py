"""The column of pressed elements: an energy's forces, bounded by the edges; a beam where faces rest on each other."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State
from cvt_hpc.models.elastic_belt.column import column_across, column_forces, rocking_column
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.rhs import strains
from support.equations import evaluate
from support.straight import LENGTH, MASS, moving_straight, straight_belt

EA, EI, OUTER, INNER = 4e7, 2.0, 1.2e-3, 0.4e-3
COLUMN = {"has_column": True, "column_stiffness": EI, "outer_edge": OUTER, "inner_edge": INNER}
RANDOM = np.random.default_rng(3)
# strains to 2 kN and turning well beyond rocking of either edge, both signs
STATES = list(zip(RANDOM.uniform(-5e-5, 2e-5, 400), RANDOM.uniform(-3.0, 3.0, 400), strict=True))


def forces(eps, kappa, outer=OUTER, inner=INNER, bending=EI):
    """Push force and moment."""
    strain, *_, moment = rocking_column(eps, kappa, EA, bending, outer, inner)
    return -EA * min(strain, 0.0), moment


def energy(eps, kappa):
    """U by its definition: the largest of -P eps - M kappa - P^2 / 2 EA - M^2 / 2 EI in the cone, on a grid of M / P."""
    found = 0.0
    for place in np.linspace(-INNER, OUTER, 4001):
        along, softness = -(eps + place * kappa), 1.0 / EA + place**2 / EI
        found = max(found, 0.5 * max(along, 0.0) ** 2 / softness)
    return found


def printed(eps, kappa):
    """P of Bullinger et al. 2005, eq. 41, with M of eq. 24."""
    push = max(-EA * eps, 0.0)
    return push, float(np.clip(-EI * kappa, -INNER * push, OUTER * push))


def cycle_work(law, eps=-3e-5, kappa=1.5, size=(1e-5, 1.0), parts=2000):
    """Work of a law around an ellipse of strain and curvature, per length [N]."""
    angle = 2.0 * np.pi * np.arange(parts + 1) / parts
    path = np.array([eps + size[0] * np.cos(angle), kappa + size[1] * np.sin(angle)])
    middle = 0.5 * (path[:, 1:] + path[:, :-1])
    along = np.array([law(*place) for place in middle.T]).T
    return -(along * np.diff(path)).sum()


def test_states_rest_rock_on_both_edges_and_part():
    kinds = set()
    for eps, kappa in STATES:
        push, moment = forces(eps, kappa)
        kinds.add(
            (push > 0.0, np.sign(round(moment - OUTER * push, 9)), np.sign(round(moment + INNER * push, 9)))
        )
    assert len(kinds) == 4


@pytest.mark.parametrize(("eps", "kappa"), STATES[:60])
def test_forces_are_slopes_of_the_energy(eps, kappa):
    push, moment = forces(eps, kappa)
    assert push >= 0.0 and -INNER * push - 1e-12 <= moment <= OUTER * push + 1e-12
    # by Legendre: U = -P eps - M kappa - P^2 / 2 EA - M^2 / 2 EI; the grid of M / P is 0.4 um wide
    reached = -push * eps - moment * kappa - 0.5 * push**2 / EA - 0.5 * moment**2 / EI
    assert reached == pytest.approx(energy(eps, kappa), rel=1e-5, abs=1e-9)


def test_slopes_are_those_of_the_forces_and_alike_across():
    for eps, kappa in STATES:
        _, give, turn, _ = rocking_column(eps, kappa, EA, EI, OUTER, INNER)
        up, down = (forces(eps + d, kappa) for d in (1e-10, -1e-10))
        left, right = (forces(eps, kappa + d) for d in (1e-6, -1e-6))
        if forces(eps, kappa)[0] > 1.0:
            # beside a corner, which two of the states may sit on, differences have both slopes
            assert up[0] - down[0] == pytest.approx(-EA * give * 2e-10, rel=1e-4)
            assert left[0] - right[0] == pytest.approx(-EA * turn * 2e-6, rel=1e-4, abs=1e-6)
        # Maxwell: dP/dkappa = dM/deps
        assert (left[0] - right[0]) / 2e-6 == pytest.approx((up[1] - down[1]) / 2e-10, rel=1e-4, abs=1e-1)


def test_a_cycle_does_no_work_but_by_the_printed_law():
    # the ellipse rests, and rocks on the inner edge; the sum by midpoints is exact to 1 / parts^2
    assert abs(cycle_work(forces)) < 1e-6
    # eq. 24 beside eq. 41: of 0.01 N per length to and fro it takes or gives a third in every cycle
    assert abs(cycle_work(printed)) > 3e-3


def test_limits():
    for eps, kappa in STATES:
        # k -> 0: today's belt
        assert forces(eps, kappa, 0.0, 0.0) == (max(-EA * eps, 0.0), 0.0)
        if eps < -1e-6:
            # wide faces: a beam
            assert forces(eps, kappa, 10.0, 10.0) == pytest.approx((-EA * eps, -EI * kappa))
            # stiff bodies rock at once, on their edge: M = k P
            push, moment = forces(eps, kappa, bending=1e9)
            assert moment == pytest.approx((OUTER if kappa < 0.0 else -INNER) * push)
    # without push there is no moment
    assert forces(1e-3, 1.0) == forces(1e-3, -0.5) == (0.0, 0.0)


def test_the_moment_is_that_of_eq_24_at_the_same_push():
    for eps, kappa in STATES:
        push, moment = forces(eps, kappa)
        assert moment == pytest.approx(np.clip(-EI * kappa, -INNER * push, OUTER * push), abs=1e-9)


def pressed_belt(cells=48, bending=0.5, **changes):
    """A straight belt whose elements bear a moment."""
    return straight_belt(cells, bending=bending)._replace(**COLUMN | changes)


def stiffness_of(belt, tension, push):
    """K of u' = K w about the straight belt, on functions odd about both ends of a strand: hinged."""
    n = belt.cell.size
    fields, scalars = moving_straight(belt, tension=tension, push=push)
    flat, found = flat_belt(belt), np.empty((n, n))
    for j in range(n):
        sides = []
        for size in (1e-9, -1e-9):
            moved = fields.copy()
            moved[f.W, j] = size
            evaluate(flat, State(moved, scalars))
            sides.append(flat.rate[f.U].copy())
        found[:, j] = (sides[0] - sides[1]) / 2e-9
    inside = np.arange(1, n // 2)
    return found[np.ix_(inside, inside)] - found[np.ix_(inside, n - inside)]


@pytest.mark.parametrize(("push", "borne"), [(3000.0, EI), (-100.0, 0.0)])
def test_frequencies_of_a_pressed_strand(push, borne):
    # hinged beam under T - P: w_n^2 = (n pi / L)^2 (T - P + (EI + EI_c) (n pi / L)^2) / m, EI_c of pressed elements alone
    belt, tension = pressed_belt(), 8000.0
    found = np.sqrt(np.sort(-np.linalg.eigvals(stiffness_of(belt, tension, push)).real)[:3])
    wave = np.arange(1, 4) * np.pi / LENGTH
    content = 1.0 / (1.0 - max(push, 0.0) / belt.element_stiffness)  # pressed, there are more of them
    exact = wave * np.sqrt((tension - max(push, 0.0) + (0.5 + borne * content) * wave**2) / MASS)
    # mesh: (3 pi / 48)^2 / 12 of the beam's part, twice that of the string's
    assert found == pytest.approx(exact, rel=4e-3)


def test_buckling_of_a_pressed_strand():
    # P - T = (EI + EI_c) (pi / L)^2: least eigenvalue of K + (P - T) times that of a string is zero
    belt = pressed_belt()
    critical = (0.5 + EI) * (np.pi / LENGTH) ** 2
    least = [
        -np.sort(np.linalg.eigvals(stiffness_of(belt, 3000.0, 3000.0 + share * critical)).real)[-1]
        for share in (0.98, 1.02)
    ]
    assert least[0] > 0.0 > least[1]


def test_a_cut_column_is_in_balance():
    # moments of the line forces ahead of a cut about it, of any shape: M at the cut; and at most k P
    belt = pressed_belt()
    n, (fields, _) = belt.cell.size, moving_straight(belt, push=2000.0)
    place = np.arange(n) * belt.cell[0]
    fields[f.W] = (
        2e-4 * np.sin(6.0 * np.pi * place / (2.0 * LENGTH)) * (place > LENGTH / 2) * (place < 1.5 * LENGTH)
    )
    eps, pressed, moment = np.empty((2, n)), np.empty(n), np.empty(n)
    strains(belt, fields, eps)
    column_forces(belt, fields, eps[0], pressed, moment)
    across = np.array([column_across(belt, moment, j) for j in range(n)]) * belt.dual
    push = -EA * pressed
    beside = np.maximum(push, np.roll(push, 1))
    # both edges bear; a half of a cell may have up to twice the mean push of both
    assert np.all(moment <= 2.0 * OUTER * beside) and np.all(moment >= -2.0 * INNER * beside)
    assert np.sum(moment > 0.5 * OUTER * beside) > 5 and np.sum(moment < -0.5 * INNER * beside) > 5
    for cut in range(n // 4, 3 * n // 4):
        ahead = np.arange(cut + 1, n)
        assert across[ahead] @ (place[ahead] - place[cut]) == pytest.approx(-moment[cut], abs=1e-9)
    assert across.sum() == pytest.approx(0.0, abs=1e-9)


def stored(belt, fields):
    """Energy [J] of a straight belt at rest, tension and push of its cells, and half the squared rise over them."""
    eps, n = np.empty((2, belt.cell.size)), belt.cell.size
    strains(belt, fields, eps)
    bent = np.array([belt.bending[j] @ fields[f.W][(j + np.arange(-2, 3)) % n] for j in range(n)])
    rise = np.roll(fields[f.W], -1) - fields[f.W]
    turned = -(rise - np.roll(rise, 1)) / (belt.cell * belt.dual)
    total = 0.5 * belt.dual @ (belt.mass * fields[f.U] ** 2 - fields[f.W] * bent)
    total += (
        0.5
        * belt.dual
        @ (belt.element_mass * fields[f.V_ELEMENT] ** 2 + belt.ring_mass * fields[f.V_RING] ** 2)
    )
    total += 0.5 * belt.cell @ (fields[f.N_RING] * belt.ring_stiffness * eps[1] ** 2)
    net, rocked = belt.ring_stiffness * eps[1], 0
    for c in range(n):
        for kappa in (turned[c], turned[(c + 1) % n]):
            push, moment = forces(eps[0, c], kappa)
            net[c] -= 0.5 * push
            rocked += push > 0.0 and abs(moment + EI * kappa) > 1e-3 * abs(moment)
            along = push**2 / EA + moment**2 / EI
            total += 0.25 * belt.cell[c] * fields[f.N_ELEMENT, c] * along
    return total, net, 0.5 * rise**2 / belt.cell, rocked


def test_energy_is_kept_while_elements_rock():
    # A belt at rest, let go from a bow in which elements rock on both edges; classical Runge-Kutta. The linear stretch
    # leaves out what net forces that change do against slopes squared: it is followed and counted apart.
    belt = pressed_belt(12, element_damping=0.0, element_mass=16.0)  # waves of 1.6 km/s, for longer steps
    n, state, flat = belt.cell.size, moving_straight(belt, push=150.0), flat_belt(belt)
    fields, place = state.fields, np.arange(belt.cell.size) * belt.cell[0]
    fields[f.W] = 1e-4 * np.sin(2.0 * np.pi * place / LENGTH)
    step = 5e-7

    def rates(moved):
        evaluate(flat, State(moved, state.scalars))
        rate = flat.rate.copy()
        rate[f.W] = moved[f.U]
        return rate

    total, net, half_squared, most = stored(belt, fields)
    first, left = total + net @ half_squared, []
    for k in range(600):
        one = rates(fields)
        two = rates(fields + 0.5 * step * one)
        three = rates(fields + 0.5 * step * two)
        fields += step / 6.0 * (one + 2.0 * two + 2.0 * three + rates(fields + step * three))
        if k % 2:
            total, after, squared, rocked = stored(belt, fields)
            first += 0.5 * (after - net) @ (squared + half_squared)
            net, half_squared, most = after, squared, max(most, rocked)
            left.append(total + net @ half_squared - first)
    # 2e-5 of what moves by then is seen, which rises from nothing
    assert np.abs(left).max() < 1e-4 * 0.5 * belt.mass * belt.dual @ fields[f.U] ** 2
    assert most > n and np.ptp(net) > 50.0
