"""The energy criterion: whether friction feeds a small radial vibration of elements that creep in the groove.

It answers one question, *does friction that falls as steeply as this excite a contact that slides like
that?*, for a metre of belt in the wrap that is pressed by `contact_force` and slides at given speeds.
Lebrecht et al. 2004 derive it in sec. 4 (eqs 13-19) from an oscillator of mass m. It is taken per length
here, so that its quantities are the elastic belt's:

    m x'' = f_rad - d x' - c_belt x - 2 (f_ax + c_ele x tan(th)) (tan(th) + mu_r(v_r + x')),

x inwards, v_r the radial creep, mu_r its friction. A harmonic motion x = X cos(w t) does the work

    E(X) = -pi w X^2 (d + 2 f_ax mu')  at small X,    w^2 = [c_belt + 2 c_ele tan(th) (tan(th) + mu_r)] / m

in a period: the preload's terms cancel, and c_ele's do no work by symmetry. So it grows where mu' < -d / (2
f_ax) (eq. 19). A flank that slides in two directions, at |v| with the radial part |v| sin(gamma), has mu_r =
mu(|v|) v_r / |v|, whose slope in v_r is

    mu' sin(gamma)^2 + (mu / |v|) cos(gamma)^2

in the place of mu': tangential sliding makes dry friction viscous across, and damps. With friction memory the
falling part of mu' is divided by 1 + (w tau)^2, its share in phase with the speed. At finite X the same
work is integrated over the friction law as it is, sliding that turns about included; where E(X) comes back
to zero from above is the amplitude of a limit cycle in harmonic balance.

It cannot answer at which load or ratio a belt vibrates (that needs the sliding of each element: the
elastic belt), in which mode and strand, or with which amplitude the strands move; motions that are not
harmonic, which have a `damping_ratio` below -0.1; and stick-slip.

Parameters of the criterion that a job may set: quantities of the elastic belt, and how its flank slides.

The defaults are assumptions: a metre of the driven wrap of the elastic belt at 50 kN (its arc is 0.28 m
long), on sheaves that tilt (3e5 N m/rad over arc times radius squared), which slides radially.
"""

from cvt_hpc.models import elastic_belt
from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive
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
    problems = friction_problems(p)
    if p["radial_speed"] == 0.0 and p["tangential_speed"] == 0.0:
        problems.append(("radial_speed", "a flank that slides, radially or tangentially", "both speeds 0"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect: see `elastic_belt.inert`."""
    return friction_inert(parameters)
