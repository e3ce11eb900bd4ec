"""The text under the panels of a scene: the chosen method, and points that are not drawn, with the reason."""

import math
import re
from textwrap import wrap

from cvt_hpc.analysis.figures import with_units
from cvt_hpc.chart.comparing import Comparison, Result

_LINE_LENGTH = 104  # [letters]
LARGEST_ERROR = 10.0  # relative: errors beyond are named, and not drawn
_DETAILS = re.compile(r" \([^()]*\)$")


def notes(comparison: Comparison) -> list[str]:
    """Text under the panels: the chosen method, and points that are not drawn, with the reason."""
    point = comparison.reference.point
    known = f"{point.label} at {point.setting_in_words}; its own error from a coarser one"
    lines = [f"reference: {'exact solution' if comparison.scene.exact else known}"]
    lines.append(f"cheapest within all tolerances: {comparison.verdict}")
    for why, methods in _omitted(comparison).items():
        each = "; ".join(f"{label} ({', '.join(settings)})" for label, settings in methods.items())
        lines.append(f"omitted: {why}: {each}")
    return [part for line in lines for part in wrap(with_units(line), _LINE_LENGTH, subsequent_indent="    ")]


def _omitted(comparison: Comparison) -> dict[str, dict[str, list[str]]]:
    """Points that are not drawn in all panels: reason -> method -> settings."""
    omitted: dict[str, dict[str, list[str]]] = {}
    for result in comparison.methods:
        for why in _reasons(result):
            methods = omitted.setdefault(why, {})
            methods.setdefault(result.point.label, []).append(result.point.setting_in_words)
    return omitted


def _reasons(result: Result) -> list[str]:
    """Why a point is not drawn, in general words: where and after how many steps is in the table."""
    if reason := result.measurement.reason:
        return [f"failed, {_DETAILS.sub('', reason.partition(': ')[2])}"]
    errors = {name.replace("_", " "): error for name, error in result.errors.items()}
    reasons = [f"no {name}" for name, error in errors.items() if math.isinf(error)]
    if any(LARGEST_ERROR < error < math.inf for error in errors.values()):
        reasons.append(f"error of more than {LARGEST_ERROR:.0%}")
    return reasons
