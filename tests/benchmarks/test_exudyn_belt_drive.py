"""The comparison with EXUDYN: what its numbers mean. EXUDYN itself is not needed here."""

import exudyn_belt_drive as comparison
import exudyn_near_slip as near_slip
import numpy as np
import pytest

from cvt_hpc.job import build_job


@pytest.fixture(scope="module")
def begun():
    p = comparison.point(32, 1e-4)
    return p, comparison.begin(p)


def test_both_measures_of_strain_give_the_tension_at_rest(begun):
    p, run = begun
    strain = comparison.reference_strain(p)
    q = run._state.chain.q[None]
    own, peer = (comparison.tensions(p, run, q, measure) for measure in (None, strain))
    assert own.mean() == pytest.approx(p["tension"], rel=2e-3)  # within an element it waves
    np.testing.assert_allclose(peer, own, rtol=2e-3)


def test_the_scene_is_a_belt_at_rest_on_smaller_circles(begun):
    p, run = begun
    scene = comparison.scene_of(p, run, 1e-4, comparison.AT_REST, 0.0)
    middle = np.sqrt(p["driven_radius"] ** 2 - (0.5 * run._drive.beam.lengths[0] / comparison.SEGMENTS) ** 2)
    assert scene["radius"] == pytest.approx(middle, abs=1e-6)  # of the chords of the cord's circle
    assert (scene["torques"] == 0.0).all() and scene["positions"].shape == (32, 4)
    loaded = comparison.scene_of(p, run, 1e-4, comparison.DURATION, 0.0)
    assert loaded["torques"].min() == -comparison.LOAD


def test_errors_are_against_the_finest_run_of_the_same_program():
    rows = [{"program": name, "speed_loss": loss} for name, loss in (("a", 1.1), ("a", 1.0), ("b", 2.0))]
    assert [row["error"] for row in comparison.with_errors(rows)] == pytest.approx([0.1, 0.0, 0.0])


def test_the_scene_near_slip_is_that_of_a_job_with_its_load_and_bristles():
    p = comparison.point(near_slip.ELEMENTS, near_slip.STEP)
    kept = ("elements", "step", "duration", "rise_time", "sampling_rate", "length_scatter", "mass_damping")
    values = {name: p[name] for name in (*kept, "contact_points")} | {"load": 20.0}
    values |= {"friction_treatment": "bristle", "shear_stiffness": comparison.BRISTLE}
    asked = build_job({"name": "near_slip", "model": "belt_drive"}, "near_slip", values).point(0)
    assert near_slip.scene(near_slip.BRISTLES) == asked
