"""Record logs: what was written is read back bitwise, and damage costs no more than what it struck."""

import os

import numpy as np
import pytest

from cvt_hpc.storage.files import StorageError
from cvt_hpc.study.description import describe
from cvt_hpc.study.record import log
from cvt_hpc.study.record.index import read_records
from cvt_hpc.study.record.log import BEGUN, HEAD, PLACE, RECORD, RecordFormat, RecordLog
from cvt_hpc.variables import Status
from support.study_double import Axis, Job, Simulator

SESSION = {
    "id": "a",
    "started": 1.0,
    "command": "cvt-hpc run",
    "host": "here",
    "ranks": 1,
    "versions": {"numpy": "2"},
    "git_revision": "",
}
RUNS = 8


def make_study(**parameters):
    return describe(Job((Axis("load", tuple(range(RUNS))),), parameters), Simulator())


def make_rows(study, seed=0):
    rows = study.blank_rows(study.size)
    generator = np.random.default_rng(seed)
    rows["status"] = Status.DONE
    rows["amplitude"] = generator.standard_normal(rows["amplitude"].shape)
    rows["spectrum"] = generator.standard_normal(rows["spectrum"].shape)
    return rows


def write_log(folder, study, rows, indices, session=SESSION):
    folder.mkdir(exist_ok=True)
    with RecordLog(folder, RecordFormat(study.fingerprint, study.record_dtype), session, rank=0) as log:
        for index in indices:
            log.append([(index, rows[index])])
    return log.path


@pytest.fixture(autouse=True, params=[1 << 22, 100])
def window(request, monkeypatch):
    """Logs are read as a whole, and in windows of which several lie in one frame."""
    monkeypatch.setattr("cvt_hpc.study.record.log.WINDOW", request.param)


@pytest.fixture
def study():
    return make_study()


@pytest.fixture
def rows(study):
    return make_rows(study)


@pytest.fixture
def frame_size(study):
    return HEAD.size + PLACE.size + study.record_dtype.itemsize


def assert_recorded(records, rows, indices):
    """Assert that exactly these runs are recorded, bitwise, and the others blank."""
    assert list(np.flatnonzero(records.recorded)) == sorted(indices)
    found = records.read(np.arange(RUNS))
    assert found["status"].tolist() == records.status.tolist()
    for index in range(RUNS):
        if index in indices:
            assert found[index].tobytes() == rows[index].tobytes()
        else:
            assert found["status"][index] == Status.NOT_RUN
            assert np.isnan(found["amplitude"][index]).all()


def test_records_come_back_bitwise(tmp_path, study, rows):
    write_log(tmp_path / "r", study, rows, [3, 0, 7])
    write_log(tmp_path / "r", study, rows, [1], {**SESSION, "id": "b", "started": 0.5})
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [0, 1, 3, 7])
    assert [session["id"] for session in records.sessions] == ["b", "a"]
    assert records.warnings == []


def test_a_log_without_records_leaves_no_file(tmp_path, study, rows):
    write_log(tmp_path / "r", study, rows, [])
    assert list((tmp_path / "r").iterdir()) == []


@pytest.mark.parametrize("cut", ["one byte", "within the marker", "all but one byte"])
def test_a_torn_tail_costs_one_record(tmp_path, study, rows, frame_size, cut):
    path = write_log(tmp_path / "r", study, rows, [4, 5, 6])
    lost = {"one byte": 1, "within the marker": frame_size - 2, "all but one byte": frame_size - 1}[cut]
    os.truncate(path, path.stat().st_size - lost)
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [4, 5])
    assert len(records.warnings) == 1
    assert path.name in records.warnings[0]
    assert f"last {frame_size - lost} bytes are an unfinished record" in records.warnings[0]


def test_a_flipped_bit_costs_one_record(tmp_path, study, rows, frame_size):
    path = write_log(tmp_path / "r", study, rows, [4, 5, 6])
    whole = path.read_bytes()
    for place in range(HEAD.size + PLACE.size + 30):
        path.write_bytes(whole)
        flip(path, len(whole) - 2 * frame_size + place)
        records = read_records(tmp_path / "r", study)
        assert_recorded(records, rows, [4, 6])
        assert len(records.warnings) == 1, place
        assert "are damaged" in records.warnings[0]


def test_a_marker_among_the_numbers_misleads_nobody(tmp_path, study, rows, frame_size):
    rows["spectrum"].reshape(RUNS, -1)[5].view(np.uint8)[16:20] = np.frombuffer(RECORD, np.uint8)
    path = write_log(tmp_path / "r", study, rows, [4, 5, 6])
    flip(path, path.stat().st_size - 2 * frame_size)
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [4, 6])
    assert len(records.warnings) == 1


@pytest.mark.parametrize("place", [0, 9, 14, 18, 40])  # magic, version, length, checksum, text
def test_records_outlive_their_header(tmp_path, study, rows, place):
    path = write_log(tmp_path / "r", study, rows, [4, 5])
    flip(path, place)
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [4, 5])
    assert any("the header is damaged" in warning for warning in records.warnings)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"\x00\x01" * 5000, "not a record log"),
        (b"my notes", "not a record log"),
        (RECORD * 9, "not a record log"),
    ],
)
def test_a_foreign_file_is_named_and_left(tmp_path, study, rows, content, complaint):
    write_log(tmp_path / "r", study, rows, [2])
    foreign = tmp_path / "r" / "notes.log"
    foreign.write_bytes(content)
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [2])
    assert len(records.warnings) == 1
    assert "notes.log: left out" in records.warnings[0]
    assert complaint in records.warnings[0]
    assert foreign.read_bytes() == content


def test_a_folder_among_the_logs_is_named(tmp_path, study, rows):
    write_log(tmp_path / "r", study, rows, [2])
    (tmp_path / "r" / "sub").mkdir()
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [2])
    assert "sub: left out: a folder in the place of a file" in records.warnings[0]


def test_a_log_of_another_version_is_named(tmp_path, study, rows, monkeypatch):
    monkeypatch.setattr(log, "FORMAT_VERSION", 1)
    path = write_log(tmp_path / "r", study, rows, [2])
    monkeypatch.undo()
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [])
    assert records.warnings == [f"{path}: left out: expected format 2 of the record log, found 1"]


def test_marks_are_no_records_and_damage_to_them_costs_no_record(tmp_path, study, rows):
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    with RecordLog(tmp_path, layout, SESSION, rank=0, attempts={5: 3}) as log:
        for index in (4, 5):
            log.begin([index])
            log.append([(index, rows[index])])
    records = read_records(tmp_path, study)
    assert_recorded(records, rows, [4, 5])
    assert records.attempts.tolist() == [1] * 5 + [3] + [1] * 2
    mark = log.path.read_bytes().rindex(BEGUN)
    for place in range(HEAD.size + PLACE.size):
        flip(log.path, mark + place)
        records = read_records(tmp_path, study)
        assert_recorded(records, rows, [4, 5])
        assert records.warnings == [
            f"{log.path}: bytes {mark} to {mark + HEAD.size + PLACE.size} are damaged; left out"
        ]
        flip(log.path, mark + place)


def test_a_batch_without_all_its_records_has_no_time(tmp_path, study, rows):
    with RecordLog(tmp_path, RecordFormat(study.fingerprint, study.record_dtype), SESSION, rank=0) as log:
        for batch, recorded in (([0], [0]), ([1, 2], [1, 2]), ([3, 4], [3])):
            log.begin(batch)
            log.append([(index, rows[index]) for index in recorded])
    assert [timing.batch for timing in read_records(tmp_path, study).timings] == [(1, 2)]


def test_a_torn_mark_is_no_death(tmp_path, study, rows):
    path = write_log(tmp_path, study, rows, [4])
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    with path.open("ab") as file:
        file.write(layout.mark(BEGUN, [(5, 1), (6, 1)], 2.0)[:-1])
    records = read_records(tmp_path, study)
    assert_recorded(records, rows, [4])
    assert records.died.sum() == 0
    assert "unfinished" in records.warnings[0]


def test_records_of_another_job_do_not_count(tmp_path, study, rows):
    path = write_log(tmp_path / "r", make_study(thrust=2.0), rows, [2])
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [])
    assert "another job" in records.warnings[0]
    flip(path, 0)  # nor where the header can no longer tell
    assert_recorded(read_records(tmp_path / "r", study), rows, [])


def test_the_earliest_of_two_records_counts_whatever_the_file_names(tmp_path, study, rows):
    later = make_rows(study, seed=1)
    first = write_log(tmp_path / "r", study, rows, [2])
    second = write_log(tmp_path / "r", study, later, [2, 3])
    for names in (("a.log", "b.log"), ("d.log", "c.log")):
        first = first.rename(first.with_name(names[0]))
        second = second.rename(second.with_name(names[1]))
        records = read_records(tmp_path / "r", study)
        assert records.read(2).tobytes() == rows[2].tobytes()
        assert records.read(3).tobytes() == later[3].tobytes()
        assert "run 2 has other numbers" in records.warnings[0]
        assert f"{names[0]}, which counts" in records.warnings[0]


def test_a_copied_log_changes_nothing(tmp_path, study, rows):
    path = write_log(tmp_path / "r", study, rows, [2, 3])
    path.with_name("copy.log").write_bytes(path.read_bytes())
    records = read_records(tmp_path / "r", study)
    assert_recorded(records, rows, [2, 3])
    assert records.warnings == []


def test_timings_may_differ_between_records_of_a_run(tmp_path, study, rows):
    write_log(tmp_path / "r", study, rows, [2])
    slower = rows.copy()
    slower["core_seconds"] = 99.0
    write_log(tmp_path / "r", study, slower, [2])
    assert read_records(tmp_path / "r", study).warnings == []


def test_a_refused_write_leaves_whole_records(tmp_path, study, rows, monkeypatch):
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    log = RecordLog(tmp_path, layout, SESSION, rank=0)
    log.append([(1, rows[1])])
    system_write = os.write

    def short_then_full(descriptor, data):
        if len(data) < layout.record_size:
            raise OSError(28, "No space left on device")
        return system_write(descriptor, data[:50])

    monkeypatch.setattr(os, "write", short_then_full)
    with pytest.raises(StorageError, match="No space left on device"):
        log.append([(2, rows[2]), (4, rows[4])])
    monkeypatch.undo()
    log.append([(3, rows[3])])
    log.close()
    records = read_records(tmp_path, study)
    assert_recorded(records, rows, [1, 3])
    assert records.warnings == []


def test_the_records_of_a_batch_are_one_write(tmp_path, study, rows, frame_size, monkeypatch):
    writes = []
    system_write = os.write
    monkeypatch.setattr(os, "write", lambda fd, data: writes.append(len(data)) or system_write(fd, data))
    with RecordLog(tmp_path, RecordFormat(study.fingerprint, study.record_dtype), SESSION, rank=0) as log:
        for batch in ([6], [5, 0, 2], [7]):
            log.append([(index, rows[index]) for index in batch])
    assert writes[1:] == [frame_size, 3 * frame_size, frame_size]
    assert_recorded(read_records(tmp_path, study), rows, [0, 2, 5, 6, 7])


def test_a_torn_batch_keeps_its_whole_records(tmp_path, study, rows, frame_size):
    with RecordLog(tmp_path, RecordFormat(study.fingerprint, study.record_dtype), SESSION, rank=0) as log:
        log.append([(index, rows[index]) for index in (3, 4, 5, 6)])
    os.truncate(log.path, log.path.stat().st_size - frame_size - 1)
    assert_recorded(read_records(tmp_path, study), rows, [3, 4])


def flip(path, place):
    data = bytearray(path.read_bytes())
    data[place] ^= 0x10
    path.write_bytes(data)
