"""Runs without mechanics in the place of `cvt_hpc.simulation` and of what draws and stores histories."""

import sys
from types import ModuleType

import numpy as np
import pytest
import xarray as xr

import cvt_hpc.simulation.record  # noqa: F401  # the double below is no package to look for it in
from cvt_hpc.cli import main
from cvt_hpc.variables import Status, Variable, Vibrates
from support.outcomes import outcomes_of

FLAGS = {
    "status": ([0, 1, 2, 3, 4], "not_run done failed_numerics failed_error timed_out"),
    "vibrates": ([0, 1, 2], "no yes undecided"),
}


class Interrupted(Exception):
    pass


def record_variables(job):
    return (
        Variable("status", "", "how the run ended", dtype="i1", flags=Status),
        Variable("vibrates", "", "whether the belt vibrates", dtype="i1", flags=Vibrates),
        Variable("reason", "", "why the run failed", dtype="S240"),
    )


def run_point(job, point, interrupt):
    """Vibrate above 40 N m; fail with rigid sheaves."""
    fails = np.isinf(point["sheave_stiffness"])
    return {
        "status": Status.FAILED_NUMERICS if fails else Status.DONE,
        "vibrates": Vibrates.YES if point["load"] > 40 else Vibrates.NO,
        "reason": "step 3: too stiff" if fails else "",
    }


def run_points(job, points, interrupt, more=None):
    return [run_point(job, point, interrupt) for point in points]


def simulate(job, at):
    """Return the same as a history of three instants."""
    point = job.point_at(at)
    record = run_point(job, point, lambda: None)
    data = {"load": ((), point["load"], {"units": "N m"})} | {
        name: ((), np.int8(record[name]), {"flag_values": values, "flag_meanings": meanings})
        for name, (values, meanings) in FLAGS.items()
    }
    data["reason"] = ((), record["reason"])
    data["steps"] = ((), 3, {"units": "1"})
    data["amplitude"] = ("strand", [1e-6, 25e-6], {"units": "m"})
    data["displacement"] = ("time", np.zeros(9))
    return xr.Dataset(data, {"strand": ["t1", "t2"], "time": np.arange(9.0)})


class Alone:
    """The double of a single run."""

    def __init__(self, job, at):
        self.made = sys.modules["cvt_hpc.simulation"].simulate(job, at)
        self.record = {name: self.made[name].item() for name in ("status", "reason")}

    def history(self):
        return self.made

    def outcomes(self):
        return outcomes_of(self.made)


@pytest.fixture
def mechanics(monkeypatch):
    """Put the double in place; return the lists of what was written and drawn."""
    double = ModuleType("cvt_hpc.simulation")
    double.__dict__.update(
        Interrupted=Interrupted,
        record_variables=record_variables,
        record_coordinates=lambda job: {},
        run_costs=lambda job: np.ones(job.size),
        lane_groups=lambda job, indices: [(index,) for index in indices],
        turns=lambda job, runs: 1,
        forget=lambda job: None,
        pilot_share=lambda job: 0.25,
        profile_bytes=lambda job: 0,
        run_points=run_points,
        simulate=simulate,
        alone=Alone,
        estimate_cost=lambda job: 30.0,
    )
    histories = ModuleType("cvt_hpc.analysis.histories")
    calls = {"written": [], "drawn": []}
    histories.place_of = histories.values_of = histories.settings_of = lambda attributes: []
    histories.course_line = lambda attributes: ""
    histories.draw_history = lambda dataset, path: calls["drawn"].append((dataset, path)) or path
    monkeypatch.setitem(sys.modules, "cvt_hpc.simulation", double)
    monkeypatch.setitem(sys.modules, "cvt_hpc.analysis.histories", histories)
    kept = lambda dataset, path: calls["written"].append((dataset, path)) or path  # noqa: E731
    monkeypatch.setattr("cvt_hpc.storage.netcdf.write_history", kept)
    monkeypatch.setattr("cvt_hpc.storage.netcdf.is_history", lambda path: path.name == "history.nc")
    return calls


@pytest.fixture
def call(capsys):
    """Return a function that runs a command line: exit status, lines on stdout, lines on stderr."""

    def run(*arguments):
        status = main(list(map(str, arguments)))
        out, err = capsys.readouterr()
        return status, out.splitlines(), err.splitlines()

    return run
