"""For all tests: a model and a stepper without physics, which say what a job file may set and run nothing."""

import gc
import os
import sys
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

from cvt_hpc.job import schema
from cvt_hpc.models import MODELS
from cvt_hpc.parameters import Parameter

# Workers take all cores: threads of the linear algebra on top, here or in what tests start, would wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
threadpool_limits(1)

# Ten times fewer searches for garbage find the same: a picture alone, or the code of a test, is thousands of objects.
gc.set_threshold(7000, 10, 10)

# No test depends on the clock: a busy machine, or the first loading of pint, takes longer than an example may.
settings.register_profile(
    "untimed",
    parent=settings(),
    deadline=None,
    # one `tell` serves all examples of a test
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("untimed")

TOY_PARAMETERS = {
    "scene": {
        "ratio": Parameter(2.5, "", "speed ratio", minimum=0.0, exclusive=True),
        "driving_speed": Parameter(300.0, "rad/s", "speed of the driving pulley", sensible=(1.0, 800.0)),
        "thrust": Parameter(None, "N", "axial force on the driven pulley", minimum=0.0, exclusive=True),
        "load": Parameter(0.0, "N m", "torque at the driving pulley"),
        "load_history": Parameter("constant", "", "how the load is applied", choices=("constant", "ramp")),
    },
    "belt": {
        "element_mass": Parameter(1.0, "kg/m", "mass per length", minimum=0.0, exclusive=True),
        "half_wedge_angle": Parameter(
            0.2, "rad", "half wedge angle", minimum=0.0, maximum=1.0, sensible=(0.02, 0.8)
        ),
        "sheave_stiffness": Parameter(1.0, "", "stiffness", minimum=0.0, exclusive=True, allow_infinite=True),
        "friction_gradient": Parameter(-0.8, "s/m", "slope of the friction law", maximum=0.0),
        "table": Parameter((), "N/m", "rows of line forces"),
        "label": Parameter("steel", "", "what it is made of"),
    },
    "mesh": {
        "stations": Parameter(160, "", "cells around the belt", minimum=24, maximum=4096),
        "refined": Parameter(False, "", "finer on the arcs"),
    },
}
TOY_NUMERICS = {"numerics": {"step": Parameter(1e-6, "s", "time step", minimum=0.0, exclusive=True)}}
TOY_SHARED = {"run": {"duration": Parameter(0.3, "s", "simulated time", minimum=0.0, exclusive=True)}}


def check_toy(parameters):
    """Refuse a load that the thrust cannot carry."""
    load, thrust = parameters["load"], parameters["thrust"]
    if abs(load) > thrust * 0.01:
        return [("load", f"at most {thrust * 0.01:g} N m at this thrust", f"{load:g} N m")]
    return []


def check_hop(parameters):
    """Refuse steps that are longer than the run."""
    step, duration = parameters["step"], parameters["duration"]
    return [("step", f"at most duration = {duration:g} s", f"{step:g} s")] if step > duration else []


def check_run(parameters):
    """Refuse runs that nobody has the time for."""
    duration = parameters["duration"]
    return [("duration", "at most an hour", f"{duration:g} s")] if duration > 3600 else []


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    """Let each worker begin a folder with another file: no two rewrite the same assertions, and all find the others'."""
    report = yield
    if isinstance(collector, pytest.Dir) and report.result:
        worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
        first = len(report.result) * int(worker) // int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
        report.result = report.result[first:] + report.result[:first]
    return report


def pytest_collection_modifyitems(items):
    """Put files with slow tests first: begun last, one would keep one core waiting for another.

    Before them go those that wait for a Slurm most of the time, beside which others compute. All workers have one order.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (item.path.parent.name != "slurm", item.path not in slow, item.path))


def pytest_collection_finish():
    """Leave what the collected tests hold out of later searches for garbage: it stays to the end."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish():
    """Search for garbage once: pytest would search all that is left five times."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def tell(record_property):
    """Return a function that keeps what a test measures, for the table that `jobs/paper_tests.py` writes."""

    def tell(quantity, found, reference=np.nan):
        record_property(
            quantity, tuple(np.asarray(part, float).ravel().tolist() for part in (found, reference))
        )

    return tell


@pytest.fixture
def unarranged(monkeypatch):
    """Compose pictures without the search for room, for tests that do not look at the places."""
    monkeypatch.setattr(
        "matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda engine, figure: None
    )


@pytest.fixture
def toy(monkeypatch):
    """Register the model "toy" and the stepper "hop", and put a table [run] in the place of all shared ones."""
    model, stepper, shared = ModuleType("toy_model"), ModuleType("toy_stepper"), ModuleType("toy_shared")
    model.PARAMETERS, model.DEFAULT_STEPPER, model.check = TOY_PARAMETERS, "hop", check_toy
    model.STEPPERS, model.REFUSED = {"hop": "toy_stepper"}, {"imex": "the toy has no step of its own"}
    stepper.PARAMETERS, stepper.check = TOY_NUMERICS, check_hop
    shared.PARAMETERS, shared.check = TOY_SHARED, check_run
    monkeypatch.setattr(schema, "SHARED", (shared,))
    for module in (model, stepper):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(MODELS, "toy", "toy_model")


@pytest.fixture
def write_job(toy, tmp_path, monkeypatch):
    """Return a function that writes a job file of the toy model, and make it the current folder's x.toml."""
    monkeypatch.chdir(tmp_path)

    def write(text='[scene]\nthrust = "20 kN"\n', head='name = "x"\nmodel = "toy"\n'):
        (tmp_path / "x.toml").write_text(head + text)
        return "x.toml"

    return write
