"""What feeds a vibration and what takes from it: each term, and their balance."""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import belt_constants, mesh
from cvt_hpc.models.elastic_belt.fluctuation import ARC_PARTS, fluctuation, part_shares
from cvt_hpc.models.elastic_belt.one_system import unpack
from cvt_hpc.models.elastic_belt.record import judge
from cvt_hpc.models.linear_stability.modes import modes
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from cvt_hpc.physics.flank import flank_forces
from cvt_hpc.physics.friction import friction_coefficient
from support.fast_runs import FastRuns
from support.growing import at_rest
from support.lone import Transient
from support.settled import DEFAULTS

BELT = DEFAULTS | {"stations": 96}
PHASES = 8  # of a period; sums over them are exact up to the third harmonic of a product
TAKEN = ("belt_taken", "ring_taken", "layer_taken", "lag_taken", "carried_power")
CONSTANT = {"friction_law": "coulomb", "friction_gradient": 0.0}


@cache
def finished(**values):
    """A coarse run, judged over 60 ms."""
    document = {"name": "test", "model": "elastic_belt", "stepper": "imex", "axes": {}}
    shared = {
        "stations": 64, "duration": 0.12, "load": 120.0, "friction_gradient": -1.0, "precision": "double"
    }  # fmt: skip
    asked = build_job(document, "test.toml", shared | values)
    run = Transient(asked.point(0), asked.stepper)
    while run.done < run.samples:
        assert run.advance(run.samples) is None
    return run


@cache
def steady_belts():
    loads = (95.0, 100.0, 105.0, 125.0, 140.0)
    return dict(zip(loads, SteadyBelt(BELT).along(loads), strict=True))


def steady(load):
    return steady_belts()[load]


def covariance(a, b):
    """Mean product of the deviations from the means, over lanes or states."""
    return np.mean((a - a.mean(axis=0)) * (b - b.mean(axis=0)), axis=0)


def sampled(belt, states):
    """One sample of each of some states of the same belt: the runs, and what feeds over all of them."""
    runs = FastRuns([belt] * len(states), states)
    runs.advance(0, 1e-6)
    means = {name: sums.mean(axis=1) for name, sums in runs.profiles().items()}
    return runs, fluctuation(means, mesh(BELT), BELT)


# The balance of a vibration


def flow(found):
    """All that is fed into the vibration [W]."""
    terms = [*found["flank_fed"].ravel(), found["stress_fed"], *(-found[name] for name in TAKEN)]
    return sum(max(term, 0.0) for term in terms)


@pytest.mark.parametrize(("step", "tolerance"), [(4.6e-6, 0.04), (1e-6, 0.015)])
def test_what_is_fed_into_a_vibration_is_taken(step, tolerance):
    # 20 W. Backward Euler in the elements damps by EA dt/2, 90 N s at 4.6 us
    found = judge(finished(step=step))
    assert flow(found) > 8.0
    assert abs(found["fluctuation_remainder"]) < tolerance * flow(found)


def test_a_term_of_the_wrong_sign_would_show():
    found = judge(finished(step=1e-6))
    fed = [*found["flank_fed"].sum(axis=1), found["stress_fed"], *(-found[name] for name in TAKEN)]
    # a term below 3 % is within what may be left open
    large = [term for term in fed if abs(term) > 0.03 * flow(found)]
    assert len(large) >= 6
    for term in large:
        assert abs(found["fluctuation_remainder"] - 2.0 * term) > 2.0 * 0.015 * flow(found)


def test_the_outlet_of_the_driven_arc_feeds_and_the_driving_arc_takes():
    found = judge(finished())
    assert found["flank_fed"][1].argmax() == ARC_PARTS - 1
    assert found["flank_fed"][1].sum() > 3.0 and found["flank_fed"][0].sum() < -3.0


def test_a_quiet_belt_is_not_fed():
    # elements hum at the front of the push all the same: 0.03 W, and dampers there work in blows that samples miss
    found = judge(finished(sheave_stiffness=np.inf, stiffness_of="sheave", load=100.0, **CONSTANT))
    for name in ("flank_fed", "stress_fed", *TAKEN, "fluctuation_remainder"):
        assert np.all(np.abs(found[name]) < 0.1), name
    assert np.all(np.abs(found["flank_fed"][1]) < 1e-3)


def test_parts_add_up_to_what_friction_takes():
    run = finished()
    loss = [run.channel(f"{pulley}_flank_loss")[run.judged].mean() for pulley in ("driving", "driven")]
    assert judge(run)["part_flank_loss"].sum(axis=1) == pytest.approx(loss, rel=1e-12)


def test_denser_samples_see_the_same():
    # the same steps, of a quarter of the shorter interval: friction's fast part would show as a difference
    coarse, dense = (judge(finished(step=3.125e-6, sampling_rate=rate)) for rate in (20e3, 80e3))
    # means of 1200 samples, of which some 30 periods of the vibration are not a whole number
    assert coarse["flank_fed"] == pytest.approx(dense["flank_fed"], abs=0.1)
    assert coarse["stress_fed"] == pytest.approx(dense["stress_fed"], abs=0.1)


def test_parts_are_equal_shares_of_each_wrap():
    grid = mesh(BELT)
    shares = part_shares(grid)
    belt = belt_constants(BELT)
    assert shares.sum(axis=(0, 1)) == pytest.approx(belt.touches, abs=1e-14)
    # of its stations' lengths on the arc
    on_arc = 0.5 * (belt.cell * (belt.curvature > 0.0))
    on_arc += np.roll(on_arc, 1)
    lengths = shares @ on_arc
    wraps = [grid.path.lengths[region] / ARC_PARTS for region in (0, 2)]
    assert lengths == pytest.approx(np.repeat(wraps, ARC_PARTS).reshape(2, ARC_PARTS), rel=1e-12)
    # from the inlet on
    middles = (shares @ (on_arc * np.arange(grid.cell.size))) / lengths
    assert np.all(np.diff(middles, axis=1) > 0.0)
    # and the groove's outer stations go with the parts beside them
    for pulley, region in enumerate((0, 2)):
        zone = grid.zone(region)
        for part, outside in ((0, zone.beyond < 0.0), (-1, zone.beyond > 0.0)):
            assert outside.any() and np.all(shares[pulley, part, zone.stations[outside]] == 1.0)


def test_a_ramp_of_load_has_no_mean_state():
    found = judge(finished(load_history="ramp", load_start=60.0))
    for name in ("flank_fed", "stress_fed", *TAKEN, "fluctuation_remainder"):
        assert np.all(np.isnan(found[name])), name
    assert np.all(found["part_flank_loss"] > 0.0)


# Each station alone: radial speeds that swing while the belt, and so the contact force, stays where it is


def swinging(size):
    """States of the belt at 100 N m whose stations swing out of step, all at the same displacement."""
    phases = 2.0 * np.pi * np.random.default_rng(3).uniform(size=BELT["stations"])
    states = [steady(100.0).state.copy() for _ in range(PHASES)]
    for k, state in enumerate(states):
        state.fields[f.U] += size * np.sin(phases + 2.0 * np.pi * k / PHASES)
    return states


def test_a_motion_that_does_not_fluctuate_feeds_nothing():
    # a state in rough motion, the same at every sample: products of means alone, of up to 1e5 W
    state = swinging(0.05)[3]
    _, found = sampled(belt_constants(BELT | {"load": 100.0}), [state] * PHASES)
    for name in ("flanks", "belt", "rings", "stresses", "carried"):
        assert np.abs(getattr(found, name)).max() < 1e-8, name


def plain_feed(belt, forces, states):
    """Power that flank friction feeds at each station [W], by the plain form of the forces."""
    angle = belt.half_wedge_angle
    wedge, sine, cosine = 2.0 * np.tan(angle), np.sin(angle), np.cos(angle)
    history = np.zeros((4, len(states), belt.cell.size))
    for k, state in enumerate(states):
        w, v = state.fields[f.W], state.fields[f.V_ELEMENT]
        slope = (np.roll(w, -1) - np.roll(w, 1)) * belt.per_span
        for j in np.flatnonzero(forces > 0.0):
            driven = belt.on_driven[j] > 0.0
            omega = state.scalars[f.DRIVEN_SPEED] if driven else belt.driving_speed
            v_across = state.fields[f.U, j] + v[j] * slope[j]
            # radial unit vector (lean, upright), along and across; rho = R + rise + upright w
            lean = belt.lean[j] - belt.lean_rate[j] * w[j]
            rho = (
                (belt.driven_radius if driven else belt.driving_radius)
                + belt.rise[j]
                + belt.upright[j] * w[j]
            )
            v_radial = belt.upright[j] * v_across + lean * v[j]
            v_tangential = belt.upright[j] * v[j] - lean * v_across - omega * rho
            force = forces[j]
            mu, _ = friction_coefficient(belt.law, np.hypot(v_radial / cosine, v_tangential), force / cosine)
            radial, tangential = flank_forces(
                mu, belt.friction_speed, sine, cosine, force, v_radial, v_tangential
            )
            history[:, k, j] = radial - wedge * force, v_radial, tangential, v_tangential
    radial, v_radial, tangential, v_tangential = history
    return belt.dual * (covariance(radial, v_radial) + covariance(tangential, v_tangential))


@pytest.mark.parametrize("law", [CONSTANT, {"friction_memory": 0.0}])
def test_flanks_feed_what_their_plain_forces_do(law):
    belt, states = belt_constants(BELT | {"load": 100.0} | law), swinging(0.01)
    runs, found = sampled(belt, states)
    force = runs.profiles()["contact_force"]
    assert np.ptp(force, axis=1).max() < 1e-9 * force.max()
    expected = plain_feed(belt, force.mean(axis=1), states)
    # round-off of means that are 1e4 times as large
    assert found.flanks == pytest.approx(expected, rel=1e-8, abs=1e-10)
    # u swings by itself: 1/2 d_b u^2
    assert found.belt == pytest.approx(-0.5 * 500.0 * 0.01**2 * belt.dual, rel=1e-6)
    on_arcs = force.mean(axis=1) > 0.0
    if law is CONSTANT:
        # regularised it rises with speed at every speed
        assert np.all(found.flanks[on_arcs] < 0.0)
    else:
        assert found.flanks.max() > 1e-3


# A small motion grows by what it is fed: the eigenvalue is known from the Jacobian alone


@pytest.mark.parametrize("load", [95.0, 105.0, 125.0, 140.0])
def test_growth_is_what_is_fed_over_twice_the_energy(load):
    point, grid = steady(load), mesh(BELT)
    mode = modes(point, grid)[0]
    flat, y, _ = at_rest(point)
    states, size = [], 1e-8
    for k in range(PHASES):
        unpack(flat, 0.0, y + size * (mode.vector * np.exp(2j * np.pi * k / PHASES)).real)
        states.append(flat.state.copy())
        states[-1].scalars[0] = 1.0  # long after the start-up
    runs, found = sampled(point.belt, states)
    fed = sum(x.sum() for x in (found.flanks, found.belt, found.rings, found.stresses, found.carried))
    fed -= _dampers_take(runs, point.belt, states) + _lag_takes(runs, point.belt)
    # Left out of the sum is what elements carry of their own speed, upwinded: 1 to 3 /s here
    assert fed / (2.0 * _energy(runs, point.belt, states)) == pytest.approx(mode.growth, abs=3.0)


def _dampers_take(runs, belt, states):
    """Power of the layers' dampers in the fluctuation [W]: of no steps, and so of the samples."""
    v0, v1 = (np.array([state.fields[row] for state in states]) for row in (f.V_ELEMENT, f.V_RING))
    u = np.array([state.fields[f.U] for state in states])
    lifted = 0.5 * belt.curvature * belt.cell * (u + np.roll(u, -1, axis=1))
    opening, stretching = (np.roll(v, -1, axis=1) - v + lifted for v in (v0, v1))
    elements = -covariance(runs.profiles()["push_damping"].T, opening).sum()
    return elements + belt.ring_damping * (stretching.var(axis=0) / belt.cell).sum()


def _lag_takes(runs, belt):
    axial = [runs.channels(lane)["axial_force driven"] for lane in range(PHASES)]
    return np.var(axial) / belt.axial_damping


def _energy(runs, belt, states):
    """Energy of the motion, of bending and of the contact [J]; that of T and P is in the stresses' power."""
    fields = np.array([state.fields for state in states])
    position = np.array([state.scalars[f.DRIVEN_POSITION] for state in states])
    w, dual = fields[:, f.W], belt.dual
    masses = ((f.U, belt.mass), (f.V_ELEMENT, belt.element_mass), (f.V_RING, belt.ring_mass))
    moving = sum((mass * dual * fields[:, row].var(axis=0)).sum() for row, mass in masses)
    gap = 2.0 * np.tan(belt.half_wedge_angle) * belt.upright * w + belt.on_driven * position[:, np.newaxis]
    contact = -(dual * covariance(runs.profiles()["contact_force"].T, gap)).sum()
    bent = sum(belt.bending[:, k] * np.roll(w, 2 - k, axis=1) for k in range(5))
    return 0.5 * (moving + contact - (dual * covariance(bent, w)).sum())
