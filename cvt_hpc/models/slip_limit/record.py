"""The record of a limit of slip, and the search for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.variables import Coordinate, Status, Values, Variable, Vibrates
from cvt_hpc.variator import GROSS_SLIP
from cvt_hpc.variator.variables import COORDINATES, shared

if TYPE_CHECKING:
    from cvt_hpc.models.steady_variator.walking import Steady, SteadyBelt

VARIABLES = (
    Variable("limit_torque", "N m", "at the driving pulley, where the belt begins to slip grossly"),
    Variable("limit_thrust", "N", "on the driven pulley, where the belt begins to slip grossly"),
    Variable("formula_ratio", "1", "limit torque over that of Bullinger et al. 2005, eq. 2"),
    Variable("limit_slip", "1", "at the limit, tangential sliding over belt speed", dims=("pulley",)),
    Variable("working_torque", "N m", "at the driving pulley, safe by the factor"),
    Variable("axial_force", "N", "necessary thrust at the working point", dims=("pulley",)),
    Variable("thrust_ratio", "1", "axial force of the driving over that of the driven pulley"),
    Variable("slip", "1", "at the working point, tangential sliding over belt speed", dims=("pulley",)),
    *shared("flank_loss", "driving_power", "load_power", "ring_loss", "belt_loss"),
    *shared("layer_loss", "seating_loss", "loss", "efficiency", "power_residual"),
)
_AT_WORK = tuple(variable.name for variable in VARIABLES[5:])
_FIRST_SHARE = 0.4  # of eq. 2's torque: where continuations to the limit begin
WITHIN, TRIES = 2e-3, 8  # of the load: how closely a thrust's limit meets it; thrusts tried at most


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, whatever the parameters."""
    return dict(COORDINATES)


def cost(parameters: Parameters, stepper: None) -> Any:
    """Core-seconds of a run: of a first state and of the continuation to the limit."""
    return np.where(parameters["method"] == "formula", 1e-4, 1e-3 * parameters["stations"] ** 2)


def solve(parameters: Parameters) -> Any:
    """Limit and working point of the parameters of a run [SI]; or why none was found."""
    from cvt_hpc.models.steady_variator.walking import NoSteadyState

    try:
        return _by_formula(parameters) if parameters["method"] == "formula" else _by_states(parameters)
    except NoSteadyState as error:
        return error


def judge(solution: Values | ValueError) -> Values:
    """The record of a run, its cost apart."""
    if isinstance(solution, ValueError):
        return {"status": Status.FAILED_NUMERICS, "reason": str(solution)}
    reason = "a limit of slip, and whether the belt vibrates is not asked here"
    return {"status": Status.DONE, "vibrates": Vibrates.UNDECIDED, "reason": reason, **solution}


def _formula_thrust(p: Parameters) -> float:
    """Thrust that carries the load by eq. 2, which is linear in it [N]."""
    return abs(p["load"]) / carried_torque({**p, "thrust": 1.0})


def _by_formula(p: Parameters) -> Values:
    sign, safety = -1.0 if p["load"] < 0.0 else 1.0, p["safety"]
    if p["sought"] == "thrust":
        thrust, working_thrust = _formula_thrust(p), safety * _formula_thrust(p)
        torque = working_torque = p["load"]
    else:
        thrust = working_thrust = p["thrust"]
        torque = sign * carried_torque(p)
        working_torque = torque / safety
    return {
        "limit_torque": torque,
        "limit_thrust": thrust,
        "formula_ratio": 1.0,
        "working_torque": working_torque,
        "axial_force": np.array([np.nan, working_thrust]),
    }


def _by_states(p: Parameters) -> Values:
    from cvt_hpc.models.elastic_belt.belt import mesh
    from cvt_hpc.models.steady_variator.record import quantities
    from cvt_hpc.models.steady_variator.walking import NoSteadyState

    if p["sought"] == "thrust":
        limit = _at_least_thrust(p)
        first, belt = _first({**p, "thrust": p["safety"] * limit.belt.thrust})
        working = belt.at(p["load"], first)
    else:
        limit, first, belt = _largest(p)
        working = belt.at(limit.load / p["safety"], first)
    found, there = quantities(working, mesh(p)), quantities(limit, mesh(p))
    if (slip := np.abs(found["slip"]).max()) > GROSS_SLIP:
        raise NoSteadyState(f"no working point found: at {working.load:.4g} N m a pulley slips by {slip:.3g}")
    by_formula = carried_torque({**p, "thrust": limit.belt.thrust})
    return {
        "limit_torque": limit.load,
        "limit_thrust": limit.belt.thrust,
        "formula_ratio": abs(limit.load) / by_formula,
        "limit_slip": there["slip"],
        "working_torque": working.load,
        **{name: found[name] for name in _AT_WORK},
    }


def _largest(p: Parameters) -> tuple[Steady, Steady, SteadyBelt]:
    """State at the largest load that the thrust carries, the start of the continuation, and their belt."""
    first, belt = _first(p)
    return belt.carried(first), first, belt


def _first(p: Parameters) -> tuple[Steady, SteadyBelt]:
    """State where continuations begin, under a load that is carried by far, and its belt.

    Near the largest torque there are other states under the same load, up to a driven pulley that stands.
    """
    from cvt_hpc.models.steady_variator.walking import SteadyBelt

    belt = SteadyBelt(p)
    return belt.at(np.copysign(_FIRST_SHARE, p["load"]) * carried_torque(p)), belt


def _at_least_thrust(p: Parameters) -> Steady:
    """State at the least thrust that carries the load.

    The largest load is nearly proportional to the thrust. The driven speed does not lead there: under less
    thrust the belt sinks into the driven pulley, which turns the faster for it while slip slows it down.
    """
    from cvt_hpc.models.steady_variator.walking import NoSteadyState

    thrust = _formula_thrust(p)
    for _ in range(TRIES):
        limit, _, _ = _largest({**p, "thrust": thrust})
        share = p["load"] / limit.load
        if abs(share - 1.0) < WITHIN:
            return limit
        thrust *= share
    raise NoSteadyState(f"no least thrust found at {p['load']:g} N m: {thrust:.4g} N after {TRIES} tries")
