"""The torque that friction carries, by which loads of different ratios and thrusts are compared."""

import math
from collections.abc import Mapping
from typing import Any

NEEDS = (
    "ratio",
    "driven_radius",
    "thrust",
    "half_wedge_angle",
    "friction_law",
    "kinetic_friction",
    "table_mu",
)


def torque_limit(mu: Any, axial_force: Any, driving_radius: float, half_wedge_angle: float) -> Any:
    """Torque at the driving pulley [N m] at which a pulley slips: Bullinger et al. 2005, eq. 2.

    Of the coefficient of friction `mu` [1], the axial force of the belt on a sheave [N] (numbers or arrays;
    the least result over both pulleys counts), `driving_radius` [m] and `half_wedge_angle` [rad].
    """
    return 2.0 * mu * axial_force * driving_radius / math.cos(half_wedge_angle)


def carried_torque(parameters: Mapping[str, Any]) -> float:
    """Torque at the driving pulley [N m] that friction carries on rigid sheaves.

    From flat parameters [SI], those of NEEDS, by `torque_limit`, with the thrust on the driven pulley, which
    a job prescribes, and the coefficient of `_friction_level`. A model without a choice of friction laws has
    neither `friction_law` nor `table_mu`. ValueError if the friction table has no coefficients.
    """
    p = parameters
    radius = p["driven_radius"] / p["ratio"]
    return torque_limit(_friction_level(p), p["thrust"], radius, p["half_wedge_angle"])


def _friction_level(parameters: Mapping[str, Any]) -> float:
    """Coefficient of friction [1] that stays as the friction gradient varies; of a table the least one."""
    if parameters.get("friction_law") != "table":
        return parameters["kinetic_friction"]
    rows = (row if isinstance(row, tuple) else (row,) for row in parameters["table_mu"])
    coefficients = [mu for row in rows for mu in row]
    if not coefficients:
        raise ValueError("a friction table with coefficients in table_mu")
    return min(coefficients)


def shared_load(parameters: Mapping[str, Any]) -> float:
    """Torque at the driving pulley [N m]: the share `load_share` of the torque that friction carries."""
    return parameters["load_share"] * carried_torque(parameters)
