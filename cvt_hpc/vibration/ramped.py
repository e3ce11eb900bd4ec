"""What a run changes all along, by its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Quantity(NamedTuple):
    """What a ramp changes: the parameter that says so, units in sentences and in attributes, and its name."""

    history: str
    units: str
    cf_units: str
    long_name: str


QUANTITIES = {
    "load": Quantity("load_history", "N m", "N m", "load"),
    "speed": Quantity("speed_history", "rad/s", "rad s-1", "speed of the driving pulley"),
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
