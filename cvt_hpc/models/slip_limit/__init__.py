"""Where a belt begins to slip: the largest torque under a thrust, or the least thrust for a torque.

Two methods answer: Bullinger et al. 2005, eq. 2, in a microsecond, and steady states of the elastic belt as
its driven pulley is slowed down, in seconds. The latter also give the working point that is safe by a factor:
thrusts of both pulleys, efficiency and losses by their part. It cannot answer whether the belt vibrates
there. A belt whose gaps wander may carry some per cent more than its steady states do. Importing this package
is cheap.
"""

from cvt_hpc.models.slip_limit.parameters import PARAMETERS, check, inert

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]
