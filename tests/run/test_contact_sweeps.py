"""Runs whose contact is swept a few times in each step instead of solved."""

import numpy as np

from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt.grouping import lane_key
from cvt_hpc.models.elastic_belt.transient import Batch

COARSE = {"stations": 48, "duration": 0.04, "rise_time": 0.01, "load": 60.0, "step": 4e-6}


def point(sweeps):
    document = {"name": "test", "model": "elastic_belt", "stepper": "imex"}
    return build_job(document, "test.toml", COARSE | {"precision": "double", "contact_sweeps": sweeps}).point(
        0
    )


def displacement(sweeps):
    batch = Batch([point(sweeps)], "imex")
    batch.advance(100)
    assert batch.runs[0].failure is None
    return batch.runs[0].displacement


def test_sweeps_come_near_the_exact_contact_the_more_there_are():
    exact = displacement(0)
    moved = np.abs(exact - exact[0]).max()
    few, many = (np.abs(displacement(sweeps) - exact).max() for sweeps in (2, 100))
    # 100 sweeps leave 0.94^100 = 0.2 % of a step's change, those of 2 nearly 0.9 of it
    assert 100 * many < few
    assert few > 1e-3 * moved


def test_runs_of_other_sweeps_do_not_share_a_batch():
    assert lane_key(point(0)) != lane_key(point(5))
