"""Runs of the small models for tests: parameters, marches, fitted orders."""

from importlib import import_module

import numpy as np

from cvt_hpc import recording
from cvt_hpc.models import MODELS
from cvt_hpc.steppers import STEPPERS

METHODS = list(STEPPERS)
FACTS = {name: import_module(STEPPERS[name]).FACTS for name in METHODS}
FIXED = [name for name in METHODS if not FACTS[name].adaptive]
ADAPTIVE = [name for name in METHODS if FACTS[name].adaptive]
IMPLICIT = [name for name in FIXED if FACTS[name].implicit]
# Of the oscillator, Veraszto and Stepan 2017: m .538, b0 5.746, k 6957, C 2, C0 6, c_v 10, b_s .2; 18 Hz
VERASZTO_STEPAN = {
    "friction_law": "stribeck",
    "friction_gradient": -40.0,
    "kinetic_friction": 2.0,
    "stribeck_velocity": 0.1,
    "mass": 0.538,
    "stiffness": 6957.0,
    "damping": 5.946,
}


def defaults(*modules):
    return {
        key: parameter.default
        for module in modules
        for section in module.PARAMETERS.values()
        for key, parameter in section.items()
    }


def scene(model, **changes):
    """Parameters of a model and of all methods, with changes."""
    methods = [import_module(STEPPERS[name]) for name in METHODS]
    known = defaults(import_module(MODELS[model]), recording, *methods)
    assert set(changes) <= set(known)
    return known | changes


def begin(model, stepper, parameters):
    """A run that has not started."""
    return import_module(MODELS[model] + ".transient").Transient(parameters, stepper)


def finished(model, stepper, parameters):
    """A run at its end, which it must reach."""
    run = begin(model, stepper, parameters)
    failure = run.advance(run.samples)
    assert failure is None, failure
    return run


def order(sizes, errors):
    """Slope of the errors over the steps or tolerances, both logarithmic."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def bisect(is_beyond, low, high, times=14):
    """The border between values where something does not happen and values where it does, logarithmically."""
    assert not is_beyond(low) and is_beyond(high)
    for _ in range(times):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if is_beyond(middle) else (middle, high)
    return np.sqrt(low * high)
