"""Uncertain parameters told by measured noise: hidden ones are found, and a study is calibrated by command."""

import csv

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.experiments.calibrate import FEWEST, Posterior, information, load, weigh
from cvt_hpc.job import load_job

LOADS = np.arange(20.0, 205.0, 10.0)  # [N m]
JOB = """
name = "x"
model = "elastic_belt"

[axes]
load = { from = "20 N m", to = "200 N m", step = "10 N m" }

[uncertain]
samples = 256
stribeck_velocity = { distribution = "uniform", from = "40 mm/s", to = "60 mm/s" }
friction_memory = { distribution = "uniform", from = "0.2 ms", to = "0.4 ms" }
transverse_damping = { distribution = "uniform", from = "300 N s/m^2", to = "700 N s/m^2" }
"""


RANGES = {
    "stribeck_velocity": (0.04, 0.06),
    "friction_memory": (2e-4, 4e-4),
    "transverse_damping": (300.0, 700.0),
}
KEYS, SAMPLES = tuple(RANGES), 256


def window(share):
    """Where it vibrates [N m] and at which frequency [Hz], by the first two shares; the third does nothing."""
    return 60.0 + 60.0 * share[0], 180.0 + 0.0 * share[0], 500.0 + 100.0 * share[1]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A job, and results that it does not compute: windows by a closed form."""
    path = tmp_path_factory.mktemp("calibrate") / "x.toml"
    path.write_text(JOB)
    job = load_job(path)
    scatters = {rule.key: rule.source for rule in job.rules}
    values = {key: np.array([scatters[key].value({"sample": k}) for k in range(SAMPLES)]) for key in KEYS}
    share = np.array([(values[key] - low) / (high - low) for key, (low, high) in RANGES.items()])
    low, high, frequency = window(share)
    vibrates = (LOADS >= low[:, None]) & (LOADS <= high[:, None])
    units = {"stribeck_velocity": "m s-1", "friction_memory": "s", "transverse_damping": "N s m-2"}
    dims = ("sample", "load")
    dataset = xr.Dataset(
        {
            "status": (dims, np.ones(vibrates.shape, np.int8)),
            "vibrates": (dims, vibrates.astype(np.int8)),
            "amplitude": ((*dims, "strand"), np.where(vibrates, 1e-5, 0.0)[..., None], {"units": "m"}),
            "frequency": (
                (*dims, "strand"),
                np.where(vibrates, frequency[:, None], 0.0)[..., None],
                {"units": "Hz"},
            ),
        },
        {
            "sample": np.arange(SAMPLES),
            "load": ("load", LOADS, {"units": "N m"}),
            "strand": ["t1"],
            **{key: ("sample", values[key], {"units": units[key]}) for key in KEYS},
        },
        attrs={"job": "{}"},
    )
    assert share.min() >= 0.0 and share.max() <= 1.0
    rig = path.parent / "rig.csv"
    rig.write_text("onset_load [N m]\n87\n")
    return load(path, (), str(rig)), dataset


def asked_by(study, folder, text, **changes):
    (folder / "rig.csv").write_text(text)
    return study[0]._replace(measured=folder / "rig.csv", **changes)


def measured_windows(hidden, rng):
    """A rig's windows of a hidden variator: ends and frequency with noise."""
    low, high, frequency = window(hidden)
    low, frequency = low + rng.normal(0.0, 3.0), frequency + rng.normal(0.0, 10.0)
    head = (
        "load_from [N m],load_to [N m],measured_load_from [N m],measured_load_to [N m],frequency_from [Hz],"
    )
    return f"{head}frequency_to [Hz]\n{low:g},{high:g},20,200,{frequency:g},{frequency:g}\n"


def test_a_hidden_variator_is_found_within_its_own_bounds(study, tmp_path):
    _, dataset = study
    rng, inside, widths, told = np.random.default_rng(3), [], [], []
    for _ in range(40):
        hidden = rng.random(3)
        asked = asked_by(study, tmp_path, measured_windows(hidden, rng), scatter=10.0)
        found = weigh(asked, dataset)
        told.append(found.effective >= FEWEST)
        before, after = found.bands()
        by_key = {
            key: low + part * (high - low)
            for part, (key, (low, high)) in zip(hidden, RANGES.items(), strict=True)
        }
        names = [one.key for one in found.distributions]
        true = np.array([by_key[name] for name in names])
        inside.append((after[:, 0] <= true) & (true <= after[:, 2]))
        widths.append(np.ptp(after, axis=1) / np.ptp(before, axis=1))
    share = dict(zip(names, np.mean(inside, axis=0), strict=True))
    width = dict(zip(names, np.median(widths, axis=0), strict=True))
    assert min(share.values()) >= 0.9 and np.mean(told) >= 0.9, share
    assert width["stribeck_velocity"] < 0.5 and width["friction_memory"] < 0.5, width
    assert width["transverse_damping"] > 0.9  # of which the file tells nothing


def test_weights_are_those_of_the_stated_likelihood(study, tmp_path):
    """Against a count by hand of one sample's cells, and ratios of two samples."""
    _, dataset = study
    text = "load_from [N m],load_to [N m],measured_load_from [N m],measured_load_to [N m],amplitude [um]\n95,185,20,200,20\n"
    asked = asked_by(study, tmp_path, text, doubt=0.1)
    found = weigh(asked, dataset)
    noise = (LOADS > 95.0) & (LOADS < 185.0)
    wrong = (dataset["vibrates"].values.astype(bool) != noise).sum(axis=1)
    expected = -wrong * np.log(9.0) - 0.5  # a ratio of amplitudes of one half
    assert found.log_likelihood == pytest.approx(expected)
    assert found.weights == pytest.approx(np.exp(expected) / np.exp(expected).sum())


def test_onsets_count_by_half_a_step_of_their_axis(study, tmp_path):
    _, dataset = study
    found = weigh(asked_by(study, tmp_path, "onset_load [N m]\n87\n"), dataset)
    first = np.array([LOADS[row.astype(bool)][0] for row in dataset["vibrates"].values]) - 5.0
    expected = -0.5 * ((first - 87.0) / 5.0) ** 2
    expected[np.abs(first - 87.0) > 15.0] = -2.0 * np.log(19.0)  # farther apart they are no pair
    assert found.log_likelihood == pytest.approx(expected)


def test_the_next_measurement_is_where_the_outcome_is_most_open(study, tmp_path):
    _, dataset = study
    asked = asked_by(
        study,
        tmp_path,
        "load_from [N m],load_to [N m],measured_load_from [N m],measured_load_to [N m]\n20,20,20,60\n",
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
    # the part that is written goes on as a job, about what was found
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


def test_too_few_samples_that_agree_are_no_result(study, tmp_path):
    _, dataset = study
    rig = "load_from [N m],load_to [N m],measured_load_from [N m],measured_load_to [N m],frequency_from [Hz],frequency_to [Hz]\n95,185,20,200,900,900\n"
    asked = asked_by(study, tmp_path, rig, scatter=1.0)
    assert weigh(asked, dataset).fault(asked.doubt).startswith("no sample agrees")
    few = dataset.isel(sample=slice(0, 6))
    asked = asked_by(study, tmp_path, "onset_load [N m]\n87\n")
    assert "effective samples, too few" in weigh(asked, few).fault(asked.doubt)


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
    asked = asked_by(study, tmp_path, "onset_load [N m]\n87\n")
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
        (JOB, {"measured": "none.csv"}, "none.csv"),
        (JOB, {"measured": "rig.csv", "doubt": "0.7"}, "--doubt"),
        (
            JOB.replace(
                'load = { from = "20 N m", to = "200 N m", step = "10 N m" }', 'thrust = ["40 kN", "50 kN"]'
            ),
            {"measured": "rig.csv"},
            "expected the axis load",
        ),
        (JOB + '[design]\nkind = "adaptive"\n', {"measured": "rig.csv"}, "as many samples in each cell"),
        (JOB, {"measured": "rig.csv", "scatter": "3 um"}, "--scatter"),
    ],
)
def test_what_cannot_be_calibrated_is_one_error(job, options, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.toml").write_text(job.replace("samples = 256", "samples = 8"))
    (tmp_path / "rig.csv").write_text("onset_load [N m]\n87\n")
    words = [word for key, value in options.items() for word in (f"--{key}", value)]
    assert main(["calibrate", "x.toml", *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
