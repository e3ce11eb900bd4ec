"""What a job may set of the deflection of the sheaves' discs, and the flexibilities that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cvt_hpc.parameters import Column, FromFile, Parameter, RowError, not_negative, positive
from cvt_hpc.physics.deflection import cone_flexibilities, interpolated, table_problem
from cvt_hpc.physics.geometry import variator

PULLEYS = ("driving", "driven")
CONE = ("cone_stiffness", "cone_shift")
TABLE_KEYS = tuple(f"{pulley}_flexibility{end}" for pulley in PULLEYS for end in ("_file", "_angle", ""))


def _arranged(pulley: str, columns: Mapping[str, Column]) -> dict[str, Any]:
    """Angles and flexibilities; the rows may come in any order."""
    places, values = columns["angle"].values, columns["flexibility"].values
    others = columns["other_angle"].values if "other_angle" in columns else (0.0,) * len(places)
    found: dict[tuple[float, float], float] = {}
    for row, (place, value) in enumerate(zip(zip(others, places, strict=True), values, strict=True)):
        if place in found:
            raise RowError(row, "one flexibility for each pair of angles", "a second one for these")
        found[place] = value
    angles, rows = sorted(set(places)), sorted(set(others))
    for one in rows:
        for other in angles:
            if (one, other) not in found:
                missing = f"{one:g} and {other:g} rad"
                raise ValueError(f"expected a flexibility for each pair of angles, found none for {missing}")
    table = [[found[one, other] for other in angles] for one in rows]
    return {f"{pulley}_flexibility_angle": angles, f"{pulley}_flexibility": table}


def _table(pulley: str) -> dict[str, Parameter]:
    angle, flexibility = gives = (f"{pulley}_flexibility_angle", f"{pulley}_flexibility")
    columns = {"angle": ("rad",), "other_angle": ("rad",), "flexibility": ("m/N",)}
    told = ", ".join(columns)
    text = f"CSV or netCDF file in the place of {' and '.join(gives)}; columns {told} (none: of revolution)"
    file = FromFile(columns, ("angle", "flexibility"), gives, partial(_arranged, pulley))
    return {
        f"{pulley}_flexibility_file": Parameter("", "", text, file=file),
        angle: Parameter(
            (), "rad", "angles of these flexibilities from the inlet, from 0 on", sensible=(1e-4, 7.0)
        ),
        flexibility: Parameter(
            (),
            "m/N",
            f"flexibilities w_ij of the {pulley} sheaves, opening of the groove by a force on both flanks: a "
            "row for each angle; of discs of revolution one row, over the angle between both",
            sensible=(1e-30, 1e-5),
        ),
    }


DEFLECTION: dict[str, Parameter] = {
    "sheave_deformation": Parameter(
        "bending",
        "",
        "deformation of the discs beside the tilt of their collars: local bending, a tilting cone, or "
        "flexibilities of a table",
        choices=("bending", "cone", "flexibilities"),
    ),
    "cone_stiffness": replace(
        positive(3e5, "N m/rad", "stiffness of a cone against tilting", sensible=(100.0, 1e9)),
        allow_infinite=True,
    ),
    "cone_shift": not_negative(
        0.0, "m", "shift of a cone's axis of tilting towards the middle of the arc", sensible=(1e-5, 0.2)
    ),
    **_table("driving"),
    **_table("driven"),
}

DEFLECTION_DEFAULTS = {key: parameter.default for key, parameter in DEFLECTION.items() if not parameter.file}


def flexibilities(
    parameters: Mapping[str, Any], pulley: str, stations: int, spacing: float, radius: float
) -> np.ndarray:
    """Flexibilities of one pulley's discs at the reference stiffness, (m, m) [m/N]; (0, 0): local bending.

    Parameters
    ----------
    parameters : mapping
        Flat values of the run [SI].
    pulley : str
        driving or driven.
    stations : int
        Those of the wrap, m.
    spacing, radius : float
        Their distance along the arc, and the pitch radius [m].
    """
    p = DEFLECTION_DEFAULTS | dict(parameters)
    if p["sheave_deformation"] == "cone":
        return cone_flexibilities(stations, spacing, radius, p["cone_stiffness"], p["cone_shift"])
    if p["sheave_deformation"] == "flexibilities":
        table = p[f"{pulley}_flexibility_angle"], p[f"{pulley}_flexibility"]
        return interpolated(*table, stations, spacing, radius)
    return np.empty((0, 0))


def deflection_problems(parameters: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Problems of the discs' deformation: (key, expected, found); the scene's sizes are taken as sound."""
    p = DEFLECTION_DEFAULTS | dict(parameters)
    kind = p["sheave_deformation"]
    if kind == "bending":
        return []
    if p.get("contact_sweeps", 0) > 0:
        return [("contact_sweeps", f"0 with sheave_deformation {kind}", f"{p['contact_sweeps']}")]
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    if kind == "cone":
        least = min(path.driving_radius, path.driven_radius)
        if p["cone_shift"] >= least:
            return [("cone_shift", f"less than the radii, {least:.4g} m", f"{p['cone_shift']:g} m")]
        return []
    problems = []
    for pulley, wrap in zip(PULLEYS, (path.driving_wrap, path.driven_wrap), strict=True):
        key = f"{pulley}_flexibility"
        told = table_problem(p[f"{key}_angle"], p[key], wrap)
        if told:
            problems.append((key, *told))
    return problems


def deflection_inert(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Settings of the deformation without effect, each with the setting that makes it so."""
    kind = (DEFLECTION_DEFAULTS | dict(parameters))["sheave_deformation"]
    setting = f"sheave_deformation {kind}"
    of_kinds = {"bending": ("local_stiffness", "local_length"), "cone": CONE, "flexibilities": TABLE_KEYS}
    return {key: setting for other, keys in of_kinds.items() if other != kind for key in keys}
