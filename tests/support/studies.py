"""Made-up results of studies, in the form of results.nc."""

from collections import Counter

import matplotlib
import numpy as np
import xarray as xr

from cvt_hpc.analysis.classes import occurrence_classes
from cvt_hpc.variables import Status, Vibrates

GRADIENTS = (-2.4, -1.6, -0.8)
STIFFNESSES = (1.0, 1.2, 1.5, np.inf)
LOADS = tuple(np.linspace(20.0, 200.0, 10))
RAMP_GRADIENTS = [-1.0, -0.8, -0.6]


def flags(values, dims, kind, long_name):
    """A flag variable with CF attributes."""
    attributes = {
        "long_name": long_name,
        "flag_values": np.array(list(kind), np.int8),
        "flag_meanings": " ".join(flag.name.lower() for flag in kind),
    }
    return dims, np.asarray(values, np.int8), attributes


def study(gradients=GRADIENTS, stiffnesses=STIFFNESSES, loads=LOADS):
    """Results that look like the papers' maps: a window of load that narrows with stiffness, and runs of every class."""
    gradient, stiffness, load = np.meshgrid(gradients, stiffnesses, loads, indexing="ij")
    dims = ("friction_gradient", "sheave_stiffness", "load")
    strength = -gradient / np.max(np.abs(gradients)) / stiffness**0.5
    size = 22e-6 * strength * np.sin(np.pi * np.clip((load - 40 * stiffness**0.5) / 150, 0, 1))
    vibrates = np.where(size > 1e-6, Vibrates.YES, Vibrates.NO)
    vibrates[(size > 0.5e-6) & (size < 2e-6)] = Vibrates.UNDECIDED
    status = np.full(load.shape, Status.DONE)
    status[0, 0, -2:] = Status.FAILED_NUMERICS
    status[-1, 0, 1] = Status.TIMED_OUT
    status[-1, -1, 0] = Status.FAILED_ERROR
    status[-1, -1, -1] = Status.NOT_RUN
    vibrates[status != Status.DONE] = Vibrates.UNDECIDED
    amplitude = np.stack([size, 0.7 * size + 1e-9], axis=-1)
    frequency = np.stack([640 - 0.6 * load, 520 + 0.9 * load], axis=-1)
    unknown = (status != Status.DONE)[..., np.newaxis] & [True, True]
    strands = (*dims, "strand")
    return xr.Dataset(
        {
            "status": flags(status, dims, Status, "how the run ended"),
            "vibrates": flags(vibrates, dims, Vibrates, "whether the run vibrates"),
            "amplitude": (strands, np.where(unknown, np.nan, amplitude), {"units": "m"}),
            "frequency": (strands, np.where(unknown, np.nan, frequency), {"units": "Hz"}),
        },
        {
            "friction_gradient": ("friction_gradient", list(gradients), {"units": "s/m"}),
            "sheave_stiffness": ("sheave_stiffness", list(stiffnesses), {"units": "1"}),
            "load": ("load", list(loads), {"units": "N m"}),
            "strand": ("strand", ["t1", "t2"]),
        },
        {"job_name": "occurrence", "title": "Vibration occurrence over load, friction and stiffness"},
    )


def ramps():
    """Ramps between 20 and 200 N m at three gradients: the last one is quiet, the second lasts to an end."""
    share = (np.arange(20) + 0.5) / 20
    up = 20.0 + 180.0 * share
    over = ("load_start", "friction_gradient")
    onset = [[85.0, 100.0, np.nan], [166.0, np.nan, np.nan]]
    end = [[173.0, 150.0, np.nan], [71.0, 96.0, np.nan]]
    vibrates = [[Vibrates.YES, Vibrates.YES, Vibrates.NO]] * 2
    units = {"units": "N m"}
    return xr.Dataset(
        {
            "status": flags(np.full((2, 3), Status.DONE), over, Status, "how"),
            "vibrates": flags(vibrates, over, Vibrates, "whether"),
            "onset_load": (over, onset, units),
            "end_load": (over, end, units),
            "ramp_load": ((*over, "ramp_share"), np.stack([[up] * 3, [up[::-1]] * 3]), units),
        },
        {
            "load_start": ("load_start", [20.0, 200.0], units),
            "friction_gradient": ("friction_gradient", RAMP_GRADIENTS, {"units": "s/m"}),
        },
        {"job_name": "up $and$ down"},
    )


def traced(**axes):
    """The study as a trace along the load leaves it: every third load is run, what lies between them is inferred."""
    results = study(**axes)
    inferred = occurrence_classes(results)
    skipped = np.arange(results.sizes["load"]) % 3 > 0
    results["status"].values[..., skipped] = Status.NOT_RUN
    results["vibrates"].values[..., skipped] = Vibrates.UNDECIDED
    for name in ("amplitude", "frequency"):
        results[name].values[..., skipped, :] = np.nan
    return results.assign(inferred_class=inferred)


def sampled():
    """The study's runs as samples, all in a row."""
    return study().stack(run=("friction_gradient", "sheave_stiffness", "load")).reset_index("run")


def two_flags(status, vibrates):
    """A study along the load by its flags alone."""
    dims = ("load",)
    return xr.Dataset(
        {"status": (dims, status), "vibrates": (dims, vibrates)}, {"load": np.arange(float(len(status)))}
    )


def fills_of(axes):
    """How many cells have which colour."""
    (image,) = axes.images
    cells = image.get_array().reshape(-1, 4) / 255
    return Counter(matplotlib.colors.to_hex(colour) for colour in cells)
