"""The friction laws: their names, the parameters that each reads, and the checks of these.

A law is declared by an entry in `Law`; its formula, by which this file cannot be read without a compiler,
goes into `friction`, whose import fails where one is missing. `friction_file` reads a table of a coefficient
for each pair of normal force and sliding speed. Parameters are values by name [SI]; those of the law count.
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from functools import partial
from typing import Any, Self

import numpy as np

from cvt_hpc.parameters import Column, FromFile, Parameter, Parameters, Problem, RowError

KEYS = ("table_force", "table_speed", "table_mu")
OTHER_NAMES = {
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


FORMULA_PARAMETERS = ("kinetic_friction", "friction_gradient", "stribeck_velocity")
TABLE_PARAMETERS = ("table_force", "table_speed", "table_mu")
_ALL_PARAMETERS = (*FORMULA_PARAMETERS, "table_file", *TABLE_PARAMETERS)


def _no_problems(p: Parameters) -> list[Problem]:
    return []


def _coulomb_problems(p: Parameters) -> list[Problem]:
    if p["friction_gradient"] == 0.0:
        return []
    return [("friction_gradient", "0 with friction_law coulomb", f"{p['friction_gradient']:g} s/m")]


def _table_problems(p: Parameters) -> list[Problem]:
    """list[Problem] of a friction table; the first one only."""
    force, speed, mu = (p[key] for key in TABLE_PARAMETERS)
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


def _kinetic(p: Parameters) -> float:
    return float(p["kinetic_friction"])


def _fallen_from(p: Parameters, share: float = 1.0) -> float:
    return float(p["kinetic_friction"] - share * p["friction_gradient"] * p["stribeck_velocity"])


def _of_table(p: Parameters) -> float:
    return float(np.max(p["table_mu"]))


class Law(IntEnum):
    """The laws, as kernels know them, each with its declaration."""

    reads: tuple[str, ...]  # the parameters that the law reads
    problems: Callable[[Parameters], list[Problem]]  # finds its problems in parameters
    # largest coefficient [1] by parameters: that of v -> 0+ but for a table
    largest: Callable[[Parameters], float]

    def __new__(
        cls,
        number: int,
        reads: tuple[str, ...],
        problems: Callable[[Parameters], list[Problem]] = _no_problems,
        largest: Callable[[Parameters], float] = _fallen_from,
    ) -> Self:
        """Make the member of a number."""
        law = int.__new__(cls, number)
        law._value_, law.reads, law.problems, law.largest = number, reads, problems, largest
        return law

    COULOMB = 0, ("kinetic_friction", "friction_gradient"), _coulomb_problems, _kinetic
    LINEAR = 1, FORMULA_PARAMETERS
    STRIBECK = 2, FORMULA_PARAMETERS
    HYPERBOLIC = 3, ("kinetic_friction", "friction_gradient"), _no_problems, _kinetic
    CUBIC = 4, FORMULA_PARAMETERS, _no_problems, partial(_fallen_from, share=2.0 / 3.0)
    TABLE = 5, ("table_file", *TABLE_PARAMETERS), _table_problems, _of_table


FRICTION_LAWS = tuple(law.name.lower() for law in Law)  # as a job names them


def friction_problems(parameters: Parameters) -> list[Problem]:
    """list[Problem] of a friction law: (key, expected, found)."""
    return _declared(parameters).problems(parameters)


def friction_inert(parameters: Parameters) -> dict[str, str]:
    """Parameters of a friction law without effect, each with the setting that makes it so."""
    reads, setting = _declared(parameters).reads, f"friction_law {parameters['friction_law']}"
    inert = {key: setting for key in _ALL_PARAMETERS if key not in reads}
    if parameters["friction_gradient"] == 0.0:
        inert["stribeck_velocity"] = "friction_gradient 0"
    return inert


def largest_friction(parameters: Parameters) -> float:
    """Largest coefficient of a friction law without problems, at any speed and force [1]."""
    return _declared(parameters).largest(parameters)


def _declared(parameters: Parameters) -> Law:
    return Law[parameters["friction_law"].upper()]


def friction_file(force_unit: str) -> Parameter:
    """Return the parameter that names the file of a friction table.

    `force_unit` is that of the table's normal forces: N/m, or N for a single contact. Where it is N/m the
    file may have the normal force of an element [N] instead, together with `element_pitch` [m]: the line
    force is the former over the latter.
    """
    per_length = force_unit == "N/m"
    columns = {"force": ("N/m", "N") if per_length else ("N",), "speed": ("m/s",), "mu": ("",)}
    if per_length:
        columns["element_pitch"] = ("m",)
    told = f"{', '.join(KEYS)}; columns {', '.join(columns)}"
    text = f"CSV or netCDF file of a friction table, in the place of {told}"
    file = FromFile(columns, ("speed", "mu"), KEYS, partial(_arranged, force_unit), OTHER_NAMES)
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
