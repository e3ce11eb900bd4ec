"""One run: a model marched by a stepper, or solved at once, judged, and turned into a record or a history."""

from cvt_hpc.simulation.record import (
    declared_record,
    estimate_cost,
    forget,
    lane_groups,
    may_join,
    pilot_share,
    profile_bytes,
    record_coordinates,
    record_variables,
    run_costs,
    turns,
)
from cvt_hpc.simulation.running import Interrupted, alone, run_point, run_points, run_points_keeping, simulate

__all__ = [
    "declared_record",
    "Interrupted",
    "estimate_cost",
    "forget",
    "lane_groups",
    "may_join",
    "pilot_share",
    "profile_bytes",
    "record_coordinates",
    "record_variables",
    "run_costs",
    "run_point",
    "run_points",
    "run_points_keeping",
    "simulate",
    "alone",
    "turns",
]
