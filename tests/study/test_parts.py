"""Parts of a study: every run in exactly one, side by side in one folder, to the very same numbers."""

import json
import math
import signal
import threading
import time

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.storage.locks import locked
from cvt_hpc.study import gather, open_results, read_status, run
from cvt_hpc.study.folder import Part, StudyFolder, read_part
from support.recorded import assert_same_numbers, records
from support.study_double import Axis, Job, Simulator
from support.study_processes import PATIENCE, wait_until

RUNS = 60


def job(runs=RUNS, **parameters):
    return Job((Axis("load", tuple(range(runs))),), parameters)


def sweep(out, **options):
    return run(job(), out, simulator=Simulator(), progress=False, **options)


@pytest.mark.parametrize(("size", "parts"), [(1, 1), (12, 5), (90, 16), (7, 9), (1000, 10)])
def test_every_run_is_in_one_part_and_parts_are_of_one_size(size, parts):
    held = np.array([Part(number + 1, parts).holds(np.arange(size)) for number in range(parts)])
    assert (held.sum(axis=0) == 1).all()
    counts = held.sum(axis=1)
    assert counts.max() - counts.min() <= 1 + (size % parts > 0)


def test_with_an_axis_as_long_as_the_parts_all_get_all_values():
    held = Part(3, 12).holds(np.arange(5 * 12)).reshape(5, 12)
    assert held.sum(axis=1).tolist() == [1] * 5
    assert held.sum(axis=0).max() == 1


@pytest.mark.parametrize(
    "text", ["3", "0/4", "5/4", "1/0", "-1/4", "1/4/2", "1.5/4", " 1/4", "one/4", "", "١/4"]
)
def test_what_is_no_part_is_refused(tmp_path, text):
    with pytest.raises(InputError, match="part: expected K/N with K from 1 to N, such as 3/16, found "):
        sweep(tmp_path / "out", part=text)
    assert not (tmp_path / "out").exists()
    assert read_part("16/16") == (16, 16)


def test_parts_one_after_the_other_make_the_dataset(tmp_path):
    sweep(tmp_path / "whole")
    for number in (2, 3, 1):
        report = sweep(tmp_path / "parts", part=f"{number}/3")
        assert (report.total, report.done, report.remaining, report.exit_status) == (20, 20, 0, 0)
        assert report.results == tmp_path / "parts" / "results.nc"
    with open_results(tmp_path / "parts") as found, open_results(tmp_path / "whole") as expected:
        assert_same_numbers(found, expected)


def test_parts_side_by_side_make_the_dataset(start, tmp_path):
    options = {"runs": RUNS, "parameters": {"pause": 0.01, "raise_at": 7}}
    parts = [start({"out": tmp_path / "parts", **options, "sweep": {"part": f"{k}/3"}}) for k in (1, 2, 3)]
    ends = [part.finish() for part in parts]
    assert sorted(end.returncode for end in ends) == [0, 0, 1], [end.stderr for end in ends]
    assert [json.loads(end.stdout)["remaining"] for end in ends] == [0, 0, 0]
    run(job(raise_at=7), tmp_path / "whole", simulator=Simulator(), progress=False)
    # gathered by the last of them, without being asked
    with open_results(tmp_path / "parts") as found, open_results(tmp_path / "whole") as expected:
        assert_same_numbers(found, expected)


def test_a_part_that_is_done_does_nothing(tmp_path):
    class Idle(Simulator):
        def run_points(self, *arguments):
            raise AssertionError("a run was repeated")

    sweep(tmp_path, part="2/3")
    logs = set((tmp_path / "records").iterdir())
    report = run(job(), tmp_path, simulator=Idle(), progress=False, part="2/3")
    assert (report.done, report.exit_status, report.gained) == (20, 0, 0)
    assert set((tmp_path / "records").iterdir()) == logs


def test_one_gathers_at_a_time(tmp_path):
    sweep(tmp_path)
    folder = StudyFolder(tmp_path)
    folder.results.unlink()
    other = threading.Thread(target=gather, args=(tmp_path,))
    with locked(folder.gather_lock):
        other.start()
        time.sleep(0.3)  # long enough to gather
        assert not folder.results.exists()
    other.join(PATIENCE)
    assert folder.results.exists()


@pytest.fixture
def at_work(start, tmp_path):
    """Part 1/2, at work until it is ended, with one run recorded."""
    slow = {"from": 1, "pause": 300.0}
    first = start({"out": tmp_path, "runs": RUNS, "slow": slow, "sweep": {"part": "1/2"}})
    wait_until(lambda: records(tmp_path) == 1, "the first record")
    return first


def test_a_part_at_work_refuses_its_double_and_the_whole_but_not_another_part(at_work, tmp_path):
    found = f"that no run is at work in, found process {at_work.process.pid} on"
    with pytest.raises(InputError, match=f"expected a part 1/2 {found}"):
        sweep(tmp_path, part="1/2")
    for fresh in (False, True):
        with pytest.raises(InputError, match="expected a folder that no run is at work in, found process"):
            sweep(tmp_path, fresh=fresh)
    assert records(tmp_path) == 1
    assert read_status(tmp_path).running
    report = sweep(tmp_path, part="2/2")
    assert (report.done, report.remaining, report.exit_status) == (30, 0, 0)
    # left to the part that ends last, which is told to stop here
    assert report.results is None and not (tmp_path / "results.nc").exists()
    at_work.process.send_signal(signal.SIGUSR1)
    finished = at_work.finish()
    assert finished.returncode == 99, finished.stderr
    assert (json.loads(finished.stdout)["done"], json.loads(finished.stdout)["remaining"]) == (1, 29)
    assert not read_status(tmp_path).running
    with open_results(tmp_path) as dataset:
        assert int((dataset["status"] == 1).sum()) == 31


def test_a_part_that_was_killed_is_gone_on_with(at_work, tmp_path):
    sweep(tmp_path, part="2/2")
    at_work.kill()
    at_work.process.wait()
    gather(tmp_path)
    with open_results(tmp_path) as dataset:
        assert int((dataset["status"] == 1).sum()) == 31
    assert sweep(tmp_path).gained == 29  # the whole takes what is left
    assert sweep(tmp_path, part="1/2").gained == 0


def test_a_part_is_refused_while_the_whole_is_at_work(start, tmp_path):
    whole = start({"out": tmp_path, "runs": RUNS, "slow": {"from": 1, "pause": 300.0}})
    wait_until(lambda: records(tmp_path) == 1, "the first record")
    with pytest.raises(InputError, match=f"in, found process {whole.process.pid} on"):
        sweep(tmp_path, part="2/2")


def test_a_part_does_not_start_over(tmp_path):
    sweep(tmp_path, part="1/2")
    with pytest.raises(InputError, match="fresh: expected a run of the whole study, found part 2/2"):
        sweep(tmp_path, part="2/2", fresh=True)
    assert records(tmp_path) == 30
    assert sweep(tmp_path, fresh=True).gained == RUNS
    assert not list(tmp_path.glob(".part-*"))


def test_a_start_without_any_gain_ends_with_98(tmp_path):
    assert sweep(tmp_path, time_limit=0.0).exit_status == 98

    class Late(Simulator):
        def run_point(self, job, point, interrupt):
            if point["load"] == 4:
                raise self.Interrupted
            return super().run_point(job, point, interrupt)

    late = run(job(), tmp_path, simulator=Late(), progress=False, time_limit=math.inf)
    assert (late.gained, late.remaining, late.exit_status) == (RUNS - 1, 1, 99)
    assert run(job(), tmp_path, simulator=Late(), progress=False).exit_status == 98
