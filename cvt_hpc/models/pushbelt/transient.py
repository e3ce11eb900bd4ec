"""A transient run of the planar pushbelt: it starts from geometry, is clamped and loaded, and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import run
from cvt_hpc.models.pushbelt.belt import Newton
from cvt_hpc.models.pushbelt.parameters import MODES, path_length
from cvt_hpc.models.pushbelt.readings import SCALARS, Reading
from cvt_hpc.models.pushbelt.run import COURSES, ElementRun
from cvt_hpc.models.pushbelt.start import of_lanes, start, workspace
from cvt_hpc.models.pushbelt.step import advance
from cvt_hpc.variator.profiles import multiple
from cvt_hpc.vibration.ramped import ramped

CHANNELS = (*COURSES, *SCALARS)


class Transient(ElementRun):
    """One run of the planar pushbelt; parameters as of `ElementRun`."""

    def _begin(self, p: Mapping[str, Any]) -> None:
        self._advance = called_alike(advance)
        self._belt, self._state = start(given(p))
        self._work = workspace(self._belt, p["elements"])
        self._method = Newton(
            tolerance=p["speed_tolerance"],
            power_tolerance=p["power_tolerance"],
            most_iterations=p["most_iterations"],
        )

    def _read(self) -> Reading:
        return Reading(self._readings, self._elements(), self._state.pulleys)

    def _elements(self) -> np.ndarray:
        """Fields of the elements in the order of the belt, (n, fields)."""
        return of_lanes(self._state.elements)

    def _stored_energy(self, found: Reading) -> float:
        return found.stored_energy(self._state.openings)


def given(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """What `start` takes, from flat parameters of a run [SI]."""
    p, length = parameters, path_length(parameters)
    pitch = length / p["elements"]
    rigid = np.isinf(p["sheave_stiffness"])
    return {
        "ratio": p["ratio"],
        "centre_distance": p["centre_distance"],
        "belt_length": length,
        "elements": p["elements"],
        "element_mass": p["element_mass"] * pitch,
        "element_height": p["element_height"],
        "pitch_depth": p["ring_offset"],
        "head_height": p["head_height"],
        "play": p["play"],
        "ring_mass": p["ring_mass"] * length,
        "ring_stiffness": p["ring_stiffness"],
        "ring_strain": 1e-4,
        "half_wedge_angle": p["half_wedge_angle"],
        "flank_stiffness": p["flank_stiffness"] * pitch,
        "contact_stiffness": p["edge_stiffness"] / pitch,
        **{key: p[key] for key in ("nose_height", "nose_clearance", "nose_stiffness")},
        "angle_stiffness": p["tilt_spring"] * pitch,
        "angle_damping": p["tilt_damper"] * pitch,
        "transverse_damping": p["transverse_damping"],
        "friction_law": p["friction_law"],
        "kinetic_friction": p["kinetic_friction"],
        "friction_gradient": p["friction_gradient"],
        "stribeck_velocity": p["stribeck_velocity"],
        "friction_memory": p["friction_memory"],
        "ring_friction": p["ring_friction"],
        "friction_speed": p["friction_speed"],
        "ring_friction_speed": p["ring_friction_speed"],
        "driven_inertia": p["driven_inertia"],
        "driving_rate": p["sheave_rate"] if p["driving_thrust"] > 0.0 else 0.0,
        "driven_rate": p["sheave_rate"],
        "modal_stiffness": () if rigid else p["sheave_stiffness"] * np.array([p[key] for key in MODES]),
        "driving_speed": p["speed_start"]
        if ramped(p) == "speed"
        else p["driving_speed"] * multiple(p, "driving_speed", 0.0),
    }


batch = batches_of_one(Transient)
forget = run.forget
