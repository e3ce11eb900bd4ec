"""The quantity that a run changes all along, by its parameters."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple


class Quantity(NamedTuple):
    """A ramped quantity: the parameter that has it change, its name, and its units.

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
    "time": Quantity("profile_time", 1.0, "s", "s", "time"),
}
CONSTANT = ("constant", ())  # of the parameters that have a quantity change


def ramped(parameters: Mapping[str, Any]) -> str:
    """The one of QUANTITIES that a run changes all along; "" where its judged part has constant values.

    It is "time" where profiles go on while the run is judged. Models without ramps or profiles lack their
    keys.
    """
    p = parameters
    for name, quantity in QUANTITIES.items():
        course = p.get(quantity.history, "constant")
        if course == "ramp":
            return name
        if course not in CONSTANT and course[-1] > (1.0 - p["judged_fraction"]) * p["duration"] * (
            1.0 + 1e-9
        ):
            return name
    return ""


def along_ramp(parameters: Mapping[str, Any]) -> str:
    """The setting by which a run changes all along, in words; "" where it does not. As of `ramped`."""
    quantity = ramped(parameters)
    if quantity == "time":
        return "profiles that go on to the judged part"
    return quantity and f"{QUANTITIES[quantity].history} ramp"
