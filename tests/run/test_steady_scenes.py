"""The steady belt away from its working point: any ratio, speed, load of either sign, sheaves; and at rest."""

import numpy as np
import pytest
from scipy.stats import qmc

from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.steady_variator.continuation import NoSteadyState
from cvt_hpc.models.steady_variator.first_states import FirstStates
from cvt_hpc.models.steady_variator.forces import distributions
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from cvt_hpc.variables import Status, Vibrates
from support.rungs import rung_job, rung_record

BELT = {"belt_length": 0.6612, "centre_distance": 0.155, "stations": 64}


def random_scenes(count):
    """Scenes whose load is 0.15 to 0.75 of what friction carries by eq. 2 of Bullinger et al. 2005.

    Driven by its load the belt carries down to half of that in underdrive, where the driving pulley's axial
    force falls: there the load is at most 0.3 of it. Below 0.15 the push changes strands somewhere, and at some
    loads where neither strand pushes no state is found (README of the model).
    """
    for x in qmc.Sobol(6, seed=5).random_base2(3)[:count]:
        ratio = 0.4 * 6.5 ** x[0]
        share = np.copysign(0.15 + 1.2 * abs(x[3] - 0.5), x[3] - 0.5)
        yield {
            "ratio": float(ratio),
            "driving_speed": float(5.0 * 100.0 ** x[1]),
            "thrust": float(5e3 * 16.0 ** x[2]),
            "load_share": float(max(share, -0.3) if ratio > 1.0 else share),
            "stiffness_of": "sheave",
            "sheave_stiffness": np.inf if x[4] > 0.9 else float(0.5 * 10.0 ** (x[4] / 0.9)),
            "friction_gradient": float(-1.2 * x[5]),
        }


@pytest.mark.parametrize("scene", list(random_scenes(8)), ids=lambda scene: f"{scene['ratio']:.2f}")
def test_random_scenes_have_a_state_in_balance(scene):
    found = rung_record("steady_variator", **BELT, **scene)
    assert found["status"] == Status.DONE, found["reason"]
    assert found["axial_force"][1] == pytest.approx(scene["thrust"], rel=1e-8)
    # powers of the discretised belt close to first order in the cells: 1e-4 to 1e-3 at 96 and 160 stations
    assert abs(found["power_residual"]) < 5e-3
    assert np.sign(found["torque_ratio"]) == np.sign(scene["load_share"])
    assert 0.0 <= found["efficiency"] < 1.0


@pytest.mark.parametrize(("ratio", "share"), [(0.5, 0.0), (0.5, 0.9), (1.0, 0.95), (2.0, -0.3)])
def test_it_is_the_state_that_a_transient_comes_to(ratio, share):
    scene = BELT | {"ratio": ratio, "load_share": share, "friction_gradient": 0.0}
    steady = rung_record("steady_variator", **scene)
    alone = {"duration": 0.4, "disturbance": 0.0, "precision": "double", "lanes": "stations"}
    marched = rung_record("elastic_belt", **alone, **scene)
    force = 1e-3 * steady["mean_ring_tension"].max()  # gaps move on for longer than the run
    assert steady["mean_ring_tension"] == pytest.approx(marched["mean_ring_tension"], abs=force)
    assert steady["mean_push_force"] == pytest.approx(marched["mean_push_force"], abs=force)
    assert steady["efficiency"] == pytest.approx(marched["efficiency"], abs=2e-3)
    assert steady["torque_ratio"] == pytest.approx(marched["torque_ratio"], abs=1e-3)


def test_at_rest_without_load_both_halves_of_a_wrap_are_alike():
    # and at inlet and outlet contact ends without force, beyond the tangent points
    point = rung_job("steady_variator", ratio=2.16, driving_speed=0.1, load=0.0, **BELT).point(0)
    steady, grid = SteadyBelt(point).at(0.0), mesh(point)
    groove = steady.belt.driving_stations
    force = distributions(steady).contact_force[groove]
    # friction at 0.1 rad/s is 1e-3 of what it is regularised over
    assert force == pytest.approx(force[::-1], abs=5e-3 * force.max())
    at_inlet = np.flatnonzero(groove == grid.starts[0])[0]
    assert force[0] == 0.0 < force[at_inlet] < 0.9 * force.max()


def test_where_no_march_settles_the_way_begins_at_loads_to_both_sides(monkeypatch):
    # 240 stations at 100 N m and -0.8 s/m, collars at tilt_factor 1: 54.5 N m leads there
    def settled(self, load):
        if not 50.0 < load < 60.0:
            raise NoSteadyState("no steady state found")
        return np.array([load])

    monkeypatch.setattr(FirstStates, "_settled", settled)
    monkeypatch.setattr(FirstStates, "_unmarched", lambda self: self._settled(0.0))
    point = rung_job("steady_variator", load=100.0, friction_gradient=-0.8, stations=64).point(0)
    (began,) = SteadyBelt(point)._first.under(100.0, lambda x, start, load: x)
    assert began == pytest.approx(54.5, abs=0.1)


def test_more_than_friction_carries_is_told_with_what_it_does_carry():
    found = rung_record("steady_variator", ratio=1.5, load_share=-0.9, **BELT)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips through under -" in found["reason"] and "they reach to -" in found["reason"]
