"""The same run in other units of force, time and length: what it takes, and what it finds, by dimension analysis."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.job import Job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.simulation import record_variables, run_point
from support.marched import never
from support.rungs import rung_job

# Powers of force, time and length; a kilogram is a newton second squared per metre.
BASES = {
    "N": (1, 0, 0),
    "s": (0, 1, 0),
    "m": (0, 0, 1),
    "kg": (1, 2, -1),
    "Hz": (0, -1, 0),
    "J": (1, 0, 1),
    "W": (1, -1, 1),
    "Pa": (1, 0, -2),
    "rad": (0, 0, 0),
    "1": (0, 0, 0),
}
TOKEN = re.compile(r"\s*(?:(?P<sign>/)|(?P<base>[A-Za-z]+|1)\^?(?P<power>[+-]?\d+)?)\s*")


class Scale(NamedTuple):
    """Factors on force, time and length: powers of two, so that a scaled number has the same digits."""

    force: float = 1.0
    time: float = 1.0
    length: float = 1.0

    def of(self, unit: str) -> float:
        """Factor on a quantity of a unit as pint or CF writes it."""
        factor, position, sign = 1.0, 0, 1
        while position < len(unit):
            token = TOKEN.match(unit, position)
            assert token, unit
            position = token.end()
            if token["sign"]:
                sign = -1
                continue
            powers = np.array(BASES[token["base"]]) * sign * int(token["power"] or 1)
            factor *= float(np.prod(np.array(self) ** powers.astype(float)))
            sign = 1
        return factor

    def point(self, job: Job, point: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters of a run [SI], its numerics and its judgement among them, scaled."""
        declared = load_schema(job.model, job.stepper, job.source).parameters
        return {key: _scaled(value, self.of(declared[key].unit)) for key, value in point.items()}


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, (list, tuple)):
        return type(value)(_scaled(each, factor) for each in value)
    return value if factor == 1.0 else value * factor


@cache
def _record(model: str, scale: Scale, stepper: str | None, values: frozenset[tuple[str, Any]]) -> dict:
    asked = rung_job(model, stepper=stepper, **dict(values))
    return run_point(asked, scale.point(asked, asked.point(0)), never)


def scaled_back(model: str, scale: Scale, stepper: str | None = None, **values) -> tuple[dict, dict]:
    """Records of a run and of the scaled one, without times of computing; the second in the units of the first.

    `reason`, which has numbers, is left out, but for the words of a failure.
    """
    asked = rung_job(model, stepper=stepper, **values)
    declared = [v for v in record_variables(asked) if not v.volatile and v.name != "reason"]
    records = ({}, {})
    for record, own in zip(records, (Scale(), scale), strict=True):
        one = _record(model, own, stepper, frozenset(values.items()))
        for variable in declared:
            value = np.asarray(one[variable.name])
            factor = own.of(variable.units)
            record[variable.name] = value if factor == 1.0 else value / factor
    return records


def different(one: Mapping[str, Any], other: Mapping[str, Any], names: Iterable[str] | None = None) -> dict:
    """Variables in which two records differ, with the largest difference over the largest value."""
    found = {}
    for name in one if names is None else names:
        a, b = np.asarray(one[name]), np.asarray(other[name])
        if a.tobytes() == b.tobytes():
            continue
        if a.dtype.kind not in "fiu" or a.shape != b.shape or np.any(np.isnan(a) != np.isnan(b)):
            found[name] = np.inf
        else:
            gap = np.nanmax(np.abs(a.astype(float) - b)) if a.size else 0.0
            found[name] = float(gap / max(np.nanmax(np.abs(a)), np.nanmax(np.abs(b)), 1e-300))
    return found
