"""Runs whose contact is swept a few times in each step instead of solved."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, load_job
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


@pytest.mark.parametrize("text", ["[numerics]\ncontact_sweeps = 5", "[axes]\ncontact_sweeps = [0, 5]"])
def test_no_job_of_runs_may_sweep(tmp_path, text):
    # one sweep a step lets the default belt vibrate at 350 Hz instead of 495 Hz, and its power balance closes
    path = tmp_path / "x.toml"
    path.write_text(f'name = "x"\nmodel = "elastic_belt"\n{text}\n')
    with pytest.raises(
        InputError, match=r"\[numerics\] contact_sweeps: expected 0 in a job of runs.*found 5"
    ):
        load_job(path)
    assert load_job(path, {"contact_sweeps": 0}).parameters["contact_sweeps"] == 0
