"""Whether a run that reached its end left the ground on which its numbers stand."""

from __future__ import annotations

from cvt_hpc.variables import Status


def slack_doubt(bending_stiffness: float, cell: float, least_force: float) -> tuple[Status, str] | None:
    """Whether a strand was pushed so slack that what grows in it is the mesh's.

    Under F = T - P - m v^2 < 0 waves of wave number k grow, at rest at the rate k sqrt((-F - EI k^2) / m): it
    buckles. So they do in the discretised strand beyond its critical speed sqrt((T - P) / m), whose shortest
    waves feel no gyroscopic force. With bending k = sqrt(-F / (2 EI)) is the fastest; without it the shortest
    wave is, at a rate that rises with every refinement: the problem is ill posed.

    Parameters
    ----------
    bending_stiffness : float
        EI [N m^2].
    cell : float
        Length of a strand's cells [m].
    least_force : float
        Smallest F in a strand over the run [N].

    Returns
    -------
    (Status, str) or None
        What is wrong, where the fastest wave has k cell > 1: fewer than some six cells.
    """
    bearable = -2.0 * bending_stiffness / cell**2
    if least_force >= bearable:
        return None
    found = f"a strand is slack, T - P - m v^2 down to {least_force:.3g} N"
    return Status.FAILED_NUMERICS, f"{found}, where waves as short as its cells grow from {bearable:.3g} N on"
