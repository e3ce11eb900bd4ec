"""Runs of the spatial pushbelt, as a job asks for them."""

import re

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.parameters import most_tension, path_length, string_limit
from cvt_hpc.models.spatial_pushbelt import fields
from cvt_hpc.models.spatial_pushbelt.parameters import roll_limit
from cvt_hpc.models.spatial_pushbelt.readings import ANGLES, SHEAVES
from cvt_hpc.models.spatial_pushbelt.record import histories, judge
from cvt_hpc.models.spatial_pushbelt.transient import Transient
from cvt_hpc.physics.out_of_plane import axial_offset, clamped_force
from cvt_hpc.simulation import run_point, simulate
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator.history import regions
from support.spatial_belts import COARSE, TORQUE, job
from support.spatial_belts import constants as given

OFFSET = 5e-4  # [m]
BRIEF = {"duration": 0.016, "rise_time": 0.004, "band_low": 700.0}


def record(**values):
    asked = job(**values)
    return run_point(asked, asked.point(0), lambda: None)


@pytest.fixture(scope="module")
def misaligned():
    asked = job(misalignment=OFFSET)
    run = Transient(asked.point(0), "newton")
    run.advance(run.samples)
    return run


def test_both_pulleys_take_the_lateral_force_of_misaligned_strands(misaligned):
    """The force of one pulley is that of the other, and of the order of two clamped strands under their tension."""
    found = judge(misaligned)
    assert misaligned.failure is None and misaligned.counters()["unsolved"] == 0
    driving, driven = found["net_axial_force"]
    # means over 60 ms: 1.2 % found
    assert driving == pytest.approx(-driven, rel=0.02)
    net = (
        found["mean_ring_tension"]
        - found["mean_push_force"]
        - 1.4635 * (100.0 * np.pi * 0.063896 / 1.35) ** 2
    )
    strand, offset = misaligned.path.strand_length, found["final_misalignment"]
    clamped = sum(clamped_force(offset, strand, tension, 47.6, 2.4e6) for tension in net)
    assert found["beam_axial_force"] == pytest.approx([clamped, -clamped], rel=1e-3)
    assert found["string_axial_force"][0] == pytest.approx(net.sum() * offset / strand, rel=1e-3)
    # a belt runs through the arcs' ends, where elements slide and rings turn: not held as a clamped beam is
    assert 0.6 * clamped < driving < clamped
    assert found["sheave_force"].reshape(2, 2).mean(axis=1) == pytest.approx(found["axial_force"])
    assert found["sheave_loss"].reshape(2, 2).sum(axis=1) == pytest.approx(found["flank_loss"])
    assert found["final_misalignment"] == pytest.approx(OFFSET, rel=0.1)
    assert abs(found["power_residual"]) < 1e-3
    # the slopes of the strand are those of the elements, which yaw with it
    assert 0.5 * 1.5 * OFFSET / strand < found["largest_yaw"] < 3.0 * 1.5 * OFFSET / strand


def test_power_and_axial_forces_are_balanced_with_falling_friction_between_elastic_sheaves():
    values = {"friction_gradient": -0.3, "friction_memory": 3e-4, "sheave_stiffness": 1.0}
    found = record(misalignment=OFFSET, **values)
    assert found["status"] == Status.DONE
    driving, driven = found["net_axial_force"]
    # 2 %: by samples; by every step they agree to 0.03 % (`exact/test_spatial_revolution.py`)
    assert driving > 80.0 and driving == pytest.approx(-driven, rel=0.02)
    assert abs(found["power_residual"]) < 3e-3


BENDING = {
    "local_stiffness": 4e9,
    "flank_stiffness": 6e10,
    "sheave_stiffness": 1.0,
    "nose_clearance": np.inf,
    "step": 2e-5,
    "sampling_rate": 12.5e3,
    "band_high": 800.0,
}


def test_local_bending_gives_an_aligned_belt_the_forces_slip_and_losses_of_the_planar_one():
    """With the points of a flank at one height and sheaves that move alike it is that belt, in as many iterations."""
    values = COARSE | BENDING | {"load": TORQUE, "longest_duration": 0.04}
    asked = build_job({"name": "planar", "model": "pushbelt"}, "planar", values)
    planar = run_point(asked, asked.point(0), lambda: None)
    loose = {"driving_loose_side": "both", "driven_loose_side": "both"}
    found = record(**BENDING, **loose, flank_reach="1e-9 m", disturbance=0.0)
    assert planar["status"] == found["status"] == Status.DONE
    # 0.4 % at most; as a bedding alone it is 1 % off in axial forces, 2 % in the others, and 8 % in slip
    for name in (
        "axial_force",
        "mean_ring_tension",
        "mean_push_force",
        "flank_loss",
        "ring_loss",
        "slip_loss",
    ):
        close = 0.006 * np.abs(planar[name]).max()
        assert found[name] == pytest.approx(planar[name], abs=close), name
    assert found["iterations"] < 1.1 * planar["iterations"]


def test_the_loose_sheave_has_the_thrust(misaligned):
    """On the driven pulley the left sheave moves until it carries the thrust; the other one has the net force more."""
    left, right = (
        misaligned.channel(f"sheave_force driven {side}")[-200:].mean() for side in ("left", "right")
    )
    assert left == pytest.approx(20e3, rel=0.02)
    assert right - left < -50.0


def test_profiles_and_histories_agree_with_the_record(misaligned):
    dataset, found = histories(misaligned), judge(misaligned)
    assert dataset.sizes["probe"] == 2 * misaligned.displacement.shape[1] // 2
    profiles = misaligned.profiles
    both = profiles["contact_force_left"] + profiles["contact_force_right"]
    known = np.isfinite(both)
    assert both[known] == pytest.approx(2.0 * profiles["contact_force"][known])
    assert profiles["push_force_left"] + profiles["push_force_right"] == pytest.approx(
        profiles["push_force"], nan_ok=True
    )
    heads = [profiles[f"head_force_{side}"] for side in ("left", "right")]
    assert sum(heads) == pytest.approx(profiles["head_force"], nan_ok=True)
    assert max(map(np.nanmax, heads)) > 0.0
    for side, head in zip(("left", "right"), heads, strict=True):  # the rocking edge has the rest
        assert np.nanmin(profiles[f"push_force_{side}"] - head) >= -1e-9
    # elements lie in the mid planes of the arcs, and go over along the strands
    region = regions(misaligned.path, misaligned.places)
    for which, at in ((0, -0.5), (2, 0.5)):
        assert np.nanmedian(profiles["lateral_position"][region == which]) == pytest.approx(
            at * OFFSET, rel=0.15
        )
    assert (
        np.nanmax(profiles["ring_slope"][region == 1]) > 0.0 > np.nanmin(profiles["ring_slope"][region == 3])
    )
    for sheave in SHEAVES:
        assert dataset[f"sheave_force_{sheave.replace(' ', '_')}"].attrs["units"] == "N"
    for angle in ANGLES:
        assert found[f"largest_{angle}"] == dataset[f"extreme_{angle}"].values[misaligned.judged].max()
    assert set(found["lateral_amplitude"].shape) == set(found["amplitude"].shape) == {2}


def test_two_flows_show_what_one_leaves_out_in_record_and_history():
    one, two = (simulate(job(misalignment=OFFSET, **BRIEF, ring_flows=flows)) for flows in (1, 2))
    assert one["sheave_force"].shape == (4,) and one["contact_force_left"].dims == ("position",)
    assert float(one["axial_offset"][-1]) == pytest.approx(OFFSET, rel=0.2)
    assert two["unsolved_share"] == 0.0 and abs(two["power_residual"]) < 1e-3
    assert not np.isfinite(one["mean_tension_difference"]).any() and "tension_difference" not in one
    apart = two["tension_difference"]
    assert apart.dims == ("position",) and apart.attrs["units"] == "N"
    assert 1.0 < np.abs(two["mean_tension_difference"]).max() < 0.02 * two["mean_ring_tension"].max()
    # a tenth of the start-up's transient is left; once stationary they agree to 1 % (jobs/ring_flows.toml)
    assert two["net_axial_force"].values == pytest.approx(one["net_axial_force"].values, rel=0.1)


def test_an_aligned_belt_stays_in_its_plane_and_a_seed_leads_it_out():
    values = BRIEF | {"driving_loose_side": "both", "driven_loose_side": "both"}
    still = Transient(job(disturbance=0.0, **values).point(0), "newton")
    still.advance(still.samples // 2)
    lateral = still.displacement[:, len(still.probes) // 2 :]
    assert not lateral.any() and still.failure is None
    seeded = Transient(job(disturbance=1e-6, **values).point(0), "newton")
    seeded.advance(seeded.samples // 2)
    lateral = seeded.displacement[:, len(seeded.probes) // 2 :]
    assert 1e-8 < np.abs(lateral).max() < 1e-3


def test_a_sheave_at_its_stop_and_an_element_off_the_grooves_end_a_run():
    run = Transient(job(inner_radius=0.043, outer_radius=0.07).point(0), "newton")
    assert run._out_of_place() is None
    run._state.pulleys[f.DRIVING_RADIUS] = 0.0429  # which no thrust moves
    assert run.advance(1)[0] == Status.FAILED_NUMERICS
    assert run.failure[1].startswith(
        "the driving sheave has run to its stop: a pitch radius of 0.0429 m, of 0.043 to 0.07 m"
    )
    run._state.elements.data[3, fields.POSITION + 2, 1] = -0.0111
    assert (
        run._out_of_place()
        == f"element {run._state.elements.data.shape[0] + 3} has left the grooves: it is 11.1 mm out of the plane"
    )


def moving(**values):
    """A run whose samples say that t2 alone moves, out of the plane, by 20 um at 600 Hz."""
    run = Transient(job(**values).point(0), "newton")
    probes = [probe.label for probe in run.probes]
    assert probes[:5] == [f"t1 {k}" for k in range(1, 6)] and probes[10] == "t1_lateral 1"
    time = run.interval * np.arange(run.samples)
    run._rows[:], run._totals[:], run.done = 0.0, np.linspace(0.0, 1.0, run.samples)[:, None], run.samples
    run._rows[:, run.channels.index("driving_speed") + len(probes)] = 314.0
    run._rows[:, run.channels.index("load") + len(probes)] = [run.load(t) for t in time]
    run._sums[:] = 1.0
    run._rows[:, probes.index("t2_lateral 3")] = 2e-5 * np.sin(2.0 * np.pi * 600.0 * time)
    return run


def judged(run):
    with np.errstate(divide="ignore", invalid="ignore"):
        found = judge(run)
    assert found["lateral_amplitude"] == pytest.approx([0.0, 2e-5], rel=0.02)
    assert found["lateral_frequency"][1] == pytest.approx(600.0, rel=0.01)
    assert found["amplitude"] == pytest.approx([0.0, 0.0])
    assert "t2_lateral" in found["reason"]
    return found


def test_the_vibration_of_both_planes_is_judged_together():
    found = judged(moving())
    assert found["vibrates"] == Vibrates.YES
    assert found["spectrum"].shape == found["lateral_spectrum"].shape


RAMP = {"load_history": "ramp", "load_start": 20.0}


def test_a_ramp_is_judged_in_both_planes():
    """In all windows of t2, from the ramp's start to its end; loads of the ramp's parts are no values of strands."""
    found = judged(moving(duration=1.0, **RAMP))
    assert found["vibrates"] == Vibrates.YES and "from the ramp's start to its end" in found["reason"]
    known = np.isfinite(found["ramp_load"])
    assert known.size == 20 and known.sum() > 15
    assert found["ramp_load"][known] == pytest.approx(
        20.0 + 40.0 * (np.arange(20.0) + 0.5)[known] / 20.0, abs=2.0
    )
    assert found["lateral_ramp_amplitude"][1, known] == pytest.approx(2e-5, rel=0.02)
    assert found["ramp_amplitude"][:, known] == pytest.approx(0.0)
    assert found["lateral_ramp_amplitude"].shape == found["ramp_amplitude"].shape == (2, 20)
    assert found["lateral_spectrum"].shape == found["spectrum"].shape


def test_a_ramp_that_slips_through_tells_of_both_planes_before():
    run = moving(**RAMP)
    run.failure = Status.DONE, "the belt slips through"
    found = judged(run)
    assert found["vibrates"] == Vibrates.SLIPS and "before: t2_lateral vibrates" in found["reason"]
    assert (
        found["lateral_ramp_amplitude"].shape
        == (2, 20)
        == (*found["lateral_amplitude"].shape, found["ramp_load"].size)
    )


def test_a_run_along_a_ramp_has_the_amplitudes_of_both_planes():
    found = record(misalignment=OFFSET, **RAMP, **BRIEF)
    assert found["status"] == Status.DONE
    for plane in ("", "lateral_"):
        along, most = found[f"{plane}ramp_amplitude"], found[f"{plane}amplitude"]
        known = np.isfinite(found["ramp_load"])
        assert (
            along.shape == (2, 20) and (np.isfinite(along) == known).all() and (0.0 < along[:, known]).all()
        )
        assert (
            np.nanmax(along, axis=1) <= most * (1.0 + 1e-12)
        ).all()  # means of windows, of which the largest counts


def test_misalignment_follows_from_the_ratio_at_which_pulleys_are_aligned():
    belt = {"belt_length": 0.6612, "elements": 216, "band_high": 600.0}
    for ratio in (0.7, 1.35, 2.5):
        point = job(ratio=ratio, aligned_ratio=1.0, **belt).point(0)
        assert point["misalignment"] == axial_offset(point, 1.0) < 0.0
    assert job(ratio=1.35, aligned_ratio=1.35, **belt).point(0)["misalignment"] == pytest.approx(
        0.0, abs=1e-15
    )
    with pytest.raises(InputError, match="aligned_ratio: expected either aligned_ratio or misalignment"):
        job(aligned_ratio=1.0, misalignment=1e-4)


def test_lateral_stiffness_follows_from_the_strips():
    point = job(bending_share=1.0).point(0)
    # 18 strips of 185 um, of which EA is: each bends about its stiff axis
    assert point["lateral_bending_stiffness"] == pytest.approx(6e6 * 9.75e-3**2 / 12.0)
    assert job().point(0)["lateral_bending_stiffness"] == 47.6


def test_super_elements_turn_as_stiffly_as_their_elements():
    few, many = (given(job(elements=n).point(0)) for n in (108, 432))
    assert few["yaw_stiffness"] == pytest.approx(4.0 * many["yaw_stiffness"]) == pytest.approx(8.0, rel=1e-3)


def test_the_longest_step_is_that_of_the_strand_or_of_roll(tell):
    """Pitch sqrt(m' / T), and the waves of roll, of a torsion string: rings at +-b on elements that are plates."""
    p = job(elements=432).point(0)
    pitch = path_length(p) / 432
    assert string_limit(p) == pytest.approx(pitch * np.sqrt(1.4635 / most_tension(p)), rel=1e-3)
    stiff = p | {"ring_stiffness": 100.0 * p["ring_stiffness"]}
    longest = [min(string_limit(of), roll_limit(of)) for of in (p, stiff)]
    tell("longest step with rings 100 times as stiff over the given one", longest[1] / longest[0])
    inertia = 1.214 * (24e-3**2 + 13e-3**2) / 12.0 + 0.2495 * (7.5e-3**2 + 9.75e-3**2 / 12.0)
    assert roll_limit(p) == pytest.approx(
        pitch * np.sqrt(inertia / (most_tension(p) * (7.5e-3**2 + 9.75e-3**2 / 12.0))), rel=1e-6
    )


def test_how_far_out_of_line_the_faces_allow():
    """A flank out of line by e meets its sheave e / tan d0 further out; faces not given reach an element's height."""
    tangent, loose = np.tan(np.radians(11.0)), {"elements": 216, "band_high": 600.0, "belt_length": 0.6612}
    faces = {"inner_radius": 0.03, "outer_radius": 0.063896 + 3e-3 + 1e-3 / tangent}
    for most, given_faces in ((tangent * 10e-3, {}), (1e-3, faces)):
        job(misalignment=0.999 * most, **given_faces)
        with pytest.raises(InputError, match=r"misalignment: expected at most .* found 0.00"):
            job(misalignment=-1.001 * most, **given_faces)
    # what follows from the ratio at which pulleys are aligned, and from ratios that a run comes to
    with pytest.raises(
        InputError, match="aligned_ratio: expected at most 0.000603 m of offset.* found 0.000852 m"
    ):
        job(ratio=2.5, aligned_ratio=1.0, element_height=6.1e-3, **loose)
    turned = {"profile_time": [0.01, 0.02], "ratio_profile": [1.0, 2.5], "element_height": 6.1e-3, **loose}
    with pytest.raises(InputError, match=r"misalignment: expected at most 0.000603 m.* at a ratio of 2.5"):
        job(ratio=1.0, **turned)
    job(ratio=1.0, misalignment=4e-4, **turned)


def test_what_ends_a_run_is_recorded_and_the_sweep_goes_on(tmp_path):
    """Slip, a sheave at its stop, steps that are not solved, elements out of the rings: when, at what and which."""
    points = {
        "load": [20.0, 300.0, 20.0, 20.0, 20.0],
        "thrust": [20e3, 20e3, 80e3, 20e3, 20e3],
        "power_tolerance": [5.0, 5.0, 5.0, 1e-9, 5.0],  # [W]: one is less than rounding leaves
        "disturbance": [1e-9, 1e-9, 1e-9, 1e-9, 0.01],  # [m]: one turns elements by half a radian
    }
    document = {
        "name": "ends",
        "model": "spatial_pushbelt",
        "design": {"kind": "listed", "runs": 5},
        "axes": points,
    }
    loose = {"driving_thrust": 20e3, "sheave_rate": 5e-5, "flank_reach": 1e-3}
    faces = {"inner_radius": 0.045, "outer_radius": 0.065}
    short = BRIEF | {"longest_duration": 0.016, "most_refinements": 0, "most_iterations": 20}
    report = run(build_job(document, "ends.toml", COARSE | loose | faces | short), tmp_path, progress=False)
    assert report.done == 2 and len(report.failed) == 3
    with open_results(report.results) as results:
        statuses, verdicts, reasons = (results[name].values for name in ("status", "vibrates", "reason"))
    failed = Status.FAILED_NUMERICS
    assert statuses.tolist() == [Status.DONE, Status.DONE, failed, failed, failed]
    assert verdicts[0] != Vibrates.SLIPS == verdicts[1]
    for reason, expected in zip(
        reasons[1:],
        (
            "the belt slips through: the driven pulley has lost 50% of its speed",
            "the driven sheave has run to its stop: a pitch radius of 0.065",
            r"[\d.]+% of the steps were not solved, the last at the (flank|edge|head|ring|pin).* contact of element \d+$",
            r"element \d+ has left the rings: its (roll|yaw) is 0\.\d+ rad$",
        ),
        strict=True,
    ):
        assert re.match(rf"at [\d.]+ ms: {expected}", reason), reason


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ("belt.play=-0.1 mm", "[belt] play: expected >= 0 mm, found"),
        ("belt.play=7 mm", "[belt] play: expected less than the pitch of the elements"),
        ("scene.belt_length=300 mm", "[scene] belt_length: expected more than 0.31 m, twice the centre distance"),
        ("scene.ratio=0.3", "[scene] ratio: expected pulleys that do not overlap"),
        ("sheaves.outer_radius=60 mm", "[scene] ratio: expected radii within the sheaves, 0 to 0.06 m, found 1.35"),
        ("belt.thickness=7 mm", "[belt] thickness: expected 0.00629714 to 0.00635769 m, so that the elements fit"),
        ("belt.thickness=6.2 mm", "[belt] thickness: expected 0.00629714 to 0.00635769 m, so that the elements fit"),
        ("scene.misalignment=5 mm", "[scene] misalignment: expected at most 0.00194 m of offset, so that flanks meet the sheaves' faces, an element's"),
        ("scene.misalignment=-2 mm", "[scene] misalignment: expected at most 0.00194 m of offset"),
        ("belt.flank_reach=7 mm", "[belt] flank_reach: expected at most half of element_height, 0.0065 m, found 0.007 m"),
        ("sheaves.outer_radius=65 mm", "[belt] flank_reach: expected at most 0.0011 m, so that flanks meet the sheaves' faces, found"),
        ("sheaves.half_wedge_angle=11", '[sheaves] half_wedge_angle: expected >= 0.0872665 and <= 0.349066 rad, found 11; did you mean "11 deg"?'),
        ("scene.misalignment=11 mm", "[scene] misalignment: expected >= -10 and <= 10 mm, found"),
        ("scene.axis_tilt=25 mrad", "[scene] axis_tilt: expected >= -20 and <= 20 mrad, found"),
        ("scene.misalinment=1 mm", "[scene] misalinment: unknown key; did you mean misalignment?"),
        ("belt.nose_clearance=-0.1 mm", "[belt] nose_clearance: expected >= 0 mm, found"),
        ("belt.lateral_bending_stiffness=-1 N m^2", "[belt] lateral_bending_stiffness: expected > 0 N m^2, found"),
        ("belt.yaw_spring=-1 N", "[belt] yaw_spring: expected >= 0 N, found"),
        ("belt.element_mass=-1 kg/m", "[belt] element_mass: expected > 0 kg/m, found"),
        ("belt.edge_half_width=13 mm", "[belt] edge_half_width: expected at most half of element_width, 0.012 m, found"),
        ("sheaves.half_wedge_angle=4 deg", "[sheaves] half_wedge_angle: expected >= 5 and <= 20 deg, found"),
        ("sheaves.half_wedge_angle=21 deg", "[sheaves] half_wedge_angle: expected >= 5 and <= 20 deg, found"),
        ("sheaves.driven_loose_side=lef", '[sheaves] driven_loose_side: expected one of left, right, both, found "lef"; did you mean left?'),
        ("sheaves.driven_lose_side=left", "[sheaves] driven_lose_side: unknown key; did you mean driven_loose_side?"),
        ("sheaves.driving_loose_side=top", '[sheaves] driving_loose_side: expected one of left, right, both, found "top"'),
        ("belt.elements=60", "[belt] elements: expected 100 or more, or coarse = true, found 60"),
        ("numerics.step=1 ms", "[numerics] step: expected at most 0.000122 s, pitch over the speed of transverse"),
        ("numerics.step=0.121 ms", "[numerics] step: expected at most 0.000121 s, pitch over the speed of torsional"),
        ("friction.friction_gradient=-80 s/m", "[numerics] step: expected at most 3.07e-06 s, beyond which friction that falls so steeply has several"),
        ("friction.stribeck_velocity=0 m/s", "[friction] stribeck_velocity: expected > 0 m/s, found"),
        ("friction.kinetic_friction=-0.1", "[friction] kinetic_friction: expected > 0, found -0.1"),
        ("sheaves.flank_stiffness=-1 N/m^2", "[sheaves] flank_stiffness: expected > 0 N/m^2, found"),
        ("belt.nose_stiffness=-1 N/m", "[belt] nose_stiffness: expected > 0 N/m, found"),
        ("belt.ring_mass=-1 kg/m", "[belt] ring_mass: expected > 0 kg/m, found"),
    ],
)  # fmt: skip
def test_bad_input_is_told_in_a_line_and_nothing_is_computed(
    values, complaint, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    table, assignment = values.split(".", 1)
    key, value = assignment.split("=")
    text = {"belt": {"elements": 104}, "vibration": {"band_high": 1000}}
    number = value.lstrip("-").replace(".", "").isdigit()
    text.setdefault(table, {})[key] = value if not number else float(value) if "." in value else int(value)
    lines = ['name = "x"', 'model = "spatial_pushbelt"']
    for name, entries in text.items():
        lines += [f"[{name}]", *(f"{k} = {v!r}" for k, v in entries.items())]
    (tmp_path / "x.toml").write_text("\n".join(lines).replace("'", '"'))
    assert main(["run", "x.toml"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith(f"cvt-hpc: x.toml: {complaint}"), err
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]
