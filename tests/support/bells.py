"""A model whose errors and costs are known by construction: a bell that each stepper makes a little too loud.

A run at a step h is louder than the truth by the stepper's share of h, and each of its samples takes 1.1 ns / h
of a clock that stands still otherwise.
"""

import numpy as np

from cvt_hpc.parameters import Parameter
from cvt_hpc.variables import Status

PARAMETERS = {
    "scene": {
        "pitch": Parameter(500.0, "Hz", "frequency of the bell", minimum=0.0, exclusive=True),
        "loudness": Parameter(1e-5, "m", "amplitude of its rim", minimum=0.0),
        "scatter": Parameter(0.0, "", "relative scatter of the loudness over the starts"),
        "load_slope": Parameter(100.0, "N m/s", "rise of the load"),
        "seed": Parameter(1, "", "seed", minimum=0),
    },
}
STEP = {"numerics": {"step": Parameter(1e-5, "s", "time step", minimum=0.0, exclusive=True)}}
TOLERANCE = {"numerics": {"tolerance": Parameter(1e-3, "", "tolerance", minimum=0.0, exclusive=True)}}
# relative error per step or tolerance
LOUDER = {"soft": 100.0, "hard": 1000.0, "clever": 0.1}
CHANNELS = ("load",)
LONGEST_STEP = 1e-3  # from here on runs fail half way


def exact(parameters, times):
    wave = np.sin(2 * np.pi * parameters["pitch"] * times)
    size = parameters["loudness"] * np.array([1.0, 0.2])
    return wave[:, np.newaxis] * size


class Probe:
    def __init__(self, label):
        self.label = label


class Transient:
    """One run of the bell."""

    clock = None
    made = 0

    def __init__(self, parameters, stepper):
        type(self).made += 1
        self.parameters, self.stepper = parameters, stepper
        self.probes = (Probe("rim 1/2"), Probe("foot"), Probe("driving arc 1/2"))
        self.interval = 1 / parameters["sampling_rate"]
        self.samples = round(parameters["duration"] * parameters["sampling_rate"])
        self.done, self.led, self.failure = 0, None, None
        self.setting = parameters["step"] if "step" in parameters else parameters["tolerance"]

    @property
    def time(self):
        return self.done * self.interval

    @property
    def times(self):
        return (1 + np.arange(self.done)) * self.interval

    @property
    def displacement(self):
        p = self.parameters
        factor = 1.0 + LOUDER[self.stepper] * self.setting
        factor *= 1.0 + p["scatter"] * np.random.default_rng(p["seed"]).standard_normal()
        found = np.column_stack([factor * exact(p, self.times), np.full(self.done, 7.0)])
        if self.led is not None:
            found[: len(self.led)] = self.led
        return found

    def take_over(self, runs):
        (run,) = runs
        self.done, self.led = run.done, run.displacement

    def channel(self, name):
        return {"load": self.parameters["load_slope"] * self.times}[name]

    def counters(self):
        return {"steps": 3 * self.done, "rates": 7 * self.done}

    def advance(self, samples):
        if (
            "step" in self.parameters
            and self.setting >= LONGEST_STEP
            and self.done + samples > self.samples // 2
        ):
            Transient.clock.now += (self.samples // 2 - self.done) * 1.1e-9 / self.setting
            self.done = self.samples // 2
            self.failure = Status.FAILED_NUMERICS, "the bell has cracked (by 3 mm)"
            return
        self.done += samples
        Transient.clock.now += samples * 1.1e-9 / self.setting


class Clock:
    def __init__(self):
        self.now = 0.0

    def process_time(self):
        return self.now


JOB = """
name = "bells"
description = "Two ways to ring"
model = "bell"

[run]
duration = "0.1 s"

[chart]
repeats = 2
time_limit = "1 h"

[chart.scenes.ringing]
title = "Ringing"
reference = "exact"
set = { loudness = "20 um" }
[chart.scenes.ringing.quantities]
trajectory = { until = "10 ms", tolerance = "5 %" }
amplitude = { tolerance = "1 %" }
frequency = { tolerance = "1 %" }
occurrence = {}

[chart.methods.soft]
label = "soft hammer"
stepper = "soft"
step = ["2 ms", "1 us", "10 us", "0.2 ms"]

[chart.methods.clever]
stepper = "clever"
tolerance = [0.01, 0.1, 0.5]

[chart.methods.hard]
stepper = "hard"
step = ["1 us"]

[chart.budget]
label = "the default"
scene = "ringing"
set = { step = "10 us" }
[chart.budget.choices.louder]
set = { loudness = "22 um" }
[chart.budget.choices.fine]
label = "step 1 us"
set = { step = "1 us" }
refines = true
[chart.budget.choices.cracked]
set = { step = "2 ms" }
"""
