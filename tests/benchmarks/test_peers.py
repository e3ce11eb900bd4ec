"""The comparison with other schedulers: what its numbers mean, and that the sweep does its tasks."""

import numpy as np
import pytest
from peer_programs import main
from peer_tasks import ENTRY, Tasks, read_witness
from peers import figures, markdown


def test_figures_of_a_known_schedule():
    # Two processes, of which one computes: tasks of 1, 3 and 2 s, and 1 s of waiting between the last two.
    done = np.array([(0, 7, 10.0, 11.0), (1, 7, 11.0, 14.0), (2, 7, 15.0, 17.0)], ENTRY)
    found = figures(done, processes=2, workers=1)
    assert found["makespan [s]"] == 7
    assert found["longest [s]"] == 3
    assert found["over ideal"] == pytest.approx(14 / 6)
    assert found["over ideal of computing"] == pytest.approx(7 / 6)
    assert found["overhead [us]"] == pytest.approx(8e6 / 3)  # 8 s of 14 without a task, three tasks


def test_a_table_leaves_out_what_a_row_does_not_have():
    assert markdown([{"peer": "one", "starts": 2}], ("peer", "longest", "starts")).splitlines() == [
        "| peer | longest | starts |",
        "| --- | --- | --- |",
        "| one |  | 2 |",
    ]


def test_tasks_are_equal_for_all_and_the_longest_come_first():
    tasks = Tasks("sleep", 300, "")
    durations = tasks.durations()
    np.testing.assert_array_equal(durations, Tasks("kernel", 300, "").durations())
    assert (np.diff(durations[tasks.longest_first()]) <= 0).all()
    assert durations.min() >= 2e-3 and durations.max() == 50e-3


def test_the_sweep_does_each_task_once_and_goes_on_where_it_was(tmp_path):
    options = {"peer": "cvt_hpc", "kind": "trivial", "count": 10, "folder": str(tmp_path), "together": 1}
    assert main(options) == 0
    assert main(options) == 0
    assert sorted(read_witness(tmp_path)["task"]) == list(range(10))
