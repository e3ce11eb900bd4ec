"""Gathering piece by piece: the same numbers as all at once, in bounded memory, and whole whatever comes between."""

import os
import resource
import signal
import subprocess
import sys
import tracemalloc

import netCDF4
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.storage.files import StorageError
from cvt_hpc.study import gather, open_results, run
from cvt_hpc.study.description import describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.gather import contiguous_part
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.record.log import RecordFormat, RecordLog
from cvt_hpc.variables import Status
from support.study_double import Axis, Coordinate, Job, Simulator
from support.study_processes import clean_environment, wait_until

SESSION = {
    "id": "a", "started": 1.0, "command": "run", "host": "here", "ranks": 1, "versions": {}, "git_revision": "",
}  # fmt: skip


def grid(*lengths):
    return Job(tuple(Axis(f"axis_{i}", tuple(range(length))) for i, length in enumerate(lengths)))


def make_rows(study, seed=0):
    generator = np.random.default_rng(seed)
    rows = study.blank_rows(study.size)
    for name in ("amplitude", "spectrum", "core_seconds"):
        rows[name] = generator.standard_normal(rows[name].shape)
    rows["steps"] = generator.integers(0, 1 << 60, study.size)
    rows["status"] = generator.integers(1, 4, study.size)
    rows["reason"] = [f"reason δ {i}".encode() for i in generator.integers(0, 1 << 30, study.size)]
    return rows


def write_log(out, study, rows, runs):
    """Write records into a new log of a study's folder."""
    folder = StudyFolder(out)
    folder.create()
    folder.save(study)
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    with RecordLog(folder.records, layout, SESSION, rank=0) as log:
        for i in range(0, len(runs), 50):
            log.append([(int(index), rows[index]) for index in runs[i : i + 50]])
    return log.path


def assert_holds(path, study, rows):
    """Assert that a dataset has the numbers of records, bitwise, and the texts."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        for name in rows.dtype.names:
            expected = rows[name].reshape(study.shape + rows[name].shape[1:])
            if expected.dtype.kind == "S":
                assert file[name][...].tolist() == np.char.decode(expected, "utf-8").tolist()
            else:
                assert file[name].dtype == expected.dtype
                assert np.asarray(file[name][...]).tobytes() == expected.tobytes(), name


@pytest.mark.parametrize("shape", [(), (9, 7), (2, 1, 17)])
@pytest.mark.parametrize("block", [1, 5, 10_000])
@pytest.mark.parametrize("chunk", [1, 700])
def test_the_dataset_does_not_depend_on_its_pieces(tmp_path, monkeypatch, shape, block, chunk):
    study = describe(grid(*shape), Simulator())
    monkeypatch.setattr("cvt_hpc.study.record.index.BLOCK", block * study.record_dtype.itemsize)
    monkeypatch.setattr(sys.modules["cvt_hpc.study.gather"], "CHUNK", chunk)
    monkeypatch.setattr("cvt_hpc.study.record.log.WINDOW", 1000)  # less than two frames
    rows = make_rows(study)
    order = np.random.default_rng(1).permutation(study.size)
    for part in (order[::2], order[1::2]):
        write_log(tmp_path, study, rows, part)
    assert_holds(gather(tmp_path), study, rows)


def test_gaps_damage_and_repetition_cost_only_what_they_struck(tmp_path, monkeypatch, caplog):
    study = describe(grid(6, 10), Simulator())
    monkeypatch.setattr("cvt_hpc.study.record.index.BLOCK", 7 * study.record_dtype.itemsize)
    monkeypatch.setattr("cvt_hpc.study.record.log.WINDOW", 1000)
    rows, others = make_rows(study), make_rows(study, seed=1)
    first = write_log(tmp_path, study, rows, range(5, 40))
    write_log(tmp_path, study, others, range(30, 50))  # of the first ten the earlier written count
    first.with_name("copy.log").write_bytes(first.read_bytes())
    torn = write_log(tmp_path, study, rows, range(50, 54))
    data = bytearray(torn.read_bytes()[:-9])
    data[-2 * RecordFormat(study.fingerprint, study.record_dtype).record_size] ^= 1  # the end of run 51
    torn.write_bytes(data)
    (first.parent / "notes.txt").write_text("mine")
    gather(tmp_path)
    expected = study.blank_rows(study.size)
    expected[5:40], expected[40:50], expected[[50, 52]] = rows[5:40], others[40:50], rows[[50, 52]]
    assert_holds(tmp_path / "results.nc", study, expected)
    lines = [record.getMessage() for record in caplog.records]
    assert sum("has other numbers than in" in line for line in lines) == 10
    assert sum("are damaged" in line for line in lines) == 1
    assert sum("unfinished record" in line for line in lines) == 1
    assert sum("notes.txt: left out: not a record log" in line for line in lines) == 1
    assert len(lines) == 13


def recorded(out):
    folder = StudyFolder(out)
    return read_records(folder.records, folder.load())


@given(st.lists(st.integers(1, 12), max_size=4), st.integers(0, 500), st.integers(0, 500))
def test_parts_follow_each_other_and_smaller_ones_fit_into_larger_ones(shape, one, other):
    small, large = (contiguous_part(tuple(shape), most) for most in sorted((one, other)))
    for part, most in ((small, min(one, other)), (large, max(one, other))):
        assert 1 <= np.prod(part, dtype=int) <= max(most, 1)
        cut = [i for i, (length, whole) in enumerate(zip(part, shape, strict=True)) if length < whole]
        assert all(length == 1 for i in cut[-1:] for length in part[:i])
    for less, more, whole in zip(small, large, shape, strict=True):
        assert more == whole or more % less == 0


class Broad(Simulator):
    """The double with spectra of 256 points."""

    def record_variables(self, job):
        return tuple(v for v in super().record_variables(job) if v.name != "reason")

    def record_coordinates(self, job):
        frequency = Coordinate(np.linspace(0, 2550, 256), "Hz", "frequency")
        return {**super().record_coordinates(job), "frequency_bin": frequency}


def test_memory_is_bounded_by_the_block_not_by_the_study(tmp_path, monkeypatch):
    runs = 8_000
    study = describe(grid(100, runs // 100), Broad())
    rows = study.blank_rows(50)
    rows["status"] = Status.DONE
    write_log(tmp_path, study, np.resize(rows, runs), range(runs))
    monkeypatch.setattr("cvt_hpc.study.record.index.BLOCK", 1 << 20)
    monkeypatch.setattr("cvt_hpc.study.record.log.WINDOW", 1 << 20)
    tracemalloc.start()
    try:
        gather(tmp_path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert next((tmp_path / "records").iterdir()).stat().st_size > 32e6

    # one block of records, as much again of compressed chunks and of chunks at work, and the index
    assert peak < 4 * (1 << 20) + 100 * runs


def test_a_running_sweep_is_gathered_again_and_again(start, tmp_path):
    # loads xarray and what it needs, for which no sweep would wait
    open_results(run(grid(1), tmp_path / "first", simulator=Simulator(), progress=False).out).close()
    out, runs = tmp_path / "out", 160
    sweep = start({"out": out, "runs": runs, "parameters": {"pause": 0.02}}, ranks=2)
    wait_until(lambda: (out / "job.json").exists() and recorded(out).recorded.any(), "the first record")
    snapshots = []
    while sweep.process.poll() is None:
        with open_results(gather(out)) as dataset:
            snapshots.append(dataset.load())
    assert sweep.finish().returncode == 0
    with open_results(out) as final:
        assert (final["status"] == Status.DONE).all()
        for snapshot in snapshots:
            done = (snapshot["status"] == Status.DONE).values
            for name in ("amplitude", "spectrum", "core_seconds"):
                assert snapshot[name].values[done].tobytes() == final[name].values[done].tobytes()
                assert np.isnan(snapshot[name].values[~done]).all()
    counts = [int((snapshot["status"] == Status.DONE).sum()) for snapshot in snapshots]
    assert counts == sorted(counts)
    assert len(set(counts)) > 2  # there was something between the first and the last


def gather_elsewhere(out, before="pass", **options):
    """Gather in a process of its own, after some statements."""
    code = f"import os, signal, sys\n{before}\nfrom cvt_hpc.study import gather\ngather(sys.argv[1])"
    return subprocess.run(
        [sys.executable, "-c", code, str(out)],
        env=clean_environment(),
        capture_output=True,
        text=True,
        **options,
    )


KILLED = """
from importlib import import_module
def kill(*arguments, **options):
    os.kill(os.getpid(), signal.SIGKILL)
import_module("cvt_hpc.study.{module}").{function} = kill
"""


@pytest.mark.parametrize(
    ("module", "function"),
    [("gather", "_declare"), ("gather", "fill"), ("gather", "_pack")],
)
def test_a_gathering_that_is_killed_leaves_the_dataset_that_was_there(tmp_path, module, function):
    job = grid(60)
    run(job, tmp_path, simulator=Simulator(), progress=False)
    before = (tmp_path / "results.nc").read_bytes()
    finished = gather_elsewhere(tmp_path, KILLED.format(module=module, function=function))
    assert finished.returncode == -signal.SIGKILL
    assert (tmp_path / "results.nc").read_bytes() == before
    assert len(StudyFolder(tmp_path).leftovers()) == 1
    study = describe(job, Simulator())
    assert_holds(gather(tmp_path), study, recorded(tmp_path).read(np.arange(60)))


def test_a_disk_that_fills_up_among_the_chunks_leaves_the_dataset_that_was_there(tmp_path):
    study = describe(grid(500), Simulator())
    write_log(tmp_path, study, make_rows(study), range(500))
    size = gather(tmp_path).stat().st_size
    before = (tmp_path / "results.nc").read_bytes()
    limit = size - 20_000  # declarations and the first chunks fit
    finished = gather_elsewhere(
        tmp_path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    assert finished.returncode == 1, finished.stderr
    found = (
        "results.nc: expected to be able to write, found: File too large. The runs recorded so far are kept"
    )
    assert found in finished.stderr.splitlines()[-1]
    assert (tmp_path / "results.nc").read_bytes() == before
    assert list(tmp_path.glob(".*")) == []


def test_a_log_that_is_cut_short_meanwhile_is_named(tmp_path):
    study = describe(grid(8), Simulator())
    path = write_log(tmp_path, study, make_rows(study), range(8))
    records = recorded(tmp_path)
    os.truncate(path, path.stat().st_size - 10)
    assert records.read(np.arange(7)).size == 7
    with pytest.raises(StorageError, match=f"{path.name}: expected run 7, found the file cut short"):
        records.read(np.arange(8))
    path.unlink()
    with pytest.raises(StorageError, match=f"{path.name}: expected a record log that can be read"):
        records.read(3)


def test_one_quantity_is_read_alone(tmp_path):
    study = describe(grid(8), Simulator())
    rows = make_rows(study)
    write_log(tmp_path, study, rows, [1, 2, 5])
    records = recorded(tmp_path)
    for name in rows.dtype.names:
        found = records.read(np.array([[5, 0], [2, 1]]), name)
        expected = rows[name].copy()
        expected[0] = study.blank_rows()[name]
        assert found.dtype == expected.dtype
        assert found.tobytes() == expected[[5, 0, 2, 1]].tobytes()
