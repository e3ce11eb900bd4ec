"""Made-up results and histories from which every kind of picture can be drawn, and the texts of a picture."""

import json
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from cvt_hpc.analysis.profiles import QUANTITIES, SIDES
from cvt_hpc.physics.geometry import variator
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator.band import strand_frequencies
from support.studies import flags

POINT = {
    "ratio": 2.52,
    "driven_radius": 0.075,
    "centre_distance": 0.155,
    "driving_speed": 300.0,
    "thrust": 50e3,
    "element_mass": 1.0,
    "ring_mass": 0.3,
    "bending_stiffness": 0.5,
    "kinetic_friction": 0.08,
    "half_wedge_angle": 0.19,
}
PATH = variator(*(POINT[key] for key in ("ratio", "driven_radius", "centre_distance")))
STATIONS, RATE = 240, 10e3
SPEEDS, LOADS, RATIOS = np.linspace(100.0, 600.0, 6), np.linspace(20.0, 200.0, 10), (1.0, 1.6, 2.52)
BINS = np.arange(0.0, 1510.0, 10.0)
POWERS = {
    "driving_power": 39e3,
    "load_power": 36e3,
    "thrust_power": -0.2,
    "storing_power": -7.8,
    "ring_loss": 400.0,
    "layer_loss": 2.8,
    "seating_loss": 370.0,
    "loss": 3e3,
    "layer_taken": 2.3,
    "lag_taken": 0.6,
    "carried_power": 0.9,
    "fluctuation_remainder": -0.1,
}
INK = 0.12  # share of a text's box at each side that its letters leave free


def results():
    """A study over speed, load and ratio with runs of every class, spectra, forces and efficiency."""
    dims = ("driving_speed", "load", "ratio")
    speed, load, ratio = np.meshgrid(SPEEDS, LOADS, RATIOS, indexing="ij")
    size = 20e-6 * np.sin(np.pi * np.clip((load - 40.0) / 140.0, 0.0, 1.0)) * speed / 600.0 / ratio
    vibrates = np.where(size > 2e-6, Vibrates.YES, Vibrates.NO)
    vibrates[(size > 1e-6) & (size < 3e-6)] = Vibrates.UNDECIDED
    vibrates[-1, -1], vibrates[0, 1] = Vibrates.SLIPS, Vibrates.IRREGULAR
    status = np.full(load.shape, Status.DONE)
    status[1, 5], status[2, -1], status[3, 3] = Status.FAILED_NUMERICS, Status.NOT_RUN, Status.TIMED_OUT
    vibrates[status != Status.DONE] = Vibrates.UNDECIDED
    known = np.where(status == Status.DONE, 1.0, np.nan)[..., None]
    forces = np.stack([9e3 + 20.0 * load, 9e3 - 10.0 * load], -1)
    pushes = np.stack([25.0 * load, 3.0 * load], -1)
    modes = np.array([[150.0], [180.0]]) * np.arange(1, 6)
    lines = np.exp(-(((BINS - modes[..., None]) / 15.0) ** 2)) * np.array([0.3, 0.6, 1.0, 0.4, 0.1])[:, None]
    harmonic = np.exp(-(((BINS - 8.0 * speed[..., None] / (2.0 * np.pi)) / 12.0) ** 2))
    spectrum = (size[..., None, None] + 2e-7) * lines.sum(1) + 3e-6 * harmonic[..., None, :] + 1e-9
    over = (*dims, "strand")
    variables = {
        "status": flags(status, dims, Status, "how the run ended"),
        "vibrates": flags(vibrates, dims, Vibrates, "whether the run vibrates"),
        "amplitude": (over, known * size[..., None] * [1.0, 0.7], {"units": "m"}),
        "frequency": (over, known * np.stack([640.0 - 0.6 * load, 520.0 + 0.9 * load], -1), {"units": "Hz"}),
        "spectrum": ((*over, "frequency_bin"), known[..., None] * spectrum, {"units": "m"}),
        "mean_ring_tension": (over, forces, {"units": "N"}),
        "mean_push_force": (over, pushes, {"units": "N"}),
        "efficiency": (dims, 0.93 - 0.1 * (load / 200.0 - 0.6) ** 2 - 0.02 * ratio, {"units": "1"}),
    }
    coordinates = {
        "driving_speed": ("driving_speed", SPEEDS, {"units": "rad/s"}),
        "load": ("load", LOADS, {"units": "N m"}),
        "ratio": ("ratio", list(RATIOS), {"units": "1"}),
        "strand": ["t1", "t2"],
        "frequency_bin": ("frequency_bin", BINS, {"units": "Hz"}),
    }
    return xr.Dataset(variables, coordinates, {"job_name": "pictures", "job": json.dumps({"scene": POINT})})


def ramps(gradients=(-1.0, -0.8, -0.6)):
    """Ramps between 20 and 200 N m: the last gradient is quiet, the second lasts to an end of the ramp."""
    count = len(gradients)
    share = (np.arange(20) + 0.5) / 20
    up = 20.0 + 180.0 * share
    over = ("load_start", "friction_gradient")
    onset, end, vibrates = np.full((3, 2, count), np.nan)
    onset[:, :-1], end[:, :-1], vibrates[:] = 120.0, 150.0, Vibrates.YES
    vibrates[:, -1] = Vibrates.NO
    onset[:, :2], end[:, :2] = [[85.0, 100.0], [166.0, np.nan]], [[173.0, 150.0], [71.0, 96.0]]
    units = {"units": "N m"}
    return xr.Dataset(
        {
            "status": flags(np.full((2, count), Status.DONE), over, Status, "how"),
            "vibrates": flags(vibrates, over, Vibrates, "whether"),
            "onset_load": (over, onset, units),
            "end_load": (over, end, units),
            "ramp_load": ((*over, "ramp_share"), np.stack([[up] * count, [up[::-1]] * count]), units),
        },
        {
            "load_start": ("load_start", [20.0, 200.0], units),
            "friction_gradient": ("friction_gradient", list(gradients), {"units": "s/m"}),
        },
        {"job_name": "up $and$ down"},
    )


def history(load=100.0, ramped=None, duration=0.4):
    """A run of a variator with everything that pictures of runs take, along a ramp of load or speed if so asked."""
    time = np.arange(round(duration * RATE)) / RATE
    share = time / duration
    loads = 20.0 + 160.0 * share if ramped == "load" else np.full(time.size, load)
    speeds = 200.0 + 400.0 * share if ramped == "driving_speed" else np.full(time.size, 300.0)
    first = strand_frequencies(POINT | {"load": load})[:, :3]
    motion = [np.sin(2.0 * np.pi * first[k] * time[:, None]) @ [4e-6, 6e-6, 2e-6] for k in range(2)]
    motion[1] = motion[1] + 2e-6 * np.sin(8.0 * np.cumsum(speeds) / RATE)
    shapes = np.array([[0.7, 0], [1, 0], [0.7, 0], [0, 0.7], [0, 1], [0, 0.7]])
    position = (np.arange(STATIONS) + 0.5) * PATH.path_length / STATIONS
    ends = np.cumsum(PATH.lengths)
    place = np.searchsorted(ends, position, "right")
    region = np.array(["driving arc", "t1", "driven arc", "t2"], object)[place]
    within = (position - np.append(0.0, ends)[place]) / np.array(PATH.lengths)[place]  # of a region
    on_arc = np.isin(place, (0, 2))
    sign = np.where(place == 0, 1.0, -1.0)
    sliding = np.where(on_arc, 0.02 * sign * (1.0 - 2.0 * within), np.nan)
    push = np.interp(position, [0.02, ends[0], ends[1], ends[2]], [0.0, 30.0 * load, 30.0 * load, 0.0])
    along = {
        "ring_tension": (np.interp(position, [0.0, ends[0], ends[2]], [9e3, 7.5e3, 9e3]), "N"),
        "push_force": (push, "N"),
        "tension": (9e3 - push, "N"),
        "sliding_tension": (9e3 - 0.9 * push, "N"),
        "contact_force": (np.where(on_arc, 3e5 + 1e5 * np.cos(20.0 * position), 0.0), "N m-1"),
        "normal_force": (np.where(on_arc, 2e5 + 1e5 * within, 0.0), "N m-1"),
        "friction_force": (np.where(on_arc, -1e4 * sign * within, 0.0), "N m-1"),
        "ring_friction": (np.where(on_arc, 2e3 * sign, 0.0), "N m-1"),
        "sliding": (sliding, "m s-1"),
        "wrap_angle": (np.where(on_arc, np.pi * within, np.nan), "rad"),
        "flank_feed": (np.where(place == 2, 40.0, np.where(place == 0, -80.0, 0.0)), "W m-1"),
        "stress_feed": (np.where(place == 0, 70.0, 0.0), "W m-1"),
        "damping_feed": (np.full(STATIONS, -2.0), "W m-1"),
    }
    for name in QUANTITIES:
        for side, ahead in zip(SIDES, (0.0, 0.02), strict=True):
            along[f"{name}_{side}"] = (np.where(on_arc & (within > ahead), 1e5 * (1.0 + ahead), 0.0), "N m-1")
    variables = {name: ("position", values, {"units": unit}) for name, (values, unit) in along.items()}
    fast = time[:: int(RATE // 2e3)]
    for name in ("radial_sliding", "tangential_sliding", "sliding_speed"):
        swinging = sliding * (1.0 + 0.2 * np.sin(2.0 * np.pi * 500.0 * fast[:, None]))
        variables[f"momentary_{name}"] = (("profile_time", "position"), swinging, {"units": "m s-1"})
    variables["momentary_element_speed"] = (("profile_time", "position"), np.full((fast.size, STATIONS), 9.0))
    variables |= {
        "status": ((), np.int8(Status.DONE)),
        "vibrates": ((), np.int8(Vibrates.YES)),
        "displacement": (("time", "probe"), np.stack(motion, 1) @ shapes.T, {"units": "m"}),
        "load": ("time", loads, {"units": "N m"}),
        "driving_speed": ("time", speeds, {"units": "rad s-1"}),
        **{name: ((), power, {"units": "W"}) for name, power in POWERS.items()},
        "part_flank_loss": (("pulley", "arc_part"), 5.0 * np.arange(8.0).reshape(2, 4), {"units": "W"}),
    }
    coordinates = {
        "time": ("time", time, {"units": "s"}),
        "profile_time": fast,
        "position": ("position", position, {"units": "m"}),
        "region": ("position", region),
        "probe": [f"{strand} {part}" for strand in ("t1", "t2") for part in ("1/4", "1/2", "3/4")],
        "probe_position": (
            "probe",
            [ends[0] + 0.03 * k for k in (1, 2, 3)] + [ends[2] + 0.03 * k for k in (1, 2, 3)],
        ),
        "pulley": ["driving", "driven"],
    }
    job = {
        "name": "run",
        "model": "elastic_belt",
        "stepper": "imex",
        "axes": {"load": [80.0, 100.0]},
        "scene": POINT,
    }
    told = {"job_name": "run", "job": json.dumps(job), "point": json.dumps(POINT | {"load": load})}
    return xr.Dataset(variables, coordinates, told)


class Written(NamedTuple):
    """A text as it stands in a picture: its words and the box of its letters [pixel]."""

    words: str
    box: Bbox


def texts_of(figure, monkeypatch):
    """All texts that are drawn in a picture."""
    drawn, draw = [], Text.draw

    def record(self, renderer, *args, **options):
        if self.get_visible() and self.get_text().strip():
            box = Text.get_window_extent(self, renderer)
            free = INK * min(box.height, box.width) / (1 + self.get_text().count("\n"))
            drawn.append(Written(self.get_text(), box.padded(-free)))
        return draw(self, renderer, *args, **options)

    monkeypatch.setattr(Text, "draw", record)
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()  # all that a drawing does, but for the pixels
    return drawn


def faults_of(figure, monkeypatch):
    """What is wrong with the texts of a picture: two that overlap, and those that the page cuts."""
    texts, page = texts_of(figure, monkeypatch), figure.bbox.padded(1.0)
    found = [
        f"{one.words!r} on {other.words!r}"
        for k, one in enumerate(texts)
        for other in texts[:k]
        if one.box.overlaps(other.box)
    ]
    found += [
        f"{one.words!r} is cut"
        for one in texts
        if not (page.contains(*one.box.min) and page.contains(*one.box.max))
    ]
    return found
