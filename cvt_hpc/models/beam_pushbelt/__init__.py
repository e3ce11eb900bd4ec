"""The planar pushbelt on a ring of beams (Geier and Schindler 2007): the slow reference of `pushbelt`.

Parameters are those of `pushbelt`, and those of the ring. Importing this package is cheap: kernels are
compiled when `transient` is imported.
"""

import numpy as np

from cvt_hpc.models.pushbelt import parameters as pushbelt
from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative
from cvt_hpc.steppers import STEPPERS as GENERAL

DEFAULT_STEPPER = "proximal"
REFUSED = dict.fromkeys(
    GENERAL, "its set-valued laws are coupled by the ring: it is marched by its own step, proximal"
)
STEPPERS = {"proximal": "cvt_hpc.models.beam_pushbelt.proximal_settings"}
KICK = "kick", 0.02  # [m/s]
_MOST_TURN = np.pi / 3.0  # [rad] of a beam along an arc

# what the model of rigid sheaves, bare strands and set-valued friction does without, and what that is there
_WITHOUT = {"coarse": True, "nose_clearance": np.inf, "transverse_damping": 0.0, "sheave_stiffness": np.inf}
_IDLE = (
    *("nose_height", "nose_stiffness", "element_damping", "local_stiffness", "local_length"),
    *("ring_friction_speed", "ring_damping", "bending_stiffness", "friction_speed", "gravity", "tilt_lag"),
    *pushbelt.MODES,
)
_ALL = {key: entry for table in pushbelt.PARAMETERS.values() for key, entry in table.items()}
_WITHOUT |= {key: _ALL[key].default for key in _IDLE}
_CHANGED: dict[str, Parameter] = {
    "elements": Parameter(160, "", "elements of the belt", minimum=32, maximum=512),
    "kinetic_friction": not_negative(0.09, "", "the level that does not change with the gradient"),
}
PARAMETERS: dict[str, dict[str, Parameter]] = {
    name: {key: _CHANGED.get(key, entry) for key, entry in table.items() if key not in _WITHOUT}
    for name, table in pushbelt.PARAMETERS.items()
    if not table.keys() <= _WITHOUT.keys()
}
PARAMETERS["belt"] |= {
    "ring_beams": Parameter(40, "", "beams of the ring", minimum=4, maximum=512),
    # a dozen steel bands of 0.18 mm, 18 mm wide in sum: 12 E b h^3 / 12
    "ring_bending_stiffness": not_negative(
        0.02, "N m^2", "EI of all rings, which are circles without load", sensible=(1e-4, 10.0)
    ),
}


def as_pushbelt(parameters: Parameters) -> Parameters:
    """Parameters, completed by the further ones of `pushbelt`."""
    return {**_WITHOUT, **parameters}


def _step_limit(parameters: Parameters) -> float:
    """Longest explicit step of elements that all press on each other at edge and head [s].

    The contacts' forces f obey f'' = -c G f with G = W^T M^-1 W. A contact at height h shares its two
    elements with those at both heights h' there and on both sides, each by 1 / m + h h' / J; so the sum of a
    row bounds the square of the highest frequency.
    """
    p = parameters
    pitch = pushbelt.path_length(p) / p["elements"]
    mass = p["element_mass"] * pitch
    inertia = mass * (p["element_height"] ** 2 + pitch**2) / 12.0
    heights = np.array([-p["ring_offset"], p["head_height"]])
    rows = 4.0 * np.abs(1.0 / mass + np.outer(heights, heights) / inertia).sum(axis=1)
    return float(2.0 / np.sqrt(p["edge_stiffness"] / pitch * rows.max()))


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters [SI], in the form of `pushbelt.check`."""
    p = parameters
    if problems := pushbelt.check(as_pushbelt(p)):
        return problems
    # the slopes of a beam count as small; those that turn by 30 degrees carry 1.6 % less tension
    around = pushbelt.path_length(p) + 2.0 * np.pi * p["ring_offset"]
    least = int(np.ceil(around / min(p["driven_radius"], p["driven_radius"] / p["ratio"]) / _MOST_TURN))
    if p["ring_beams"] < least:
        expected = f"at least {least}, so that none turns by more than {np.rad2deg(_MOST_TURN):.0f} degrees"
        problems.append(("ring_beams", expected, f"{p['ring_beams']}"))
    if "step" in p and p["step"] > (limit := _step_limit(p)):
        expected = f"at most {limit:.3g} s, the limit of elements that press on each other"
        problems.append(("step", expected, f"{p['step']:g} s"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, by name the setting that makes them so."""
    found = pushbelt.inert(as_pushbelt(parameters))
    found["arc_probes"] = "model beam_pushbelt, which is probed on its strands"
    return {key: why for key, why in found.items() if key in parameters}
