"""The record of a run: as of the elastic belt."""

from functools import partial

from cvt_hpc.models.elastic_belt import grouping, record

# Core-seconds per station and time step, measured beside other work at 160 stations
cost = partial(grouping.cost, step_cost={"split": 8.5e-7})
VARIABLES, coordinates, judge = record.VARIABLES, record.coordinates, record.judge
histories, lane_key, lanes = record.histories, grouping.lane_key, grouping.lanes
