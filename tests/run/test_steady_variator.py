"""The steady belt: at rest under the transient's own right-hand side, in equilibrium, and where it has none."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state, mesh
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, rates
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.steady_variator import OF_THE_COURSE, curve, first_states
from cvt_hpc.models.steady_variator.continuation import OWN, Continuation, mean_size, newton
from cvt_hpc.models.steady_variator.curve import Curve, Piece, determinant_sign
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.models.steady_variator.first_states import FirstStates, SlipsThrough, least_sliding
from cvt_hpc.models.steady_variator.forces import distributions
from cvt_hpc.models.steady_variator.record import Found, judge, quantities
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator import GROSS_SLIP
from support.fast_runs import FastRuns
from support.rungs import rung_job, rung_record
from support.scene import VALUES

GIVEN = VALUES | {"duration": 0.1, "stations": 48}
LOADS = (60.0, 80.0, 100.0, 120.0)


@cache
def steady(**values):
    found = tuple(SteadyBelt(GIVEN | values).along(LOADS))
    assert len(found) == len(LOADS)
    return found


def rates_of(found, belt):
    flat = flat_belt(belt, 1e9)
    out = np.empty(flat.origin.size)
    assert rates(flat, 0.0, pack(flat, found.state), out)
    return out


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"sheave_stiffness": np.inf, "stiffness_of": "sheave", "friction_memory": 0.0},
        {"tilt_spring": 3267.0},
    ],
)
def test_nothing_changes_in_it(values):
    first = initial_state(GIVEN | values, belt_constants(GIVEN | values))
    for found in steady(**values):
        belt = found.belt._replace(bridging_stiffness=found.belt.element_stiffness)
        # Newton's last step is 1e-7 of the sizes, so strains are left by 1e-10, and the elements' stiffness 4e7 N
        # makes of that 0.6 m/s^2 in cells of 7 mm and 1 kg/m; forces of 1e5 N/m cancel
        assert np.abs(rates_of(found, belt)).max() < 1.0
        contents = found.state.fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ belt.cell
        assert contents == pytest.approx(first.fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ belt.cell, rel=1e-12)


def test_a_transient_stays_there():
    # constant friction, so that nothing grows; the sheaves' lag is 2 ms
    found = steady(friction_gradient=0.0)
    for one in found:
        run = FastRuns([one.belt], [one.state])
        run.advance(2000, 4e-6)
        state = run.state()
        # Where the explicit rule of parting and the step's differ, at most one cell, the step begins without its
        # push: 10 nm of the belt's 1 mm. Without that cell it is 1 pm.
        assert state.fields[f.W] == pytest.approx(one.state.fields[f.W], abs=2e-8)
        assert state.scalars[f.DRIVEN_SPEED] == pytest.approx(one.state.scalars[f.DRIVEN_SPEED], abs=2e-4)


def test_pulleys_are_in_balance():
    # moment about the driven shaft: strands pull where their lines pass it, the rings d_1 further out
    grid = mesh(GIVEN)
    for found in steady():
        belt, around = found.belt, distributions(found)
        numbers = quantities(found, grid)
        assert numbers["axial_force"][1] == pytest.approx(GIVEN["thrust"], rel=1e-9)
        moment = 0.0
        for region, sign in ((1, -1.0), (3, 1.0)):
            stations = grid.starts[region] + np.arange(grid.counts[region] // 4, 3 * grid.counts[region] // 4)
            way = grid.along(region)
            slope, w = np.polyfit(way[stations - grid.starts[region]], around.displacement[stations], 1)
            arm = belt.driven_radius + w + (slope * way[-1] if region == 1 else 0.0)
            tension, push = around.ring_tension[stations].mean(), around.push_force[stations].mean()
            net = tension - push - belt.mass * belt.belt_speed**2
            moment += sign * (net * arm + tension * belt.ring_offset)
        # strands bend next to the arcs: 0.5 of 500 N m, as in tests/conservation
        assert moment == pytest.approx(belt.ratio * found.load, abs=0.5)


def test_load_moves_the_push_into_t1_and_slows_the_driven_pulley():
    numbers = [quantities(found, mesh(GIVEN)) for found in steady()]
    push = np.array([one["mean_push_force"] for one in numbers])
    loss = [one["speed_loss"] for one in numbers]
    assert np.all(np.diff(push[:, 0]) > 0.0) and np.all(push[:, 1] < 1.0)
    assert np.all(np.diff(loss) > 0.0) and loss[0] > 0.0


def test_the_way_does_not_matter():
    # 80 N m along the load, and from a first state of its own: both within Newton's tolerance, 1e-7 of the sizes
    alone = SteadyBelt(GIVEN).at(80.0)
    sizes = Equations(GIVEN | {"load_start": 0.0}, alone.belt).sizes
    assert np.abs((alone.unknowns - steady()[1].unknowns) / sizes).max() < 1e-7


def test_jacobian():
    parameters = GIVEN | {"load_start": 0.0}
    equations = Equations(parameters, belt_constants(parameters))
    x = steady()[0].unknowns.copy()
    assert equations.residual(x) is not None
    matrix = equations.jacobian(x).toarray()
    random = np.random.default_rng(3).normal(size=x.size) * equations.sizes * 1e-6
    # elements' strains apart, whose corners are somewhere between
    random[48 : 2 * 48] = 0.0
    change = equations.residual(x + random) - equations.residual(x - random)
    assert matrix @ (2.0 * random) == pytest.approx(change, rel=1e-4, abs=3e-6 * np.abs(change).max())


def beside_a_corner(equations, distance):
    """Unknowns with one strain moved next to the corner of its cell's damped push, and that strain's place."""
    x = steady()[0].unknowns.copy()
    cell = int(np.argmax(equations.corners(x)[0]))
    for _ in range(5):  # the damper's part follows the strain, too
        x[48 + cell] += equations.corners(x)[0, cell] - distance
    assert equations.corners(x)[0, cell] == pytest.approx(distance, rel=1e-3)
    return x, 48 + cell


@pytest.mark.parametrize("distance", [3e-11, -3e-11], ids=["pressed", "apart"])
def test_slopes_beside_a_corner_are_those_of_its_own_side(distance):
    # a difference quotient of 1e-9 would be the mean of both sides: with it, Newton's iteration goes to and fro
    parameters = GIVEN | {"load_start": 0.0, "tilt_lag": 0.0}
    equations = Equations(parameters, belt_constants(parameters))
    x, strain = beside_a_corner(equations, distance)
    away = np.zeros(x.size)
    away[strain] = -np.sign(distance) * 1e-8
    before = equations.residual(x)
    assert before is not None
    slopes, mean = (equations.jacobian(x, sided=sided) @ away for sided in (True, False))
    change = equations.residual(x + away) - before
    assert slopes == pytest.approx(change, rel=1e-3, abs=1e-4 * np.abs(change).max())
    assert np.abs(mean - change).max() > 0.1 * np.abs(change).max()


def test_a_correction_that_leaves_the_range_of_the_unknowns_ends_the_step(monkeypatch):
    belt = SteadyBelt(GIVEN)
    start, equations, solves = belt.at(60.0), Equations(GIVEN, belt_constants(GIVEN)), []

    class Diverging:
        def solve(self, right):
            solves.append(right.size)
            return 1e6 * equations.sizes * (-1.0) ** np.arange(right.size)

    states = Curve(equations, 1e-7)
    monkeypatch.setattr(states, "_residual", lambda x, pressed: (np.zeros(x.size - 1), 0.0))
    pressed = equations.corners(start.unknowns).ravel() > 0.0
    tangent = np.ones(equations.sizes.size)
    piece = Piece(start.unknowns, pressed, Diverging(), tangent, 1.0)
    assert states._corrected(piece, 0.0) is None
    assert len(solves) == 1  # no slopes are taken out there, on which SuperLU crashes


@pytest.mark.parametrize("distance", [1e-8, -1e-8], ids=["pressed", "apart"])
def test_pushes_go_on_beyond_the_corners_of_presumed_cells(distance):
    parameters = GIVEN | {"load_start": 0.0, "tilt_lag": 0.0}
    equations = Equations(parameters, belt_constants(parameters))
    x, strain = beside_a_corner(equations, distance)
    pressed = equations.corners(x) > 0.0
    own = equations.residual(x)
    assert equations.residual(x, pressed) == pytest.approx(own, abs=1e-6 * np.abs(own).max())
    across = np.zeros(x.size)
    across[strain] = 2.0 * distance
    ahead, behind = (equations.residual(x + sign * across, pressed) - own for sign in (1.0, -1.0))
    assert np.abs(ahead + behind).max() < 1e-3 * np.abs(ahead).max()
    assert np.abs(equations.residual(x + across) - own + behind).max() > 0.1 * np.abs(ahead).max()


def test_slopes_of_corners():
    parameters = GIVEN | {"load_start": 0.0, "tilt_lag": 0.0}
    equations = Equations(parameters, belt_constants(parameters))
    x = steady()[0].unknowns
    change = 1e-6 * np.random.default_rng(4).normal(size=x.size) * equations.sizes
    found = equations.corners(x + change) - equations.corners(x - change)
    assert equations.corner_slopes(x) @ (2.0 * change) == pytest.approx(found.ravel(), rel=1e-6, abs=1e-14)


def test_sign_of_a_determinant():
    for matrix in np.random.default_rng(5).normal(size=(10, 7, 7)):
        assert determinant_sign(splu(csc_array(matrix))) == np.sign(np.linalg.det(matrix))


def test_states_follow_their_curve_from_corner_to_corner_where_the_load_turns_back():
    # from 20 to 60 N m the play passes from the driven wrap through a strand to the driving wrap, cell by cell
    parameters = GIVEN | {"load_start": 0.0, "tilt_lag": 0.0, "tilt_stiffness": 6.3e5, "stations": 30}
    first = SteadyBelt(parameters).at(20.0)
    equations = Equations(parameters, first.belt)
    loads, pressed = [first.load], equations.corners(first.unknowns) > 0.0
    for x, load in Curve(equations, 1e-7).along(first.unknowns, -1.0):
        equations.under(load=load, load_start=load)
        # strains are left by 1e-10 or so, which the elements' stiffness makes some m/s^2 of
        assert np.abs(equations.residual(x)).max() < 10.0
        before, pressed = pressed, equations.corners(x) > 0.0
        assert np.sum(pressed[0] != before[0]) <= 1
        loads.append(load)
        if load > 60.0:
            break
    assert loads[-1] > 60.0 and np.diff(loads).min() < 0.0 and np.diff(loads).max() < 10.0
    # under a load between two of them there is a state between them, also where they turn back
    found = SteadyBelt(parameters).at(60.0, first).unknowns
    equations.under(load=60.0, load_start=60.0)
    assert np.abs(equations.residual(found)).max() < 1.0
    assert mean_size(equations, found - x) < 1.0


def test_single_cells_that_open_are_not_taken_for_the_limit_of_friction():
    # -5 s/m: the load falls by half at 211 N m, while slip stays at a fifth of a per cent, and rises again to 305 N m
    parameters = GIVEN | {
        "load_start": 0.0,
        "friction_gradient": -5.0,
        "tilt_stiffness": 6.3e5,
        "stations": 24,
    }
    belt = SteadyBelt(parameters)
    # first a load under which the belt settles soon
    limit = belt.carried(belt.at(200.0, belt.at(100.0)))
    assert limit.largest_slip > 0.01 and limit.load > 250.0


def test_largest_load_where_a_strand_is_about_to_let_go():
    """Its cells' pushes differ by 1e-12 of strain and less, so that several are on their corners at once."""
    scene = {
        "belt_length": 0.661195,
        "centre_distance": 0.155,
        "ratio": 2.191,
        "driving_speed": 47.8,
        "thrust": 58.86e3,
        "friction_gradient": -0.47,
        "sheave_stiffness": np.inf,
        "stiffness_of": "sheave",
        "tilt_stiffness": 6.3e5,
        "friction_memory": 0.18e-3,
        "friction_speed": 0.01,
        "stations": 48,
    }
    point = rung_job("steady_variator", load_share=-0.4695, **scene).point(0)
    belt = SteadyBelt(point)
    near = belt.at(point["load"])
    limit = belt.carried(near)
    assert limit.load < 1.2 * near.load and 0.01 < limit.largest_slip < GROSS_SLIP


def test_largest_load_does_not_depend_on_the_steps(monkeypatch):
    parameters = GIVEN | {"friction_gradient": 0.0, "stations": 32}
    belt = SteadyBelt(parameters)
    near = belt.at(235.0)
    loads = [belt.carried(near).load]
    monkeypatch.setattr(curve, "LONGEST", 0.025)
    loads.append(belt.carried(near).load)
    assert loads[1] == pytest.approx(loads[0], rel=1e-6)


def test_newton_gives_up_where_it_is_lost():
    parameters = GIVEN | {"load_start": 0.0}
    belt = belt_constants(parameters)
    equations = Equations(parameters, belt)
    assert newton(equations, equations.unknowns(initial_state(parameters, belt)), 1e-7) is None


def test_friction_carries_what_bullinger_says():
    # transmittable torque 2 mu / cos(d0) Q r of the driving pulley (Bullinger et al. 2005, eq. 2), if all sliding is along
    # the belt and far beyond the regularisation speed
    parameters = GIVEN | {"friction_gradient": 0.0, "sheave_stiffness": np.inf, "stiffness_of": "sheave"}
    belt = SteadyBelt(parameters)
    last = belt.carried(belt.at(200.0))
    axial = quantities(last, mesh(parameters))["axial_force"][0]
    most = 2.0 * GIVEN["kinetic_friction"] / np.cos(GIVEN["half_wedge_angle"])
    assert 0.9 < last.load / (most * axial * last.belt.driving_radius) < 1.0


def test_a_load_beyond_what_friction_carries():
    record = rung_record("steady_variator", load=400.0, stations=32)
    assert (record["status"], record["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips through under 400 N m: from" in record["reason"]


def test_a_load_that_does_not_settle_is_reached_from_each_of_the_loads_beside_it(monkeypatch):
    """And a march that runs away from a load that brakes has not slipped through: it diverges."""
    monkeypatch.setattr(first_states, "settled", lambda *_: Outcome.RAN_AWAY)
    parameters = GIVEN | {"load_start": 0.0}
    first = FirstStates(parameters, Continuation(parameters))
    with pytest.raises(NoSteadyState, match="does not settle under 60 N m"):
        first._settled(60.0)
    with pytest.raises(SlipsThrough, match="slips through under -60 N m"):
        first._settled(-60.0)

    begun = []

    def rise(x, start, load):
        begun.append(start)
        if len(begun) < 3:
            raise NoSteadyState(f"not from {start:g}")
        return x

    def settle(load, wide):
        if load == 60.0:
            raise NoSteadyState("not at 60")
        return np.zeros(1)

    monkeypatch.setattr(first, "_settle", settle)
    assert first.under(60.0, rise) == 0.0 and len(set(begun)) == 3

    def refused(x, start, load):
        begun.append(start)
        raise NoSteadyState(f"not from {start:g}")

    with pytest.raises(NoSteadyState, match="not from"):
        first.under(60.0, refused)
    assert begun[-1] == pytest.approx(0.1 * carried_torque(GIVEN))


def test_wider_friction_is_tried_where_a_march_by_its_own_does_not_settle(monkeypatch):
    first, tried = FirstStates(GIVEN, Continuation(GIVEN)), []

    def settle(load, wide):
        tried.append(wide)
        if wide == OWN:
            raise NoSteadyState("goes round for ever")
        return np.zeros(1)

    monkeypatch.setattr(first, "_settle", settle)
    assert first.under(60.0, None) == 0.0
    # 0.3 and 10 m/s over 30 and 10 mm/s
    assert tried == [OWN, pytest.approx((10.0, 1000.0))]


@pytest.mark.parametrize("speed", [0.01, 0.3])
def test_a_slow_belt_settles_as_a_faster_one_whose_speeds_are_slowed_down(speed):
    # the angles by which its elements tilt are no speeds
    scene = {"driving_speed": speed, "thrust": 2e4, "ratio": 2.16, "driven_radius": 0.0705, "stations": 48}
    asked = build_job({"name": "slow", "model": "steady_variator"}).parameters | scene
    given = {**asked, **OF_THE_COURSE, "load": 0.0}
    first = FirstStates(given, course := Continuation(given))
    x = first._settle(0.0, OWN)
    assert np.abs(x[course.equations.memories]).max() < speed and x[-2] == pytest.approx(
        speed / 2.16, rel=0.02
    )


def test_a_load_that_takes_faster_sliding_than_the_belt_runs_is_refused():
    """tanh(v / v_reg) of the torque that twice the thrust carries at friction's highest level."""
    belt = belt_constants(GIVEN | {"load": 0.0, "load_start": 0.0, "driving_speed": 0.01})
    most = 4.0 * GIVEN["thrust"] * belt.driving_radius / np.cos(GIVEN["half_wedge_angle"])
    most *= GIVEN["kinetic_friction"] - GIVEN["friction_gradient"] * GIVEN["stribeck_velocity"]
    v = least_sliding(belt, 60.0)
    assert most * np.tanh(v / GIVEN["friction_speed"]) == pytest.approx(60.0, rel=1e-9)
    assert least_sliding(belt, -60.0) == v and least_sliding(belt, 1.01 * most) == 0.0
    record = rung_record("steady_variator", load=60.0, driving_speed=0.01, stations=48)
    assert (
        record["status"] == Status.FAILED_NUMERICS
        and "m/s of sliding on, and the belt runs at" in record["reason"]
    )


def test_record_is_that_of_the_state():
    record = rung_record("steady_variator", load=60.0, stations=48)
    numbers = quantities(steady()[0], mesh(GIVEN))
    assert record["status"] == Status.DONE
    assert record["mean_push_force"] == pytest.approx(numbers["mean_push_force"], rel=1e-6)
    assert record["thrust_ratio"] == pytest.approx(numbers["thrust_ratio"], rel=1e-9)


@pytest.mark.parametrize(("slip", "verdict"), [(0.049, Vibrates.UNDECIDED), (-0.051, Vibrates.SLIPS)])
def test_a_state_in_which_a_pulley_slips_grossly_is_called_so(slip, verdict):
    values = {"slip": np.array([slip, 0.02])}
    found = judge(Found(None, None, values))
    assert (found["status"], found["vibrates"]) == (Status.DONE, verdict)


def test_the_margin_of_gross_slip_is_that_of_the_elastic_belt():
    found = rung_record("steady_variator", load=100.0, stations=48)
    torque = 2 * 0.1 / np.cos(np.deg2rad(11)) * found["axial_force"].min() * 0.075 / 2.52
    assert found["slip_margin"] == pytest.approx(100.0 / torque - 1.0, abs=1e-4)
