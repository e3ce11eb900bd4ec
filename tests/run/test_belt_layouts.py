"""Drives of other layouts: crossed, of three pulleys, with a tensioner; speed profiles; what is refused."""

import re

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from cvt_hpc.analysis.histories import history_figure
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive.courses import length_at
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.models.belt_drive.pulleys import arms_energy, axes
from cvt_hpc.models.belt_drive.readings import Reading, Readings, stored_energy
from cvt_hpc.models.belt_drive.start import start
from cvt_hpc.physics.belt_path import belt_path, span_starts, tangents
from cvt_hpc.printing import outcome_lines
from cvt_hpc.simulation import simulate
from cvt_hpc.variables import Status, Vibrates
from support.outcomes import outcomes_of

# coarse elements shake the strands
SHORT = {"duration": 0.25, "longest_duration": 0.25, "most_refinements": 0, "amplitude_threshold": 0.01}
# a belt that bends easily around two large pulleys, and a tensioner that presses it inwards on its slack side
PULLEYS = {
    "pulley_x": (0.0, 0.12, 0.24),
    "pulley_y": (0.0, -0.1, 0.0),
    "pulley_radius": (0.1, 0.04, 0.1),
    "pulley_turn": (1.0, -1.0, 1.0),
    "pulley_inertia": (0.0, 1e-4, 0.005),
    "pulley_load": (0.0, 0.0, 1.0),
}
TENSIONER = {
    "tensioner_pulley": (2.0,),
    "tensioner_x": (0.2,),
    "tensioner_y": (-0.1,),
    "tensioner_inertia": (2e-3,),
    "tensioner_stiffness": (40.0,),
    "tensioner_damping": (0.5,),
    "tensioner_lowest": (-0.4,),
    "tensioner_highest": (0.4,),
}
STRUT = {
    "strut_fixed_x": (0.16,),
    "strut_fixed_y": (-0.3,),
    "strut_held_x": (0.12,),
    "strut_held_y": (-0.1,),
    "strut_stiffness": (8e3,),
    "strut_damping": (60.0,),
}
SERPENTINE = (
    PULLEYS
    | TENSIONER
    | {"elements": 64, "bending_stiffness": 2.6e-3, "contact_stiffness": 1.2e8, "contact_damping": 200.0}
)


def job(**values):
    return build_job({"name": "x", "model": "belt_drive"}, "x", SHORT | values)


def begun(**values):
    """Parameters, readings, drive and state of a start."""
    p = job(**values).point(0)
    drawn = layout(p)
    where = Readings(p, drawn)
    drive, state, is_settled = start(p, drawn, where.mean_tension)
    assert is_settled
    return p, where, drive, state


def turned(drawn, pivot, angle):
    """The path with the tensioner's arm turned."""
    centre = drawn.path.centre.copy()
    sine, cosine = np.sin(angle), np.cos(angle)
    centre[1] = pivot + np.array([[cosine, -sine], [sine, cosine]]) @ (centre[1] - pivot)
    return belt_path(centre, drawn.path.radius, drawn.path.turn)


def lengthening(drawn, pivot, angle):
    """Slope of the path's length by the arm's angle [m]."""
    h = 1e-6
    return (turned(drawn, pivot, angle + h).path_length - turned(drawn, pivot, angle - h).path_length) / (
        2 * h
    )


@pytest.fixture(scope="module")
def held():
    return begun(**SERPENTINE)


def test_the_spring_holds_the_arm_where_it_is_drawn(held):
    """By virtual work its moment is the tension times the slope of the path's length; bending is some 0.5 %."""
    p, where, drive, state = held
    exact = p["tension"] * lengthening(where.drawn, drive.pulleys.arms.pivot[0], 0.0)
    assert where.mean_tension(drive, state) == pytest.approx(p["tension"], rel=1e-3)
    assert float(drive.pulleys.arms.moment[0]) == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("strut", [{}, STRUT])
def test_a_given_spring_turns_the_arm_into_equilibrium(held, strut):
    """Where its moment is T dL/dangle, with the tension of a belt of one length."""
    p, where, drive, _ = held
    pivot, moment = drive.pulleys.arms.pivot[0], 2.0 * float(drive.pulleys.arms.moment[0])
    length = length_at(where.drawn.path, p["tension"], p)

    def tension(angle):
        path = turned(where.drawn, pivot, angle)
        return brentq(lambda force: length_at(path, force, p) - length, -2e4, 5e4)

    _, found, released, state = begun(**SERPENTINE, **strut, tensioner_moment=(moment,))

    def open_moment(angle):
        arms, h = released.pulleys.arms, 1e-6
        less, more = (arms_energy(arms, np.array([angle + side]), np.zeros(1)) for side in (-h, h))
        return (less - more) / (2 * h) - tension(angle) * lengthening(where.drawn, pivot, angle)

    angle = brentq(open_moment, -0.08, 0.04)
    assert abs(angle) > 5e-3
    assert state.wheels.angle[0, 0] == pytest.approx(angle, rel=0.02)
    assert found.mean_tension(released, state) == pytest.approx(tension(angle), rel=0.02)
    # displacement counts from where the spans run: the arm's motion is none of theirs
    moved = turned(where.drawn, pivot, float(state.wheels.angle[0, 0]))
    starts, ends = tangents(moved.centre, moved.radius, moved.turn)
    np.testing.assert_allclose(starts, span_starts(moved), atol=1e-12)
    np.testing.assert_allclose(np.hypot(*(ends - starts).T), moved.spans, rtol=1e-12)
    np.testing.assert_allclose(axes(released.pulleys, state.wheels.angle[0]), moved.centre, atol=1e-12)
    chords = found.chords(released, state)
    away = np.abs(Reading(found, released, state).displacement)
    assert (away < 0.05 * np.abs(chords).max()).all() and np.abs(chords).max() > 2e-4


def test_arms_store_energy(held):
    """I w^2 / 2 of the speed; of the angle k angle^2 / 2, less what the spring's moment gives."""
    _, _, drive, state = held
    rest, count = stored_energy(drive, state), len(drive.pulleys.radius)
    arms, (angle, rate) = drive.pulleys.arms, (0.01, 3.0)
    state.wheels.speed[0, count] += rate
    state.wheels.angle[0, 0] += angle
    gained = stored_energy(drive, state) - rest
    state.wheels.speed[0, count] -= rate
    state.wheels.angle[0, 0] -= angle
    expected = 0.5 * 2e-3 * rate**2 + 0.5 * 40.0 * angle**2 - float(arms.moment[0]) * angle
    assert gained == pytest.approx(expected, rel=1e-6)


def test_a_belt_of_a_given_length_has_its_tension(held):
    p, where, drive, _ = held
    length = float(drive.beam.lengths.sum())
    given = job(**SERPENTINE, free_length=length).point(0)
    assert given["tension"] == pytest.approx(p["tension"], rel=0.01)  # of bending EI / R^2


COURSES = {
    "driving_speed": 60.0,
    "driving_speed_profile": (0.0, 1.0),
    "profile_time": (0.0, 0.1),
    "speed_ripple": 5.0,
    "load": 8.0,
    "load_profile": (0.5, 1.0),
}


@pytest.fixture(scope="module")
def started():
    """From rest to 60 rad/s and a ripple, with a tensioner."""
    return simulate(job(**SERPENTINE, **COURSES), {})


def test_a_drive_starts_from_rest_and_follows_its_courses(started):
    time = started.time.values
    ramp = np.where(time < 0.1, 600.0 * time, 60.0 + 5.0 * np.sin(80.0 * np.pi * (time - 0.1)))
    np.testing.assert_allclose(started.driving_speed.values, ramp, rtol=1e-12)
    assert list(started.strand.values) == ["P1-P2", "P2-P3", "P3-P1"]
    risen = time > 0.1  # rise_time; before, half of the load rises
    np.testing.assert_allclose(started["load"].values[risen], 8.0, rtol=1e-12)
    first = started["speed_P3"].values[0]
    assert 0.0 <= first < 1.0 and started["speed_P3"].values[-1] == pytest.approx(ramp[-1], rel=0.1)
    # the tensioner's pulley turns the other way, by its radius
    assert float(started["speed_P2"][-100:].mean()) == pytest.approx(2.5 * ramp[-100:].mean(), rel=0.01)


def test_powers_of_a_drive_with_a_tensioner_are_in_balance(started):
    assert started.status == Status.DONE and abs(float(started.power_residual)) < 4e-3
    assert float(started.efficiency) == pytest.approx(1.0 - float(started.loss / started.driving_power))
    assert float(started.arm_loss) > 0.0 and float(started.arm_ripple[1]) > 1e-4
    assert np.isnan(started.arm_angle.values[[0, 2]]).all() and float(started.stop_share[1]) == 0.0


def test_a_tensioner_evens_out_the_slack_spans(started):
    """Tension rises in the span that runs to the driving pulley; beside the tensioner it changes less."""
    judged = started.isel(time=slice(started.sizes["time"] // 2, None))
    for k, strand in enumerate(started.strand.values):
        ripple = judged[f"tension_{strand}"].values.std()
        assert float(started.tension_ripple[k]) == pytest.approx(ripple, rel=1e-3)
    slack, behind, tight = started.strand_tension.values
    assert tight - 0.5 * (slack + behind) == pytest.approx(8.0 / 0.1, rel=0.05)
    assert (started.tension_ripple.values[:2] < 0.8 * started.tension_ripple.values[2]).all()


def test_a_mirrored_drive_turns_the_other_way(started):
    """Nothing tells left from right but the signs; rounding alone differs."""
    mirrored = {"pulley_y": (0.0, 0.1, 0.0), "pulley_turn": (-1.0, 1.0, -1.0), "tensioner_y": (0.1,)}
    found = simulate(job(**SERPENTINE | COURSES | mirrored), {})
    for name in ("strand_tension", "slip", "friction_loss", "driven_speed", "friction_force"):
        np.testing.assert_allclose(found[name], started[name], rtol=1e-6, atol=1e-9)
    for name in ("arm_angle", "displacement"):
        np.testing.assert_allclose(-found[name], started[name], rtol=1e-6, atol=1e-12)


def test_a_file_gives_the_pulleys(tmp_path):
    lines = ["x [mm],y [mm],radius [mm],turn,inertia [kg m^2],load", "0,0,100,1,0,0", "120,-100,40,-1,1e-4,0"]
    (tmp_path / "pulleys.csv").write_text("\n".join([*lines, "240,0,100,1,5e-3,1"]))
    tables = {"layout": {"pulley_file": "pulleys.csv"}, "belt": {"elements": 64}}
    found = build_job({"name": "x", "model": "belt_drive"} | tables, str(tmp_path / "x.toml")).point(0)
    assert {key: found[key] for key in PULLEYS} == PULLEYS


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("120,-100,0,-1,1e-4,0", "pulleys.csv: line 3: expected radius: a radius above 0, found 0 m"),
        ("120,-100,40,-1,0,0", "pulleys.csv: line 3: expected inertia: moments of inertia above 0"),
        ("120,-100,400,-1,1e-4,0", "pulleys.csv: pulley_x: expected pulleys that do not overlap"),
    ],
)
def test_a_fault_in_a_file_is_told_by_its_line(tmp_path, row, message):
    lines = ["x [mm],y [mm],radius [mm],turn,inertia [kg m^2],load", "0,0,100,1,0,0", row]
    (tmp_path / "pulleys.csv").write_text("\n".join([*lines, "240,0,100,1,5e-3,1"]))
    with pytest.raises(InputError) as caught:
        build_job(
            {"name": "x", "model": "belt_drive", "layout": {"pulley_file": "pulleys.csv"}},
            str(tmp_path / "x"),
        )
    assert message in str(caught.value)


def test_what_is_per_pulley_is_printed(started):
    """However many pulleys there are; of arms those that are there."""
    lines = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in outcome_lines(outcomes_of(started)))
    assert lines["arm angle"].startswith("P2 ") and "P1" not in lines["arm angle"]
    assert lines["slip"].count("P") == 3 and "spectrum" not in lines
    wider = xr.Dataset({"status": started.status, "slip": ("pulley", np.arange(9.0), {"units": "1"})})
    (slip,) = (
        line
        for line in outcome_lines(outcomes_of(wider.assign_coords(pulley=np.arange(9))))
        if "slip" in line
    )
    assert slip.endswith("7 7, 8 8")


def test_a_crossed_belt_turns_the_driven_pulley_the_other_way():
    values = {"driven_radius": 0.1, "centre_distance": 0.3, "elements": 40, "bending_stiffness": 2.6e-3}
    found = simulate(job(**values, crossed=True, load=10.0, contact_stiffness=1.2e8), {})
    t1, t2 = found.strand_tension.values
    assert (t2 - t1) * 0.1 == pytest.approx(10.0, rel=0.03)
    late = 1.0 - found.driven_speed.values[-250:].mean() / 62.8
    assert found.turns == 0 and np.isnan(found.speed_loss)  # 0.125 s are judged, a turn takes longer
    assert 0.0 < late < 2e-3 and abs(float(found.power_residual)) < 4e-3
    assert float(found.load_power) == pytest.approx(10.0 * 62.8, rel=5e-3)
    assert found.driven_speed.values[-1] > 0.0  # forwards along the belt


def test_an_arm_at_its_stop_is_told():
    narrow = {"tensioner_lowest": (-2e-3,), "tensioner_highest": (2e-3,), "tensioner_moment": (-40.0,)}
    found = simulate(job(**SERPENTINE | narrow), {})
    assert float(found.stop_share[1]) == 1.0 and 2e-3 < abs(float(found.arm_angle[1])) < 8e-3


def test_a_tensioner_that_turns_away_lets_the_belt_go():
    p, _, drive, _ = begun(**SERPENTINE)
    away = {"tensioner_moment": (-float(drive.pulleys.arms.moment[0]),)}
    found = simulate(job(**SERPENTINE, **away), {})
    assert (found.status, found.vibrates) == (Status.DONE, Vibrates.SLIPS)
    assert "lifts off: it has not touched the P2 pulley" in str(found.reason.values)
    assert list(found.lifted.values) == [0.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"pulley_y": (0.0, 0.1)}, "[layout] pulley_y: expected as many values as pulley_x has, 3, found 2"),
        (
            {"pulley_turn": (1.0, 0.5, 1.0)},
            "[layout] pulley_turn: expected 1 or -1 for each pulley, found 0.5",
        ),
        (
            {"pulley_y": (0.0, 0.1, 0.0), "pulley_turn": (1.0, 1.0, 1.0)},
            "[layout] pulley_turn: expected a belt that closes on its pulleys",
        ),
        ({"pulley_x": (0.0, 0.12, 0.19)}, "[layout] pulley_x: expected pulleys that do not overlap"),
        ({"pulley_load": (1.0, 0.0, 1.0)}, "[layout] pulley_load: expected 0 of the first pulley"),
        ({"pulley_load": (0.0, 0.0, 0.0)}, "[layout] pulley_load: expected a value other than 0"),
        ({"pulley_x": (0.0, 0.1)}, "[layout] pulley_x: expected as many values as pulley_y has, 3, found 2"),
        (
            {"crossed": True},
            "[scene] crossed: expected none beside pulley_x, which gives all pulleys, found true",
        ),
        ({"centre_distance": 0.5}, "[scene] centre_distance: expected none beside pulley_x"),
        (
            {"tensioner_pulley": ()},
            "[tensioner] tensioner_pulley: expected as many values as tensioner_x has, 1, found none",
        ),
        ({"tensioner_highest": (0.0,)}, "[tensioner] tensioner_lowest: expected travel on both sides"),
        (
            {"tensioner_pulley": (1.0,)},
            "[tensioner] tensioner_pulley: expected different whole numbers, 2 to 3",
        ),
        (
            {"tensioner_damping": ()},
            "[tensioner] tensioner_damping: expected as many values as tensioner_pulley",
        ),
        (
            STRUT | {"strut_held_x": ()},
            "[tensioner] strut_held_x: expected as many values as tensioner_pulley",
        ),
        (
            STRUT | {"strut_held_x": (0.2,)},
            "[tensioner] strut_held_x: expected a spring that does not point at the pivot",
        ),
        ({"free_length": 1.5}, "[belt] free_length: expected more than"),
        ({"profile_time": (0.1, 0.0)}, "[profiles] profile_time: expected ascending times"),
        (
            {"pulley_x": (0.0, 5.0, 10.0), "pulley_radius": (0.1, 0.005, 0.1)},
            "; but at most 2048 are permitted: on the belt of 20.63 m none may be longer than 0.0025 m, found 64",
        ),
        ({"elements": 24}, "[belt] elements: expected at least 63, which turn by half a radian"),
        (
            {"profile_time": (0.0,), "driving_speed_profile": (0.5,)},
            "[profiles] driving_speed_profile: expected 1 at last",
        ),
        (
            {"load_profile": (1.0,)},
            "[profiles] profile_time: expected as many values as load_profile has, 1, found none",
        ),
        ({"pulley_y": ((0.0, 0.1, 0.0),)}, "[layout] pulley_y: expected a list of numbers"),
        ({"profile_time": ((0.0,),)}, "[profiles] profile_time: expected a list of numbers"),
    ],
)
def test_layouts_that_cannot_be_are_refused(values, message):
    with pytest.raises(InputError) as caught:
        job(**SERPENTINE | values)
    assert message in str(caught.value)


def test_lists_in_other_units_are_refused_alike():
    values = {key: [f"{1e3 * value:g} mm" for value in SERPENTINE[key]] for key in ("pulley_x", "pulley_y")}
    with pytest.raises(InputError, match="pulley_y: expected as many values as pulley_x has, 3, found 2"):
        job(**SERPENTINE | values | {"pulley_y": ["0 mm", "5 mm"]})


def test_a_picture_shows_forces_speeds_and_arms(started):
    panels = [axes.get_ylabel().split(" [")[0] for axes in history_figure(started).axes]
    assert [name for name in panels if name in ("tension", "speed", "arm")] == ["tension", "speed", "arm"]
