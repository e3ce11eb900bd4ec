"""Branches of one belt at several ratios: what each steady belt and its runs have."""

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.experiments.branch.diagram import diagram_dataset
from cvt_hpc.experiments.branch.job import load

JOB = """
name = "x"
model = "linear_stability"
[scene]
belt_length = "661.195 mm"
[axes]
ratio = [1.0, 2.0]
load = ["90 N m", "105 N m"]
[linked.ratio]
thrust = ["40 kN", "50 kN"]
[derived]
driving_speed = "300 * ratio"
"""
RADII = [0.05589442, 0.07270807]  # [m]


@pytest.fixture
def path(tmp_path):
    (tmp_path / "x.toml").write_text(JOB)
    return tmp_path / "x.toml"


def test_each_branch_and_its_runs_have_their_own_geometry(path):
    diagram = load(path)
    for branch, radius, thrust, speed in zip(
        diagram.branches, RADII, (40e3, 50e3), (300.0, 600.0), strict=True
    ):
        run = branch.runs.point_at({"load": 95.0, "disturbance": 1e-5})
        for found in (branch.parameters, run):
            assert found["driven_radius"] == pytest.approx(radius, rel=1e-7)
            assert (found["thrust"], found["driving_speed"]) == (thrust, speed)
        assert run["load"] == 95.0
        assert run["ratio"] == branch.place["ratio"]


def test_the_dataset_has_what_follows_along_its_axes(path):
    dataset = diagram_dataset(load(path), {})
    assert dataset["driven_radius"].dims == ("ratio",)
    assert dataset["driven_radius"].values == pytest.approx(RADII, rel=1e-7)
    assert dataset["thrust"].values.tolist() == [40e3, 50e3]


def test_what_follows_from_the_load_is_refused(path):
    path.write_text(JOB.replace("300 * ratio", "300 + load"))
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value) == (
        f"{path}: [derived] driving_speed: expected a value that does not follow from the load, along which "
        "branches go, found 300 + load"
    )
