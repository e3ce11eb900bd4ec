"""The same run in other units: results and verdicts are the same but for their units, so no limit is absolute."""

import pytest

from support.marched import CHEAP
from support.scaling import Scale, different, scaled_back

# Each at a time, and together.
SCALES = [
    Scale(force=0.125),
    Scale(time=0.5),
    Scale(length=4.0),
    Scale(force=0.125, time=0.5, length=4.0),
    Scale(force=64.0, time=0.0625, length=0.25),
]
ROUNDING = 1e-14  # of logarithms and fits to them: all else is the same to the last bit
BELT = CHEAP | {"load": 80.0, "most_refinements": 0, "longest_duration": CHEAP["duration"]}

# A short cheap run of each recorded model: stepper, values.
SCENES = {
    "auto": (None, BELT | {"precision": "double"}),
    "criterion": (None, {}),
    "elastic_belt": ("imex", BELT | {"precision": "double"}),
    "oscillator": (None, {}),
    "strand": (None, {"load": 80.0}),
}


@pytest.mark.parametrize("model", SCENES)
def test_results_do_not_depend_on_units(model):
    stepper, values = SCENES[model]
    for scale in SCALES:
        one, other = scaled_back(model, scale, stepper, **values)
        assert max(different(one, other).values(), default=0.0) < ROUNDING, scale
