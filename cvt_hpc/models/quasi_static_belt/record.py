"""What the record of a run holds: as of the elastic belt."""

from functools import partial

from cvt_hpc.models.elastic_belt import grouping
from cvt_hpc.models.elastic_belt.record import (
    VARIABLES,
    coordinates,
    evaluate,
    histories,
    judge,
    lane_key,
    lanes,
)

# Core-seconds per station and time step of SciPy's BDF, whose steps are not known beforehand: of 15 us
cost = partial(grouping.cost, step_cost={"scipy_bdf": 1e-4})

__all__ = ["VARIABLES", "coordinates", "cost", "evaluate", "histories", "judge", "lane_key", "lanes"]
