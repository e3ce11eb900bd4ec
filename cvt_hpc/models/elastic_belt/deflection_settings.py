"""Parameters of the deflection of the sheaves' discs, and the flexibilities that result."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from cvt_hpc.parameters import (
    Column,
    FromFile,
    Parameter,
    Parameters,
    Problem,
    RowError,
    not_negative,
    positive,
)
from cvt_hpc.physics.deflection import cone_flexibilities, interpolated, table_problem
from cvt_hpc.physics.geometry import variator
from cvt_hpc.physics.ritz import modal_flexibilities, moving_modes
from cvt_hpc.physics.sheaves import Sheaves
from cvt_hpc.recording import steps_per_sample
from cvt_hpc.variator import PULLEYS

CONE = ("cone_stiffness", "cone_shift")
RITZ = ("ritz_limit", "ritz_modes", "disc_damping")
TABLE_KEYS = tuple(f"{pulley}_flexibility{end}" for pulley in PULLEYS for end in ("_file", "_angle", ""))
_OF_MODE = ("mode_harmonic", "mode_flexibility", "mode_mass")
MODE_KEYS = tuple(f"{pulley}_{key}" for pulley in PULLEYS for key in _OF_MODE)
MODE_FILES = tuple(f"{pulley}_modes_file" for pulley in PULLEYS)


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
        angle: Parameter((), "rad", "angles of these flexibilities from the inlet", sensible=(1e-4, 7.0)),
        flexibility: Parameter(
            (),
            "m/N",
            f"flexibilities w_ij of the {pulley} sheaves, opening of the groove by a force on both flanks: a "
            "row for each angle; of discs of revolution one row, over the angle between both",
            sensible=(1e-30, 1e-5),
        ),
    }


def _modes(pulley: str) -> dict[str, Parameter]:
    harmonic, flexibility, mass = gives = tuple(f"{pulley}_{key}" for key in _OF_MODE)
    columns = {"harmonic": ("",), "modal_flexibility": ("m/N",), "modal_mass": ("kg",)}

    def arranged(found: Mapping[str, Column]) -> dict[str, Any]:
        return {key: list(found[name].values) for key, name in zip(gives, columns, strict=True)}

    text = f"CSV or netCDF file in the place of {', '.join(gives)}; columns {', '.join(columns)}"
    file = FromFile(columns, tuple(columns), gives, arranged)
    return {
        f"{pulley}_modes_file": Parameter("", "", text, file=file),
        harmonic: Parameter(
            (), "", f"waves around the {pulley} discs of each of their modes, of both discs of the groove"
        ),
        flexibility: positive(
            (),
            "m/N",
            "opening of the groove by these modes at rest, at the place of a force on both flanks",
            (1e-30, 1e-5),
        ),
        mass: not_negative((), "kg", "masses of these modes; 0: without inertia", (1e-9, 1e9)),
    }


DEFLECTION: dict[str, Parameter] = {
    "sheave_deformation": Parameter(
        "bending",
        "",
        "deformation of the discs beside the tilt of their collars: local bending, a tilting cone, "
        "flexibilities of a table, or modes with inertia",
        choices=("bending", "cone", "flexibilities", "ritz"),
    ),
    "cone_stiffness": positive(
        3e5, "N m/rad", "stiffness of a cone against tilting", (100.0, 1e9), allow_infinite=True
    ),
    "cone_shift": not_negative(
        0.0, "m", "shift of a cone's axis of tilting towards the middle of the arc", (1e-5, 0.2)
    ),
    **_table("driving"),
    **_table("driven"),
    **_modes("driving"),
    **_modes("driven"),
    "ritz_limit": not_negative(
        20e3, "Hz", "highest frequency of modes that have inertia; 0: none", (1.0, 1e6)
    ),
    "ritz_modes": Parameter(
        0, "", "how many modes are kept, the lowest frequencies first; 0: all", minimum=0
    ),
    "disc_damping": not_negative(0.005, "", "damping ratio of the discs' modes"),
}


def _kept_modes(parameters: Parameters, pulley: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Harmonics, flexibilities [m/N] and masses [kg] of the modes that are kept, by ascending frequency."""
    harmonic, flexibility, mass = (np.array(parameters[f"{pulley}_{key}"], float) for key in _OF_MODE)
    order = np.argsort(-flexibility * mass, kind="stable")
    order = order[: parameters["ritz_modes"] or None]
    return harmonic[order], flexibility[order], mass[order]


def disc_settings(p: Parameters, pulley: str, wrap: Sheaves, radius: float, turned: float) -> dict[str, Any]:
    """Data of one pulley's discs for `Sheaves`, at the reference stiffness, beside local bending.

    `flexibilities`, (m, m) [m/N], or (0, 0) for local bending, and `modes` where these have inertia, over the
    `wrap` of m stations, with the pitch radius [m] and the angle `turned` of the arc [rad].
    """
    if p["sheave_deformation"] == "cone":
        from_middle, distance = wrap.angle - 0.5 * turned, radius + wrap.rise
        shifted = p["cone_stiffness"], p["cone_shift"]
        return {"flexibilities": cone_flexibilities(from_middle, distance, *shifted)}
    if p["sheave_deformation"] == "flexibilities":
        angles, table = p[f"{pulley}_flexibility_angle"], p[f"{pulley}_flexibility"]
        return {"flexibilities": interpolated(angles, table, wrap.angle, turned)}
    if p["sheave_deformation"] == "ritz":
        kept, interval = _kept_modes(p, pulley), 1.0 / p["sampling_rate"]
        step = interval / steps_per_sample(interval, p["step"])
        place = wrap.angle, wrap.weight / radius
        modes = moving_modes(kept, p["ritz_limit"], p["disc_damping"], step, place)
        return {"flexibilities": modal_flexibilities(kept[0], kept[1], *place), "modes": modes}
    return {}


def deflection_problems(p: Parameters) -> list[Problem]:
    """Problems of the discs' deformation: (key, expected, found); the scene's sizes are taken as sound."""
    kind = p["sheave_deformation"]
    if kind == "bending":
        return []
    if kind == "ritz":
        return _ritz_problems(p)
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


def refuse_moving_discs(parameters: Parameters) -> list[Problem]:
    """Refuse discs with inertia, of which a method knows nothing."""
    if parameters["sheave_deformation"] != "ritz":
        return []
    return [("sheave_deformation", "bending, cone or flexibilities but by the stepper imex", "ritz")]


def _ritz_problems(p: Parameters) -> list[Problem]:
    if "lanes" not in p:  # a general method
        return refuse_moving_discs(p)
    problems = []
    for pulley in PULLEYS:
        sizes = [len(p[f"{pulley}_{key}"]) for key in _OF_MODE]
        if not sizes[0] or len(set(sizes)) > 1:
            expected = "modes, with one harmonic, flexibility and mass each"
            problems.append((f"{pulley}_mode_harmonic", expected, " and ".join(map(str, sizes))))
            continue
        for n in p[f"{pulley}_mode_harmonic"]:
            if n < 0.0 or n != round(n):
                problems.append((f"{pulley}_mode_harmonic", "whole numbers of 0 or more", f"{n:g}"))
                break
    # beyond it a step has less than six parts of a period
    if p.get("step") and p["ritz_limit"] > (most := 1.0 / (2.0 * np.pi * p["step"])):
        problems.append(("ritz_limit", f"at most {most:.4g} Hz at this step", f"{p['ritz_limit']:g} Hz"))
    return problems


def deflection_inert(parameters: Parameters) -> dict[str, str]:
    """Settings of the deformation without effect, each with the setting that makes it so."""
    kind = parameters["sheave_deformation"]
    setting = f"sheave_deformation {kind}"
    of_kinds = {
        "bending": ("local_stiffness", "local_length"),
        "cone": CONE,
        "flexibilities": TABLE_KEYS,
        "ritz": RITZ + MODE_KEYS + MODE_FILES,
    }
    return {key: setting for other, keys in of_kinds.items() if other != kind for key in keys}
