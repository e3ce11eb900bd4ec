"""The step of `imex` for a scene: as long as accuracy and stability allow.

**Accuracy.** The step is of first order: its effect on a vibration's amplitude is in proportion to its
length over the period. REFERENCE_STEP changes it by REFERENCE_ERROR at the working point of the chart, whose
vibrations are below _REFERENCE_BAND. Elsewhere that is no bound: of 81 random scenes that vibrate it changes
half by more than 1.2 %, a tenth by more than 9 % (`docs/guide/validation.md`).

**Stability.** Transverse motion is explicit but for bending (`imex_stations`): beyond 2 / w the shortest
waves grow, w being their angular frequency under tension and contact, and beyond 2 m / (c kappa^2) what the
layers' dampers c brake (`transverse_limit`). The step chosen stays at SAFE_SHARE of that.
"""

import numpy as np

from cvt_hpc.parameters import Parameters, Substitute
from cvt_hpc.physics.geometry import cut_path, variator, variator_problems
from cvt_hpc.physics.sheaves import axial_element_stiffness

REFERENCE_STEP, REFERENCE_ERROR = 4.6e-6, 0.02  # [s], share of the amplitude
_REFERENCE_BAND = 1500.0  # [Hz], of a vibration, as a job has it by band_high
SAFE_SHARE = 0.75
SHORTEST = 1e-9  # [s], of a step: of scenes that are beyond all sense
MESH = ("ratio", "driven_radius", "centre_distance", "stations", "end_refinement")  # the path and its cells
_LAYERS = ("element_mass", "ring_mass", "element_damping", "ring_damping")
_FLANKS = ("flank_stiffness", "element_factor", "half_wedge_angle")
NEEDS = ("step_error", "band_high", *MESH, "thrust", "driving_speed", *_LAYERS, *_FLANKS)


def transverse_limit(p: Parameters) -> float:
    """Longest stable step of the transverse motion [s], by flat values [SI] of a run.

    The fastest waves are two of the shortest cells long, in the grooves:
    w^2 = (4 F / h^2 + 4 c_e tan^2 delta) / m, F being the tension that the thrust has the grooves bear.
    Bending, which is implicit, has no part in it. What the belt carries goes on by a cell in a step at most.
    Arcs that move outwards without a motion along the belt are braked by (c_0 + c_1) kappa^2 / m.
    """
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    cell = min(cells.min() for cells in cut_path(path, p["stations"], p["end_refinement"]))
    slope = np.tan(p["half_wedge_angle"])
    force = 2.0 * slope * p["thrust"] / path.driven_wrap
    stiffness = 4.0 * force / cell**2 + 4.0 * slope**2 * axial_element_stiffness(p)
    waves = 2.0 / np.sqrt(stiffness / (p["element_mass"] + p["ring_mass"]))
    braked = (p["element_damping"] + p["ring_damping"]) / min(path.driving_radius, path.driven_radius) ** 2
    dampers = 2.0 * (p["element_mass"] + p["ring_mass"]) / max(braked, SHORTEST)
    return float(min(waves, dampers, cell / (p["driving_speed"] * path.driving_radius)))


def chosen_step(parameters: Parameters) -> float:
    """Step of `imex` [s] for a scene, by flat values [SI] of NEEDS, to three digits.

    So that scenes whose limits differ by rounding have one step, and advance together. Of a scene that is no
    variator, which the model refuses, it is the one by accuracy alone.
    """
    step = REFERENCE_STEP * parameters["step_error"] / REFERENCE_ERROR
    step *= _REFERENCE_BAND / parameters["band_high"]
    if not variator_problems(parameters):
        step = min(step, SAFE_SHARE * transverse_limit(parameters))
    return max(float(f"{step:.2e}"), SHORTEST)


CHOICE = Substitute("step", NEEDS, chosen_step)
