"""The same run in other units: results and verdicts are the same but for their units, so no limit is absolute."""

import pytest

from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.models.elastic_belt.step_choice import chosen_step
from support.marched import CHEAP, job
from support.scaling import Scale, different, scaled_back

SCALES = [
    Scale(force=0.125),
    Scale(time=0.5),
    Scale(length=4.0),
    Scale(force=0.125, time=0.5, length=4.0),
    Scale(force=64.0, time=0.0625, length=0.25),
]
ROUNDING = 1e-14  # of logarithms and fits to them: all else is the same to the last bit
BELT = CHEAP | {"load": 80.0, "most_refinements": 0, "longest_duration": CHEAP["duration"]}
# A short cheap run of a model: stepper, values.
SCENES = {
    "auto": (None, BELT | {"precision": "double"}),
    "criterion": (None, {}),
    "elastic_belt": ("imex", BELT | {"precision": "double"}),
    "oscillator": (None, {"band_low": 300.0}),
    "strand": (None, {"load": 80.0}),
}
DEAR, ITERATED = "a run takes too long", "it iterates with sizes and tolerances of the default scene"
LEFT_OUT = {
    "beam_pushbelt": DEAR,
    "belt_drive": ITERATED,
    "linear_stability": ITERATED,
    "pushbelt": DEAR,
    "quasi_static_belt": DEAR,
    "slip_limit": ITERATED,
    "spatial_pushbelt": DEAR,
    "steady_variator": ITERATED,
}


def test_every_recorded_model_is_tried_or_left_out_for_a_reason():
    assert {*SCENES, *LEFT_OUT} == {model for model in MODELS if load_model(model).is_recorded}


@pytest.mark.parametrize("model", SCENES)
def test_results_do_not_depend_on_units(model):
    stepper, values = SCENES[model]
    for scale in SCALES:
        one, other = scaled_back(model, scale, stepper, **values)
        assert max(different(one, other).values(), default=0.0) < ROUNDING, scale


@pytest.mark.parametrize("stations", [48, 288])  # by accuracy, by stability
def test_the_step_is_chosen_in_the_scene_s_own_time(stations):
    asked = job(stations=stations)
    point = asked.point(0)
    for scale in SCALES:
        chosen = chosen_step(scale.point(asked, point))
        assert chosen == pytest.approx(scale.time * chosen_step(point), rel=5e-3)  # three digits
