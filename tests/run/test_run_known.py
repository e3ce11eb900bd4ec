"""What a run that has reached its end leaves of what its model declares: everything, unless it says that it may not."""

import numpy as np
import pytest

import bits
from cvt_hpc import build_job
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.simulation import marching, record, record_variables, run_point, running
from cvt_hpc.variables import Status
from cvt_hpc.vibration.ramp import RampOccurrence

NOT_COMPUTED = object()
FURTHER = {
    "belt_drive": {"amplitude_threshold": 0.01},  # coarse elements shake the strands
    **dict.fromkeys(("steady_variator", "linear_stability"), {"stations": 48}),
    "beam_pushbelt": {"elements": 80},
    "slip_limit": {"stations": 36},
}
RECORDED = [
    pytest.param(name, marks=pytest.mark.slow) if name == "beam_pushbelt" else name
    for name in MODELS
    if load_model(name).is_recorded
]


@pytest.mark.parametrize("model", RECORDED)
def test_what_is_declared_is_computed_and_nothing_else(model, monkeypatch):
    document = next(job for name, job in bits.STUDIES.items() if name.split()[0] == model)
    job = build_job({"name": "known", "model": model, **document}, "known", FURTHER.get(model, {}))
    declared = {variable.name: variable for variable in record_variables(job)}
    for module in (record, running, marching):
        monkeypatch.setattr(module, "blank_record", lambda job: dict.fromkeys(declared, NOT_COMPUTED))
    found = run_point(job, job.point(0), lambda: None)
    assert found["status"] is Status.DONE, found["reason"]
    assert found.keys() == declared.keys()
    known = {
        name
        for name, value in found.items()
        if value is not NOT_COMPUTED and not (declared[name].dtype == "f8" and np.isnan(value).all())
    }
    assert {name for name in declared.keys() - known if not declared[name].may_miss} == set()


@pytest.mark.parametrize("model", ["elastic_belt", "pushbelt", "spatial_pushbelt", "belt_drive"])
def test_what_is_found_of_a_run_has_other_names_than_the_run(model):
    # `Measured` has the attributes of both
    document = next(job for name, job in bits.STUDIES.items() if name.split()[0] == model)
    job = build_job({"name": "known", "model": model, **document})
    (run,) = load_model(model).batch([job.point(0)], job.stepper).runs
    assert RampOccurrence.__dataclass_fields__.keys() & set(dir(run)) == set()
