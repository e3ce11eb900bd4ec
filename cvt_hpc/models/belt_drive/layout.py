"""The layout of a drive: two pulleys by ratio and distance, or any number by lists; and arms of tensioners.

The belt runs around the pulleys in the order of the lists; the first one drives. Where a pulley is on an arm,
it stands in the lists as at rest.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.models.belt_drive.pulleys import Arms, Pulleys, no_struts, struts
from cvt_hpc.parameters import Column, FromFile, Parameter, Parameters, Problem, Range, RowError, positive
from cvt_hpc.physics.belt_path import BeltPath, belt_path
from cvt_hpc.physics.geometry import variator_problems
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.variator.scene import length_problems, nested_problems

_MOST_RUN_OUT = 0.01  # of the radius: the square of this is left out

COLUMNS = {"x": ("m",), "y": ("m",), "radius": ("m",), "turn": ("",), "inertia": ("kg m^2",), "load": ("",)}
PULLEY_LISTS = tuple(f"pulley_{name}" for name in COLUMNS)
TWO = "ratio", "driven_radius", "centre_distance", "driven_inertia", "crossed"  # values that lists replace


def _arranged(columns: Mapping[str, Column]) -> dict[str, Any]:
    """Lists of the columns of a file; an error in them names its row, or all of them."""
    lists = {f"pulley_{name}": list(column.values) for name, column in columns.items()}
    for row, key, expected, found in _pulley_faults(lists):
        raise RowError(row, f"{key.removeprefix('pulley_')}: {expected}", found)
    for key, expected, found in _pulley_problems(lists):
        raise ValueError(f"{key}: expected {expected}, found {found}")
    return lists


def _list(unit: str, description: str, sensible: Range | None = None, **bounds: Any) -> Parameter:
    return Parameter((), unit, description, sensible=sensible, **bounds)


LAYOUT: dict[str, Parameter] = {
    "pulley_file": Parameter(
        "",
        "",
        f"CSV file of pulleys instead of lists; a row for each, columns {', '.join(COLUMNS)}",
        file=FromFile(COLUMNS, tuple(COLUMNS), PULLEY_LISTS, _arranged),
    ),
    "pulley_x": _list(
        "m", "axes of the pulleys along x, the driving one first, as the belt runs", (1e-3, 10.0)
    ),
    "pulley_y": _list("m", "axes of the pulleys along y", (1e-3, 10.0)),
    "pulley_radius": _list("m", "radii at the belt's cord", (5e-3, 1.0), minimum=0.0, exclusive=True),
    "pulley_turn": _list("", "direction in which the belt turns a pulley: 1 counter-clockwise, -1 clockwise"),
    "pulley_inertia": _list(
        "kg m^2", "moments of inertia; not read of the first", (1e-6, 100.0), minimum=0.0
    ),
    "pulley_load": _list("", "braking torque of each pulley over load; 0 for the first"),
    "run_out": _list(
        "m", "eccentricity of each pulley's rim; by default all are round", (1e-7, 1e-3), minimum=0.0
    ),
    "run_out_phase": _list(
        "rad", "angle of the rim's highest place at first, from x; by default 0 of all", (1e-3, 7.0)
    ),
}
TENSIONER: dict[str, Parameter] = {
    "tensioner_pulley": _list("", "numbers of the pulleys that arms carry, from 2 on"),
    "tensioner_x": _list("m", "pivots of the arms along x", (1e-3, 10.0)),
    "tensioner_y": _list("m", "pivots of the arms along y", (1e-3, 10.0)),
    "tensioner_inertia": _list(
        "kg m^2", "of arm and pulley's mass, about the pivot", (1e-7, 100.0), minimum=0.0, exclusive=True
    ),
    "tensioner_stiffness": _list("N m", "moment of the spring by the angle [rad]", (1e-3, 1e5), minimum=0.0),
    "tensioner_damping": _list("N m s", "moment of the dashpot by the speed", (1e-5, 1e3), minimum=0.0),
    "tensioner_moment": _list(
        "N m",
        "moments of the springs as drawn, which rotate the arms; by default the moments that hold them",
        (1e-3, 1e4),
    ),
    "strut_fixed_x": _list(
        "m", "fixed ends along x of springs that pull at the arms, if they have such", (1e-3, 10.0)
    ),
    "strut_fixed_y": _list("m", "fixed ends of these springs along y", (1e-3, 10.0)),
    "strut_held_x": _list("m", "ends of these springs on the arms along x, as drawn", (1e-3, 10.0)),
    "strut_held_y": _list("m", "ends of these springs on the arms along y, as drawn", (1e-3, 10.0)),
    "strut_stiffness": _list("N/m", "force of such a spring by its length", (1.0, 1e9), minimum=0.0),
    "strut_damping": _list("N s/m", "force of a dashpot beside it by the speed", (1e-3, 1e6), minimum=0.0),
    "tensioner_lowest": _list("rad", "clockwise end of the travel", (1e-3, 7.0)),
    "tensioner_highest": _list("rad", "counter-clockwise end of the travel", (1e-3, 7.0)),
    "stop_stiffness": positive(
        1e4, "N m", "moment of the stops at the ends by the angle [rad]", sensible=(1.0, 1e8)
    ),
}
_STRUT_LISTS = tuple(key for key in TENSIONER if key.startswith("strut_"))
_ARM_LISTS = tuple(
    key for key in TENSIONER if key not in ("tensioner_moment", "stop_stiffness", *_STRUT_LISTS)
)


class Layout(NamedTuple):
    """Pulleys as drawn, and the belt's path around them."""

    path: BeltPath  # the reference path
    pulleys: tuple[str, ...]  # names, (P,)
    spans: tuple[str, ...]  # names, (P,); a span is behind its pulley
    inertia: np.ndarray  # (P,) [kg m^2]
    load: np.ndarray  # torque that brakes a pulley over the load, (P,)
    driven: int  # the pulley that takes most of the load

    @property
    def ratio(self) -> float:
        """Speed of the driving pulley over that of the driven one, without slip."""
        return float(self.path.radius[self.driven] / self.path.radius[0])


def layout(parameters: Parameters) -> Layout:
    """Layout of a drive, from values by name [SI] without problems."""
    p = parameters
    if not p["pulley_x"]:
        centre = np.array([[0.0, 0.0], [p["centre_distance"], 0.0]])
        radius = np.array([p["driven_radius"] / p["ratio"], p["driven_radius"]])
        path = belt_path(centre, radius, np.array([1.0, -1.0 if p["crossed"] else 1.0]))
        inertia, load = np.array([0.0, p["driven_inertia"]]), np.array([0.0, p["ratio"]])
        return Layout(path, PULLEYS, STRANDS, inertia, load, 1)
    x, y, radius, turn, inertia, load = (np.array(p[key]) for key in PULLEY_LISTS)
    names = tuple(f"P{k + 1}" for k in range(len(x)))
    spans = tuple(f"{name}-{after}" for name, after in zip(names, (*names[1:], names[0]), strict=True))
    path = belt_path(np.stack([x, y], 1), radius, turn)
    return Layout(path, names, spans, inertia, load, 1 + int(np.argmax(np.abs(load[1:]))))


def _arms_of(parameters: Parameters) -> Arms:
    """Arms of a drive; without `tensioner_moment` the moments of their springs are 0."""
    p = parameters
    pivot = np.array([p["tensioner_x"], p["tensioner_y"]]).T.reshape(-1, 2)
    names = ("inertia", "moment", "stiffness", "damping", "lowest", "highest")
    values = {name: np.array(p[f"tensioner_{name}"], float) for name in names}
    if not p["tensioner_moment"]:
        values["moment"] = np.zeros(len(pivot))
    fixed_x, fixed_y, held_x, held_y, stiffness, damping = (np.array(p[key], float) for key in _STRUT_LISTS)
    pulling = no_struts(len(pivot))
    if p["strut_stiffness"]:
        fixed, held = np.stack([fixed_x, fixed_y], 1), np.stack([held_x, held_y], 1)
        pulling = struts(pivot, fixed, held, stiffness, damping)
    return Arms(pivot, **values, stop=p["stop_stiffness"], struts=pulling)


def pulleys_of(parameters: Parameters, drawn: Layout) -> Pulleys:
    """Pulleys of a drive, on their axes and arms."""
    arm = np.full(len(drawn.inertia), -1)
    for a, number in enumerate(parameters["tensioner_pulley"]):
        arm[int(number) - 1] = a
    rim = [np.array(parameters[key] or np.zeros(len(arm)), float) for key in ("run_out", "run_out_phase")]
    return Pulleys(drawn.path.centre, drawn.path.radius, drawn.inertia, arm, _arms_of(parameters), *rim)


def layout_problems(parameters: Parameters) -> list[Problem]:
    """Problems of a layout, in the form of a model's check: (key, expected, found)."""
    p = parameters
    has_lists = any(p[key] for key in PULLEY_LISTS)
    if found := _list_problems(p, PULLEY_LISTS) if has_lists else variator_problems(dict(p)):
        return found
    if p["pulley_x"]:
        found = _pulley_problems(p)
    if not found and any(p[key] for key in (*_ARM_LISTS, *_STRUT_LISTS, "tensioner_moment")):
        given = (*_ARM_LISTS, *_STRUT_LISTS) if any(p[key] for key in _STRUT_LISTS) else _ARM_LISTS
        given = (*given, "tensioner_moment") if p["tensioner_moment"] else given
        found = _list_problems(p, given) or _arm_problems(p)
    return found


def run_out_problems(parameters: Parameters) -> list[Problem]:
    """Problems of eccentric pulleys of a layout without problems, in the form of a model's check."""
    p, radius = parameters, layout(parameters).path.radius
    for key in ("run_out", "run_out_phase"):
        if p[key] and (found := nested_problems(p, (key,))):
            return found
        if len(p[key]) not in (0, len(radius)):
            return [(key, f"a value for each pulley, {len(radius)}", f"{len(p[key])}")]
    for value, most in zip(p["run_out"], _MOST_RUN_OUT * radius, strict=False):
        if value > most:
            expected = f"at most {most:g} m, {_MOST_RUN_OUT:.0%} of the pulley's radius"
            return [("run_out", expected, f"{value:g} m")]
    return []


def _list_problems(p: Parameters, keys: Sequence[str]) -> list[Problem]:
    """Lists that are none of numbers, missing beside others, or not as long as most of them."""
    return nested_problems(p, keys) or length_problems(p, keys)


def _pulley_problems(p: Parameters) -> list[Problem]:
    count = len(p["pulley_x"])
    if count < 2:
        return [("pulley_x", "two pulleys or more", f"{count}")]
    for _, key, expected, value in _pulley_faults(p):
        return [(key, expected, value)]
    if not any(p["pulley_load"]):
        return [("pulley_load", "a value other than 0, of the pulley that is driven", "0 of all")]
    try:
        layout(p)
    except ValueError as error:
        key = "pulley_x" if "overlap" in str(error) else "pulley_turn"
        expected = "pulleys that do not overlap" if key == "pulley_x" else "a belt that closes on its pulleys"
        return [(key, expected, str(error).removeprefix("overlap: "))]
    return []


def _pulley_faults(p: Parameters) -> Iterator[tuple[int, str, str, str]]:
    """Yield errors in single pulleys: number of the pulley from 0 on, key, expected, found."""
    lists = (p[f"pulley_{name}"] for name in ("radius", "turn", "inertia", "load"))
    for k, (radius, turn, inertia, load) in enumerate(zip(*lists, strict=True)):
        if radius <= 0.0:
            yield k, "pulley_radius", "a radius above 0", f"{radius:g} m"
        if turn not in (1.0, -1.0):
            yield k, "pulley_turn", "1 or -1 for each pulley", f"{turn:g}"
        if inertia < 0.0 or (k > 0 and inertia == 0.0):
            expected = "moments of inertia above 0 of all but the first"
            yield k, "pulley_inertia", expected, f"{inertia:g} kg m^2"
        if k == 0 and load != 0.0:
            yield k, "pulley_load", "0 of the first pulley, which drives", f"{load:g}"


def _arm_problems(p: Parameters) -> list[Problem]:
    count, numbers = len(p["pulley_x"]) or 2, p["tensioner_pulley"]
    for number in numbers:
        if number not in range(2, count + 1) or numbers.count(number) > 1:
            return [("tensioner_pulley", f"different whole numbers, 2 to {count}", f"{list(numbers)}")]
    for low, high in zip(p["tensioner_lowest"], p["tensioner_highest"], strict=True):
        if not low < 0.0 < high:
            expected = "travel on both sides: tensioner_lowest < 0 < tensioner_highest"
            return [("tensioner_lowest", expected, f"{low:g} to {high:g} rad")]
    pulleys = pulleys_of(p, layout(p))
    for a, number in enumerate(numbers):
        if np.hypot(*(pulleys.centre[int(number) - 1] - pulleys.arms.pivot[a])) == 0.0:
            return [("tensioner_x", "a pivot beside the pulley's axis", f"that of pulley {number:g}")]
        if p["strut_stiffness"] and not abs(pulleys.arms.struts.lever[a]) > 0.0:
            expected = "a spring that does not point at the pivot"
            return [("strut_held_x", expected, f"that of pulley {number:g}")]
    return []


def layout_inert(parameters: Parameters) -> dict[str, str]:
    """Parameters of layouts without effect, each with the setting that makes it so."""
    p = parameters
    found = dict.fromkeys(TWO, "pulley_x, which gives all pulleys") if p["pulley_x"] else {}
    if not any(p["run_out"]):
        found["run_out_phase"] = "no run_out"
    if not p["tensioner_pulley"]:
        found |= dict.fromkeys(TENSIONER.keys() - {"tensioner_pulley"}, "no tensioner_pulley")
    return found
