"""Output folders of somebody else: changed, made up, or full of links; what is not believed is one clear line."""

import json
import os
import random
import signal
import sys
import threading
import time
import zlib
from types import SimpleNamespace

import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job
from cvt_hpc.ladder.making import run_ladder
from cvt_hpc.locks import BusyError, locked
from cvt_hpc.netcdf import write_history
from cvt_hpc.output_folder import checksum
from cvt_hpc.study import gather, open_results, read_status, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.frames import FORMAT_VERSION, PREAMBLE, RECORD, RecordFormat
from cvt_hpc.study.repeats import Repeat
from support.recorded import assert_same_numbers
from support.study_double import Job, Simulator
from support.study_processes import wait_until

JOB = Job(histories=(3,))
GATHERING = sys.modules["cvt_hpc.study.gather"]  # whose name is that of its function
READERS = {"status": read_status, "gather": gather, "map": open_results}
STRAND = """
name = "strand"
model = "strand"
[axes]
load = ["40 N m", "80 N m"]
[mesh]
ritz_functions = 5
"""


def sweep(out, job=JOB, **options):
    return run(job, out, simulator=Simulator(), progress=False, **options)


@pytest.fixture
def out(tmp_path):
    sweep(tmp_path / "out")
    return tmp_path / "out"


@pytest.fixture
def mine(tmp_path):
    """A folder with a file that nobody else may write to."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "precious").write_text("mine")
    yield folder
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"precious": "mine"}


def change(out, edit, signed=False):
    """Change what job.json says; `signed` with a checksum that fits."""
    path = out / "job.json"
    entry = json.loads(path.read_text())
    edit(entry)
    if signed:
        entry.pop("checksum", None)
        entry["checksum"] = checksum(entry)
    path.write_text(json.dumps(entry))


def shift(entry):
    entry["axes"][0]["values"][3] = 3.5


def shift_all(entry):
    shift(entry)
    entry["job"]["axes"]["load"][3] = 3.5


class TestChangedJobFile:
    """One value of an axis has changed in job.json."""

    @pytest.mark.parametrize("edit", [shift, shift_all])
    @pytest.mark.parametrize("use", READERS.values(), ids=READERS)
    def test_who_reads_refuses_it(self, out, edit, use):
        change(out, edit)
        before = (out / "results.nc").read_bytes()
        with pytest.raises(InputError, match="does not fit its checksum.*`cvt-hpc run` of its job") as caught:
            use(out)
        assert "\n" not in str(caught.value)
        assert (out / "results.nc").read_bytes() == before

    @pytest.mark.parametrize("signed", [False, True])
    def test_run_mends_it(self, out, signed, caplog):
        whole = (out / "job.json").read_text()
        change(out, shift_all, signed)
        assert sweep(out).gained == 0
        assert "job.json: " in caplog.text and "written anew" in caplog.text
        assert (out / "job.json").read_text() == whole
        with open_results(out) as found:
            assert found["load"].values.tolist() == list(range(12))

    @pytest.mark.parametrize("fresh", [False, True])
    def test_run_mends_it_without_any_record(self, out, fresh):
        for log in (out / "records").iterdir():
            log.unlink()
        change(out, shift)
        assert sweep(out, fresh=fresh).gained == 12
        assert read_status(out).done == 12

    @pytest.mark.parametrize("use", READERS.values(), ids=READERS)
    def test_axes_and_job_that_differ_are_refused_whatever_the_checksum(self, out, use):
        change(out, shift, signed=True)
        with pytest.raises(InputError, match="load: not the values of its job"):
            use(out)


class TestJobFileWithoutChecksum:
    """Of an earlier version; of a real job, whose fingerprint follows from what the file says."""

    @pytest.fixture
    def out(self, tmp_path):
        (tmp_path / "strand.toml").write_text(STRAND)
        run(load_job(tmp_path / "strand.toml"), tmp_path / "out", progress=False)
        change(tmp_path / "out", lambda entry: entry.pop("checksum"))
        return tmp_path / "out"

    def test_it_is_read_and_gets_one_by_the_next_run(self, out):
        assert read_status(out).done == 2
        gather(out)
        assert "checksum" not in json.loads((out / "job.json").read_text())
        assert run(load_job(out.parent / "strand.toml"), out, progress=False).gained == 0
        assert "checksum" in json.loads((out / "job.json").read_text())

    @pytest.mark.parametrize("use", READERS.values(), ids=READERS)
    def test_a_changed_one_is_refused(self, out, use):
        def edit(entry):
            entry["axes"][0]["values"][1] = entry["job"]["axes"]["load"][1] = 90.0

        change(out, edit)
        with pytest.raises(
            InputError, match="its job does not give its fingerprint.; `cvt-hpc run` of its job"
        ):
            use(out)


class TestLinks:
    """Links in the folder lead to `mine`, which stays as it is."""

    @pytest.mark.parametrize("name", ["run.lock", "gather.lock"])
    @pytest.mark.parametrize("target", ["precious", "new"])
    def test_a_lock_is_refused_and_mended_by_fresh(self, out, mine, name, target):
        (out / name).unlink()
        (out / name).symlink_to(mine / target)
        with pytest.raises(InputError, match=f"{name}: expected a file, found a link; remove it, or --fresh"):
            sweep(out)
        if name == "gather.lock":
            with pytest.raises(InputError, match="expected a file to lock, found: a link"):
                gather(out)
        assert sweep(out, fresh=True).gained == 12
        gather(out)

    def test_a_lock_that_has_a_second_name_is_refused(self, out, mine):
        (out / "gather.lock").unlink()
        os.link(mine / "precious", out / "gather.lock")
        with pytest.raises(InputError, match="a file that has a second name elsewhere"):
            gather(out)

    def test_the_folder_of_records(self, out, mine):
        (out / "records").rename(out / "elsewhere")
        (out / "records").symlink_to(mine)
        (mine / "rank-0.log").write_text("a log of mine")
        with pytest.raises(
            InputError, match="records: expected a folder, found a link; remove it, or --fresh"
        ):
            sweep(out)
        assert sweep(out, fresh=True).gained == 12
        assert (mine / "rank-0.log").read_text() == "a log of mine"
        (mine / "rank-0.log").unlink()

    def test_the_folder_of_histories(self, out, mine):
        for path in (out / "histories").iterdir():
            path.unlink()
        (out / "histories").rmdir()
        (out / "histories").symlink_to(mine)
        with pytest.raises(InputError, match="histories: expected .* found: a link in the place of a folder"):
            sweep(out)
        assert sweep(out, fresh=True).gained == 12
        assert (out / "histories" / "run-000003.nc").exists()

    def test_what_is_replaced(self, out, mine):
        for name in ("results.nc", "job.json"):
            (out / name).unlink()
            (out / name).symlink_to(mine / "precious")
        assert sweep(out).done == 12
        assert not (out / "results.nc").is_symlink() and not (out / "job.json").is_symlink()

    def test_half_written_files(self, out, mine, monkeypatch):
        monkeypatch.setattr("cvt_hpc.files.secrets.token_hex", lambda length: "guessed")
        (out / ".results.nc.guessed.part").symlink_to(mine / "precious")
        monkeypatch.setattr(StudyFolder, "leftovers", lambda folder: [])
        with pytest.raises(InputError, match="found: File exists"):
            gather(out)

    def test_names_of_half_written_files_are_not_the_same_twice(self, tmp_path, monkeypatch):
        names = []
        monkeypatch.setattr("cvt_hpc.files.os.replace", lambda aside, path: names.append(aside.name))
        for _ in range(2):
            monkeypatch.setattr("cvt_hpc.netcdf.write_netcdf", lambda dataset, path: None)
            write_history(xr.Dataset(), tmp_path / "h.nc")
        assert len(set(names)) == 2

    def test_crash_log(self, start, tmp_path, mine):
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / "crash.log").symlink_to(mine / "precious")
        slow = {"pause": 0.05}  # so that one rank does not do all runs before the other has begun
        options = {"out": tmp_path / "out", "break_rank": 1, "parameters": slow}
        finished = start(options, ranks=2).finish()
        assert finished.returncode != 0 and "a defect outside of runs" in finished.stderr

    @pytest.mark.parametrize(
        "name", ["job.json", "run.lock", "gather.lock", "records", "histories", "results.nc"]
    )
    def test_a_link_to_itself_is_mended_by_fresh(self, out, name):
        path = out / name
        if path.is_dir():
            path.rename(out / "elsewhere")
        else:
            path.unlink()
        path.symlink_to(name)
        with open_results(sweep(out, fresh=True).out) as found:
            assert (found["status"] == 1).all()


@pytest.mark.parametrize("linked", ["audit", "rung"])
def test_a_folder_within_that_is_a_link_is_refused_before_anything_is_run(out, mine, linked):
    (out / linked).symlink_to(mine)
    with pytest.raises(InputError, match=f"{linked}: expected a folder of its own, found a link"):
        if linked == "rung":
            run_ladder([SimpleNamespace(name="rung", job=JOB)], out, tell=None)
        else:
            Repeat("audit", "in full", JOB, out, "audit", JOB, 0.5, None, None).check(fresh=False)


class TestHeldGatherLock:
    """Somebody holds gather.lock."""

    def test_who_waits_says_for_whom_and_gives_up(self, out, monkeypatch, caplog):
        monkeypatch.setattr(GATHERING, "PATIENCE", 0.5)
        monkeypatch.setattr("cvt_hpc.locks._SILENCE", 0.1)
        with locked(out / "gather.lock"), pytest.raises(BusyError, match=f"found process {os.getpid()} on"):
            gather(out)
        assert f"gather.lock: waits for process {os.getpid()} on" in caplog.text

    def test_a_name_that_is_left_of_a_dead_process_is_not_told(self, out, monkeypatch):
        monkeypatch.setattr(GATHERING, "PATIENCE", 0.1)
        with locked(out / "gather.lock"):
            word = (out / "gather.lock").read_text()
            (out / "gather.lock").write_text(word.replace(f"process {os.getpid()}", "process 4194304"))
            with pytest.raises(BusyError, match="found a process that has not left its name"):
                gather(out)

    def test_a_signal_ends_the_wait_of_a_run(self, start, out):
        sweep(out)
        with locked(out / "gather.lock"):
            waiting = start({"out": out, "runs": 12, "histories": [3]})
            wait_until(lambda: "at work since" in (out / "run.lock").read_text(), "the start")
            time.sleep(1.0)  # to get there from here
            waiting.process.send_signal(signal.SIGTERM)
            began = time.monotonic()
            finished = waiting.finish()
        assert finished.returncode == 0, finished.stderr  # all runs are on record
        assert time.monotonic() - began < 10.0  # [s]; it waits for 600 otherwise
        assert "not gathered" in finished.stderr


def odd(value):
    """Values that are not what stands there."""
    deep = value
    for _ in range(60):
        deep = [deep]
    found = [None, True, -1, 1e300, 10**30, "", "\x1b[31m", "../../x", [], {}, [value], {"a": value}, deep]
    return [one for one in found if one != value]


def places(entry, path=()):
    """Yield the places of all values of a document."""
    for key in entry if isinstance(entry, dict) else range(len(entry)):
        yield (*path, key)
        if isinstance(entry[key], (dict, list)):
            yield from places(entry[key], (*path, key))


def test_a_job_file_of_odd_types_with_a_checksum_is_one_line(out, capsys, caplog):
    whole = (out / "job.json").read_text()
    document = json.loads(whole)
    every = [place for place in places(document) if place[0] not in ("format", "checksum")]
    chance = random.Random(1)
    refused = 0
    for place in chance.sample(every, 60):
        *inner, last = place
        entry = json.loads(whole)
        at = entry
        for key in inner:
            at = at[key]
        at[last] = chance.choice(odd(at[last]))
        del entry["checksum"]
        (out / "job.json").write_text(json.dumps({**entry, "checksum": checksum(entry)}))
        for command in ("status", "gather"):
            status = main([command, str(out)])
            told = capsys.readouterr().err
            assert status in (0, 2), (place, told)
            assert status == 0 or (told.count("\n") == 1 and "\x1b" not in told), (place, told)
            refused += status == 2
    assert refused > 60  # texts may be others


def test_a_name_that_does_not_print_is_escaped(out, capsys):
    entry = json.loads((out / "job.json").read_text())
    del entry["checksum"]
    entry["name"] = "gr\u00fcn\x1b[31m\n"
    (out / "job.json").write_text(json.dumps({**entry, "checksum": checksum(entry)}))
    assert [main([command, str(out)]) for command in ("status", "gather", "map")] == [0, 0, 0]
    assert capsys.readouterr().out.startswith("job     gr\u00fcn\\x1b[31m\\n (")


@pytest.mark.parametrize(
    "text",
    [b"[" * 10**5, b'{"format": ' + b"[" * 10**5, b"9" * 5000, b'{"format": "cvt_hpc study 1", "axes": NaN}'],
    ids=["lists", "format", "digits", "nan"],
)
def test_a_job_file_that_json_cannot_read_is_one_line(out, text):
    (out / "job.json").write_bytes(text)
    for use in READERS.values():
        with pytest.raises(InputError, match="found damage"):
            use(out)


def sign(study, header):
    """Return a log that begins with any header."""
    text = json.dumps(header).encode() if not isinstance(header, bytes) else header
    check = zlib.crc32(text, FORMAT_VERSION)
    return PREAMBLE.pack(b"\x89CVTREC\n", FORMAT_VERSION, len(text), check) + text


HEADERS = {
    "a number": 5,
    "empty": {},
    "deep": b"[" * 10**5,
    "fingerprint": {"fingerprint": 5, "dtype": [], "session": {}},
    "no session": {"session": None},
    "list": {"session": []},
    "times": {"session": {"started": "x", "id": 5}},
    "versions": {"session": {"versions": 5}},
    "refine": {"session": {"refine": "x"}},
    "far": {"session": {"started": 1e300}},
}


@pytest.mark.parametrize("header", HEADERS.values(), ids=HEADERS)
def test_a_log_header_of_odd_content_with_a_checksum_costs_no_record(out, header, caplog):
    study = StudyFolder(out).load()
    (log,) = (out / "records").iterdir()
    data = log.read_bytes()
    length = PREAMBLE.unpack_from(data)[2]
    sound = json.loads(data[PREAMBLE.size : PREAMBLE.size + length])
    if isinstance(header, dict) and "session" in header and "dtype" not in header:
        session = header["session"]
        header = {
            **sound,
            "session": {**sound["session"], **session} if isinstance(session, dict) and session else session,
        }
    log.write_bytes(sign(study, header) + data[PREAMBLE.size + length :])
    gather(out)
    with open_results(out) as found:
        assert (found["status"] == 1).all()
    assert "the header is damaged" in caplog.text
    assert sweep(out).gained == 0


def test_frames_that_no_sweep_writes_do_not_count(out):
    study = StudyFolder(out).load()
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    row = study.pack_failure("made up")
    unknown = row.copy()
    unknown["status"] = 77
    frames = [
        layout.record((1, 2**32 - 1), 1.0, row),
        layout.record((1, 0), 1.0, row),
        layout.record((1, 1), float("nan"), row),
        layout.record((1, 1), 1e300, row),
        layout.record((1, 1), 1.0, unknown),
        layout.mark(b"\xf5AGN", [(1, 2**32 - 1)], 1.0),
    ]
    with open_results(out) as found:
        before = found.load()
    (out / "records" / "rank-9.log").write_bytes(layout.preamble({}, 9) + b"".join(frames))
    (warning,) = read_status(out).warnings
    assert "rank-9.log: left out: no record of this study in it" in warning
    assert sweep(out, retry=[3]).gained == 0
    with open_results(out) as found:
        assert_same_numbers(found, before)


class TestNotRegular:
    """What would be waited for, or read for ever, among the logs."""

    @staticmethod
    def make(path, kind):
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "device":
            path.symlink_to("/dev/zero")
        elif kind == "sparse":
            with path.open("wb") as file:
                file.truncate(1 << 40)
        elif kind == "markers":
            path.write_bytes((RECORD + b"\0\0\0\0") * (1 << 20))
        elif kind == "marks":
            path.write_bytes((b"\xf5BEG" + (12 << 20).to_bytes(4, "little")) * (1 << 20))

    @pytest.mark.parametrize("kind", ["pipe", "device", "sparse", "markers", "marks"])
    def test_among_the_logs(self, out, kind):
        self.make(out / "records" / "rank-7.log", kind)
        began = time.monotonic()
        status = read_status(out)
        assert status.done == 12 and len(status.warnings) == 1
        assert "rank-7.log: left out" in status.warnings[0]
        assert time.monotonic() - began < 15.0  # [s]; half an hour for 1 TB, minutes for a file of markers
        assert sweep(out).gained == 0

    @pytest.mark.parametrize("kind", ["pipe", "device", "sparse"])
    @pytest.mark.parametrize("name", ["job.json", "results.nc", "run.lock", "gather.lock"])
    def test_in_the_folder(self, out, name, kind):
        (out / name).unlink()
        self.make(out / name, kind)
        ends = []

        def use():
            for reader in READERS.values():
                try:
                    reader(out)
                except InputError as error:
                    ends.append(str(error))

        thread = threading.Thread(target=use, daemon=True)
        thread.start()
        thread.join(30.0)
        assert not thread.is_alive()
        assert all("\n" not in end for end in ends)
        assert sweep(out, fresh=True).gained == 12
