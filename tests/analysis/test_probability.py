"""Probabilities over the samples of uncertain parameters: counts, intervals, onsets, pictures and sentences."""

import json
from zipfile import ZipFile

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_hex
from matplotlib.text import Text
from scipy.stats import binomtest, norm
from scipy.stats import sobol_indices as scipy_indices

import cvt_hpc.accessor  # noqa: F401
from cvt_hpc import open_results, run
from cvt_hpc.analysis.classes import OccurrenceClass
from cvt_hpc.analysis.figures import check_known
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.analysis.probability import probabilities
from cvt_hpc.analysis.probability_drawing import onset_bands_figure, sensitivity_figure
from cvt_hpc.analysis.run_table import tables, write_tables
from cvt_hpc.analysis.sensitivity import onset_axes, onset_scatter
from cvt_hpc.analysis.sobol import sobol_indices
from cvt_hpc.analysis.value_maps import COLOURS, UNSURE, value_map_figure
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.job.uncertain import Distribution, Uncertain
from cvt_hpc.models.oscillator.motion import oscillator, steady_sliding
from cvt_hpc.report import write_report
from cvt_hpc.report.interactive import map_data
from cvt_hpc.report.page import next_steps
from cvt_hpc.study.intervals import interval, look, looks_of
from cvt_hpc.variables import Status, Vibrates
from support.studies import flags

Q, V, U, F, N, S, IRR = OccurrenceClass
VERDICTS = {Q: Vibrates.NO, V: Vibrates.YES, S: Vibrates.SLIPS, IRR: Vibrates.IRREGULAR}
NAMES = {F: Status.FAILED_NUMERICS, N: Status.NOT_RUN}


def study(classes, **axes):
    """Results of these classes over axes and, last, the samples."""
    classes, dims = np.asarray(classes), (*axes, "sample")
    kinds = [OccurrenceClass(kind) for kind in classes.ravel()]
    status = np.reshape([NAMES.get(kind, Status.DONE) for kind in kinds], classes.shape)
    vibrates = np.reshape([VERDICTS.get(kind, Vibrates.UNDECIDED) for kind in kinds], classes.shape)
    amplitude = np.where(classes == V, 1e-6 * (1.0 + np.arange(classes.shape[-1])), np.nan)
    damping = xr.DataArray(np.arange(classes.shape[-1]) / 10.0, dims="sample")
    return xr.Dataset(
        {
            "status": flags(status, dims, Status, "status"),
            "vibrates": flags(vibrates, dims, Vibrates, "vibrates"),
            "amplitude": (dims, amplitude, {"units": "m"}),
        },
        {
            **{
                name: (name, list(values), {"units": "N m" if name == "load" else "N"})
                for name, values in axes.items()
            },
            "sample": np.arange(classes.shape[-1]),
            "damping": damping.assign_attrs(units="N s m-1", derived="normal, mean 0.5 N s/m"),
        },
        {"job_name": "made"},
    )


def test_what_is_not_decided_counts_on_neither_side_and_widens_the_interval():
    runs = [V] * 6 + [Q] * 5 + [S] * 2 + [U] * 3 + [IRR, F, N]
    found = study([runs, [Q] * 19, [U] * 19, [N] * 19], load=[1.0, 2.0, 3.0, 4.0]).cvt.probability()
    assert found["samples"].values.tolist() == [18, 19, 19, 0]
    assert found["undecided_samples"].values.tolist() == [5, 0, 19, 0]
    one = found.isel(load=0)
    assert one["vibration_probability"] == pytest.approx(6 / 13)
    assert one["slip_probability"] == pytest.approx(2 / 13)
    assert one["failure_probability"] == pytest.approx(1 / 18)
    for event, count, hidden in (("vibration", 6, 5), ("slip", 2, 5), ("failure", 1, 0)):
        low = binomtest(count, 18).proportion_ci(method="exact").low
        high = binomtest(count + hidden, 18).proportion_ci(method="exact").high
        assert one[f"{event}_probability_low"] == pytest.approx(low)
        assert one[f"{event}_probability_high"] == pytest.approx(high)
    assert found["vibration_probability"].values[1:] == pytest.approx([0.0, np.nan, np.nan], nan_ok=True)
    assert found["vibration_probability_high"].values[1:] == pytest.approx([1 - 0.025 ** (1 / 19), 1.0, 1.0])
    # of the samples that vibrate: 1 to 6 um
    assert one["amplitude_quantiles"].values == pytest.approx([1e-6, 3e-6, 6e-6])
    assert np.isnan(found["amplitude_quantiles"].values[:, 1:]).all()


def onset_job(seed, loads, samples, **further):
    """The oscillator with a normal damping over its normal load."""
    friction = {"friction_law": "stribeck", "kinetic_friction": 2.0, "stribeck_velocity": 0.1}
    return build_job(
        {
            "name": "onset",
            "model": "oscillator",
            "axes": {"normal_load": list(loads)},
            "friction": friction | ({} if further else {"friction_gradient": -40.0}),
            "uncertain": {
                "samples": samples,
                "seed": seed,
                "damping": {"distribution": "normal", "mean": 5.9, "standard_deviation": 0.6},
                **further,
            },
        }
    )


# at 0.2 m/s friction falls by exp(-2) of its steepest fall; steady sliding is unstable where the damping is less than
# that times the normal load
SLOPE = 40.0 * np.exp(-2.0)
LOADS = np.array([0.95, 1.1, 1.2])
GRADIENT = {"distribution": "normal", "mean": -40.0, "standard_deviation": 3.0}
CORRELATION = {"parameters": ["damping", "friction_gradient"], "matrix": [[1.0, 0.5], [0.5, 1.0]]}


def stability(job):
    """Results of the job's cells by the stability of steady sliding, as the model has it."""
    points = (job.point(index) for index in range(job.size))
    growth = np.array([steady_sliding(oscillator(point)).eigenvalue.real for point in points])
    return study(np.where(growth > 0.0, V, Q).reshape(job.shape), normal_load=job.axes[0].values)


@pytest.mark.slow
def test_the_interval_holds_the_probability_of_the_closed_form():
    further = {"friction_gradient": GRADIENT, "correlation": CORRELATION}
    # damping and weighted gradient, both normal, add to less than nothing
    weight = LOADS * np.exp(-2.0)
    spread = np.sqrt(0.6**2 + (3.0 * weight) ** 2 + 2 * 0.5 * 0.6 * 3.0 * weight)
    true = norm.cdf((40.0 * weight - 5.9) / spread)
    held, errors = np.zeros(LOADS.size), []
    for seed in range(40):
        found = probabilities(stability(onset_job(seed, LOADS, 16, **further)))
        low, high = (found[f"vibration_probability_{end}"].values for end in ("low", "high"))
        held += (low <= true) & (true <= high)
        errors.append(found["vibration_probability"].values - true)
    assert (held == 40).all()
    independent = np.sqrt(true * (1.0 - true) / 16.0)
    assert (np.sqrt(np.mean(np.square(errors), axis=0)) < 0.5 * independent).all()


@pytest.mark.parametrize("samples", [32, 64, 128])
def test_twice_the_samples_hold_the_probability_as_often(samples):
    true, held = np.array([0.02, 0.1, 0.3, 0.5]), np.zeros(4)
    for seed in range(100):
        scores = sums_of_two(seed, samples)
        hits = np.less.outer(norm.ppf(true), scores).sum(axis=-1)
        low, high = interval(hits, np.full(true.size, samples))
        held += (low <= 1.0 - true) & (1.0 - true <= high)
    assert (held >= 95).all()


def sums_of_two(seed, samples):
    """Samples of the sum of two normal parameters, of standard deviation 1."""
    normals = [Distribution(key, "normal", (("mean", 0.0), ("standard_deviation", 1.0))) for key in "ab"]
    drawn = Uncertain(tuple(normals), seed)
    scores = [[drawn.value(place, k) for k in range(samples)] for place in (0, 1)]
    return np.sum(scores, axis=0) / np.sqrt(2.0)


def test_runs_of_the_samples_have_the_verdicts_of_the_closed_form(tmp_path):
    loads = np.array([250.0, 300.0, 350.0])
    damping = {"distribution": "normal", "mean": 55.0, "standard_deviation": 6.0}
    document = {
        "scene": {"belt_speed": "50 mm/s", "start": "sliding", "initial_displacement": "4 um"},
        "oscillator": {"stiffness": "10 kN/mm"},
        "friction": {"friction_law": "stribeck", "friction_gradient": -0.5, "stribeck_velocity": "50 mm/s"},
        "run": {"duration": "1 s"},
        "uncertain": {"samples": 16, "damping": damping},
    }
    axes = {"normal_load": loads.tolist()}
    run(build_job({"name": "onset", "model": "oscillator", "axes": axes, **document}), tmp_path)
    found = open_results(tmp_path)
    border = 0.5 * np.exp(-1.0) * loads  # of the damping, below which steady sliding is unstable
    share = found["damping"].values / border[:, None]
    beside = np.abs(share - 1.0) < 0.01  # the start is small, yet no infinitely small motion
    assert beside.sum() < 5
    assert ((found["vibrates"].values == np.where(share < 1.0, Vibrates.YES, Vibrates.NO)) | beside).all()
    told, true = found.cvt.probability(), norm.cdf((border - 55.0) / 6.0)
    assert (np.abs(told["vibration_probability"].values - true) < 2.0 / 16).all()


@pytest.mark.parametrize("of_sobol", [True, False])
def test_intervals_hold_also_where_cells_stop_by_what_they_find(of_sobol):
    design = {"first_samples": 16, "widest_interval": 0.3}
    true, repeats = np.array([0.02, 0.1, 0.3, 0.5]), 300
    held, first = np.zeros(true.size), np.zeros(true.size)
    for seed in range(repeats):
        if of_sobol:
            vibrates = np.less.outer(norm.ppf(true), sums_of_two(seed, 256))
        else:
            vibrates = np.random.default_rng(seed).random((true.size, 256)) < true[:, np.newaxis]
        classes = np.where(vibrates, V, Q).astype(np.int8)
        counted, wanted = look(classes, design)
        assert (counted == wanted).all()
        hits = np.array([row[:size].sum() for row, size in zip(vibrates, counted, strict=True)])
        low, high = interval(hits, counted, looks=5)
        assert ((high - low <= 0.3) | (counted == 256)).all()
        right = 1.0 - true if of_sobol else true
        held += (low <= right) & (right <= high)
        first += counted
    assert (held >= 0.95 * repeats).all()
    assert (np.diff(first) > 0.0).all()  # the less certain a cell is, the more samples it has


def test_a_cell_wants_no_further_sample_before_the_last_look_has_ended_nor_in_vain():
    design = {"first_samples": 4, "widest_interval": 0.4}
    assert looks_of(design, 16) == [4, 8, 16] and looks_of({}, 16) == [16]
    mixed = [V, Q, V, Q, Q, V, V, Q]
    rows = [[*mixed[:3], *[N] * 13], [*mixed[:4], *[N] * 12], [*mixed, *[N] * 8], [*mixed, *mixed], [U] * 16]
    found = look(np.array(rows, np.int8), design)
    assert found.counted.tolist() == [0, 4, 8, 16, 8]
    assert found.wanted.tolist() == [4, 8, 16, 16, 8]  # of the last one no sample ends with a verdict
    dataset = study(rows, load=np.arange(5.0)).assign_attrs(job=json.dumps({"design": design}))
    told = dataset.cvt.probability()
    assert told["samples"].values.tolist() == [0, 4, 8, 16, 8]
    low, high = interval(8, 16, looks=3)
    assert told["vibration_probability_low"][3] == low < interval(8, 16)[0]
    assert told["vibration_probability_high"][3] == high
    assert "5 cells of 0 to 16 samples" in told.attrs["counted"]


def test_one_uncertain_parameter_has_a_sample_in_each_part_of_its_distribution():
    found = probabilities(stability(onset_job(1, LOADS, samples=64)))
    true = norm.cdf((SLOPE * LOADS - 5.9) / 0.6)
    assert found["vibration_probability"].values == pytest.approx(true, abs=1 / 64)


@pytest.mark.slow
def test_sobol_indices_are_those_of_the_ishigami_function():
    size = 8192
    flat = {"distribution": "uniform", "from": -np.pi, "to": np.pi}
    keys = ("preload", "initial_displacement", "initial_speed")
    table = {"samples": size, "seed": 2, "indices": True, **dict.fromkeys(keys, flat)}
    job = build_job({"name": "x", "model": "oscillator", "uncertain": table})
    places = [{"sample": k, "swapped": which} for k in range(size) for which in job.axes[1].values]
    rules = {rule.key: rule for rule in job.rules}
    x, y, z = np.array([[rules[key].source.value(place) for place in places] for key in sorted(keys)])
    values = (np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)).reshape(size, 5)
    axes = {"sample": np.arange(size), "swapped": [*job.axes[1].values]}
    found = sobol_indices(xr.DataArray(values, axes, ["sample", "swapped"]))
    assert found["parameter"].values.tolist() == sorted(keys)
    assert found["first_order"].values == pytest.approx([0.3139, 0.4424, 0.0], abs=0.01)
    assert found["total_order"].values == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.01)
    scores = values.T
    given = {"f_A": scores[:1], "f_B": scores[1:2], "f_AB": scores[2:, None]}
    other = scipy_indices(func=given, n=size)
    assert found["first_order"].values == pytest.approx(other.first_order.ravel(), abs=1e-12)
    assert found["total_order"].values == pytest.approx(other.total_order.ravel(), abs=1e-12)
    for order in ("first_order", "total_order"):
        low, high = found[f"{order}_low"], found[f"{order}_high"]
        assert ((low <= found[order]) & (found[order] <= high)).all()
        assert (high - low).max() < 0.1


def test_probabilities_rest_on_both_sets_of_samples_and_not_on_those_between(tmp_path):
    # the first set vibrates, and of the second what has its damping; the mass is of no effect
    classes = np.array([[V] * 8, [V] * 4 + [Q] * 4, [V] * 4 + [Q] * 4, [V] * 8])
    dataset = xr.concat([study(row[np.newaxis], load=[1.0]) for row in classes], "swapped")
    dataset = dataset.assign_coords(swapped=["none", "all", "damping", "mass"])
    found = dataset.cvt.probability()
    assert found["samples"].item() == 16
    assert found["vibration_probability"].item() == 12 / 16
    assert found["total_order"].values[0] == pytest.approx([4 / 8 / 2 / (12 / 16 * 4 / 16), 0.0])
    # one of eight samples without a verdict is too many
    unknown = dataset.copy(deep=True)
    unknown["vibrates"][3, 0, 0] = Vibrates.UNDECIDED
    assert np.isnan(unknown.cvt.indices()["total_order"]).all()
    with pytest.raises(
        InputError, match="total_order, found none; less than 90 % of the samples count, or all"
    ):
        check_known(unknown.cvt.indices(), ["total_order"], "results")
    assert dataset.cvt.indices("amplitude")["total_order"].shape == (1, 2)
    with pytest.raises(InputError, match="unknown variable; did you mean amplitude"):
        dataset.cvt.indices("amplitud")
    with pytest.raises(InputError, match="expected results of a job with `indices = true`"):
        dataset.isel(swapped=0).cvt.indices()
    text = write_report(dataset, tmp_path / "report.html").read_text().replace("\u00a0", " ")
    assert "Total Sobol indices where vibration is least certain, at load 1 N m: damping 1.33 (" in text
    both = xr.concat([unknown, dataset.assign_coords(load=[2.0])], "load", data_vars="minimal")
    text = write_report(both, tmp_path / "report.html").read_text().replace("\u00a0", " ")
    told = "Total Sobol indices of 1 of 2 cells, where vibration is least certain among these, at load 2 N m"
    assert told in text
    dataset["vibrates"][:] = Vibrates.UNDECIDED
    assert "Total Sobol" not in write_report(dataset, tmp_path / "report.html").read_text()
    assert "occurrence" in words(map_figure(dataset, {"swapped": "none"}))


def linear_onset(samples, along, **uncertain):
    """Results of which vibration sets in at 1 + 2 damping + preload / 10, by the samples of a job."""
    table = {"samples": samples, "seed": 3, **uncertain}
    job = build_job({"name": "x", "model": "oscillator", "uncertain": table})
    points = [job.point(index) for index in range(job.size)]
    keys = ["damping", "preload", *(key for key in ("mass", "stiffness") if key in uncertain)]
    values = {key: np.reshape([point[key] for point in points], job.shape) for key in keys}
    sets_in = 1.0 + 2.0 * values["damping"] + values["preload"] / 10.0
    classes = np.where(np.greater_equal.outer(along, sets_in), V, Q)
    parts = [
        study(part, load=along) for part in np.moveaxis(np.reshape(classes, (len(along), samples, -1)), -1, 0)
    ]
    if "indices" not in table:
        dataset, dims = parts[0], ["sample"]
    else:
        dataset = xr.concat(parts, "swapped").assign_coords(swapped=[*job.axes[1].values])
        dims = ["sample", "swapped"]
    dataset = dataset.assign_coords({key: (dims, one) for key, one in values.items()})
    return dataset.assign_attrs(job=json.dumps(job.resolved()))


def normal(mean, deviation):
    return {"distribution": "normal", "mean": mean, "standard_deviation": deviation}


STEPS = np.arange(5.0, 26.0)
WIDE = 2.0 * norm.ppf(0.95)


def test_quantiles_of_the_onset_are_those_of_the_closed_form():
    loads = np.arange(0.92, 1.4, 0.02)
    found = onset_scatter(stability(onset_job(1, loads, samples=128)), "normal_load")["onset"]
    exact = (5.9 + 0.6 * norm.ppf([0.05, 0.5, 0.95])) / SLOPE
    assert exact[0] < 0.92 and found[0] == -np.inf
    # a 128th of the distribution, where a step of the grid is 0.02
    assert found.values[1:] == pytest.approx(exact[1:], abs=0.6 / SLOPE / 128 / norm.pdf(1.645))


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_half_the_scatter_of_a_parameter_narrows_the_onset_as_in_the_closed_form(correlation):
    further = {"damping": normal(5.0, 0.75), "preload": normal(40.0, 20.0)}
    if correlation:
        matrix = [[1.0, correlation], [correlation, 1.0]]
        further["correlation"] = {"parameters": ["damping", "preload"], "matrix": matrix}
    found = linear_onset(1024, STEPS, **further).cvt.onset_scatter()
    # the onset has the standard deviations 1.5 and 2 by the two parameters
    exact = WIDE * np.sqrt(1.5**2 + 2.0**2 + 2 * correlation * 1.5 * 2.0)
    assert found["band"].item() == pytest.approx(exact, rel=0.02)
    halved = WIDE * np.sqrt([0.75**2 + 2.0**2, 1.5**2 + 1.0]) if not correlation else [0.5 * exact]
    assert found["parameter"].values.tolist() == (["correlated"] if correlation else ["damping", "preload"])
    assert found["halved_band"].values == pytest.approx(halved, rel=0.03)
    assert ((found["halved_band_low"] < halved) & (halved < found["halved_band_high"])).all()
    left = (np.sqrt(7.0) / 4.0) ** (2 if correlation else 1)
    assert found["effective_samples"].values == pytest.approx(1024 * left, rel=0.02)
    assert found["halved_onset"].values[1] == pytest.approx(15.0, abs=0.1)


def test_groups_of_correlated_parameters_are_halved_each_for_itself():
    """Each of two parameters with one on which the onset does not depend: as in the closed form without it."""
    keys, matrix = ["mass", "damping", "preload", "stiffness"], np.eye(4)
    matrix[0, 1] = matrix[1, 0] = 0.6
    matrix[2, 3] = matrix[3, 2] = -0.5
    further = {"damping": normal(5.0, 0.75), "preload": normal(40.0, 20.0)}
    further |= {"mass": normal(1.0, 0.02), "stiffness": normal(100.0, 1.0)}
    further["correlation"] = {"parameters": keys, "matrix": matrix.tolist()}
    dataset = linear_onset(2048, STEPS, **further)
    found = dataset.cvt.onset_scatter()
    assert found["parameter"].values.tolist() == ["correlated_1", "correlated_2"]
    assert found["halved_band"].values == pytest.approx(
        WIDE * np.sqrt([0.75**2 + 2.0**2, 1.5**2 + 1.0]), rel=0.03
    )
    assert found["effective_samples"].values == pytest.approx(2048 * 7.0 / 16.0, rel=0.03)
    assert "mass,\ndamping" in words(sensitivity_figure(dataset))


def test_the_picture_names_correlated_parameters_and_says_where_nothing_vibrates():
    further = {"damping": normal(5.0, 0.75), "preload": normal(40.0, 20.0)}
    further["correlation"] = {"parameters": ["damping", "preload"], "matrix": [[1.0, 0.6], [0.6, 1.0]]}
    dataset = linear_onset(32, STEPS, **further)
    assert "damping,\npreload" in words(sensitivity_figure(dataset))
    quiet = dataset.assign(vibrates=xr.full_like(dataset["vibrates"], int(Vibrates.NO)))
    assert "hardly any sample vibrates" in words(sensitivity_figure(quiet))
    assert "hardly any" not in words(sensitivity_figure(dataset))


@pytest.mark.usefixtures("undrawn")
def test_a_band_of_less_than_two_steps_is_not_said_to_shrink(tmp_path):
    further = {"damping": normal(5.0, 0.75), "preload": normal(40.0, 20.0)}
    dataset = linear_onset(64, np.arange(5.0, 26.0, 5.0), **further)
    found = dataset.cvt.onset_scatter()
    assert found["step"] == 5.0 and found["band"] < 10.0
    text = report(dataset, tmp_path)
    known = "known no better than the step of 5 N m: take a finer axis"
    assert f"within {found['band'].item():.3g} N m, {known}." in text and "Halve" not in text
    assert known in words(sensitivity_figure(dataset))
    assert known not in words(sensitivity_figure(linear_onset(64, STEPS, **further)))


@pytest.mark.usefixtures("undrawn")
def test_the_report_names_the_parameter_that_decides_as_far_as_the_bounds_tell(tmp_path):
    steps = np.arange(5.0, 26.0, 0.5)
    decides = "Preload decides; damping hardly matters."
    further = {"damping": normal(5.0, 0.1), "preload": normal(40.0, 20.0)}
    text = report(linear_onset(256, steps, **further), tmp_path)
    assert decides in text and "Halve the scatter of preload, and this band shrinks from" in text
    told = "Halve the scatter of damping, and it is not certain that this band changes: "
    assert told in text and "grows" not in text
    dataset = linear_onset(256, steps, **further, indices=True)
    text = report(dataset, tmp_path)
    assert "Total Sobol indices of the onset in load: preload " in text and decides in text
    # without verdicts in more than a tenth of the samples those of the onset are left
    few = dataset["sample"] % 8 > 0
    beside = dataset.assign(vibrates=dataset["vibrates"].where(few, int(Vibrates.UNDECIDED)))
    text = report(beside, tmp_path)
    assert "No cell has Sobol indices of vibration: nine of ten samples need verdicts" in text
    alike = {"damping": normal(5.0, 0.75), "preload": normal(40.0, 15.0)}
    text = report(linear_onset(64, steps, **alike), tmp_path)
    assert "more samples would tell whether" in text and "decides" not in text


@pytest.mark.usefixtures("undrawn")
def test_the_onset_lies_along_the_axis_on_which_verdicts_change(tmp_path):
    within = np.add.outer(np.arange(40), np.zeros((3, 8))) - np.arange(8)
    runs = np.where((within > 10) & (within < 25), V, Q)
    dataset = study(runs, radial_speed=np.arange(40.0), contact_force=[1.0, 2.0, 3.0])
    assert onset_axes(dataset) == ["radial_speed", "contact_force"]
    assert onset_axes(dataset, ["radial_speed"]) == ["contact_force"]
    told = words(onset_bands_figure(dataset))
    assert "onset in radial speed" in told and "along another axis: --along contact_force" in told
    assert "another axis" not in words(onset_bands_figure(dataset, along="radial_speed"))
    text = report(dataset, tmp_path)
    assert text.count("the probability of vibration passes 10 % at") == 3
    assert "falls below 90 % at 0.0248 kN, 50 % at 0.028 kN, 10 % at 0.0312 kN of radial speed" in text
    runs[:, 0] = Q
    text = report(study(runs, radial_speed=np.arange(40.0), contact_force=[1.0, 2.0, 3.0]), tmp_path)
    assert "No sample is known to vibrate in 1 of 3 lines along radial speed." in text


@pytest.mark.usefixtures("undrawn")
def test_the_report_names_what_is_hardly_known_and_the_largest_probability_that_is_known_best(tmp_path):
    # of the second load one sample of 16 has a verdict
    rows = [[Q] * 16, [V] + [U] * 15, [V] * 14 + [U] * 2, [V] * 16]
    text = report(study(rows, load=[10.0, 20.0, 30.0, 40.0]), tmp_path)
    assert "50 % at 15 N m" in text and "largest at 40 N m: 100 % (79.4 to 100 %)" in text
    assert "; hardly known, with intervals wider than 0.5, at 20 N m." in text
    assert "hardly known" not in report(study(rows[::3], load=[10.0, 40.0]), tmp_path)


def report(dataset, folder):
    """The text of its page."""
    return write_report(dataset, folder / "report.html").read_text().replace("\u00a0", " ")


def test_samples_that_are_not_run_make_no_band_surer():
    whole = linear_onset(256, STEPS, damping=normal(5.0, 0.75), preload=normal(40.0, 20.0))
    part = whole.isel(sample=slice(32))
    few = whole.assign(status=whole["status"].where(whole["sample"] < 32, int(Status.NOT_RUN)))
    found, expected = few.cvt.onset_scatter(), part.cvt.onset_scatter()
    for name in ("onset", "band", "halved_band", "effective_samples"):
        assert found[name].values == pytest.approx(expected[name].values), name
    assert found["effective_samples"].max() < 32


def test_of_an_adaptive_study_the_report_tells_the_runs_that_its_cells_want():
    design = {"kind": "adaptive", "first_samples": 32, "widest_interval": 0.2}
    uncertain = {"samples": 128, "damping": normal(5.0, 0.75)}
    job = build_job({"name": "x", "model": "oscillator", "uncertain": uncertain, "design": design})
    # the first has 30 of its 32, the second 48 of 64 since it is not known well enough, the third more than it wants
    cells = [[Q] * 30 + [N] * 98, [Q, V] * 24 + [N] * 80, [Q] * 64 + [N] * 64]
    found = study(cells, load=[1.0, 2.0, 3.0])
    assert look(np.array(cells, np.int8), design).wanted.tolist() == [32, 64, 32]
    steps = list(next_steps(found, job, None))
    assert "`cvt-hpc run JOB` goes on: 18 runs are left." in steps
    assert "goes on" not in " ".join(next_steps(found.isel(load=[2]), job, None))
    # more samples serve cells that have all of them, and no cell of which too many samples have no verdict
    cells = [[Q] * 32 + [N] * 96, [U] * 32 + [N] * 96, [Q] * 90 + [U] * 38]
    told = " ".join(next_steps(study(cells, load=[1.0, 2.0, 3.0]), job, None))
    assert "In 2 cells more than 20 % of the samples have no verdict: no further samples narrow" in told
    assert "uncertain.samples" not in told
    cells[2] = [Q, V] * 64
    assert "uncertain.samples=256" in " ".join(next_steps(study(cells, load=[1.0, 2.0, 3.0]), job, None))


def test_a_band_that_ends_beyond_the_axis_has_no_width():
    found = linear_onset(64, np.arange(5.0, 16.0), damping=normal(5.0, 0.75), preload=normal(40.0, 20.0))
    assert (
        np.isinf(found.cvt.onset_scatter()["band"])
        and np.isinf(found.cvt.onset_scatter()["halved_band"]).all()
    )
    assert "halved_band" not in found.drop_attrs().cvt.onset_scatter()


def test_indices_of_the_onset_are_shares_of_its_variance_and_rows_pool_their_cells():
    further = {"indices": True, "damping": normal(5.0, 0.75), "preload": normal(40.0, 20.0)}
    dataset = linear_onset(512, STEPS, **further)
    found = dataset.cvt.indices("onset", "load")
    shares = np.array([1.5**2, 2.0**2]) / 6.25
    # of a sum of independent parameters both orders are alike
    assert found["first_order"].values == pytest.approx(shares, abs=0.03)
    assert found["total_order"].values == pytest.approx(shares, abs=0.03)
    row, cells = dataset.cvt.indices(along="load"), dataset.cvt.indices()
    assert cells["load"].equals(dataset["load"]) and "load" not in row.coords
    both = dataset["vibrates"].sel(swapped=["none", "all"]) == Vibrates.YES
    variance = both.astype(float).var(["sample", "swapped"])
    pooled = (cells["total_order"] * variance).sum("load") / variance.sum()
    # where A and B are alike in a cell it has no index of its own, and counts in the row
    assert row["total_order"].values == pytest.approx(pooled.values, abs=2e-3)
    for dataset_ in (found, row):
        assert (dataset_["total_order_low"] <= dataset_["total_order"]).all()
    matrix = [[1.0, 0.6], [0.6, 1.0]]
    further["correlation"] = {"parameters": ["damping", "preload"], "matrix": matrix}
    found = linear_onset(64, STEPS, **further).cvt.indices("onset", "load")
    assert found["parameter"].values.tolist() == ["correlated"]
    assert found["total_order"].values == pytest.approx([1.0], abs=0.15)
    with pytest.raises(InputError, match="along: expected one of the axes load, found thrust"):
        dataset.cvt.indices("onset", "thrust")


def test_an_onset_beyond_the_axis_is_infinite_and_one_without_verdicts_does_not_count():
    runs = [[V, V], [Q, Q], [Q, V], [U, U], [U, V]]
    dataset = study(np.transpose(runs), load=[1.0, 2.0])
    found = dataset.cvt.onset_scatter()["onset"]
    assert found.values.tolist() == [-np.inf, -np.inf, np.inf]  # of -inf, inf, 1.5, none, -inf
    assert found["quantile"].values.tolist() == ["5 %", "50 %", "95 %"]


@pytest.fixture
def two_axes():
    """Probabilities that rise along the load and with the thrust."""
    order = np.add.outer(np.arange(4), np.arange(8))[..., np.newaxis] - np.arange(8) / 2
    classes = np.where(order > 5, V, Q)
    classes[0, 0, 0], classes[3, 7, :2] = U, S
    return study(classes, thrust=[1e3, 2e3, 3e3, 4e3], load=np.arange(8) * 10.0)


def words(figure):
    return " ".join(text.get_text() for text in figure.findobj(Text))


def test_a_map_has_contours_and_says_how_wide_intervals_are(two_axes):
    figure = map_figure(two_axes)
    told = words(figure)
    assert "made: 32 cells of 8 samples; 95 % intervals up to" in told
    assert "probability of vibration" in told
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "interval wider than 0.5",
        *(f"probability {share}" for share in (0.1, 0.5, 0.9)),
    ]
    # the middle line lies where as many samples vibrate as do not
    lines = next(one for one in figure.axes[0].collections if hasattr(one, "levels"))
    assert list(lines.levels) == [0.1, 0.5, 0.9]
    assert len({str(style) for style in lines.get_linestyle()}) == 3
    place = min(lines.allsegs[1][0], key=lambda point: abs(point[1] - 2.0))
    shares = probabilities(two_axes)["vibration_probability"].sel(thrust=2e3)
    assert np.interp(place[0], shares["load"], shares) == pytest.approx(0.5)
    assert "slip" in words(value_map_figure(two_axes, ["slip_probability"]))
    assert "Vibration occurrence" in words(map_figure(two_axes, {"sample": 0}))
    assert "probability" in words(map_figure(two_axes.cvt.probability()))


def test_cells_that_are_hardly_known_are_hatched_and_those_without_a_value_say_why():
    # of the first cell 7 of 64 samples are quiet, and all others without a verdict
    rows = np.array([[[Q] * 7 + [U] * 57, [Q] * 64], [[Q, V] * 32, [U] * 64]])
    dataset = study(rows, thrust=[1.0, 2.0], load=[1.0, 2.0])
    figure = map_figure(dataset)
    (hatched,) = [patch for patch in figure.axes[0].patches if patch.get_hatch() == UNSURE]
    assert hatched.get_path().get_extents().bounds == pytest.approx((0.5, 0.5e-3, 1.0, 1e-3))
    told = words(figure)
    assert "interval wider than 0.5" in told and "no sample has a verdict" in told
    assert UNSURE not in {patch.get_hatch() for patch in map_figure(dataset[{"load": [1]}]).axes[0].patches}
    classes = np.array([[V] * 8, [V] * 4 + [Q] * 4, [V] * 4 + [Q] * 4, [V] * 8])
    parts = [study([[row, row], [[Q] * 8] * 2], thrust=[1.0, 2.0], load=[1.0, 2.0]) for row in classes]
    both = xr.concat(parts, "swapped").assign_coords(swapped=["none", "all", "damping", "friction_memory"])
    told = words(value_map_figure(both, ["total_order"]))
    assert "friction memory" in told and "intervals up to" not in told
    assert "less than 90 % of the samples count, or all are alike" in told
    assert "no sample vibrates" in words(value_map_figure(both, ["amplitude_quantiles"]))


def test_over_one_axis_the_interval_is_a_band_and_onsets_have_one_over_another(two_axes):
    figure = map_figure(two_axes.sel(thrust=2e3))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["95 % interval", "of the samples"]
    (band,) = figure.axes[0].collections
    high = probabilities(two_axes)["vibration_probability_high"].sel(thrust=2e3)
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(high.max().item())
    figure = onset_bands_figure(two_axes)
    quantiles = onset_scatter(two_axes, "load")["onset"]
    median = figure.axes[0].lines[0].get_ydata()
    assert median == pytest.approx(np.where(np.isinf(quantiles[1]), np.nan, quantiles[1]), nan_ok=True)
    with pytest.raises(InputError, match="over samples, load with numbers, and a further axis, such as"):
        onset_bands_figure(two_axes.isel(thrust=0))
    with pytest.raises(InputError, match="expected results with the axis sample"):
        two_axes.isel(sample=0).cvt.probability()
    with pytest.raises(InputError, match="along: expected one of the axes thrust, load, found sample"):
        two_axes.cvt.onset_scatter("sample")


def test_a_table_has_a_row_for_each_cell_beside_that_for_each_run(two_axes, tmp_path):
    frames = tables(two_axes)
    assert [len(frame) for frame in frames.values()] == [256, 32]
    one = frames["cells"].iloc[15]
    told = probabilities(two_axes).isel(thrust=1, load=7)
    assert (one["thrust [N]"], one["load [N m]"]) == (2e3, 70.0)
    assert one["vibration_probability"] == told["vibration_probability"] and "class" not in frames["cells"]
    assert one["amplitude_quantiles_95 % [m]"] == told["amplitude_quantiles"].values[-1]
    written = write_tables(frames, tmp_path / "table.csv")
    assert [path.name for path in written] == ["table.csv", "table_cells.csv"]
    assert [len(path.read_text().splitlines()) for path in written] == [257, 33]
    (sheets,) = write_tables(frames, tmp_path / "table.xlsx")
    assert "xl/worksheets/sheet2.xml" in ZipFile(sheets).namelist()
    assert [*tables(two_axes.isel(sample=0))] == ["runs"]


@pytest.fixture
def undrawn(monkeypatch):
    """Pages have places for their pictures alone."""
    monkeypatch.setattr("cvt_hpc.report.page._encoded", lambda compose: "AA==")


@pytest.mark.usefixtures("undrawn")
def test_the_report_says_how_sure_the_map_is(two_axes, tmp_path):
    text = write_report(two_axes, tmp_path / "report.html").read_text().replace("\u00a0", " ")
    assert "32 cells of 8 samples, with 95 % intervals up to" in text
    assert "Uncertain: damping (normal, mean 0.5 N s/m)." in text
    assert "At thrust 3 kN the probability of vibration passes 10 % at" in text
    assert "In 1 more line along load samples vibrate." in text
    assert "The belt slips with a probability of up to 25 %, at thrust 4 kN and load 70 N m." in text
    assert "--set uncertain.samples=16</code> narrows the intervals" in text
    assert "along sample" not in text
    assert text.count('alt="onset of vibration"') == 1
    # within the two printed pages to hand on
    assert 'class="whole several"' in text
    assert text.index('class="front"') < text.index('alt="onset of vibration"') < text.index("<h2>Next steps")
    colours = map_data(probabilities(two_axes))["others"]
    assert [colour for _, colour in colours] == [to_hex(COLOURS(k)) for k in range(24)]  # as in print


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("indices", [False, True])
def test_what_the_onset_depends_on_is_drawn_and_told(indices, tmp_path):
    further = {"damping": normal(5.0, 0.75), "preload": normal(40.0, 20.0)}
    dataset = linear_onset(64, STEPS, **further, **({"indices": True} if indices else {}))
    dataset = dataset.assign_attrs(job_name="made")
    found, figure = dataset.cvt.onset_scatter(), sensitivity_figure(dataset)
    told = words(figure)
    assert "What the onset in load depends on: made" in told
    assert ("Sobol index" in told, len(figure.axes)) == (indices, 2 + indices)
    # the longer bar above: preload moves the onset by twice its standard deviation more than damping does
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == ["damping", "preload"]
    low, high = found["quarter_onset"].sel(parameter="preload").values
    assert (low, high) == pytest.approx(15.0 + 2.0 * norm.ppf([0.125, 0.875]), abs=0.6)
    ends = [bar.get_x() + bar.get_width() for bar in figure.axes[0].patches]
    assert ends == pytest.approx(found["quarter_onset"].values.ravel())
    widths = [bar.get_width() for bar in figure.axes[1].patches]
    assert widths == pytest.approx(found["halved_band"].values)
    assert figure.axes[1].lines[-1].get_xdata()[0] == pytest.approx(found["band"].item())
    text = write_report(dataset, tmp_path / "report.html").read_text().replace("\u00a0", " ")
    assert f"Halve the scatter of preload, and this band shrinks from {found['band'].item():.3g} to" in text
    assert text.count('alt="what the onset depends on"') == 1
    assert "beyond the axis" in words(sensitivity_figure(dataset.sel(load=slice(5.0, 15.0))))
    with pytest.raises(InputError, match="expected results with the job that states the distributions"):
        sensitivity_figure(dataset.drop_attrs())
    with pytest.raises(InputError, match="at thrust: unknown axis of the results"):
        sensitivity_figure(dataset, {"thrust": 1.0})
