"""Parameters of the belt's bending, of its rings as layers, and of the elements' tilt on the rings.

Conflicts between them, and keys without effect. No paper gives numbers of rings as layers: thickness and
friction are assumptions, those of common belts. By default elements do not tilt. A model that leaves these
parameters out has their defaults.
"""

from dataclasses import replace

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive
from cvt_hpc.variator import scene

CURVATURE_TERMS = ("none", "path", "straight")

BENDING: dict[str, Parameter] = {
    "curvature_terms": Parameter(
        "none",
        "",
        "terms of the path's curvature in the transverse motion (Bullinger et al. 2005, eqs 14-21): none, or "
        "those of a belt with the path as shape at rest, or of a belt straight at rest",
        choices=CURVATURE_TERMS,
    ),
    "column_bending": Parameter(
        "off",
        "",
        "rocking: pressed elements bear a bending moment, and rock on the edges of their faces (eqs 22-24)",
        choices=("off", "rocking"),
    ),
    "column_stiffness": positive(
        0.5, "N m^2", "EI of the pressed elements while their faces rest on each other", (1e-4, 1e4)
    ),
    "outer_edge": not_negative(
        1e-3, "m", "k+: from the pitch line outwards to the edge of the elements' faces", (1e-6, 0.05)
    ),
    "inner_edge": not_negative(
        0.0, "m", "k-: from the pitch line inwards to the edge of the elements' faces", (1e-6, 0.05)
    ),
}

MOST_LAYERS = 12  # of pushbelts that are built: 9 to 12

RINGS: dict[str, Parameter] = {
    "ring_layers": Parameter(
        1,
        "",
        "ring layers, each with a speed and a length of its own, that share mass and stiffness of the rings; "
        "1: all rings as one",
        minimum=1,
        maximum=MOST_LAYERS,
    ),
    "layer_thickness": not_negative(
        0.185e-3,
        "m",
        "thickness of a ring layer; ring_offset is that of the middle of the stack",
        (1e-6, 5e-3),
    ),
    "layer_tolerance": Parameter(
        (),
        "",
        "length of each layer over the length that fits, k_i, inner layer first; none: all fit",
        minimum=0.99,
        maximum=1.01,
    ),
    "layer_friction": not_negative(0.08, "", "kinetic friction coefficient between ring layers"),
    "ring_static_factor": Parameter(
        1.0,
        "",
        "static over kinetic friction, among layers, at the saddle and at the elements' ears",
        minimum=1.0,
        maximum=10.0,
    ),
    "ring_stribeck_speed": positive(
        0.05, "m/s", "speed over which that static friction falls to the kinetic one", (1e-4, 10.0)
    ),
}

TILT: dict[str, Parameter] = scene.TILT | {
    "tilt_spring": replace(
        scene.TILT["tilt_spring"],
        default=np.inf,
        description=f"{scene.TILT['tilt_spring'].description}; inf: none tilts",
        exclusive=True,
        allow_infinite=True,
        sensible=(1.0, np.inf),
    ),
    "tilt_damper": replace(scene.TILT["tilt_damper"], exclusive=True),
}

DEFAULTS = {key: parameter.default for key, parameter in (BENDING | RINGS | TILT).items()}


def has_column(parameters: Parameters) -> bool:
    """Whether pressed elements bear a bending moment."""
    return bool(parameters.get("column_bending", "off") == "rocking")


def layer_count(parameters: Parameters) -> int:
    """Number of ring layers."""
    return int(parameters.get("ring_layers", 1))


def elements_tilt(parameters: Parameters) -> bool:
    """Whether elements tilt on the rings."""
    return bool(np.isfinite(parameters.get("tilt_spring", np.inf)))


def belt_problems(parameters: Parameters) -> list[Problem]:
    """Problems between these parameters, in the form of a model's check."""
    p, found = DEFAULTS | dict(parameters), []
    layers, tolerance = layer_count(p), p["layer_tolerance"]
    if p["curvature_terms"] != "none" and p["longitudinal_mass"] != 1.0:
        found.append(("curvature_terms", "none with longitudinal_mass other than 1", p["curvature_terms"]))
    if tolerance and len(tolerance) != layers:
        expected = f"one for each of {layers} ring_layers, or none"
        found.append(("layer_tolerance", expected, str(len(tolerance))))
    elif layers > 1:
        # terms of the elements' moments and of curvature know the rings as one
        plain = {"curvature_terms": "none", "column_bending": "off"}
        others = {key: value for key, value in plain.items() if p[key] != value}
        found += [
            (key, f'"{value}" with ring_layers above 1', f'"{p[key]}"') for key, value in others.items()
        ]
    if elements_tilt(p) and layers > 1:
        found.append(("tilt_spring", "inf with ring_layers above 1", f"{p['tilt_spring']:g} N"))
    elif elements_tilt(p) and p["ring_offset"] == 0.0:
        found.append(("ring_offset", "other than 0, the lever of the rings, where elements tilt", "0 m"))
    return found


def stack_problems(parameters: Parameters, least_radius: float) -> list[Problem]:
    """Rings that reach the axis of the smaller pulley, of the radius [m]: result as of a model's check."""
    p = DEFAULTS | dict(parameters)
    key = "layer_thickness" if p["ring_layers"] > 1 else "ring_offset"
    stack = p["ring_layers"] * p["layer_thickness"] if p["ring_layers"] > 1 else 0.0
    innermost = p["ring_offset"] - 0.5 * stack
    if innermost > -least_radius:
        return []
    expected = f"rings within the smaller pulley's radius of {1e3 * least_radius:.4g} mm"
    return [(key, expected, f"{p[key]:g} m, the innermost {-1e3 * innermost:.4g} mm below the pitch line")]


def rings_rub(parameters: Parameters) -> bool:
    """Whether rings have friction, at the saddle or among each other."""
    p = DEFAULTS | dict(parameters)
    return bool(p["ring_friction"] > 0.0 or (p["ring_layers"] > 1 and p["layer_friction"] > 0.0))


def belt_inert(parameters: Parameters) -> dict[str, str]:
    """Those of these parameters without effect, each with the setting that makes it so."""
    p, layers = DEFAULTS | dict(parameters), layer_count(parameters)
    of_layers = tuple(key for key in RINGS if key != "ring_layers")
    cases = (
        (not has_column(p), ("column_stiffness", "outer_edge", "inner_edge"), "column_bending off"),
        (layers == 1, of_layers, "ring_layers 1"),
        (layers > 1 and p["ring_static_factor"] == 1.0, ("ring_stribeck_speed",), "ring_static_factor 1"),
        (not elements_tilt(p), ("tilt_damper",), "tilt_spring inf"),
    )
    return {key: setting for holds, keys, setting in cases if holds for key in keys}
