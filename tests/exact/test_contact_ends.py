"""Where the belt leaves its groove: a string and a beam on their bedding, local bending on a finer mesh, no set reach."""

import functools

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import rhs
from cvt_hpc.models.elastic_belt.belt import Mesh, State, belt_constants, mesh
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.validity import reach_doubt
from cvt_hpc.physics.compliance import plain_contact, solve_wrap
from cvt_hpc.physics.sheaves import elastic_matrix, sheaves
from cvt_hpc.variables import Status
from support.complementarity import solve_lcp
from support.equations import evaluate
from support.marched import fresh_record
from support.settled import DEFAULTS

FORCE = 5.8e3  # F = T - P - m v^2 [N]
# Pulleys so large that the belt is a straight one on a parabola, as in the closed form: EI / R^2 is 1e-3 of F
LARGE = {"ratio": 1.0, "driven_radius": 0.3, "centre_distance": 0.8, "stations": 480, "end_refinement": 20.0}
RIGID_DISCS = {"sheave_stiffness": np.inf, "stiffness_of": "sheave"}


def closed_form(radius, bedding, bending):
    """Largest radial force over F / R, and the end of contact from the tangent point [m], without friction.

    Within the contact EI y'''' - F y'' + k_r (y - x^2 / 2R) = -F / R in the path's axes, beyond it EI y'''' = F y''
    and y falls to 0: y, y', y'' and y''' are continuous where the force ends.
    """
    if bending == 0.0:
        return 1.0, np.sqrt(FORCE / bedding)
    roots = np.roots([bending, 0.0, -FORCE, 0.0, bedding])
    roots = roots[roots.real > 0.0]
    m, depth = np.sqrt(FORCE / bending), FORCE / (radius * bedding)
    # depth, slope, curvature and its change at the end e of contact; unknown: two waves, e, and y' beyond
    system = [
        [1.0, 1.0, 0.0, 0.0],
        [*roots, -1.0 / radius, m],
        [*roots**2, 0.0, -(m**2)],
        [*roots**3, 0.0, m**3],
    ]
    found = np.linalg.solve(np.array(system), [depth, 0.0, 1.0 / radius, 0.0])
    x = np.linspace(-0.1, 0.0, 100001)
    waves = (found[0] * np.exp(roots[0] * x) + found[1] * np.exp(roots[1] * x)).real
    return (1.0 - waves / depth).max(), found[2].real


@functools.cache
def at_rest(bending, flanks):
    """A belt at rest under F in grooves without friction: its constants, mesh and axial line forces."""
    values = DEFAULTS | LARGE | RIGID_DISCS | {"curvature_terms": "straight", "transverse_damping": 0.0}
    values |= {"bending_stiffness": bending, "flank_stiffness": flanks, "friction_memory": 0.0}
    belt = belt_constants(values)
    law = belt.law._replace(kinetic=0.0, gradient=0.0)
    belt = belt._replace(belt_speed=0.0, driving_speed=0.0, law=law)
    n = belt.cell.size
    state, flat = State(np.zeros((7, n)), np.zeros(f.SCALARS)), flat_belt(belt)
    state.scalars[f.TIME] = 1.0

    def across(w):
        middles = belt.curvature * 0.5 * (w + np.roll(w, -1))
        state.fields[f.W] = w
        state.fields[f.N_ELEMENT] = 1.0 + middles
        ring = 1.0 + middles + belt.curvature * belt.ring_offset
        state.fields[f.N_RING] = ring / (1.0 + FORCE / belt.ring_stiffness)
        evaluate(flat, state)
        return flat.rate[f.U].copy()

    w = np.zeros(n) - 1e-4
    for _ in range(30):
        left = across(w)
        slopes = np.array([across(w + 1e-9 * unit) - left for unit in np.eye(n)]).T / 1e-9
        change = np.linalg.solve(slopes, -left)
        w = w + change
        if np.abs(change).max() < 1e-10:
            break
    assert np.abs(across(w)).max() * belt.mass < 1e-3 * FORCE / belt.driving_radius
    return belt, mesh(values), flat.force


@pytest.mark.slow
@pytest.mark.parametrize(("bending", "flanks"), [(0.0, 3.53e9), (0.5, 3.53e9), (0.5, 3e10)])
def test_contact_ends_where_that_of_a_belt_on_its_bedding_does(bending, flanks):
    belt, grid, force = at_rest(bending, flanks)
    wedge, radius = 2.0 * np.tan(belt.half_wedge_angle), belt.driving_radius
    bedding = wedge**2 * flanks
    largest, end = closed_form(radius, bedding, bending)
    zone, radial = grid.zone(0), wedge * force[belt.driving_stations]
    middle = radial.size // 2
    assert radial[middle] == pytest.approx(FORCE / radius, rel=5e-3)
    for outward in (slice(middle, None), slice(middle, None, -1)):
        pull, x = radial[outward], np.abs(zone.beyond[outward])
        on_arc = np.minimum(zone.angle, np.pi - zone.angle)[outward] * radius
        x = np.where(x > 0.0, x, -on_arc)
        assert pull.max() / (FORCE / radius) == pytest.approx(largest, rel=0.02)
        last = np.flatnonzero(pull > 0.0)[-1]
        found = x[last] + (x[last + 1] - x[last]) * pull[last] / (pull[last] - pull[last + 1])
        assert found == pytest.approx(end, abs=0.03 * max(abs(end), np.sqrt(FORCE / bedding)))


@pytest.mark.slow
@pytest.mark.parametrize(("bending", "flanks"), [(0.0, 3.53e9), (0.5, 3e10)])
def test_radial_forces_turn_the_belt_by_half_a_turn(bending, flanks):
    belt, grid, force = at_rest(bending, flanks)
    zone = grid.zone(0)
    radial = 2.0 * np.tan(belt.half_wedge_angle) * np.maximum(force[belt.driving_stations], 0.0)
    assert belt.driving.weight @ (radial * np.sin(zone.angle)) == pytest.approx(2.0 * FORCE, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.52, 1.06, 2.52])
def test_local_bending_at_the_ends_is_that_of_a_ten_times_finer_mesh(ratio):
    """A groove that presses evenly on its arc and widens beyond it, by Lemke's algorithm."""
    values = DEFAULTS | {
        "ratio": ratio,
        "driven_radius": 0.075 if ratio > 1.0 else 0.04,
        "tilt_stiffness": np.inf,
    }
    wrap, radius = (belt := belt_constants(values)).driving, belt.driving_radius
    wedge, depth = 2.0 * np.tan(belt.half_wedge_angle), 4e-5
    force = np.empty(wrap.weight.size)
    assert solve_wrap(plain_contact(wrap), wedge * wrap.rise - depth, force) > 0

    # from 40 mm before the outlet to where its groove is wide, in even cells; the rest of the arc is far away
    cell = 0.1 * wrap.weight.min()
    s = np.arange(-0.04, 0.01, cell)
    beyond = np.maximum(s, 0.0)
    fine = sheaves(
        np.full(s.size, cell),
        np.minimum(s, 0.0) / radius + np.arctan2(beyond, radius),
        np.hypot(beyond, radius) - radius,
        radius,
        *(1.0, np.inf, values["local_stiffness"], values["local_length"], wrap.element_stiffness),
    )
    stiff = np.eye(s.size) + wrap.element_stiffness * elastic_matrix(fine) * fine.weight
    expected = solve_lcp(stiff, wrap.element_stiffness * (wedge * fine.rise - depth))

    outlet = wrap.angle[wrap.rise == 0.0].max()
    place = np.where(wrap.angle > outlet, np.tan(wrap.angle - outlet), wrap.angle - outlet) * radius
    near = (place > -0.02) & (place < 0.01)
    assert near.sum() > 8
    size = expected.max()
    assert force[near] == pytest.approx(np.interp(place[near], s, expected), abs=0.03 * size)
    total = wrap.weight[near] @ force[near]
    inside = (s > place[near][0] - 0.5 * wrap.weight[near][0]) & (s < 0.01)
    assert total == pytest.approx(cell * expected[inside].sum(), rel=0.01)


def test_twice_the_reach_beyond_the_arcs_changes_no_digit(monkeypatch):
    scene = {"stations": 64, "duration": 0.04, "rise_time": 0.01, "load": 60.0, "precision": "double"}
    expected = fresh_record(**scene)
    zone = Mesh.zone
    monkeypatch.setattr(Mesh, "zone", lambda grid, region: zone(grid, region, 0.2))
    found = fresh_record(**scene)
    # but those of rounding
    for name in ("axial_force", "mean_ring_tension", "flank_loss"):
        assert found[name] == pytest.approx(expected[name], rel=1e-6), name
    assert found["amplitude"] == pytest.approx(expected["amplitude"], abs=1e-10)


def test_contact_that_reaches_the_last_tested_station_is_a_failure():
    grid = mesh(DEFAULTS)
    grooves = [grid.zone(region).stations for region in (0, 2)]
    for stations in grooves:
        for end in (0, -1):
            force = np.zeros(grid.cell.size)
            force[stations[1:-1]] = 1e5
            assert reach_doubt(force, grooves) is None
            force[stations[end]] = 1.0
            status, why = reach_doubt(force, grooves)
            assert status is Status.FAILED_NUMERICS and "would be cut off" in why


@pytest.mark.parametrize("ratio", [0.52, 1.06, 2.52])
def test_what_turns_with_a_pulley_does_not_slide_in_its_groove(ratio):
    """Rigid rotation, wherever the station lies: along it omega (R + w), across it -omega x."""
    values = DEFAULTS | {"ratio": ratio, "driven_radius": 0.075 if ratio > 1.0 else 0.04, "duration": 1.0}
    belt, grid = belt_constants(values), mesh(values)
    state = State(np.zeros((7, belt.cell.size)), np.zeros(f.SCALARS))
    state.scalars[f.DRIVEN_SPEED] = driven = belt.driving_speed / ratio
    for region, omega, radius in (
        (0, belt.driving_speed, belt.driving_radius),
        (2, driven, belt.driven_radius),
    ):
        zone = grid.zone(region)
        assert np.abs(zone.beyond).max() > 5e-3
        for w in (0.0, 2e-4, -2e-4):
            state.fields[f.W], state.fields[f.V_ELEMENT] = w, omega * (radius + w)
            for j, x in zip(zone.stations, zone.beyond, strict=True):
                climb, run, distance = rhs.sliding_speeds(belt, state, j, -omega * x, belt.driving_speed)
                # exact on the path; of a displacement w / R (x / R)^2 and (w / R)^2 are left out
                left_out = abs(w) / radius * ((x / radius) ** 2 + 3.0 * abs(w) / radius) + 1e-13
                assert distance == pytest.approx(np.hypot(x, radius + w), abs=radius * left_out)
                assert max(abs(climb), abs(run)) < omega * radius * left_out
