"""Steady states of free pulleys, from that of the same belt between pulleys that are not.

The hold on the pulleys is released little by little: the residual that the free equations have in the held
state is taken down along a path (Newton's homotopy), r(x) = (1 - share) r(x_held). Only the pulleys'
equations have one to begin with.
"""

from typing import Any

import numpy as np
from scipy.sparse import csc_array

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.one_system import pulled_by
from cvt_hpc.models.elastic_belt.pulley_settings import DRIVEN_INERTIA, PULLEY_DEFAULTS, are_free
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.parameters import Parameters
from cvt_hpc.variator.measures import measures

# Keys that free a pulley, each with a value that does not
HELD = {
    key: PULLEY_DEFAULTS[key]
    for key in (
        "driving_inertia",
        "driving_axial",
        "clamping",
        "driving_piston",
        "driven_piston",
        "driving_spring_rate",
        "driven_spring_rate",
        "tilt_lag",
        "collar_clearance",
        "bearing_clearance",
    )
}
# [s], in the default scene: of a tilt that has clearance and no lag; a steady state does not know it
ANY_LAG = 1e-3


def held(parameters: Parameters) -> dict[str, Any]:
    """Parameters of the same belt between pulleys that turn by a given speed under a constant thrust."""
    found = dict(parameters) | HELD
    if np.isinf(found["driven_inertia"]):
        found["driven_inertia"] = DRIVEN_INERTIA.default
    return found


def freed(parameters: Parameters) -> dict[str, Any] | None:
    """Parameters under which a steady state knows of clearances; None where no pulley is free."""
    p = PULLEY_DEFAULTS | dict(parameters)
    if p["tilt_lag"] == 0.0 and (p["collar_clearance"] or p["bearing_clearance"]):
        p["tilt_lag"] = ANY_LAG * measures(p).time
    return p if are_free(p) else None


def nearest(whole: Belt, free: Belt, state: State) -> State:
    """Return the state of free pulleys nearest to `state`, one of the `whole` belt, whose pulleys are not."""
    found, force = state.copy(), np.zeros(whole.cell.size)
    contact_forces(whole, state, fresh_contacts(whole), force)
    pull, laws = pulled_by(whole, force, np.zeros_like(force)), free.pulleys.laws[0]
    for wrap, (tilted, give) in enumerate(((f.DRIVING_COS, f.DRIVING_TILT), (f.DRIVEN_COS, f.DRIVEN_TILT))):
        place = f.FIRST_STATE + tilted
        found.scalars[place : place + 2] = laws[give] * pull[4 + 2 * wrap : 6 + 2 * wrap]
    if laws[f.RATIO_RATE] > 0.0:
        found.scalars[f.FIRST_STATE + f.RATIO_SUM] = pull[2]  # the thrust that the held sheave needs
    return found


class Released:
    """The equations of free pulleys on their way from a held state; in the form that `newton` takes.

    `x`, (n,), are the free pulleys' unknowns nearest to the held state; `share` is that of the way, 0 to 1.
    """

    def __init__(self, equations: Equations, x: np.ndarray) -> None:
        self._equations = equations
        self.sizes, self.share = equations.sizes, 0.0
        self._start = equations.residual(x)

    def residual(self, x: np.ndarray) -> np.ndarray | None:
        """Remaining share of the residual of the held state."""
        left = self._equations.residual(x)
        if left is None or self._start is None:
            return None
        return left - (1.0 - self.share) * self._start

    def jacobian(self, x: np.ndarray, sided: bool) -> csc_array:
        """Return the Jacobian, in the form of `Equations`."""
        return self._equations.jacobian(x, sided)
