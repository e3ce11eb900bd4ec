"""The results of a chart as netCDF, with all that is needed to repeat it."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.chart.comparing import Comparison, Result
from cvt_hpc.chart.plan import Chart
from cvt_hpc.chart.quantities import KINDS
from cvt_hpc.netcdf import VOLATILE, attributes, global_attributes

CHOSEN = "cheapest point of its scene that meets all tolerances"
REFINES = "whether a choice is nearer to the truth than the base"
_Variable = tuple[str, np.ndarray, dict[str, Any]]


def chart_dataset(
    chart: Chart, comparisons: Sequence[Comparison], makers: Sequence[dict[str, Any]]
) -> xr.Dataset:
    """Return the results as a dataset: errors, values, cost and work of each point, and how it ended.

    Parameters
    ----------
    chart : Chart
        The job, which goes into the attributes.
    comparisons : sequence of Comparison
        The results.
    makers : sequence of dict
        Origin of the measurements: versions, revision and machine, each of them once.

    Returns
    -------
    Dataset
        Along the dimension `point`.
    """
    rows = [result for comparison in comparisons for result in comparison.results]
    variables: dict[str, Any] = _descriptions(rows) | _costs(rows)
    for name in KINDS:
        if not any(name in row.errors for row in rows):
            continue
        words = name.replace("_", " ")
        errors = [row.errors.get(name, np.nan) for row in rows]
        variables[f"{name}_error"] = _along(errors, "1", f"{words} error", "of a reference its own")
        below = np.array([name in row.below for row in rows], "i1")
        text = "whether the error is below the reference's own"
        variables[f"{name}_below_reference"] = _flag(below, f"{words} below the reference", text)
        if name not in ("trajectory", "occurrence"):
            values = [row.values.get(name, np.nan) for row in rows]
            variables[name] = _along(values, KINDS[name].unit, words, "pooled over the starts")
    points = ("point", np.array([row.point.name for row in rows], dtype=object), attributes("point"))
    return xr.Dataset(variables, {"point": points}, _attributes(chart, comparisons, makers))


def _descriptions(rows: Sequence[Result]) -> dict[str, Any]:
    texts = {
        "scene": ("", lambda r: r.point.scene),
        "role": ("what the point was measured for", lambda r: r.point.role.value),
        "method": ("method or choice", lambda r: r.point.label),
        "stepper": ("", lambda r: r.point.job.stepper),
        "reason": ("why the point failed", lambda r: r.measurement.reason),
    }
    variables: dict[str, Any] = {
        name: ("point", np.array([read(row) for row in rows], dtype=object), attributes(name, comment=text))
        for name, (text, read) in texts.items()
    }
    for key, unit in (("step", "s"), ("tolerance", "1")):
        settings = [row.point.setting if row.point.key == key else np.nan for row in rows]
        variables[key] = _along(settings, unit, key, "of the method")
    variables["chosen"] = _flag([r.chosen for r in rows], "chosen", CHOSEN)
    variables["failed"] = _flag([bool(r.measurement.reason) for r in rows], "failed", "see reason")
    variables["refines"] = _flag([r.point.refines for r in rows], "refines", REFINES)
    return variables


def _costs(rows: Sequence[Result]) -> dict[str, Any]:
    found = [row.measurement for row in rows]
    least, first = f"of methods the least of all repeats; {VOLATILE}", f"of the first pass; {VOLATILE}"
    variables = {
        "core_seconds_per_simulated_second": _along([m.cost for m in found], "1", "cost of a run", least),
        "core_seconds": _along([m.core_seconds for m in found], "s", "processor time", first),
        "simulated_seconds": _along([m.simulated for m in found], "s", "simulated time", "of a run"),
        "starts": _along([row.point.starts for row in rows], "1", "starts", "number of pooled runs"),
    }
    for name in dict.fromkeys(name for row in rows for name in row.measurement.counters):
        counts = [row.measurement.counters.get(name, np.nan) for row in rows]
        variables[f"work_{name}"] = _along(counts, "1", name.replace("_", " "), "mean over the starts")
    return variables


def _along(values: Sequence[float], units: str, long_name: str, comment: str) -> _Variable:
    return "point", np.array(values, float), attributes(long_name, units, comment)


def _flag(values: Sequence[bool] | np.ndarray, long_name: str, comment: str) -> _Variable:
    flags = {"flag_values": np.array([0, 1], "i1"), "flag_meanings": "no yes"}
    return "point", np.array(values, "i1"), attributes(long_name, comment=comment) | flags


def _attributes(
    chart: Chart, comparisons: Sequence[Comparison], makers: Sequence[dict[str, Any]]
) -> dict[str, str]:
    return {
        **global_attributes(chart, chart.resolved(), "speed against accuracy", makers=makers),
        "job_fingerprint": chart.fingerprint(),
        "verdicts": json.dumps({c.scene.name: c.verdict for c in comparisons}),
        "machine": json.dumps([*{str(m["machine"]): m["machine"] for m in makers}.values()]),
    }
