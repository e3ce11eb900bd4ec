"""The friction table of a CSV file: a coefficient for each pair of normal force and sliding speed."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from cvt_hpc.parameters import Column, FromFile, Parameter, RowError

KEYS = ("table_force", "table_speed", "table_mu")
_OTHER_NAMES = {
    "cof": "mu",
    "coefficient_of_friction": "mu",
    "friction_coefficient": "mu",
    "\u03bc": "mu",
    "normal_force": "force",
    "velocity": "speed",
    "sliding_speed": "speed",
    "sliding_velocity": "speed",
}
_ANY_FORCE = (0.0, 1.0)  # knots of a table that does not depend on the force, which is held outside


def friction_file(force_unit: str) -> Parameter:
    """Return the parameter that names the file of a friction table.

    Parameters
    ----------
    force_unit : str
        Of the normal forces of the table [N/m, or N for a single contact]. Where it is N/m the file may have
        the normal force of an element [N] instead, together with `element_pitch` [m]: the line force is the
        former over the latter.
    """
    per_length = force_unit == "N/m"
    columns = {"force": ("N/m", "N") if per_length else ("N",), "speed": ("m/s",), "mu": ("",)}
    if per_length:
        columns["element_pitch"] = ("m",)
    told = f"{', '.join(KEYS)}; columns {', '.join(columns)}"
    text = f"CSV or netCDF file of a friction table, in the place of {told}"
    file = FromFile(columns, ("speed", "mu"), KEYS, partial(_arranged, force_unit), _OTHER_NAMES)
    return Parameter("", "", text, file=file)


def _arranged(force_unit: str, columns: Mapping[str, Column]) -> dict[str, Any]:
    """Return knots and coefficients; the rows may come in any order."""
    speeds, coefficients = columns["speed"].values, columns["mu"].values
    if "force" not in columns:
        _refuse_pitch(columns)
        places = [(force, speed) for force in _ANY_FORCE for speed in speeds]
        coefficients = coefficients * len(_ANY_FORCE)
    else:
        places = list(zip(_forces(force_unit, columns), speeds, strict=True))
    found: dict[tuple[float, float], float] = {}
    for row, (place, mu) in enumerate(zip(places, coefficients, strict=True)):
        row %= len(speeds)
        for what, value in zip(("force", "speed"), place, strict=True):
            if value < 0.0:
                raise RowError(row, f"a {what} of 0 or more (a magnitude)", f"{value:g}")
        if mu <= 0.0:
            raise RowError(row, "a coefficient of friction > 0", f"{mu:g}")
        if place in found:
            expected = "one coefficient for each force and speed, such as the mean of repeated measurements"
            raise RowError(row, expected, "a second one for these")
        found[place] = mu
    forces, knots = (sorted({place[i] for place in found}) for i in (0, 1))
    for force in forces:
        for speed in knots:
            if (force, speed) not in found:
                missing = f"force {force:g} {force_unit} and speed {speed:g} m/s"
                raise ValueError(f"expected a coefficient for each force and speed, found none for {missing}")
    return {
        "table_force": forces,
        "table_speed": knots,
        "table_mu": [[found[force, speed] for speed in knots] for force in forces],
    }


def _forces(force_unit: str, columns: Mapping[str, Column]) -> tuple[float, ...]:
    """Return the normal forces of the rows [force_unit]."""
    force = columns["force"]
    if force.unit == force_unit:
        _refuse_pitch(columns)
        return force.values
    if "element_pitch" not in columns:
        raise ValueError("expected a column element_pitch [m] beside the force of an element, found none")
    pitches = columns["element_pitch"].values
    for row, pitch in enumerate(pitches):
        if pitch <= 0.0:
            raise RowError(row, "an element_pitch > 0 m", f"{pitch:g} m")
    return tuple(one / pitch for one, pitch in zip(force.values, pitches, strict=True))


def _refuse_pitch(columns: Mapping[str, Column]) -> None:
    if "element_pitch" in columns:
        raise ValueError("expected element_pitch only beside the force [N] of an element, found it alone")
