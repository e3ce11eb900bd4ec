"""The bell in the place of a model, and a chart job of it."""

import sys
from types import ModuleType

import pytest
from bells import JOB, PARAMETERS, STEP, TOLERANCE, Clock, Transient, exact

from cvt_hpc.models import MODELS
from cvt_hpc.models.alone import Alone
from cvt_hpc.steppers import STEPPERS


@pytest.fixture
def bell(monkeypatch):
    """Register the bell and its steppers; return the clock."""
    model, transient, solution = ModuleType("bell"), ModuleType("bell.transient"), ModuleType("bell.exact")
    model.PARAMETERS, model.DEFAULT_STEPPER = PARAMETERS, "soft"
    model.STEPPER_NAMES, model.REFUSED = ("soft", "hard", "clever"), {}
    model.check = lambda parameters: []
    transient.Transient, solution.exact = Transient, exact
    transient.batch = lambda points, stepper: Alone(Transient(points[0], stepper))
    clock = Clock()
    monkeypatch.setattr(Transient, "clock", clock)
    monkeypatch.setattr(Transient, "made", 0)
    monkeypatch.setattr("cvt_hpc.chart.marching.time", clock)
    for module in (model, transient, solution):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(MODELS, "bell", "bell")
    for name, table in (("soft", STEP), ("hard", STEP), ("clever", TOLERANCE)):
        stepper = ModuleType(name)
        stepper.PARAMETERS = table
        monkeypatch.setitem(sys.modules, name, stepper)
        monkeypatch.setitem(STEPPERS, name, name)
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
