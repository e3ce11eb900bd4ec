"""Made-up studies of which all that papers state holds: one for each figure, to be broken by tests."""

import json

import numpy as np
import xarray as xr

from cvt_hpc.job import build_job
from cvt_hpc.papers import schindler
from cvt_hpc.papers.bullinger_ratios import ALONE, AT_REST, LOADED, REVERSED
from cvt_hpc.papers.verdicts import Kept
from cvt_hpc.variables import Status, Vibrates

ARC, STRAND = 40, 8
NAMES = np.repeat(["driving arc", "t1", "driven arc", "t2"], [ARC, STRAND, ARC, STRAND])
FIRST = {"driving": 0, "t1": ARC, "driven": ARC + STRAND, "t2": 2 * ARC + STRAND}
SHARE = np.linspace(0.0, 1.0, ARC + 1)  # of a wrap
STRANDS = ["t1", "t2"]
PEAKS = ("peak_frequency", "peak_mode", "peak_amplitude")


def belt(point=(), **values):
    """A history: `driving` and `driven` hold values (ARC + 1,) by name, `t1` and `t2` numbers by name."""
    angle, held = np.full(NAMES.size, np.nan), {}
    for region, quantities in values.items():
        first = FIRST[region]
        on_arc = region in ("driving", "driven")
        if on_arc:
            angle[first : first + ARC + 1] = 3.0 * SHARE
        for name, of in quantities.items():
            array = held.setdefault(name, np.zeros(NAMES.size))
            array[first : first + (ARC + 1 if on_arc else STRAND)] = of
    held = {name: ("position", array) for name, array in {"wrap_angle": angle, **held}.items()}
    places = {"position": 4e-3 * np.arange(NAMES.size), "region": ("position", NAMES)}
    return xr.Dataset(held, places, {"point": json.dumps(dict(point))})


def results(axes, **values):
    """Results of runs that are done; `values` are arrays over the axes, or pairs of dimensions and array."""
    shape = tuple(len(axis) for axis in axes.values())
    arrays = {
        name: (value if isinstance(value, tuple) else (list(axes), value)) for name, value in values.items()
    }
    arrays["status"] = list(axes), np.full(shape, Status.DONE, np.int8)
    arrays.setdefault("vibrates", (list(axes), np.full(shape, Vibrates.NO, np.int8)))
    return xr.Dataset(arrays, {**axes, "strand": STRANDS})


def bullinger_04():
    radial, tangential = 0.1 * (2.0 * SHARE - 1.0), np.full(SHARE.size, 0.05)
    runs = []
    for stiffness, factor in ((1.0, 1.0), (np.inf, 0.01)):
        sliding = {"radial_sliding": factor * radial, "tangential_sliding": tangential, "normal_force": 1e5}
        runs.append(belt({"sheave_stiffness": stiffness}, driving=sliding, driven=sliding))
    return Kept(None, runs)


def _pushed(share):
    """A belt at ratio 1 whose elements press from a station of the driving arc on, later with the load."""
    front = int(30 * share) + 4
    behind = np.arange(ARC + 1) >= front
    top = 3000.0 * share
    push = np.where(behind, top * (np.arange(ARC + 1) - front + 1.0) / (ARC + 1 - front), 0.0)
    turn = 0.6 - 0.6 * share  # of the driven wrap, where sliding turns
    driven = np.interp(SHARE, [0.0, turn, 1.0], [top, top * (1.5 - 0.6 * share), 0.01 * top])
    return belt(
        {"load_share": share},
        driving={
            "push_force": push,
            "friction_force": np.where(behind, 14e3, 7e3),
            "ring_friction": np.where(behind, -300.0, 7e3),
        },
        t1={"push_force": top},
        driven={
            "push_force": driven,
            "mean_displacement": np.interp(SHARE, [0.0, 0.8, 1.0], [0.0, -6e-4, -5e-4]),
            "tangential_sliding": np.interp(SHARE, [0.0, 0.8, 1.0], [-0.1, 0.1, 0.05]),
            "sliding_angle": np.radians(np.interp(SHARE, [0.0, turn, 1.0], [150.0, 90.0, 30.0])),
        },
    )


def bullinger_20():
    return Kept(None, [_pushed(share) for share in (0.26, 0.51, 0.77)])


def bullinger_21():
    shares = [0.0, 0.26, 0.51, 0.77]
    push = np.outer(shares, [3000.0, 0.0])
    found = results({"load_share": shares}, mean_push_force=(("load_share", "strand"), push))
    return Kept(found, [_pushed(max(share, 0.01)).assign_attrs(point=json.dumps({"load_share": share}))
                        for share in shares])  # fmt: skip


def _strands(shares):
    """Forces of both strands at ratios 0.5 and 2 that balance the torque, the push changing strands off zero."""
    ratios, radius = np.array([0.5, 2.0]), np.array([0.05, 0.08])
    load = 200.0 * np.multiply.outer(np.ones(2), shares)
    force = load / (radius / ratios)[:, None]
    slope = np.array([-1000.0, 1000.0])[:, None]  # T_t2 - T_t1
    push = slope - force  # P_t2 - P_t1, so that (T - P)_t2 - (T - P)_t1 is the force
    push = np.stack([np.maximum(-push, 0.0), np.maximum(push, 0.0)], -1)
    tension = np.stack([6000.0 + 0.0 * force, 6000.0 + slope + 0.0 * force], -1)
    over = ("ratio", "load_share", "strand")
    return results(
        {"ratio": ratios, "load_share": shares},
        mean_push_force=(over, push),
        mean_ring_tension=(over, tension),
        driven_radius=("ratio", radius),
        load=load,
    )


def bullinger_05():
    return Kept(_strands([-0.9, -0.45, 0.0, 0.45, 0.9]), [])


def bullinger_22():
    runs = []
    for ratio in (0.5, 2.0):
        for share, rise, angle in (
            (0.0, 1.5, 150.0),
            (0.3, 1.3, 130.0),
            (0.6, 1.1, 100.0),
            (0.85, 1.0, 70.0),
        ):
            push = np.interp(SHARE, [0.0, 0.4, 1.0], [1e3, 1e3 * rise, 0.0])
            along = {"push_force": push, "sliding_angle": np.radians(angle - 40.0 * SHARE)}
            runs.append(belt({"ratio": ratio, "load_share": share}, driven=along))
    return Kept(_strands([0.0, 0.3, 0.6, 0.85]), runs)


def bullinger_23():
    shapes = {
        REVERSED: [80.0, 90.0, 250.0],
        AT_REST: [150.0, 100.0, 150.0],
        ALONE: [120.0, 100.0, 300.0],
        LOADED: [250.0, 200.0, 240.0],
    }
    runs = []
    for (share, speed), ends in shapes.items():
        force = 1e3 * np.interp(SHARE, [0.0, 0.15, 0.85, 1.0], [ends[0], ends[1], ends[1], ends[2]])
        runs.append(belt({"load_share": share, "driving_speed": speed}, driving={"normal_force": force}))
    return Kept(None, runs)


def lebrecht_3_6():
    load = np.array([50.0, 130.0, 200.0])
    pair = ("load", "strand")
    tension, push = np.tile([6000.0, 7500.0], (3, 1)), np.outer(20.0 * load, [1.0, 0.0])
    return Kept(results({"load": load}, mean_ring_tension=(pair, tension), mean_push_force=(pair, push)), [])


def lebrecht_3_7():
    load = np.array([0.0, 130.0, 200.0])
    rise = load / 200.0
    waves = (
        np.array([[560.0, 700.0], [520.0, 560.0]])[..., None] + np.array([-50.0, 100.0])[:, None, None] * rise
    )
    over = ("strand", "half_waves", "load")
    found = results({"load": load}, eigenfrequency=(over, waves)).assign_coords(half_waves=[2, 3])
    return Kept(found, [])


def ramp(window, size, point=()):
    """A ramp from 40 to 200 N m in 1 s; t1 and the driving moment swing at 550 Hz between two loads."""
    time = np.arange(5000) / 5e3
    load = 40.0 + 160.0 * time
    swing = np.where((load > window[0]) & (load < window[1]), 1.0, 0.01) * np.sin(2 * np.pi * 550.0 * time)
    held = {
        "load": ("time", load, {"units": "N m"}),
        "displacement": (("time", "probe"), 1e-6 * size * np.stack([swing, swing], 1)),
        "driving_moment": ("time", load + 2.0 * swing, {"units": "N m"}),
    }
    return xr.Dataset(held, {"time": time, "probe": ["t1 1/2", "t2 1/2"]}, {"point": json.dumps(dict(point))})


def lebrecht_3_1():
    return Kept(None, [ramp((80.0, 120.0), 12.0)])


lebrecht_3_9 = lebrecht_3_1


def lebrecht_3_13():
    cases = {-0.7: ((80.0, 110.0), 12.0), -0.85: ((70.0, 120.0), 30.0), -1.0: ((60.0, 130.0), 50.0)}
    runs = [ramp(*case, {"friction_gradient": gradient}) for gradient, case in cases.items()]
    return Kept(results({"friction_gradient": list(cases)}), runs)


def lebrecht_3_14():
    runs = []
    for stiffness, lower, upper in ((1.0, 12.0, 10.0), (1.2, 8.0, 10.0), (1.5, 0.0, 9.0), (np.inf, 0.0, 0.0)):
        both = [ramp(window, size) for window, size in (((82.0, 118.0), lower), ((185.0, 199.0), upper))]
        moved = both[0].assign(displacement=both[0]["displacement"] + both[1]["displacement"])
        runs.append(moved.assign_attrs(point=json.dumps({"sheave_stiffness": stiffness})))
    return Kept(None, runs)


def lebrecht_3_2():
    load = np.array([100.0, 130.0, 160.0, 200.0])
    verdicts = np.array([Vibrates.NO, Vibrates.YES, Vibrates.YES, Vibrates.YES], np.int8)
    pair = ("load", "strand")
    found = results(
        {"load": load},
        vibrates=verdicts,
        amplitude=(pair, np.full((4, 2), 1e-5)),
        frequency=(pair, np.full((4, 2), 600.0)),
        peak_mode=((*pair, "peak"), np.tile([[[2], [3]]], (4, 1, 1))),
    ).assign_coords(peak=[1])
    return Kept(found, [])


def _peaks(*of_strands):
    """Peaks of both strands as (frequency [Hz], mode, amplitude [m])."""
    array = np.array(of_strands, float)
    over = ("strand", "peak")
    named = {name: (over, array[..., k]) for k, name in enumerate(PEAKS)}
    return xr.Dataset({"status": ((), Status.DONE), **named}, {"strand": STRANDS})


def lebrecht_3_11():
    return Kept(_peaks([(520.0, 2, 1e-5), (640.0, 3, 2e-6)], [(520.0, 2, 1e-5), (640.0, 3, 9e-6)]), [])


def lebrecht_3_10():
    time = np.arange(1200) / 2e4
    speed = 0.1 + 0.02 * np.sin(2 * np.pi * 640.0 * time)[:, None] * np.ones(NAMES.size)
    history = belt(driven={}).assign_coords(profile_time=time)
    history["momentary_sliding_speed"] = ("profile_time", "position"), speed
    return Kept(lebrecht_3_11().results, [history])


def lebrecht_3_12():
    gradients, speeds = [0.0, -0.7, -1.0], np.array([0.02, 0.1, 0.2])
    job = build_job({"name": "made_up", "model": "criterion",
                     "axes": {"friction_gradient": gradients, "radial_speed": speeds}})  # fmt: skip
    verdicts = np.array([[0, 0, 0], [0, 1, 1], [0, 1, 1]], np.int8)
    growth = np.array([[-9.0, -9.0, -9.0], [-9.0, 10.0, 9.0], [-9.0, 20.0, 9.0]])
    axes = {"friction_gradient": gradients, "radial_speed": speeds}
    found = results(axes, vibrates=verdicts, growth_rate=growth)
    return Kept(found.assign_attrs(job=json.dumps(job.resolved())), [])


def _spiral():
    """Radial sliding inwards up to 0.75 of the wrap, then outwards, and the way that it is of."""
    speed = 0.2 * (SHARE - 0.75)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / ARC])
    return {"radial_sliding": speed, "mean_displacement": way}


def lebrecht_4_1():
    return Kept(None, [belt(driven=_spiral())])


def lebrecht_4_2():
    """An element that swings about its mean radial speed and slides on at 0.15 m/s."""
    job = build_job({"name": "made_up", "model": "elastic_belt", "friction": {"friction_gradient": -0.8}})
    time = np.arange(4000) / 2e4
    history = belt(driven={**_spiral(), "sliding_speed": 0.15}).assign_coords(profile_time=time)
    over = ("profile_time", "position")
    swing = 0.02 * np.sin(2 * np.pi * 550.0 * time)[:, None]
    mean = history["radial_sliding"].where(history["wrap_angle"].notnull()).values
    history["momentary_radial_sliding"] = over, mean + swing
    history["momentary_sliding_speed"] = over, 0.15 + 0.0 * mean + 0.0 * swing
    history["momentary_element_speed"] = over, np.full((time.size, NAMES.size), 8.0)
    return Kept(None, [history.assign_attrs(point=json.dumps(job.point(0)))])


def lebrecht_4_4():
    angle = np.radians(11.0)
    runs = []
    for gradient, outlet, size in ((-0.7, 2.0, 2e-5), (0.0, -0.01, 1e-8)):
        speed = 0.2 * (SHARE - 0.75)
        # friction is against sliding, 10 kN/m of both flanks
        normal = 1e5 / np.cos(angle) - 0.5 * np.sin(angle) * 1e4 * np.sign(speed)
        along = {"radial_sliding": speed, "contact_force": 1e5, "normal_force": normal}
        history = belt({"friction_gradient": gradient, "half_wedge_angle": angle}, driven=along)
        # nothing acts elsewhere
        history["normal_force"] = history["normal_force"].where(history["contact_force"] > 0.0, 0.0)
        history = history.assign_coords(pulley=["driving", "driven"], strand=STRANDS)
        fed = np.zeros((2, 4))
        fed[1, -1] = outlet
        history["flank_fed"] = ("pulley", "arc_part"), fed
        history["amplitude"] = "strand", np.full(2, size)
        for name, power in (("stress_fed", 0.0), ("belt_taken", 0.5), ("ring_taken", 0.1),
                            ("layer_taken", 0.2), ("lag_taken", 0.2)):  # fmt: skip
            history[name] = (), power
        runs.append(history)
    return Kept(results({"friction_gradient": [-0.7, 0.0]}), runs)


def push_force():
    """A belt whose push changes from t2 to t1 as the torque rises, and is largest at the exit of an arc."""
    runs = []
    for share, first, second in (
        (0.0, 0.0, 400.0), (0.15, 0.0, 60.0), (0.3, 30.0, 0.0), (0.6, 800.0, 0.0), (0.95, 1500.0, 0.0)
    ):  # fmt: skip
        runs.append(
            belt(
                {"load_share": share},
                driving={"push_force": np.interp(SHARE, [0.0, 1.0], [second, first])},
                t1={"push_force": first, "ring_tension": 2000.0 + first},
                driven={"push_force": np.interp(SHARE, [0.0, 1.0], [first, second])},
                t2={"push_force": second, "ring_tension": 2000.0 + second},
            )
        )
    job = build_job({"name": "made_up", "model": "pushbelt", "axes": {"load_share": [0.0, 0.15]}}).resolved()
    return Kept(None, [history.assign_attrs(job=json.dumps(job)) for history in runs])


def spatial_push_force():
    """Aligned belts that press at the rocking edges on arcs, and partly by their left heads on a strand."""
    runs = []
    for load, strand, other in ((60.0, "t1", "t2"), (0.0, "t2", "t1")):
        heads = {"head_force_left": np.linspace(20.0, 60.0, STRAND), "head_force_right": 0.0}
        along = {
            "driving": {"push_force": 600.0 * SHARE},
            strand: {"push_force": 600.0, **heads},
            "driven": {"push_force": 600.0 * SHARE[::-1]},
            other: {},
        }
        runs.append(belt({"misalignment": 0.0, "load": load}, **along))
        runs[-1]["push_force"].attrs["units"] = "N"
    return Kept(None, runs)


def clamping():
    thrust = np.array([11e3, 20e3, 34e3])
    losses = {
        "ring_loss": 5e-3 * thrust,
        "tilt_loss": 5e-4 * thrust,
        "element_loss": 2e-4 * thrust,
        "belt_loss": 5e-5 * thrust,
    }
    flanks = 1e-2 * np.outer(thrust, [1.5, 1.0])
    whole = flanks.sum(axis=1) + sum(losses.values())
    found = results(
        {"thrust": thrust},
        flank_loss=(("thrust", "pulley"), flanks),
        loss=whole,
        efficiency=1.0 - whole / 2e4,
        **losses,
    )
    return Kept(found.assign_coords(pulley=["driving", "driven"]), [])


def belt_drive_friction():
    """A table that falls with the force and rises with the speed."""
    table = {
        "table_force": [1e3, 6e3, 2e4],
        "table_speed": [0.0, 0.005, 0.5],
        "table_mu": [[0.5, 0.6, 0.7], [0.4, 0.5, 0.6], [0.3, 0.4, 0.5]],
    }
    axes = {"friction_law": ["coulomb", "table"], "load": [8.0, 16.0]}
    job = build_job({"name": "made_up", "model": "belt_drive", "axes": axes, "friction": table})
    return Kept(results(axes).assign_attrs(job=json.dumps(job.resolved())), [])


def belt_drive():
    load = np.array([0.0, 8.0, 16.0, 22.0])
    creep = np.tile(1.3e-4 * load, (2, 1))
    verdicts = np.where(load == 22.0, Vibrates.SLIPS, Vibrates.NO) * np.ones((2, 1), np.int8)
    found = results(
        {"driving_speed": [22.6, 62.8], "load": load},
        speed_loss=1.1 * creep,
        expected_speed_loss=1.07 * creep,
        creep_speed_loss=creep,
        vibrates=verdicts,
    )
    return Kept(found, [])


def belt_drive_tension():
    """Forces over a driven pulley that follow the tension, with a peak at both ends; bending tightens the belt."""
    tension = np.interp(SHARE, [0.0, 0.3, 1.0], [160.0, 160.0, 480.0])
    peaks = np.where(np.abs(SHARE - 0.5) > 0.42, 2.0, 1.0)
    forces = {
        "tension": tension,
        "normal_force": 20.0 * peaks * tension,
        "friction_force": -10.0 * peaks * tension,
    }
    axes = {"load": [2.0, 16.0], "bending_stiffness": [0.0026, 0.026], "contact_stiffness": [3e8, 1.2e9]}
    rise = np.multiply.outer(np.multiply.outer([0.1, 1.0], [3.0, 250.0]), [1.0, 1.0])
    pair = 310.0 + rise[..., None] + np.array([-160.0, 160.0])
    found = results(axes, strand_tension=((*axes, "strand"), pair))
    points = ({"bending_stiffness": stiffness, "tension": 310.0} for stiffness in axes["bending_stiffness"])
    return Kept(found, [belt(point, driven=forces) for point in points])


def belt_drive_spectra():
    """Spectra with the lines of three modes, whose frequencies fall in t1 and rise in t2."""
    load, bins, waves = np.array([0.0, 10.0, 20.0]), np.arange(0.0, 400.0, 2.5), np.array([1, 2, 3])
    first = np.stack([72.0 - load, 72.0 + load], 1)
    frequency = first[..., None] * waves
    lines = np.exp(-(((bins - frequency[..., None]) / 3.0) ** 2)) / waves[:, None]
    found = results(
        {"load": load},
        eigenfrequency=(("load", "strand", "half_waves"), frequency),
        spectrum=(("load", "strand", "frequency_bin"), 1e-7 + 1e-5 * lines.sum(axis=2)),
    )
    return Kept(found.assign_coords(half_waves=waves, frequency_bin=bins), [])


def belt_drive_roughness():
    return belt_drive_spectra()


def serpentine():
    time = 5e-4 * np.arange(1, 2001)
    ripple = np.sin(2.0 * np.pi * 40.0 * time)
    courses = {
        "tension_P3-P4": 700.0 + 30.0 * ripple,
        "tension_P5-P1": 1400.0 + 200.0 * ripple,
        "arm_T2": np.radians(1.0 + 0.3 * ripple),
        "speed_P1": 60.0 + 10.0 * ripple,
        "speed_P5": 59.8 + 10.0 * ripple,
    }
    history = xr.Dataset({name: ("time", course) for name, course in courses.items()}, {"time": time})
    return Kept(None, [history.assign_attrs(point=json.dumps({"ripple_frequency": 40.0}))])


def misalignment():
    axes = {"misalignment": np.array([0.0, 5e-4, 1e-3]), "load": np.array([0.0, 60.0])}
    size = np.add.outer(40.0 + 3e5 * axes["misalignment"], 0.1 * axes["load"])
    force = size[..., None] * np.array([1.0, -1.0])
    found = results(
        axes,
        **{name: ((*axes, "pulley"), force) for name in schindler.SHOWN[0]},
        final_misalignment=1e-6 * size,
        largest_roll=1e-5 * size,
        largest_yaw=2e-5 * size,
        loss=300.0 + size,
    )
    return Kept(found.assign_coords(pulley=["driving", "driven"]), [])
