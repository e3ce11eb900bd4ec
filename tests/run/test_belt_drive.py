"""Runs of the belt drive, as a job asks for them."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive import start, transient
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.models.belt_drive.readings import Readings
from cvt_hpc.models.belt_drive.record import cost
from cvt_hpc.models.belt_drive.transient import Transient
from cvt_hpc.physics.geometry import variator
from cvt_hpc.simulation import run_point, simulate
from cvt_hpc.variables import Status, Vibrates

# Large pulleys near to each other and a soft contact, so that few elements follow the arcs; a belt that bends easily, of
# which the theories of creep and of Euler and Eytelwein know nothing; a turn of the belt in the judged half
SCENE = {
    "driven_radius": 0.1,
    "centre_distance": 0.22,
    "elements": 32,
    "driving_speed": 80.0,
    "bending_stiffness": 2.6e-3,
    "contact_stiffness": 1.2e8,
    "duration": 0.3,
    "longest_duration": 0.3,
    "most_refinements": 0,
    "amplitude_threshold": 0.01,  # coarse elements shake the strands
}
# what friction carries at most, by Euler and Eytelwein less the centrifugal force: 2 (T0 - m v^2) R tanh(mu pi / 2)
TENSION, RADIUS, SPEED, MU = 310.0, 0.1, 80.0 * 0.1, 0.5
CENTRIFUGAL = 0.096 * SPEED**2  # [N]
SLIP_TORQUE = 2.0 * (TENSION - CENTRIFUGAL) * RADIUS * np.tanh(0.5 * np.pi * MU)


def job(**values):
    return build_job({"name": "belt_drive", "model": "belt_drive"}, "belt_drive", SCENE | values)


def record(**values):
    asked = job(**values)
    return run_point(asked, asked.point(0), lambda: None)


@pytest.fixture(scope="module")
def loaded():
    """History of a run at 0.45 of the slip torque."""
    return simulate(job(load=0.45 * SLIP_TORQUE), {})


def test_defaults_are_the_ten_values_of_the_paper(tell):
    # Cepon and Boltezar 2011, table 1: two equal pulleys, and a belt of five ribs
    given = build_job({"name": "belt_drive", "model": "belt_drive"}, "belt_drive", {}).point(0)
    ribs = {"axial_stiffness": 30.4e3, "axial_damping": 4.1, "bending_stiffness": 5.2e-3}
    wanted = {"driven_radius": 0.05, "driven_inertia": 0.013, "centre_distance": 0.45, "line_mass": 0.096}
    wanted |= {name: 5.0 * value for name, value in ribs.items()}
    wanted |= {"mass_damping": 2.8, "bending_damping": 1.8e-3}
    assert {name: given[name] for name in wanted} == pytest.approx(wanted, rel=1e-12)
    tell("nine values over those of table 1", [given[name] / wanted[name] for name in wanted], 1.0)
    tell("length of the belt [m]", layout(given).path.path_length)
    # its tenth value is the length, printed as 1.2 m
    assert round(layout(given).path.path_length, 1) == 1.2


def stretch(tension, stiffness=152e3):
    """Length over that without load, EA (x^2 - 1) x / 2 = T to the second order."""
    return 1.0 + tension / stiffness - 1.5 * (tension / stiffness) ** 2


def test_speed_is_lost_by_creep_and_radial_compliance(loaded):
    """The belt sticks where it runs onto a pulley: w (R - depth) / stretch is the same on both."""
    tension = loaded.strand_tension.values
    depth = (tension - CENTRIFUGAL) / (RADIUS * SCENE["contact_stiffness"])
    ratio = np.prod((stretch(tension) / (RADIUS - depth)) ** [1.0, -1.0])
    assert loaded.turns == 1
    assert float(loaded.speed_loss) == pytest.approx(1.0 - ratio, rel=0.02)


def test_tensions_and_powers(loaded):
    t1, t2 = loaded.strand_tension.values
    torque = 0.45 * SLIP_TORQUE
    assert (t2 - t1) * RADIUS == pytest.approx(torque, rel=0.02)
    assert float(loaded.load_power) == pytest.approx(torque * 80.0, rel=5e-3)
    assert abs(float(loaded.power_residual)) < 2e-3 and loaded.unsolved_share < 0.02
    assert (loaded.friction_loss > 0.0).all() and 0.98 < loaded.efficiency < 1.0


@pytest.mark.parametrize(("pulley", "sign"), [("driving", -1.0), ("driven", 1.0)])
def test_tension_changes_as_an_exponential_where_the_belt_slides(loaded, pulley, sign):
    """Euler and Eytelwein: d(T - m v^2) / dphi = mu (T - m v^2) up to the outlet; before it the belt sticks."""
    part = loaded.isel(position=loaded.region.values == pulley)
    share = (part.friction_force / part.normal_force).values
    angle, tension = part.position.values / RADIUS, part.tension.values
    slides = share * sign < -0.5 * MU  # forwards on the driving pulley
    least, most = np.sort(loaded.strand_tension.values) - CENTRIFUGAL
    expected = np.log(most / least) / MU
    # within strips of 2.5 degrees, in an element of 19 degrees
    assert slides.sum() * np.diff(angle).mean() == pytest.approx(expected, abs=0.1)
    fully = (share * sign < -0.98 * MU) & (angle < angle[-1] - 0.35)  # without the element that leaves
    slope = np.polyfit(angle[fully], np.log(tension[fully] - CENTRIFUGAL), 1)[0]
    assert slope == pytest.approx(sign * MU, rel=0.06)  # tension waves by a few percent within an element
    assert np.abs(share[12:20]).mean() < 0.1 * MU


def test_more_torque_than_friction_carries_slips_through():
    found = record(load=1.15 * SLIP_TORQUE, driven_inertia=1e-3)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips through: the driven pulley has lost 50%" in found["reason"]
    assert (
        found["unsolved_share"] == 0.0 and abs(found["power_residual"]) < 2e-3 and not found["lifted"].any()
    )
    assert found["driving_power"] > found["load_power"] > 0.0 > found["storing_power"]


def test_a_load_that_drives_more_than_friction_carries_slips_through():
    found = record(load=-1.15 * SLIP_TORQUE, driven_inertia=1e-3)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "the driven pulley has gained 50%" in found["reason"]


def test_a_breakdown_of_the_steps_is_no_slip():
    """Steps of 0.5 ms are not solved, and the pulleys fly apart at once."""
    long = {"elements": 48, "step": 5e-4, "load": 8.0, "most_refinements": 0}
    asked = build_job({"name": "x", "model": "belt_drive"}, "x", long)
    found = run_point(asked, asked.point(0), lambda: None)
    assert found["status"] == Status.FAILED_NUMERICS and found["vibrates"] == Vibrates.UNDECIDED
    assert "of the steps were not solved, and then the belt slips through" in found["reason"]
    assert found["simulated_seconds"] < 0.01


@pytest.mark.parametrize(("unsolved", "status"), [(1, Status.DONE), (3, Status.FAILED_NUMERICS)])
def test_steps_that_are_not_solved_before_an_early_end_count(unsolved, status):
    """Of 100 in the last 10 ms, 2; of all 25 000 they are few."""
    run = Transient(job().point(0), "cyclic_alpha")
    run.done = 400
    run._state.counters[:] = 25_000, 0, 100
    run._unsolved[:] = 100 - unsolved
    assert run._early_end("why")[0] == status


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"elements": 15},
            "[belt] elements: expected at least 16, four on the shorter arc and two on a strand, found 15",
        ),
        (
            {"tension": 1e5},
            "[belt] tension: expected at most 76000 N, half of axial_stiffness, found 100000 N",
        ),
        ({"centre_distance": 0.19}, "[scene] ratio: expected pulleys that do not overlap"),
        (
            {"rise_time": 0.2},
            "[scene] rise_time: expected a load that has risen before the run is judged, within 0.15 s, found 0.2 s",
        ),
        (
            {"contact_stiffness": 1e6, "ratio": 1.25, "driven_radius": 0.05},
            "[contact] contact_stiffness: expected at least 1.9375e+06 N/m^2",
        ),
    ],
)
def test_drives_that_cannot_be_are_refused(values, message):
    with pytest.raises(InputError) as caught:
        job(**values)
    assert message in str(caught.value)


def test_a_belt_on_the_softest_contacts_starts_with_its_tension():
    """10 tension / R^2 of the smaller pulley: the contacts give way 19 times as much as the belt."""
    p = job(contact_stiffness=1.94e6, ratio=1.25, driven_radius=0.05, centre_distance=0.15).point(0)
    drawn = layout(p)
    where = Readings(p, drawn)
    made, begun, is_settled = start.start(p, drawn, where.mean_tension)
    # terms of the second order leave this much after three corrections; without the contacts' part it is 0.5
    assert is_settled and where.mean_tension(made, begun) == pytest.approx(p["tension"], rel=1e-3)


def test_strands_vibrate_within_the_band_of_the_defaults():
    """The first three modes of a string: n / (2 l) sqrt(T / m)."""
    p = build_job({"name": "x", "model": "belt_drive"}, "x").point(0)
    strand = variator(p["ratio"], p["driven_radius"], p["centre_distance"]).strand_length
    modes = np.arange(1, 4) / (2.0 * strand) * np.sqrt(p["tension"] / p["line_mass"])
    assert (p["band_low"] < modes).all() and (modes < p["band_high"]).all()
    assert p["window_length"] > 2.0 / p["band_low"] and p["sampling_rate"] == 4.0 * p["band_high"]


def test_a_step_is_no_longer_than_a_sample_in_the_cost_of_a_run():
    fast = job(sampling_rate=20e3, step=1e-4).point(0)
    halved = fast | {"step": 5e-5}
    assert cost(fast, "cyclic_alpha") == cost(halved, "cyclic_alpha") < cost(fast | {"step": 2.5e-5}, "x")


def test_a_belt_without_equilibrium_is_a_failed_run(monkeypatch):
    monkeypatch.setattr(start, "MOST_STEPS", 2)
    found = simulate(job(most_refinements=3), {})
    assert found.status == Status.FAILED_NUMERICS and found.sizes["time"] == 0
    assert found.refinements == 0  # no shorter step would help
    assert str(found.reason.values).startswith("at 0 ms: the belt finds no equilibrium on its pulleys")


def test_what_is_not_to_be_trusted_is_named():
    run = Transient(job().point(0), "cyclic_alpha")
    sound = {"unsolved_share": 0.0, "power_residual": 1e-3, "vibrates": Vibrates.NO}
    assert run.numerical_doubt(sound) is None
    for doubt, words in (({"unsolved_share": 0.03}, "not solved"), ({"power_residual": np.nan}, "balance")):
        status, why = run.numerical_doubt(sound | doubt)
        assert status == Status.FAILED_NUMERICS and words in why


def test_a_longer_run_goes_on_from_a_shorter_one_bit_by_bit():
    whole, shorter = (Transient(job(duration=t).point(0), "cyclic_alpha") for t in (0.27, 0.26))
    for run in (whole, shorter):
        run.advance(20)
    shorter.prolong(job(duration=0.27).point(0))
    for run in (whole, shorter):
        run.advance(20)
    assert (whole.displacement == shorter.displacement).all()


@pytest.mark.parametrize("tension", [120.0, 500.0])
def test_the_mesh_alone_may_shake_the_belt(tension):
    """What elements miss goes with their fourth power: as many as are needed shake by less than the threshold."""
    values = {"amplitude_threshold": 1e-4, "elements": 64, "bending_stiffness": 0.026, "most_refinements": 3}
    told = {"unsolved_share": 0.0, "power_residual": 0.0, "vibrates": Vibrates.YES}
    told["strand_tension"] = np.array([tension, 100.0])
    run = Transient(job(**values).point(0), "cyclic_alpha")
    h, pull = run.path.path_length / 64, tension - CENTRIFUGAL
    shaken = 0.02 * h**4 * pull / (0.026 * RADIUS)
    assert run.numerical_doubt(told | {"amplitude": np.array([1.01 * shaken, 0.0])}) is None
    assert run.numerical_doubt(told | {"amplitude": np.zeros(2), "vibrates": Vibrates.NO}) is None
    status, why = run.numerical_doubt(told | {"amplitude": np.array([0.99 * shaken, 0.0])})
    needed = int(np.ceil(64 * (shaken / 1e-4) ** 0.25))
    assert status == Status.FAILED_NUMERICS and f": {needed} elements or more" in why
    assert run.parameters["most_refinements"] == 0
    run = Transient(job(**values | {"elements": needed}).point(0), "cyclic_alpha")
    assert run.numerical_doubt(told | {"amplitude": np.full(2, 1e-4)}) is None


def test_a_run_that_the_mesh_shakes_fails_once():
    found = record(amplitude_threshold=1e-5, most_refinements=3, duration=0.26, rise_time=0.05)
    assert found["status"] == Status.FAILED_NUMERICS and found["refinements"] == 0
    assert "the mesh alone may shake the belt by" in found["reason"]


def test_a_prolonged_run_is_kicked_once(monkeypatch):
    kicks = []
    monkeypatch.setattr(transient, "kick", lambda *given: kicks.append(given))
    p = job(kick=0.02).point(0) | {"duration": 0.01, "rise_time": 0.002}
    run = Transient(p, "cyclic_alpha")
    run.advance(20)
    run.prolong(p | {"duration": 0.02})
    run.advance(20)
    assert run.done == 40 and len(kicks) == 1 and run.kicked == slice(10, 20)


def test_whole_turns_with_a_ripple_are_whole_periods():
    """A turn takes 133 ms: of 300 ms two turns are judged, or as many periods of 70 ms as come near to them."""
    run = Transient(job(duration=0.6, longest_duration=0.6).point(0), "cyclic_alpha")
    turn = run.path.path_length / (80.0 * RADIUS)
    assert run.turns == 2
    for values, length in (
        ({}, 2.0 * turn),
        ({"speed_ripple": 1.0, "ripple_frequency": 1 / 0.07}, 0.28),
        ({"speed_ripple": 1.0, "ripple_frequency": 1 / 0.19}, 0.19),
        ({"speed_ripple": 1.0, "ripple_frequency": 1.0}, 2.0 * turn),  # no period is judged: whole turns
    ):
        run.parameters = run.parameters | values
        part = run.whole_turns
        assert part.stop == run.samples == 1200
        assert (part.stop - part.start) * run.interval == pytest.approx(length, abs=0.6 * run.interval)
