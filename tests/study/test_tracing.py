"""Traces: what is run, what is inferred, and that neither depends on the order, on ranks or on interruptions."""

import csv
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from cvt_hpc.errors import InputError
from cvt_hpc.study import open_results, read_status, run
from cvt_hpc.study.description import describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.planning import inferred_classes, needed_runs
from cvt_hpc.tables import below_origin
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.classes import OccurrenceClass
from support.recorded import assert_same_numbers
from support.study_double import Axis, Job, Simulator
from support.study_processes import HERE

QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN, SLIPPING, IRREGULAR = OccurrenceClass
FLAGS = {
    QUIET: (Status.DONE, Vibrates.NO),
    VIBRATING: (Status.DONE, Vibrates.YES),
    UNDECIDED: (Status.DONE, Vibrates.UNDECIDED),
    IRREGULAR: (Status.DONE, Vibrates.IRREGULAR),
    SLIPPING: (Status.DONE, Vibrates.SLIPS),
    FAILED: (Status.FAILED_NUMERICS, Vibrates.UNDECIDED),
}


def study_of(shape, spacings):
    """Return a study whose axes a0, a1, ... are traced where a spacing is given."""
    axes = tuple(Axis(f"a{i}", tuple(range(length))) for i, length in enumerate(shape))
    traced = {f"a{i}": spacing for i, spacing in enumerate(spacings) if spacing}
    return describe(Job(axes, design={"kind": "trace", "first_spacing": traced}), Simulator())


class Found:
    """Records of runs that never were, as far as a trace asks for them."""

    def __init__(self, study):
        self.rows, self.recorded = study.blank_rows(study.size), np.zeros(study.size, bool)

    @property
    def status(self):
        return self.rows["status"]

    def read(self, runs, name):
        return self.rows[name][runs]

    def enter(self, runs, found):
        self.rows["status"][runs], self.rows["vibrates"][runs] = FLAGS[found]
        self.recorded[runs] = True


def pending_runs(study, records):
    return np.flatnonzero(needed_runs(study, records) & ~records.recorded)


def traced(truth, spacings, order=None):
    """Return which cells of a map of classes are run, and the classes that are inferred from these.

    With `order` runs are done singly, as it chooses from those that are pending.
    """
    study = study_of(truth.shape, spacings)
    records = Found(study)
    while (pending := pending_runs(study, records)).size:
        for index in pending if order is None else [order.choice(pending)]:
            records.enter(index, OccurrenceClass(truth.flat[index]))
    return records.recorded.reshape(truth.shape), inferred_classes(study, records)


@st.composite
def maps(draw):
    """Rectangles of all classes painted over each other, and the spacings along which to trace."""
    shape = tuple(draw(st.lists(st.integers(1, 11), min_size=1, max_size=3)))
    truth = np.full(shape, QUIET, np.int8)
    for _ in range(draw(st.integers(0, 5))):
        ends = [sorted(draw(st.tuples(st.integers(0, n), st.integers(0, n)))) for n in shape]
        truth[tuple(slice(*pair) for pair in ends)] = draw(st.sampled_from(list(FLAGS)))
    spacings = [draw(st.none() | st.integers(1, 6)) for _ in shape]
    return truth, spacings


@settings(max_examples=80)
@given(maps())
def test_every_patch_of_which_a_cell_is_run_is_found_whole(found):
    truth, spacings = found
    done, inferred = traced(truth, spacings)
    assert (inferred != NOT_RUN).all()
    assert (inferred[done] == truth[done]).all()
    neighbours = np.zeros((3,) * truth.ndim, bool)
    neighbours[(1,) * truth.ndim] = True
    for axis, spacing in enumerate(spacings):
        if spacing:
            np.moveaxis(neighbours, axis, 0)[(slice(None), *(1,) * (truth.ndim - 1))] = True
    for kind in FLAGS:
        patches, count = ndimage.label(truth == kind, neighbours)
        for patch in (patches == number for number in range(1, count + 1)):
            if done[patch].any():
                assert (inferred[patch] == kind).all()


@st.composite
def windows(draw):
    """One window at least as wide as the first spacing along each axis, or cut off by an end of the grid."""
    lengths = draw(st.lists(st.integers(1, 16), min_size=1, max_size=2))
    spacings = [draw(st.integers(1, 5)) for _ in lengths]
    window = []
    for length, spacing in zip(lengths, spacings, strict=True):
        start = draw(st.integers(0, length - 1))
        least = 1 if start == 0 else min(start + spacing, length) - start
        window.append(slice(start, start + draw(st.integers(least, length - start))))
    truth = np.full(lengths, QUIET, np.int8)
    truth[tuple(window)] = VIBRATING
    return truth, spacings


@settings(max_examples=150)
@given(windows())
def test_a_window_as_wide_as_the_first_spacing_gives_the_map_of_the_full_grid(found):
    truth, spacings = found
    assert (traced(truth, spacings)[1] == truth).all()


@settings(max_examples=15)
@given(maps(), st.randoms(use_true_random=False))
def test_what_is_run_does_not_depend_on_the_order(found, order):
    truth, spacings = found
    done, inferred = traced(truth, spacings)
    again, inferred_again = traced(truth, spacings, order)
    assert (again == done).all()
    assert (inferred_again == inferred).all()


def test_few_runs_are_needed():
    truth = np.full(9, QUIET, np.int8)
    truth[3:] = VIBRATING
    done, _ = traced(truth, [4])
    assert np.flatnonzero(done).tolist() == [0, 2, 3, 4, 8]  # 0, 4, 8; then 2 within 0..4; then 3
    disc = np.hypot(*np.mgrid[-32:33, -32:33]) < 20
    done, inferred = traced(np.where(disc, VIBRATING, QUIET).astype(np.int8), [8, 8])
    assert ((inferred == VIBRATING) == disc).all()
    assert done.mean() < 0.2  # a boundary of some 160 cells, of 4225, and what leads there


def test_a_window_between_the_first_runs_is_missed():
    truth = np.full(9, QUIET, np.int8)
    truth[5:8] = VIBRATING
    done, inferred = traced(truth, [4])
    assert np.flatnonzero(done).tolist() == [0, 4, 8]
    assert (inferred == QUIET).all()


def test_nothing_is_inferred_before_all_corners_of_a_box_are_run():
    study = study_of((9,), [4])
    records = Found(study)
    records.enter([0, 4], VIBRATING)
    assert inferred_classes(study, records).tolist() == [VIBRATING] * 5 + [NOT_RUN] * 4
    assert pending_runs(study, records).tolist() == [8]


def test_the_published_map_is_traced_with_half_of_its_runs():
    with (HERE.parents[1] / "jobs" / "results" / "lebrecht_2004.csv").open() as table:
        rows = list(csv.DictReader(below_origin(table)))
    verdicts = {"no": QUIET, "yes": VIBRATING, "undecided": UNDECIDED, "irregular": IRREGULAR, "": FAILED}
    verdicts["slips"] = SLIPPING
    truth = np.array([verdicts[row["vibrates"]] for row in rows], np.int8).reshape(7, 4, 19)
    truth[..., -2:] = QUIET  # as if all windows ended at 180 N m, so that some lie between runs
    for spacing in (4, 6, 9):
        done, inferred = traced(truth, [None, None, spacing])
        assert done.mean() < 0.5
        # what is missed lies between two loads that were run, and both are quiet
        missed = inferred != truth
        for row, panel, load in np.argwhere(missed):
            run = np.flatnonzero(done[row, panel])
            beside = run[run < load].max(), run[run > load].min()
            assert (truth[row, panel, beside] == QUIET).all() and inferred[row, panel, load] == QUIET
        windows = (missed & (truth == VIBRATING)).any(axis=2).sum()
        assert (windows > 0) == (spacing == 9)  # which is wider than some of the windows


def test_nothing_is_inferred_along_an_axis_that_is_not_traced():
    truth = np.full((3, 9), QUIET, np.int8)
    truth[1] = VIBRATING
    done, _ = traced(truth, [None, 4])
    assert (done == ([True, False, False, False] * 2 + [True])).all()  # all rows alike, none is cut


def test_failed_and_undecided_runs_are_classes_of_their_own():
    for kind in (UNDECIDED, FAILED):
        truth = np.full(9, QUIET, np.int8)
        truth[4] = kind
        done, inferred = traced(truth, [4])
        assert np.flatnonzero(~done).tolist() == [1, 7]
        assert (inferred == truth).all()


# Sweeps

RUNS = 60
NEEDED = [*range(0, 57, 4), 59, 21, 22, 33, 34]  # the first runs, and those about the ends of the window
JOB = Job(
    (Axis("load", tuple(range(RUNS))),),
    {"window": [22, 33]},
    design={"kind": "trace", "first_spacing": {"load": 4}},
)


class Counting(Simulator):
    runs = 0

    def run_point(self, *arguments):
        self.runs += 1
        return super().run_point(*arguments)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Return the dataset of an undisturbed serial trace."""
    folder = tmp_path_factory.mktemp("reference")
    run(JOB, folder, simulator=Simulator(), progress=False)
    return results(folder)


def results(folder):
    with open_results(folder) as dataset:
        return dataset.load()


def test_a_trace_runs_a_part_of_the_grid_and_infers_the_rest(tmp_path, reference):
    simulator = Counting()
    report = run(JOB, tmp_path, simulator=simulator, progress=False)
    assert simulator.runs == len(NEEDED)
    assert (report.done, report.total, report.unneeded, report.remaining) == (20, 20, 40, 0)
    assert report.exit_status == 0
    dataset = results(tmp_path)
    assert np.flatnonzero(dataset["status"] == Status.DONE).tolist() == sorted(NEEDED)
    assert (dataset["status"].values[np.setdiff1d(range(RUNS), NEEDED)] == Status.NOT_RUN).all()
    expected = [VIBRATING if 22 <= load <= 33 else QUIET for load in range(RUNS)]
    assert dataset["inferred_class"].values.tolist() == expected
    words = "quiet vibrating undecided failed not_run slipping irregular"
    assert dataset["inferred_class"].attrs["flag_meanings"] == words
    status = read_status(tmp_path)
    assert (status.total, status.done, status.left, status.unneeded) == (20, 20, 0, 40)
    run(JOB, tmp_path, simulator=simulator, progress=False)
    assert simulator.runs == len(NEEDED)  # a finished trace repeats nothing
    assert_same_numbers(results(tmp_path), reference)


@pytest.mark.parametrize("lanes", [1, 7])
@pytest.mark.parametrize("until", [1, 9, 16, 17, 18])  # within the first round, at its end, and later
def test_an_interrupted_trace_goes_on_to_the_same_runs(tmp_path, monkeypatch, reference, until, lanes):
    class Late(Counting):
        def run_point(self, *arguments):
            if self.runs + 1 == until:
                late = time.monotonic() + 2000.0
                monkeypatch.setattr("cvt_hpc.study.ranks.stopping.time.monotonic", lambda: late)
            return super().run_point(*arguments)

    report = run(JOB, tmp_path, simulator=Late(lanes=lanes), progress=False, time_limit=1000.0)
    monkeypatch.undo()
    assert (report.stopped, report.exit_status) == ("time limit", 99)
    assert report.remaining > 0
    cells = results(tmp_path)["inferred_class"]
    done = results(tmp_path)["status"] == Status.DONE
    assert (cells.values[done] == reference["inferred_class"].values[done]).all()
    before, simulator = report.done, Counting(lanes=5)
    report = run(JOB, tmp_path, simulator=simulator, progress=False)
    assert (report.exit_status, before + simulator.runs) == (0, len(NEEDED))
    assert_same_numbers(results(tmp_path), reference)


def test_a_round_that_leaves_no_records_is_a_defect_and_no_endless_loop(tmp_path, monkeypatch):
    monkeypatch.setattr("cvt_hpc.study.ranks.stopping.Stop.fits", lambda self, seconds: False)
    with pytest.raises(RuntimeError, match="without records of its runs"):
        run(JOB, tmp_path, simulator=Simulator(), progress=False)


def test_two_ranks_trace_the_same_runs(start, tmp_path, reference):
    options = {"runs": RUNS, "parameters": JOB.parameters, "design": JOB.design, "lanes": 2}
    finished = start({"out": tmp_path, **options}, ranks=2).finish()
    assert finished.returncode == 0, finished.stderr
    assert "20/20 runs (100.0%)" in finished.stderr.splitlines()[-1]
    assert_same_numbers(results(tmp_path), reference)


def test_failed_runs_of_a_trace_are_reported(tmp_path):
    job = Job(JOB.axes, {**JOB.parameters, "raise_at": 48}, design=JOB.design)
    report = run(job, tmp_path, simulator=Simulator(), progress=False)
    assert (report.exit_status, report.remaining) == (1, 0)
    assert [failed.at for failed in report.failed] == [{"load": 48}]
    cells = results(tmp_path)["inferred_class"].values
    assert np.flatnonzero(cells == FAILED).tolist() == [48]


def test_a_run_that_is_done_again_may_change_its_class(tmp_path):
    class Broken(Simulator):
        def run_point(self, job, point, interrupt):
            if point["load"] == 48:
                raise RuntimeError("out of luck")
            return super().run_point(job, point, interrupt)

    report = run(JOB, tmp_path, simulator=Broken(), progress=False)
    assert (len(report.failed), report.total) == (1, 24)  # the failed run is a class: 46, 47, 49, 50 as well
    simulator = Counting()
    report = run(JOB, tmp_path, simulator=simulator, progress=False, retry=[Status.FAILED_ERROR])
    assert simulator.runs == 1
    assert (report.exit_status, report.done, report.total, report.unneeded) == (0, 24, 24, 36)
    expected = [VIBRATING if 22 <= load <= 33 else QUIET for load in range(RUNS)]
    assert results(tmp_path)["inferred_class"].values.tolist() == expected


def test_a_trace_is_not_done_in_parts(tmp_path):
    with pytest.raises(InputError, match="part: expected a whole study, since it chooses by"):
        run(JOB, tmp_path / "out", simulator=Simulator(), part="1/2")
    assert not (tmp_path / "out").exists()


def test_a_run_whose_history_is_wanted_is_run(tmp_path):
    report = run(replace(JOB, histories=(10,)), tmp_path, simulator=Simulator(), progress=False)
    assert (report.exit_status, report.total) == (0, 21)
    assert results(tmp_path)["status"].values[10] == Status.DONE
    assert StudyFolder(tmp_path).history(10).exists()
