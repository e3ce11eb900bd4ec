"""Parameters of the criterion that a job may set: quantities of the elastic belt, and how its flank slides.

The defaults are assumptions: a metre of the driven wrap of the elastic belt at 50 kN (its arc is 0.28 m
long), on sheaves that tilt (3e5 N m/rad over arc times radius squared), which slides radially.
"""

from typing import Any

from cvt_hpc.models import elastic_belt
from cvt_hpc.parameters import Parameter, not_negative, positive
from cvt_hpc.physics.friction_laws import friction_inert, friction_problems

_BELT, _SHEAVES = elastic_belt.PARAMETERS["belt"], elastic_belt.PARAMETERS["sheaves"]

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": {
        "contact_force": positive(
            1.8e5, "N/m", "axial line force of one flank, in steady sliding", sensible=(10.0, 100000000.0)
        ),
        "radial_speed": Parameter(
            0.1, "m/s", "radial sliding speed of the elements, inward positive", sensible=(1e-06, 50.0)
        ),
        "tangential_speed": Parameter(
            0.0, "m/s", "tangential sliding speed of the elements", sensible=(1e-06, 50.0)
        ),
    },
    "belt": {
        **{key: _BELT[key] for key in ("element_mass", "ring_mass", "transverse_damping")},
        "belt_stiffness": not_negative(
            0.0,
            "N/m^2",
            "the belt's own radial stiffness per length, that of the contact apart",
            sensible=(1.0, 10000000000000.0),
        ),
    },
    "sheaves": {
        "contact_stiffness": not_negative(
            1.8e8,
            "N/m^2",
            "axial stiffness of elements and sheaves together, per length",
            sensible=(10000.0, 100000000000000.0),
        ),
        "half_wedge_angle": _SHEAVES["half_wedge_angle"],
    },
    "friction": elastic_belt.PARAMETERS["friction"],
    "judgement": {
        "undecided_margin": Parameter(
            0.1,
            "",
            "energy balance (fed - taken) / (fed + taken) up to which nothing is decided, either way",
            minimum=0.0,
            maximum=1.0,
        )
    },
}


def check(parameters: dict[str, Any]) -> list[tuple[str, str, str]]:
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
    problems = friction_problems(p)
    if p["radial_speed"] == 0.0 and p["tangential_speed"] == 0.0:
        problems.append(("radial_speed", "a flank that slides, radially or tangentially", "both speeds 0"))
    return problems


def inert(parameters: dict[str, Any]) -> dict[str, str]:
    """Parameters without effect: see `elastic_belt.inert`."""
    return friction_inert(parameters)
