"""What the papers say of the working point, found in runs with default parameters and mesh.

Lebrecht et al. 2004: friction that falls with speed lets the loaded strand vibrate, from a load on and with elastic sheaves; mode
2, 500-700 Hz, 10 um simulated and 20 um measured. Bullinger et al. 2005: without load the rings' friction is balanced by push
in the strand that is not loaded. All runs take 0.2 s, of which the last 0.1 s are judged, in the precision of a job that
states none.
"""

import numpy as np
import pytest

from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.settings import ABOVE_MODES, BELOW_MODES
from support.marched import Together, job

T1, T2 = 0, 1
QUIET = {
    "level friction": {"friction_gradient": 0.0},
    # of another law, and so with no other run in its lanes, which its stations fill
    "constant friction": {"friction_law": "coulomb", "friction_gradient": 0.0, "lanes": "stations"},
    "rigid sheaves": {"sheave_stiffness": np.inf},
    "half the fall": {"friction_gradient": -0.4},
}
SCENES = [{}, {"seed": 2}, *QUIET.values()]
ALL = {"duration": 0.2, "precision": "single"}
RUNS = Together(
    *(ALL | {"load": load} for load in (0.0, 40.0, 100.0, 160.0)),
    *(ALL | {"load": 120.0} | scene for scene in SCENES),
)


def run(load, **values):
    found = RUNS.record(**ALL, load=load, **values)
    assert found["status"] == Status.DONE, found["reason"]
    return found


def test_falling_friction_lets_the_loaded_strand_vibrate():
    found = run(120.0)
    assert found["vibrates"] == Vibrates.YES
    assert found["mode"][T1] == 2
    assert 350 < found["frequency"][T1] < 800
    # the papers' 10-20 um, within a factor of two: ours follows the assumed damping and friction
    assert 5e-6 < found["amplitude"][T1] < 40e-6
    # settled: over the judged 0.1 s it neither grows nor falls by more than its own scatter, 10 % per window
    assert abs(found["growth_rate"][T1]) * 0.1 < 0.25


@pytest.mark.parametrize("values", QUIET.values(), ids=QUIET)
def test_it_is_quiet_without_the_fall_of_friction_or_without_elastic_sheaves(values):
    found = run(120.0, **values)
    assert found["vibrates"] == Vibrates.NO
    # a tenth of what it is with both, in either strand, whatever the threshold
    assert np.all(found["amplitude"] < 0.1 * run(120.0)["amplitude"])


@pytest.mark.parametrize("load", [0.0, 40.0])
def test_it_is_quiet_at_low_load(load):
    found = run(load)
    assert found["vibrates"] == Vibrates.NO
    assert np.all(found["amplitude"] < 0.1 * run(120.0)["amplitude"])


def test_the_vibration_does_not_depend_on_how_it_was_started():
    one, other = run(120.0), run(120.0, seed=2)
    # One limit cycle, from two random starts of 1 um. Windows of 40 ms scatter by 2-7 %, the judged part has four of them.
    assert other["amplitude"] == pytest.approx(one["amplitude"], rel=0.05)
    assert other["frequency"] == pytest.approx(one["frequency"], rel=0.01)
    assert not np.array_equal(other["amplitude"], one["amplitude"])


def test_without_load_the_rings_drag_is_balanced_by_push_in_the_other_strand():
    found = run(0.0)
    # underdrive: the rings slip back on the small driving pulley and are tighter where they enter it
    assert found["mean_ring_tension"][T2] > 1.1 * found["mean_ring_tension"][T1]
    assert found["mean_push_force"][T2] > 1e3
    assert found["mean_push_force"][T1] < 1.0


def test_push_carries_the_load_in_the_loaded_strand():
    loads = [40.0, 100.0, 120.0, 160.0]
    push = np.array([run(load)["mean_push_force"] for load in loads])
    assert np.all(push[:, T2] < 1.0)
    # what the load adds at the radius of the driving pulley, 30 mm, shared by push and rings: a rise of 20 to 33 N per N m
    per_load = np.diff(push[:, T1]) / np.diff(loads)
    assert np.all((per_load > 20) & (per_load < 1 / 0.0298))


def test_the_free_frequency_of_the_loaded_strand_falls_with_load():
    # F = T - P of a strand: push slackens the loaded strand, and tightens nothing in the other. The first mode of a free strand
    # of mass m and length L that moves at v has sqrt(F / m) (1 - m v^2 / F) / (2 L).
    p = job().parameters
    mass, radius = p["element_mass"] + p["ring_mass"], p["driven_radius"] / p["ratio"]
    speed = p["driving_speed"] * radius
    length = np.sqrt(p["centre_distance"] ** 2 - (p["driven_radius"] - radius) ** 2)
    free = []
    for load in (40.0, 100.0, 120.0, 160.0):
        found = run(load)
        force = found["mean_ring_tension"] - found["mean_push_force"]
        free.append(np.sqrt(force / mass) * (1 - mass * speed**2 / force) / (2 * length))
    free = np.array(free)
    assert np.all(np.diff(free[:, T1]) < 0)
    assert np.all(np.diff(free[:, T2]) > 0)
    assert np.all(free[:, T1] < free[:, T2])
    # the band in which vibration is looked for begins below them, in a run that judders above; bending raises them by 2 %
    assert run(40.0)["lower_band_edge"] == pytest.approx(BELOW_MODES * free[0].min(), rel=0.03)
    assert run(120.0)["driven_speed_ripple"] > 0.1
    assert run(120.0)["lower_band_edge"] == pytest.approx(ABOVE_MODES * free[2].max(), rel=0.03)
