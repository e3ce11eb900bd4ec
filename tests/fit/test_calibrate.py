"""Uncertain parameters told by measured noise: hidden ones are found, and a study is calibrated by command."""

import csv
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.experiments.calibrate import (
    BAND,
    Posterior,
    _lines,
    _write_part,
    information,
    load,
    told_best,
    weigh,
)
from cvt_hpc.experiments.uncertain_lines import correlated_groups, nearest_distribution
from cvt_hpc.job import load_job
from cvt_hpc.job.uncertain import Distribution
from cvt_hpc.study import run
from cvt_hpc.study.status import find_records

SPEEDS = np.arange(20.0, 205.0, 10.0)  # [mm/s]
JOB = """
name = "x"
model = "criterion"

[axes]
radial_speed = { from = "20 mm/s", to = "200 mm/s", step = "10 mm/s" }

[uncertain]
samples = 256
stribeck_velocity = { distribution = "uniform", from = "40 mm/s", to = "60 mm/s" }
friction_memory = { distribution = "uniform", from = "0.2 ms", to = "0.4 ms" }
transverse_damping = { distribution = "uniform", from = "300 N s/m^2", to = "700 N s/m^2" }
"""
LOW, HIGH = np.array([300.0, 0.04, 2e-4]), np.array([700.0, 0.06, 4e-4])  # [SI], in the order of the keys
KEYS, SAMPLES = ("transverse_damping", "stribeck_velocity", "friction_memory"), 256
ONSET = "onset_radial_speed [mm/s]\n87\n"
RANGE = "measured_radial_speed_from [mm/s],measured_radial_speed_to [mm/s]"
WINDOW = f"radial_speed_from [mm/s],radial_speed_to [mm/s],{RANGE}"
FREQUENCIES = "frequency_from [Hz],frequency_to [Hz]"


def window(share):
    """Where it vibrates [mm/s] and at which frequency [Hz], by the last two shares; the first does nothing."""
    return 60.0 + 60.0 * share[1], 180.0 + 0.0 * share[1], 500.0 + 100.0 * share[2]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A job, and results that it does not compute: windows by a closed form."""
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "x.toml").write_text(JOB)
    (folder / "rig.csv").write_text(ONSET)
    asked = load(folder / "x.toml", (), str(folder / "rig.csv"))
    scatters = {rule.key: rule.source for rule in asked.job.rules}
    values = np.array([[scatters[key].value({"sample": k}) for k in range(SAMPLES)] for key in KEYS])
    low, high, frequency = window((values.T - LOW).T / (HIGH - LOW)[:, None])
    vibrates = (SPEEDS >= low[:, None]) & (SPEEDS <= high[:, None])
    dims = ("sample", "radial_speed")
    moves = np.where(vibrates, 1.0, 0.0)[..., None]
    dataset = xr.Dataset(
        {
            "status": (dims, np.ones(vibrates.shape, np.int8)),
            "vibrates": (dims, vibrates.astype(np.int8)),
            "amplitude": ((*dims, "strand"), 1e-5 * moves, {"units": "m"}),
            "frequency": ((*dims, "strand"), frequency[:, None, None] * moves, {"units": "Hz"}),
        },
        {
            "sample": np.arange(SAMPLES),
            "radial_speed": ("radial_speed", 1e-3 * SPEEDS, {"units": "m s-1", "job_units": "mm/s"}),
            "strand": ["t1"],
            **{key: ("sample", own) for key, own in zip(KEYS, values, strict=True)},
        },
        attrs={"job": "{}"},
    )
    return asked, dataset


def asked_by(study, folder, text, **changes):
    (folder / "rig.csv").write_text(text)
    return study[0]._replace(measured=folder / "rig.csv", **changes)


def measured_windows(hidden, rng):
    """What a rig measures of a hidden variator, as `calibrate` takes it: one cell in twenty is judged otherwise."""
    low, high, frequency = window(hidden)
    noisy = ((SPEEDS >= low) & (SPEEDS <= high)) ^ (rng.random(SPEEDS.size) < 0.05)
    end = f"20,200,{(measured := frequency + rng.normal(0.0, 10.0)):g},{measured:g}"
    rows = [f"{speed - 1:g},{speed + 1:g},{end}" for speed in SPEEDS[noisy]]
    return "\n".join([f"{WINDOW},{FREQUENCIES}", *rows, f"20,20,{end}", ""])


@pytest.mark.slow
def test_hidden_variators_lie_in_bands_and_in_what_is_written_as_often_as_these_say(study, tmp_path):
    """Of two parameters on which the noise depends, by central shares of the distribution for a next job."""
    rng, inside, widths, shares = np.random.default_rng(3), [], [], []
    for _ in range(32):
        hidden = rng.random(3)
        found = weigh(asked_by(study, tmp_path, measured_windows(hidden, rng), scatter=10.0), study[1])
        assert [one.key for one in found.distributions] == [*KEYS]
        before, after = np.array(found.bands()).swapaxes(0, 1)
        true = LOW + hidden * (HIGH - LOW)
        inside.append((after[:, 0] <= true) & (true <= after[:, 2]))
        widths.append(np.ptp(after, axis=1) / np.ptp(before, axis=1))
        narrowed = found.narrowed()
        written = [narrowed.get(one.key, one) for one in found.distributions]
        shares += [float(one.shares(value)) for one, value in zip(written[1:], true[1:], strict=True)]
    assert np.mean(inside, axis=0).min() >= 0.9
    damping, velocity, memory = np.median(widths, axis=0)
    assert memory < 0.5 and velocity < 0.5 and damping > 0.9  # of which the file tells nothing
    for share in (0.5, 0.8, 0.95):
        covered = np.mean(np.abs(np.array(shares) - 0.5) <= 0.5 * share)
        assert abs(covered - share) < 2.5 * np.sqrt(share * (1.0 - share) / len(shares)), (share, covered)


def of_scores(study, begins, frequency):
    """The same study with windows and frequencies by the normal scores of the last two parameters."""
    asked, dataset = study
    values = np.array([dataset[key].values for key in KEYS])
    _, one, other = norm.ppf((values.T - LOW) / (HIGH - LOW)).T
    vibrates = SPEEDS >= begins(one, other)[:, None]
    told = np.where(vibrates, frequency(one, other)[:, None], 0.0)[..., None]
    changed = {
        "vibrates": vibrates.astype(np.int8),
        "frequency": told,
        "amplitude": np.where(told, 1e-5, 0.0),
    }
    return asked, dataset.assign({name: dataset[name].copy(data=new) for name, new in changed.items()})


@pytest.mark.slow
def test_what_a_file_tells_of_parameters_together_is_narrow_and_holds_them(study, tmp_path):
    """Window and frequency by the sum of two scores: each is hardly told, but their sum is."""

    def begins(one, other):
        return 110.0 + 20.0 * (one + other)

    def frequency(one, other):
        return 500.0 + 50.0 * (one + other)

    changed, rng, rows = of_scores(study, begins, frequency), np.random.default_rng(8), []
    for _ in range(32):
        hidden = rng.normal(size=2)
        noisy = (begins(*hidden) <= SPEEDS) ^ (rng.random(SPEEDS.size) < 0.05)
        end = f"20,200,{(measured := frequency(*hidden) + rng.normal(0.0, 20.0)):g},{measured:g}"
        windows = [f"{speed - 1:g},{speed + 1:g},{end}" for speed in SPEEDS[noisy]]
        text = "\n".join([f"{WINDOW},{FREQUENCIES}", *windows, f"20,20,{end}", ""])
        asked = asked_by(changed, tmp_path, text)
        found = weigh(asked, changed[1])
        if found.fault(asked.doubt):
            continue
        told = told_best(asked, found)
        low, _, high = told.after.quantiles(BAND)
        each = [np.ptp(after) / np.ptp(before) for before, after in found.bands()[1:]]
        rows.append([low <= told.coefficients[1:] @ hidden <= high, told.width(), *each, *told.coefficients])
    inside, width, first, second, *coefficients = np.array(rows).T
    assert len(rows) > 27 and inside.mean() >= 0.9
    assert np.median(width) < 0.35 and min(np.median(first), np.median(second)) > 0.5
    assert np.median(np.abs(coefficients), axis=1) == pytest.approx([0.0, 0.5**0.5, 0.5**0.5], abs=0.15)


@pytest.mark.parametrize("samples", [32, 64, 256])
def test_a_file_that_tells_nothing_tells_nothing_of_parameters_together(study, tmp_path, samples):
    """All samples have the same window: the least of the spreads of few samples is one by chance."""
    changed = of_scores(study, lambda one, other: 100.0 + 0.0 * one, lambda one, other: 500.0 + 0.0 * one)
    asked = asked_by(changed, tmp_path, f"{WINDOW}\n99,201,20,200\n")
    found = weigh(asked, changed[1].isel(sample=slice(samples)))
    assert told_best(asked, found).width() > 0.85
    assert not any(line.startswith("told best") for line in _lines(asked, found))


@pytest.mark.parametrize(
    ("likelihood", "kind"),
    [
        (lambda x: (x > 0.5).astype(float), "uniform"),
        (lambda x: ((x > 0.3) & (x < 0.8)).astype(float), "uniform"),
        (lambda x: np.exp(-0.5 * ((x - 0.6) / 0.1) ** 2), "normal"),
        (lambda x: np.exp(-0.5 * (x / 0.3) ** 2), "normal"),  # cut by the limit of the prior
    ],
)
def test_what_is_written_is_as_wide_as_the_samples(likelihood, kind):
    x = (np.arange(400) + 0.5) / 400
    weights = likelihood(x) / likelihood(x).sum()
    prior = Distribution("x", "uniform", (("from", 0.0), ("to", 1.0)))
    found = nearest_distribution(prior, x, weights)
    drawn = found.quantiles(x)
    mean = weights @ x
    assert found.kind == kind and drawn.mean() == pytest.approx(mean, abs=0.01)
    assert drawn.std() == pytest.approx(np.sqrt(weights @ (x - mean) ** 2), rel=0.05)


def test_weights_are_those_of_the_stated_likelihood(study, tmp_path):
    """Against a count by hand of one sample's cells, and ratios of two samples."""
    _, dataset = study
    text = f"{WINDOW},amplitude [um]\n95,185,20,200,20\n"
    asked = asked_by(study, tmp_path, text, doubt=0.1)
    found = weigh(asked, dataset)
    noise = (SPEEDS > 95.0) & (SPEEDS < 185.0)
    wrong = (dataset["vibrates"].values.astype(bool) != noise).sum(axis=1)
    expected = -wrong * np.log(9.0) - 0.5  # a ratio of amplitudes of one half
    assert found.log_likelihood == pytest.approx(expected)
    assert found.weights == pytest.approx(np.exp(expected) / np.exp(expected).sum())


def test_onsets_count_by_half_a_step_of_their_axis(study, tmp_path):
    _, dataset = study
    found = weigh(asked_by(study, tmp_path, ONSET), dataset)
    first = np.array([SPEEDS[row.astype(bool)][0] for row in dataset["vibrates"].values]) - 5.0
    expected = -0.5 * ((first - 87.0) / 5.0) ** 2
    expected[np.abs(first - 87.0) > 15.0] = -2.0 * np.log(19.0)  # farther apart they are no pair
    assert found.log_likelihood == pytest.approx(expected)


def test_the_next_measurement_is_where_the_outcome_is_most_open(study, tmp_path):
    _, dataset = study
    asked = asked_by(
        study,
        tmp_path,
        f"{WINDOW}\n20,20,20,60\n",
    )
    found = weigh(asked, dataset)
    bits, chance = information(asked, found).values, found.probability().values
    best = int(np.argmax(bits))
    assert abs(chance[best] - 0.5) == np.abs(chance - 0.5).min() and 0.0 < bits[best] < 1.0
    certain = chance == 0.0
    assert certain.any() and np.allclose(bits[certain], 0.0, atol=1e-9)


def test_parameters_that_act_alike_are_not_told_apart():
    rng = np.random.default_rng(1)
    one = rng.random(400)
    values = np.array([one, 1.0 - one + 0.05 * rng.normal(size=400)])
    weights = np.full(400, 1.0 / 400)
    found = Posterior(None, None, (), values, [], weights, weights)
    assert found.correlation()[0, 1] < -0.9


def ranks_of(values, weights=None):
    """Rank correlations of weighed samples (parameter, sample), and their effective number."""
    weights = np.full(values.shape[1], 1.0) if weights is None else weights
    weights = weights / weights.sum()
    found = Posterior(None, None, (), values, [], weights, weights)
    return found.correlation(), found.effective


def test_groups_are_those_of_the_law_that_samples_were_drawn_from():
    """A chain whose ends do not correlate, a pair, and one alone; by weights that leave half of the samples."""
    rng, found = np.random.default_rng(5), []
    for _ in range(50):
        x = rng.normal(size=(6, 600))
        values = [x[0] + x[1], x[1] + x[2], x[2] + x[3], np.exp(x[4]), x[4] - x[5], rng.random(600)]
        ranks, effective = ranks_of(np.array(values), rng.exponential(size=600))
        assert effective == pytest.approx(300, rel=0.2)
        found.append(correlated_groups(ranks, effective, np.arange(6)).tolist())
    assert np.mean([one == [0, 0, 0, 1, 1, 2] for one in found]) >= 0.9


@pytest.mark.parametrize(("count", "samples"), [(2, 24), (4, 64), (8, 256)])
def test_independent_parameters_pass_for_correlated_in_one_of_twenty_studies(count, samples):
    rng, repeats = np.random.default_rng(6), 400
    together = 0
    for _ in range(repeats):
        ranks, effective = ranks_of(rng.random((count, samples)), rng.exponential(size=samples))
        together += len(np.unique(correlated_groups(ranks, effective, np.arange(count)))) < count
    assert together / repeats < 0.05 + 2.5 * np.sqrt(0.05 * 0.95 / repeats)


CRITERION = """
name = "y"
model = "criterion"

[axes]
radial_speed = { from = "10 mm/s", to = "250 mm/s", step = "40 mm/s" }

[uncertain]
samples = 32
stribeck_velocity = { distribution = "normal", mean = "50 mm/s", standard_deviation = "10 mm/s", from = "20 mm/s" }
friction_memory = { distribution = "log_normal", mean = "0.3 ms", standard_deviation = "0.1 ms" }
"""


def test_a_study_is_run_and_calibrated_by_one_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "y.toml").write_text(CRITERION)
    head = "radial_speed_from [mm/s],radial_speed_to [mm/s],measured_radial_speed_from [mm/s],"
    (tmp_path / "rig.csv").write_text(f"{head}measured_radial_speed_to [mm/s]\n70,170,10,170\n")
    command = ["calibrate", "y.toml", "--measured", "rig.csv"]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "32 samples weighed by rig.csv" in out and "measure next: radial_speed" in out
    folder = tmp_path / "out" / "y"
    with (folder / "calibrated.csv").open() as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == 32 and sum(float(row["weight"]) for row in rows) == pytest.approx(1.0)
    assert (folder / "calibrated.png").stat().st_size > 5000
    # the part that is written goes on as a job, about what was found, in the units of that
    assert re.search(r'stribeck_velocity = .* "[\d.]+ mm/s"', (folder / "calibrated.toml").read_text())
    text = CRITERION[: CRITERION.index("[uncertain]")] + (folder / "calibrated.toml").read_text()
    (tmp_path / "z.toml").write_text(text)
    job, weights = load_job(tmp_path / "z.toml"), np.array([float(row["weight"]) for row in rows])
    speed = np.array([float(row["stribeck_velocity [mm/s]"]) for row in rows]) @ weights
    drawn = np.unique([1e3 * job.point(k)["stribeck_velocity"] for k in range(job.size)])
    assert drawn.mean() == pytest.approx(speed, rel=0.05)
    # nothing is run twice
    before = {path: path.stat().st_mtime_ns for path in (folder / "samples" / "records").rglob("*")}
    assert main(command) == 0
    assert {path: path.stat().st_mtime_ns for path in (folder / "samples" / "records").rglob("*")} == before


def test_runs_that_are_there_are_weighed_and_what_is_left_of_them_is_done(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "y.toml").write_text(CRITERION)
    (tmp_path / "rig.csv").write_text(f"{WINDOW}\n70,170,10,170\n")
    job, out = load_job(tmp_path / "y.toml"), tmp_path / "out" / "y"
    run(job, out, part="1/2", progress=False)
    left = job.size - int(find_records(out, job).recorded.sum())
    command = ["calibrate", "y.toml", "--measured", "rig.csv"]
    assert main(command) == 0
    told = capsys.readouterr()
    assert 0 < left < job.size and f"{left} runs" in told.err and "32 samples weighed by rig.csv" in told.out
    assert not (out / "samples").exists() and (out / "calibrated.csv").exists()
    before = {path: path.stat().st_mtime_ns for path in (out / "records").rglob("*")}
    assert main(command) == 0 and not (out / "samples").exists()
    assert {path: path.stat().st_mtime_ns for path in (out / "records").rglob("*")} == before
    # nor does a folder of samples that has fewer of them
    run(job, out / "samples", part="1/8", progress=False)
    assert main(command) == 0 and int(find_records(out / "samples", job).recorded.sum()) < job.size
    assert {path: path.stat().st_mtime_ns for path in (out / "records").rglob("*")} == before
    shutil.rmtree(out / "samples")
    # that of another job is refused, as by `run`; --fresh throws none of it away, and is not offered
    capsys.readouterr()
    for option in ([], ["--fresh"]):
        assert main([*command, "--set", "uncertain.seed=2", *option]) == 2 and not (out / "samples").exists()
        (line,) = capsys.readouterr().err.splitlines()
        assert f"{Path('out/y')}: expected the folder of this job, found that of another" in line
        assert line.endswith("; choose another name or --out")
    # what --fresh repeats of this job has a folder of its own
    assert main([*command, "--fresh"]) == 0 and (out / "samples").exists()
    assert {path: path.stat().st_mtime_ns for path in (out / "records").rglob("*")} == before


def test_what_is_written_correlates_what_the_file_does_not_tell_apart_and_nothing_else(study, tmp_path):
    """The window begins by the sum of two shares: where one is larger, the other is less."""
    asked, dataset = study
    values = np.array([dataset[key].values for key in KEYS])
    shares = (values.T - LOW) / (HIGH - LOW)
    vibrates = SPEEDS >= 60.0 + 60.0 * (shares[:, 1] + shares[:, 2])[:, None]
    dataset = dataset.assign(vibrates=dataset["vibrates"].copy(data=vibrates.astype(np.int8)))
    asked = asked_by(study, tmp_path, "onset_radial_speed [mm/s]\n120\n")
    path = _write_part(asked, weigh(asked, dataset), tmp_path / "calibrated.toml")
    (tmp_path / "x.toml").write_text(JOB)
    (tmp_path / "z.toml").write_text(JOB[: JOB.index("[uncertain]")] + path.read_text())
    job = load_job(tmp_path / "z.toml", ["uncertain.indices=true"])
    assert job.axes[-1].values == ("none", "all", "transverse_damping", "correlated")
    (uncertain,) = {rule.source.uncertain for rule in job.rules}
    assert uncertain.groups()["correlated"] == ("stribeck_velocity", "friction_memory")
    assert -1.0 < uncertain.matrix[0][1] < -0.8
    # of a file that tells each of them nothing is correlated, but for what was so before
    rng = np.random.default_rng(4)
    asked = asked_by(study, tmp_path, measured_windows(np.array([0.5, 0.5, 0.5]), rng))
    assert "correlation" not in _write_part(asked, weigh(asked, study[1]), path).read_text()
    stated = {"parameters": ["friction_memory", "transverse_damping"], "matrix": [[1.0, 0.3], [0.3, 1.0]]}
    before = load_job(tmp_path / "x.toml", {"uncertain.correlation": stated})
    text = _write_part(asked._replace(job=before), weigh(asked, study[1]), path).read_text()
    assert 'parameters = ["transverse_damping", "friction_memory"]' in text


def test_what_the_file_tells_and_what_not_is_stated(study, tmp_path):
    """Window and frequency tell a parameter each; the window of a sum tells neither alone, but both together."""

    def stated(study, text, **changes):
        asked = asked_by(study, tmp_path, text, **changes)
        told = [line.partition(": ")[::2] for line in _lines(asked, weigh(asked, study[1]))]
        heads = [head for head, _ in told if "told" in head and "together" not in head]
        assert heads[-3:] == [
            "told, a band below half of that before",
            "told in part",
            "not told, a band hardly narrower",
        ]
        return [dict(told)[head].split(", ") for head in heads[-3:]]

    told, in_part, left = stated(study, f"{WINDOW},{FREQUENCIES}\n85,181,20,200,550,550\n", scatter=8.0)
    assert told[:2] == ["stribeck_velocity", "friction_memory"] and in_part + left in (
        ["transverse_damping", "nothing"],
        ["nothing", "transverse_damping"],
    )
    told, in_part, left = stated(study, f"{WINDOW}\n85,181,20,200\n")
    assert told[0] == "stribeck_velocity" and in_part == ["nothing"]
    assert left == ["transverse_damping", "friction_memory"]
    changed = of_scores(
        study, lambda one, other: 110.0 + 20.0 * (one + other), lambda one, other: 500.0 + one
    )
    told, in_part, left = stated(changed, f"{WINDOW}\n105,201,20,200\n")
    assert told == ["that together"] and {"stribeck_velocity", "friction_memory"} <= {*in_part, *left}


def test_too_few_samples_that_agree_are_no_result(study, tmp_path):
    _, dataset = study
    rig = f"{WINDOW},{FREQUENCIES}\n95,185,20,200,900,900\n"
    asked = asked_by(study, tmp_path, rig, scatter=1.0)
    assert weigh(asked, dataset).fault(asked.doubt).startswith("no sample agrees")
    few = dataset.isel(sample=slice(0, 6))
    asked = asked_by(study, tmp_path, ONSET)
    assert "effective samples, too few" in weigh(asked, few).fault(asked.doubt)
    assert weigh(asked, dataset.isel(sample=[0])).fault(asked.doubt)


def test_the_range_is_named_in_which_most_samples_disagree(study, tmp_path):
    """Noise of 60 to 200 mm/s, and only there: samples vibrate from 60 to 180 at least, and below 60 never."""
    rig = f"{WINDOW}\n30,115,20,200\n"
    asked = asked_by(study, tmp_path, rig)
    _, fault, *lines = _lines(asked, weigh(asked, study[1]))
    assert fault.startswith("no sample agrees")
    assert lines == [
        "most samples vibrate in 7 cells from 120 mm/s to 180 mm/s, where silence was measured",
        "most samples are quiet in 6 cells from 30 mm/s to 80 mm/s, where noise was measured",
    ]


def test_samples_without_verdicts_are_no_candidates(study, tmp_path):
    """A run that failed agrees with nothing, and a study of such runs is one error."""
    _, dataset = study
    rng = np.random.default_rng(2)
    asked = asked_by(study, tmp_path, measured_windows(np.array([0.5, 0.5, 0.5]), rng))
    failed = dataset.copy(deep=True)
    failed["status"][::2] = 2
    weights = weigh(asked, failed).weights
    assert weights[::2].max() < 1e-2 * weights.max()
    failed["status"][:] = 2
    with pytest.raises(InputError, match="cells in its range of which a run is decided"):
        weigh(asked, failed)


def test_both_sets_of_samples_for_sobol_indices_are_candidates(study, tmp_path):
    _, dataset = study
    halves = [dataset.isel(sample=slice(0, 128)), dataset.isel(sample=slice(128, 256))]
    halves = [half.assign_coords(sample=np.arange(128)) for half in halves]
    whole = xr.concat(halves, xr.DataArray(["none", "all"], dims="swapped", name="swapped"))
    asked = asked_by(study, tmp_path, ONSET)
    found, alone = weigh(asked, whole), weigh(asked, dataset)
    assert found.values.shape == alone.values.shape
    assert found.log_likelihood == pytest.approx(alone.log_likelihood)
    assert found.values == pytest.approx(alone.values)


@pytest.mark.parametrize(
    ("job", "options", "said"),
    [
        (JOB, {}, "--measured: expected a file with measured noise, found nothing"),
        (
            JOB[: JOB.index("[uncertain]")],
            {"measured": "rig.csv"},
            "expected samples of uncertain parameters",
        ),
        (JOB + "[fit]\n", {"measured": "rig.csv"}, "found one for `cvt-hpc fit`"),
        (JOB, {"measured": "none.csv"}, "none.csv"),
        (JOB, {"measured": "rig.csv", "doubt": "0.7"}, "--doubt"),
        (
            JOB.replace(
                'radial_speed = { from = "20 mm/s", to = "200 mm/s", step = "10 mm/s" }',
                'friction_gradient = ["-1 s/m", "-2 s/m"]',
            ),
            {"measured": "rig.csv"},
            "expected the axis radial_speed",
        ),
        (JOB + '[design]\nkind = "adaptive"\n', {"measured": "rig.csv"}, "as many samples in each cell"),
        (JOB, {"measured": "rig.csv", "scatter": "3 um"}, "--scatter"),
    ],
)
def test_what_cannot_be_calibrated_is_one_error(job, options, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.toml").write_text(job.replace("samples = 256", "samples = 8"))
    (tmp_path / "rig.csv").write_text(ONSET)
    words = [word for key, value in options.items() for word in (f"--{key}", value)]
    assert main(["calibrate", "x.toml", *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
