"""Curvature terms and rocking elements in runs: steps agree, power balances, settings that do not fit are refused."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state
from cvt_hpc.models.elastic_belt.column import column_forces
from cvt_hpc.models.elastic_belt.rhs import strains
from support.fast_runs import march, march_fast
from support.lone import Transient
from support.marched import job, record

SCENE = {"stations": 48, "duration": 0.06, "rise_time": 0.01, "load": 110.0}
# both edges of faces beside the pitch line, of elements that bend little
ROCKING = {"column_bending": "rocking", "column_stiffness": 5.0, "outer_edge": 1e-3, "inner_edge": 5e-4}
SWITCHES = {
    "path": {"curvature_terms": "path"},
    "straight": {"curvature_terms": "straight", "bending_stiffness": 0.1},
    "rocking": ROCKING,
    "both": ROCKING | {"curvature_terms": "path"},
}


@pytest.mark.parametrize("name", SWITCHES)
def test_power_balances(name):
    # 0.03 to 0.05 % without them: the coarse mesh's transport
    found = record(**SCENE, **SWITCHES[name])
    assert abs(found["power_residual"]) < 1e-3
    assert found["step_ripple"] < 1e-3
    none = record(**SCENE)
    assert not np.array_equal(found["amplitude"], none["amplitude"])


def test_elements_rock_in_it():
    parameters = job(**SCENE, **ROCKING).parameters
    belt = belt_constants(parameters)
    state = march_fast(belt, initial_state(parameters, belt), 4e-6, 10000)
    n = belt.cell.size
    eps, pressed, moment = np.empty((2, n)), np.empty(n), np.empty(n)
    strains(belt, state.fields, eps)
    column_forces(belt, state.fields, eps[0], pressed, moment)
    push = -belt.element_stiffness * np.minimum(pressed, 0.0)
    # where they are bent to the arcs' curvature: on their inner edge, but for some at the ends of the push
    beside = 0.5 * (push + np.roll(push, 1))
    bent = (
        (belt.curvature > 0.0)
        & (np.roll(belt.curvature, 1) > 0.0)
        & (np.minimum(push, np.roll(push, 1)) > 500.0)
    )
    lever = moment[bent] / beside[bent]
    assert bent.sum() > 10
    assert np.median(lever) == pytest.approx(-ROCKING["inner_edge"], rel=0.02)
    assert np.mean(np.abs(lever / -ROCKING["inner_edge"] - 1.0) < 0.1) > 0.6


@pytest.mark.parametrize("name", ["straight", "both"])
def test_the_fast_step_has_the_limit_of_the_explicit_one(name):
    parameters = job(**SCENE, **SWITCHES[name]).parameters
    belt = belt_constants(parameters)
    before = march_fast(belt, initial_state(parameters, belt), 4e-6, 5000)
    random = np.random.default_rng(7)
    for row in (f.U, f.V_RING):
        before.fields[row] += 0.02 * random.normal(size=belt.cell.size)
    exact = march("explicit", belt, before, 2.5e-8, 4000).fields
    errors = []
    for steps in (100, 200, 400):
        found = march_fast(belt, before, 1e-4 / steps, steps).fields
        errors.append([np.abs(found[row] - exact[row]).max() for row in (f.W, f.U, f.V_RING)])
    moved = [np.abs(exact[row] - before.fields[row]).max() for row in (f.W, f.U, f.V_RING)]
    errors = np.array(errors) / moved
    # of first order, and within 1 % at 0.25 us
    assert np.all(errors[-1] < 0.01)
    assert np.all(errors[0] / errors[-1] > 1.5**2)


def test_a_run_in_parts_is_the_run():
    runs = []
    for lanes in ("runs", "stations"):
        run = Transient(job(**SCENE, **SWITCHES["both"], lanes=lanes, precision="single").point(0), "imex")
        assert run.advance(50) is None
        runs.append(run.rows[: run.done])
    # round-off of single precision, as runs in parts mostly have it, and what sliding about makes of it; a wrong
    # neighbour changes the first digits
    size, error = np.abs(runs[0]).max(axis=0), np.abs(runs[1] - runs[0])
    assert (error[0] <= 1e-5 * size).all() and (error <= 5e-4 * size).all()


@pytest.mark.parametrize(
    ("model", "bending", "told"),
    [
        ("elastic_belt", {"outer_edge": "-1 mm"}, "outer_edge"),
        ("elastic_belt", {"column_bending": "rolling"}, "column_bending.*off, rocking"),
        ("elastic_belt", {"column_stiffness": "0 N m^2"}, "column_stiffness"),
        ("quasi_static_belt", {"curvature_terms": "path"}, "bending"),
    ],
)
def test_settings_that_do_not_fit(model, bending, told):
    with pytest.raises(InputError, match=told) as caught:
        build_job({"name": "x", "model": model, "bending": bending}, "x.toml")
    assert "\n" not in str(caught.value)


def test_curvature_terms_know_one_mass():
    document = {"name": "x", "model": "elastic_belt", "bending": {"curvature_terms": "path"}}
    with pytest.raises(
        InputError, match="curvature_terms: expected none with longitudinal_mass other than 1"
    ):
        build_job(document | {"belt": {"longitudinal_mass": 5.0}}, "x.toml")
