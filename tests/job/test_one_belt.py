"""A variator by the length of its belt, and a load by its share of what friction carries: in every model that knows them."""

import math

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, known_keys
from cvt_hpc.job.crosscheck import without_effect
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.summary import summarize
from cvt_hpc.models import MODELS
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.physics.geometry import variator

OF_VARIATORS = [model for model in MODELS if "belt_length" in known_keys(model)]
FEW_ELEMENTS = {"beam_pushbelt": {"vibration": {"band_high": "600 Hz"}}}  # pass at few times that
RATIOS, SHARES = [0.5, 1.0, 2.0, 2.5], [0.0, -0.2, 0.6]
DRIVEN = [36.35e-3, 55.89e-3, 72.71e-3, 76.718e-3]  # [m], published, to 5 um
ONE_BELT = {"belt_length": "661.195 mm", "centre_distance": "155 mm"}


def job(model="elastic_belt", axes=None, overrides=(), **tables):
    axes = {"ratio": RATIOS, "load_share": SHARES} if axes is None else axes
    head = {"name": "x", "model": model, "scene": ONE_BELT, "axes": axes}
    return build_job({**head, **tables}, "x.toml", overrides)


def refusal(**arguments):
    with pytest.raises(InputError) as caught:
        job(**arguments)
    return str(caught.value).removeprefix("x.toml: ")


def test_these_are_the_models_of_a_variator():
    assert {
        "elastic_belt", "quasi_static_belt", "steady_variator", "linear_stability", "strand", "auto"
    } <= set(OF_VARIATORS)  # fmt: skip
    assert all("load_share" in known_keys(model) for model in OF_VARIATORS)


@pytest.mark.parametrize("model", OF_VARIATORS)
def test_one_belt_has_its_radii_at_each_ratio(model):
    asked = job(model, **FEW_ELEMENTS.get(model, {}))
    for index in range(asked.size):
        point = asked.point(index)
        place = RATIOS.index(point["ratio"])
        assert point["driven_radius"] == pytest.approx(DRIVEN[place], abs=5.5e-6)
        path = variator(point["ratio"], point["driven_radius"], point["centre_distance"])
        assert path.path_length == pytest.approx(0.661195, rel=1e-14)
        # Bullinger et al. 2005, eq. 2
        pressed = 2.0 * asked.parameters["kinetic_friction"] * asked.parameters["thrust"]
        most = pressed / math.cos(math.radians(11.0)) * path.driving_radius
        assert point["load"] == pytest.approx(SHARES[index % 3] * most, rel=1e-14)
    # the fast step of the belt follows from the scene, too
    told = {one.name: (one.axes, one.words) for one in asked.derived if one.name != "step"}
    assert told == {
        "driven_radius": (("ratio",), "by belt_length"),
        "load": (("ratio", "load_share"), "by load_share"),
    }
    assert build_job(asked.resolved(), "x.toml") == asked


@pytest.mark.parametrize("model", OF_VARIATORS)
def test_without_them_nothing_of_them_is_in_a_job(model):
    asked = job(model, {}, scene={})
    assert not {"belt_length", "load_share"} & asked.parameters.keys()
    assert not {"belt_length", "load_share"} & asked.resolved()["scene"].keys()
    schema = load_schema(model, None, "x")
    assert asked.parameters["driven_radius"] == schema.parameters["driven_radius"].default
    assert [rule.key for rule in asked.rules if rule.key != "step"] == []


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"scene": {**ONE_BELT, "driven_radius": 0.07}}, "[scene] belt_length: expected either belt_length or driven_radius, found both"),
        ({"scene": {**ONE_BELT, "load": 70}}, "[scene] load_share: expected either load_share or load, found both"),
        ({"axes": {"load": [1, 2], "load_share": [0.1]}}, "[scene] load_share: expected either load_share or load, found both"),
        ({"derived": {"load": "2"}}, "[scene] load_share: expected either load_share or load, found both"),
        ({"linked": {"ratio": {"driven_radius": DRIVEN}}}, "[scene] belt_length: expected either belt_length or driven_radius, found both"),
        ({"overrides": ["load=3", "load_share=0.2"]}, "[scene] load_share: expected either load_share or load, found both"),
        ({"axes": {"ratio": RATIOS}, "derived": {"load_share": "load / 100"}}, "[derived] load_share: expected formulas without a circle, found load -> load_share -> load"),
        ({"axes": {"ratio": RATIOS}, "derived": {"load": "load_share * 100"}}, "[derived] load: expected parameters that the job gives, found load_share, which it does not"),
        ({"scene": {"belt_length": "0.3 m"}}, "[scene] belt_length: expected more than 0.31 m, twice the centre distance, and less than 0.814334 m, where the pulleys touch, found 0.3 m (at ratio = 0.5)"),
        ({"scene": {"belt_length": "0.81 m"}}, "[scene] belt_length: expected more than 0.31 m, twice the centre distance, and less than 0.796947 m, where the pulleys touch, found 0.81 m (at ratio = 1)"),
        ({"scene": {"belt_length": "-1 m"}}, '[scene] belt_length: expected > 0 m, found "-1 m"'),
        ({"friction": {"friction_law": "table"}}, "[scene] load_share: expected a friction table with coefficients in table_mu, found 0 (at ratio = 0.5, load_share = 0)"),
    ],
)  # fmt: skip
def test_what_is_given_twice_or_fits_nowhere_is_refused(tables, message):
    assert refusal(**tables) == message


def test_a_share_is_of_the_lowest_coefficient_of_a_table():
    table = {"friction_law": "table", "table_force": [0, 1e5], "table_speed": [0, 1], "table_mu": [[0.12, 0.08], [0.11, 0.09]]}  # fmt: skip
    asked = job(axes={"load_share": [0.5]}, friction=table)
    coulomb = job(axes={"load_share": [0.5]}, friction={"kinetic_friction": 0.08})
    assert asked.point(0)["load"] == coulomb.point(0)["load"]
    assert coulomb.point(0)["load"] == 0.5 * carried_torque(coulomb.point(0))


def test_an_override_of_one_replaces_the_other():
    given = job(overrides=["load=50", "driven_radius=0.05"])
    assert [axis.name for axis in given.axes] == ["ratio"]
    assert {given.point(i)["load"] for i in range(4)} == {50.0}
    assert {given.point(i)["driven_radius"] for i in range(4)} == {0.05}
    assert not {"belt_length", "load_share"} & given.parameters.keys()
    shared = job(axes={"load": [1, 2]}, overrides={"load_share": 0.5})
    assert shared.axes == ()
    assert shared.parameters["load"] == 0.5 * carried_torque(shared.parameters)


def test_a_run_at_chosen_values_follows_the_belt():
    asked = job()
    off = asked.point_at({"ratio": 1.7, "load_share": 0.5})
    assert variator(1.7, off["driven_radius"], 0.155).path_length == pytest.approx(0.661195)
    assert off["load"] == 0.5 * carried_torque(off)
    given = asked.point_at({"load": 7.0})
    assert given["load"] == 7.0
    assert "load_share" not in given
    assert given["driven_radius"] == asked.parameters["driven_radius"]
    # the parameters of a whole run name both of each pair, which agree
    assert asked.point_at(asked.point(5)) == asked.point(5)
    with pytest.raises(
        InputError, match=r"load_share: expected either load_share or load, found both, which do not agree"
    ):
        asked.point_at({"load": 7.0, "load_share": 0.5})


def test_histories_of_runs_that_an_override_takes_off_the_grid_are_left_out():
    record = {"history": [{"ratio": 1.0, "load_share": 0.6}]}
    assert job(record=record).histories == (5,)
    assert job(record=record, overrides=["load=3"]).histories == ()


def test_a_share_may_follow_from_others_and_give_to_others():
    derived = {"load_share": "0.2 * ratio", "load_start": "load / 2"}
    asked = job(axes={"ratio": [1, 2]}, derived=derived)
    points = [asked.point(i) for i in range(2)]
    assert [p["load_share"] for p in points] == [0.2, 0.4]
    assert [p["load"] for p in points] == [p["load_share"] * carried_torque(p) for p in points]
    assert [p["load_start"] for p in points] == [p["load"] / 2 for p in points]


def test_a_share_is_of_no_effect_where_the_load_is_of_none():
    message = refusal(model="strand", scene={**ONE_BELT, "strand_forces": "given"})
    assert message == (
        "[axes] load_share: expected one value, since it has no effect with strand_forces given, found 3 values"
    )


def test_another_model_is_handed_what_follows():
    asked = job(derived={"thrust": "20e3 * ratio", "rise_time": "duration / 20"})
    handed = build_job(handed_to(asked, "strand", "for the test"), "x.toml")
    keys = ("ratio", "driven_radius", "load", "thrust")
    assert [[handed.point(i)[key] for key in keys] for i in range(handed.size)] == [
        [asked.point(i)[key] for key in keys] for i in range(asked.size)
    ]
    frequencies = job("auto", auto={"question": "frequencies"})
    assert frequencies.model == "strand"
    assert frequencies.point(5) == job("strand").point(5)


def test_what_gives_no_share_of_a_load_is_without_effect():
    found = job()
    inert = without_effect(found.schema, found.parameters, found.axes, found.rules)
    assert inert["table_mu"] == inert["table_force"] == "friction_law stribeck"
    assert "kinetic_friction" not in inert


def test_angles_that_the_job_leaves_out_are_told_in_degrees_and_rpm():
    told = [" ".join(line.split()) for line in summarize(job(), 1.0).splitlines()]
    assert "half_wedge_angle 0.1919862177 rad (11 deg) default half wedge angle of the groove" in told
    assert any(line.startswith("driving_speed 314.1592654 rad/s (3000 rpm) default") for line in told)
