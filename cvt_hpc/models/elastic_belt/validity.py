"""Conditions that end a run, and checks of the numbers of a run that reached its end."""

from collections.abc import Iterable

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.models.elastic_belt.sampling import LARGEST_STRAIN, Outcome
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Failure, Status, Values
from cvt_hpc.variator import LARGEST_DISPLACEMENT
from cvt_hpc.variator.slip import GAINED, LOST

# Limit of the open power balance, over the power that flows, with REFERENCE_CELLS around the belt. Sound runs
# of 160 stations leave 0.005-0.2 % (2,000 random scenes: 99 in 100 below 0.05 %, the largest 0.39 %), chatter
# of friction 0.6 % and more. On coarser meshes the transport leaves more, in proportion to the cells, at
# any step.
LARGEST_POWER_RESIDUAL, REFERENCE_CELLS = 0.004, 159
BEYOND_LIMIT = 1.25  # of the longest stable step by formula: methods were found to hold up to 1.22 of it

_UNSOLVED = "the search for the closed stations of belt and sheaves did not end"
_LEFT = f"the belt is off its path by more than {LARGEST_DISPLACEMENT:.1%} of the distance of the shafts"
_STRAINED = f"strain is beyond {LARGEST_STRAIN:.0%}, or elements gape by that share of the belt's length"
# Of an end with a result the status is done.
FAILURES = {
    Outcome.NO_CONTACT_SOLUTION: (Status.FAILED_NUMERICS, _UNSOLVED),
    Outcome.NOT_FINITE: (Status.FAILED_NUMERICS, "the state is not a number"),
    Outcome.LEFT_THE_GROOVES: (Status.FAILED_NUMERICS, _LEFT),
    Outcome.OVERSTRAINED: (Status.FAILED_NUMERICS, _STRAINED),
    # results, and no faults: the torque is more than friction carries, and nothing new would come of the rest
    Outcome.SLIPPED_THROUGH: (Status.DONE, LOST),
    Outcome.RAN_AWAY: (Status.DONE, GAINED),
}


def slack_doubt(bending_stiffness: float, cell: float, least_force: float) -> Failure | None:
    """Whether a strand was pushed so slack that the growth in it is an effect of the mesh; the reason, if so.

    Under F = T - P - m v^2 < 0 waves of wave number k grow, at rest at the rate k sqrt((-F - EI k^2) / m): it
    buckles. So they do in the discretised strand beyond its critical speed sqrt((T - P) / m), whose shortest
    waves feel no gyroscopic force. With bending k = sqrt(-F / (2 EI)) is the fastest; without it the shortest
    wave is, at a rate that rises with every refinement: the problem is ill posed. There is doubt where the
    fastest wave has k cell > 1, fewer than some six cells: by EI [N m^2], the length of a strand's longest
    `cell` [m] and the smallest F in a strand over the run [N].
    """
    bearable = -2.0 * bending_stiffness / cell**2
    if least_force >= bearable:
        return None
    found = f"a strand is slack, T - P - m v^2 down to {least_force:.3g} N"
    return Status.FAILED_NUMERICS, f"{found}, where waves as short as its cells grow from {bearable:.3g} N on"


def power_limit(grid: Mesh) -> float:
    """Largest share of the power that flows which the balance may leave open, by the number of cells."""
    return LARGEST_POWER_RESIDUAL * max(1.0, REFERENCE_CELLS / grid.cell.size)


def step_doubt(step: float, limit: float) -> Failure | None:
    """Whether a step of `imex` [s] is beyond the longest stable one [s] of `transverse_limit`."""
    if step <= BEYOND_LIMIT * limit:
        return None
    why = f"the step {step:.3g} s is beyond the longest that is stable, {limit:.3g} s"
    return Status.FAILED_NUMERICS, f"{why}: shorter waves across the belt grow from step to step"


def reach_doubt(force: np.ndarray, grooves: Iterable[np.ndarray]) -> Failure | None:
    """Whether contact went on to the last stations that a groove may hold; the reason, if so.

    It might go on beyond them. By axial line forces of the flanks (N,) [N/m], of a state or a mean, and the
    stations (m,) that each groove may hold, in the direction of travel.
    """
    if not any((force[stations[[0, -1]]] > 0.0).any() for stations in grooves):
        return None
    why = "the belt touches a groove at the last station beyond its arc at which contact is tested"
    return Status.FAILED_NUMERICS, f"{why}: a longer contact would be cut off"


def doubt(record: Values, parameters: Parameters, grid: Mesh) -> Failure | None:
    """Whether a run that reached its end is not to be trusted; the reason, if so.

    By `power_residual`, `step_ripple` and `least_strand_force` of its record, and its flat values [SI].
    """
    residual = abs(record["power_residual"])
    if not residual <= power_limit(grid):
        why = f"the power balance is open by {residual:.3g} of the power that flows"
        return Status.FAILED_NUMERICS, why
    if record["step_ripple"] > parameters["most_step_ripple"]:
        why = f"speeds go to and fro from step to step, by {record['step_ripple'] * 1e3:.3g} mm/s on average"
        return Status.FAILED_NUMERICS, f"{why}: no motion of the belt is as fast"
    longest = float(grid.cell[grid.region == 1].max())
    return slack_doubt(parameters["bending_stiffness"], longest, record["least_strand_force"])
