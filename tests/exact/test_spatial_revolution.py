"""Half a revolution of misaligned spatial pushbelts: laws of all contacts at all outputs, balances, states of contacts."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from cvt_hpc.models.pushbelt import fields as pushbelt_fields
from cvt_hpc.models.pushbelt.belt import of_lanes
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.transient import advance
from cvt_hpc.physics.friction_laws import Law
from support import spatial_chains as chains
from support.pushbelts import THRUST
from support.spatial_belts import (
    LOAD,
    STEP,
    TORQUE,
    gaps,
    inputs,
    leaning_loads,
    scene,
    sheaves_modes,
    sheaves_opening,
    stored,
)

OUTPUTS = 225  # of ten steps each: half a revolution
SCENES = {
    # falling friction between elastic sheaves
    "falling": {
        "flank_law": int(Law.STRIBECK),
        "flank_gradient": -0.3,
        "friction_memory": 3e-4,
        "modal": ((6e8, 3e8, 3e8), (6e8, 3e8, 3e8)),  # [N/m]
    },
    # elements that nothing turns with the rings yaw until their pins hold them
    "pins": {"yaw_stiffness": 0.0, "pin_clearance": 5e-5},
}
CONTACTS = slice(
    spatial_fields.PUSH, spatial_fields.FLANK + spatial_fields.POINTS
)  # fields of their normal forces, in the order of b.CONTACTS
FRONTS, PIN, FLANKS = slice(0, 4), 4, slice(5, 9)


class Revolution(NamedTuple):
    """`rate` of all totals [W], in place of the time that of the stored energy."""

    belt: b.Belt
    state: b.BeltState
    rate: np.ndarray
    pushed: float  # rate of the belt's axial momentum [N]
    loads: np.ndarray  # of every step, (10 OUTPUTS, LOADS)
    elements: np.ndarray  # (OUTPUTS, nodes, STATE_FIELDS)
    saddle_before: np.ndarray  # normal forces of rings one step earlier, (OUTPUTS, nodes)
    gaps: np.ndarray  # (OUTPUTS, nodes, 9)
    openings: np.ndarray  # of the sheaves at the elements, (OUTPUTS, nodes)
    leans: np.ndarray  # before every step, (10 OUTPUTS, 2, modes)
    leaning: np.ndarray  # loads of these modes in it [N], (10 OUTPUTS, 2, modes)


def axial_momentum(belt, state):
    """[N s]."""
    return chains.energy_and_momentum(belt, of_lanes(state.elements))[1][2]


@cache
def revolution(name):
    belt, state, work = scene(**SCENES[name])
    has_modes = belt.modal_stiffness.size > 0
    before, energy, momentum = state.totals.copy(), stored(belt, state), axial_momentum(belt, state)
    hold = inputs((THRUST, THRUST), (LOAD, LOAD))
    of_steps, found = [], []
    for _ in range(OUTPUTS):
        for _ in range(10):
            saddle = of_lanes(state.elements)[:, spatial_fields.SADDLE].copy()
            leans, shapes = state.leans.copy(), sheaves_modes(belt, state) if has_modes else None
            assert advance(belt, b.NEWTON, state, work, hold, 1, STEP) == 0
            fields = of_lanes(state.elements).copy()
            load = leaning_loads(belt, fields, shapes) if has_modes else leans
            of_steps.append((state.loads.copy(), leans, load))
        found.append((fields, saddle, gaps(belt, state), sheaves_opening(belt, state, state.openings)))
    spent = state.totals - before
    rate = spent / spent[pushbelt_fields.TIME]
    rate[pushbelt_fields.TIME] = (stored(belt, state) - energy) / spent[pushbelt_fields.TIME]
    pushed = (axial_momentum(belt, state) - momentum) / spent[pushbelt_fields.TIME]
    loads, *modes = map(np.array, zip(*of_steps, strict=True))
    return Revolution(belt, state, rate, pushed, loads, *map(np.array, zip(*found, strict=True)), *modes)


def slips(f):
    """Sliding speeds of flanks and rings, (..., 5) [m/s]."""
    m, t = (f[..., k : k + 4] for k in (spatial_fields.FLANK_SLIP_M, spatial_fields.FLANK_SLIP_T))
    return np.concatenate([np.hypot(m, t), np.abs(f[..., spatial_fields.RING_SLIP, None])], axis=-1)


@pytest.mark.parametrize("name", SCENES)
def test_power_is_balanced_and_both_pulleys_take_the_same_axial_force(name, tell):
    found = revolution(name)
    rate, loads = found.rate, found.loads.mean(axis=0)
    lost = rate[pushbelt_fields.FLANK_LOSS : pushbelt_fields.POWER_RESIDUAL]
    # elements enter faster than they leave, for which flanks give 0.3 W at 10 us
    assert (lost > -1e-3 * lost.sum()).all()
    left = (
        rate[pushbelt_fields.WORK_IN]
        - rate[pushbelt_fields.WORK_OUT]
        - rate[pushbelt_fields.THRUST_WORK]
        - lost.sum()
        - rate[pushbelt_fields.TIME]
    )
    tell("power left open in a revolution over that of the drive", abs(left) / rate[pushbelt_fields.WORK_IN])
    assert abs(left) < 3e-4 * rate[pushbelt_fields.WORK_IN]
    assert found.state.counters[pushbelt_fields.FAILED_STEPS] <= 2
    # what the belt does to one pulley along the axis it takes from the other, or from its own motion
    net = (
        loads[spatial_fields.DRIVING_RIGHT] - loads[spatial_fields.DRIVING_LEFT],
        loads[spatial_fields.DRIVEN_RIGHT] - loads[spatial_fields.DRIVEN_LEFT],
    )
    assert net[0] > 80.0
    assert net[0] + net[1] == pytest.approx(-found.pushed, abs=1e-4 * net[0])
    assert -loads[spatial_fields.DRIVING_TORQUE] == pytest.approx(TORQUE, rel=0.03)


@pytest.mark.parametrize("name", SCENES)
def test_contacts_press_by_their_gaps_at_every_output(name, tell):
    """Forces are one-sided and those of the accepted state's gaps, which a step predicts along directions of q_k."""
    found = revolution(name)
    normal = found.elements[..., CONTACTS]
    assert normal.min() >= 0.0
    belt, pressed = found.belt, normal > 0.0
    stiffness = 0.5 * belt.contact_stiffness, belt.pin_stiffness, 0.5 * belt.flank_stiffness
    deformed = normal / np.repeat(stiffness, [4, 1, 4])
    error = np.abs(np.maximum(-found.gaps, 0.0) - deformed)
    deformed[..., FLANKS] += belt.cosine * found.openings[..., None]
    assert pressed[..., FRONTS].any() and pressed[..., FLANKS].any()
    # the largest error of an output, which what is not pressed but closed has too; 0.4 % found
    for part in (FRONTS, FLANKS):
        largest = deformed[..., part].max(axis=(1, 2))
        tell("overlap less deformation over the largest", error[..., part].max(axis=(1, 2)) / largest)
        assert (error[..., part].max(axis=(1, 2)) < 0.01 * largest).all(), part
    # Within a step a pin may run along its hole by so much that the direction of its force turns by 0.04: the gap
    # is another by its cosine's part of the clearance, 40 nm, and presses by one and a half times of that: 3 % of the
    # largest. So few pins err by more than 1 %, one in sixty here.
    of_pin, pin, largest = error[..., PIN], pressed[..., PIN], deformed[..., PIN].max()
    assert pin.any() == (name == "pins")
    assert of_pin.max() <= 0.05 * largest and of_pin[~pin].max() <= 0.01 * largest
    if pin.any():
        assert np.percentile(of_pin[pin], 98.0) < 0.01 * largest


@pytest.mark.parametrize("name", SCENES)
def test_friction_keeps_its_law_and_its_cone_at_every_output(name):
    found = revolution(name)
    f, belt = found.elements, found.belt
    sliding, size = (
        [f[..., k : k + 4] for k in (spatial_fields.FLANK_SLIP_M, spatial_fields.FLANK_SLIP_T)],
        slips(f),
    )
    force = [f[..., k : k + 4] for k in (spatial_fields.FLANK_FRICTION_M, spatial_fields.FLANK_FRICTION_T)]
    mu = np.full(size.shape[:-1], 0.09)[..., None]
    if name == "falling":  # mu_k - g v_s exp(-v / v_s)
        mu = 0.09 + 0.3 * 0.1 * np.exp(
            -f[..., spatial_fields.V_FILTERED : spatial_fields.V_FILTERED + 4] / 0.1
        )
        assert mu.max() > 1.2 * mu.min()
    most = mu * f[..., CONTACTS][..., FLANKS]
    least = 1e-9 * most.max()  # friction is linear to 3e-7 below 1e-3 of the regularisation's speed
    law = most * np.tanh(size[..., :4] / belt.friction_speed)
    assert np.abs(np.hypot(*force) - law).max() < least
    assert (np.hypot(*force) - most).max() < least
    assert np.abs(force[0] * sliding[1] - force[1] * sliding[0]).max() < least
    assert min((one * way).min() for one, way in zip(force, sliding, strict=True)) >= 0.0
    # rings: by the normal force of the step before
    most, slip = belt.ring_friction * found.saddle_before, f[..., spatial_fields.RING_SLIP]
    law = most * np.tanh(slip / belt.ring_friction_speed)
    assert np.abs(f[..., spatial_fields.RING_FRICTION] - law).max() < 1e-9 * most.max()


def changes(name):
    """Contacts that open, close, begin to stick and to slide from one output to the next, by their names."""
    f = revolution(name).elements
    touching, sliding = f[..., CONTACTS] > 0.0, slips(f) > 5e-4
    held = np.concatenate([touching[..., FLANKS], np.ones_like(touching[..., :1])], axis=-1)
    held = held[1:] & held[:-1]
    found = {
        "opens": touching[:-1] & ~touching[1:],
        "closes": ~touching[:-1] & touching[1:],
        "sticks": held & sliding[:-1] & ~sliding[1:],
        "slips": held & ~sliding[:-1] & sliding[1:],
    }
    names = {
        "opens": spatial_fields.CONTACTS[:9],
        "closes": spatial_fields.CONTACTS[:9],
        "sticks": spatial_fields.CONTACTS[5:],
        "slips": spatial_fields.CONTACTS[5:],
    }
    return {
        verb: {what for what, seen in zip(names[verb], found[verb].any(axis=(0, 1)), strict=True) if seen}
        for verb in found
    }


AHEAD = {"edge left", "edge right", "head left", "head right", "pin"}  # without friction
SIDES = {"flank left low", "flank left high", "flank right low", "flank right high"}


@pytest.mark.parametrize(
    ("verb", "contacts"),
    [
        ("opens", AHEAD | SIDES),
        ("closes", AHEAD | SIDES),
        ("sticks", SIDES | {"ring"}),  # saddle and pillar hold the rings from both sides
        ("slips", SIDES | {"ring"}),
    ],
)
def test_every_kind_of_contact_opens_closes_sticks_and_slips(verb, contacts):
    assert changes("pins")[verb] == contacts


@pytest.mark.parametrize(
    ("where", "points"),  # left low, left high, right low, right high
    [
        ("nowhere", "...."),
        ("left only", "lt.."),
        ("right only", "..lt"),
        ("both", "ltlt"),
        ("top of the left only", ".t.."),
        ("top of the right only", "...t"),
        ("bottom of the left only", "l..."),
        ("bottom of the right only", "..l."),
    ],
)
def test_flanks_touch_on_either_side_and_at_either_height(where, points):
    touching = revolution("pins").elements[..., CONTACTS][..., FLANKS] > 0.0
    assert (touching == [point != "." for point in points]).all(axis=-1).any(), where


def test_sheaves_lean_by_the_difference_of_their_loads(tell):
    found, stiffness = revolution("falling"), np.array(SCENES["falling"]["modal"])
    # every mode follows its load by the lag, so that in the mean it leans by load over stiffness less lag times rate
    rate = (found.leans[-1] - found.leans[0]) / (OUTPUTS * 10 * STEP)
    expected = found.leaning.mean(axis=0) / stiffness - found.belt.lean_lag * rate
    largest = np.abs(expected).max()
    assert largest > 1e-7 and (np.abs(expected[:, 1]) > 0.5 * largest).all()
    tell("lean of single sheaves by their loads [m]", found.leans.mean(axis=0), expected)
    assert found.leans.mean(axis=0) == pytest.approx(expected, abs=1e-3 * largest)
    # the first mode opens a sheave evenly by force over stiffness
    loads = found.loads.mean(axis=0)
    assert found.state.openings[0, 0] * 6e8 == pytest.approx(
        loads[: spatial_fields.DRIVEN_LEFT].mean(), rel=0.05
    )
