"""Batches of real runs: which may be done together, that it leaves no trace in the numbers, and what it is to cost."""

from dataclasses import replace

import numpy as np
import pytest

from cvt_hpc import simulation
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import grouping
from cvt_hpc.models.elastic_belt.transient import LaneRun
from cvt_hpc.simulation import record
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration import assessment
from support.recorded import assert_same_numbers

# The last load is more than friction carries: its runs end early, beside others that go on.
GRID = {"sheave_stiffness": [1.0, np.inf], "load": [0.0, 120.0, 450.0]}
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

    def may_join(self, job, runs, others):
        return self.size > 1

    def lane_groups(self, job, indices):
        return [tuple(indices[i : i + self.size]) for i in range(0, len(indices), self.size)]

    def run_points(self, job, points, interrupt, more):
        def noted():
            joining = more()
            self.done += [-len(joining)] if joining else []
            return joining

        self.done.append(len(points))
        return simulation.run_points(job, points, interrupt, noted)


@pytest.fixture(scope="module")
def singles(tmp_path_factory):
    """The dataset of a sweep whose runs are done alone."""
    return swept(Grouped(1), tmp_path_factory.mktemp("singles"))


def swept(simulator, folder):
    report = run(job(GRID), folder, simulator=simulator, progress=False)
    with open_results(report.results) as dataset:
        return dataset.load()


@pytest.mark.parametrize(("size", "batches"), [(4, [4, -2]), (6, [6])])  # with a sign: that have joined
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


def test_groups_are_of_one_kind_and_no_larger_than_may_be(monkeypatch):
    monkeypatch.setattr(grouping, "LANES", {"double": 3, "single": 3})
    asked = job(MIXED)
    groups = simulation.lane_groups(asked, range(asked.size))
    kinds = [
        {tuple(asked.point(i)[key] for key in ("stations", "step", "duration")) for i in group}
        for group in groups
    ]
    assert [len(kind) for kind in kinds] == [1] * 12
    assert sorted(map(len, groups)) == [2] * 12
    # more of a kind than lanes: several turns, as long as a batch takes less than half a minute
    many = job({"load": [0.0, 20.0, 40.0, 60.0, 80.0]})
    assert list(map(len, simulation.lane_groups(many, range(5)))) == [5]
    assert [simulation.turns(many, runs) for runs in (1, 3, 4, 5)] == [1, 1, 2, 2]
    predicted = grouping.cost(many.parameters, "imex")
    for seconds, sizes in ((1.9 * predicted, [2, 3]), (2.1 * predicted, [5])):
        monkeypatch.setattr(record, "BATCH_SECONDS", seconds)
        assert list(map(len, simulation.lane_groups(many, range(5)))) == sizes
        assert simulation.may_join(many, (0, 1), (2, 3, 4)) == (sizes == [5])
    general = job({"load": [0.0, 60.0]}, "symplectic_euler")  # takes one run at a time
    assert simulation.lane_groups(general, [0, 1]) == [(0,), (1,)]
    assert not simulation.may_join(general, (0,), (1,))


def test_runs_of_one_kind_may_join():
    asked = job({"load": [0.0, 20.0], "stations": [48, 64]})
    assert simulation.may_join(asked, (0,), (2,)) and not simulation.may_join(asked, (0,), (1,))


def test_runs_of_one_belt_advance_together_at_one_ratio_only():
    document = job({}).resolved()
    for key in ("ratio", "driven_radius", "load"):
        del document["scene"][key]
    of_one_belt = {"belt_length": [0.661195], "ratio": [0.5, 1.0, 2.0], "load_share": [0.2, 0.4]}
    asked = build_job(document | {"axes": of_one_belt}, "batches.toml")
    assert simulation.lane_groups(asked, range(asked.size)) == [(0, 1), (2, 3), (4, 5)]
    # two belts at one ratio have two geometries
    of_two_belts = {"belt_length": [0.66, 0.67], "ratio": [1.0], "load_share": [0.2, 0.4]}
    asked = build_job(document | {"axes": of_two_belts}, "batches.toml")
    assert simulation.lane_groups(asked, range(asked.size)) == [(0, 1), (2, 3)]


def test_a_cost_that_follows_from_an_axis_is_that_of_each_run():
    document = job({"ratio": [1.0, 1.25, 1.5], "load": [0.0, 60.0]}).resolved()
    del document["mesh"]["stations"]
    asked = build_job(document | {"derived": {"stations": "48 * ratio"}}, "batches.toml")
    costs = simulation.run_costs(asked)
    assert costs.reshape(3, 2) / costs[0] == pytest.approx(np.array([[1.0] * 2, [1.25] * 2, [1.5] * 2]))


def test_the_cost_of_each_run_is_that_of_a_job_of_its_own():
    asked = job({"sheave_stiffness": [1.0, np.inf], **MIXED, "load_history": ["constant", "ramp"]})
    costs = simulation.run_costs(asked)
    assert costs.shape == (asked.size,)
    for index in (0, 7, 50, asked.size - 1):
        point = asked.point(index)
        alone = job({axis.name: [point[axis.name]] for axis in asked.axes})
        assert costs[index] == pytest.approx(simulation.estimate_cost(alone))
    assert simulation.run_costs(job({})).shape == (1,)


class Impatient:
    """`cvt_hpc.simulation` that breaks off a batch at one of its polls."""

    def __init__(self, poll):
        self.left = poll

    def __getattr__(self, name):
        return getattr(simulation, name)

    def run_points(self, job, points, interrupt, more):
        def impatient():
            self.left -= 1
            return "no time" if self.left == 0 else interrupt()

        return simulation.run_points(job, points, impatient, more)


@pytest.fixture
def open_and_coarse(monkeypatch):
    """Runs between rigid sheaves are undecided before 0.1 s; at 4.6 us those of 120 N m are too coarse."""
    assess, doubt = assessment.assess, LaneRun.numerical_doubt

    def slow(displacement, rate, strands, parameters):
        found = assess(displacement, rate, strands, parameters)
        is_open = np.isinf(parameters["sheave_stiffness"]) and len(displacement) / rate < 0.1
        return replace(found, vibrates=Vibrates.UNDECIDED) if is_open else found

    def strict(run, record):
        is_coarse = run.parameters["load"] == 120.0 and run.step > 3e-6
        return (Status.FAILED_NUMERICS, "too coarse") if is_coarse else doubt(run, record)

    monkeypatch.setattr(assessment, "assess", slow)
    monkeypatch.setattr(LaneRun, "numerical_doubt", strict)


def test_a_sweep_broken_off_in_a_later_try_ends_with_the_same_numbers(open_and_coarse, tmp_path):
    expected = swept(simulation, tmp_path / "whole")
    assert expected["refinements"].values.tolist() == [[0, 1, 0]] * 2
    assert expected["simulated_seconds"].values[:, :2] == pytest.approx(
        np.array([[0.04, 0.04], [0.16, 0.16]])
    )
    impatient = Impatient(15)  # a first transient asks at least four times
    report = run(job(GRID), tmp_path / "parts", simulator=impatient, progress=False)
    assert impatient.left == 0 and report.remaining == 6
    assert_same_numbers(swept(simulation, tmp_path / "parts"), expected)
