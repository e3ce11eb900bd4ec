"""The bell in the place of a model, and a chart job of it."""

import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest

from cvt_hpc.models import MODELS
from cvt_hpc.models.marched import batches_of_one
from support.bells import CHANNELS, JOB, PARAMETERS, STEP, TOLERANCE, Clock, Transient, exact


@pytest.fixture
def bell(monkeypatch):
    """Register the bell and its steppers; return the clock."""
    model, transient, solution = ModuleType("bell"), ModuleType("bell.transient"), ModuleType("bell.exact")
    model.PARAMETERS, model.DEFAULT_STEPPER = PARAMETERS, "soft"
    model.STEPPERS = {name: name for name in ("soft", "hard", "clever")}
    model.check = lambda parameters: []
    solution.exact = exact
    transient.batch, transient.CHANNELS = batches_of_one(Transient), CHANNELS
    clock = Clock()
    monkeypatch.setattr(
        "os.sched_getaffinity", lambda process: {0}, raising=False
    )  # spawned ones know no bells
    monkeypatch.setattr(Transient, "clock", clock)
    monkeypatch.setattr(Transient, "made", 0)
    monkeypatch.setattr("cvt_hpc.simulation.marching.time", clock)
    monkeypatch.setattr("cvt_hpc.experiments.chart.measuring.time", clock)
    transient.TAKES_OVER = True
    for module in (model, transient, solution):
        module.__spec__ = ModuleSpec(module.__name__, None)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(MODELS, "bell", "bell")
    for name, table in (("soft", STEP), ("hard", STEP), ("clever", TOLERANCE)):
        stepper = ModuleType(name)
        stepper.PARAMETERS = table
        monkeypatch.setitem(sys.modules, name, stepper)
    return clock


@pytest.fixture
def write_chart(bell, tmp_path, monkeypatch):
    """Return a function that writes a chart job with texts replaced, and gives its name."""
    monkeypatch.chdir(tmp_path)

    def write(*replacements, text=JOB):
        for old, new in replacements:
            assert old in text, old
            text = text.replace(old, new)
        (tmp_path / "c.toml").write_text(text)
        return "c.toml"

    return write
