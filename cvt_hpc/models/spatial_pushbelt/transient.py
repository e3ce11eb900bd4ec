"""A transient run of the spatial pushbelt: it starts from geometry, is clamped and loaded, and recorded."""

from functools import partial
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import run
from cvt_hpc.models.pushbelt.belt import of_lanes
from cvt_hpc.models.pushbelt.run import COURSES, ElementRun
from cvt_hpc.models.pushbelt.stepping import advance_by
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import readings
from cvt_hpc.models.spatial_pushbelt.belt import NEWTON, NEWTON_OF_TWO_FLOWS, start, with_two_flows, workspace
from cvt_hpc.models.spatial_pushbelt.parameters import LOOSE_SIDES, package_arm
from cvt_hpc.models.spatial_pushbelt.step import EQUATIONS
from cvt_hpc.parameters import Parameters
from cvt_hpc.variator import LARGEST_DISPLACEMENT, STRANDS

CHANNELS = (*COURSES, *readings.SCALARS)
# Turned by this, the flanks of an element have moved by a quarter of its half width, and no saddle holds the
# rings. Elements of sound runs turn by 0.05 at most, also where the belt slips through.
LARGEST_TURN = 0.25  # [1], sine


class Transient(ElementRun):
    """One run of the spatial pushbelt; parameters as of `ElementRun`.

    Displacement is in the plane at the probes of both strands, outwards, and then out of it at the same ones,
    to the right.
    """

    _contacts = f.CONTACTS
    _channels = CHANNELS
    _profiles = tuple(readings.PROFILES)
    _directions = (*STRANDS, *readings.LATERAL)

    def _begin(self, p: Parameters) -> None:
        flows = p["ring_flows"]
        self._advance = partial(called_alike(advance_by), EQUATIONS[flows])
        self._belt, self._state = start(given(p))
        method = NEWTON
        if flows == 2:
            self._state, method = with_two_flows(self._belt, self._state), NEWTON_OF_TWO_FLOWS
            self._profiles = (*readings.PROFILES, *readings.OF_TWO_FLOWS)
        self._work = workspace(self._belt, p["elements"], flows)
        self._method = method._replace(
            tolerance=p["speed_tolerance"],
            power_tolerance=p["power_tolerance"],
            most_iterations=p["most_iterations"],
        )

    def _inputs_along(self, sample: int) -> np.ndarray:
        still = np.zeros((2, f.INPUTS - f.IN_DRIVING_DRIFT))
        return np.column_stack([super()._inputs_along(sample), still])

    def _read(self) -> readings.Reading:
        state = self._state
        return readings.Reading(self._readings, of_lanes(state.elements), state.pulleys, state.loads)

    def _tilting_inertia(self) -> float:
        return self._belt.pitch_inertia

    def _out_of_place(self) -> str | None:
        """As in the plane; or whether an element is so far out of it that no groove and no ring holds it."""
        elements = of_lanes(self._state.elements)
        lateral = np.abs(elements[:, f.POSITION + f.AXIAL])
        most = LARGEST_DISPLACEMENT * self.parameters["centre_distance"]
        most += 0.5 * abs(self.parameters["misalignment"])
        if (largest := lateral.max()) > most:
            element = int(lateral.argmax())
            return f"element {element} has left the grooves: it is {largest * 1e3:.3g} mm out of the plane"
        turned = np.abs(readings.angles(elements))
        if (largest := turned.max()) > LARGEST_TURN:
            angle, element = np.unravel_index(turned.argmax(), turned.shape)
            found = np.arcsin(min(largest, 1.0))
            return f"element {element} has left the rings: its {readings.ANGLES[angle]} is {found:.3g} rad"
        return super()._out_of_place()

    def _stored_energy(self, found: readings.Reading) -> float:
        return found.stored_energy(self._state.openings, self._state.leans)


def given(parameters: Parameters) -> dict[str, Any]:
    """What `start` takes, from flat parameters of a run [SI]."""
    p, shared = parameters, run.given(parameters)
    pitch = shared["belt_length"] / p["elements"]
    return {
        **shared,
        "package_arm": package_arm(p),
        "ring_bending": p["lateral_bending_stiffness"],
        "ring_shear": p["lateral_shear_stiffness"],
        "yaw_stiffness": p["yaw_spring"] * pitch,
        "yaw_damping": p["yaw_damper"] * pitch,
        "loose_sides": tuple(p[key] for key in LOOSE_SIDES),
    }


batch = batches_of_one(Transient)
forget = run.forget
