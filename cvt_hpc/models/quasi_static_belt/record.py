"""What the record of a run holds: as of the elastic belt."""

from cvt_hpc.models.elastic_belt.record import VARIABLES, coordinates, evaluate, histories, lane_key, lanes

# Core-seconds per station and time step of SciPy's BDF, whose steps are not known beforehand: of 15 us
STEP_COST = {"scipy_bdf": 1e-4}

__all__ = ["STEP_COST", "VARIABLES", "coordinates", "evaluate", "histories", "lane_key", "lanes"]
