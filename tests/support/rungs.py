"""Records of the rungs of the ladder for tests, through the job and the simulation as any user has them."""

from cvt_hpc.job import Job, build_job
from cvt_hpc.simulation import run_point


def rung_job(model: str, axes: dict | None = None, stepper: str | None = None, **values) -> Job:
    """A job of a model with defaults but for `values`."""
    head = {"name": "test", "model": model} | ({"stepper": stepper} if stepper else {})
    return build_job(head | {"axes": axes or {}}, "test.toml", values)


def rung_record(model: str, stepper: str | None = None, **values) -> dict:
    """The record of one run."""
    asked = rung_job(model, stepper=stepper, **values)
    return run_point(asked, asked.point(0), lambda: None)
