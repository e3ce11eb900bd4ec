"""The free strands as running beams that are pulled and pushed: eigenfrequencies and critical speed.

It answers at which frequencies a strand can vibrate, in which modes, and how that changes with load
(Lebrecht et al. 2004, sec. 3.2, fig. 3.7). A strand of length L between pinned ends runs at v with the net
force F = T - P, ring tension less push force; with w = sum q_n(t) sin(n pi x / L) its energies (eq. 8)

    kinetic 1/2 m int (w_t + v w_x)^2 dx,    potential 1/2 int (F w_x^2 + EI w_xx^2) dx

give by Lagrange (eqs 7-11) q'' + G q' + K q = 0 with

    K_nn = (F / m - v^2) (n pi / L)^2 + (EI / m) (n pi / L)^4,
    G_jk = 8 v j k / (L (j^2 - k^2)) where j + k is odd, else 0.

Without the terms of v each K_nn stands alone (eq. 12: `resting_frequency`). At the critical speed v^2 = (F +
EI pi^2 / L^2) / m the first K_nn is 0: the strand no longer holds its shape.

It does not know whether anything vibrates (`vibrates` is always undecided: a strand alone has no source of
energy), how far, the arcs at its ends, the neighbouring strand, and damping.

Parameters of the strands: quantities of the elastic belt, and the source of their forces.
"""

from cvt_hpc.models import elastic_belt
from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.physics.geometry import variator_problems

_BELT = elastic_belt.PARAMETERS
_FORCES = ("ring_tension_t1", "push_force_t1", "ring_tension_t2", "push_force_t2")
_OF_FORMULAS = ("thrust", "load", "half_wedge_angle", "kinetic_friction")

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": {
        **{
            key: _BELT["scene"][key]
            for key in (
                "ratio",
                "driven_radius",
                "belt_length",
                "centre_distance",
                "driving_speed",
                "thrust",
                "load",
                "load_share",
            )
        },
        "strand_forces": Parameter(
            "formulas",
            "",
            "by belt formulas from thrust and load, or as given in [strands]",
            choices=("formulas", "given"),
        ),
    },
    "strands": {
        "ring_tension_t1": not_negative(
            7000.0,
            "N",
            "ring tension of the strand that leaves the driving pulley",
            sensible=(10.0, 1000000.0),
        ),
        "push_force_t1": not_negative(
            0.0, "N", "push force between the elements of that strand", sensible=(1.0, 1000000.0)
        ),
        "ring_tension_t2": not_negative(
            7000.0,
            "N",
            "ring tension of the strand that enters the driving pulley",
            sensible=(10.0, 1000000.0),
        ),
        "push_force_t2": not_negative(
            0.0, "N", "push force between the elements of that strand", sensible=(1.0, 1000000.0)
        ),
    },
    "belt": {key: _BELT["belt"][key] for key in ("element_mass", "ring_mass", "bending_stiffness")},
    "sheaves": {"half_wedge_angle": _BELT["sheaves"]["half_wedge_angle"]},
    "friction": {"kinetic_friction": _BELT["friction"]["kinetic_friction"]},
    "mesh": {
        "ritz_functions": Parameter(
            48, "", "half waves along the strand in the Ritz model", minimum=5, maximum=512
        )
    },
}

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]


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
    problems = variator_problems(p)
    if not problems and p["strand_forces"] == "formulas":
        most = carried_torque(p)  # from there on the driven pulley slips
        if abs(p["load"]) >= most:
            expected = f"less than {most:.4g} N m, which friction carries on the driven pulley"
            problems.append(("load", expected, f"{p['load']:g} N m"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, each with the setting that makes it so."""
    keys = _FORCES if parameters["strand_forces"] == "formulas" else _OF_FORMULAS
    return dict.fromkeys(keys, f"strand_forces {parameters['strand_forces']}")
