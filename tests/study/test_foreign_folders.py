"""Output folders that are damaged, or hold links, pipes and devices; what is not believed is one clear line."""

import json
import os
import signal
import sys
import threading
import time
from types import SimpleNamespace

import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.experiments.sweeps import run_sweeps
from cvt_hpc.storage.locks import BusyError, locked
from cvt_hpc.storage.netcdf import write_history
from cvt_hpc.storage.output_folder import checksum
from cvt_hpc.study import gather, open_results, read_status, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.repeats import Repeat
from support.study_double import Job, Simulator
from support.study_processes import wait_until

JOB = Job(histories=(3,))
GATHERING = sys.modules["cvt_hpc.study.gather"]  # whose name is that of its function
READERS = {"status": read_status, "gather": gather, "map": open_results}


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
def test_a_job_file_of_an_earlier_version_without_checksum_is_written_anew(out, use):
    change(out, lambda entry: entry.pop("checksum"))
    with pytest.raises(InputError, match="does not fit its checksum.*`cvt-hpc run` of its job goes on"):
        use(out)
    assert sweep(out).gained == 0
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
        monkeypatch.setattr("cvt_hpc.storage.files.secrets.token_hex", lambda length: "guessed")
        (out / ".results.nc.guessed.part").symlink_to(mine / "precious")
        monkeypatch.setattr(StudyFolder, "leftovers", lambda folder: [])
        with pytest.raises(InputError, match="found: File exists"):
            gather(out)

    def test_names_of_half_written_files_are_not_the_same_twice(self, tmp_path, monkeypatch):
        names = []
        monkeypatch.setattr("cvt_hpc.storage.files.os.replace", lambda aside, path: names.append(aside.name))
        for _ in range(2):
            monkeypatch.setattr("cvt_hpc.storage.netcdf.write_netcdf", lambda dataset, path: None)
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
            run_sweeps([SimpleNamespace(name="rung", job=JOB)], {}, out, fresh=False, tell=print)
        else:
            Repeat("audit", "in full", JOB, out, "audit", JOB, 0.5, None, None).check(fresh=False)


class TestHeldGatherLock:
    """Somebody holds gather.lock."""

    def test_who_waits_says_for_whom_and_gives_up(self, out, monkeypatch, caplog):
        monkeypatch.setattr(GATHERING, "PATIENCE", 0.5)
        monkeypatch.setattr("cvt_hpc.storage.locks._SILENCE", 0.1)
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


def test_a_name_that_does_not_print_is_escaped(out, capsys):
    entry = json.loads((out / "job.json").read_text())
    del entry["checksum"]
    entry["name"] = "gr\u00fcn\x1b[31m\n"
    (out / "job.json").write_text(json.dumps({**entry, "checksum": checksum(entry)}))
    assert [main([command, str(out)]) for command in ("status", "gather", "map")] == [0, 0, 0]
    assert capsys.readouterr().out.startswith("job     gr\u00fcn\\x1b[31m\\n (")


@pytest.mark.parametrize(
    "text",
    [b"[" * 10**5, b"9" * 5000, b"5", b'{"format": "cvt_hpc study 1", "axes": NaN}'],
    ids=["lists", "digits", "number", "nan"],
)
def test_a_job_file_that_json_cannot_read_is_one_line(out, text):
    (out / "job.json").write_bytes(text)
    for use in READERS.values():
        with pytest.raises(InputError, match="found damage"):
            use(out)


class TestNotRegular:
    """What would be waited for, or read for ever."""

    @staticmethod
    def make(path, kind):
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "device":
            path.symlink_to("/dev/zero")
        elif kind == "sparse":
            with path.open("wb") as file:
                file.truncate(1 << 40)

    @pytest.mark.parametrize("kind", ["pipe", "device"])
    def test_among_the_logs(self, out, kind):
        self.make(out / "records" / "rank-7.log", kind)
        status = read_status(out)
        assert status.done == 12 and len(status.warnings) == 1
        assert "rank-7.log: left out" in status.warnings[0]
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
