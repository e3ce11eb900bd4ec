"""The record of a run: as of the elastic belt."""

from functools import partial

from cvt_hpc.models.elastic_belt import grouping
from cvt_hpc.models.elastic_belt.record import VARIABLES, coordinates, histories, judge, lane_key, lanes

# Core-seconds per station and time step, measured beside other work at 160 stations
cost = partial(grouping.cost, step_cost={"split": 8.5e-7})

__all__ = ["VARIABLES", "coordinates", "cost", "histories", "judge", "lane_key", "lanes"]
