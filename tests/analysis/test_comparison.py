"""Two studies against each other: what contradicts is found, and what agrees is not."""

import csv
import json
import math

import numpy as np
import pytest
import xarray as xr
from matplotlib import image

from cvt_hpc.analysis.comparison import compare, write_comparison
from cvt_hpc.analysis.comparison_drawing import draw_comparison
from cvt_hpc.errors import InputError
from cvt_hpc.printing import comparison_lines
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.classes import OccurrenceClass, PairClass, classify_pairs
from support.studies import STIFFNESSES, sampled, study, two_flags

JOB = {
    "name": "x",
    "model": "elastic_belt",
    "vibration": {"amplitude_threshold": 5e-6},
    "numerics": {"step": 1e-6},
}
QUIET, VIBRATING, UNDECIDED = Vibrates.NO, Vibrates.YES, Vibrates.UNDECIDED


def of_job(dataset, **changes):
    """A dataset with the attributes that results.nc has."""
    versions = {"cvt_hpc": "1.0", "numpy": "2.1"}
    return dataset.assign_attrs(job=json.dumps(JOB | changes), versions=json.dumps(versions))


def row(verdicts, amplitudes, frequencies=None, status=None, **changes):
    """A study along the load, by the verdicts, amplitudes [um] and frequencies [Hz] of one strand."""
    dataset = two_flags([Status.DONE] * len(verdicts) if status is None else status, verdicts)
    dataset["amplitude"] = (("load", "strand"), 1e-6 * np.array(amplitudes)[:, np.newaxis])
    dataset["frequency"] = (
        ("load", "strand"),
        np.array(frequencies or [500.0] * len(verdicts))[:, np.newaxis],
    )
    return of_job(dataset, **changes)


def test_equal_studies_have_no_contradiction():
    found = compare(of_job(study()), of_job(study()))
    assert not found.contradicts.any() and found.differences == () and found.left_out == (0, 0)
    counts = found.counts()
    assert all(of_a == of_b for (of_a, of_b), count in counts.items() if count)
    assert sum(counts.values()) == found.pairs.size
    assert found.deviation("amplitude") == found.deviation("frequency") == (0.0, 0.0, 0.0)


def test_contradictions_are_told_from_other_differences_and_by_the_threshold():
    # the larger amplitude counts: 6 um is the last that is within 20 % of 5 um, whichever study it is of
    a = row([VIBRATING, VIBRATING, QUIET, QUIET, VIBRATING, QUIET], [6.0, 6.1, 1.0, 6.1, 9.0, 1.0])
    b = row([QUIET, QUIET, VIBRATING, VIBRATING, UNDECIDED, UNDECIDED], [0.1, 0.1, 6.0, 6.0, 9.0, 1.0])
    found = compare(a, b)
    assert found.pairs.tolist() == [
        PairClass.A_ONLY_NEAR,
        PairClass.A_ONLY,
        PairClass.B_ONLY_NEAR,
        PairClass.B_ONLY,
        PairClass.OTHERWISE,
        PairClass.OTHERWISE,
    ]
    assert found.contradicts.tolist() == [True] * 4 + [False] * 2
    assert found.contradicts_beyond.tolist() == [False, True, False, True, False, False]
    counts = found.counts()
    assert counts[OccurrenceClass.VIBRATING, OccurrenceClass.QUIET] == 2
    assert counts[OccurrenceClass.QUIET, OccurrenceClass.UNDECIDED] == 1


def test_runs_without_results_are_no_contradiction_and_are_not_counted_as_answered():
    a = row([QUIET] * 3, [1.0] * 3)
    b = row([VIBRATING] * 3, [9.0] * 3, status=[Status.FAILED_NUMERICS, Status.NOT_RUN, Status.DONE])
    found = compare(a, b)
    assert found.pairs.tolist() == [PairClass.FAILED_IN_ONE, OccurrenceClass.NOT_RUN, PairClass.B_ONLY]
    assert found.answered.tolist() == [False, False, True]


def test_every_class_that_there_is_agrees_with_itself_alone():
    kinds = np.array(list(OccurrenceClass), np.int8)
    pairs = classify_pairs(*np.meshgrid(kinds, kinds), np.zeros((kinds.size, kinds.size), bool))
    assert (np.diag(pairs) == kinds).all()
    either = np.logical_or(*np.meshgrid(kinds == OccurrenceClass.NOT_RUN, kinds == OccurrenceClass.NOT_RUN))
    assert (pairs[either] == OccurrenceClass.NOT_RUN).all()
    assert (pairs[~np.eye(kinds.size, dtype=bool) & ~either] < 0).all()


def test_deviations_are_those_of_the_cells_that_vibrate_in_both():
    sizes = np.linspace(10.0, 20.0, 21)
    factors = 1.0 + np.linspace(-0.1, 0.3, 21)
    a = row([VIBRATING] * 21 + [QUIET], [*sizes, 1.0])
    b = row([VIBRATING] * 21 + [QUIET], [*(sizes * factors), 9.0], [510.0] * 20 + [450.0, 999.0])
    found = compare(a, b)
    off = np.abs(factors - 1.0)
    wanted = np.median(off), np.quantile(off, 0.95), off.max()
    assert np.allclose(found.deviation("amplitude"), wanted, rtol=1e-12)
    assert np.allclose(found.deviation("frequency"), (0.02, 0.02, 0.1), rtol=1e-12)


def test_common_points_are_compared_whatever_their_order():
    a = of_job(study(stiffnesses=(1.0, 1.2, np.inf)))
    b = of_job(study(loads=(60.0, 20.0 + 1e-12, 333.0)).transpose("load", "strand", ...))
    found = compare(a, b)
    assert found.left_out == (90 - 18, 36 - 18)
    assert dict(found.cells.sizes) == {"friction_gradient": 3, "sheave_stiffness": 3, "load": 2}
    assert found.cells["load"].values.tolist() == [20.0, 60.0]
    assert found.deviation("amplitude") == (0.0, 0.0, 0.0)
    assert not found.contradicts.any()


def test_samples_are_compared_at_common_places():
    a, b = of_job(sampled()), of_job(sampled().isel(run=slice(None, None, -2)))
    b["vibrates"].values[5] = 1 - b["vibrates"].values[5]
    found = compare(a, b)
    assert found.left_out == (60, 0)
    (cell,) = found.rows(found.contradicts)
    run = b.isel(run=5)
    assert cell.at == {name: run[name].item() for name in cell.at} and len(cell.at) == 3


def test_what_differs_between_the_jobs_is_named():
    b = of_job(study(), model="auto", numerics={"step": 2e-6}, auto={"question": "occurrence"})
    b.attrs["versions"] = json.dumps({"cvt_hpc": "1.1", "numpy": "2.1"})
    assert compare(of_job(study()), b).differences == (
        'model: "elastic_belt" in A, "auto" in B',
        "numerics.step: 1e-06 in A, 2e-06 in B",
        'versions.cvt_hpc: "1.0" in A, "1.1" in B',
        "in B alone: auto.question",
    )


@pytest.mark.parametrize(("value", "stored", "words"), [(1.2, 1.2, "1.2"), (np.inf, "inf", "inf")])
def test_an_axis_of_one_study_is_reduced_to_the_value_of_the_other(value, stored, words):
    a = of_job(study())
    b = of_job(study().sel(sheave_stiffness=value, drop=True), belt={"sheave_stiffness": stored})
    for pair, label, left_out in (((a, b), "A", (90, 0)), ((b, a), "B", (0, 90))):
        found = compare(*pair)
        other = "B" if label == "A" else "A"
        assert found.notes == (f"axis sheave_stiffness of {label} alone: at {words}, as in {other}",)
        assert found.left_out == left_out and found.differences == ()
        sizes = [found.cells[f"amplitude_{study}"].values for study in "ab"]
        assert np.array_equal(*sizes, equal_nan=True)


def test_an_axis_of_one_value_that_the_other_study_does_not_know_is_reduced():
    a = of_job(study())
    lonely = of_job(study().expand_dims(seed=[7]))
    assert compare(lonely, a).notes == ("axis seed of A alone: at 7, unknown in B",)


@pytest.mark.parametrize(
    ("b", "message"),
    [
        (study(loads=(1.0, 2.0)), "b: axis load: expected a value of a: 20, 40, "),
        (study().rename(load="loads"), "a: axis load: expected an axis or a parameter of b, found neither"),
        (study().rename(load="loads"), "; did you mean loads?"),
        (
            study().isel(load=0, drop=True),
            "a: axis load: expected an axis or a parameter of b, found neither",
        ),
        (
            of_job(study().isel(load=0, drop=True), scene={"load": 21.0}),
            "a: axis load: expected one of 20, 40, 60, ",
        ),
        (sampled(), "b: expected results over a grid, as in a, found samples"),
        (xr.Dataset({"x": 1}), "b: expected results of a study, with the variable status, found x"),
    ],
)
def test_what_cannot_be_compared_is_one_clear_error(b, message):
    with pytest.raises(InputError) as caught:
        compare(of_job(study()), b, ("a", "b"))
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_samples_that_share_nothing_are_one_clear_error():
    b = sampled().assign_coords(load=("run", sampled()["load"].values + 0.5))
    with pytest.raises(InputError, match="^b: expected samples at places of those of a, found none$"):
        compare(sampled(), b, ("a", "b"))
    with pytest.raises(InputError, match="since samples have no common values"):
        compare(sampled(), of_job(sampled().drop_vars("load"), scene={"load": 1.0}), ("a", "b"))


def test_the_report_says_both_counts_and_names_the_cells():
    a = row([VIBRATING, QUIET, VIBRATING, VIBRATING], [5.5, 1.0, 20.0, 8.0], [500.0, 400.0, 600.0, 500.0])
    b = row([QUIET, VIBRATING, VIBRATING, UNDECIDED], [4.5, 9.0, 22.0, 7.0], [505.0, 410.0, 606.0, 500.0])
    lines = list(comparison_lines(compare(a, b), ("out/a", "out/b")))
    assert lines == [
        "A: out/a",
        "B: out/b",
        "differs: nothing that the datasets tell",
        "4 cells, by class in A (rows) and in B (columns):",
        "             quiet  vibrating  undecided",
        "  quiet      0      1          0",
        "  vibrating  1      1          1",
        "2 of 4 cells contradict (quiet against vibrating), 1 of them beyond the threshold (larger amplitude "
        "not within 20% of it)",
        "  load = 0: vibrating 5.5 um 500 Hz | quiet 4.5 um 505 Hz, near the threshold",
        "  load = 1: quiet 1 um 400 Hz | vibrating 9 um 410 Hz",
        "amplitude where both vibrate (1 cells): B deviates by 10.00% (median), 10.00% (95 %), 10.00% (largest)",
        "frequency where both vibrate (1 cells): B deviates by 1.00% (median), 1.00% (95 %), 1.00% (largest)",
    ]


@pytest.mark.parametrize(
    ("changes", "are_designs"),
    [
        ({"sheaves": {"tilt_stiffness": 3e5}}, True),
        ({"scene": {"ratio": 2.0, "seed": 2}}, True),
        ({"scene": {"ratio": 2.5, "seed": 2, "disturbance": 1e-5}}, False),
        ({"numerics": {"step": 2e-6}, "mesh": {"stations": 96}, "model": "pushbelt"}, False),
        ({"limit": {"limit_frequency": 2e3}, "friction": {"friction_treatment": "set_valued"}}, False),
        ({"vibration": {"amplitude_threshold": 1e-6}, "rings": {"layers": 3}}, False),
    ],
)
def test_of_two_designs_one_is_better_and_of_two_methods_one_contradicts(changes, are_designs):
    scene = {
        "scene": {"ratio": 2.5, "seed": 1, "disturbance": 1e-6},
        "sheaves": {"tilt_stiffness": 2e5},
        "mesh": {"stations": 160},
        "limit": {"limit_frequency": 1e3},
        "friction": {"friction_treatment": "regularised"},
    }
    a = row([VIBRATING, VIBRATING, QUIET, VIBRATING], [5.5, 9.0, 1.0, 20.0], **scene)
    b = row([QUIET, QUIET, VIBRATING, VIBRATING], [4.5, 1.0, 9.0, 10.0], **(scene | changes))
    found = compare(a, b)
    lines = list(comparison_lines(found, ("a", "b")))
    assert found.are_designs == are_designs and any("contradict" in line for line in lines) != are_designs
    if are_designs:
        start = next(k for k, line in enumerate(lines) if line.startswith("two designs"))
        assert lines[start : start + 4] == [
            "two designs: of 4 cells B is better in 2 (quiet where A vibrates) and worse in 1 (vibrates where A is "
            "quiet)",
            "amplitude where both vibrate: in B 0.5 times that in A (median), better",
            "worse in B:",
            "  load = 2: quiet 1 um 500 Hz | vibrating 9 um 500 Hz",
        ]


def test_studies_without_amplitudes_are_compared_by_class():
    a, b = (two_flags([Status.DONE] * 2, verdicts) for verdicts in ([QUIET, QUIET], [QUIET, VIBRATING]))
    found = compare(a, b)
    assert found.contradicts_beyond.tolist() == [False, True]
    lines = list(comparison_lines(found, ("a", "b")))
    assert lines[-1] == "  load = 1: quiet | vibrating"


def test_the_table_has_a_row_for_each_cell(tmp_path):
    found = compare(row([VIBRATING, QUIET], [5.5, math.nan]), row([QUIET, QUIET], [4.5, 1.0]))
    rows = list(csv.DictReader(write_comparison(found, tmp_path / "new" / "compare.csv").open()))
    assert [list(cells.values()) for cells in rows] == [
        ["0.0", "vibrating", "quiet", "in A only, near the threshold", "5.5", "4.5", "500", "500"],
        ["1.0", "quiet", "quiet", "quiet", "", "1", "500", "500"],
    ]


def of_drive(losses, tensions):
    """A study of the belt drive along the load, quiet, by speed loss [1] and tensions [N] of two strands."""
    dataset = row([QUIET] * len(losses), [math.nan] * len(losses), model="belt_drive")
    dataset["speed_loss"] = ("load", losses, {"units": "1"})
    dataset["strand_tension"] = (("load", "span"), tensions, {"units": "N"})
    return dataset.assign_coords(span=["t1", "t2"])


def test_what_the_model_names_is_compared(tmp_path):
    a = of_drive([0.0, 1.0e-3, math.nan], [[300.0, 320.0], [280.0, 340.0], [250.0, 370.0]])
    b = of_drive([1e-5, 1.02e-3, 2e-3], [[300.0, 320.0], [280.0, 323.0], [250.0, 370.0]])
    found = compare(a, b)
    # speed loss: of 0 no share is known, the third run of A has none
    assert list(comparison_lines(found, ("a", "b")))[-3:] == [
        "speed_loss where both have ended: B deviates by 2.00% (median), 2.00% (95 %), 2.00% (largest); at most 2e-05",
        "strand_tension_t1 where both have ended: B deviates by 0.00% (median), 0.00% (95 %), 0.00% (largest); at most 0 N",
        "strand_tension_t2 where both have ended: B deviates by 0.00% (median), 4.50% (95 %), 5.00% (largest); at most 17 N",
    ]
    rows = list(csv.DictReader(write_comparison(found, tmp_path / "compare.csv").open()))
    further = [rows[1][f"{name}_{study}"] for name in ("speed_loss",) for study in "ab"]
    further += [rows[1][f"strand_tension_t2_{study} [N]"] for study in "ab"]
    assert further == ["0.001", "0.00102", "340", "323"] and rows[2]["speed_loss_a"] == ""


def drawn(found, path):
    """The picture of a comparison, as numbers."""
    return image.imread(draw_comparison(found, path, ("out/a", "out/b")))[..., :3]


def has_colour(picture, colour, least=1e-3):
    wanted = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return (np.abs(picture - wanted) < 0.02).all(axis=-1).mean() > least


@pytest.mark.parametrize("is_sampled", [False, True])
def test_contradictions_show_in_the_picture(tmp_path, is_sampled):
    a, b = (of_job(study(stiffnesses=(1.0,))) for _ in "ab")
    vibrating = np.argwhere(b["vibrates"].values == VIBRATING)
    if is_sampled:
        a, b = (dataset.stack(run=dataset["status"].dims).reset_index("run") for dataset in (a, b))
        b["vibrates"].values[b["vibrates"].values == VIBRATING] = QUIET
    agreeing = drawn(compare(a, a), tmp_path / "agreeing.png")
    if not is_sampled:
        b["vibrates"].values[tuple(vibrating[10])] = QUIET
    contrary = drawn(compare(a, b), tmp_path / "contrary.png")
    assert has_colour(contrary, "#123a6b") and not has_colour(agreeing, "#123a6b")


@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize("size", [0.0, -1e-6])
def test_amplitudes_that_no_logarithm_has_are_not_drawn(size, tmp_path):
    one = row([Vibrates.YES] * 3, [size] * 3)
    assert drawn(compare(one, one), tmp_path / "x.png").size


def test_contradictions_that_the_map_leaves_out_are_counted(tmp_path):
    a, b = (xr.concat([study(), study()], "seed").assign_coords(seed=[1, 2]) for _ in "ab")
    b["vibrates"].values[1] = QUIET
    texts = []

    def keep(compose, out):
        figure = compose()
        texts.append(figure.get_suptitle())
        return out

    import cvt_hpc.analysis.comparison_drawing as drawing

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "draw", keep)
        found = compare(a, b)
        draw_comparison(found, tmp_path / "x.png", ("a", "b"))
    assert found.contradicts.sum() > 0
    assert f"{found.contradicts.sum()} contradicting cells are not on this map" in " ".join(texts[0].split())


def test_single_runs_are_compared_without_a_map(tmp_path):
    a, b = (of_job(study().isel(load=3, sheave_stiffness=0, friction_gradient=0, drop=True)) for _ in "ab")
    b["vibrates"].values[()] = QUIET
    found = compare(a, b)
    (cell,) = found.rows(found.contradicts)
    assert cell.at == {} and found.pairs == PairClass.A_ONLY
    assert has_colour(drawn(found, tmp_path / "x.png"), "#123a6b", 1e-4)


def test_infinite_and_textual_values_are_matched():
    found = compare(of_job(study()), of_job(study(stiffnesses=(np.inf,))))
    assert found.cells["sheave_stiffness"].values.tolist() == [STIFFNESSES[-1]]
    texts = study().assign_coords(load=[f"case {k}" for k in range(10)])
    assert compare(texts, texts.isel(load=[3, 1])).left_out == (96, 0)
