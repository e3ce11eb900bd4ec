"""The quantity that a run changes all along, by its parameters."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple


class Quantity(NamedTuple):
    """A ramped quantity: the parameter that selects it, its name, and its units.

    Units in sentences are those for people, `factor` times a value [cf_units].
    """

    history: str
    factor: float
    units: str
    cf_units: str
    long_name: str


QUANTITIES = {
    "load": Quantity("load_history", 1.0, "N m", "N m", "load"),
    "speed": Quantity("speed_history", 30.0 / math.pi, "rpm", "rad s-1", "speed of the driving pulley"),
}


def ramped(parameters: Mapping[str, Any]) -> str:
    """Which of QUANTITIES a run changes all along; "" where it keeps both.

    Parameters
    ----------
    parameters : mapping
        Flat parameters of a run; of a model without ramps, without their keys.
    """
    ramps = (name for name, q in QUANTITIES.items() if parameters.get(q.history, "constant") == "ramp")
    return next(ramps, "")
