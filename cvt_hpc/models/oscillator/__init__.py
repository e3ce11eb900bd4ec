"""A mass on a spring, dragged by a belt that runs below it: the smallest model with friction noise.

    m x'' + c x' + k x = P + N(x) mu(v - x'),   N(x) = N_0 - n x,

x the displacement of the mass, v the speed of the belt, N the normal load, P a constant force. It is the
radial oscillator of Lebrecht et al. 2004 in full (eqs 13-14: elements that creep inwards through the groove
at v_0 = v), x outwards, with the weights of its forces put together:

    c = d_belt,   k = c_belt + 2 c_ele tan(theta)^2,   N_0 = 2 f_ax,0,   n = 2 c_ele tan(theta),
    P = 2 f_ax,0 tan(theta) - f_rad,0   (-2 f_ax,0 mu_0 where x = 0 is steady sliding).

With n = 0 and P = 0, the defaults, it is the mass on a belt. Steady sliding is at x_s = (P + N_0 mu) / (k +
n mu); small motions about it have the eigenvalues of m s^2 + (c + N mu') s + k + n mu = 0.

It answers whether, how fast, how far and at what frequency one mass on one friction law vibrates, whether it
sticks, and from which starts. It knows one direction of sliding and no belt: no load, no strand, no mode, and
no wave that takes energy away. A run in which the normal load falls to 0 has failed: lift-off is not in it.

Steppers other than `moreau` take the friction law with its jump at rest smoothed over `friction_speed`;
`moreau` takes it as it is.

Parameters of the oscillator that a job may set. The defaults: stick-slip of unit mass and stiffness.
"""

from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive
from cvt_hpc.physics.friction_laws import FRICTION_LAWS, friction_file, friction_inert, friction_problems
from cvt_hpc.steppers import STEPPERS

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": {
        "belt_speed": not_negative(0.2, "m/s", "speed of the belt under the mass", sensible=(1e-06, 100.0)),
        "normal_load": positive(
            1.0, "N", "force that presses the mass on the belt", sensible=(1e-06, 10000000.0)
        ),
        "preload": Parameter(
            0.0, "N", "constant force on the mass, in the belt's direction", sensible=(1e-06, 10000000.0)
        ),
        "start": Parameter(
            "given",
            "",
            "as given, or initial_displacement away from steady sliding: at rest, or carried by the belt",
            choices=("given", "sliding", "sticking"),
        ),
        "initial_displacement": Parameter(
            0.0, "m", "displacement of the mass at the start", sensible=(1e-12, 100.0)
        ),
        "initial_speed": Parameter(
            0.2, "m/s", "speed of the mass at the start; belt_speed: it sticks", sensible=(1e-09, 100.0)
        ),
    },
    "oscillator": {
        "mass": positive(1.0, "kg", "the mass", sensible=(1e-06, 100000.0)),
        "stiffness": positive(1.0, "N/m", "stiffness of its spring", sensible=(1e-06, 1000000000000.0)),
        "normal_stiffness": not_negative(
            0.0,
            "N/m",
            "fall of the normal load per displacement of the mass",
            sensible=(1e-06, 1000000000000.0),
        ),
        "damping": not_negative(
            0.0, "N s/m", "viscous damping of its spring", sensible=(1e-06, 1000000000.0)
        ),
    },
    "friction": {
        "friction_law": Parameter(
            "coulomb",
            "",
            "friction of the mass over sliding speed",
            choices=FRICTION_LAWS,
        ),
        "friction_gradient": Parameter(
            0.0,
            "s/m",
            "slope dmu/dv of the friction law at v -> 0+, its steepest fall, without regularisation",
            maximum=0.0,
            sensible=(0.001, 100.0),
        ),
        "kinetic_friction": positive(0.6, "", "the level that does not change with the gradient"),
        "static_friction": Parameter(
            1.0, "", "level at rest, of the coulomb law alone; the others have theirs by the law", minimum=0.0
        ),
        "stribeck_velocity": positive(0.05, "m/s", "speed scale of the fall", sensible=(0.0001, 10.0)),
        "friction_speed": positive(
            1e-3,
            "m/s",
            "regularisation speed of friction at rest; moreau does without",
            sensible=(1e-09, 5.0),
        ),
        "table_file": friction_file("N"),
        "table_force": Parameter(
            (), "N", "normal loads of a friction table, ascending", sensible=(1e-06, 10000000.0)
        ),
        "table_speed": Parameter((), "m/s", "speeds of a friction table, ascending", sensible=(1e-07, 100.0)),
        "table_mu": Parameter((), "", "friction table: a row of coefficients for each load"),
    },
}

DEFAULT_STEPPER = "moreau"
KICK = "initial_displacement", 1e-6  # [m]

__all__ = ["DEFAULT_STEPPER", "KICK", "PARAMETERS", "STEPPERS", "check", "inert"]


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters [SI]: (key, expected, found) of each."""
    p = parameters
    problems = friction_problems(p)
    if p["friction_law"] == "coulomb" and p["static_friction"] < p["kinetic_friction"]:
        expected = f"kinetic_friction {p['kinetic_friction']:g} or more with friction_law coulomb"
        problems.append(("static_friction", expected, f"{p['static_friction']:g}"))
    if p["normal_stiffness"] * p["preload"] >= p["normal_load"] * p["stiffness"]:
        most = p["normal_load"] * p["stiffness"] / p["normal_stiffness"]
        problems.append(("preload", f"less than {most:g} N, which lifts the mass off", f"{p['preload']:g} N"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, each with the setting that makes it so."""
    p = parameters
    law = p["friction_law"]
    cases = (
        (p["start"] != "given", "initial_speed", f"start {p['start']}"),
        (law != "coulomb", "static_friction", f"friction_law {law}"),
    )
    found = dict.fromkeys(("strand_probes", "arc_probes"), "model oscillator, which has no belt")
    return friction_inert(p) | found | {key: setting for holds, key, setting in cases if holds}
