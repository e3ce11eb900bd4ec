"""The table [uncertain] of a job: samples of its distributions in every cell, and what is refused."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from cvt_hpc.analysis.held_job import job_held
from cvt_hpc.errors import InputError, UnitWarning
from cvt_hpc.job import build_job
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.summary import rules_in_words
from cvt_hpc.job.uncertain import Distribution, Uncertain, read_document

NORMAL = {"distribution": "normal", "mean": "20 kN", "standard_deviation": "1 kN"}
LOG_NORMAL = {"distribution": "log_normal", "mean": "2 kg/m", "standard_deviation": "0.5 kg/m"}
CUT = NORMAL | {"from": "19 kN", "to": "21.5 kN"}


def toy(uncertain, *overrides, axes=None, **tables):
    """A job of the toy model over two loads."""
    document = {"name": "x", "model": "toy", "axes": {"load": [0.0, 50.0]} if axes is None else axes}
    return build_job({**document, **tables, "uncertain": uncertain}, "x.toml", overrides)


def column(job, key):
    """Values of a parameter by the number of the sample."""
    return np.array([job.complete({"sample": k})[key] for k in job.axes[-1].values])


@pytest.mark.usefixtures("toy")
class TestSamples:
    @pytest.mark.parametrize(
        ("key", "table", "law"),
        [
            ("thrust", NORMAL, stats.norm(20e3, 1e3)),
            ("thrust", CUT, stats.truncnorm(-1.0, 1.5, 20e3, 1e3)),
            ("thrust", {"distribution": "uniform", "from": "18 kN", "to": "22 kN"}, stats.uniform(18e3, 4e3)),
            (
                "thrust",
                {"distribution": "triangular", "from": 18e3, "mode": 19e3, "to": 22e3},
                stats.triang(0.25, 18e3, 4e3),
            ),
            # of 2 and 0.5: the logarithm has the variance ln(1 + 1/16)
            ("element_mass", LOG_NORMAL, stats.lognorm(np.log(17 / 16) ** 0.5, 0.0, 2.0 / (17 / 16) ** 0.5)),
        ],
        ids=["normal", "cut", "uniform", "triangular", "log_normal"],
    )
    def test_values_have_their_distribution(self, key, table, law):
        thrust = {} if key == "thrust" else {"scene": {"thrust": 20e3}}
        values = column(toy({"samples": 1024, key: table}, **thrust), key)
        # one value in each of 1024 equal parts of the distribution: the point of such a sequence
        assert sorted(np.floor(1024 * law.cdf(values)).astype(int)) == list(range(1024))
        one = read_document(toy({"samples": 2, key: table}, **thrust).rules[-1].source.uncertain.document())
        drawn = one.distributions[0]
        assert drawn.shares(values) == pytest.approx(law.cdf(values), abs=1e-9)
        # weighted, they are those of half the scatter
        weights = np.exp(drawn.halved().log_density(values) - drawn.log_density(values))
        means = np.average([values, values**2], axis=1, weights=weights)
        assert means[0] == pytest.approx(
            law.mean() if table is not CUT else stats.truncnorm(-2, 3, 2e4, 500).mean(), rel=1e-3
        )
        deviation = 0.5 * law.std() if table is not CUT else stats.truncnorm(-2, 3, 2e4, 500).std()
        assert np.sqrt(means[1] - means[0] ** 2) == pytest.approx(deviation, rel=1e-2)

    def test_every_cell_has_the_same_samples_and_the_axes_come_first(self):
        job = toy({"samples": 8, "thrust": NORMAL})
        assert [axis.name for axis in job.axes] == ["load", "sample"]
        assert [job.point(k)["thrust"] for k in range(8)] == [job.point(8 + k)["thrust"] for k in range(8)]
        assert {job.point(8 + k)["load"] for k in range(8)} == {50.0}
        assert job.derived[0].axes == ("sample",)

    def test_twice_the_samples_keep_the_first_half_bit_for_bit(self):
        table = {"thrust": NORMAL, "element_mass": LOG_NORMAL, "seed": 3}
        table["correlation"] = {
            "parameters": ["thrust", "element_mass"],
            "matrix": [[1.0, -0.7], [-0.7, 1.0]],
        }
        few, many = (toy({"samples": n, **table}) for n in (256, 1024))
        for key in ("thrust", "element_mass"):
            assert column(few, key).tobytes() == column(many, key)[:256].tobytes()

    def test_correlation_is_that_of_normal_scores(self):
        matrix = [[1.0, -0.7], [-0.7, 1.0]]
        table = {"samples": 4096, "thrust": NORMAL, "element_mass": LOG_NORMAL}
        job = toy(table | {"correlation": {"parameters": ["element_mass", "thrust"], "matrix": matrix}})
        thrust, mass = column(job, "thrust"), column(job, "element_mass")
        assert np.corrcoef(thrust, np.log(mass))[0, 1] == pytest.approx(-0.7, abs=0.01)
        assert (thrust.mean(), thrust.std()) == pytest.approx((20e3, 1e3), rel=2e-3)
        assert (mass.mean(), mass.std()) == pytest.approx((2.0, 0.5), rel=5e-3)

    def test_a_resolved_job_builds_the_same_job(self):
        job = toy({"samples": 8, "seed": 2, "thrust": CUT, "element_mass": LOG_NORMAL})
        again = build_job(json.loads(json.dumps(job.resolved())), "again")
        assert again.fingerprint() == job.fingerprint()
        assert [again.point(k) for k in range(16)] == [job.point(k) for k in range(16)]
        assert toy({"samples": 8, "seed": 3, "thrust": CUT}).fingerprint() != job.fingerprint()

    def test_samples_do_not_depend_on_the_layout_of_the_table(self):
        jobs = [
            toy({"samples": 4, **tables})
            for tables in (
                {"thrust": NORMAL, "element_mass": LOG_NORMAL},
                {"belt": {"element_mass": LOG_NORMAL}, "thrust": NORMAL},
            )
        ]
        assert jobs[0].fingerprint() == jobs[1].fingerprint()
        assert [jobs[0].point(k) for k in range(8)] == [jobs[1].point(k) for k in range(8)]

    def test_for_sobol_indices_each_parameter_is_swapped_alone(self):
        table = {"samples": 8, "indices": True, "thrust": NORMAL, "element_mass": LOG_NORMAL}
        job = toy(table)
        assert [axis.name for axis in job.axes] == ["load", "sample", "swapped"]
        assert job.axes[-1].values == ("none", "all", "element_mass", "thrust")
        found = [
            [job.complete({"sample": 3, "swapped": which})[key] for key in ("element_mass", "thrust")]
            for which in job.axes[-1].values
        ]
        a, b = found[:2]
        assert a[0] != b[0] and a[1] != b[1]
        assert found[2:] == [[b[0], a[1]], [a[0], b[1]]]
        again = build_job(json.loads(json.dumps(job.resolved())), "again")
        assert again.fingerprint() == job.fingerprint() and again.point(21) == job.point(21)
        assert toy(table, "thrust=1e4").axes[-1].values == ("none", "all", "element_mass")
        assert toy(table, "swapped=all").point(3)["thrust"] == b[1]

    def test_correlated_parameters_are_swapped_together_and_are_correlated_in_both_sets(self):
        job = toy(correlated([[1.0, 0.9], [0.9, 1.0]]) | {"indices": True, "samples": 512})
        assert job.axes[-1].values == ("none", "all", "correlated")
        sets = {}
        for which in job.axes[-1].values:
            points = [job.complete({"sample": k, "swapped": which}) for k in range(512)]
            sets[which] = np.array([[point["thrust"], np.log(point["element_mass"])] for point in points])
            assert np.corrcoef(sets[which].T)[0, 1] == pytest.approx(0.9, abs=0.02)
        assert (sets["correlated"] == sets["all"]).all() and (sets["none"] != sets["all"]).all()

    def test_those_that_correlations_connect_are_swapped_together_and_others_alone(self):
        """Of a chain and of a pair, told in any order, and of one that is correlated with none."""
        keys = ["thrust", "load", "element_mass", "kinetic_friction", "static_friction", "driving_speed"]
        matrix = np.eye(6)
        for i, j, share in ((0, 2, 0.5), (2, 5, -0.4), (1, 4, 0.9)):
            matrix[i, j] = matrix[j, i] = share
        drawn = tuple(Distribution(key, "uniform", (("from", 1.0), ("to", 2.0))) for key in sorted(keys))
        uncertain = Uncertain(drawn, 0, tuple(keys), tuple(map(tuple, matrix.tolist())), True)
        chain, pair = ("thrust", "element_mass", "driving_speed"), ("load", "static_friction")
        alone = {"kinetic_friction": ("kinetic_friction",)}
        assert uncertain.groups() == {**alone, "correlated_1": chain, "correlated_2": pair}
        for place, one in enumerate(drawn):
            first, second = (uncertain.value(place, 3, which) for which in ("none", "all"))
            own = {name: uncertain.value(place, 3, name) for name in uncertain.groups()}
            assert first != second
            assert own == {n: second if one.key in keys else first for n, keys in uncertain.groups().items()}

    def test_a_matrix_without_correlations_makes_no_group(self):
        job = toy(correlated([[1.0, 0.0], [0.0, 1.0]]) | {"indices": True})
        assert job.axes[-1].values == ("none", "all", "element_mass", "thrust")

    def test_overrides_take_a_sample_or_a_value(self):
        table = {"samples": 8, "thrust": NORMAL, "element_mass": LOG_NORMAL}
        job = toy(table)
        one = toy(table, "sample=3")
        assert (one.shape, one.point(0)["thrust"]) == ((2,), job.point(3)["thrust"])
        assert build_job(one.resolved(), "again").point(0) == one.point(0)
        assert toy(table, "thrust=19 kN").point(5)["thrust"] == 19e3
        assert toy(table, "thrust=19 kN").shape == (2, 8)
        assert toy(table, "thrust=19 kN", "element_mass=1").shape == (2,)
        assert toy(table, "uncertain.samples=16").shape == (2, 16)
        axes = {"load": {"from": 0, "to": 80, "count": 17}}
        traced = toy({"samples": 8, "thrust": NORMAL}, "thrust=2e4", "design.kind=trace", axes=axes)
        assert (traced.shape, traced.design["kind"]) == ((17,), "trace")
        assert job.point_at({"sample": 3})["element_mass"] == job.point(3)["element_mass"]

    def test_formulas_follow_uncertain_parameters(self):
        job = toy({"samples": 4, "thrust": NORMAL}, derived={"element_mass": "thrust / 1e4"})
        assert job.point(2)["element_mass"] == pytest.approx(job.point(2)["thrust"] / 1e4)

    def test_a_trace_goes_along_other_axes_alone(self):
        load = {"load": {"from": 0, "to": 80, "count": 17}}
        job = toy({"samples": 64, "thrust": NORMAL}, axes=load, design={"kind": "trace"})
        assert job.design["first_spacing"] == {"load": 4}

    def test_adaptive_samples_need_samples_and_no_indices(self):
        table = {"samples": 64, "thrust": NORMAL}
        job = toy(table, design={"kind": "adaptive", "first_samples": 16})
        assert job.design == {"kind": "adaptive", "first_samples": 16, "widest_interval": 0.2}
        again = build_job(json.loads(json.dumps(job.resolved())), "again")
        assert (again.fingerprint(), again.in_rounds) == (job.fingerprint(), True)
        for overrides in (["uncertain.indices=true"], ["sample=3"], ["thrust=2e4"]):
            with pytest.raises(
                InputError, match=r"\[design\] kind: expected samples of \[uncertain\] without"
            ):
                toy(table, "design.kind=adaptive", *overrides)
        with pytest.raises(
            InputError, match=r"first_samples: expected a power of 2 \(the nearest: 32 and 64\)"
        ):
            toy(table, design={"kind": "adaptive", "first_samples": 40})

    def test_a_bare_number_that_is_far_from_usual_draws_a_warning(self):
        with pytest.warns(UnitWarning, match=r"\[uncertain\] driving_speed: 3000 is read as 3000 rad/s"):
            toy(
                {"samples": 4, "driving_speed": NORMAL | {"mean": 3000, "standard_deviation": 1}},
                scene={"thrust": 20e3},
            )

    def test_a_huge_grid_is_checked_at_the_extremes_of_its_samples(self):
        table = {"samples": 16384, "thrust": NORMAL | {"standard_deviation": "4.5 kN", "from": 1.0}}
        with pytest.raises(InputError, match=r"load: expected at most .* N m at this thrust, found 50 N m"):
            toy(table)


PAIR = {"thrust": NORMAL, "element_mass": LOG_NORMAL}


def correlated(matrix, parameters=("thrust", "element_mass")):
    return {"samples": 8, **PAIR, "correlation": {"parameters": [*parameters], "matrix": matrix}}


@pytest.mark.usefixtures("toy")
@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"thrust": NORMAL}, "samples: expected the number of samples, found nothing"),
        ({}, ": expected a parameter with a distribution, or several, found none"),
        ({"samples": 8}, ": expected a parameter with a distribution, or several, found none"),
        ({"samples": 10**8, "thrust": NORMAL}, "samples: expected >= 2 and <= 65536, found 100000000"),
        ({"samples": 100, "thrust": NORMAL}, "the nearest: 64 and 128), found 100"),
        ({"samples": 8, "thrst": NORMAL}, "thrst: unknown key; did you mean thrust in [scene]?"),
        ({"samples": 8, "thrust": 3}, "thrust: expected a distribution, such as"),
        ({"samples": 8, "stations": NORMAL}, "stations: expected a parameter with continuous values"),
        ({"samples": 8, "load_history": NORMAL}, "load_history: expected a parameter with continuous values"),
        ({"samples": 8, "thrust": {"distribution": "norml"}}, 'found "norml"; did you mean normal?'),
        ({"samples": 8, "thrust": NORMAL | {"mode": 1}}, "thrust.mode: unknown key of a normal distribution"),
        (
            {"samples": 8, "thrust": {"distribution": "uniform", "from": 1}},
            "thrust.to: expected a number, which a uniform distribution needs, found nothing",
        ),
        (
            {"samples": 8, "thrust": NORMAL | {"mean": "3 m"}},
            'thrust.mean: expected a value in N (such as "1 N"',
        ),
        ({"samples": 8, "thrust": NORMAL | {"standard_deviation": 0}}, "standard_deviation: expected > 0 N"),
        ({"samples": 8, "thrust": NORMAL | {"from": 3e4, "to": 2e4}}, "thrust: expected from below to"),
        (
            {"samples": 8, "thrust": NORMAL | {"from": "30 kN", "to": "20 kN"}},
            'thrust: expected from below to, found "30 kN" and "20 kN"',
        ),
        ({"samples": 8, "thrust": NORMAL | {"from": 4e4}}, "expected limits between which values are likely"),
        (
            {"samples": 8, "thrust": {"distribution": "triangular", "from": 1, "mode": 3, "to": 2}},
            "thrust.mode: expected a value from `from` to `to`, found 3",
        ),
        (
            {"samples": 1024, "thrust": {"distribution": "uniform", "from": "-1 kN", "to": "3 kN"}},
            "at its end, 25 % of the distribution beyond; limits `from` and `to` cut it off",
        ),
        # 3.1 standard deviations, which none of two samples is beyond, but one of 4096
        (
            {"samples": 2, "thrust": NORMAL | {"mean": "3.1 kN"}},
            'expected > 0 kN, found "-3.02',
        ),
        (correlated([[1.0, 2.0], [2.0, 1.0]]), "matrix: expected a positive definite matrix"),
        (correlated([[1.0, 0.5], [0.4, 1.0]]), "matrix: expected a symmetric matrix, found one that is not"),
        (
            correlated([[1.0, 0.5]]),
            "matrix: expected 2 rows of 2 numbers, one for each parameter, found 1 rows",
        ),
        (correlated([[2.0, 0.5], [0.5, 1.0]]), "matrix: expected 1 on the diagonal"),
        (correlated([[1, 0], [0, 1]], ["thrust", "load"]), "parameters load: unknown uncertain parameter"),
        (correlated([[1, 0], [0, 1]], ["thrust"] * 2), "parameters: expected two or more, each once"),
        (
            {"samples": 8, "thrust": NORMAL, "correlation": [1]},
            "correlation: expected a table with parameters",
        ),
    ],
)
def test_a_bad_table_is_refused_in_one_line(table, text):
    with pytest.raises(InputError) as error:
        toy(table)
    assert str(error.value).startswith("x.toml: [uncertain]")
    assert text in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("toy")
def test_samples_of_the_axes_and_two_sources_of_a_value_are_refused():
    design = {"kind": "sobol", "runs": 8}
    axes = {"load": {"from": 0, "to": 50}}
    with pytest.raises(InputError, match=r"\[uncertain\]: expected a grid or a trace"):
        toy({"samples": 8, "thrust": NORMAL}, axes=axes, design=design)
    with pytest.raises(InputError, match=r"\[uncertain\] thrust: expected one source of its values"):
        toy({"samples": 8, "thrust": NORMAL}, scene={"thrust": 1e4})


@pytest.mark.usefixtures("toy")
def test_per_cent_of_a_mean_and_a_distribution_by_set_are_told():
    friction = {"distribution": "normal", "mean": 0.1, "standard_deviation": "1 %", "from": 0.01}
    document = {"name": "x", "model": "criterion", "axes": {"radial_speed": [0.1, 0.2]}}
    with pytest.warns(UnitWarning, match='standard_deviation: "1 %" is 0.01, no share of the mean'):
        build_job(document | {"uncertain": {"samples": 2, "kinetic_friction": friction}}, "x.toml")
    with pytest.raises(InputError, match="--set thrust: expected one value, or uncertain.thrust for a dist"):
        toy({"samples": 2, "element_mass": LOG_NORMAL}, 'thrust={distribution="uniform", from=1, to=2}')


def test_other_models_of_the_ladder_have_the_samples_too():
    table = {"samples": 4, "kinetic_friction": {"distribution": "uniform", "from": 0.08, "to": 0.1}}
    document = {"name": "x", "model": "elastic_belt", "uncertain": table, "axes": {"load": [20.0, 40.0]}}
    job = build_job(document, "x.toml")
    other = build_job(handed_to(job, "steady_variator", "it answers"), "x.toml")
    assert [other.point(k)["kinetic_friction"] for k in range(8)] == [
        job.point(k)["kinetic_friction"] for k in range(8)
    ]
    table["judged_fraction"] = {"distribution": "uniform", "from": 0.3, "to": 0.5}
    with pytest.raises(InputError, match=r"\[uncertain\] judged_fraction: expected a key of steady_variator"):
        handed_to(build_job(document, "x.toml"), "steady_variator", "it answers")


def test_distributions_are_told_in_the_unit_of_the_job_also_by_what_is_stored(toy):
    job = build_job({"name": "x", "model": "toy", "uncertain": {"samples": 2, "thrust": NORMAL}})
    dataset = xr.Dataset(attrs={"job": json.dumps(job.resolved()), "job_units": json.dumps(dict(job.units))})
    for one in (job, job_held(dataset)):
        ((_, _, words, _),) = rules_in_words(one, one.schema)
        assert words == "normal, mean 20 kN, standard deviation 1 kN"


def test_a_parameter_without_effect_is_refused():
    table = {"samples": 4, "static_friction": {"distribution": "uniform", "from": 1, "to": 2}}
    document = {
        "name": "x",
        "model": "oscillator",
        "friction": {"friction_law": "linear"},
        "uncertain": table,
    }
    expected = "expected a parameter of effect, which it has not with friction_law linear"
    with pytest.raises(InputError, match=expected):
        build_job(document, "x.toml")
