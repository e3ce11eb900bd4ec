"""Ring layers: exact cases of their mechanics, the fast step against the plain form, and what a job may ask."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import State, belt_constants, initial_state
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.one_system import pack as pack_one
from cvt_hpc.models.elastic_belt.one_system import rates as rates_of_one
from cvt_hpc.models.elastic_belt.record import judge
from cvt_hpc.models.elastic_belt.rings import (
    FIRST_LAYER,
    flat_rings,
    layer_rates,
    pack,
    rates,
    ring_constants,
    surface_friction,
    unite_layers,
    with_layers,
)
from cvt_hpc.physics.layers import stack_forces
from support.lone import Transient
from support.marched import job

SCENE = {"stations": 48, "duration": 0.04, "rise_time": 0.01, "load": 60.0}
UNLIKE = {
    "ring_layers": 3,
    "layer_friction": 0.05,
    "ring_static_factor": 1.5,
    "layer_tolerance": (1.0, 1.0001, 0.9999),
}
# the outer layer is too long for its place: it bears on the ears
LONG = {"ring_layers": 3, "layer_tolerance": (1.0, 1.0, 1.002)}
# one neutral line for all, and a grip that the saddle's friction cannot break
STUCK = {"ring_layers": 3, "layer_thickness": 0.0, "layer_friction": 0.3}


def layered(**values):
    """Constants and a state at the start of a belt with layers."""
    p = job(**SCENE | values).parameters
    belt = belt_constants(p)
    rings = ring_constants(p, belt)
    return belt, rings, with_layers(initial_state(p, belt), belt, rings)


def strains(belt, rings, state):
    eps = np.empty((rings.length.size, belt.cell.size))
    unite_layers(belt, rings, state, eps)
    return eps


def strain(belt, rings, state, eps):
    """Give the layers of a state strains."""
    n, w = rings.length.size, state.fields[f.W]
    turned = 1.0 + belt.curvature * rings.offset[:, None]
    stretched = turned + belt.curvature * 0.5 * (w + np.roll(w, -1))
    state.fields[FIRST_LAYER + n :] = stretched / (1.0 + eps) - turned
    return strains(belt, rings, state)


def pressed(inward):
    normal = np.empty(len(inward) + 1)
    stack_forces(np.array(inward), normal)
    return normal


def test_normal_forces_fall_from_the_saddle_outward():
    assert pressed([3.0, 2.0, 1.0]) == pytest.approx([6.0, 3.0, 1.0, 0.0], abs=0.0)


@pytest.mark.parametrize(
    ("inward", "expected"),
    [
        ([2.0, 1.0, -0.5], [3.0, 1.0, 0.0, 0.5]),  # the outer layer alone bears on the ears
        ([-1.0, 2.0], [1.0, 2.0, 0.0]),  # a slack layer is held by the one above it
        ([-1.0, -2.0], [0.0, 1.0, 3.0]),  # all fly outward
        ([0.0, 0.0], [0.0, 0.0, 0.0]),
    ],
)
def test_a_stack_bears_on_the_saddle_or_on_the_ears(inward, expected):
    normal = pressed(inward)
    assert normal == pytest.approx(expected, abs=0.0)
    assert -np.diff(normal) == pytest.approx(inward, abs=1e-15)


def test_layers_that_turn_about_a_pulley_with_the_elements_do_not_slide():
    belt, rings, state = layered(ring_layers=4)
    n, normal, sliding = 4, np.empty(5), np.empty(5)
    eps = strains(belt, rings, state)
    for j in (3, int(np.flatnonzero(belt.curvature * belt.on_driven)[3])):
        turning = 1.0 + rings.offset * belt.arc_curvature[j]
        state.fields[FIRST_LAYER : FIRST_LAYER + n, j] = state.fields[f.V_ELEMENT, j] * turning
        surface_friction(belt, rings, state, eps, 1.0, j, normal, sliding)
        assert np.abs(sliding).max() < 1e-14 * belt.belt_speed
        # where all have one speed the outer one falls back by what its radius is larger
        state.fields[FIRST_LAYER : FIRST_LAYER + n, j] = state.fields[f.V_ELEMENT, j]
        surface_friction(belt, rings, state, eps, 1.0, j, normal, sliding)
        kappa, speed = belt.arc_curvature[j], state.fields[f.V_ELEMENT, j]
        # one thickness below the middle of the stack
        surface = speed * (1.0 + (belt.ring_offset - 0.185e-3) * kappa)
        assert sliding[1] == pytest.approx(surface * 0.185e-3 * kappa / turning[:2].prod(), rel=1e-12)


def test_the_capstan_holds_in_each_layer():
    """T ~ exp(mu phi) in all layers that slide on the ones below, with one mu at the saddle and between them."""
    belt, rings, state = layered(
        ring_layers=3,
        layer_thickness=0.0,
        ring_offset=0.0,
        stations=160,
        end_refinement=1.0,
        driving_speed=1.0,
    )
    n, cells, mu = 3, belt.cell.size, 0.08
    arc = int(np.count_nonzero(belt.curvature * (belt.on_driven == 0.0)))
    angle = (np.cumsum(belt.cell) - 0.5 * belt.cell) * belt.curvature[0]
    share = np.array([0.5, 0.3, 0.2])[:, None]
    tension = 5e3 * share * np.exp(mu * np.minimum(angle, np.pi))
    eps = strain(belt, rings, state, tension / rings.stiffness)
    speed = belt.belt_speed
    # each layer is faster than what lies below it by 20 times the speed of regularisation
    state.fields[FIRST_LAYER : FIRST_LAYER + n] = speed + 0.2 * np.arange(1.0, n + 1.0)[:, None]
    state.fields[f.V_ELEMENT] = speed
    rate = np.empty((2 * n + 1, cells))
    layer_rates(belt, rings, state, eps, 1.0, rate)
    inner = slice(2, arc - 2)
    at_station = 0.5 * (tension + np.roll(tension, 1, axis=1))[:, inner]
    size = mu * at_station * belt.curvature[0] / rings.mass
    # differences of neighbouring cells, (mu kappa h)^2 / 24 = 4e-6, and the belt's own weight, 0.1 N of 5 kN
    assert np.abs(rate[:n, inner] / size).max() < 2e-4
    # the saddles are dragged along by the friction of all layers
    expected = mu * at_station.sum(axis=0) * belt.curvature[0] / belt.element_mass
    assert rate[2 * n, inner] == pytest.approx(expected, rel=2e-4)


def test_rings_that_spin_free_press_on_nothing_and_faster_ones_on_the_ears():
    belt, rings, state = layered(ring_layers=3, layer_thickness=0.0, ring_offset=0.0)
    normal, sliding, j = np.empty(4), np.empty(4), 3
    eps = strain(belt, rings, state, np.full((3, belt.cell.size), rings.relief / rings.stiffness))
    surface_friction(belt, rings, state, eps, 1.0, j, normal, sliding)
    assert np.abs(normal).max() < 1e-9 * rings.relief * belt.arc_curvature[j]
    # (1.1^2 - 1) m v^2 kappa of all three, toward the ears
    surface_friction(belt, rings, state, eps, 1.1, j, normal, sliding)
    flung = 0.21 * rings.relief * belt.arc_curvature[j]
    assert normal == pytest.approx(flung * np.arange(4.0), rel=1e-6, abs=1e-9 * flung)
    # layers that run ahead of the elements pull them along at the ears
    state.fields[FIRST_LAYER : FIRST_LAYER + 3] = state.fields[f.V_ELEMENT] + 0.2
    rate = np.empty((7, belt.cell.size))
    layer_rates(belt, rings, state, eps, 1.1, rate)
    assert rate[6, j] == pytest.approx(0.08 * 3.0 * flung / belt.element_mass, rel=1e-3)


# with the weight of 40 times the speed all layers fly outward
@pytest.mark.parametrize(("share", "bare"), [(1.0, 3), (40.0, 0)])
def test_friction_takes_what_its_surfaces_lose(share, bare, tell):
    """Its power on layers and elements is -mu N |sliding| of all surfaces, whatever their speeds."""
    belt, rings, state = layered(**UNLIKE)
    n, cells = 3, belt.cell.size
    random = np.random.default_rng(2)
    state.fields[FIRST_LAYER : FIRST_LAYER + n] += 0.05 * random.normal(size=(n, cells))
    eps = strains(belt, rings, state)
    rate, smooth = np.empty((2, 2 * n + 1, cells))
    layer_rates(belt, rings, state, eps, share, rate)
    layer_rates(belt, rings._replace(kinetic=np.zeros(n + 1)), state, eps, share, smooth)
    bent = belt.cell * belt.curvature
    turn = 0.5 * (bent + np.roll(bent, 1)) / belt.dual
    inertia = np.vstack([rings.mass * (1.0 + rings.offset[:, None] * turn), [[belt.element_mass] * cells]])
    speeds = np.vstack([state.fields[FIRST_LAYER : FIRST_LAYER + n], state.fields[f.V_ELEMENT]])
    power = (inertia * (rate - smooth)[[0, 1, 2, 2 * n]] * speeds).sum(axis=0)
    kinetic, normal, sliding = np.array([0.08, 0.05, 0.05, 0.08]), np.empty(n + 1), np.empty(n + 1)
    on_arcs = np.flatnonzero(belt.arc_curvature)
    assert on_arcs.size > cells / 2
    for j in on_arcs:
        surface_friction(belt, rings, state, eps, share, j, normal, sliding)
        assert normal[bare] == 0.0 and np.delete(normal, bare).min() > 0.0
        size = np.abs(sliding)
        mu = (
            kinetic
            * (1.0 + 0.5 * np.exp(-size / rings.stribeck_speed))
            * np.tanh(size / rings.friction_speed)
        )
        tell("power of friction of layers by Stribeck curves [W/m]", power[j], -(mu * normal * size).sum())
        # forces at 10 m/s cancel to those at some cm/s
        assert power[j] == pytest.approx(-(mu * normal * size).sum(), rel=1e-9)


def test_tolerances_are_differences_of_tension():
    belt, rings, state = layered(**UNLIKE)
    mean = strains(belt, rings, state) @ belt.cell / belt.cell.sum()
    expected = rings.stiffness * (UNLIKE["layer_tolerance"][0] / np.array(UNLIKE["layer_tolerance"]) - 1.0)
    assert rings.stiffness * (mean - mean[0]) == pytest.approx(expected, rel=2e-3, abs=0.3)


@pytest.mark.parametrize("count", [1, 3])
def test_layers_that_move_as_one_are_the_rings_as_one(count):
    belt, rings, state = layered(ring_layers=count, layer_thickness=0.0)
    random = np.random.default_rng(1)
    n, cells = count, belt.cell.size
    state.fields[f.U] += 0.02 * random.normal(size=cells)
    state.fields[f.V_ELEMENT] += 0.05 * random.normal(size=cells)
    state.fields[FIRST_LAYER : FIRST_LAYER + n] += 0.05 * random.normal(size=cells)
    state.fields[FIRST_LAYER + n :] *= 1.0 + 1e-4 * random.normal(size=cells)
    strains(belt, rings, state)
    flat, one = flat_rings(belt, rings), flat_belt(belt)
    y = pack(flat, state)
    found = np.empty_like(y)
    assert rates(flat, 1.0, y, found)
    y_one = pack_one(one, State(state.fields[:FIRST_LAYER].copy(), state.scalars))
    expected = np.empty_like(y_one)
    assert rates_of_one(one, 1.0, y_one, expected)
    rows = {
        name: slice(k * cells, (k + 1) * cells) for k, name in enumerate(("w", "u", "v0", "v1", "n0", "n1"))
    }
    for name in ("w", "u", "v0", "n0"):
        size = np.abs(expected[rows[name]]).max()
        assert np.abs(found[rows[name]] - expected[rows[name]]).max() < 1e-11 * size, name
    layers = found[y_one.size :].reshape(2, n, cells)
    for name, rate in (("v1", layers[0].mean(axis=0)), ("n1", layers[1].mean(axis=0))):
        size = np.abs(expected[rows[name]]).max()
        assert np.abs(rate - expected[rows[name]]).max() < 1e-9 * size, name


@cache
def marched(**values):
    """A run that is done, of layers with its stations in linked parts."""
    parts = {"lanes": "stations"} if "ring_layers" in values else {}
    run = Transient(job(**SCENE | parts | values).point(0), "imex")
    while run.done < run.samples:
        assert run.advance(run.samples) is None
    return run


def stepped(step, on_ears):
    """A belt that is sliding all over, with its constants and state before and after one step."""
    run = marched(**UNLIKE)
    still = Transient(run.parameters, "imex")
    belt = belt_constants(run.parameters)
    rings = ring_constants(run.parameters, belt)
    begun = run.state
    if on_ears:
        # pressed together along the belt, all bear on the ears, by as much as they do on the saddle
        strain(belt, rings, begun, -strains(belt, rings, begun))
    still.batch.take_over([SimpleNamespace(state=begun, rows=run.rows[:0], done=0, time=run.time)])
    still.batch.step, still.batch.steps_per_sample = step, 1
    still.batch.advance(1)
    return belt, rings, run.time, begun, still


@pytest.mark.parametrize("on_ears", [False, True])
def test_the_fast_step_is_the_plain_form_in_the_limit_of_short_steps(on_ears):
    """Increments of a step of 0.02 ns over its length are the rates, for layers that slide, stick and differ."""
    step = 2e-11
    belt, rings, time, begun, still = stepped(step, on_ears)
    flat = flat_rings(belt, rings)
    y = pack(flat, begun)
    expected = np.empty_like(y)
    assert rates(flat, time, y, expected)
    cells, n = belt.cell.size, 3
    change = (still.state.fields - begun.fields) / step
    found = expected[-2 * n * cells :].reshape(2 * n, cells)
    for k in range(2 * n):
        # contents take the speeds at the end of the step; friction changes at 4e7/s
        assert np.abs(change[FIRST_LAYER + k] - found[k]).max() < 0.01 * np.abs(found[k]).max(), k
    elements = expected[2 * cells : 3 * cells]
    assert np.abs(change[f.V_ELEMENT] - elements).max() < 0.01 * np.abs(elements).max()


@pytest.mark.parametrize("on_ears", [False, True])
def test_layers_move_by_their_mean_from_which_they_were_eliminated(on_ears, tell):
    *_, begun, still = stepped(4.6e-6, on_ears)
    layers = slice(FIRST_LAYER, FIRST_LAYER + 3)
    change = (still.state.fields - begun.fields)[layers].mean(axis=0)
    expected = still.batch.work.stations.data[:, lf.DV_1, 0]
    tell("change of the mean speed of the layers by linear momentum [m/s]", change, expected)
    # of speeds of 10 m/s, rounded
    assert np.abs(change - expected).max() < 1e-14 * 10.0 + 1e-12 * np.abs(expected).max()


def test_layers_that_do_not_rub_move_as_the_rings_as_one_step_by_step():
    """Whatever inertia is added to what layers move against their mean; 2 ms, before friction feeds on rounding."""
    free = SCENE | {"ring_friction": 0.0}
    apart = {"ring_layers": 3, "layer_thickness": 0.0, "layer_friction": 0.0, "lanes": "stations"}
    layers, one = (Transient(job(**free | own).point(0), "imex") for own in (apart, {}))
    while layers.done < 40:
        layers.advance(40 - layers.done)
        one.advance(40 - one.done)
    found, expected = layers.state.fields, one.state.fields
    for row in range(FIRST_LAYER):
        size = np.ptp(expected[row])
        assert found[row] == pytest.approx(expected[row], rel=1e-10, abs=1e-10 * size), row


def test_the_content_of_each_layer_stays(tell):
    run = marched(**UNLIKE)
    belt = belt_constants(run.parameters)
    rings = ring_constants(run.parameters, belt)
    n = rings.length.size
    content = run.state.fields[FIRST_LAYER + n :] + 1.0 + belt.curvature * rings.offset[:, None]
    tell("content of each layer of the rings after a run [m]", content @ belt.cell, rings.length)
    assert content @ belt.cell == pytest.approx(rings.length, rel=1e-12)


@pytest.mark.parametrize("values", [UNLIKE, LONG, STUCK], ids=["unlike", "long", "stuck"])
def test_the_power_balance_closes_with_the_loss_of_each_surface(values):
    run = marched(**values)
    found = judge(run)
    # what 48 stations leave open with the rings as one
    assert abs(found["power_residual"]) < 5e-4
    losses = found["surface_loss"]
    assert (losses[3] > 1.0) == (values is LONG)
    assert losses[0] > 0.0 and np.nanmin(losses) > -1e-9 and np.isnan(losses[4:]).all()
    assert np.nansum(losses) == pytest.approx(found["ring_loss"], rel=1e-9)
    tensions = [run.channel(f"ring_tension {strand}")[run.judged].mean() for strand in ("t1", "t2")]
    assert np.nansum(found["layer_tension"], axis=0) == pytest.approx(tensions, rel=1e-6)


def test_layers_that_hold_to_each_other_are_the_rings_as_one():
    stuck, one = (judge(marched(**values)) for values in (STUCK, {}))
    for name in ("ring_loss", "loss", "mean_ring_tension", "mean_push_force", "axial_force", "efficiency"):
        # they creep on each other by 1 mm/s where they hold: 0.3 % of the rings' loss
        assert stuck[name] == pytest.approx(one[name], rel=5e-3, abs=5.0), name


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"ring_layers": 0}, "ring_layers: expected .*1"),
        ({"ring_layers": 13}, "ring_layers: expected .*12"),
        ({"ring_layers": 3, "layer_tolerance": (1.0,)}, "layer_tolerance: expected one for each of 3 ring_layers"),
        ({"ring_layers": 2, "layer_tolerance": (1.0, -1.0)}, "layer_tolerance"),
        ({"ring_layers": 2, "layer_friction": -0.1}, "layer_friction"),
        ({"ring_layers": 2, "layer_thickness": -1e-4}, "layer_thickness"),
        ({"ring_layers": 9, "layer_thickness": 0.02}, "layer_thickness: expected rings within .* radius"),
        ({"ring_offset": -0.2}, "ring_offset: expected rings within .* radius"),
        ({"ring_layers": 2, "curvature_terms": "path"}, 'curvature_terms: expected "none" with ring_layers above 1'),
        ({"ring_layers": 2, "column_bending": "rocking"}, 'column_bending: expected "off" with ring_layers above 1'),
        ({"ring_layers": 2, "stepper": "explicit"}, "ring_layers: expected 1 with the explicit step"),
    ],
)  # fmt: skip
def test_what_does_not_fit_gets_one_line(values, told):
    with pytest.raises(InputError, match=told):
        job(values.pop("stepper", "imex"), **SCENE, **values)
