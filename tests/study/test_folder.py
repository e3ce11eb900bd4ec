"""The output folder: nothing of another job, of another run at work, or of the user is touched."""

import json
import os

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.storage.locks import is_locked, locked
from cvt_hpc.study import gather, open_results, read_status, run
from support.study_double import Axis, Job, Simulator
from support.study_processes import wait_until

JOB = Job()
OTHER = Job(parameters={"thrust": 2.0})


def sweep(job, out, **options):
    return run(job, out, simulator=Simulator(), progress=False, **options)


def content(folder):
    """Return every file's bytes, without those of the lock, which a refused start may touch."""
    return {p: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file() and p.name != "run.lock"}


def test_job_file_holds_the_whole_job(tmp_path):
    sweep(JOB, tmp_path / "out")
    entry = json.loads((tmp_path / "out" / "job.json").read_text())
    assert entry["format"] == "cvt_hpc study 1"
    assert entry["job"] == JOB.resolved()
    assert entry["fingerprint"] == JOB.fingerprint()


def test_default_folder_has_the_name_of_the_job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sweep(JOB, None).results == (tmp_path / "out" / "double" / "results.nc").relative_to(tmp_path)


@pytest.mark.parametrize(
    "other", [OTHER, Job((Axis("load", (1, 2)),)), Job((Axis("torque", tuple(range(12))),))]
)
def test_a_folder_of_another_job_is_refused(tmp_path, other):
    sweep(JOB, tmp_path)
    before = content(tmp_path)
    with pytest.raises(InputError, match="found that of another") as caught:
        sweep(other, tmp_path)
    told = ("is not set there", "there,", "load has 10 values there that it lacks here (0, 3, 4, ..., 11)")
    assert any(text in str(caught.value) for text in told)
    assert content(tmp_path) == before


def test_a_folder_with_other_quantities_is_refused(tmp_path):
    class Richer(Simulator):
        def record_variables(self, job):
            return super().record_variables(job)[:-1]

    sweep(JOB, tmp_path)
    before = content(tmp_path)
    with pytest.raises(InputError, match="quantities of this version"):
        run(JOB, tmp_path, simulator=Richer(), progress=False)
    assert content(tmp_path) == before


def test_fresh_starts_over(tmp_path):
    sweep(JOB, tmp_path)
    (tmp_path / "crash.log").write_text("rank 1: an error")
    old_logs = set((tmp_path / "records").iterdir())
    assert sweep(OTHER, tmp_path, fresh=True).done == 12
    assert not old_logs & set((tmp_path / "records").iterdir())
    assert not (tmp_path / "crash.log").exists()
    assert json.loads((tmp_path / "job.json").read_text())["fingerprint"] == OTHER.fingerprint()


def test_fresh_removes_only_what_runs_wrote(tmp_path):
    sweep(JOB, tmp_path)
    mine = [tmp_path / "notes.txt", tmp_path / "map.png", tmp_path / "records" / "mine.csv"]
    for path in mine:
        path.write_text("mine")
    sweep(JOB, tmp_path, fresh=True)
    assert [path.read_text() for path in mine] == ["mine"] * 3


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("results.nc", "mine", "found results.nc without a job.json"),
        ("records/mine.csv", "mine", "found records without a job.json"),
        ("job.json", '{"title": "Head of Sales"}', "expected format"),
        ("job.json", "{", "expected the job of a run"),
        ("job.json", '{"format": "cvt_hpc study 1"}', "expected the job of a run, found damage"),
    ],
)
def test_what_this_program_did_not_write_is_left(tmp_path, fresh, name, text, complaint):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=complaint):
        sweep(JOB, tmp_path, fresh=fresh)
    assert content(tmp_path) == {tmp_path / name: text.encode()}


@pytest.mark.parametrize(
    "text",
    [b"", b"{", b"\xff\xfe", b'{"format": "cvt_hpc study 1"}', None],
    ids=["", "{", "ff", "bare", "gone"],
)
class TestDamagedJobFile:
    """What to do where job.json does not say whose the records are."""

    @pytest.fixture(autouse=True)
    def damaged(self, tmp_path, text):
        sweep(JOB, tmp_path)
        (tmp_path / "results.nc").unlink()
        (tmp_path / "job.json").unlink()
        if text is not None:
            (tmp_path / "job.json").write_bytes(text)

    def test_the_logs_tell_that_it_is_the_same_job(self, tmp_path, caplog):
        assert sweep(JOB, tmp_path).gained == 0
        assert f"{tmp_path / 'job.json'}: damaged or gone; written anew" in caplog.text
        assert read_status(tmp_path).done == 12
        caplog.clear()
        assert sweep(JOB, tmp_path).gained == 0
        assert not caplog.records

    def test_another_job_is_refused(self, tmp_path):
        before = content(tmp_path)
        with pytest.raises(
            InputError, match="or --fresh to throw away its results, which are of another job"
        ):
            sweep(OTHER, tmp_path)
        assert content(tmp_path) == before

    @pytest.mark.parametrize("job", [JOB, OTHER])
    def test_fresh_starts_over(self, tmp_path, caplog, job):
        assert sweep(job, tmp_path, fresh=True).gained == 12
        assert not caplog.records

    @pytest.mark.parametrize("use", [read_status, gather])
    def test_who_reads_is_told_what_to_do(self, tmp_path, use):
        with pytest.raises(InputError, match="`cvt-hpc run` of its job goes on and writes it anew"):
            use(tmp_path)


def test_a_folder_with_other_files_may_be_used(tmp_path):
    (tmp_path / "slurm-17.out").write_text("mine")
    assert sweep(JOB, tmp_path).done == 12


def test_a_file_is_no_folder(tmp_path):
    out = tmp_path / "out"
    out.write_text("mine")
    for use in (lambda: sweep(JOB, out), lambda: read_status(out)):
        with pytest.raises(InputError, match="found a file"):
            use()
    assert out.read_text() == "mine"


def test_an_impossible_folder_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="results can be written to, found: Not a directory"):
        sweep(JOB, tmp_path / "file" / "out")


@pytest.fixture
def no_privileges():
    """Let this process be an ordinary user, whom permissions stop."""
    if os.geteuid() == 0:
        os.seteuid(65534)
        yield
        os.seteuid(0)
    else:
        yield


def test_a_folder_without_permission_is_one_clear_error(tmp_path, no_privileges):
    with pytest.raises(InputError, match="results can be written to, found: Permission denied"):
        sweep(JOB, "/cvt_hpc-test/out")


@pytest.mark.parametrize("use", [read_status, lambda out: sweep(JOB, out), open_results, gather])
def test_an_unreadable_folder_is_one_clear_error(tmp_path, use, request):
    (tmp_path / "out").mkdir()
    tmp_path.chmod(0)
    try:
        request.getfixturevalue("no_privileges")
        with pytest.raises(InputError, match="expected .* found: .*Permission denied"):
            use(tmp_path / "out")
    finally:
        os.seteuid(os.getuid())
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("ranks", [0, 2])
def test_an_impossible_folder_ends_with_status_2(start, tmp_path, ranks):
    (tmp_path / "file").write_text("mine")
    finished = start({"out": tmp_path / "file" / "out"}, ranks).finish()
    assert finished.returncode == 2
    errors = [line for line in finished.stderr.splitlines() if line.startswith("error:")]
    assert len(errors) == 1
    assert "Traceback" not in finished.stderr


def test_a_second_run_at_the_same_time_is_refused(start, tmp_path):
    first = start({"out": tmp_path, "runs": 400, "parameters": {"pause": 0.1}})
    wait_until(lambda: list(tmp_path.glob("records/*.log")), "the first record")
    job = Job((Axis("load", tuple(range(400))),), {"pause": 0.1})
    with pytest.raises(InputError, match=f"no run is at work in, found process {first.process.pid} on"):
        sweep(job, tmp_path, fresh=True)
    assert list(tmp_path.glob("records/*.log"))  # --fresh has not got at them
    assert read_status(tmp_path).running
    first.kill()
    first.process.wait()
    assert not read_status(tmp_path).running
    assert sweep(job, tmp_path, time_limit=0.0).remaining < 400  # the dead one's lock does not count


def test_lock_is_free_again_after_use(tmp_path):
    with locked(tmp_path / "lock"):
        assert is_locked(tmp_path / "lock")
    assert not is_locked(tmp_path / "lock")


def test_half_written_files_of_dead_processes_are_removed(tmp_path):
    sweep(JOB, tmp_path)
    leftover = tmp_path / ".results.nc.somewhere-1.part"
    leftover.write_text("half")
    sweep(JOB, tmp_path)
    assert not leftover.exists()


@pytest.mark.parametrize("read", [read_status, open_results])
def test_reading_where_no_study_is(tmp_path, read):
    place = tmp_path / "studies" / "of_mine"  # beside no other study
    place.mkdir(parents=True)
    makes = "`cvt-hpc run JOB.toml` makes one"
    with pytest.raises(InputError, match=f"found no job.json in it; {makes}|found nothing; {makes}"):
        read(place)
    sweep(JOB, place / "first")
    with pytest.raises(InputError, match="; studies in it: first"):
        read(place)
    with pytest.raises(InputError, match="found nothing|No such file"):
        read(tmp_path / "absent")
