"""The rungs of the ladder on one belt at several ratios."""

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.experiments.ladder.loading import ladder
from cvt_hpc.job import build_job

DOCUMENT = {
    "name": "x",
    "model": "elastic_belt",
    "scene": {"belt_length": "661.195 mm"},
    "axes": {"ratio": [1.0, 2.0], "load": [50, 60], "sheave_stiffness": [1.0, 2.0]},
    "linked": {"ratio": {"thrust": ["40 kN", "50 kN"]}, "sheave_stiffness": {"tilt_stiffness": [3e5, 4e5]}},
    "derived": {"driving_speed": "300 * ratio"},
}


def test_rungs_have_the_same_geometry_at_each_ratio():
    rungs, refusals = ladder(build_job(DOCUMENT, "x.toml"))
    assert refusals == {}
    keys = ("driven_radius", "thrust", "driving_speed")
    wanted = [[rungs[-1].job.point(i)[key] for key in keys] for i in (0, 4)]
    assert wanted[0][0] == pytest.approx(0.05589442, rel=1e-7)
    for rung in rungs:
        if "driven_radius" not in rung.job.parameters:
            continue  # the criterion has neither ratio nor radii
        last = rung.job.size - 1
        assert [[rung.job.point(i)[key] for key in keys] for i in (0, last)] == wanted, rung.name


def test_what_the_reference_refines_must_not_follow_from_others():
    for key, formula in (("stations", "160"), ("step", "1e-6 * ratio"), ("duration", "0.4 * ratio")):
        job = build_job(DOCUMENT | {"derived": {key: formula}}, "x.toml")
        with pytest.raises(InputError, match=rf"\[derived\] {key}: expected one value, .* found a formula"):
            ladder(job)
