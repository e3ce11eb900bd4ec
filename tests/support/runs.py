"""A made-up history of one run, in the form in which `simulate` gives it."""

import numpy as np
import xarray as xr

from cvt_hpc.variables import Status, Vibrates

RATE = 20_000.0
PROBES = ("t1 1/4", "t1 1/2", "t1 3/4", "t2 1/6", "t2 1/2", "t2 5/6")


def displacement(time):
    """Second mode of t1 at 560 Hz, third of t2 at 690 Hz, both grown out of a settling belt [m]."""
    growth = 1 / (1 + np.exp(-(time - 0.08) / 0.008))
    t1 = 10e-6 * growth * np.sin(2 * np.pi * 560 * time)
    t2 = 6e-6 * growth * np.sin(2 * np.pi * 690 * time + 1) + 1.5e-6 * growth * np.sin(2 * np.pi * 560 * time)
    shapes = np.array([[1, 0], [0.05, 0], [-0.9, 0], [0, 1], [0, -1], [0, 1]], float)
    settling = 1e-4 * np.exp(-time / 0.03)
    return np.stack([t1, t2], axis=1) @ shapes.T + settling[:, np.newaxis]


def run(duration=0.3, ramp=True):
    """A run that vibrates, with everything that a history may hold."""
    time = np.arange(round(duration * RATE)) / RATE
    position = np.linspace(0.0, 0.652, 160, endpoint=False)
    borders = np.searchsorted(np.array([0.10, 0.248, 0.504]), position, side="right")
    region = np.array(["driving arc", "t1", "driven arc", "t2"], object)[borders]
    tension = np.interp(position, [0, 0.1, 0.248, 0.504, 0.652], [9e3, 7.5e3, 7.4e3, 9.1e3, 9e3])
    push = np.interp(position, [0.03, 0.1, 0.248, 0.45], [0, 5e3, 5e3, 0])
    contact = np.where(np.isin(borders, (0, 2)), 3e5 + 1e5 * np.cos(20 * position), 0.0)
    return xr.Dataset(
        {
            "status": ((), np.int8(Status.DONE)),
            "vibrates": ((), np.int8(Vibrates.YES)),
            "reason": ((), "t1 vibrates for the last 0.15 s, 10 um at the end, growth 0.01 1/s"),
            "displacement": (("time", "probe"), displacement(time), {"units": "m"}),
            "load": (("time",), 20 + 400 * time if ramp else np.full(time.size, 120.0), {"units": "N m"}),
            "ring_tension": (("position",), tension, {"units": "N"}),
            "push_force": (("position",), push, {"units": "N"}),
            "contact_force": (("position",), contact, {"units": "N m-1"}),
            "flank_feed": (("position",), np.where(borders == 2, 100.0, np.where(borders == 0, -800.0, 0.0))),
            "stress_feed": (("position",), np.where(borders == 0, 1500.0, 0.0)),
            "damping_feed": (("position",), np.full(160, -1.0)),
        },
        {
            "time": ("time", time, {"units": "s"}),
            "probe": ("probe", np.array(PROBES, object)),
            "probe_position": ("probe", np.linspace(0.12, 0.63, 6), {"units": "m"}),
            "position": ("position", position, {"units": "m"}),
            "region": ("position", region),
        },
        {"job_name": "ramp", "Conventions": "CF-1.11"},
    )
