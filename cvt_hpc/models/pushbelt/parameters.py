"""Parameters of the planar pushbelt that a job may set, with units, bounds and defaults.

Centre distance, belt length, number and mass of the elements are those of a common passenger-car belt; ratio
and driving_speed are those of Geier and Schindler's measurements (2007, fig. 4). Every other default is an
assumption, plausible and not measured.
"""

from dataclasses import replace

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters, Problem, Substitute, not_negative, positive
from cvt_hpc.physics.friction_laws import FRICTION_LAWS, friction_inert, friction_problems
from cvt_hpc.physics.geometry import driven_radius, variator, variator_problems
from cvt_hpc.variator import PULLEYS, profiles, scene
from cvt_hpc.variator.profiles import extremes, profile_problems
from cvt_hpc.variator.scene import nested
from cvt_hpc.vibration.ramped import ramped

_FEWEST_ELEMENTS = 100
_BELOW_PASSAGE = 0.9  # of half that frequency: belts run up to 4 % slower than by the nominal radius
_NOT_HERE = ("disturbance", "seed")
MODES = ("driving_modal_stiffness", "driven_modal_stiffness")
SCALED = (*MODES, "local_stiffness", "local_length")  # without effect between rigid sheaves
_RINGS = {"bending_stiffness": 0.0, "reference_tension": 600.0}  # defaults other than the elastic belt's
_NO_TABLE = ("table_file", "table_force", "table_speed", "table_mu")


def _play(parameters: Parameters) -> float:
    play = path_length(parameters) - parameters["elements"] * parameters["thickness"]
    if not 0.0 <= play <= parameters["thickness"]:
        least, most = (path_length(parameters) / (parameters["elements"] + more) for more in (1, 0))
        raise ValueError(
            f"{least:.6g} to {most:.6g} m, so that the elements fit with less play than one of them"
        )
    return play


def path_length(parameters: Parameters) -> float:
    """Length of the closed pitch line [m]."""
    p = parameters
    return variator(p["ratio"], p["driven_radius"], p["centre_distance"]).path_length


PARAMETERS: dict[str, dict[str, Parameter]] = {
    "scene": {
        **{key: entry for key, entry in scene.SCENE.items() if key not in _NOT_HERE},
        "ratio": replace(
            scene.SCENE["ratio"], default=1.35, description="speed ratio, driven radius / driving radius"
        ),
        "driven_radius": replace(scene.SCENE["driven_radius"], default=0.063896),
        "driving_speed": replace(scene.SCENE["driving_speed"], default=100.0 * np.pi),
        "thrust": replace(scene.SCENE["thrust"], default=20e3),
        # elements stick radially until they have come round: with less, a load near the limit slips through
        "rise_time": replace(
            scene.SCENE["rise_time"],
            default=0.12,
            description="start-up: thrust rises in its first half, load in its second",
        ),
        "driving_thrust": not_negative(
            0.0,
            "N",
            "axial force on the driving pulley; 0: its sheave stays where the ratio puts it",
            sensible=(500.0, 2e6),
        ),
        "kick": not_negative(
            0.0,
            "m/s",
            "largest speed outwards that is given to each strand when the judged part begins",
            sensible=(1e-6, 10.0),
        ),
        "gravity": Parameter(
            0.0,
            "m/s^2",
            "acceleration of gravity in the plane of the belt, across the line of both shafts, from t2 to t1",
            minimum=-100.0,
            maximum=100.0,
            sensible=(0.1, 100.0),
        ),
    },
    "profiles": profiles.declared(
        ("load", "driving_speed", "thrust", "driving_thrust", "ratio"),
        ("load", "driving_speed", "thrust", "driving_thrust"),
    ),
    "belt": {
        "elements": Parameter(432, "", "elements of the belt", minimum=32, maximum=4096),
        "coarse": Parameter(
            False,
            "",
            f"fewer than {_FEWEST_ELEMENTS} elements are meant: super elements, a polygon around the arcs",
        ),
        "element_mass": positive(1.214, "kg/m", "mass per length of the elements", sensible=(0.05, 20.0)),
        "element_height": positive(
            0.013, "m", "height of an element, whose inertia is that of a plate", sensible=(1e-3, 0.1)
        ),
        "play": not_negative(
            0.3e-3, "m", "sum of the gaps between elements on the path", sensible=(1e-07, 0.05)
        ),
        "thickness": positive(
            None,
            "m",
            "thickness of an element, in the place of play, which follows",
            gives=Substitute("play", ("elements", "ratio", "driven_radius", "centre_distance"), _play),
            sensible=(1e-4, 0.02),
        ),
        "edge_stiffness": positive(
            1.53e6,
            "N",
            "force between neighbours at rocking edge or head by their approach over the pitch",
            sensible=(1e4, 1e10),
        ),
        "element_damping": not_negative(
            20.0,
            "N s",
            "damping of these contacts, force by rate of approach over the pitch",
            sensible=(1e-3, 1e5),
        ),
        "ring_offset": positive(
            1.5e-3,
            "m",
            "radial offset of the rings from the pitch line and the rocking edge",
            sensible=(1e-06, 0.05),
        ),
        "head_height": positive(
            4e-3,
            "m",
            "height above the rings of the second contact between neighbours",
            sensible=(1e-05, 0.05),
        ),
        "nose_clearance": not_negative(
            np.inf,
            "m",
            "play of an element's nose in the next one's hole, up and down; inf: no noses",
            sensible=(1e-6, np.inf),
            allow_infinite=True,
        ),
        "nose_height": positive(6e-3, "m", "height of nose and hole above the rings", sensible=(1e-5, 0.05)),
        "nose_stiffness": positive(
            1e8, "N/m", "force of a nose over the offset beyond its play", sensible=(1e4, 1e11)
        ),
        "ring_mass": positive(0.2495, "kg/m", "mass per length of the rings", sensible=(0.01, 10.0)),
        "ring_stiffness": positive(6e6, "N", "longitudinal stiffness EA of all rings", sensible=(1e4, 1e10)),
        **{key: replace(entry, default=_RINGS.get(key, entry.default)) for key, entry in scene.RINGS.items()},
        "ring_friction": not_negative(0.06, "", "friction coefficient between rings and elements"),
        "ring_friction_speed": positive(
            5e-4, "m/s", "regularisation speed of that friction", sensible=(1e-06, 5.0)
        ),
        "transverse_damping": scene.TRANSVERSE_DAMPING,
        **scene.TILT,
    },
    "sheaves": {
        "sheave_stiffness": positive(
            1.0,
            "",
            "stiffness of the sheaves: factor on all modes of opening and on local_stiffness; inf: rigid",
            allow_infinite=True,
        ),
        **{
            key: Parameter(
                (6e8, 3e8, 3e8, 9e8, 9e8),
                "N/m",
                f"reference stiffness of the {pulley} pulley's opening by angle: 1, cos, sin, cos 2, sin 2",
                sensible=(1e5, 1e12),
            )
            for key, pulley in zip(MODES, PULLEYS, strict=True)
        },
        "flank_stiffness": positive(
            3.27e10,
            "N/m^2",
            "stiffness of an element at each flank, along its normal, per length",
            sensible=(1e6, 1e14),
        ),
        "local_stiffness": positive(
            np.inf,
            "N/m^2",
            "stiffness of both sheaves against local bending, per length; inf: none",
            sensible=(1e5, np.inf),
            allow_infinite=True,
        ),
        "local_length": positive(0.013, "m", "decay length of local bending", sensible=(0.0001, 0.3)),
        "half_wedge_angle": scene.HALF_WEDGE_ANGLE,
        "inner_radius": not_negative(
            0.0, "m", "pitch radius at the inner end of the sheaves of both pulleys", sensible=(1e-3, 0.5)
        ),
        "outer_radius": positive(
            np.inf,
            "m",
            "pitch radius at the outer end of the sheaves of both pulleys",
            sensible=(1e-3, np.inf),
            allow_infinite=True,
        ),
        "sheave_rate": positive(
            5e-6,
            "m/(N s)",
            "radial speed of the belt over the thrust beyond the axial force of the belt",
            sensible=(1e-12, 1.0),
        ),
        "driven_inertia": positive(
            0.02, "kg m^2", "moment of inertia of the driven pulley", sensible=(1e-05, 100.0)
        ),
    },
    "pulleys": scene.TILT_LAG,
    "friction": {
        **{key: entry for key, entry in scene.FRICTION.items() if key not in _NO_TABLE},
        "friction_law": replace(
            scene.FRICTION["friction_law"], choices=tuple(law for law in FRICTION_LAWS if law != "table")
        ),
        "friction_gradient": replace(scene.FRICTION["friction_gradient"], default=0.0),
        "kinetic_friction": replace(scene.FRICTION["kinetic_friction"], default=0.09),
        "friction_speed": replace(scene.FRICTION["friction_speed"], default=5e-4),
    },
    "record": {
        "profile_places": Parameter(
            220, "", "places along the path at which histories have forces and sliding", 20, 2000
        ),
    },
}


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters [SI]: (key, expected, found) of each."""
    p = parameters
    problems = variator_problems(p) or profile_problems(p)
    if problems:
        return problems
    pitch = path_length(p) / p["elements"]
    if p["play"] > pitch:
        problems.append(("play", f"less than the pitch of the elements, {pitch:.4g} m", f"{p['play']:g} m"))
    if p["elements"] < _FEWEST_ELEMENTS and not p["coarse"]:
        expected = f"{_FEWEST_ELEMENTS} or more, or coarse = true"
        problems.append(("elements", expected, f"{p['elements']}"))
    for key in MODES:
        if nested(p[key]) or not p[key] or len(p[key]) != len(p[MODES[0]]) or min(p[key]) <= 0.0:
            expected = "values above 0, as many of both pulleys"
            problems.append((key, expected, f"{list(p[key])}"))
    for ratio in ratios_along(p):
        problems = problems or _problems_at(p, ratio)
    return problems + friction_problems(p)


def ratios_along(parameters: Parameters) -> list[float]:
    """The ratio first, then the least and greatest along its profile if that has an effect."""
    ratio, others = parameters["ratio"], extremes(parameters, "ratio")
    return [ratio, *(other for other in others if other != ratio and parameters["driving_thrust"] == 0.0)]


def _problems_at(parameters: Parameters, ratio: float) -> list[Problem]:
    """Problems at a ratio that the run has, or comes to along its profile."""
    key = "ratio" if ratio == parameters["ratio"] else "ratio_profile"
    at = "" if key == "ratio" else f" at a ratio of {ratio:g}"
    length = path_length(parameters)
    try:
        driven = driven_radius(ratio, length, parameters["centre_distance"])
    except ValueError:
        return [(key, "ratios at which the belt closes on pulleys that do not overlap", f"{ratio:g}")]
    p = {**parameters, "ratio": ratio, "driven_radius": driven if at else parameters["driven_radius"]}
    radii = sorted((driven / ratio, driven))
    if not p["inner_radius"] <= radii[0] <= radii[1] <= p["outer_radius"]:
        expected = f"radii within the sheaves, {p['inner_radius']:g} to {p['outer_radius']:g} m"
        return [(key, expected, f"{ratio:g}, and with it radii of {radii[0]:.5g} and {radii[1]:.5g} m")]
    psi = np.arcsin((radii[1] - radii[0]) / p["centre_distance"])
    least = int(np.ceil(8.0 * length / ((np.pi - 2.0 * psi) * radii[0])))
    if p["elements"] < least:
        return [("elements", f"at least {least}, eight on the shorter arc{at}", f"{p['elements']}")]
    problems = []
    # the polygon of the elements shakes strands as they pass, and by the change of stiffness at half of that
    half = 0.5 * _driving_speeds(p)[0] * driven / ratio * p["elements"] / length
    if _BELOW_PASSAGE * half < p["band_high"]:
        most = f"{_BELOW_PASSAGE * half:.4g} Hz, below half of the frequency at which elements pass{at}"
        problems.append(("band_high", f"at most {most}, or more elements", f"{p['band_high']:g} Hz"))
    step, why = p.get("step", 0.0), "pitch over the speed of transverse waves under the thrust"
    if not problems and step > (limit := string_limit(p)):
        problems.append(("step", f"at most {limit:.3g} s, {why}{at}", f"{step:g} s"))
    why = "beyond which friction that falls so steeply has several solutions"
    if not problems and step > (limit := falling_limit(p)):
        problems.append(("step", f"at most {limit:.3g} s, {why}{at}", f"{step:g} s"))
    # a sheave moves by an explicit step against the stiffness of the flanks on the longer arc
    angle, arc = p["half_wedge_angle"], (np.pi + 2.0 * psi) * radii[1]
    fastest = flank_compliance(p) / (step * arc * np.sin(angle) * np.cos(angle) + 1e-300)
    if p["sheave_rate"] > fastest:
        expected = f"at most {fastest:.3g} m/(N s) at this step, beyond which the sheave does not settle{at}"
        problems.append(("sheave_rate", expected, f"{p['sheave_rate']:g} m/(N s)"))
    return problems


def local_compliance(parameters: Parameters) -> float:
    """Local bending of a sheave along its normal by the normal line force of a flank [m^2/N].

    Both sheaves open by n cos(d0) / k, and each gives way along its normal by half of that times cos(d0).
    """
    p = parameters
    stiffness = p["sheave_stiffness"] * p["local_stiffness"]
    return float(0.5 * np.cos(p["half_wedge_angle"]) ** 2 / stiffness)


def flank_compliance(parameters: Parameters) -> float:
    """Penetration of a flank by a normal line force that is alike all along [m^2/N]."""
    return 1.0 / parameters["flank_stiffness"] + local_compliance(parameters)


def _driving_speeds(p: Parameters) -> tuple[float, float]:
    """Lowest and highest speed of the driving pulley once it is loaded [rad/s]."""
    least, most = extremes(p, "driving_speed")
    begun = p["speed_start"] if ramped(p) == "speed" else least
    return min(least, begun), max(most, begun)


def _most_thrust(p: Parameters) -> float:
    """Greatest axial force on either pulley [N]."""
    return max(extremes(p, name)[1] for name in ("thrust", "driving_thrust"))


def falling_limit(parameters: Parameters) -> float:
    """Longest step in which falling friction of the flanks has one solution [s], by the mean over an arc.

    An element that slides has m' (v - v_0) / dt = f - 2 n mu(v_f) per length, n being the normal line force
    of a flank. That has one solution while its slope by v, m' / dt + 2 n g dt / (dt + tau), is positive: with
    memory tau, friction follows a sudden change of speed only by dt / (dt + tau). The gradient g is the law's
    steepest; n is the axial force over R wrap cos d0, on the shorter arc, where both pulleys have the thrust.
    """
    p = parameters
    if p["friction_gradient"] >= 0.0:
        return np.inf
    driving = p["driven_radius"] / p["ratio"]
    wrap = np.pi + 2.0 * np.arcsin((driving - p["driven_radius"]) / p["centre_distance"])
    arc = min(driving * wrap, p["driven_radius"] * (2.0 * np.pi - wrap))
    pressed = _most_thrust(p) / (arc * np.cos(p["half_wedge_angle"]))
    without = p["element_mass"] / (2.0 * pressed * -p["friction_gradient"])
    return float(0.5 * without + np.sqrt(0.25 * without**2 + without * p["friction_memory"]))


def most_tension(parameters: Parameters) -> float:
    """Tension of the tighter strand under thrust and load [N], by which explicit steps are limited.

    It is estimated by the equilibrium of an arc and of a pulley, times 1.5 for the effect of arcs.
    """
    p = parameters
    driving = p["driven_radius"] / p["ratio"]
    wrap = np.pi + 2.0 * np.arcsin((p["driven_radius"] - driving) / p["centre_distance"])
    centrifugal = (p["element_mass"] + p["ring_mass"]) * (_driving_speeds(p)[1] * driving) ** 2
    held = 2.0 * _most_thrust(p) * np.tan(p["half_wedge_angle"]) / wrap + centrifugal
    return float(1.5 * (held + 0.5 * max(map(abs, (*extremes(p, "load"), p["load_start"]))) / driving))


def string_limit(parameters: Parameters) -> float:
    """Longest step with which the strands' transverse motion, which is explicit, is stable [s].

    It is pitch / sqrt(T / m) of a string in steps of symplectic Euler, T being `most_tension`; bending of the
    rings takes a quarter of its square (`ring_bending`).
    """
    p = parameters
    mass = (p["element_mass"] + p["ring_mass"]) * (0.75 if p["bending_stiffness"] > 0.0 else 1.0)
    return float(path_length(p) / p["elements"] * np.sqrt(mass / most_tension(p)))


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, so that a study does not vary them for nothing.

    Each has the setting that makes it so, e.g. "sheave_stiffness inf".
    """
    p = parameters
    cases = (
        (p["ring_friction"] == 0.0, "ring_friction_speed", "ring_friction 0"),
        (p["friction_gradient"] == 0.0, "friction_memory", "friction_gradient 0"),
        (np.isinf(p["local_stiffness"]), "local_length", "local_stiffness inf"),
        *((np.isinf(p["sheave_stiffness"]), key, "sheave_stiffness inf") for key in (*SCALED, "tilt_lag")),
        (len(p[MODES[0]]) == 1, "tilt_lag", "one mode of opening"),
        *(
            (np.isinf(p["nose_clearance"]), f"nose_{key}", "nose_clearance inf")
            for key in ("height", "stiffness")
        ),
        (p["elements"] >= _FEWEST_ELEMENTS, "coarse", f"elements {_FEWEST_ELEMENTS} or more"),
        (p["driving_thrust"] > 0.0, "ratio_profile", "driving_thrust above 0"),
        (p["driving_thrust"] == 0.0, "driving_thrust_profile", "driving_thrust 0"),
        (True, "arc_probes", "model pushbelt, which is probed on its strands"),
    )
    found = {key: setting for holds, key, setting in cases if holds}
    return friction_inert({**p, **dict.fromkeys(_NO_TABLE, ())}) | scene.course_inert(p) | found
