"""Batches of real runs: which may be done together, that it leaves no trace in the numbers, and what it is to cost."""

import numpy as np
import pytest
from recorded import assert_same_numbers

from cvt_hpc import simulation
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import grouping
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Status, Vibrates

# The last load is more than friction carries: its runs end early, beside others that go on.
GRID = {"sheave_stiffness": [1.0, np.inf], "load": [0.0, 120.0, 500.0]}
MIXED = {"stations": [48, 56], "step": [2e-6, 3e-6, 6e-6], "duration": [0.04, 0.08], "load": [0.0, 60.0]}


def job(axes, stepper="imex"):
    """A coarse belt and short runs."""
    document = {
        "name": "batches",
        "model": "elastic_belt",
        "stepper": stepper,
        "axes": axes,
        "scene": {"rise_time": "10 ms"},
        "mesh": {"stations": 48},
        "run": {"duration": "0.04 s"},
    }
    return build_job(document, "batches.toml")


class Grouped:
    """`cvt_hpc.simulation` with batches of any size."""

    def __init__(self, size):
        self.size = size
        self.done = []

    def __getattr__(self, name):
        return getattr(simulation, name)

    def lane_groups(self, job, indices):
        return [tuple(indices[i : i + self.size]) for i in range(0, len(indices), self.size)]

    def run_points(self, job, points, interrupt):
        self.done.append(len(points))
        return simulation.run_points(job, points, interrupt)


@pytest.fixture(scope="module")
def singles(tmp_path_factory):
    """The dataset of a sweep whose runs are done alone."""
    return swept(Grouped(1), tmp_path_factory.mktemp("singles"))


def swept(simulator, folder):
    report = run(job(GRID), folder, simulator=simulator, progress=False)
    with open_results(report.results) as dataset:
        return dataset.load()


@pytest.mark.parametrize(("size", "batches"), [(4, [4, 2]), (6, [6])])
def test_numbers_do_not_depend_on_the_batch(singles, tmp_path, size, batches):
    simulator = Grouped(size)
    dataset = swept(simulator, tmp_path)
    assert simulator.done == batches
    assert_same_numbers(dataset, singles)
    status = [[Status(value) for value in row] for row in dataset["status"].values]
    assert status == [[Status.DONE] * 3] * 2
    assert (dataset["vibrates"].values == Vibrates.SLIPS).tolist() == [[False, False, True]] * 2


def test_every_run_is_in_one_group_and_groups_do_not_depend_on_the_hour():
    asked = job(MIXED)
    pending = [index for index in range(asked.size) if index % 5]
    groups = simulation.lane_groups(asked, pending)
    assert sorted(index for group in groups for index in group) == pending
    assert simulation.lane_groups(asked, pending) == groups
    assert simulation.lane_groups(asked, []) == []


def test_groups_are_of_one_kind_and_no_larger_than_the_lanes(monkeypatch):
    monkeypatch.setattr(grouping, "LANES", {"double": 3, "single": 3})
    asked = job(MIXED)
    groups = simulation.lane_groups(asked, range(asked.size))
    kinds = [
        {tuple(asked.point(i)[key] for key in ("stations", "step", "duration")) for i in group}
        for group in groups
    ]
    assert [len(kind) for kind in kinds] == [1] * 12
    assert sorted(map(len, groups)) == [2] * 12
    # more of a kind than lanes
    many = job({"load": [0.0, 20.0, 40.0, 60.0, 80.0]})
    assert sorted(map(len, simulation.lane_groups(many, range(5)))) == [2, 3]
    general = job({"load": [0.0, 60.0]}, "symplectic_euler")  # takes one run at a time
    assert simulation.lane_groups(general, [0, 1]) == [(0,), (1,)]


def test_the_cost_of_each_run_is_that_of_a_job_of_its_own():
    asked = job({"sheave_stiffness": [1.0, np.inf], **MIXED, "load_history": ["constant", "ramp"]})
    costs = simulation.run_costs(asked)
    assert costs.shape == (asked.size,)
    for index in (0, 7, 50, asked.size - 1):
        point = asked.point(index)
        alone = job({axis.name: [point[axis.name]] for axis in asked.axes})
        assert costs[index] == pytest.approx(simulation.estimate_cost(alone))
    assert simulation.run_costs(job({})).shape == (1,)
