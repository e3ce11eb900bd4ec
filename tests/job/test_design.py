"""The table [design] of a job file: traces, and samples of the ranges of the axes."""

import json
import re

import numpy as np
import pytest
from scipy.stats import qmc

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, load_job
from cvt_hpc.job.summary import summarize

SAMPLED = """
[scene]
thrust = "20 kN"
[design]
kind = "{kind}"
runs = 32
seed = 7
[axes]
load = {{ from = "20 N m", to = "0.2 kN m" }}
sheave_stiffness = {{ from = 1, to = 100, spacing = "log" }}
"""
TRACED = """
[scene]
thrust = "20 kN"
[design]
kind = "trace"
[axes]
load = { from = 0, to = 80, count = 9 }
load_history = ["constant", "ramp"]
ratio = [1.0, 2.0]
"""


def test_without_a_design_all_of_the_grid_is_run(write_job):
    job = load_job(write_job("[scene]\nthrust = 1000\n[axes]\nload = [1, 2]\n"))
    assert job.design == {}
    assert "design" not in job.resolved()
    assert (
        load_job(write_job('[scene]\nthrust = 1000\n[design]\nkind = "grid"\n[axes]\nload = [1, 2]\n')) == job
    )


@pytest.mark.parametrize(("kind", "engine"), [("sobol", qmc.Sobol), ("latin_hypercube", qmc.LatinHypercube)])
def test_samples_are_those_of_scipy_between_the_ends_of_the_ranges(write_job, kind, engine):
    job = load_job(write_job(SAMPLED.format(kind=kind)))
    assert (job.size, job.shape, job.is_sampled) == (32, (32,), True)
    found = np.array([[job.point(i)["load"], job.point(i)["sheave_stiffness"]] for i in range(32)])
    unit = engine(2, seed=np.random.default_rng(7)).random(32)
    assert found[:, 0] == pytest.approx(20 + 180 * unit[:, 0])
    assert np.log10(found[:, 1]) == pytest.approx(2 * unit[:, 1])
    # both fill the ranges evenly: one sample in each of 32 equal parts of each
    for share in ((found[:, 0] - 20) / 180, np.log10(found[:, 1]) / 2):
        assert sorted(np.floor(32 * share)) == list(range(32))
    assert {job.point(i)["thrust"] for i in range(32)} == {20e3}
    assert [axis.spacing for axis in job.axes] == ["linear", "log"]


def test_the_seed_tells_samples_apart(write_job):
    path = write_job(SAMPLED.format(kind="sobol"))
    assert load_job(path) == load_job(path)
    other = load_job(path, ["design.seed=8"])
    assert other.axes != load_job(path).axes
    assert other.fingerprint() != load_job(path).fingerprint()


@pytest.mark.parametrize("text", [SAMPLED.format(kind="sobol"), TRACED])
def test_a_resolved_job_with_a_design_builds_the_same_job(write_job, text):
    job = load_job(write_job(text))
    again = build_job(json.loads(json.dumps(job.resolved())), "x.toml")
    assert (again.axes, again.design, again.fingerprint()) == (job.axes, job.design, job.fingerprint())


LISTED = """
[scene]
thrust = "20 kN"
[design]
kind = "listed"
runs = 3
[axes]
load = ["20 N m", "0.1 kN m", 20]
sheave_stiffness = [1, inf, 1]
"""


def test_listed_samples_are_those_of_the_job(write_job):
    job = load_job(write_job(LISTED))
    assert (job.size, job.shape, job.is_sampled) == (3, (3,), True)
    points = [(job.point(i)["load"], job.point(i)["sheave_stiffness"]) for i in range(3)]
    assert points == [(20.0, 1.0), (100.0, np.inf), (20.0, 1.0)]  # values may come again, a whole run, too
    again = build_job(json.loads(json.dumps(job.resolved())), "x.toml")
    assert (again.axes, again.design, again.fingerprint()) == (job.axes, job.design, job.fingerprint())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("runs = 3", "runs = 4", "[axes] load: expected a list of 4 values, one for each of the runs of [design], found 3 values"),
        ("[1, inf, 1]", "{ from = 1, to = 2 }", "[axes] sheave_stiffness: expected a list of 3 values, one for each of the runs of [design], found a table"),
        ("[1, inf, 1]", "[1, -2, 1]", "[axes] sheave_stiffness, value 2: expected > 0, found -2"),
        ("runs = 3", "", "[design] runs: expected the number of samples, found nothing"),
        ("runs = 3", "runs = 3\nseed = 1", '[design] seed: unknown key of a design of kind "listed"; known: kind, runs'),
    ],
)  # fmt: skip
def test_what_is_wrong_with_listed_samples_is_said(write_job, old, new, message):
    with pytest.raises(InputError) as caught:
        load_job(write_job(LISTED.replace(old, new)))
    assert message in str(caught.value)


def test_an_axis_that_is_replaced_by_one_value_is_no_dimension_of_the_samples(write_job):
    job = load_job(write_job(SAMPLED.format(kind="sobol")), ["sheave_stiffness=2"])
    assert [axis.name for axis in job.axes] == ["load"]
    assert {job.point(i)["sheave_stiffness"] for i in range(32)} == {2.0}
    other = load_job("x.toml", ["load={from=20, to=30}", "ratio={from=1, to=2}"])
    assert [axis.name for axis in other.axes] == ["load", "sheave_stiffness", "ratio"]
    assert all(20 <= load < 30 for load in other.axes[0].values)


def test_every_sample_is_checked_and_the_first_bad_one_is_named(write_job):
    text = SAMPLED.format(kind="sobol").replace('to = "0.2 kN m"', 'to = "0.22 kN m"')  # 20 kN carry 200 N m
    unit = qmc.Sobol(2, seed=np.random.default_rng(7)).random(32)
    load, share = next((20 + 200 * u, v) for u, v in unit if u > 0.9)
    place = f"(at load = {load:.10g} N m, sheave_stiffness = {100**share:.10g})"
    with pytest.raises(InputError, match=f"at most 200 N m at this thrust.*{re.escape(place)}"):
        load_job(write_job(text))


def test_a_trace_is_along_the_long_axes_of_numbers(write_job):
    path = write_job(TRACED)
    assert load_job(path).design == {"kind": "trace", "first_spacing": {"load": 4}}
    assert load_job(path, ["design.first_spacing=3"]).design["first_spacing"] == {"load": 3}
    assert load_job(path, ["design.first_spacing={load=2}"]).design["first_spacing"] == {"load": 2}
    named = TRACED.replace('"trace"', '"trace"\nfirst_spacing = { ratio = 1, load = 2 }')
    assert load_job(write_job(named)).design["first_spacing"] == {"ratio": 1, "load": 2}
    # a whole grid is a trace by command
    path = write_job(TRACED.replace('kind = "trace"', ""))
    assert load_job(path).design == {}
    assert load_job(path, ["design.kind=trace"]).design == {"kind": "trace", "first_spacing": {"load": 4}}


def test_a_design_is_told(write_job):
    told = summarize(load_job(write_job(TRACED)), 2.0)
    assert "first_spacing  4 along load" in told
    assert told.endswith(
        "runs: at most 36 = 9 x 2 x 2\nestimated cost: at most 2 core-seconds per run, 72 core-seconds in all"
    )
    told = summarize(load_job(write_job(SAMPLED.format(kind="sobol"))), 2.0)
    assert "kind  sobol" in told and "32 samples" in told
    assert "runs: 32\nestimated cost: 2 core-seconds per run" in told


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"sobol"', '"sobl"', '[design] kind: expected one of grid, trace, adaptive, sobol, latin_hypercube, listed, found "sobl"; did you mean sobol?'),
        ("runs = 32", "runs = 100", "[design] runs: expected a power of 2 (the nearest: 64 and 128), found 100"),
        ("runs = 32", "", "[design] runs: expected the number of samples, found nothing"),
        ("runs = 32", "run = 32", '[design] run: unknown key of a design of kind "sobol"; did you mean runs?'),
        ("seed = 7", "seed = -1", "[design] seed: expected >= 0, found -1"),
        ('"sobol"', '"trace"', '[design] runs: unknown key of a design of kind "trace"; known: kind, first_spacing'),
        (', spacing = "log"', ", count = 3", "[axes] sheave_stiffness.count: unknown key of a range to draw samples from; known: from, to, spacing"),
        ("from = 1,", "from = 0.0, ", "[axes] sheave_stiffness.from: expected > 0, found 0.0"),
        ('{ from = "20 N m", to = "0.2 kN m" }', "[20, 200]", "[axes] load: expected a range {from=, to=}, to draw samples from, found a list"),
        ('load = { from = "20 N m", to = "0.2 kN m" }', "stations = {from = 40, to = 80}", "[axes] stations: expected a parameter with continuous values, to draw samples from, found another one"),
        ("[design]", "[design]\nfirst_spacing = 2", '[design] first_spacing: unknown key of a design of kind "sobol"; known: kind, runs, seed'),
    ],
)  # fmt: skip
def test_what_is_wrong_with_samples_is_said(write_job, old, new, message):
    text = SAMPLED.format(kind="sobol")
    assert old in text
    with pytest.raises(InputError) as caught:
        load_job(write_job(text.replace(old, new)))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"trace"', '"trace"\nfirst_spacing = 0', "[design] first_spacing: expected >= 1 and <= 100000, found 0"),
        ('"trace"', '"trace"\nfirst_spacing = 5', "[design] first_spacing: expected an axis of more than 10 numbers, to trace along, found none"),
        ('"trace"', '"trace"\nfirst_spacing = { lod = 2 }', "[design] first_spacing.lod: unknown axis; did you mean load?"),
        ('"trace"', '"trace"\nfirst_spacing = { load_history = 2 }', "[design] first_spacing.load_history: expected an axis of numbers, found one of texts"),
        ("{ from = 0, to = 80, count = 9 }", "[0, 1, 2, 3, 4, 5, 6, 8, 7]", "[axes] load: expected values that rise or fall all the way, to trace along them, found others"),
        ("[design]\nkind", "design", "design: expected a table [design], found \"trace\""),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_trace_is_said(write_job, old, new, message):
    text = TRACED.replace("[scene]", "", 1).replace('thrust = "20 kN"', "") if new == "design" else TRACED
    with pytest.raises(InputError) as caught:
        load_job(write_job(text.replace(old, new)))
    assert message in str(caught.value)
