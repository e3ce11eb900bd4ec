"""A string that runs between two eyes: the strand of a belt without bending, push force and neighbours.

    m (w_tt + 2 v w_xt + v^2 w_xx) = T w_xx,   w = 0 at x = 0 and x = L,

m its mass per length, T its tension, v its speed, c = sqrt(T / m). Eigenfrequencies n (c^2 - v^2) / (2 c L);
from v = c on it holds no shape (critical speed).

Parameters of the moving string that a job may set; the defaults are near those of a belt's strand.
"""

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters, Problem, positive
from cvt_hpc.steppers import taken

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": {
        "belt_speed": Parameter(9.4, "m/s", "speed of the string", minimum=0.0, sensible=(0.001, 200.0)),
        "shape": Parameter(
            "mode",
            "",
            "wave that travels along the string: an eigenmode, or a single pulse",
            choices=("mode", "pulse"),
        ),
        "mode": Parameter(1, "", "number of the eigenmode", minimum=1, maximum=1000),
        "pulse_width": positive(0.1, "", "width of the pulse, relative to the length of its way and back"),
        "largest_displacement": positive(
            1e-5, "m", "largest displacement at the start, nearly", sensible=(1e-12, 0.1)
        ),
    },
    "string": {
        "length": positive(0.15, "m", "length between the eyes", sensible=(0.001, 10.0)),
        "tension": positive(5000.0, "N", "tension T", sensible=(0.01, 10000000.0)),
        "line_mass": positive(1.3, "kg/m", "mass per length", sensible=(0.0001, 100.0)),
    },
    "mesh": {
        "cells": Parameter(64, "", "cells between the eyes", minimum=4, maximum=4096),
    },
}

DEFAULT_STEPPER = "runge_kutta_4"
REFUSED = {
    "moreau": "nothing rubs here: it is for set-valued friction and rigid contact",
}
STEPPERS = taken(REFUSED)

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters.

    Parameters
    ----------
    parameters : dict
        Values by name, in SI units.

    Returns
    -------
    list of (key, expected, found)
        Empty where all is well.
    """
    p = parameters
    problems = []
    wave = np.sqrt(p["tension"] / p["line_mass"])
    if p["belt_speed"] >= wave:
        expected = f"less than the wave speed sqrt(tension / line_mass) = {wave:g} m/s"
        problems.append(("belt_speed", expected, f"{p['belt_speed']:g} m/s"))
    if p["cells"] < p["strand_probes"] + 1:
        expected = f"strand_probes + 1 = {p['strand_probes'] + 1} or more"
        problems.append(("cells", expected, f"{p['cells']}"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, each with the setting that makes it so."""
    shape = parameters["shape"]
    found = {"arc_probes": "model moving_string, which has one strand"}
    return found | {"pulse_width" if shape == "mode" else "mode": f"shape {shape}"}
