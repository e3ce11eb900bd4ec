"""The command `fit` on a belt whose best parameters are known: what it finds, keeps and refuses."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.experiments.fit.evaluating import Evaluation, study_of
from cvt_hpc.experiments.fit.job import share_of
from cvt_hpc.experiments.fit.loading import load
from cvt_hpc.experiments.fit.making import conflict_table
from cvt_hpc.experiments.fit.search import Found, sensitivities
from cvt_hpc.physics.out_of_plane import axial_offset
from cvt_hpc.study import run
from cvt_hpc.tables import below_origin
from cvt_hpc.vibration.classes import OccurrenceClass

# The window begins at 25 N m / element_mass, so that these targets ask for a mass of 0.25 kg/m and a gradient of -1.44 s/m
JOB = """
name = "x"
model = "toy"
[scene]
thrust = "30 kN"
[axes]
element_mass = { from = "0.1 kg/m", to = "1 kg/m", spacing = "log" }
friction_gradient = { from = "-2000 s/km", to = "-500 s/km" }
[fit]
screened = 16
population = 10
generations = 6
every = 2
confirmed = 2
distances = [0.5, 0.97, 1.03, 4.0]
samples = 8
starts = [{ element_mass = "0.9 kg/m", friction_gradient = "-0.6 s/m" }]
along = { load = { from = "0 N m", to = "200 N m", step = "5 N m" } }
counted = { slip_margin = { to = -0.05 } }
coarse = { stations = 40 }
repeat = { stations = [80, 160] }
[fit.cases]
as_built = {}
rigid = { set = { sheave_stiffness = inf } }
steeper = { factor = { friction_gradient = 1.5 } }
constant = { set = { friction_gradient = 0 } }
[[fit.targets]]
name = "area"
case = "as_built"
measure = "vibrating"
from = "100 N m"
to = "125 N m"
statement = "noise from 100 to 125 N m, said somebody"
[[fit.targets]]
name = "below"
measure = "quiet"
to = "95 N m"
[[fit.targets]]
name = "band"
measure = "within"
quantity = "frequency"
bounds = ["595 Hz", "605 Hz"]
fading = "100 Hz"
[[fit.targets]]
name = "one"
measure = "areas"
[[fit.targets]]
name = "rigid"
case = "rigid"
measure = "quiet"
[[fit.targets]]
name = "constant"
case = "constant"
measure = "quiet"
[[fit.targets]]
name = "steeper"
case = "steeper"
measure = "larger"
than = "as_built"
"""

# Where it does not matter what the search finds
BRIEFLY = [
    word for key in ("generations=1", "screened=8", "population=5") for word in ("--set", f"fit.{key}")
]
ALIGNMENT = Path(__file__).parents[2] / "jobs" / "fit_alignment.toml"


@pytest.fixture
def job(window, tmp_path):
    (tmp_path / "x.toml").write_text(JOB)
    return tmp_path / "x.toml"


def read(path):
    """Provenance and rows of a table."""
    lines = path.read_text().splitlines()
    return lines, list(csv.DictReader(below_origin(lines)))


def test_it_finds_the_set_that_is_known(job, window, capsys, tmp_path):
    assert main(["fit", "x.toml"]) == 0
    printed = capsys.readouterr().out
    assert "best set: generation_" in printed
    told, rows = read(tmp_path / "out" / "x" / "set.csv")
    of_set = {row["parameter"]: row for row in rows}
    mass, gradient = of_set["element_mass"], of_set["friction_gradient"]
    # the loads are 5 N m apart, and the search has every other one
    assert 25.0 / float(mass["value"]) == pytest.approx(100.0, abs=5.0)
    # 595 to 605 Hz are 500 Hz times the root of 1.416 to 1.464; in the unit of the job
    assert gradient["unit"] == "s/km" and -1500.0 < float(gradient["value"]) < -1380.0
    assert float(mass["lowest"]) <= float(mass["median"]) <= float(mass["highest"])
    # a mass of a half moves the window to 200 N m, near gross slip, and of four times to 25 N m, where it stays
    assert mass["out_below"] == "0.5" and mass["out_above"] == ""
    assert told[0].startswith("# The best set") and told[1].startswith("# revision: ")
    assert told[2].startswith("# job: x, fingerprint ") and told[4].startswith("# versions: cvt_hpc ")
    _, verdicts = read(tmp_path / "out" / "x" / "verdicts.csv")
    assert {row["target"]: row["verdict"] for row in verdicts} == dict.fromkeys(
        ["area", "below", "band", "one", "rigid", "constant", "steeper"], "reproduced"
    )
    assert verdicts[0]["found"].startswith("vibrates 100-125") and "said somebody" in verdicts[0]["statement"]
    _, confirmed = read(tmp_path / "out" / "x" / "confirmed.csv")
    assert [row["found_in"] for row in confirmed][-1] == "start 1"  # run in full, too, and worse
    _, candidates = read(tmp_path / "out" / "x" / "candidates.csv")
    assert len(candidates) <= 1 + 16 + 6 * 10
    assert {row["stage"] for row in candidates} >= {"screening", "generation_001"}
    best = max(float(row["score"]) for row in candidates)
    assert best > max(float(row["score"]) for row in candidates if row["stage"] == "screening")
    # coarse runs are coarse, and those that count are not
    assert {point["stations"] for point in window} == {40, 80, 160}
    assert all(point["friction_gradient"] == 0.0 for point in window if point["friction_gradient"] > -0.4)

    # done again it runs nothing, and says the same
    runs, tables = len(window), {path: path.read_bytes() for path in (tmp_path / "out" / "x").glob("*.csv")}
    assert main(["fit", "x.toml"]) == 0
    assert capsys.readouterr().out == printed and len(window) == runs
    assert len(tables) == 7 and {path: path.read_bytes() for path in tables} == tables
    # another search would mix with the studies that are there
    assert main(["fit", "x.toml", "--set", "fit.seed=2"]) == 2
    assert "screening: expected" in capsys.readouterr().err
    assert len(window) == runs


def test_conflicts_are_pairs_that_nobody_meets_together(job):
    fit = load(job)
    scores = np.ones((3, len(fit.targets)))
    scores[:, 0] = 1.0, 0.2, 0.7  # of the first target and the second each is met, but never both
    scores[:, 1] = 0.1, 1.0, 0.6
    scores[:, 2] = 0.5  # and the third by none
    table = conflict_table(fit, Found(["a"] * 3, np.zeros((3, 2)), scores, np.zeros(3)))
    assert table.rows[-1] == ["area", "below", 1.0, 1.0, 0.6]
    assert all("band" in row[:2] and row[-1] == 0.5 for row in table.rows[:-1])
    assert len(table.rows) == 7


def test_sensitivities_are_those_of_the_law(job, tmp_path):
    """Within 30 % of the set the frequency follows from the gradient alone, and the window from the mass."""
    fit = load(job, ["fit.samples=32", "fit.nearby=0.3"])
    indices = sensitivities(fit, Evaluation(fit, tmp_path / "out"), "around", np.array([0.25, -1.44]))
    found = {(index.score, index.parameter): index for index in indices}
    for score, decides, other in (
        ("band", "friction_gradient", "element_mass"),
        ("below", "element_mass", "friction_gradient"),
    ):
        assert found[score, decides].first == pytest.approx(1.0, abs=0.15)
        assert found[score, decides].total == pytest.approx(1.0, abs=0.15)
        assert found[score, other].total == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(found["rigid", "element_mass"].first)  # never anything but silence
    of_total = found["total", "element_mass"]
    assert of_total.total_low < of_total.total < of_total.total_high


def test_runs_that_the_model_refuses_do_not_count(job, window, tmp_path):
    job.write_text(JOB.replace("rigid = {", 'light = { set = { thrust = "15 kN" } }\nrigid = {'))
    fit = load(job)
    scenes, evaluation = np.array([[0.25, -1.44], [0.2, -1.44]]), Evaluation(fit, tmp_path / "out")
    for courses in evaluation.evaluate("some", scenes, {}, fit.values, ["as_built", "light"]).courses:
        whole, light = courses["as_built"], courses["light"]
        refused = light.values > 150.0
        assert np.array_equal(light.classes, np.where(refused, OccurrenceClass.NOT_RUN, whole.classes))
        assert not light.counted[refused].any() and np.isnan(light.quantities["amplitude"][refused]).all()
        kept = light.quantities["amplitude"][~refused]
        assert np.array_equal(kept, whole.quantities["amplitude"][~refused])
    assert len(window) == 2 * (41 + 31)
    with pytest.raises(InputError, match="load: expected at most 300 N m at this thrust"):
        evaluation.evaluate("all", scenes, {}, np.array([400.0]), ["as_built"])


def test_starts_are_looked_around_as_the_best_set_is(job, tmp_path, capsys):
    assert main(["fit", "x.toml", "--set", "fit.around=starts", *BRIEFLY]) == 0
    for name in ("distances", "sensitivities"):
        _, rows = read(tmp_path / "out" / "x" / f"{name}.csv")
        sets = list(dict.fromkeys(row["around"] for row in rows))
        assert len(sets) == 2 and sets[1] == "start 1" and sets[0] != "start 1"
        assert sum(row["around"] == "start 1" for row in rows) == len(rows) // 2
    # the window of the start begins at 27.8 N m, with 1.03 times its mass at 27 N m; the loads are 10 N m apart
    _, rows = read(tmp_path / "out" / "x" / "distances.csv")
    of_start = {(r["parameter"], r["factor"]): r for r in rows if r["around"] == "start 1"}
    assert float(of_start["element_mass", "4"]["value"]) == 3.6
    assert of_start["element_mass", "1.03"]["found"] == "vibrates 30-50"


def test_a_fit_that_was_stopped_goes_on(job, window, monkeypatch, capsys, tmp_path):
    small = ["fit", "x.toml", *BRIEFLY, "--set", "fit.samples=0"]
    assert main([*small, "--out", "whole"]) == 0
    whole, runs = capsys.readouterr().out, len(window)
    reports = iter([False, True])

    def stopped(*arguments, **keys):
        report = run(*arguments, **keys)
        return replace(report, remaining=1, gained=1) if next(reports) else report

    monkeypatch.setattr("cvt_hpc.experiments.fit.evaluating.run", stopped)
    assert main(small) == 99
    assert not list((tmp_path / "out" / "x").glob("*.csv"))
    monkeypatch.setattr("cvt_hpc.experiments.fit.evaluating.run", run)
    assert main(small) == 0
    assert capsys.readouterr().out.split("table:")[0] == whole.split("table:")[0]
    assert len(window) == 2 * runs  # none twice


def test_factors_are_set_as_a_list(job, capsys):
    assert load(job, ["fit.distances=[0.8, 1.25]"]).distances == (0.8, 1.25)
    assert load(job, {"fit.distances": [2.0]}).distances == (2.0,)
    for value, found in (("0.8", '"0.8"'), ("[0.8, -1]", "[0.8, -1.0]")):
        assert main(["fit", "x.toml", "--set", f"fit.distances={value}"]) == 2
        assert f"found {found}" in capsys.readouterr().err


def test_shares_and_scenes_are_inverse(job):
    fit = load(job)
    shares = np.random.default_rng(1).random((5, 2))
    scenes = fit.scenes(shares)
    back = [share_of(one, column) for one, column in zip(fit.free, scenes.T, strict=True)]
    assert np.allclose(np.transpose(back), shares, atol=1e-12)
    assert np.allclose(np.log10(scenes[:, 0]), shares[:, 0] - 1.0)


def test_check_tells_targets_and_cost(job, capsys):
    assert main(["check", "x.toml"]) == 0
    out = capsys.readouterr().out
    assert "2 free parameters, 7 targets" in out and "noise from 100 to 125 N m, said somebody" in out
    # 77 candidates x 4 cases x 21 loads of 2 core-seconds
    assert "6468 runs" in out and "3.59 core-hours" in out
    assert main(["run", "x.toml"]) == 2
    assert "[fit]: expected a job of runs, found one for `cvt-hpc fit`" in capsys.readouterr().err


def test_a_free_parameter_may_give_another_one_at_each_value_along():
    fit = load(ALIGNMENT)
    job, legal = study_of(fit, "x", fit.scenes(np.array([[0.0], [1.0]])), {}, fit.values, fit.cases)
    points = [job.point(k) for k in range(job.size)]
    assert legal.all() and {point["ratio"] for point in points} == set(fit.values)
    offsets = [axial_offset(point, point["aligned_ratio"]) for point in points]
    assert [point["misalignment"] for point in points] == offsets and len(set(offsets)) == len(points) == 8


def test_a_start_gives_what_the_job_does_not(tmp_path):
    text = ALIGNMENT.read_text().replace("[{ aligned_ratio = 1 }]", "[{}]")
    (tmp_path / "x.toml").write_text(text)
    with pytest.raises(InputError, match="aligned_ratio: expected a value, as the job has none"):
        load(tmp_path / "x.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('measure = "areas"', 'measure = "area"', 'measure: expected one of vibrating, quiet, within, least, areas, onset, larger, found "area"; did you mean areas?'),
        ('measure = "areas"', "", "targets, item 4 measure: expected one of"),
        ('case = "rigid"\n', 'case = "rigit"\n', 'item 5 case: expected one of as_built, rigid, steeper, constant, found "rigit"; did you mean rigid?'),
        ('than = "as_built"', 'than = "steeper"', 'item 7 than: expected another case than its own, found "steeper"'),
        ('than = "as_built"', "", "item 7 than: expected one of as_built"),
        ('quantity = "frequency"', 'quantity = "frequenzy"', "item 3 quantity: unknown quantity of a run; did you mean frequency?"),
        ('quantity = "frequency"', 'quantity = "frequency t3"', "item 3 quantity: unknown part of frequency; known: t1, t2"),
        ('fading = "100 Hz"', "", "item 3 fading: expected a value in Hz"),
        ('["595 Hz", "605 Hz"]', '["605 Hz", "595 Hz"]', "item 3 bounds: expected two values, the lower one first, found [605.0, 595.0]"),
        ('["595 Hz", "605 Hz"]', '["595 N", "605 Hz"]', "item 3 bounds, item 1: expected a value in Hz"),
        ('from = "100 N m"\nto = "125 N m"', 'from = "101 N m"\nto = "109 N m"', "item 1 from, to: expected one or more of the values of load that the search runs, found none between them"),
        ('from = "100 N m"\nto', 'from = "300 N m"\nto', "item 1 from: expected a value not above `to`"),
        ('name = "below"', 'name = "area"', 'item 2 name: expected a name of its own, found "area"'),
        ("count = 2", "counts = 2", "unknown key"),
        ("friction_gradient = 1.5", "friction_gradent = 1.5", "[fit] cases.steeper factor friction_gradent: unknown key; did you mean friction_gradient in [belt]?"),
        ("friction_gradient = 1.5", "load = 1.5", "cases.steeper load: expected other parameters than the swept one, found load"),
        ("sheave_stiffness = inf", "sheave_stiffness = -1", "cases.rigid set sheave_stiffness: expected > 0, found -1"),
        ('element_mass = { from = "0.1 kg/m", to = "1 kg/m", spacing = "log" }', "element_mass = [0.1, 1.0]", "[axes] element_mass: expected a range {from=, to=}, to draw samples from, found a list"),
        ('element_mass = { from', 'element_mas = { from', "[axes] element_mas: unknown key; did you mean element_mass in [belt]?"),
        ("along = { load", "along = { element_mass", "[fit] along element_mass"),
        ('element_mass = "0.9 kg/m", friction', 'element_mass = "3 kg/m", friction', "starts, item 1 element_mass: expected a value from 0.1 kg/m to 1 kg/m, found 3 kg/m"),
        ('element_mass = "0.9 kg/m", friction', 'elment_mass = "0.9 kg/m", friction', "starts, item 1 elment_mass: unknown free parameter; did you mean element_mass?"),
        ("screened = 16", "screened = 12", "[fit] screened: expected a power of 2, found 12"),
        ("coarse = { stations = 40 }", "coarse = { station = 40 }", "[fit] coarse station: unknown key; did you mean stations in [mesh]?"),
        ("coarse = { stations = 40 }", "coarse = { stations = [40, 50] }", "[fit] coarse stations: expected one value, found an axis"),
        ("counted = { slip_margin", "counted = { slip_margn", "[fit] counted slip_margn: unknown quantity of a run; did you mean slip_margin?"),
        ("generations = 6", "generation = 6", "[fit] generation: unknown key; did you mean generations?"),
        ("repeat = { stations = [80, 160] }", "repeat = { stations = 80 }", "[fit] repeat stations: expected a list"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(window, tmp_path, capsys, old, new, message):
    if old == "count = 2":
        old, new = 'measure = "areas"', 'measure = "areas"\ncounts = 2'
    assert old in JOB
    (tmp_path / "x.toml").write_text(JOB.replace(old, new, 1))
    assert main(["fit", "x.toml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("cvt-hpc: x.toml: ") and message in line, line
    assert not (tmp_path / "out").exists() and not window


def test_a_job_or_an_option_of_calibrate_is_told_so(window, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.toml").write_text(JOB[: JOB.index("[fit]")] + "[uncertain]\nsamples = 8\n")
    assert main(["fit", "x.toml"]) == main(["fit", "x.toml", "--measured", "rig.csv"]) == 2
    of_job, of_option = capsys.readouterr().err.splitlines()
    told = "`cvt-hpc calibrate JOB --measured FILE` weighs its samples by measured noise"
    assert of_job == f"cvt-hpc: x.toml: [uncertain]: expected a table [fit], found [uncertain] alone; {told}"
    assert "--measured rig.csv; `cvt-hpc calibrate JOB` takes --measured" in of_option
    (tmp_path / "x.toml").write_text(JOB + "[uncertain]\nsamples = 8\n")
    assert main(["fit", "x.toml"]) == 2
    assert "[uncertain]: expected none: a fit draws its candidates itself" in capsys.readouterr().err
