"""What follows from the axes of a job, in its results: of strands on one belt, and of the study's double."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.scatter import scatter_figure
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job
from cvt_hpc.study import gather, open_results, run
from cvt_hpc.study.folder import StudyFolder
from support.study_double import Axis, Job, Simulator

JOB = """
name = "one_belt"
model = "strand"
[axes]
ratio = [0.5, 1.0, 2.0]
load_share = [0.2, 0.4]
[scene]
belt_length = "661.195 mm"
[mesh]
ritz_functions = 5
[derived]
driving_speed = "314 / sqrt(ratio)"
"""
TWO = Job(
    (Axis("load", (1.0, 2.0, 3.0)), Axis("law", ("stribeck", "cubic"), "")),
    derived=(
        SimpleNamespace(name="thrust", axes=("load",), values=(5.0, np.inf, 7.0), unit="N", description="force", words="x"),
        SimpleNamespace(name="seed", axes=("load", "law"), values=tuple(range(6)), unit="", description="a", words="y"),
        SimpleNamespace(name="kind", axes=("law",), values=("a", "bc"), unit="", description="k", words="z"),
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("one_belt")
    (out / "x.toml").write_text(JOB)
    run(load_job(out / "x.toml"), out / "out", progress=False)
    return out


def test_results_have_what_follows_as_coordinates_of_the_axes_along_which_it_varies(folder):
    job = load_job(folder / "x.toml")
    with open_results(folder / "out") as results:
        results.load()
    assert results["status"].dims == ("ratio", "load_share")
    found = {str(name): results[name].dims for name in results.coords if "derived" in results[name].attrs}
    assert found == {
        "driven_radius": ("ratio",),
        "driving_speed": ("ratio",),
        "load": ("ratio", "load_share"),
    }
    for index in range(job.size):
        place = dict(zip(("ratio", "load_share"), np.unravel_index(index, (3, 2)), strict=True))
        here = results.isel(place)
        assert {name: here[name].item() for name in found} == {name: job.point(index)[name] for name in found}
    assert results["load"].attrs["units"] == "N m"
    assert results["load"].attrs["derived"] == "by load_share"
    assert results["driving_speed"].attrs["derived"] == "314 / sqrt(ratio)"
    assert results["status"].encoding["coordinates"] == "driving_speed driven_radius load"
    assert json.loads(results.attrs["job"])["derived"] == {"driving_speed": "314 / sqrt(ratio)"}
    # the longer the strands the lower their frequencies: runs have their own geometry
    assert len(np.unique(results["eigenfrequency"].values[..., 0].round(3))) > 3


def test_the_folder_of_such_a_job_goes_on_and_is_told_from_others(folder, capsys):
    out = folder / "out"
    job = ["run", str(folder / "x.toml"), "--out", str(out)]
    assert main(job) == 0
    assert main(["status", str(out)]) == 0
    assert "6 done" in capsys.readouterr().out
    (out / "results.nc").unlink()
    gather(out)  # from what the folder says of the study alone
    with xr.open_dataset(out / "results.nc") as again:
        assert again["load"].dims == ("ratio", "load_share")
    (folder / "y.toml").write_text(JOB.replace("314 /", "315 /"))
    assert main(["run", str(folder / "y.toml"), "--out", str(out)]) == 2


def test_it_is_mapped_and_an_axis_of_it_can_be_fixed(folder, capsys):
    out = folder / "out"
    assert main(["map", str(out)]) == 0
    assert main(["map", str(out), "--at", "ratio=1"]) == 0
    assert main(["map", str(out), "--at", "driven_radius=0.05"]) == 2
    assert "at driven_radius: unknown axis of the results" in capsys.readouterr().err


def test_one_run_is_told_where_it_stands(folder, capsys):
    assert main(["simulate", str(folder / "x.toml"), "--at", "ratio=2", "--at", "load=50"]) == 0
    told = capsys.readouterr().out
    assert (
        "at      ratio 2, driving speed 222.0315293 rad/s, driven radius 0.07270806791 m, load 50 N m" in told
    )


def test_samples_have_it_along_the_runs_and_maps_leave_it_out(folder, tmp_path):
    axes = "ratio = { from = 0.6, to = 2 }\nload_share = { from = 0.1, to = 0.5 }\n"
    text = JOB.replace("ratio = [0.5, 1.0, 2.0]\nload_share = [0.2, 0.4]\n", axes)
    (tmp_path / "x.toml").write_text(text + '[design]\nkind = "sobol"\nruns = 4\n')
    job = load_job(tmp_path / "x.toml")
    run(job, tmp_path / "out", progress=False)
    with open_results(tmp_path / "out") as results:
        results.load()
    for name in ("driven_radius", "load", "ratio"):
        assert results[name].dims == ("run",)
        assert results[name].values.tolist() == [job.point(i)[name] for i in range(4)]
    (panel, *_) = scatter_figure(results, {}, "x").axes
    assert {panel.get_xlabel(), panel.get_ylabel()} == {"load share", "ratio"}


def test_values_of_every_kind_survive_the_folder(tmp_path):
    run(TWO, tmp_path, simulator=Simulator(), progress=False)
    assert [one.values for one in StudyFolder(tmp_path).load().derived] == [one.values for one in TWO.derived]
    with open_results(tmp_path) as results:
        assert results["thrust"].values.tolist() == [5.0, np.inf, 7.0]
        assert results["seed"].values.tolist() == [[0, 1], [2, 3], [4, 5]]
        assert results["kind"].values.tolist() == ["a", "bc"]
        assert (results["thrust"].dims, results["kind"].dims) == (("load",), ("law",))
        assert "units" not in results["kind"].attrs


def test_what_follows_must_not_have_the_name_of_a_recorded_quantity(tmp_path):
    taken = SimpleNamespace(
        name="amplitude", axes=("load",), values=(1.0,), unit="m", description="a", words="x"
    )
    with pytest.raises(
        InputError, match=r"\[derived\] amplitude: expected a parameter that is not also the name"
    ):
        run(Job((Axis("load", (1.0,)),), derived=(taken,)), tmp_path, simulator=Simulator(), progress=False)
