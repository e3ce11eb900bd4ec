"""The planar elastic belt with self-induced vibration (Lebrecht et al. 2004, Bullinger et al. 2005).

Parameters that a job may set, with units, bounds and defaults. Of the defaults the same holds as of those in
`variator/scene.py`: most are assumptions, plausible and not measured. Importing this package is cheap:
kernels are compiled when `belt` is imported.
"""

import numpy as np

import cvt_hpc.models.elastic_belt.belt_settings as belt_settings
import cvt_hpc.models.elastic_belt.deflection_settings as deflection_settings
from cvt_hpc.models.elastic_belt.pulley_checks import pulley_inert, pulley_problems, shaft_problems
from cvt_hpc.models.elastic_belt.pulley_settings import DRIVEN_INERTIA, DRIVEN_SHAFT, PULLEYS, SHAFT
from cvt_hpc.models.elastic_belt.step_choice import CHOICE
from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive
from cvt_hpc.physics.friction_laws import friction_inert, friction_problems
from cvt_hpc.physics.geometry import variator, variator_problems
from cvt_hpc.physics.sheaves import STIFFNESS_OF, stiffness_factors
from cvt_hpc.steppers import taken
from cvt_hpc.variator import profiles, scene

DEFAULT_STEPPER = "imex"
REFUSED = {
    "moreau": "friction of the belt is regularised and has two directions, its contact is elastic: the belt "
    "has no set-valued forces"
}
OWN_STEPPERS = {
    "imex": "cvt_hpc.models.elastic_belt.imex_settings",
    "explicit": "cvt_hpc.models.elastic_belt.explicit_settings",
}
STEPPERS = OWN_STEPPERS | taken(REFUSED)

GIVES = {"imex": {"step_error": CHOICE}}  # by stepper: values of its parameters for a scene

KICK = "disturbance", 1e-5  # [m]

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": scene.SCENE
    | {
        "start_damping": not_negative(
            1e4,
            "N s/m^2",
            "transverse damping that the start-up adds, so that the belt settles in the grooves without "
            "ringing; fades out over rise_time",
            (1.0, 1e7),
        )
    },
    "profiles": profiles.declared(
        ("load", "driving_speed", "thrust"), ("load", "driving_speed", "thrust", "driven_pressure")
    ),
    "belt": {
        "element_mass": positive(1.0, "kg/m", "mass per length of the elements", (0.05, 20.0)),
        "ring_mass": positive(0.3, "kg/m", "mass per length of the rings", (0.01, 10.0)),
        "element_stiffness": positive(
            4e7, "N", "longitudinal stiffness EA of the pressed elements", (1e4, 1e10)
        ),
        "ring_stiffness": positive(7.7e6, "N", "longitudinal stiffness EA of all rings", (1e4, 1e10)),
        "bending_stiffness": scene.RINGS["bending_stiffness"],
        "play": Parameter(
            0.3e-3, "m", "sum of the gaps between elements on the reference path", sensible=(1e-7, 0.05)
        ),
        "reference_tension": scene.RINGS["reference_tension"],
        "ring_offset": Parameter(
            1e-3, "m", "radial offset of the rings' neutral line from the pitch line", sensible=(1e-6, 0.05)
        ),
        "ring_friction": not_negative(0.08, "", "friction coefficient between rings and elements"),
        "ring_friction_speed": positive(0.01, "m/s", "regularisation speed of that friction", (1e-5, 5.0)),
        "transverse_damping": scene.TRANSVERSE_DAMPING,
        **belt_settings.TILT,
        "element_damping": not_negative(
            20.0, "N s", "longitudinal damping of the pressed elements", (1e-3, 1e5)
        ),
        "ring_damping": scene.RINGS["ring_damping"],
        "longitudinal_mass": positive(
            1.0, "", "factor on the layers' inertia along the path; other than 1 it is another belt"
        ),
    },
    "sheaves": {
        "sheave_stiffness": positive(
            1.0,
            "",
            "stiffness of the sheaves' discs, multiple of the reference; inf: rigid; see stiffness_of",
            allow_infinite=True,
        ),
        "stiffness_of": Parameter(
            "disc",
            "",
            "stiffness that sheave_stiffness scales: the discs alone, as in Lebrecht et al. 2004, or the "
            "whole sheave, disc and tilt of its collar",
            choices=STIFFNESS_OF,
        ),
        "tilt_stiffness": positive(
            6.3e5,
            "N m/rad",
            "reference stiffness against tilting, shaft bending included",
            (100.0, 1e9),
            allow_infinite=True,
        ),
        "tilt_factor": positive(
            1.0,
            "",
            "factor on tilt_stiffness, whatever sheave_stiffness scales; inf: no tilt",
            allow_infinite=True,
        ),
        "local_stiffness": positive(
            7.1e9, "N/m^2", "reference stiffness against local bending, per length", (1e5, 1e14)
        ),
        "local_length": positive(0.013, "m", "decay length of local bending", (1e-4, 0.3)),
        "flank_stiffness": positive(
            3e10, "N/m^2", "axial stiffness of the elements, per length", (1e6, 1e14)
        ),
        "element_factor": positive(1.0, "", "factor on flank_stiffness"),
        "half_wedge_angle": scene.HALF_WEDGE_ANGLE,
        "driving_position": Parameter(
            0.0, "m", "axial opening of the driving pulley, prescribed (LOW stop)", sensible=(1e-7, 0.1)
        ),
        "sheave_lag": positive(
            2e-3, "s", "time constant T1 of the driven sheave's axial motion", (1e-6, 1.0)
        ),
        "lag_stiffness": positive(2e8, "N/m", "stiffness that scales that lag", (1e4, 1e12)),
        "driven_inertia": DRIVEN_INERTIA,
    },
    "bending": belt_settings.BENDING,
    "deflection": deflection_settings.DEFLECTION,
    "pulleys": PULLEYS,
    "shaft": SHAFT,
    "driven_shaft": DRIVEN_SHAFT,
    "rings": belt_settings.RINGS,
    "friction": scene.FRICTION,
    "mesh": {
        "stations": Parameter(160, "", "cells around the belt", minimum=24, maximum=4096),
        "end_refinement": Parameter(
            4.0,
            "",
            "cells per length at the arcs' ends over those far from them; 1: even cells",
            minimum=1.0,
            maximum=20.0,
        ),
    },
    # Sound runs have 0.001-0.8 mm/s (random scenes up to 1.9), chatter of friction 10 mm/s and more: its
    # speeds are those over which friction is regularised.
    "numerics": {
        "most_step_ripple": positive(
            2e-3,
            "m/s",
            "speed that alternates from step to step, root mean square, beyond which a run fails",
            (1e-6, 1.0),
        )
    },
    "record": {
        "profile_duration": not_negative(
            0.0,
            "s",
            "end of a run over which kept histories have sliding and forces along the belt at each sample",
            (1e-4, 10.0),
        ),
        "modal_peaks": Parameter(
            "off",
            "",
            "on: the record has the largest spectral peaks of each strand, each with its mode",
            choices=("off", "on"),
        ),
    },
}


def check(p: Parameters) -> list[Problem]:
    """Problems that lie between parameters [SI]: (key, expected, found)."""
    found = shape_problems(p) + profiles.profile_problems(p) + friction_problems(p)
    return found or pulley_problems(p)


def shape_problems(p: Parameters) -> list[Problem]:
    """Problems between sizes: pulleys that overlap, play beyond reason. Result as of `check`."""
    problems = variator_problems(p)
    if not problems:
        path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
        if abs(p["play"]) > 0.02 * path.path_length:
            expected = f"within 2 % of the belt's length {path.path_length:.4g} m"
            problems.append(("play", expected, f"{p['play']:g} m"))
        problems += deflection_settings.deflection_problems(p)
        problems += belt_settings.stack_problems(p, min(path.driving_radius, path.driven_radius))
    return problems + shaft_problems(p) + belt_settings.belt_problems(p)


def inert(p: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, so that a study does not vary them for nothing.

    By the name of the parameter, the setting that makes it so, e.g. "friction_law table".
    """
    whole, disc = stiffness_factors(p)
    of_disc, of_tilt = ("local_stiffness", "local_length"), ("tilt_stiffness", "tilt_factor")
    cases = (
        (p["disturbance"] == 0.0, ("seed",), "disturbance 0"),
        (not belt_settings.rings_rub(p), ("ring_friction_speed",), "ring_friction 0"),
        (p["sheave_stiffness"] == 1.0, ("stiffness_of",), "sheave_stiffness 1"),
        (np.isinf(p["tilt_factor"]), of_tilt[:1], "tilt_factor inf"),
        (np.isinf(p["tilt_stiffness"]), of_tilt[1:], "tilt_stiffness inf"),
        (np.isinf(disc), of_disc, "sheave_stiffness inf"),
        (np.isinf(whole), of_disc + of_tilt, "sheave_stiffness inf"),
    )
    found = {key: setting for holds, keys, setting in cases if holds for key in keys}
    of_parts = friction_inert(p) | scene.course_inert(p) | pulley_inert(p)
    return of_parts | deflection_settings.deflection_inert(p) | belt_settings.belt_inert(p) | found
