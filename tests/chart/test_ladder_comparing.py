"""Rungs of which all is known: each error comes out as it was put in."""

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.experiments.ladder.comparing import Score, compare
from cvt_hpc.experiments.ladder.loading import QUESTIONS
from cvt_hpc.experiments.sweeps import Sweep
from cvt_hpc.variables import Status, Vibrates

LOADS, GRADIENTS = 10.0 * np.arange(1, 9), np.array([-1.0, -0.5])
DIMS = ("friction_gradient", "load")
NO, YES, UNDECIDED = Vibrates.NO, Vibrates.YES, Vibrates.UNDECIDED
VERDICTS = [[NO, NO, YES, YES, YES, YES, NO, NO], [NO] * 8]  # onsets at 25 and 65 N m of the first line
COST = 0.25
FULL, REFERENCE = Sweep("elastic_belt", QUESTIONS, None), Sweep("reference", (), None)


def transient(verdicts=VERDICTS, amplitude=20e-6, frequency=500.0, force=7000.0):
    """Results of a rung with a transient: t2 is the stronger strand."""
    shape = (GRADIENTS.size, LOADS.size)

    def pair(one, other):
        return ((*DIMS, "strand"), np.broadcast_to([one, other], (*shape, 2)).copy())

    return xr.Dataset(
        {
            "status": (DIMS, np.full(shape, Status.DONE)),
            "vibrates": (DIMS, np.array(verdicts)),
            "amplitude": pair(1e-6, amplitude),
            "frequency": pair(900.0, frequency),
            "growth_rate": pair(0.0, 0.0),
            "mean_ring_tension": pair(force, 9000.0),
            "mean_push_force": pair(0.0, 2000.0),
            "axial_force": ((*DIMS, "pulley"), np.full((*shape, 2), 50e3)),
            "core_seconds": (DIMS, np.full(shape, COST)),
        },
        {
            "friction_gradient": GRADIENTS,
            "load": LOADS,
            "strand": ["t1", "t2"],
            "pulley": ["driving", "driven"],
        },
    )


def scores(dataset, answers=QUESTIONS, full=None, rung="rung"):
    """What a rung with these results is found to be worth, by question."""
    rungs = [Sweep("rung", tuple(answers), None), FULL, REFERENCE]
    results = {
        "rung": dataset,
        "elastic_belt": transient() if full is None else full,
        "reference": transient(),
    }
    found = list(compare(rungs, results))
    assert {f.question for f in found if f.rung == "rung"} == set(answers)
    return {f.question: f for f in found if f.rung == rung}


@pytest.mark.parametrize("verdict", [Vibrates.SLIPS, Vibrates.IRREGULAR])
def test_gross_slip_and_irregular_motion_are_answers(verdict):
    verdicts = np.array(VERDICTS)
    verdicts[1, -2:] = verdict  # where the reference is quiet
    score = scores(transient(verdicts))["occurrence"].score
    assert (score.cells, score.wrong, score.undecided) == (16, 2 / 16, 0.0)
    # and of the reference they are asked for
    rungs = [Sweep("rung", ("occurrence",), None), FULL, REFERENCE]
    results = {"rung": transient(), "elastic_belt": transient(), "reference": transient(verdicts)}
    score = next(found.score for found in compare(rungs, results) if found.rung == "rung")
    assert (score.cells, score.wrong, score.undecided) == (16, 2 / 16, 0.0)


def test_a_rung_that_says_the_same_has_no_error():
    found = scores(transient())
    assert found["occurrence"].score == Score(16, wrong=0.0, undecided=0.0)
    assert found["onset"].score == Score(2, 0.0, 0.0, undecided=0.0)
    assert found["frequency"].score == found["amplitude"].score == Score(4, 0.0, 0.0, undecided=0.0)
    assert found["forces"].score == Score(16, 0.0, 0.0, undecided=0.0)
    assert {f.core_seconds for f in found.values()} == {COST}


def test_a_window_that_is_shifted_by_a_cell():
    found = scores(transient([np.roll(VERDICTS[0], 1), VERDICTS[1]]))
    assert found["occurrence"].score == Score(16, wrong=2 / 16, undecided=0.0)
    assert found["onset"].score == Score(2, 10.0, 10.0, undecided=0.0)
    # where it says quiet it has no amplitude: three of four cells are left
    assert found["amplitude"].score == Score(3, 0.0, 0.0, undecided=0.25)


def test_windows_that_are_missed_or_additional():
    found = scores(transient(VERDICTS[::-1]))
    assert found["onset"].score == Score(0, undecided=1.0, additional=2)
    assert found["amplitude"].score == Score(0, undecided=1.0)


def test_amplitude_and_frequency_of_the_stronger_strand():
    found = scores(transient(amplitude=40e-6, frequency=450.0))
    assert found["amplitude"].score.median == pytest.approx(1.0)
    assert found["frequency"].score.median == pytest.approx(0.1)


def test_forces_over_the_largest_of_their_kind():
    dataset = transient(force=7090.0)  # 90 of 9000 N
    assert scores(dataset)["forces"].score.median == pytest.approx(0.01)
    dataset["axial_force"][:, :2] *= 1.04
    score = scores(dataset)["forces"].score
    assert (score.cells, score.median, score.high) == (16, pytest.approx(0.01), pytest.approx(0.04))


def test_what_fails_or_is_undecided_is_no_error():
    dataset = transient()
    dataset["status"][0, :3] = Status.FAILED_NUMERICS
    dataset["mean_ring_tension"][0, :3] = np.nan
    dataset["vibrates"][0, 3] = UNDECIDED
    found = scores(dataset)
    assert found["occurrence"].score == Score(16, wrong=0.0, undecided=4 / 16)
    assert found["onset"].score == Score(1, 0.0, 0.0, undecided=0.5)
    assert found["frequency"].score == Score(2, 0.0, 0.0, undecided=0.5)
    assert found["forces"].score == Score(13, 0.0, 0.0, undecided=3 / 16)


def test_what_the_reference_leaves_open_is_not_asked():
    verdicts = np.full((2, 8), UNDECIDED)
    verdicts[0, 0] = NO
    rungs = [Sweep("rung", QUESTIONS, None), FULL, REFERENCE]
    results = dict.fromkeys(("rung", "elastic_belt"), transient()) | {"reference": transient(verdicts)}
    found = {f.question: f.score for f in compare(rungs, results) if f.rung == "rung"}
    assert found["occurrence"] == Score(1, wrong=0.0, undecided=0.0)
    assert (found["onset"].cells, found["onset"].additional) == (0, 0)
    assert found["frequency"].cells == 0 and np.isnan(found["frequency"].undecided)


def test_the_reference_is_no_better_known_than_the_full_run_agrees_with_it():
    full = transient([np.roll(VERDICTS[0], 1), VERDICTS[1]], amplitude=22e-6)
    found = {name: f.score for name, f in scores(transient(), full=full, rung="reference").items()}
    assert found["occurrence"] == Score(16, wrong=2 / 16) and found["onset"] == Score(2, 10.0)
    assert found["amplitude"].median == pytest.approx(0.1) and found["frequency"] == Score(3, 0.0)
    found = scores(full, rung="reference")
    assert found["onset"].score == Score(2, 5.0) and found["forces"].score == Score(16, 0.0)  # half a step


def test_the_reference_is_as_well_known_as_the_rung_of_which_it_is_a_refined_one():
    """A pushbelt above the elastic belt: what the elastic belt is off by says nothing of the reference."""
    rungs = [FULL, Sweep("pushbelt", QUESTIONS, None), REFERENCE]
    results = {
        "elastic_belt": transient(amplitude=40e-6, force=7900.0),
        "pushbelt": transient(amplitude=21e-6, force=7090.0),
        "reference": transient(),
    }
    found = {(f.question, f.rung): f.score for f in compare(rungs, results)}
    assert found["amplitude", "elastic_belt"].median == pytest.approx(1.0)
    for rung in ("pushbelt", "reference"):
        assert found["amplitude", rung].median == pytest.approx(0.05)
        assert found["forces", rung].median == pytest.approx(0.01)


def test_a_rung_without_an_axis_says_the_same_along_it():
    verdicts = xr.DataArray([int(YES), int(NO)], dims="friction_gradient")
    dataset = xr.Dataset(
        {
            "status": xr.full_like(verdicts, Status.DONE),
            "vibrates": verdicts,
            "core_seconds": 0.002 * verdicts,
        },
        {"friction_gradient": GRADIENTS},
    )
    found = scores(dataset, ["occurrence"])["occurrence"]
    assert found.score == Score(16, wrong=4 / 16, undecided=0.0)
    assert found.core_seconds == 0.001  # of its own two runs


def test_a_strand_has_the_nearest_eigenfrequency_of_the_strand_that_vibrates():
    eigenfrequency = np.tile([[499.0, 501.0], [200.0, 480.0]], (LOADS.size, 1, 1))
    dataset = xr.Dataset(
        {
            "status": ("load", np.full(LOADS.size, Status.DONE)),
            "vibrates": ("load", np.full(LOADS.size, UNDECIDED)),
            "eigenfrequency": (("load", "strand", "half_waves"), eigenfrequency),
            "core_seconds": ("load", np.full(LOADS.size, 0.03)),
        },
        {"load": LOADS, "strand": ["t1", "t2"], "half_waves": [1, 2]},
    )
    assert scores(dataset, ["frequency"])["frequency"].score.median == pytest.approx(0.04)


def test_onsets_of_eigenvalues_lie_where_the_rate_is_zero():
    dataset = transient().drop_vars(["amplitude", "frequency"])
    rate = np.full((2, 8), np.nan)  # all modes decay fast: 400/s is as slow as they may
    rate[0, 1:6] = [-100.0, 25.0, 100.0, 100.0, 200.0]
    dataset["growth_rate"] = (DIMS, rate)
    dataset["frequency"] = (DIMS, np.full((2, 8), 510.0))
    found = scores(dataset, ["occurrence", "onset", "frequency", "forces"])
    # 28 N m of 25, and 60 + 10 x 200/600 of 65
    assert found["onset"].score.median == pytest.approx(0.5 * (3.0 + 5.0 / 3.0))
    assert found["frequency"].score.median == pytest.approx(0.02)
