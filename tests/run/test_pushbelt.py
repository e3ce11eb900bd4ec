"""Runs of the planar pushbelt, as a job asks for them."""

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import outset as given
from cvt_hpc.models.pushbelt.belt import start
from cvt_hpc.models.pushbelt.parameters import inert, string_limit
from cvt_hpc.models.pushbelt.record import judge
from cvt_hpc.models.pushbelt.transient import Transient
from cvt_hpc.physics.geometry import driven_radius
from cvt_hpc.simulation import run_point, simulate
from cvt_hpc.variables import Status, Vibrates

# A belt of few elements between rigid sheaves, clamped and loaded within a quarter of a revolution
BELT = {"elements": 104, "band_high": 1000.0, "sheave_stiffness": np.inf, "rise_time": 0.01, "duration": 0.04}
TORQUES = (0.0, 60.0, 200.0)
PROFILE = {"profile_time": (0.012, 0.018), "load_profile": (1.0, 2.0)}


def job(**values):
    return build_job(
        {"name": "pushbelt", "model": "pushbelt"},
        "pushbelt",
        {**BELT, "most_refinements": 0, "longest_duration": values.get("duration", 0.04)} | values,
    )


@pytest.fixture(scope="module")
def records():
    """By torque at the driving pulley [N m]."""
    return {load: record(load=load) for load in TORQUES}


def record(**values):
    asked = job(**values)
    return run_point(asked, asked.point(0), lambda: None)


def test_push_changes_strands_with_the_torque(records):
    """Geier and Schindler 2007, fig. 4: low torque in t2, high torque in t1."""
    unloaded, loaded = (records[load]["mean_push_force"] for load in (0.0, 60.0))
    assert unloaded[1] > 300.0 > 50.0 > unloaded[0]
    assert loaded[0] > 300.0 > 50.0 > loaded[1]
    assert records[60.0]["largest_push_force"] >= loaded[0]


def test_forces_of_both_strands_give_the_torque(records):
    """Rings pull at the radius of their line; elements push somewhere between rocking edge and head."""
    found, radius = records[60.0], 0.063896 / 1.35
    (t1, t2), (p1, p2) = found["mean_ring_tension"], found["mean_push_force"]
    torque = found["driving_power"] / (100.0 * np.pi)
    ring = radius + 1.5e-3
    least, most = ((t2 - t1) * ring + (p1 - p2) * height for height in (radius, ring + 4e-3))
    # heads do not touch, so that the torque is the least; 2.5e-4: of means while the belt still moves, which are off by
    # -1.8e-4 to 1.7e-4 with dampings of 0 to 4000 N s/m^2, in no order
    assert (1.0 - 2.5e-4) * least < torque < most
    assert torque == pytest.approx(60.0, rel=0.05)  # the driven pulley still swings, by 2.7 N m


def test_power_balance_closes_with_falling_friction_and_damping():
    # the weight of ten times gravity works with 0.7 W, 4e-5 of the driving power
    found = record(load=60.0, friction_gradient=-0.4, transverse_damping=1e6, gravity=-100.0)
    assert found["status"] == Status.DONE and found["unsolved_share"] == 0.0
    drive, damped = found["driving_power"], found["numerical_damping"]
    # what the belt's damping and impacts of elements take are a dozen times and more of what is left open
    assert abs(found["power_residual"]) < 2e-5 < 0.5e-3 < found["belt_loss"] / drive
    assert np.abs(damped).sum() < 1e-5 * drive
    assert found["element_loss"] > 3e-4 * drive


def test_more_torque_than_friction_carries_slips_through(records):
    found = records[200.0]
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips" in found["reason"] and found["slip"][0] < -0.05


def test_a_load_ramp_that_ends_in_gross_slip_tells_what_was_before():
    ramp = {"load_history": "ramp", "load_start": 40.0, "load": 400.0, "duration": 0.1}
    found = record(**ramp)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips through" in found["reason"] and "before: " in found["reason"]
    assert found["simulated_seconds"] < 0.1 and abs(found["slip"][0]) > 0.05
    # Bullinger's limit: it slips once the load is above, and loses half of its speed soon after
    assert 0.0 < found["slip_margin"] < 0.6 and found["slip_loss"] > 0.1
    known = np.isfinite(found["ramp_load"])
    load = found["ramp_load"][known]
    assert load.size >= 3 and (np.diff(load) > 0.0).all() and 40.0 < load[0] < load[-1] < 300.0


def test_a_belt_slips_through_by_the_speed_that_present_radii_give():
    run = Transient(job(load=60.0).point(0), "newton")
    pulleys = run._state.pulleys
    pulleys[[f.DRIVING_RADIUS, f.DRIVEN_RADIUS]] = 0.030, 0.075
    without_slip = pulleys[f.DRIVING_SPEED] * 0.030 / 0.075  # 54 % of what the ratio of the job gives
    for share, words in ((0.9, None), (1.4, None), (0.49, "lost 50%"), (1.51, "gained 50%")):
        pulleys[f.DRIVEN_SPEED] = share * without_slip
        found = run._slipped()
        assert found is None if words is None else words in found


def test_speed_is_lost_by_slip_and_by_radii(records):
    for load, accuracy in ((200.0, 0.02), (60.0, 7e-3)):
        found = records[load]
        # of the rims' speeds; while the load rises, gaps that close make the belt's own differ between the arcs:
        # by 0.6 % after 40 ms, 0.2 % after 80 ms
        assert found["slip_loss"] == pytest.approx(found["slip"][1] - found["slip"][0], abs=accuracy)
    assert records[200.0]["slip_loss"] > 0.1 > found["slip_loss"] > 0.0
    driving, driven = found["running_radius"]
    ratio = (1.0 - found["speed_loss"]) / (1.0 - found["slip_loss"])
    assert ratio == pytest.approx(1.35 * driving / driven, rel=1e-4)


def test_a_force_sets_the_driving_sheave():
    found = record(load=60.0, driving_thrust=18e3, duration=0.06)
    # sheaves creep on, at their rate by what the forces differ
    assert found["axial_force"] == pytest.approx([18e3, 20e3], rel=0.02)
    assert found["status"] == Status.DONE
    # dr/dt = rate (Q - F) of each pulley, and i = r_driven / r_driving
    p = job(load=60.0).point(0)
    driving, driven = (np.array([18e3, 20e3]) - found["axial_force"]) * p["sheave_rate"]
    expected = 1.35 * (driven / p["driven_radius"] - driving / (p["driven_radius"] / 1.35))
    assert found["shift_speed"] == pytest.approx(expected, rel=0.05)


def test_a_longer_run_goes_on_from_a_shorter_one_bit_by_bit():
    coarse = {"load": 60.0, "step": 2e-5, "sampling_rate": 12.5e3, "band_high": 800.0}
    whole, shorter = (Transient(job(**coarse, duration=t).point(0), "newton") for t in (0.068, 0.034))
    shorter.advance(shorter.samples)
    shorter.prolong(job(**coarse, duration=0.068).point(0))
    for run in (whole, shorter):
        assert run.advance(run.samples) is None
    assert whole.done == shorter.done == whole.samples
    assert np.array_equal(whole.displacement, shorter.displacement)
    assert np.array_equal(whole.profiles["push_force"], shorter.profiles["push_force"], equal_nan=True)


def test_a_step_that_is_not_solved_fails_with_time_element_and_contact():
    found = record(load=60.0, most_iterations=2, speed_tolerance=1e-12)
    assert found["status"] == Status.FAILED_NUMERICS and found["simulated_seconds"] < 0.01
    assert "not solved, at the " in found["reason"] and " contact of element " in found["reason"]


def test_a_state_that_is_not_a_number_names_no_contact():
    run = Transient(job(load=60.0).point(0), "newton")
    run._state.pulleys[f.DRIVEN_SPEED] = np.nan
    assert run.advance(1) == (
        Status.FAILED_NUMERICS,
        "the state is not a number, or the equations of a step are singular",
    )


@pytest.mark.parametrize(
    "ramp",
    [{"load_history": "ramp"}, {"speed_history": "ramp", "speed_start": 250.0, "band_high": 800.0}],
    ids=str,
)
def test_load_and_speed_rise_along_a_ramp(ramp):
    run = Transient(job(load=40.0, duration=0.1, **ramp).point(0), "newton")
    assert run.advance(run.samples) is None
    record = judge(run)
    assert run.numerical_doubt(record) is None
    stored = 0.02 * 527.0 * 210.0 if "speed_history" in ramp else 0.0  # [W] by the driven pulley, roughly
    assert record["storing_power"] == pytest.approx(stored, abs=0.3 * stored + 100.0)
    assert 0.97 < record["efficiency"] < 1.0
    assert record["loss"] == pytest.approx((1.0 - record["efficiency"]) * record["driving_power"], abs=80.0)
    name, first, last = (
        ("load", 0.0, 40.0) if "load_history" in ramp else ("driving_speed", 250.0, 100.0 * np.pi)
    )
    values = run.channel(name)[199:]  # from rise_time on
    assert values[0] == pytest.approx(first, abs=1e-3) and values[-1] == pytest.approx(last, rel=1e-4)
    assert np.diff(values) == pytest.approx((last - first) / (values.size - 1), rel=1e-6)
    assert run.channel("driven_speed")[-1] == pytest.approx(run.channel("driving_speed")[-1] / 1.35, rel=0.02)


def profiled(**values):
    run = Transient(job(load=60.0, **values).point(0), "newton")
    assert run.advance(run.samples) is None
    return run


def test_profiles_of_ones_change_no_bit():
    names = "load", "driving_speed", "thrust", "ratio"  # the driving thrust is 0 here
    ones = {f"{name}_profile": (1.0, 1.0) for name in names}
    assert np.array_equal(profiled(profile_time=(0.012, 0.018), **ones).displacement, profiled().displacement)


def test_profiles_shift_the_ratio_and_change_load_speed_and_thrust(tell):
    run = profiled(
        duration=0.12,
        band_high=800.0,
        profile_time=(0.02, 0.05),
        ratio_profile=(1.0, 1.1),
        load_profile=(1.0, 0.5),
        driving_speed_profile=(1.0, 0.9),
        thrust_profile=(1.0, 0.8),
    )
    record = judge(run)
    # also the work of the sheave that is moved counts in the balance, but before the judged part
    assert run.numerical_doubt(record) is None
    half = run.channel("load")[round(0.035 / run.interval) - 1]
    assert half == pytest.approx(45.0) and run.channel("load")[-1] == pytest.approx(30.0)
    assert run.channel("driving_speed")[-1] == pytest.approx(90.0 * np.pi)
    ratio = 1.1 * 1.35
    radius = driven_radius(ratio, run.path.path_length, 0.155) / ratio
    assert run._state.pulleys[f.DRIVING_RADIUS] == pytest.approx(radius, rel=1e-12)
    # the belt runs within 2 % of the ratio, as it does without a shift
    assert run.channel("driving_speed")[-1] / run.channel("driven_speed")[-1] == pytest.approx(
        ratio, rel=0.02
    )
    assert record["axial_force"][1] == pytest.approx(0.8 * 20e3, rel=0.01)
    tell("load in the middle of its course [N m]", half, 45.0)
    tell("driving speed at the end of its course [rad/s]", run.channel("driving_speed")[-1], 90.0 * np.pi)
    tell("ratio after a shift", run.channel("driving_speed")[-1] / run.channel("driven_speed")[-1], ratio)
    tell("driving radius after a shift [m]", run._state.pulleys[f.DRIVING_RADIUS], radius)
    tell("driven axial force as its course ends [N]", record["axial_force"][1], 0.8 * 20e3)
    # Bullinger et al. 2005, eq. 2, at the radius of the start
    carried = 2.0 * 0.09 * record["axial_force"].min() * 0.063896 / 1.35 / np.cos(np.deg2rad(11.0))
    assert record["slip_margin"] == pytest.approx(30.0 / carried - 1.0, rel=1e-3)


def test_what_the_power_balance_may_leave_open():
    """2 % of the losses, beside the 1 W of the equations; the step may damp as much, rotation, and thrust times speed by its length."""
    run = Transient(job(load=60.0).point(0), "newton")
    run.done = run.samples
    run._rows[:] = 100.0 * np.pi  # the driving speed
    radii = 0.063896 / 1.35, 0.063896
    speed, inertia = 100.0 * np.pi * radii[0], 1.214 * (0.013**2 + (0.6612 / 104) ** 2) / 12.0
    rotation = 0.5 * inertia * speed**3 * (radii[0] ** -2 + radii[1] ** -2)
    most = 1.5 * rotation + 1e-4 * 20e3 * speed + 0.02 * 200.0
    for open_power, damped, complaint in (
        (0.99 * 5.0, 0.99 * most, None),
        (-0.99 * 5.0, 0.0, None),
        (1.01 * 5.0, 0.0, "the power balance is open by"),
        (-1.01 * 5.0, 0.0, "the power balance is open by"),
        (0.0, 1.01 * most, "the time step itself damps"),
    ):
        found = {"unsolved_share": 0.0, "driving_power": 19e3, "loss": 200.0}
        found |= {"power_residual": open_power / 19e3, "numerical_damping": np.full(3, damped / 3.0)}
        doubt = run.numerical_doubt(found)
        assert (doubt is None) == (complaint is None)
        if doubt:
            assert doubt[0] == Status.FAILED_NUMERICS and complaint in doubt[1]


def test_super_elements_tilt_as_stiffly_as_their_elements(tell):
    belts = {n: start(given(job(elements=n).point(0)))[0] for n in (104, 216, 432)}
    for name, value in (("angle_stiffness", 5.0), ("angle_damping", 5e-5)):
        for n, belt in belts.items():
            tell(f"{name} of 104 to 432 elements", n * getattr(belt, name), 432 * value)
            assert n * getattr(belt, name) == pytest.approx(432 * value, rel=2e-4)


def test_arcs_are_not_probed():
    assert "strands" in inert(job().point(0))["arc_probes"]


def test_profiles_and_histories_agree_with_the_record(records):
    dataset = simulate(job(load=60.0))
    push, region = dataset["push_force"].values, dataset["region"].values
    for strand, mean in zip(("t1", "t2"), records[60.0]["mean_push_force"], strict=True):
        assert np.nanmean(push[region == strand]) == pytest.approx(mean, abs=30.0)
    for pulley, idle in zip(("driving", "driven"), records[60.0]["idle_arc"], strict=True):
        assert np.mean(push[region == pulley] < 0.02 * push.max()) == pytest.approx(idle, abs=1e-12)
    assert (
        0.9 > records[60.0]["idle_arc"][0] > records[60.0]["idle_arc"][1]
    )  # it presses all along the driven one
    gap, force = dataset["gap"].values, dataset["push_force"].values
    assert (gap[force > 700.0] < 1e-6).all() and np.nanmax(gap) > 1e-6
    assert np.nanmin(dataset["contact_force"].values) >= 0.0


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"speed_history": "ramp", "speed_start": 250.0}, "band_high"),
        ({"elements": 32, "coarse": True, "ratio": 2.5}, "elements"),
        ({"thickness": 0.02}, "thickness"),
        ({"band_high": 1500.0}, "band_high"),
        ({"driving_modal_stiffness": (1e8, -1e8)}, "driving_modal_stiffness"),
        ({"driven_modal_stiffness": (1e8,)}, "driven_modal_stiffness"),
        ({"driven_radius": 0.1}, "driven_radius"),
        ({"sheave_rate": 1e-4}, "sheave_rate"),
        ({"load_start": 1900.0, "load_history": "ramp", "step": 4.9e-5}, "step"),
        ({"friction_law": "table"}, "friction_law"),
        ({"friction_gradient": -0.8, "friction_memory": 0.0}, "step"),
        ({"rise_time": 0.025}, "rise_time"),
        ({"load_profile": (1.0, 2.0)}, "profile_time: expected ascending times from 0 on"),
        (PROFILE | {"load_profile": ((1.0, 2.0), (1.0, 2.0))}, "load_profile: expected a list of numbers"),
        ({"driving_modal_stiffness": ((1e8,), (1e8,))}, "driving_modal_stiffness: expected values above 0"),
        (PROFILE | {"ratio_profile": (1.0, 2.0)}, "band_high: expected at most .* at a ratio of 2.7"),
        (PROFILE | {"load_profile": (1.0,)}, "load_profile: expected as many values as profile_time has, 2"),
        (PROFILE | {"profile_time": (0.018, 0.012)}, "profile_time: expected ascending"),
        (PROFILE | {"profile_time": (0.012, 9.0)}, "duration: expected 9 s or more, the end of profile_time"),
        (PROFILE | {"thrust_profile": (1.0, 0.0)}, "thrust_profile: expected multiples above 0, found 0"),
        (PROFILE | {"load_history": "ramp"}, "load_history: expected constant where there are profiles"),
        (PROFILE | {"ratio_profile": (1.1, 1.0)}, "ratio_profile: expected 1 at first"),
        (PROFILE | {"ratio_profile": (1.0, 9.0)}, "elements: expected at least .* at a ratio of 12.15"),
        (
            PROFILE | {"ratio_profile": (1.0, 1.2), "outer_radius": 0.065},
            "ratio_profile: expected radii within the sheaves, 0 to 0.065 m, found 1.62, and with it radii of",
        ),
    ],
)
def test_what_cannot_be_is_refused(values, key):
    with pytest.raises(InputError, match=key):
        job(load=60.0, **values).point(0)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ("belt.play=-0.1 mm", "[belt] play: expected >= 0 mm, found"),  # elements overlap
        (
            "belt.thickness=6.4 mm",
            "[belt] thickness: expected 0.00629714 to 0.00635769 m, so that the elements fit",
        ),
        (
            "belt.play=7 mm",
            "[belt] play: expected less than the pitch of the elements, 0.006358 m, found 0.007 m",
        ),
        (
            "scene.belt_length=300 mm",
            "[scene] belt_length: expected more than 0.31 m, twice the centre distance",
        ),
        ("scene.ratio=0.3", "[scene] ratio: expected pulleys that do not overlap"),
        (
            "sheaves.outer_radius=60 mm",
            "[scene] ratio: expected radii within the sheaves, 0 to 0.06 m, found 1.35",
        ),
        (
            "sheaves.inner_radius=5 cm",
            "[scene] ratio: expected radii within the sheaves, 0.05 to inf m, found 1.35",
        ),
        ("belt.ring_mass=-1 kg/m", "[belt] ring_mass: expected > 0 kg/m, found"),
        ("belt.edge_stiffness=-1 N", "[belt] edge_stiffness: expected > 0 N, found"),
        ("sheaves.flank_stiffness=0", "[sheaves] flank_stiffness: expected > 0 N/m^2, found"),
        ("belt.elements=60", "[belt] elements: expected 100 or more, or coarse = true, found 60"),
        (
            "numerics.step=1 ms",
            "[numerics] step: expected at most 0.000122 s, pitch over the speed of transverse",
        ),
    ],
)
def test_bad_input_is_told_in_a_line_and_nothing_is_computed(
    values, complaint, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    table, assignment = values.split(".", 1)
    key, value = assignment.split("=")
    text = {"belt": {"elements": 104}, "vibration": {"band_high": 1000}}
    text.setdefault(table, {})[key] = value if " " in value else float(value) if "." in value else int(value)
    lines = ['name = "x"', 'model = "pushbelt"']
    for name, entries in text.items():
        lines += [f"[{name}]", *(f"{k} = {v!r}" for k, v in entries.items())]
    (tmp_path / "x.toml").write_text("\n".join(lines).replace("'", '"'))
    assert main(["run", "x.toml"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith(f"cvt-hpc: x.toml: {complaint}"), err
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]


def test_the_longest_step_is_that_of_the_strand():
    """Beyond pitch / sqrt(T / m) a strand's shortest waves grow; the limit named in errors keeps below that."""
    p = job(load=60.0).point(0)
    tension = record(load=60.0)["mean_ring_tension"].max()
    exact = 0.6612 / 104 * np.sqrt((1.214 + 0.2495) / tension)
    assert 0.6 * exact < string_limit(p) < exact


def test_elements_pass_as_often_as_the_belt_goes_round(records):
    """104 elements on the way around a path of 0.6612 m at the speed of the pitch line."""
    path, radius = 0.6612, 0.063896 / 1.35
    passing = records[60.0]["passing_frequency"]
    assert passing == pytest.approx(104 * 100.0 * np.pi * radius / path, rel=0.01)
