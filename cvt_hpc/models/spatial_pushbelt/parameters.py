"""Parameters of the spatial pushbelt: all of the planar one by its names, and what is out of plane.

Schindler's paper gives no number but "approximately 400 elements" and "nine to twelve rings". Every default
is an assumption, plausible and not measured; those of the planar pushbelt keep its own.
"""

from dataclasses import replace

import numpy as np

from cvt_hpc.models.pushbelt import parameters as pushbelt
from cvt_hpc.parameters import Parameter, Parameters, Problem, Substitute, not_negative, positive
from cvt_hpc.physics.out_of_plane import SIDES, axial_offset
from cvt_hpc.variator import PULLEYS
from cvt_hpc.variator.scene import SCENE

LOOSE_SIDES = tuple(f"{pulley}_loose_side" for pulley in PULLEYS)


def _offset(parameters: Parameters) -> float:
    try:
        return axial_offset(parameters, parameters["aligned_ratio"])
    except ValueError:
        raise ValueError("a ratio at which the belt closes on pulleys that do not overlap") from None


def _of_strips(parameters: Parameters) -> float:
    p = parameters
    return p["bending_share"] * p["ring_stiffness"] * p["strip_width"] ** 2 / 12.0


def _small_angle(description: str) -> Parameter:
    return Parameter(0.0, "rad", description, minimum=-0.02, maximum=0.02, sensible=(1e-6, 0.02))


_CHANGED: dict[str, Parameter] = {
    "nose_clearance": replace(
        pushbelt.PARAMETERS["belt"]["nose_clearance"],
        default=1e-4,
        description="play of an element's nose in the next one's hole, to all sides; inf: no noses",
    ),
    "nose_height": replace(pushbelt.PARAMETERS["belt"]["nose_height"], default=2.5e-3),
    "half_wedge_angle": replace(
        pushbelt.PARAMETERS["sheaves"]["half_wedge_angle"],
        minimum=np.deg2rad(5.0),
        maximum=np.deg2rad(20.0),
        exclusive=False,
    ),
}
_SCENE: dict[str, Parameter] = {
    "misalignment": Parameter(
        0.0,
        "m",
        "axial offset of the pulleys' mid planes at the start, driven over driving one, to the right",
        minimum=-0.01,
        maximum=0.01,
        sensible=(1e-6, 5e-3),
    ),
    "aligned_ratio": positive(
        None,
        "",
        "ratio without misalignment, in the place of misalignment, which follows at each ratio",
        gives=Substitute(
            "misalignment",
            ("ratio", "driven_radius", "centre_distance", "half_wedge_angle", *LOOSE_SIDES),
            _offset,
        ),
    ),
    "axis_tilt": _small_angle(
        "angle of the driven axis against the driving one, its right end away from the driving pulley"
    ),
    "axis_skew": _small_angle(
        "angle of the driven axis out of the plane of both, its right end towards the upper strand"
    ),
    "disturbance": replace(
        SCENE["disturbance"],
        default=1e-9,
        description="largest lateral displacement of the strands at the start, of five modes by chance",
    ),
    "seed": SCENE["seed"],
}
_BELT: dict[str, Parameter] = {
    "element_width": positive(
        0.024, "m", "distance of an element's flanks on the pitch line", sensible=(5e-3, 0.1)
    ),
    "flank_reach": positive(
        3e-3, "m", "distance of a flank's two contact points from the pitch line", sensible=(1e-5, 0.02)
    ),
    "edge_half_width": positive(
        0.010, "m", "from the middle to both contacts of the rocking edge", sensible=(1e-4, 0.05)
    ),
    "head_half_width": positive(
        0.005, "m", "from the middle to both contacts of the head", sensible=(1e-4, 0.05)
    ),
    "package_offset": positive(
        7.5e-3, "m", "from the middle of an element to that of either ring package", sensible=(1e-4, 0.05)
    ),
    "strip_width": positive(9.75e-3, "m", "width of the rings of a package", sensible=(1e-4, 0.05)),
    "ring_flows": Parameter(
        1, "", "flows of ring material: 1 for both packages, or 2, one for each", minimum=1, maximum=2
    ),
    "lateral_bending_stiffness": positive(
        47.6, "N m^2", "lateral bending stiffness EI of all rings", sensible=(0.01, 1e4)
    ),
    "bending_share": positive(
        None,
        "",
        "share of EA w^2 / 12, which rings of strip_width have, in the place of lateral_bending_stiffness",
        gives=Substitute("lateral_bending_stiffness", ("ring_stiffness", "strip_width"), _of_strips),
    ),
    "lateral_shear_stiffness": positive(
        2.4e6, "N", "lateral shear stiffness kGA of all rings", sensible=(1e3, 1e9)
    ),
    "lateral_damping": not_negative(
        0.0, "N s/m^2", "viscous damping of the lateral motion", sensible=(0.1, 1e6)
    ),
    "yaw_spring": not_negative(
        1307.0,
        "N",
        "stiffness of the elements' yaw against the rings, moment by angle and length",
        sensible=(1.0, 1e9),
    ),
    "yaw_damper": not_negative(
        0.03267,
        "N s",
        "damping of the elements' yaw against the rings, moment by angular velocity and length",
        sensible=(1e-6, 1e6),
    ),
}
_SHEAVES: dict[str, Parameter] = {
    **{
        key: Parameter(
            side,
            "",
            f"loose sheave of the {pulley} pulley; right: where the belt runs counter-clockwise",
            choices=tuple(SIDES),
        )
        for key, pulley, side in zip(LOOSE_SIDES, PULLEYS, ("right", "left"), strict=True)
    },
    "lean_lag": positive(
        1e-4,
        "s",
        "time constant of the tilt of a single sheave, in which the two of a pulley differ",
        sensible=(1e-6, 0.1),
    ),
}

PARAMETERS: dict[str, dict[str, Parameter]] = {
    name: {key: _CHANGED.get(key, entry) for key, entry in table.items()}
    for name, table in pushbelt.PARAMETERS.items()
}
PARAMETERS["scene"] |= _SCENE
PARAMETERS["belt"] |= _BELT
PARAMETERS["sheaves"] |= _SHEAVES


def package_arm(parameters: Parameters) -> float:
    """Distance from the middle at which a package of no width has the roll stiffness of both strips [m]."""
    p = parameters
    return float(np.sqrt(p["package_offset"] ** 2 + p["strip_width"] ** 2 / 12.0))


def roll_limit(parameters: Parameters) -> float:
    """Longest step with which the elements' roll, which is explicit, is stable [s].

    Rings at +-b turn neighbours alike by T b^2 d(roll)/ds, as a string does of the inertia per length
    J' = m_e' (h^2 + w^2) / 12 + m_r' b^2: pitch sqrt(J' / (T b^2)), T as of `pushbelt.most_tension`.
    """
    p, arm = parameters, package_arm(parameters)
    inertia = p["element_mass"] * (p["element_height"] ** 2 + p["element_width"] ** 2) / 12.0
    inertia += p["ring_mass"] * arm**2
    pitch = pushbelt.path_length(p) / p["elements"]
    return float(pitch * np.sqrt(inertia / (pushbelt.most_tension(p) * arm**2)))


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters [SI], in the form of `pushbelt.check`."""
    p = parameters
    problems = pushbelt.check(p)
    widths = dict.fromkeys(("edge_half_width", "head_half_width", "package_offset"), "element_width")
    for key, of in (*widths.items(), ("flank_reach", "element_height")):
        if p[key] > 0.5 * p[of]:
            problems.append((key, f"at most half of {of}, {0.5 * p[of]:g} m", f"{p[key]:g} m"))
    if problems:
        return problems
    step, limit = p.get("step", 0.0), roll_limit(p)
    if step > limit:
        why = "pitch over the speed of torsional waves of elements on their rings"
        problems.append(("step", f"at most {limit:.3g} s, {why}", f"{step:g} s"))
    for ratio in pushbelt.ratios_along(p):
        problems = problems or _off_the_cone(p, ratio)
    return problems


def _off_the_cone(p: Parameters, ratio: float) -> list[Problem]:
    """Whether an element that enters out of line would miss the sheaves' faces at a ratio.

    A flank out of line by e meets its sheave e / tan d0 further out, or in. Where the job does not say how
    far the faces reach, they are taken to do so by an element's height beyond the radii of the belt.
    """
    driven = pushbelt.driven_radius(ratio, pushbelt.path_length(p), p["centre_distance"])
    radii, height = (driven / ratio, driven), p["element_height"]
    inside = min(radii) - p["inner_radius"] if p["inner_radius"] > 0.0 else height
    outside = p["outer_radius"] - max(radii) if np.isfinite(p["outer_radius"]) else height
    room = min(inside, outside)
    most = np.tan(p["half_wedge_angle"]) * (room - p["flank_reach"])
    # loose sheaves take the mid planes along where the ratio changes in a run
    moved = axial_offset({**p, "ratio": ratio, "driven_radius": driven}, p["ratio"])
    offset = abs(p["misalignment"] + (moved if ratio != p["ratio"] else 0.0))
    tilted = 0.5 * p["centre_distance"] * np.hypot(p["axis_tilt"], p["axis_skew"])
    of_offset = "misalignment" if p.get("aligned_ratio") is None else "aligned_ratio"
    found = {
        "flank_reach": (p["flank_reach"], room, ""),
        of_offset: (offset, most, " of offset"),
        "axis_tilt": (tilted, most, " of offset by tilt and skew"),
    }
    at = "" if ratio == p["ratio"] else f" at a ratio of {ratio:g}"
    known = ""
    if room == height:
        known = ", an element's height beyond the belt unless inner_radius and outer_radius are given"
    for key, (size, limit, what) in found.items():
        if size > limit:
            expected = f"at most {limit:.3g} m{what}, so that flanks meet the sheaves' faces{known}"
            return [(key, expected, f"{size:.3g} m{at}")]
    return []


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, by name the setting that makes them so."""
    p = parameters
    found = pushbelt.inert(p)
    found["arc_probes"] = "model spatial_pushbelt, which is probed on its strands"
    if np.isinf(p["sheave_stiffness"]):
        found["lean_lag"] = "sheave_stiffness inf"
    if p["disturbance"] == 0.0:
        found["seed"] = "disturbance 0"
    return found
