"""Dampers of the belt's layers act on the rate at which the material lengthens, and take its power."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State, belt_constants
from cvt_hpc.models.elastic_belt.general_run import damper_power
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.rhs import lengthening
from support.equations import evaluate
from support.settled import DEFAULTS

EVEN = {"end_refinement": 1.0}


def belt_of(stations, **values):
    return belt_constants(DEFAULTS | EVEN | {"stations": stations} | values)


def pressed_state(belt, seed=0):
    """Smooth motion around the belt, its elements pressed by 1 to 3 kN, and out of contact with the grooves."""
    random, n = np.random.default_rng(seed), belt.cell.size
    angle = 2.0 * np.pi * np.insert(np.cumsum(belt.cell[:-1]), 0, 0.0) / belt.cell.sum()
    middle = angle + np.pi * belt.cell / belt.cell.sum()

    def wave(at, size):
        return size * sum(
            random.normal() * np.cos(k * at + random.uniform(0.0, 2.0 * np.pi)) for k in (1, 2, 3)
        )

    state = State(np.zeros((7, n)), np.zeros(f.SCALARS))
    state.scalars[f.TIME] = 1.0
    state.fields[f.W], state.fields[f.U] = wave(angle, 1e-5), wave(angle, 0.1)
    state.fields[f.V_ELEMENT] = belt.belt_speed + wave(angle, 0.02)
    state.fields[f.V_RING] = belt.belt_speed + wave(angle, 0.02)
    bent = belt.curvature * 0.5 * (state.fields[f.W] + np.roll(state.fields[f.W], -1))
    pushed = np.clip(2e3 + wave(middle, 300.0), 1e3, 3e3)
    state.fields[f.N_ELEMENT] = (1.0 + bent) / (1.0 - pushed / belt.element_stiffness)
    state.fields[f.N_RING] = (1.0 + bent + belt.curvature * belt.ring_offset) / 1.001
    return state


def rates_of(belt, state):
    """Rates (7, N) without flank forces, and the strains (2, N)."""
    flat = flat_belt(belt._replace(touches=np.zeros(belt.cell.size)))
    evaluate(flat, state)
    return flat.rate, flat.eps


def of_dampers(state, stations, dampers, **values):
    """The belt, and accelerations that dampers (elements', rings') add to those of the belt without any."""
    ones = [
        belt_of(stations, element_damping=one, ring_damping=other, **values)
        for one, other in ((0.0, 0.0), dampers)
    ]
    without, found = (rates_of(belt, state)[0] for belt in ones)
    return ones[1], found - without


def test_it_is_the_rate_of_the_strain_of_flowing_material():
    """D ln(1 + eps) / Dt (1 + kappa w) = v_s + kappa w_t, by the equations of stretch and content: first order."""
    worst = []
    for stations in (200, 400, 800):
        belt = belt_of(stations)
        state = pressed_state(belt)
        u = state.fields[f.U]
        rate, eps = rates_of(belt, state)
        v = state.fields[f.V_ELEMENT]
        bent = belt.curvature * 0.5 * (state.fields[f.W] + np.roll(state.fields[f.W], -1))
        here = (belt.curvature * 0.5 * (u + np.roll(u, -1))) / (1.0 + bent)
        here -= rate[f.N_ELEMENT] / state.fields[f.N_ELEMENT]
        flow = v / (1.0 + bent)
        carried = flow * (eps[0] - np.roll(eps[0], 1)) / (0.5 * (belt.cell + np.roll(belt.cell, 1)))
        found = (here + carried / (1.0 + eps[0])) * (1.0 + bent)
        expected = np.array([lengthening(belt, v, u, c) for c in range(stations)])
        # within the regions: where they join, w and kappa jump from cell to cell
        smooth = belt.curvature == np.roll(belt.curvature, 1)
        worst.append(np.abs(found - expected)[smooth].max() / np.abs(expected).max())
    assert worst[2] < 0.01
    assert worst[0] / worst[1] == pytest.approx(2.0, abs=0.5)
    assert worst[1] / worst[2] == pytest.approx(2.0, abs=0.5)


def test_elements_that_spread_as_they_move_outwards_are_not_braked():
    stations = 120
    belt = belt_of(stations)
    state = pressed_state(belt)
    state.fields[f.U] = 0.1 * (belt.arc_curvature > 0.0)
    for row in (f.V_ELEMENT, f.V_RING):
        v = state.fields[row]
        for c in range(stations - 1):
            v[c + 1] -= lengthening(belt, v, state.fields[f.U], c) * belt.cell[c]
    strained = np.abs(
        [lengthening(belt, state.fields[f.V_ELEMENT], state.fields[f.U], c) for c in range(stations - 1)]
    )
    assert strained.max() < 1e-9
    _, added = of_dampers(state, stations, (2000.0, 400.0))
    inner = slice(2, stations - 2)  # but where the closed belt cannot spread
    scale = 2000.0 * 0.1 * belt.curvature.max() ** 2 / belt.mass
    assert np.abs(added[f.U, inner]).max() < 1e-9 * scale
    assert np.abs(added[f.V_ELEMENT, inner]).max() < 1e-9 * scale


SCENES = {
    "low": {},
    "medium, graded mesh": {"ratio": 1.0, "driven_radius": 0.053, "end_refinement": 4.0},
    "overdrive": {"ratio": 0.5, "driven_radius": 0.035},
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("dampers", [(20.0, 0.0), (0.0, 4.0), (60.0, 30.0)])
def test_forces_take_what_the_dampers_lose(dampers, scene):
    stations = 120
    state = pressed_state(belt_of(stations, **SCENES[scene]), list(SCENES).index(scene))
    belt, added = of_dampers(state, stations, dampers, **SCENES[scene])
    u, v0, v1 = (state.fields[row] for row in (f.U, f.V_ELEMENT, f.V_RING))
    taken = -(belt.dual * (belt.mass * added[f.U] * u + belt.element_mass * added[f.V_ELEMENT] * v0)).sum()
    taken -= (belt.dual * belt.ring_mass * added[f.V_RING] * v1).sum()
    lost = sum(
        damper * belt.cell[c] * lengthening(belt, v, u, c) ** 2
        for damper, v in zip(dampers, (v0, v1), strict=True)
        for c in range(stations)
    )
    assert taken == pytest.approx(lost, rel=1e-6)
    assert damper_power(belt, state) == pytest.approx(lost, rel=1e-9)


def test_a_damper_never_makes_elements_pull():
    stations = 120
    belt = belt_of(stations)
    state = pressed_state(belt)
    state.fields[f.U] = 5e3  # outwards so fast that 20 N s would outweigh the push
    _, added = of_dampers(state, stations, (20.0, 0.0))
    _, more = of_dampers(state, stations, (2e3, 0.0))
    on_arcs = (belt.arc_curvature > 0.0) & (np.roll(belt.arc_curvature, 1) > 0.0)
    assert np.abs(added[f.U, on_arcs]).min() > 0.0
    assert added[f.U, on_arcs] == pytest.approx(more[f.U, on_arcs], rel=1e-9)
