"""What is wrong with the parameters of a friction law, and which of them are idle, as models tell a job."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_OF_FORMULAS = ("friction_gradient", "kinetic_friction", "stribeck_velocity")
_OF_TABLES = ("table_file", "table_force", "table_speed", "table_mu")


def friction_problems(parameters: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Problems of a friction law: (key, expected, found).

    Parameters
    ----------
    parameters : mapping
        Values by name [SI], of which those of the law count.
    """
    p = parameters
    if p["friction_law"] == "table":
        return _table_problems(p["table_force"], p["table_speed"], p["table_mu"])
    if p["friction_law"] == "coulomb" and p["friction_gradient"] != 0.0:
        return [("friction_gradient", "0 with friction_law coulomb", f"{p['friction_gradient']:g} s/m")]
    return []


def friction_inert(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Parameters of a friction law without effect, each with the setting that makes it so.

    Parameters
    ----------
    parameters : mapping
        Values by name [SI], of which those of the law count.
    """
    p = parameters
    cases = (
        (p["friction_law"] == "table", _OF_FORMULAS, "friction_law table"),
        (p["friction_law"] != "table", _OF_TABLES, f"friction_law {p['friction_law']}"),
        (p["friction_law"] == "hyperbolic", ("stribeck_velocity",), "friction_law hyperbolic"),
        (p["friction_law"] == "coulomb", ("stribeck_velocity",), "friction_law coulomb"),
        (p["friction_gradient"] == 0.0, ("stribeck_velocity",), "friction_gradient 0"),
    )
    return {key: setting for holds, keys, setting in cases if holds for key in keys}


def _table_problems(force: tuple, speed: tuple, mu: tuple) -> list[tuple[str, str, str]]:
    """Problems of a friction table: (key, expected, found); the first one only.

    Parameters
    ----------
    force, speed : tuples
        Its knots [N/m, or N for a single contact], [m/s].
    mu : tuple of tuples
        A row of coefficients for each force [1].
    """
    for key, grid in (("table_force", force), ("table_speed", speed)):
        if len(grid) < 2 or np.any(np.diff(grid) <= 0.0):
            return [(key, "at least two ascending values", f"{list(grid)}")]
    shape = (len(force), len(speed))
    if len(mu) != shape[0] or any(not isinstance(row, tuple) or len(row) != shape[1] for row in mu):
        lengths = ", ".join(str(len(row)) if isinstance(row, tuple) else "no row" for row in mu)
        return [("table_mu", f"{shape[0]} rows of {shape[1]} coefficients", f"rows of {lengths or 'none'}")]
    if np.min(mu) <= 0.0:
        return [("table_mu", "coefficients > 0", f"{np.min(mu):g}")]
    return []
