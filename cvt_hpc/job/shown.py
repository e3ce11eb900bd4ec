"""Values of axes for people: in the unit in which the job gives them, by the attributes of a coordinate."""

import math
from collections.abc import Mapping
from typing import Any

from cvt_hpc.job.units import factor_to, from_si
from cvt_hpc.job.values import in_words

JOB_UNITS = "job_units"  # attribute of a coordinate, beside `units`
POINT_UNITS = "point_units"  # attribute of a history: by key, beside the values `point`


def si_unit(attributes: Mapping[str, Any]) -> str:
    """Return the SI unit of a coordinate with these attributes; "" for texts and plain numbers."""
    unit = str(attributes.get("units", ""))
    return "" if unit == "1" else unit


def shown_unit(attributes: Mapping[str, Any]) -> str:
    """Return the unit in which a coordinate is shown: that of the job, else the SI unit."""
    unit, wanted = si_unit(attributes), str(attributes.get(JOB_UNITS, ""))
    # a dataset may be that of anybody
    return wanted if wanted and (factor_to(unit, wanted) or 0.0) > 0.0 else unit


def shown_number(value: Any, attributes: Mapping[str, Any]) -> Any:
    """Return a value [SI] of a coordinate in its `shown_unit`; a text as it is."""
    return from_si(value, si_unit(attributes), shown_unit(attributes)) if isinstance(value, float) else value


def shown(value: Any, attributes: Mapping[str, Any]) -> str:
    """Return a value [SI] of a coordinate with its `shown_unit`, such as "3000 rpm"."""
    return in_words(value, si_unit(attributes), shown_unit(attributes))


def number_within(value: float, closest: float, attributes: Mapping[str, Any]) -> str:
    """Return `shown_number` of a value [SI] with as many decimals as show differences of `closest` [SI]."""
    decimals = -math.floor(math.log10(shown_number(closest, attributes)) + 1e-9)
    return f"{shown_number(value, attributes):.{max(decimals, 0)}f}"


def shown_as_read(value: float, attributes: Mapping[str, Any]) -> str:
    """Return the same for an error, with the value [SI], which may have been meant in another unit."""
    in_si = in_words(value, si_unit(attributes))
    return in_si if (text := shown(value, attributes)) == in_si else f"{text} ({in_si})"


def heading(name: str, attributes: Mapping[str, Any]) -> str:
    """Return the head of a table's column of `shown_number`, such as "driving_speed [rpm]"."""
    unit = shown_unit(attributes)
    return f"{name} [{unit}]" if unit else name
