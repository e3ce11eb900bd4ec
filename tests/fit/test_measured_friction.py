"""Laws of friction fitted to measured coefficients: estimates, their uncertainty, what a job takes of them."""

import re
import tomllib
import warnings

import numpy as np
import pytest
from scipy.stats import t

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError, JobWarning
from cvt_hpc.experiments.measured_friction import (
    Points,
    _figure,
    by_force,
    fit_law,
    fit_laws,
    job_lines,
    keys_of,
    law_lines,
    read_points,
)
from cvt_hpc.job import build_job, load_job
from cvt_hpc.job.uncertain import Scatter
from cvt_hpc.physics.friction import friction_coefficients, friction_law
from cvt_hpc.physics.friction_laws import Law

LAWS = [law for law in Law if law is not Law.TABLE]
TRUE = {"kinetic_friction": 0.1, "friction_gradient": -0.8, "stribeck_velocity": 0.05}
SPEEDS = np.array([0.001, 0.003, 0.01, 0.02, 0.035, 0.06, 0.1, 0.16, 0.25, 0.4])  # [m/s]
SPREAD = 0.0015


def of_law(law, speeds=SPEEDS, **changes):
    has = TRUE | changes
    gradient = 0.0 if law is Law.COULOMB else has["friction_gradient"]
    made = friction_law(law.name.lower(), has["kinetic_friction"], gradient, has["stribeck_velocity"])
    return friction_coefficients(made, speeds, np.zeros_like(speeds))


def points(mu, speeds=SPEEDS, specimen=None, force=None):
    nothing = np.full(mu.shape, np.nan) if force is None else force
    return Points(speeds, mu, nothing, np.zeros(mu.shape) if specimen is None else specimen)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name.lower())
def test_points_of_a_law_give_it_back_and_no_other_is_better(law):
    found = fit_laws(points(of_law(law)))
    assert found[0].law is law or (law is Law.COULOMB and found[0].rms < 1e-9)
    own = next(one for one in found if one.law is law)
    for key, value in own.values.items():
        assert value == pytest.approx(TRUE[key], rel=1e-5)


def test_scatter_about_a_constant_is_rarely_taken_for_a_fall():
    rng = np.random.default_rng(4)
    best = [fit_laws(points(0.1 + SPREAD * rng.normal(size=10)))[0].law for _ in range(10)]
    assert best.count(Law.COULOMB) >= 8


@pytest.mark.parametrize("correlation", [0.0, 0.8])
def test_intervals_hold_the_truth_as_often_as_they_promise(correlation):
    """Noise of independent points, and of a trace whose samples follow each other closely."""
    rng, inside = np.random.default_rng(5), []
    speeds = np.linspace(0.001, 0.4, 40 if correlation == 0.0 else 150)
    for _ in range(60):
        noise = rng.normal(size=len(speeds))
        for k in range(1, len(speeds)):
            noise[k] = correlation * noise[k - 1] + np.sqrt(1.0 - correlation**2) * noise[k]
        found = fit_law(Law.STRIBECK, points(of_law(Law.STRIBECK, speeds) + SPREAD * noise, speeds))
        deviation = np.sqrt(np.diag(found.covariance))
        wanted = [TRUE["kinetic_friction"], TRUE["friction_gradient"], np.log(TRUE["stribeck_velocity"])]
        spare = found.independent * len(speeds) - len(wanted)
        inside.append(abs(found.estimate - wanted) < t.ppf(0.975, spare) * deviation)
    assert (np.mean(inside, axis=0) >= 0.9).all(), np.mean(inside, axis=0)


def test_a_law_that_few_points_cannot_prove_is_told():
    """Of six points that fall on a curve a constant is the best, by its one parameter; of ten the curve is."""
    few = points(
        np.array([0.139, 0.132, 0.123, 0.116, 0.105, 0.1]),
        np.array([1.0, 10.0, 25.5, 50.0, 100.0, 400.0]) / 1e3,
    )
    laws = fit_laws(few)
    (line,) = (line for line in law_lines(laws, few) if "closer" in line)
    assert laws[0].law is Law.COULOMB
    assert line.startswith("stribeck is much closer to the points, but 6 points are few for its 3 parameters")
    many = points(of_law(Law.STRIBECK) + 0.0005 * np.random.default_rng(1).normal(size=10))
    laws = fit_laws(many)
    assert laws[0].law is Law.STRIBECK and not any("closer" in line for line in law_lines(laws, many))


def test_lines_and_job_state_a_speed_in_the_same_unit():
    exact = points(of_law(Law.STRIBECK) + 1e-6 * np.random.default_rng(1).normal(size=10))
    laws = fit_laws(exact)
    _, head, best, *_ = law_lines(laws, exact)
    assert "stribeck_velocity [mm/s]" in head and " 50 +- " in best, best
    (written,) = (line for line in job_lines(laws[0]) if line.startswith("# stribeck_velocity"))
    assert 49.9 < float(written.split('"')[1].removesuffix(" mm/s")) < 50.1


def test_scatter_is_that_of_the_specimens_and_not_of_their_number():
    rng, count = np.random.default_rng(7), 24
    own = [TRUE["friction_gradient"] * (1.0 + 0.1 * rng.normal()) for _ in range(count)]
    mu = np.concatenate([of_law(Law.STRIBECK, friction_gradient=one) for one in own])
    found = fit_law(Law.STRIBECK, points(mu, np.tile(SPEEDS, count), np.repeat(np.arange(count), 10)))
    assert found.of_specimens == count
    deviation = found.deviations
    assert deviation["friction_gradient"] == pytest.approx(np.std(own, ddof=1), rel=1e-3)
    assert deviation["kinetic_friction"] < 1e-6
    assert found.values["friction_gradient"] == pytest.approx(np.mean(own), rel=1e-4)


def test_specimens_whose_points_do_not_determine_the_law_are_left_out():
    rng = np.random.default_rng(6)
    mu = np.concatenate([of_law(Law.STRIBECK) + SPREAD * rng.normal(size=10) for _ in range(5)] + [[0.13]])
    speeds = np.concatenate([np.tile(SPEEDS, 5), [0.0]])
    found = fit_law(Law.STRIBECK, points(mu, speeds, np.append(np.repeat(np.arange(5), 10), 9)))
    assert found.of_specimens == 5
    alone = points(mu[:50], speeds[:50], np.arange(50))  # a row for each: none is determined
    assert fit_law(Law.STRIBECK, alone).of_specimens == 0
    same = points(np.tile(of_law(Law.STRIBECK), 5), np.tile(SPEEDS, 5), np.repeat(np.arange(5), 10))
    assert fit_law(Law.STRIBECK, same).of_specimens == 0


def test_a_trace_does_not_depend_on_the_force_because_its_noise_is_slow():
    rng, told = np.random.default_rng(8), 0
    speeds = np.linspace(0.001, 0.4, 400)
    for _ in range(20):
        noise = rng.normal(size=400)
        for k in range(1, 400):
            noise[k] = 0.9 * noise[k - 1] + np.sqrt(0.19) * noise[k]
        trace = points(
            of_law(Law.STRIBECK, speeds) + SPREAD * noise, speeds, force=np.repeat([50.0, 100.0], 200)
        )
        share, error = by_force(fit_law(Law.STRIBECK, trace), trace)
        told += abs(share) > 2.0 * error
    assert told <= 4
    mu, specimen = np.tile(of_law(Law.STRIBECK), 2), np.repeat([1.0, 2.0], 10)
    apart = points(mu * np.repeat([1.0, 1.1], 10), np.tile(SPEEDS, 2), specimen, 50.0 * specimen)
    assert by_force(fit_law(Law.STRIBECK, apart), apart) is None  # of specimens, or of their forces


def test_a_coefficient_that_depends_on_the_force_is_told():
    force = np.repeat([50.0, 100.0, 200.0], 10)
    mu, speeds = np.tile(of_law(Law.STRIBECK), 3), np.tile(SPEEDS, 3)
    noise = SPREAD * np.random.default_rng(2).normal(size=30)
    rising = points(mu * (1.0 - 0.1 * (force - 50.0) / 150.0) + noise, speeds, force=force)
    share, error = by_force(fit_laws(rising)[0], rising)
    assert share == pytest.approx(-0.1, abs=0.03) and abs(share) > 2.0 * error
    share, error = by_force(fit_laws(level := points(mu + noise, speeds, force=force))[0], level)
    assert abs(share) < 2.0 * error


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name.lower())
def test_a_job_takes_the_part_that_is_written(law, tmp_path):
    rng, specimens = np.random.default_rng(3), 6
    mu = np.concatenate(
        [
            of_law(
                law,
                kinetic_friction=0.1 + 0.003 * rng.normal(),
                friction_gradient=-0.8 * np.exp(0.1 * rng.normal()),
                stribeck_velocity=0.05 * np.exp(0.1 * rng.normal()),
            )
            for _ in range(specimens)
        ]
    )
    found = fit_law(law, points(mu, np.tile(SPEEDS, specimens), np.repeat(np.arange(specimens), 10)))
    path = tmp_path / "job.toml"
    path.write_text('name = "x"\nmodel = "elastic_belt"\n\n' + "\n".join(job_lines(found)) + "\n")
    job = load_job(path)
    assert job.size == 64 and job.point(0)["friction_law"] == law.name.lower()
    drawn = {key: np.array([job.point(k)[key] for k in range(64)]) for key in keys_of(law)}
    for key, values in drawn.items():
        assert values.mean() == pytest.approx(found.values[key], rel=0.02)
        assert values.std() == pytest.approx(found.deviations[key], rel=0.15)
    if len(keys_of(law)) > 1:
        scores = np.array([np.log(v) if key == "stribeck_velocity" else v for key, v in drawn.items()])
        deviation = np.sqrt(np.diag(found.covariance))
        wanted = found.covariance / np.outer(deviation, deviation)
        assert np.corrcoef(scores) == pytest.approx(wanted, abs=0.15)


def test_a_file_of_a_tribometer_becomes_a_part_of_a_job_and_a_picture(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = [
        f"50;{1e3 * v:g};{mu:.5f}".replace(".", ",")
        for v, mu in zip(SPEEDS, of_law(Law.STRIBECK), strict=True)
    ]
    (tmp_path / "rig.csv").write_text("\n".join(["Normal force [N];Sliding speed [mm/s];COF", *rows]) + "\n")
    assert main(["friction", "rig.csv"]) == 0
    out = capsys.readouterr().out
    assert "10 points from 1 to 400 mm/s, 1 specimen" in out and "those of the mean law" in out
    assert out.index("stribeck ") < out.index("linear ")
    text = (tmp_path / "friction.toml").read_text()
    assert 'friction_law = "stribeck"' in text
    # what else may be uncertain stands there as a comment, to be taken away
    with_others = re.sub(r"(?m)^# (transverse_damping|friction_memory) = ", r"\1 = ", text)
    job = build_job(tomllib.loads('name = "x"\nmodel = "elastic_belt"\n' + with_others))
    told = [rule.source.uncertain.groups() for rule in job.rules if isinstance(rule.source, Scatter)]
    assert [*told[0]] == ["friction_memory", "transverse_damping", "correlated"]
    assert (tmp_path / "friction.png").stat().st_size > 5000
    assert re.search(r'stribeck_velocity = .*"[\d.]+ mm/s"', (tmp_path / "friction.toml").read_text())
    assert main(["friction", "rig.csv", "--law", "linear"]) == 0
    assert 'friction_law = "linear"' in (tmp_path / "friction.toml").read_text()
    capsys.readouterr()
    assert main(["friction", "rig.csv", "--law", "stribek"]) == 2
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "warning" not in line)
    assert "--law: unknown law that rig.csv determines; did you mean stribeck?" in line


def test_laws_have_dashes_of_their_own_which_a_print_in_grey_keeps_apart(tmp_path):
    rows = [f"{v},{mu}" for v, mu in zip(SPEEDS, of_law(Law.STRIBECK), strict=True)]
    (tmp_path / "rig.csv").write_text("\n".join(["speed [m/s],mu", *rows]))
    points = read_points(tmp_path / "rig.csv")
    measured, *laws = _figure(fit_laws(points), points).axes[0].lines
    assert len({str(line._dash_pattern) for line in laws}) == len(laws) > 3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed [m/s],mu\n0.1,0.1\n0.1,0.11\n0.1,0.12\n", "expected 4 different speeds or more"),
        ("speed [m/s],mu\n0.1,0.1\n-0.1,0.11\n", "line 3: expected a speed of 0 or more"),
        ("speed [m/s],mu\n0.1,0.1\n0.2,0\n", "line 3: expected a coefficient of friction > 0"),
        ("speed [m/s],mu,force [N]\n0.1,0.1,100\n0.2,0.1,-100\n", "line 3: expected a force of 0 or more"),
        ("speed [m/s],load\n0.1,0.1\n", "mu"),
        ("speed [kg],mu\n0.1,0.1\n", "speed"),
    ],
)
def test_what_is_no_measurement_of_friction_is_one_error(text, said, tmp_path):
    (tmp_path / "x.csv").write_text(text)
    with warnings.catch_warnings(), pytest.raises(InputError, match=said):
        warnings.simplefilter("ignore", JobWarning)
        read_points(tmp_path / "x.csv")
