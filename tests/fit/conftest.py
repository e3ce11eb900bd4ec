"""A simulator without mechanics: a belt that vibrates in one window of load, in the place of `cvt_hpc.simulation`."""

import sys
from types import ModuleType

import numpy as np
import pytest

from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates

WIDTH = 30.0  # [N m] of the window


class Interrupted(Exception):
    pass


def record_variables(job):
    return (
        Variable("status", "", "how the run ended", dtype="i1", flags=Status),
        Variable("vibrates", "", "whether the belt vibrates", dtype="i1", flags=Vibrates),
        Variable("reason", "", "why the run failed", dtype="S240"),
        Variable("amplitude", "m", "amplitude", dims=("strand",)),
        Variable("frequency", "Hz", "frequency", dims=("strand",)),
        Variable("slip_margin", "1", "margin"),
        Variable("core_seconds", "s", "processor time", volatile=True),
    )


def run_point(job, point, interrupt):
    """Vibrate from 25 N m / element_mass on, at 500 Hz times the square root of -friction_gradient.

    Not where sheaves are rigid or friction is constant.
    """
    onset = 25.0 / point["element_mass"]
    loud = onset <= point["load"] < onset + WIDTH and np.isfinite(point["sheave_stiffness"])
    loud = loud and point["friction_gradient"] < 0.0
    frequency = 500.0 * np.sqrt(-point["friction_gradient"])
    return {
        "status": Status.DONE,
        "vibrates": Vibrates.YES if loud else Vibrates.NO,
        "reason": "",
        "amplitude": np.array([2e-5, 1e-5]) * -point["friction_gradient"] if loud else np.full(2, 1e-8),
        "frequency": np.array([frequency, 2.0 * frequency]),
        "slip_margin": point["load"] / 200.0 - 1.0,
        "core_seconds": 1e-3,
    }


@pytest.fixture
def window(toy, monkeypatch, tmp_path):
    """Put the double in place, in a folder of its own; return the number of runs that it has done, in a list."""
    done = []

    def run_points(job, points, interrupt, more=None):
        done.extend(points)
        return [run_point(job, point, interrupt) for point in points]

    double = ModuleType("cvt_hpc.simulation")
    double.__dict__.update(
        Interrupted=Interrupted,
        record_variables=record_variables,
        record_coordinates=lambda job: {"strand": Coordinate(np.array(["t1", "t2"]), "", "strand")},
        run_costs=lambda job: np.ones(job.size),
        lane_groups=lambda job, indices: [tuple(indices)] if len(indices) else [],
        turns=lambda job, runs: 1,
        forget=lambda job: None,
        pilot_share=lambda job: 0.25,
        profile_bytes=lambda job: 0,
        run_points=run_points,
    )
    monkeypatch.setattr("cvt_hpc.experiments.fit.making.estimate_cost", lambda job: 2.0)
    monkeypatch.setitem(sys.modules, "cvt_hpc.simulation", double)
    monkeypatch.chdir(tmp_path)
    return done
