"""Elements that tilt on their rings: exact motions, and the limit of elements that do not."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state
from cvt_hpc.models.elastic_belt.column import tilt_rate, tilted_sliding
from support.fast_runs import march, march_fast
from support.lone import Transient
from support.marched import job, record

SPRING, DAMPER, LEVER = 3267.0, 0.03267, 1e-3
SCENE = {"stations": 48, "duration": 0.06, "rise_time": 0.01, "load": 110.0}
TILT = {"tilt_spring": SPRING, "tilt_damper": DAMPER, "ring_offset": LEVER}
WIDTH = 0.01  # [m/s]: v_reg


@pytest.mark.parametrize("grip", [0.0, 1.0, 1e3, 3e4, 1e6])
def test_the_saddle_slides_in_balance(grip):
    random = np.random.default_rng(3)
    for free, held, damping in zip(
        random.normal(size=200) * 10.0 ** random.uniform(-6.0, 1.0, 200),
        random.normal(size=200) * 10.0 ** random.uniform(-3.0, 5.0, 200),
        10.0 ** random.uniform(3.0, 5.0, 200),
        strict=True,
    ):
        z = tilted_sliding(free, held, grip, damping, 1.0 / WIDTH)
        parts = damping * z, -damping * free, held, grip * np.tanh(z / WIDTH)
        # round-off, of 1 in the hyperbolic tangent
        assert abs(sum(parts)) < 1e-13 * sum(map(abs, parts)) + 1e-15 * grip


def belt_and_state(**values):
    parameters = job(**SCENE | TILT | values).parameters
    belt = belt_constants(parameters)
    return belt, initial_state(parameters, belt)


def test_a_constant_force_tilts_by_its_moment_within_the_dampers_time():
    belt, state = belt_and_state()
    drag, rest = 2e4, -LEVER * 2e4 / SPRING  # the saddle is dragged back: the outer end lags
    for share in (0.0, 0.3, 1.0, 2.0):
        # of 1 - exp(-k_a t / d_a)
        state.fields[f.ELEMENT_TILT] = share * rest
        expected = SPRING / DAMPER * (1.0 - share) * rest
        assert tilt_rate(belt, state, 5, drag) == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_tilt_is_carried_with_the_elements():
    belt, state = belt_and_state()
    position = np.cumsum(belt.cell) - belt.cell
    state.fields[f.ELEMENT_TILT] = 0.2 * position
    tilt = state.fields[f.ELEMENT_TILT, 7]
    expected = -SPRING / DAMPER * tilt - 0.2 * state.fields[f.V_ELEMENT, 7]
    assert tilt_rate(belt, state, 7, 0.0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("stepper", ["imex", "explicit"])
def test_on_a_strand_it_fades_as_elements_move_on(stepper):
    belt, state = belt_and_state()
    state.fields[f.ELEMENT_TILT] = 5e-3
    step, steps = 5e-8, 400
    found = march(stepper, belt, state, step, steps).fields[f.ELEMENT_TILT]
    away = belt.touches == 0.0
    away &= np.roll(away, 1) & np.roll(away, 2)
    # backward or forward Euler: within half a step over the time of the damper
    assert found[away] == pytest.approx(5e-3 * np.exp(-SPRING / DAMPER * step * steps), rel=6e-3)


@pytest.mark.parametrize("frequency", [50.0, 500.0, 5e3])
@pytest.mark.parametrize("damper", [1e-6, DAMPER, 0.3])
def test_its_compliance_is_in_series_with_creep(frequency, damper):
    grip, turn = 6e3, 2j * np.pi * frequency
    slope, damping = grip / WIDTH, damper / LEVER**2
    small = 1e-4 * WIDTH  # where friction is linear to 1e-8

    def slides(free, held):
        return tilted_sliding(free, held, grip, damping, 1.0 / WIDTH)

    by_free = slides(small, 0.0) / small
    by_held = slides(0.0, damping * small) / (damping * small)
    # theta' = (z - free) / d with z = by_free free + by_held k_a theta / d, of free = 1
    tilt = (by_free - 1.0) / LEVER / (turn - by_held * SPRING / LEVER**2)
    force = slope * (by_free + by_held * SPRING / LEVER * tilt)
    expected = slope / (1.0 + turn * slope * LEVER**2 / (SPRING + turn * damper))
    assert force == pytest.approx(expected, rel=1e-7)
    assert force.real > 0.0  # it takes power


def test_elements_on_a_stiff_spring_are_those_that_do_not_tilt():
    belt, state = belt_and_state(tilt_spring=SPRING * 1e9)
    plain = belt_constants(job(**SCENE | TILT | {"tilt_spring": np.inf}).parameters)
    without = march_fast(plain, state._replace(fields=state.fields[: f.ELEMENT_TILT]), 4e-6, 500)
    found = march_fast(belt, state, 4e-6, 500)
    for row in range(f.ELEMENT_TILT):
        moved = np.abs(without.fields[row] - state.fields[row]).max()
        assert np.abs(found.fields[row] - without.fields[row]).max() < 1e-5 * moved, row
    assert np.abs(found.fields[f.ELEMENT_TILT]).max() < 1e-10


def test_a_step_goes_to_the_explicit_one():
    belt, start = belt_and_state()
    before = march_fast(belt, start, 4e-6, 5000)
    before.fields[f.V_RING] += 0.02 * np.random.default_rng(7).normal(size=belt.cell.size)
    exact = march("explicit", belt, before, 2.5e-8, 4000).fields[f.ELEMENT_TILT]
    errors = [
        np.abs(march_fast(belt, before, 1e-4 / steps, steps).fields[f.ELEMENT_TILT] - exact).max()
        for steps in (100, 200, 400)
    ]
    moved = np.abs(exact - before.fields[f.ELEMENT_TILT]).max()
    assert errors[-1] < 0.02 * moved and errors[0] / errors[-1] > 1.5**2


def test_power_balances():
    found, none = record(**SCENE, **TILT), record(**SCENE)
    assert abs(found["power_residual"]) < 1e-3
    assert found["tilt_loss"] > 0.01 > none["tilt_loss"] == 0.0


@pytest.mark.parametrize(
    ("model", "tables", "told"),
    [
        ("elastic_belt", {"belt": {"tilt_spring": "0 N"}}, "tilt_spring: expected > 0 N"),
        ("elastic_belt", {"belt": {"tilt_spring": "3 kN", "ring_offset": "0 m"}}, "ring_offset: expected other than 0"),
        ("elastic_belt", {"belt": {"tilt_spring": "3 kN"}, "rings": {"ring_layers": 2}}, "tilt_spring: expected inf with"),
        ("quasi_static_belt", {"belt": {"tilt_spring": "3 kN"}}, "tilt_spring"),
    ],
)  # fmt: skip
def test_settings_that_do_not_fit(model, tables, told):
    with pytest.raises(InputError, match=told) as caught:
        build_job({"name": "x", "model": model, **tables}, "x.toml")
    assert "\n" not in str(caught.value)


def test_a_run_in_parts_is_the_run():
    runs = []
    for lanes in ("runs", "stations"):
        run = Transient(job(**SCENE, **TILT, lanes=lanes, precision="single").point(0), "imex")
        assert run.advance(50) is None
        runs.append(run.rows[: run.done])
    # round-off of single precision; of 57 columns one is off by 6.5e-4 after 50 samples, the others by 1.3e-4
    size, error = np.abs(runs[0]).max(axis=0), np.abs(runs[1] - runs[0])
    assert (error[0] <= 5e-5 * size).all() and (error <= 1e-3 * size).all()
