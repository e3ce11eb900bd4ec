"""The results of a chart as netCDF, with all that is needed to repeat it."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.chart.comparing import Comparison, Result
from cvt_hpc.chart.plan import Chart
from cvt_hpc.chart.quantities import KINDS
from cvt_hpc.study.gather import merge_versions
from cvt_hpc.study.provenance import command, history_line, versions

_TIMED = "depends on the machine and the hour"


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
        By what they were measured: versions, revision and machine, each of them once.

    Returns
    -------
    Dataset
        Along the dimension `point`.
    """
    rows = [r for c in comparisons for r in (c.reference, *c.methods, *c.choices)]
    variables: dict[str, Any] = _descriptions(rows) | _costs(rows)
    for name in KINDS:
        if not any(name in row.errors for row in rows):
            continue
        words = name.replace("_", " ")
        errors = [row.errors.get(name, np.nan) for row in rows]
        variables[f"{name}_error"] = _along(errors, "1", f"error of the {words}; of a reference its own")
        below = np.array([name in row.below for row in rows], "i1")
        variables[f"{name}_below_reference"] = _flag(
            below, f"whether the error of the {words} is below the reference's"
        )
        if name not in ("trajectory", "occurrence"):
            values = [row.values.get(name, np.nan) for row in rows]
            variables[name] = _along(values, KINDS[name].unit, f"{words}, pooled over the starts")
    points = ("point", np.array([row.point.name for row in rows], dtype=object), {"long_name": "point"})
    return xr.Dataset(variables, {"point": points}, _attributes(chart, comparisons, makers))


def _descriptions(rows: Sequence[Result]) -> dict[str, Any]:
    texts = {
        "scene": ("scene", lambda r: r.point.scene),
        "role": ("what the point was measured for", lambda r: r.point.role.value),
        "method": ("method or choice", lambda r: r.point.label),
        "stepper": ("stepper", lambda r: r.point.job.stepper),
        "reason": ("why the point failed", lambda r: r.measurement.reason),
    }
    variables: dict[str, Any] = {
        name: ("point", np.array([read(row) for row in rows], dtype=object), {"long_name": text})
        for name, (text, read) in texts.items()
    }
    for key, unit in (("step", "s"), ("tolerance", "1")):
        settings = [row.point.setting if row.point.key == key else np.nan for row in rows]
        variables[key] = _along(settings, unit, f"{key} of the method")
    variables["chosen"] = _flag([r.chosen for r in rows], "cheapest point that meets all tolerances")
    variables["failed"] = _flag([bool(r.measurement.reason) for r in rows], "whether the point failed")
    variables["refines"] = _flag([r.point.refines for r in rows], "nearer to the truth than the base")
    return variables


def _costs(rows: Sequence[Result]) -> dict[str, Any]:
    variables = {
        "core_seconds_per_simulated_second": _along(
            [row.measurement.cost for row in rows], "1", "cost of a run, shortest of all repeats"
        ),
        "core_seconds": _along([row.measurement.core_seconds for row in rows], "s", "time of the first pass"),
        "simulated_seconds": _along([row.measurement.simulated for row in rows], "s", "simulated time"),
        "starts": _along([float(row.point.starts) for row in rows], "1", "runs from as many starts"),
    }
    for name in ("core_seconds_per_simulated_second", "core_seconds"):
        variables[name][2]["comment"] = _TIMED
    for name in dict.fromkeys(name for row in rows for name in row.measurement.counters):
        counts = [row.measurement.counters.get(name, np.nan) for row in rows]
        variables[f"work_{name}"] = _along(counts, "1", f"{name.replace('_', ' ')}, mean over the starts")
    return variables


def _along(values: Sequence[float], units: str, long_name: str) -> tuple[str, np.ndarray, dict[str, str]]:
    return "point", np.array(values, float), {"units": units, "long_name": long_name}


def _flag(values: Sequence[bool] | np.ndarray, long_name: str) -> tuple[str, np.ndarray, dict[str, Any]]:
    flags = {"flag_values": np.array([0, 1], "i1"), "flag_meanings": "no yes", "long_name": long_name}
    return "point", np.array(values, "i1"), flags


def _attributes(
    chart: Chart, comparisons: Sequence[Comparison], makers: Sequence[dict[str, Any]]
) -> dict[str, str]:
    return {
        "Conventions": "CF-1.11",
        "title": chart.description or chart.name,
        "source": f"cvt_hpc {versions()['cvt_hpc']}, speed against accuracy",
        "history": history_line(f"{command()} (on {platform.node()})"),
        "job_name": chart.name,
        "job": json.dumps(chart.resolved()),
        "job_fingerprint": chart.fingerprint(),
        "verdicts": json.dumps({c.scene.name: c.verdict for c in comparisons}),
        "versions": json.dumps(merge_versions([maker["versions"] for maker in makers])),
        "machine": json.dumps([*{str(m["machine"]): m["machine"] for m in makers}.values()]),
        "git_revision": ", ".join(dict.fromkeys(maker["git_revision"] for maker in makers)),
    }
