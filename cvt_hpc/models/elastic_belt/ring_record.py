"""Variables of ring layers in a record: tension and speed by layer, loss and sliding by surface."""

import numpy as np

from cvt_hpc.models.elastic_belt.lane_rings import LOSS, SLIDING, SPEED_SUM, TENSION
from cvt_hpc.models.elastic_belt.ring_settings import MOST_LAYERS, layer_count
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Coordinate, Variable, together
from cvt_hpc.variator.variables import Measured


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Dimensions of VARIABLES where the rings are layers: as many as there can be, for jobs that vary it."""
    if layer_count(parameters) == 1:
        return {}
    words = "0: saddle; k: between the layers k and k + 1; behind the outermost layer the elements' ears"
    return {
        "ring_layer": Coordinate(np.arange(1, MOST_LAYERS + 1), "1", "ring layer", "the inner one first"),
        "ring_surface": Coordinate(np.arange(MOST_LAYERS + 1), "1", "surface of ring layers", words),
    }


def of_layers(measured: Measured) -> tuple[np.ndarray, ...] | None:
    """Values of VARIABLES; not known where the rings are one."""
    means = measured.layer_means
    if means is None:
        return None
    padded = np.full((MOST_LAYERS + 1, means.shape[1]), np.nan)
    padded[: len(means)] = means
    # the ears have no layer behind them
    padded[len(means) - 1, TENSION:] = np.nan
    tensions, sliding = padded[:MOST_LAYERS, TENSION : TENSION + 2], padded[:, SLIDING : SLIDING + 2]
    return tensions, padded[:MOST_LAYERS, SPEED_SUM], padded[:, LOSS], sliding


VARIABLES = together(
    of_layers,
    Variable(
        "layer_tension",
        "N",
        "mean tension of each ring layer in the middle of the strand; nan: no such layer",
        dims=("ring_layer", "strand"),
        words="tension by ring layer",
    ),
    Variable(
        "layer_speed",
        "m s-1",
        "mean speed of each ring layer around the belt",
        dims=("ring_layer",),
        words="speed by ring layer",
    ),
    Variable(
        "surface_loss",
        "W",
        "mean loss of each sliding surface of the rings; together they are ring_loss",
        dims=("ring_surface",),
        words="loss by ring surface",
    ),
    Variable(
        "surface_sliding",
        "m s-1",
        "mean size of the sliding speed of each surface of the rings on the arc",
        dims=("ring_surface", "pulley"),
        words="sliding by ring surface",
    ),
)
