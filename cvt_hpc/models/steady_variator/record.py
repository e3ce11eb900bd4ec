"""Variables in the record of a steady state; names are those of the elastic belt's transient."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Coordinate, Status, Values, Variable, Vibrates, together, values
from cvt_hpc.variator import GROSS_SLIP
from cvt_hpc.variator.slip import AGAINST_SLIP
from cvt_hpc.variator.variables import COORDINATES, each_pulley, shared

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.models.elastic_belt.belt import Mesh
    from cvt_hpc.models.steady_variator.walking import Steady

VARIABLES = (
    Variable("mean_ring_tension", "N", "ring tension in the middle of the strand", dims=("strand",)),
    Variable("mean_push_force", "N", "push force in the middle of the strand", dims=("strand",)),
    each_pulley("axial_force", "N", "axial force of the belt on a sheave"),
    each_pulley("slip", "1", "tangential sliding over belt speed, weighted by contact force"),
    *together(attrgetter("against_slip"), *AGAINST_SLIP),
    each_pulley("open_share", "1", "out of contact", words="open share of the wrap"),
    Variable("thrust_ratio", "1", "axial force of the driving over that of the driven pulley"),
    Variable("speed_loss", "1", "1 - ratio x driven speed / driving speed"),
    Variable("driven_position", "m", "axial opening of the driven pulley"),
    *shared("flank_loss", "driving_power", "load_power", "ring_loss", "belt_loss"),
    *shared("layer_loss", "seating_loss", "loss", "efficiency", "power_residual"),
)


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, whatever the parameters."""
    return dict(COORDINATES)


def cost(parameters: Parameters, stepper: None) -> Any:
    """Core-seconds of a run: of a first state, 0.5 to 45 at 160 stations."""
    return 8e-4 * parameters["stations"] ** 2


class Found(NamedTuple):
    """A steady state on its mesh, and its values of VARIABLES."""

    steady: Steady
    grid: Mesh
    values: Values


def quantities(steady: Steady, grid: Mesh) -> Values:
    """Values of VARIABLES of a steady state."""
    from cvt_hpc.models.steady_variator.forces import SteadyMeans

    return values(VARIABLES, SteadyMeans(steady, grid))


def solve(parameters: Parameters) -> Found | ValueError:
    """Steady state of the parameters of a run [SI] with its results; or the reason why none was found."""
    from cvt_hpc.models.elastic_belt.belt import mesh
    from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt

    try:
        steady, grid = SteadyBelt(parameters).at(parameters["load"]), mesh(parameters)
        return Found(steady, grid, quantities(steady, grid))
    except NoSteadyState as error:
        return error


def judge(solution: Found | ValueError) -> Values:
    """The record of a run, its cost apart."""
    from cvt_hpc.models.steady_variator.first_states import SlipsThrough

    if isinstance(solution, SlipsThrough):
        return {"status": Status.DONE, "vibrates": Vibrates.SLIPS, "reason": str(solution)}
    if isinstance(solution, ValueError):
        return {"status": Status.FAILED_NUMERICS, "reason": str(solution)}
    largest = np.abs(solution.values["slip"]).max()
    if largest > GROSS_SLIP:
        reason = f"a steady state in which a pulley slips by {largest:.3g} of the belt's speed"
        return {"status": Status.DONE, "vibrates": Vibrates.SLIPS, "reason": reason, **solution.values}
    reason = "a steady state, and whether it is stable is not asked here"
    return {"status": Status.DONE, "vibrates": Vibrates.UNDECIDED, "reason": reason, **solution.values}


def histories(solution: Found | ValueError) -> xr.Dataset:
    """Speeds and forces by `position`; nothing where no state was found."""
    import xarray as xr

    from cvt_hpc.models.steady_variator.forces import profiles

    return xr.Dataset() if isinstance(solution, ValueError) else profiles(solution.steady, solution.grid)
