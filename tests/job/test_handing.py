"""Questions that another model answers: the same runs, of which that model knows less."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.strand import PARAMETERS as STRAND

SCENE = {"scene": {"thrust": "40 kN"}, "mesh": {"stations": 96}, "belt": {"bending_stiffness": 0.2}}


def asking(question, axes=None, **tables):
    document = {"name": "x", "model": "auto", "description": "a belt", "auto": {"question": question}}
    return build_job(document | SCENE | tables | {"axes": axes or {}}, "x.toml")


@pytest.mark.parametrize(
    ("question", "model"), [("frequencies", "strand"), ("growth", "linear_stability"), ("forces", "auto")]
)
def test_a_question_names_the_model(question, model):
    job = asking(question, {"load": [40, 80]})
    assert job.model == model
    assert job.parameters["thrust"] == 40e3 and job.parameters["bending_stiffness"] == 0.2
    assert [axis.values for axis in job.axes] == [(40.0, 80.0)]
    assert (model in job.description) is (model != "auto")


def test_what_the_other_model_does_not_know_is_left_out():
    job = asking("frequencies")
    assert "stations" not in job.parameters
    defaults = {key: parameter for table in STRAND.values() for key, parameter in table.items()}
    alternatives = {key for key, parameter in defaults.items() if parameter.gives}
    assert not alternatives & job.parameters.keys()
    others = set(defaults) - {"thrust", "bending_stiffness"} - alternatives
    assert all(np.array_equal(job.parameters[key], defaults[key].default) for key in others)
    assert asking("growth").parameters["stations"] == 96


@pytest.mark.parametrize(
    ("question", "axes", "message"),
    [
        (
            "frequencies",
            {"friction_gradient": [-1, -0.5]},
            "[axes] friction_gradient: expected a key of strand",
        ),
        ("occurrence", {"question": ["occurrence", "frequencies"]}, "[axes] question: expected one question"),
    ],
)
def test_axes_that_the_other_model_does_not_know_are_refused(question, axes, message):
    with pytest.raises(InputError) as caught:
        asking(question, axes)
    assert str(caught.value).startswith(f"x.toml: {message}")


def test_a_key_that_nobody_knows_is_still_an_error():
    with pytest.raises(InputError, match="did you mean thrust"):
        asking("frequencies", scene={"trust": "40 kN"})


def test_samples_stay_the_same_samples():
    axes = {"load": {"from": 20, "to": 200}, "thrust": {"from": 30e3, "to": 60e3}}
    design = {"kind": "sobol", "runs": 8, "seed": 3}
    job, own = asking("frequencies", axes, design=design), asking("forces", axes, design=design)
    assert job.design == own.design and len(job) == 8
    assert [axis.values for axis in job.axes] == [axis.values for axis in own.axes]
