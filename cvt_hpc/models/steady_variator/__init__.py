"""The running steady state of the elastic belt, solved as a boundary value problem with complementarity.

It answers *what are the forces?*: ring tension and push force in each strand, contact forces and sliding over
both wraps, thrust ratio and loss of speed, at a load at which the belt runs quietly. It is the elastic belt
itself: same parameters, same right-hand side, none of its time. It cannot answer whether that state is
stable, and so whether the belt vibrates about it, or how far; the mean forces of a belt that vibrates.
Importing this package is cheap.
"""

from cvt_hpc.models.steady_variator.parameters import PARAMETERS, check, inert

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]
