"""What the record of a run holds, what a run costs, and how it is judged."""

import numpy as np

from cvt_hpc.variables import Coordinate
from cvt_hpc.vibration.assessment import VARIABLES, assess

__all__ = ["VARIABLES", "coordinates", "cost", "judge"]


def coordinates(parameters):
    """Dimensions of the record beside the grid's."""
    return {"strand": Coordinate(np.array(["mass"]), "", "moving body")}


def cost(parameters, stepper):
    """Core-seconds of a run."""
    return 1e-7 * parameters["duration"] / parameters.get("step", 1e-6)


def judge(run):
    """Values and verdict of a run at its end."""
    return assess(run.displacement, 1.0 / run.interval, ("mass",), run.parameters).record()
