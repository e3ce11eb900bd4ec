"""Gross slip, by runs whose channels are written down: the torque that friction carries, and who slips when."""

from types import SimpleNamespace

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import PARAMETERS
from cvt_hpc.physics.friction import friction_law
from cvt_hpc.physics.geometry import variator
from cvt_hpc.variables import Vibrates, values
from cvt_hpc.variator.slip import AGAINST_SLIP, GROSS_SLIP, PULLEYS, largest_torque, slide, with_slip
from cvt_hpc.variator.variables import Means, Measured, shared
from cvt_hpc.vibration.assessment import Occurrence

DEFAULTS = {key: parameter.default for table in PARAMETERS.values() for key, parameter in table.items()}
PATH = variator(DEFAULTS["ratio"], DEFAULTS["driven_radius"], DEFAULTS["centre_distance"])
SPEED = 10.0  # [m/s], of the belt
ANGLE = 0.2
AXIAL = np.array([40e3, 50e3])
CONSTANT = friction_law("coulomb", 0.1, 0.0, 1.0)
ALL = slice(None)
SCENE = {"half_wedge_angle": ANGLE, "friction_law": "coulomb", "kinetic_friction": 0.1, "load": 90.0}
QUIET = {"axial_force": 40e3, "slip": 0.01}


def torque(law=CONSTANT, axial=AXIAL):
    return largest_torque(law, ANGLE, PATH, SPEED, axial)


def carried(mu, axial):
    """Bullinger et al. 2005, eq. 2, by hand."""
    return 2.0 * mu / np.cos(ANGLE) * axial * PATH.driving_radius


def test_the_pulley_with_the_smaller_axial_force_limits_the_torque():
    assert torque() == pytest.approx(carried(0.1, 40e3), rel=1e-12)
    assert torque(axial=AXIAL[::-1]) == pytest.approx(carried(0.1, 40e3), rel=1e-12)


def test_friction_is_that_at_the_sliding_speed_of_gross_slip():
    falling = friction_law("hyperbolic", 0.1, -0.8, 1.0)
    assert torque(falling) == pytest.approx(carried(0.1 / (1.0 + 8.0 * 0.05 * SPEED), 40e3), rel=1e-12)


def test_friction_is_that_under_the_line_force_of_each_arc():
    # a coefficient in proportion to the line force of the normal: 0.1 at 1 MN/m
    law = friction_law("table", 0.0, 0.0, 1.0, [0.0, 1e6], [0.0, 1.0], [0.0, 0.0, 0.1, 0.1])
    arcs = PATH.driving_radius * PATH.driving_wrap, PATH.driven_radius * PATH.driven_wrap
    forces = AXIAL / arcs / np.cos(ANGLE)
    assert torque(law) == pytest.approx(carried(1e-7 * forces, AXIAL).min(), rel=1e-12)
    assert np.argmin(carried(1e-7 * forces, AXIAL)) == 1  # though its axial force is the larger one


def run(channels=None, *, samples=8, judged=0, done=None, **parameters):
    """A run of so many samples; its channels by name, each a constant or one value for each sample."""
    found = {f"{name} {pulley}": value for name, value in QUIET.items() for pulley in PULLEYS}
    found |= {"load": 7.0, "driven_speed": 100.0} | (channels or {})
    done = samples if done is None else done
    given = DEFAULTS | SCENE | parameters
    return SimpleNamespace(
        parameters=given,
        mean_driving_speed=lambda samples: given["driving_speed"],
        samples=samples,
        done=done,
        judged=slice(judged, samples),
        path=PATH,
        channel=lambda name: np.broadcast_to(np.asarray(found[name], float), done),
    )


def capacity(run, samples):
    return values(AGAINST_SLIP, Measured(run, samples, None))


def test_the_margin_is_the_load_over_the_torque_less_one():
    limit = carried(0.1, 40e3)
    for load in (90.0, -90.0):
        found = capacity(run(load=load), ALL)
        assert found["carried_torque"] == pytest.approx(limit, rel=1e-12)
        assert found["torque_ratio"] == pytest.approx(load / limit, rel=1e-12)
        assert found["slip_margin"] == pytest.approx(90.0 / limit - 1.0, rel=1e-12)
    # gross slip is in proportion to the belt's speed, that of the driving pulley's rim
    falling = run(friction_law="hyperbolic", friction_gradient=-0.8, driving_speed=300.0)
    mu = 0.1 / (1.0 + 8.0 * GROSS_SLIP * 300.0 * PATH.driving_radius)
    assert capacity(falling, ALL)["slip_margin"] == pytest.approx(90.0 / carried(mu, 40e3) - 1.0, rel=1e-12)
    # along a ramp it is the mean load of the samples, as are the axial forces
    channels = {"load": np.arange(8.0), "axial_force driven": np.linspace(10e3, 80e3, 8)}
    found = capacity(run(channels, load_history="ramp"), slice(0, 2))
    assert found["torque_ratio"] == pytest.approx(0.5 / carried(0.1, 15e3), rel=1e-12)


def efficiency(driving, load, loss):
    found = Means()
    found.powers = {"driving_power": driving, "load_power": load, "loss": loss}
    return found.efficiency


@pytest.mark.parametrize(
    ("driving", "load", "loss", "expected"),
    [
        (100.0, 90.0, 10.0, 0.9),
        (-72.0, -80.0, 8.0, 0.9),  # the load drives
        (5.0, 0.0, 5.0, 0.0),
        (3.0, -2.0, 5.0, 0.0),  # both put in what is lost
    ],
)
def test_efficiency_has_the_sign_of_power(driving, load, loss, expected):
    assert efficiency(driving, load, loss) == pytest.approx(expected)


def test_a_belt_at_rest_has_no_efficiency():
    assert np.isnan(efficiency(0.0, 0.0, 0.0))


def judged(driving, driven=0.0, vibrates=Vibrates.YES, margin=2.0):
    """What is found of a run of eight samples, the last four judged, by its slip at each."""
    found = Occurrence(vibrates, "t1 vibrates", (), *[np.zeros(0)] * 8, margin=margin)
    return with_slip(run({"slip driving": driving, "slip driven": driven}, judged=4), found)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pulley_slips_from_a_twentieth_of_the_belts_speed_on(sign):
    found = judged(0.01, sign * 1.1 * GROSS_SLIP)
    assert (found.vibrates, found.margin) == (Vibrates.SLIPS, pytest.approx(np.log(1.1)))
    assert found.reason == "the driven pulley slips by 0.055 of the belt's speed; t1 vibrates"
    # below, the nearer one of both thresholds counts
    below = judged(sign * GROSS_SLIP / 1.1)
    assert (below.vibrates, below.margin) == (Vibrates.YES, pytest.approx(np.log(1.1)))
    assert judged(sign * GROSS_SLIP / 1.1, margin=0.01).margin == 0.01
    assert judged(0.0).margin == 2.0


def test_slip_counts_in_the_last_half_of_the_judged_part():
    early, late = np.full(8, 0.01), np.full(8, 0.01)
    early[:6], late[6:] = 0.2, 0.2
    assert judged(early).vibrates is Vibrates.YES
    assert judged(late).vibrates is Vibrates.SLIPS
    # slip to and fro is none
    assert judged(0.2 * (-1.0) ** np.arange(8)).vibrates is Vibrates.YES


@pytest.mark.parametrize(
    ("slips", "first"),
    [
        ([0.01, 0.2, 0.01, 0.01, 0.06, 0.3], 4),  # an earlier slip ended
        ([0.01, 0.2, 0.01, -0.01, -0.06, -0.3], 4),
        ([0.2] * 6, 0),
        ([0.01] * 6, 5),  # of the last sample at least
    ],
)
def test_a_slide_begins_when_a_pulley_grips_no_more(slips, first):
    for pulley in PULLEYS:
        found = run({f"slip {pulley}": slips}, samples=20, done=6)
        assert slide(found) == slice(first, 6)


def test_of_a_slide_its_means_are_known():
    channels = {
        "slip driving": [0.01, 0.01, -0.4, -0.6],
        "slip driven": [0.0, 0.0, 0.01, 0.03],
        "axial_force driving": [0.0, 0.0, 50e3, 70e3],
        "axial_force driven": [0.0, 0.0, 30e3, 50e3],
        "driven_speed": [0.0, 0.0, 60.0, 40.0],
    }
    sliding = run(channels, samples=9, done=4, driving_speed=300.0, ratio=2.0)
    known = *shared("slip", "axial_force", "thrust_ratio", "speed_loss"), *AGAINST_SLIP
    assert all(variable.early for variable in known)
    found = values(known, Measured(sliding, slide(sliding), None))
    assert found["slip"] == pytest.approx([-0.5, 0.02])
    assert found["axial_force"] == pytest.approx([60e3, 40e3])
    assert found["thrust_ratio"] == pytest.approx(1.5)
    assert found["speed_loss"] == pytest.approx(1.0 - 2.0 * 50.0 / 300.0)
    assert found["slip_margin"] == pytest.approx(90.0 / carried(0.1, 40e3) - 1.0)
