"""The elastic belt with all that is faster than a limit frequency lagging behind its forces.

Another model than `elastic_belt`, made of its parts: `equations.py` says what it
keeps and what it drops. Importing this package is cheap.
"""

from cvt_hpc.models import elastic_belt
from cvt_hpc.models.elastic_belt import check, inert
from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers import taken

PARAMETERS = {table: keys for table, keys in elastic_belt.PARAMETERS.items() if table != "pulleys"} | {
    "limit": {
        "limit_frequency": Parameter(
            1000.0,
            "Hz",
            "splines of a higher own frequency, and all longitudinal motion, follow their forces with a lag",
            minimum=0.0,
            exclusive=True,
            sensible=(10.0, 1000000.0),
        ),
    },
}
DEFAULT_STEPPER = "scipy_bdf"
STEPPERS = taken(elastic_belt.REFUSED)
REFUSED = elastic_belt.REFUSED | dict.fromkeys(
    elastic_belt.OWN_STEPPERS, "it is a step for the belt with all its inertia"
)

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
