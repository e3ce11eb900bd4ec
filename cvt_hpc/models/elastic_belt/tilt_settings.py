"""Parameters of the elements' tilt on the rings; by default they do not tilt."""

from dataclasses import replace

import numpy as np

from cvt_hpc.models.elastic_belt.ring_settings import layer_count
from cvt_hpc.parameters import Parameter, Parameters, Problem
from cvt_hpc.variator import scene

TILT: dict[str, Parameter] = scene.TILT | {
    "tilt_spring": replace(
        scene.TILT["tilt_spring"],
        default=np.inf,
        description=f"{scene.TILT['tilt_spring'].description}; inf: none tilts",
        exclusive=True,
        allow_infinite=True,
        sensible=(1.0, np.inf),
    ),
    "tilt_damper": replace(scene.TILT["tilt_damper"], exclusive=True),
}

TILT_DEFAULTS = {key: parameter.default for key, parameter in TILT.items()}


def elements_tilt(parameters: Parameters) -> bool:
    """Whether elements tilt on the rings."""
    return bool(np.isfinite(parameters.get("tilt_spring", np.inf)))


def tilt_problems(parameters: Parameters) -> list[Problem]:
    """Problems of the elements' tilt: (key, expected, found)."""
    if not elements_tilt(parameters):
        return []
    if layer_count(parameters) > 1:
        return [("tilt_spring", "inf with ring_layers above 1", f"{parameters['tilt_spring']:g} N")]
    if parameters["ring_offset"] == 0.0:
        return [("ring_offset", "other than 0, the lever of the rings, where elements tilt", "0 m")]
    return []


def tilt_inert(parameters: Parameters) -> dict[str, str]:
    """Settings of the elements' tilt without effect, each with the setting that makes it so."""
    return {} if elements_tilt(parameters) else {"tilt_damper": "tilt_spring inf"}
