"""Runs whose history is kept, as a job names them."""

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, load_job
from cvt_hpc.job.summary import summarize

AXES = (
    '[axes]\nload = {from = 0, to = 100, step = 25}\nsheave_stiffness = [1, 3]\n[scene]\nthrust = "20 kN"\n'
)


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Return a function that writes a job of the elastic belt as the current folder's x.toml."""
    monkeypatch.chdir(tmp_path)

    def write_belt(text):
        (tmp_path / "x.toml").write_text('name = "x"\nmodel = "elastic_belt"\n' + text)
        return "x.toml"

    return write_belt


def load(write, history, overrides=()):
    return load_job(write(f"[record]\nhistory = {history}\n{AXES}"), overrides)


@pytest.mark.parametrize(
    ("history", "indices"),
    [
        ("[]", ()),
        ('[{load = "0.05 kN m", sheave_stiffness = 3}, {sheave_stiffness = 1, load = 0}]', (0, 5)),
        ("[7, {load = 75, sheave_stiffness = 3}]", (7,)),
    ],
)
def test_points_and_indices(write, history, indices):
    job = load(write, history)
    assert job.histories == indices
    for index, entry in zip(indices, [(0, 1), (50, 3)], strict=False):
        if history.startswith("[{"):
            assert (job.point(index)["load"], job.point(index)["sheave_stiffness"]) == entry


def test_they_are_no_part_of_what_determines_the_numbers(write):
    plain = load_job(write(AXES))
    kept = load(write, "[3]")
    assert kept.fingerprint() == plain.fingerprint()
    assert kept.resolved() == plain.resolved()
    assert "histories kept: of runs 3" in summarize(kept, 1.0).splitlines()


def test_a_run_that_an_override_takes_off_the_grid_is_left_out(write):
    history = "[{load = 50, sheave_stiffness = 3}, {load = 75, sheave_stiffness = 1}]"
    assert load(write, history, ["load=75"]).histories == (0,)


@pytest.mark.parametrize(
    ("history", "complaint"),
    [
        (
            '"all"',
            'expected a list of runs, each a table {axis = value, ...} with all axes, or a run index, found "all"',
        ),
        ("[true]", "run 1: expected a list of runs"),
        ("[10]", "run 1: expected an index from 0 to 9, found 10"),
        ("[{load = 50}]", "run 1: expected a value for each axis, found none for sheave_stiffness"),
        (
            "[0, {load = 60, sheave_stiffness = 1}]",
            "run 2, load: expected a value of the axis, such as 50 N m or 75 N m, found 60 N m",
        ),
        (
            "[{load = '0.06 kN m', sheave_stiffness = 1}]",
            "run 1, load: expected a value of the axis, such as 50 N m or 75 N m, found 60 N m",
        ),
        ("[{load = 150, sheave_stiffness = 1}]", "such as 100 N m, found 150 N m"),
        ("[{laod = 50, sheave_stiffness = 1}]", "run 1, laod: unknown key; did you mean load in [scene]?"),
        (
            "[{load = 50, sheave_stiffness = 1, ratio = 2}]",
            "expected axes of this job (load, sheave_stiffness), found ratio",
        ),
    ],
)
def test_what_is_no_run_of_the_grid_is_refused(write, history, complaint):
    with pytest.raises(InputError) as caught:
        load(write, history)
    assert "[record] history" in str(caught.value)
    assert complaint in str(caught.value)


def test_a_value_is_found_in_spite_of_rounding():
    axes = {"load": [0.1, 0.1 + 0.2], "ratio": [1.0, 2.0]}
    document = {"name": "x", "model": "elastic_belt", "axes": axes}
    for load in (0.3, 0.1 + 0.2):
        job = build_job({**document, "record": {"history": [{"load": f"{load!r} N m", "ratio": 2}]}})
        assert job.histories == (3,)


def test_samples_are_named_by_their_index(write):
    samples = "[design]\nkind = 'sobol'\nruns = 32\n[axes]\nload = {{from = 0, to = 100}}\n[record]\nhistory = [{}]\n"
    assert load_job(write(samples.format("31, 4, 4"))).histories == (4, 31)
    for entry, found in (("32", "32"), ("{load = 100}", "a table"), ("true", "true")):
        with pytest.raises(InputError, match=f"run 1: expected an index from 0 to 31, found {found}"):
            load_job(write(samples.format(entry)))


def test_a_run_that_an_axis_of_an_override_takes_off_the_grid_is_left_out(write):
    history = "[{load = 50, sheave_stiffness = 3}, {load = 75, sheave_stiffness = 1}]"
    assert load(write, history, ["load=[75, 80]"]).histories == (0,)
    assert load(write, history, ["ratio=[1, 2]"]).histories == ()
