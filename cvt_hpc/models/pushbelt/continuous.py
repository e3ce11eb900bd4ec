"""Which pushbelt is the same belt as a continuous one (`elastic_belt`): its parameters from those of that.

A key that both models know is one quantity: the scene, the masses, ring stiffness, offset, play and
friction of the belt, the transverse damping, wedge angle and inertia, the law of friction and its memory.
`FOLLOWS` has the rules for other keys, so that an element, a flank and a pulley deform alike:

- force between neighbours: `edge_stiffness` times strain is `element_stiffness` times strain. Their damper
  is that of the continuous belt, but acts as long as a step of 10 us resolves (`LEAST_CONTACT_TIME`).
  Impacts are as good as plastic with either, and lose the same;
- a flank alone has half the axial compliance of a station's element, 1 / c_e of both flanks. Its own
  stiffness c is normal force over normal overlap, of which the axial one is c cos^2 d0:
  1 / (c cos^2 d0) = 1 / (2 c_e);
- rings bend, are as long and are damped by the same keys;
- local bending has the same keys. `sheave_stiffness` scales the pushbelt's modes of opening as well, so a
  value other than 1 requires `stiffness_of` "sheave";
- the sheaves' tilt lags by the same key, and by it alone;
- tilt opens a pulley by r^2 / c_tilt cos(phi) times the sum of F cos(phi), and likewise with sin, while modes
  open each flank by 1 / S: S = 2 c_tilt / r^2 of cos and sin. Nothing opens all around alike;
- the thrust moves the driven sheave by 1 / (T_1 k) in opening, which is 2 tan d0 of radius: `sheave_rate`;
- elements tilt against the rings by the same spring and damper. Of a continuum whose elements do not tilt, by
  the pushbelt's default ones.

Assumptions: terms of the continuum alone (`docs/guide/terms.md`) are left out.
Elements have an inertia against tilting and a second contact of which the continuum knows nothing: the
pushbelt's own defaults. The push adds P to its stiffness against tilting, k_a, and a moment P kappa t / 2, t
being an element's thickness: (k_a + P) theta = -d (f_t - P_s) - P kappa t / 2 in a steady state, of which the
continuum has k_a theta = -d (f_t - P_s).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.models.elastic_belt.pulley_settings import PULLEY_DEFAULTS
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.sheaves import axial_element_stiffness
from cvt_hpc.variator.scene import TILT

_RESOLVED = 7.5e-6  # [s]: damping over stiffness of contacts between elements, at least
_RIGID = 1e12  # [N/m]: of a mode that does not open; it gives way by 0.1 um under 100 kN

# By key of the continuum the only value that the pushbelt has a counterpart of
ONLY = {
    "driving_position": 0.0,
    "longitudinal_mass": 1.0,
    "sheave_deformation": "bending",
    "ring_layers": 1,
    "curvature_terms": "none",
    "column_bending": "off",
    **{key: value for key, value in PULLEY_DEFAULTS.items() if key != "tilt_lag"},
}


class Follows(NamedTuple):
    """Rule by which a parameter of the pushbelt follows."""

    needs: tuple[str, ...]  # keys of the continuous belt that decide it
    value: Callable[[Parameters], Any]  # flat parameters of the continuous belt [SI] -> the value [SI]


def _flank_stiffness(p: Parameters) -> float:
    return float(2.0 * axial_element_stiffness(p) / np.cos(p["half_wedge_angle"]) ** 2)


def _modes(p: Parameters, radius: float) -> tuple[float, float, float]:
    tilt = min(2.0 * p["tilt_stiffness"] * p["tilt_factor"] / radius**2, _RIGID)
    return _RIGID, tilt, tilt


def _tilt(key: str, p: Parameters) -> float:
    return float(p[key] if np.isfinite(p["tilt_spring"]) else TILT[key].default)


FOLLOWS = {
    # the driving sheave is held, as ONLY has it: the continuum has an idle thrust by this name
    "driving_thrust": Follows(("driving_axial",), lambda p: 0.0),
    "edge_stiffness": Follows(("element_stiffness",), lambda p: p["element_stiffness"]),
    "element_damping": Follows(
        ("element_damping", "element_stiffness"),
        lambda p: max(p["element_damping"], _RESOLVED * p["element_stiffness"]),
    ),
    "flank_stiffness": Follows(("flank_stiffness", "element_factor", "half_wedge_angle"), _flank_stiffness),
    "driving_modal_stiffness": Follows(
        ("tilt_stiffness", "tilt_factor", "ratio", "driven_radius"),
        lambda p: _modes(p, p["driven_radius"] / p["ratio"]),
    ),
    "driven_modal_stiffness": Follows(
        ("tilt_stiffness", "tilt_factor", "driven_radius"), lambda p: _modes(p, p["driven_radius"])
    ),
    "tilt_spring": Follows(("tilt_spring",), partial(_tilt, "tilt_spring")),
    "tilt_damper": Follows(("tilt_spring", "tilt_damper"), partial(_tilt, "tilt_damper")),
    "sheave_rate": Follows(
        ("sheave_lag", "lag_stiffness", "half_wedge_angle"),
        lambda p: float(0.5 / np.tan(p["half_wedge_angle"]) / (p["sheave_lag"] * p["lag_stiffness"])),
    ),
}
