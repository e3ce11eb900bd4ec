"""The pushbelt of which a continuous belt is the continuum: what gives way, gives way alike."""

import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc.experiments.chart import load
from cvt_hpc.experiments.ladder.loading import pushbelt_jobs
from cvt_hpc.job import build_job, known_keys, load_job
from cvt_hpc.models.contract import load_model
from cvt_hpc.models.elastic_belt import PARAMETERS
from cvt_hpc.models.pushbelt import inert
from cvt_hpc.models.pushbelt.continuous import FOLLOWS, ONLY
from cvt_hpc.models.pushbelt.parameters import flank_compliance
from cvt_hpc.models.steady_variator.record import solve
from cvt_hpc.physics.geometry import variator
from cvt_hpc.physics.sheaves import flexibility, sheaves
from support.scene import SCENE
from support.wraps import places

JOBS = Path(__file__).parents[2] / "jobs"
TERMS = runpy.run_path(str(JOBS.parent / "docs" / "terms_page.py"))["terms"]()
ANGLE, RADII = np.radians(11.0), {"driving": 0.03, "driven": 0.075}
BELT = {
    "element_stiffness": 4e7, "element_damping": 20.0, "flank_stiffness": 2e10, "element_factor": 1.5,
    "local_stiffness": 4e9, "sheave_stiffness": 1.5, "half_wedge_angle": ANGLE, "tilt_stiffness": 2e5,
    "tilt_factor": 1.5, "ratio": 2.5, "driven_radius": RADII["driven"], "sheave_lag": 2e-3, "lag_stiffness": 2e8,
    "tilt_spring": np.inf, "tilt_damper": 1.0,
}  # fmt: skip


def followed(belt):
    return {key: value(belt) for key, (_, value) in FOLLOWS.items()}


@pytest.mark.parametrize("stiffness", [1.0, 1.5, np.inf])
@pytest.mark.parametrize("pulley", RADII)
def test_sheaves_and_elements_open_alike_under_the_same_force(pulley, stiffness):
    """A smooth line force on a part of an arc that is long beside the decay of local bending."""
    radius, count = RADII[pulley], 801
    spacing = 0.5 * radius / (count - 1)
    given = BELT | {"sheave_stiffness": stiffness}
    wrap = sheaves(
        *places(count, 0.5 * radius, radius),
        radius,
        given["sheave_stiffness"],
        3e5,
        4e9,
        10.0 * spacing,
        3e10,
    )
    phi = np.arange(count) * spacing / radius
    force = 1e5 * (1.0 + 0.5 * np.cos(2.0 * phi))
    continuous = flexibility(wrap) @ force

    found = followed(given)
    shapes = np.array([np.ones(count), np.cos(phi), np.sin(phi)])
    modal = stiffness * np.array(found[f"{pulley}_modal_stiffness"])
    openings = (shapes @ (wrap.weight * force)) / modal  # of one flank
    # along its normal: of element and local bending
    overlap = force / np.cos(ANGLE) * flank_compliance(given | found)
    pushbelt = 2.0 * (overlap / np.cos(ANGLE) + openings @ shapes)
    # ends, where local bending reaches beyond the force, apart; it has ten stations, and the first mode opens
    # by 1e-3 of the others
    middle = slice(200, -200)
    assert pushbelt[middle] == pytest.approx(continuous[middle], rel=3e-3)


def test_the_driven_sheave_follows_the_thrust_alike():
    excess = 1e3
    opening = excess / (BELT["sheave_lag"] * BELT["lag_stiffness"])  # [m/s]
    radius = followed(BELT)["sheave_rate"] * excess
    assert 2.0 * np.tan(ANGLE) * radius == pytest.approx(opening)


def test_elements_tilt_alike():
    assert followed(BELT | {"tilt_spring": 5e3})["tilt_spring"] == 5e3
    assert followed(BELT)["tilt_spring"] == 3267.0  # one that does not tilt says nothing of it


def test_a_pulley_that_cannot_tilt_is_rigid():
    modes = followed(BELT | {"tilt_stiffness": np.inf})["driving_modal_stiffness"]
    assert len(set(modes)) == 1 and modes[0] >= 1e12


def test_every_parameter_of_the_continuous_belt_has_its_place():
    own = {key for table in PARAMETERS.values() for key in table}
    shared = own & {*known_keys("pushbelt")}
    # the pushbelt refuses a table of friction, and pistons, without which there is no pressure
    of_pressure = "_pressure", "_pressure_profile"
    tables = {key for key in own if key.startswith("table_") or key.endswith(of_pressure)}
    led = {need for needs, _ in FOLLOWS.values() for need in needs} - shared
    # terms of the continuum alone; a key that switches one has the others of its table with it
    terms = {key for term in TERMS for key in term["keys"]} & own
    terms |= {key for table in ("bending", "deflection", "rings") for key in PARAMETERS[table]}
    of_a_run = {*PARAMETERS["mesh"], *PARAMETERS["numerics"], *PARAMETERS["record"]}
    start = {"disturbance", "seed", "start_damping"}
    assert shared | tables | led | terms | {*ONLY} | of_a_run | start | {"stiffness_of"} == own
    assert FOLLOWS.keys() <= {*known_keys("pushbelt")}


def assert_the_same_belt(pushbelt, continuous, but=()):
    assert "element_mass" in pushbelt and pushbelt.keys() >= FOLLOWS.keys()
    of_belt = {key for name in ("scene", "belt", "sheaves", "friction") for key in PARAMETERS[name]}
    expected = {key: continuous[key] for key in of_belt & pushbelt.keys() & continuous.keys()}
    but = {*but, *inert(pushbelt)}
    for key, value in (expected | followed(continuous)).items():
        if key not in but:
            # three digits in a job file
            wanted = value if isinstance(value, str) else pytest.approx(value, rel=5e-3)
            assert pushbelt[key] == wanted, key


def test_the_job_of_vibration_has_the_belt_of_the_published_map():
    pushbelt = load_job(JOBS / "pushbelt_vibration.toml")
    axes = {axis.name: list(axis.values) for axis in pushbelt.axes}
    axes |= {"sheave_stiffness": [1.0], "tilt_factor": [1.0]}
    continuous = load_job(JOBS / "lebrecht_2004.toml", axes)
    for index in (0, pushbelt.size - 1):
        assert_the_same_belt(pushbelt.point(index), continuous.point(index))


def test_the_chart_has_the_same_belt_between_rigid_sheaves():
    """On elastic ones it goes the other way: the continuum's sheaves are fitted to the modes of the pushbelt."""
    chart = load(JOBS / "chart_pushbelt.toml")
    points = {point.series: point.job.parameters for point in chart.points if point.scene == "rigid"}
    # the chart's pushbelt has no transverse damping, and its own rate of the sheave
    but = ("transverse_damping", "sheave_rate")
    assert_the_same_belt(points["elements_216"], points["continuous"], but)
    rings = points["continuous"]["reference_tension"] / points["continuous"]["ring_stiffness"]
    assert rings == pytest.approx(1e-4)


def test_the_chart_has_sheaves_that_open_nearly_alike():
    """Between places on half a circle: 10 % of the opening, as the job says."""
    table = tomllib.loads((JOBS / "chart_pushbelt.toml").read_text())
    scene = table["chart"]["methods"]["continuous"]["set"]
    tilt, local, length = (
        float(scene[k].split()[0]) for k in ("tilt_stiffness", "local_stiffness", "local_length")
    )
    radius, length = 0.0556, 1e-3 * length
    phi = np.linspace(0.0, np.pi, 91)
    apart = np.abs(phi[:, None] - phi)
    modes = 2.0 * (1.0 / 6e8 + np.cos(apart) / 3e8 + np.cos(2.0 * apart) / 9e8)
    bending = np.exp(-radius * apart / length) / (2.0 * length * local)
    continuum = radius**2 / tilt * np.cos(apart) + bending
    assert np.linalg.norm(continuum - modes) < 0.105 * np.linalg.norm(modes)


@pytest.mark.parametrize(("ratio", "load"), [(2.52, 140.0), (1.35, 250.0), (0.52, 300.0)])
def test_rings_rub_on_the_whole_wrap_of_the_smaller_pulley(ratio, load):
    """Eytelwein there: T - m v^2 grows as exp(mu s / R). On the larger pulley rings all but stick.

    Between sheaves as soft as these: where stiffer ones hold elements back in overdrive, rings turn about on the arc.

    In the pushbelt they miss the way on which elements, here 6.3 mm long, take up the turning of the arc.
    """
    few = {"stations": 64, "band_high": 400.0, "rise_time": 0.02, "duration": 0.05, "longest_duration": 0.05}
    changes = {"ratio": ratio, "load": [load], "friction_gradient": 0.0, "ring_damping": 4.0}
    document = tomllib.loads((JOBS / "both_belts.toml").read_text()) | {"axes": {}, "design": {}}
    asked = build_job(document, overrides=SCENE | changes | few)
    point = asked.point(0)
    path = variator(ratio, point["driven_radius"], point["centre_distance"])
    radius, wrap = min((path.driving_radius, path.driving_wrap), (path.driven_radius, path.driven_wrap))
    centrifugal = point["ring_mass"] * (point["driving_speed"] * path.driving_radius) ** 2

    def rubbed(tensions):
        """Angle [rad] on which they rub, by the tensions of t1 and t2 [N]."""
        t1, t2 = np.asarray(tensions) - centrifugal
        return np.sign(ratio - 1.0) * np.log(t2 / t1) / point["ring_friction"]

    assert rubbed(solve(point).values["mean_ring_tension"]) == pytest.approx(wrap, rel=1e-3)

    marched = pushbelt_jobs(asked, {"elements": 104})[0]
    run = load_model(marched.model).batch([marched.point(0)], marched.stepper).runs[0]
    assert run.advance(run.samples) is None
    late = slice(run.samples - round(5e-3 / run.interval), run.samples)
    missed = wrap - rubbed([run.channel(f"ring_tension {strand}")[late].mean() for strand in ("t1", "t2")])
    assert 0.0 < missed * radius < 4.5 * path.path_length / 104
