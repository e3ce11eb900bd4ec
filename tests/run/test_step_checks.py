"""What the fast step once did away from its working point, and what every run checks of its own step.

One belt, 661.2 mm on shafts 155 mm apart, at ratios where rings hardly slide on the elements and where they do.
"""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.auto.rules import coarse
from cvt_hpc.models.elastic_belt import check
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state, mesh
from cvt_hpc.models.elastic_belt.step_choice import REFERENCE_STEP, SAFE_SHARE, chosen_step, transverse_limit
from cvt_hpc.models.elastic_belt.validity import doubt, step_doubt
from cvt_hpc.variables import Status
from support.fast_runs import FastRuns
from support.lone import Transient
from support.marched import fresh_record, job, record

ONE_BELT = {"belt_length": 0.6612, "centre_distance": 0.155, "stations": 48}
SHORT = {"duration": 0.08, "rise_time": 0.01, "load": 80.0, "friction_gradient": -0.4}
# Of one station of rings and elements: from here on saturated friction, as its slope takes it, can throw a sliding
# speed to and fro at every step, 2 x (1 + s) = stiffness tanh x with s the slope's implicit share.
CHATTER = 4.82


def saddle_stiffness(**values):
    """Rate of saturated friction of the saddles over their regularisation speed, times the step [1]."""
    point = job(**values).point(0)
    belt, radius = belt_constants(point), min(point["driven_radius"], point["driven_radius"] / point["ratio"])
    tension = record(**values)["mean_ring_tension"].max() - belt.ring_mass[0] * belt.belt_speed**2
    mobility = 1.0 / belt.element_mass + 1.0 / belt.ring_mass[0]
    return belt.ring_friction * tension / radius * mobility * point["step"] / belt.ring_friction_speed


def test_the_stiffness_from_which_a_tangent_chatters():
    x = np.linspace(0.1, 10.0, 500)

    def share(slope):
        return slope * (0.5 + slope / (2.0 * slope + 12.0))

    stiffness = np.linspace(3.0, 7.0, 4001)[:, None]
    thrown = stiffness * np.tanh(x) >= 2.0 * x * (1.0 + share(stiffness / np.cosh(x) ** 2))
    assert stiffness[thrown.any(axis=1)][0] == pytest.approx(CHATTER, rel=1e-3)


@pytest.mark.parametrize("ratio", [0.5, 0.7, 1.0, 1.4, 2.52])
def test_saddles_stick_however_stiff_their_friction_is(ratio):
    values = ONE_BELT | SHORT | {"ratio": ratio, "ring_friction_speed": 2e-3, "band_low": 300.0}
    found = record(**values)
    assert saddle_stiffness(**values) > 20.0 * CHATTER
    assert found["status"] == Status.DONE and found["amplitude"].max() < 0.5e-6
    # of rings that chatter 7e-2, 60 mm/s and up to 3 um; a mesh of 48 stations leaves 1.7e-3 at ratio 0.5 at any step
    assert abs(found["power_residual"]) < 2e-3
    assert found["step_ripple"] < 0.1 * job().point(0)["most_step_ripple"]
    assert found["amplitude"].max() < 0.3e-6


@cache
def least_force(step):
    """Smallest T - P - m v^2 in a strand [N] between rigid sheaves, near the largest load."""
    values = {
        "sheave_stiffness": np.inf,
        "stiffness_of": "sheave",
        "load": 200.0,
        "friction_gradient": -1.0,
        "stations": 96,
    }
    asked = job(**values, step=step, duration=0.12, rise_time=0.02)
    run = Transient(asked.point(0), "imex")
    assert run.advance(run.samples) is None
    return run.channel("least_strand_force").min()


def test_pushes_do_not_pile_up_in_elements_that_touch():
    # of pushes that go on by one cell a step: -7.7 kN at 4.6 us
    assert least_force(4.6e-6) > 1e3
    assert least_force(4.6e-6) == pytest.approx(least_force(2.3e-6), rel=0.02)


@pytest.mark.parametrize("values", [{"step": 20e-6}, {"step": 25e-6}, {"step": 16e-6, "element_mass": 0.5}])
def test_a_belt_beyond_its_stable_step_is_never_said_to_vibrate(values):
    point = job(stations=160, **values).point(0)
    assert point["step"] > 1.05 * transverse_limit(point)
    found = record(stations=160, duration=0.06, rise_time=0.01, transverse_damping=0.0, load=120.0, **values)
    assert found["status"] == Status.FAILED_NUMERICS


def test_the_limit_of_the_step_is_the_shortest_wave_s():
    # a wave of two cells alone, w^2 = 4 F / (m h^2), when contact is small beside it; bending is implicit
    point = job(bending_stiffness=500.0, flank_stiffness=1e3).point(0)
    grid = mesh(point)
    force = 2.0 * np.tan(point["half_wedge_angle"]) * point["thrust"] / grid.path.driven_wrap
    assert transverse_limit(point) == pytest.approx(grid.cell.min() / np.sqrt(force / 1.3), rel=1e-3)


def test_a_step_beyond_the_limit_is_named():
    assert step_doubt(10e-6, 10e-6) is None
    status, why = step_doubt(20e-6, 10e-6)
    assert status is Status.FAILED_NUMERICS and "the step 2e-05 s is beyond" in why


def test_speeds_that_alternate_from_step_to_step_are_no_result():
    point = job().point(0)
    grid, ripple = mesh(point), 0.5 * point["most_step_ripple"]
    sound = {"power_residual": 1e-4, "least_strand_force": 1e3, "step_ripple": ripple}
    assert doubt(sound, point, grid) is None
    status, why = doubt(sound | {"step_ripple": 20e-3}, point, grid)
    assert status is Status.FAILED_NUMERICS and "from step to step, by 20 mm/s" in why


def test_the_ripple_is_the_speed_that_alternates():
    point = job(stations=48).point(0)
    belt = belt_constants(point)
    run = FastRuns([belt], [initial_state(point, belt)])
    # speeds two steps ago less twice those one step ago, as they are where nothing changes
    noted = run.work.stations.data[:, lf.NOTED : lf.NOTED + 3, 0]
    noted[:] = -run.lanes.fields.data[:, [f.U, f.V_ELEMENT, f.V_RING], 0]
    run.advance(0, 1e-6)
    assert run.channels()["step_ripple"] == 0.0
    # the rings to and fro by 10 mm/s: +10, -10, +10
    noted[:, 2] += 4 * 10e-3
    run.advance(0, 1e-6)
    share = belt.ring_mass.mean() / (belt.ring_mass.mean() + belt.element_mass)
    # the rings' mass per length of the path differs between arcs and strands by 1 to 3 %
    assert run.channels()["step_ripple"] == pytest.approx(10e-3 * np.sqrt(share), rel=0.02)


def chosen(**values):
    document = {"name": "test", "model": "elastic_belt"}
    return build_job(document, "test.toml", values).point(0)["step"]


def test_the_step_is_chosen_for_the_scene():
    assert chosen() == REFERENCE_STEP
    assert chosen(band_high=3000.0) == pytest.approx(0.5 * REFERENCE_STEP)
    assert chosen(step_error=0.01) == pytest.approx(0.5 * REFERENCE_STEP)
    fine = job(stations=960).point(0)
    expected = pytest.approx(SAFE_SHARE * transverse_limit(fine), rel=5e-3)  # three digits
    assert chosen(stations=960) == expected
    assert chosen(stations=288) == REFERENCE_STEP > chosen(stations=960)
    assert chosen(step=2e-6) == 2e-6
    assert chosen(stepper="explicit") == 4e-8


def test_every_cell_of_a_grid_has_a_step_of_its_own():
    document = {"name": "test", "model": "auto", "axes": {"flank_stiffness": [3e10, 3e12]}}
    asked = build_job(document, "test.toml", {})
    steps = [asked.point(index)["step"] for index in range(2)]
    assert steps == [chosen_step(asked.point(index)) for index in range(2)]
    assert steps[1] < steps[0] == REFERENCE_STEP
    assert not check(asked.point(1))


def test_a_run_by_hand_beyond_the_limit_is_done_again_shorter():
    found = fresh_record(step=28e-6, stations=160, duration=0.04, rise_time=0.01, most_refinements=1)
    assert (found["status"], found["refinements"]) == (Status.DONE, 1)
    assert found["time_step"] <= 14e-6


BOTH = "[numerics] step_error: expected either step_error or step, found both"


@pytest.mark.parametrize(
    ("tables", "overrides"),
    [
        ({"numerics": {"step": "2 us", "step_error": 0.02}}, {}),  # the default, but stated
        ({"numerics": {"step": "2 us"}, "axes": {"step_error": [0.01, 0.02]}}, {}),
        ({"numerics": {"step_error": 0.01}, "axes": {"step": [1e-6, 2e-6]}}, {}),
        ({"numerics": {"step_error": 0.01}, "derived": {"step": "1e-8 * stations"}}, {}),
        (
            {"numerics": {"step": "2 us"}, "axes": {"ratio": [1, 2]}, "linked": {"ratio": {"step_error": [0.1, 0.2]}}},
            {},
        ),
        ({}, {"step": 2e-6, "step_error": 0.01}),
    ],
)  # fmt: skip
@pytest.mark.parametrize("model", ["elastic_belt", "auto"])
def test_a_step_beside_an_error_that_asks_for_one_is_refused(model, tables, overrides):
    with pytest.raises(InputError) as caught:
        build_job({"name": "test", "model": model, **tables}, "test.toml", overrides)
    assert str(caught.value) == f"test.toml: {BOTH}"


def test_of_step_and_step_error_an_override_replaces_the_other():
    document = {"name": "test", "model": "elastic_belt", "numerics": {"step": "2 us"}}
    given = build_job(document, "test.toml", {})
    assert given.point(0)["step"] == 2e-6
    assert "step_error" not in given.parameters
    assert build_job(given.resolved(), "test.toml", {}).fingerprint() == given.fingerprint()
    for asked in (
        build_job(document, "test.toml", {"step_error": 0.01}).point(0),
        given.point_at({"step_error": 0.01}),
    ):
        assert asked["step"] == pytest.approx(0.5 * REFERENCE_STEP)
    document["numerics"] = {"step_error": 0.01}
    asked = build_job(document, "test.toml", {})
    for given in (build_job(document, "test.toml", {"step": 2e-6}).point(0), asked.point_at({"step": 2e-6})):
        assert given["step"] == 2e-6 and "step_error" not in given
    assert asked.point_at(asked.point(0)) == asked.point(0)  # of a whole run, both agree
    with pytest.raises(InputError, match="either step_error or step, found both, which do not agree"):
        asked.point_at({"step": 2e-6, "step_error": 0.01})


def test_formulas_may_name_the_error_that_gives_the_step():
    document = {"name": "test", "model": "elastic_belt", "derived": {"rise_time": "step_error"}}
    assert build_job(document, "test.toml", {}).point(0)["rise_time"] == 0.02
    with pytest.raises(
        InputError, match="parameters that the job gives, found step_error, which it does not"
    ):
        build_job(document, "test.toml", {"step": 2e-6})


def test_pulleys_that_overlap_are_told_of_and_not_the_step():
    with pytest.raises(InputError, match="ratio: expected pulleys that do not overlap"):
        build_job({"name": "test", "model": "elastic_belt"}, "test.toml", {"driven_radius": 0.2})


def test_a_coarse_run_stays_within_the_limit_of_its_mesh():
    # where the contact sets the limit it does not grow with the cells
    point = job(flank_stiffness=1.5e12).point(0) | {"question": "occurrence"}
    assert coarse(point)["step"] <= SAFE_SHARE * transverse_limit(coarse(point)) * (1.0 + 1e-9)
