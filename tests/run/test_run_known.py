"""What a run that has reached its end leaves of what its model declares: everything, unless it says that it may not."""

import numpy as np
import pytest

import bits
from cvt_hpc import build_job
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.simulation import record, record_variables, run_point
from cvt_hpc.variables import Status

NOT_COMPUTED = object()


@pytest.mark.parametrize("model", [name for name in MODELS if load_model(name).is_recorded])
def test_what_is_declared_is_computed_and_nothing_else(model, monkeypatch):
    document = next(job for name, job in bits.STUDIES.items() if name.split()[0] == model)
    job = build_job({"name": "known", "model": model, **document})
    declared = {variable.name: variable for variable in record_variables(job)}
    monkeypatch.setattr(record, "_blank", lambda job: dict.fromkeys(declared, NOT_COMPUTED))
    found = run_point(job, job.point(0), lambda: None)
    assert found["status"] is Status.DONE
    assert found.keys() == declared.keys()
    blank = {name for name, value in found.items() if value is NOT_COMPUTED}
    blank |= {
        name
        for name in declared.keys() - blank
        if declared[name].dtype == "f8" and np.isnan(found[name]).all()
    }
    assert {name for name in blank if not declared[name].may_miss} == set()
