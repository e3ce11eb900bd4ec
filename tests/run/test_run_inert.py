"""What the model calls inert changes no bit of a run, and beside it stands what does."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.models.elastic_belt import inert
from cvt_hpc.models.elastic_belt.belt_settings import belt_inert
from cvt_hpc.models.elastic_belt.deflection_settings import CONE, MODE_FILES, MODE_KEYS, RITZ, TABLE_KEYS
from cvt_hpc.models.elastic_belt.pulley_checks import pulley_inert
from cvt_hpc.models.elastic_belt.pulley_settings import PULLEY_DEFAULTS
from cvt_hpc.simulation import record_variables
from support.marched import fresh_record, job

COARSE = {"stations": 32, "duration": 0.04, "rise_time": 0.01, "load": 60.0}
TABLE = {
    "friction_law": "table",
    "table_force": [1e3, 1e6],
    "table_speed": [0.0, 1.0],
    "table_mu": [[0.12, 0.1], [0.12, 0.1]],
}
OTHER = {
    "friction_gradient": -0.7,
    "kinetic_friction": 0.12,
    "stribeck_velocity": 0.06,
    "load_start": 10.0,
    "speed_start": 200.0,
    "seed": 2,
    "ring_friction_speed": 0.02,
    "stiffness_of": "sheave",
    "tilt_stiffness": 4e5,
    "tilt_factor": 2.0,
    "local_stiffness": 5e9,
    "local_length": 0.02,
}
# of pulleys, rings, discs and elements as they are in every scene here
AT_REST = (
    pulley_inert(PULLEY_DEFAULTS)
    | belt_inert({})
    | dict.fromkeys([*CONE, *TABLE_KEYS, *RITZ, *MODE_KEYS, *MODE_FILES], "sheave_deformation bending")
)
CASES = [
    (TABLE, ["friction_gradient", "kinetic_friction", "stribeck_velocity"], "friction_law table"),
    ({"friction_law": "coulomb", "friction_gradient": 0.0}, ["stribeck_velocity"], "friction_gradient 0"),
    ({"friction_law": "linear", "friction_gradient": 0.0}, ["stribeck_velocity"], "friction_gradient 0"),
    ({"friction_law": "cubic", "friction_gradient": 0.0}, ["stribeck_velocity"], "friction_gradient 0"),
    ({"friction_law": "hyperbolic"}, ["stribeck_velocity"], "friction_law hyperbolic"),
    ({"friction_gradient": 0.0}, ["stribeck_velocity"], "friction_gradient 0"),
    ({"load_history": "constant", "speed_history": "ramp"}, ["load_start"], "load_history constant"),
    ({}, ["speed_start"], "speed_history constant"),
    ({"disturbance": 0.0}, ["seed"], "disturbance 0"),
    ({"ring_friction": 0.0}, ["ring_friction_speed"], "ring_friction 0"),
    ({}, ["stiffness_of"], "sheave_stiffness 1"),
    ({"sheave_stiffness": np.inf}, ["local_stiffness", "local_length"], "sheave_stiffness inf"),
    (
        {"sheave_stiffness": np.inf, "stiffness_of": "sheave"},
        ["tilt_stiffness", "tilt_factor", "local_stiffness", "local_length"],
        "sheave_stiffness inf",
    ),
    ({"tilt_factor": np.inf}, ["tilt_stiffness"], "tilt_factor inf"),
    ({"tilt_stiffness": np.inf}, ["tilt_factor"], "tilt_stiffness inf"),
]


def bits(**values):
    """All bytes of the record of a run, timings excepted."""
    found = fresh_record(**COARSE, **values)
    return {
        variable.name: np.asarray(found[variable.name]).tobytes()
        for variable in record_variables(job())
        if not variable.volatile
    }


def without_table(scene):
    """What is inert of a table under another law."""
    law = scene.get("friction_law", "stribeck")
    keys = ("table_file", "table_force", "table_speed", "table_mu")
    return {} if law == "table" else dict.fromkeys(keys, f"friction_law {law}")


@pytest.mark.parametrize(("scene", "keys", "setting"), CASES)
def test_what_is_inert_changes_nothing_and_is_no_axis(scene, keys, setting):
    scene = {"load_history": "ramp"} | scene
    asked = job(**COARSE, **scene)
    steady = {} if "speed_history" in scene else {"speed_start": "speed_history constant"}
    whole = {} if "sheave_stiffness" in scene else {"stiffness_of": "sheave_stiffness 1"}
    found = {key: why for key, why in inert(asked.parameters).items() if key not in AT_REST}
    assert found == dict.fromkeys(keys, setting) | steady | whole | without_table(scene)
    alone = bits(**scene)
    for key in keys:
        assert bits(**scene, **{key: OTHER[key]}) == alone, key
        with pytest.raises(
            InputError, match=rf"\[axes\] {key}: expected one value, .* with {setting}, found 2"
        ):
            job(axes={key: [asked.parameters[key], OTHER[key]]}, **COARSE, **scene)


def test_each_parameter_has_its_effect_once_load_or_speed_ramps():
    stiff = {"sheave_stiffness": 1.2}  # of 1 it does not matter what it is a factor on
    scenes = {"load": stiff | {"load_history": "ramp"}, "speed": stiff | {"speed_history": "ramp"}}
    starts = {name: f"{name}_start" for name in scenes}
    alone = {name: bits(**scene) for name, scene in scenes.items()}
    for ramped, constant in (("load", "speed"), ("speed", "load")):
        expected = {starts[constant]: f"{constant}_history constant"} | without_table({})
        assert inert(job(**COARSE, **scenes[ramped]).parameters) == expected | AT_REST
    for key, value in OTHER.items():
        name = "speed" if key == starts["speed"] else "load"
        assert bits(**scenes[name], **{key: value}) != alone[name], key
