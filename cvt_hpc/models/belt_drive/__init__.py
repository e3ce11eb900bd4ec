"""The rubber belt drive of Cepon and Boltezar: ANCF elements on two pulleys, with contact and friction.

Importing this package is cheap: kernels are compiled when `transient` is imported.

Radii, centre distance, line mass, stiffness and damping of the belt (five ribs) and the inertia of the
pulleys are those of Cepon and Boltezar 2011, table 1; elements, contact points and the scatter of lengths are
those of their sec. 2.2. The belt's own length follows from the tension at rest. Assumptions are friction
coefficient and contact stiffness, which they measured but do not print as numbers, the contact's damping,
friction_speed, shear_stiffness (rubber of 3 MPa, 18 mm wide and 3 mm thick), rise_time, and the amplitude
from which a strand vibrates: 96 elements shake the strands by 30 um. The band holds the first modes of the
strands, 63 to 193 Hz.
"""

from dataclasses import replace

import numpy as np

from cvt_hpc import recording
from cvt_hpc.errors import show
from cvt_hpc.models.belt_drive.courses import PARAMETERS as COURSES
from cvt_hpc.models.belt_drive.courses import course_inert, course_problems, free_length
from cvt_hpc.models.belt_drive.layout import (
    LAYOUT,
    TENSIONER,
    TWO,
    layout,
    layout_inert,
    layout_problems,
    run_out_problems,
)
from cvt_hpc.models.belt_drive.roughness import ROUGHNESS, roughness_inert, roughness_problems
from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive
from cvt_hpc.physics.friction_laws import friction_inert, friction_problems
from cvt_hpc.steppers import STEPPERS as GENERAL
from cvt_hpc.variator.scene import FRICTION, SCENE, rise_problems
from cvt_hpc.vibration import settings

_RIBS = 5.0
_TREATMENTS = ("regularised", "set_valued", "bristle")  # of friction
_DEEPEST = 0.1  # of the smaller radius: so far the tension at rest may press the belt into a rim

RECORD, VIBRATION = recording.PARAMETERS["record"], settings.PARAMETERS["vibration"]

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": {
        "ratio": replace(SCENE["ratio"], default=1.0, description="speed ratio, driven / driving radius"),
        "driven_radius": replace(
            SCENE["driven_radius"],
            default=0.05,
            description="radius of the driven pulley, at the belt's cord",
        ),
        "centre_distance": replace(SCENE["centre_distance"], default=0.45),
        "driving_speed": replace(
            SCENE["driving_speed"], default=62.8, description="speed of the driving pulley, prescribed"
        ),
        "load": SCENE["load"],
        "rise_time": replace(SCENE["rise_time"], description="start-up: load rises smoothly"),
        "driven_inertia": positive(
            0.013, "kg m^2", "moment of inertia of the driven pulley", sensible=(1e-6, 100.0)
        ),
        "kick": not_negative(
            0.0, "N s", "impulse across each strand when the judged part begins", sensible=(1e-6, 10.0)
        ),
        "crossed": Parameter(
            False, "", "the belt crosses itself: the driven pulley rotates in the opposite direction"
        ),
    },
    "layout": LAYOUT,
    "tensioner": TENSIONER,
    "profiles": COURSES,
    "belt": {
        "tension": positive(
            310.0, "N", "mean tension of the strands at rest, with arms as drawn", sensible=(1.0, 1e5)
        ),
        "free_length": free_length(),
        "line_mass": positive(0.096, "kg/m", "mass per length", sensible=(1e-3, 10.0)),
        "axial_stiffness": positive(_RIBS * 30400.0, "N", "longitudinal stiffness EA", sensible=(1e2, 1e9)),
        "bending_stiffness": positive(_RIBS * 5.2e-3, "N m^2", "bending stiffness EI", sensible=(1e-6, 1e3)),
        "axial_damping": not_negative(
            _RIBS * 4.1, "N s", "viscous damping along the belt, force by strain rate", sensible=(1e-3, 1e4)
        ),
        "mass_damping": not_negative(
            2.8,
            "1/s",
            "damping of motion across the belt over its mass (Rayleigh's alpha)",
            sensible=(1e-3, 1e4),
        ),
        "bending_damping": not_negative(
            1.8e-3, "s", "damping of bending over its stiffness (Rayleigh's beta)", sensible=(1e-7, 1.0)
        ),
        "elements": Parameter(96, "", "elements of the belt", minimum=8, maximum=2048),
        "length_scatter": Parameter(
            0.12, "", "largest share by which the lengths of elements differ", minimum=0.0, maximum=0.5
        ),
        "seed": Parameter(1, "", "seed of these lengths", minimum=0),
        **ROUGHNESS,
    },
    "contact": {
        "contact_points": Parameter(
            3, "", "points of an element that may touch a pulley", minimum=1, maximum=16
        ),
        "contact_stiffness": positive(
            1.2e9, "N/m^2", "normal force per length and depth of a contact", sensible=(1e5, 1e13)
        ),
        "contact_damping": not_negative(
            2e3, "N s/m^2", "normal force per length and speed of a contact", sensible=(1e-2, 1e8)
        ),
    },
    "friction": {
        **{key: entry for key, entry in FRICTION.items() if key != "friction_memory"},
        "friction_law": replace(
            FRICTION["friction_law"], default="coulomb", description="friction over sliding speed"
        ),
        "friction_gradient": replace(FRICTION["friction_gradient"], default=0.0),
        "kinetic_friction": replace(FRICTION["kinetic_friction"], default=0.5),
        "friction_treatment": Parameter(
            _TREATMENTS[0],
            "",
            "Coulomb's law with tanh(speed / friction_speed); itself; or bristles that shear up to it",
            choices=_TREATMENTS,
        ),
        "friction_speed": replace(
            FRICTION["friction_speed"], default=3e-4, description="regularisation speed of friction"
        ),
        "shear_stiffness": positive(
            2e7, "N/m^2", "of the bristles: force per length by shear of the rubber", sensible=(1e4, 1e12)
        ),
    },
    "record": {"sampling_rate": replace(RECORD["sampling_rate"], default=2e3)},
    "vibration": {
        "band_low": replace(VIBRATION["band_low"], default=40.0),
        "band_high": replace(VIBRATION["band_high"], default=500.0),
        "amplitude_threshold": replace(VIBRATION["amplitude_threshold"], default=1e-4),
        "window_length": replace(VIBRATION["window_length"], default=0.1),
    },
}

DEFAULT_STEPPER = "cyclic_alpha"
REFUSED = dict.fromkeys(
    GENERAL,
    "the belt's contacts are stiff and open and close: it is marched by its own step, cyclic_alpha",
)
STEPPERS = {"cyclic_alpha": "cvt_hpc.models.belt_drive.step_settings"}
COMPARED = ("speed_loss", "efficiency", "strand_tension", "tension_ripple")
KICK = "kick", 0.02  # [N s]

__all__ = ["COMPARED", "DEFAULT_STEPPER", "KICK", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters [SI]: (key, expected, found) of each."""
    p = parameters
    problems = layout_problems(p) or _beside_lists(p) or run_out_problems(p)
    if problems:
        return problems
    path = layout(p).path
    # on a short arc an element turns by half a radian
    longest = min(np.maximum(path.arcs / 4.0, path.radius / 2.0).min(), path.spans.min() / 2.0)
    element = path.path_length / p["elements"] * (1.0 + p["length_scatter"])
    if element > longest:
        least = int(np.ceil(path.path_length * (1.0 + p["length_scatter"]) / longest))
        expected = f"at least {least}, four on the shorter arc and two on a strand"
        if path.wrap.min() < 2.0:
            expected = f"at least {least}, which turn by half a radian and lie two on a strand"
        if least > (most := PARAMETERS["belt"]["elements"].maximum):
            expected += f"; but at most {most:g} are permitted: on the belt of {path.path_length:.4g} m "
            expected += f"none may be longer than {longest:.3g} m"
        problems.append(("elements", expected, f"{p['elements']}"))
    strain = p["tension"] / p["axial_stiffness"]
    if strain > 0.5:
        most = 0.5 * p["axial_stiffness"]
        problems.append(("tension", f"at most {most:g} N, half of axial_stiffness", f"{p['tension']:g} N"))
    stiffness = p["tension"] / (_DEEPEST * path.radius.min() ** 2)
    if p["contact_stiffness"] < stiffness:
        expected = f"at least {stiffness:g} N/m^2, by which the belt sinks in by {_DEEPEST:.0%} of the radius"
        problems.append(("contact_stiffness", expected, f"{p['contact_stiffness']:g} N/m^2"))
    problems += roughness_problems(p, float(path.radius.min()))
    return problems + rise_problems(p) + course_problems(p) + friction_problems(p)


def _beside_lists(p: Parameters) -> list[Problem]:
    """Settings of two pulleys, other than by default, beside lists that give all pulleys."""
    if not p["pulley_x"]:
        return []
    given = {key: entry for key in TWO if p[key] != (entry := PARAMETERS["scene"][key]).default}
    expected = "none beside pulley_x, which gives all pulleys"
    return [(key, expected, f"{show(p[key])} {entry.unit}".rstrip()) for key, entry in given.items()]


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, each with the setting that makes it so."""
    found = {"arc_probes": "model belt_drive, which is probed on its strands"}
    if parameters["length_scatter"] == 0.0:
        found["seed"] = "length_scatter 0"
    treatment = parameters["friction_treatment"]
    for key, its_own in (("friction_speed", "regularised"), ("shear_stiffness", "bristle")):
        if treatment != its_own:
            found[key] = f"friction_treatment {treatment}"
    found |= roughness_inert(parameters)
    return friction_inert(parameters) | layout_inert(parameters) | course_inert(parameters) | found
