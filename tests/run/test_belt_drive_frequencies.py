"""Free vibration of the strands of a running belt drive after a kick."""

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive.record import judge
from cvt_hpc.models.belt_drive.transient import Transient

# A belt that bends easily, for what bending curves a strand couples it to the pulleys; a heavy driven pulley, whose
# own frequency on the belt, 6 Hz, is far below; v^2 / c^2 of 0.03
SCENE = {
    "elements": 48,
    "amplitude_threshold": 0.01,
    "driving_speed": 200.0,
    "driven_inertia": 1.0,
    "bending_stiffness": 2.6e-3,
    "bending_damping": 5e-3,
    "contact_stiffness": 1.2e8,
    "friction_speed": 1e-2,
    "speed_tolerance": 1e-4,
    "duration": 0.35,
    "rise_time": 0.05,
    "kick": 0.02,
}


@pytest.fixture(scope="module")
def kicked():
    run = Transient(build_job({"name": "x", "model": "belt_drive"}, "x", SCENE).point(0), "cyclic_alpha")
    assert run.advance(run.samples) is None
    return run


def test_strands_answer_a_kick_as_moving_strings_that_bend(kicked, tell):
    found = judge(kicked)
    ratio = found["answered_frequency"] / found["eigenfrequency"]
    assert np.isfinite(ratio[:, 0]).all() and np.isfinite(ratio).sum() >= 3  # bending damps the higher ones
    tell("frequencies after a kick over those of moving strings", ratio[np.isfinite(ratio)], 1.0)
    # elements of 25 mm lift off a pulley too late, which shortens a strand
    np.testing.assert_allclose(ratio[np.isfinite(ratio)], 1.0, rtol=0.01)


def test_the_drive_linearised_has_the_pulley_on_its_belt_and_both_strands(kicked):
    """At rest, where a string has n c / (2 L): the running strands are lower by v^2 / c^2, 0.03."""
    found = judge(kicked)
    np.testing.assert_array_equal(
        judge(kicked)["drive_frequency"], found["drive_frequency"]
    )  # to the last bit
    pulley, *strands = found["drive_frequency"][:3]
    resting = np.sqrt(found["strand_tension"] / 0.096) / (2.0 * 0.45)
    np.testing.assert_allclose(strands, np.sort(resting), rtol=0.012)  # 0.008 by elements of 25 mm
    # strands and sliding arcs are springs EA / l between the pulleys; without load all of the arcs sticks
    stiffness = 2.0 * 152e3 * 0.05**2 / 0.45
    assert pulley == pytest.approx(np.sqrt(stiffness / 1.0) / (2.0 * np.pi), rel=0.05)


def test_strands_that_bend_at_the_pulleys_turn_the_driven_one():
    """Kong and Parker 2003: with a light pulley, of a lower frequency, they are higher than with one that stands."""
    values = {"elements": 96, "friction_speed": "5 m/s"}  # all contacts stick
    first = []
    for bending, inertia in ((0.026, 100.0), (0.026, 0.013), (0.0026, 100.0), (0.0026, 0.013)):
        p = values | {"bending_stiffness": bending, "driven_inertia": inertia}
        run = Transient(build_job({"name": "x", "model": "belt_drive"}, "x", p).point(0), "cyclic_alpha")
        run.advance(1)
        found = run.drive_frequencies(4)
        first.append(found[(found > 60.0) & (found < 75.0)])
    stiff, stiff_and_light, weak, weak_and_light = first
    assert stiff.size == weak.size == 2
    assert stiff_and_light[1] > 1.005 * stiff[1] > 1.005 * weak[1]
    np.testing.assert_allclose(weak_and_light, weak, rtol=1e-3)
