"""The dataset: CF conventions, the status of every run, and all that is needed to repeat it."""

import json
import math
import resource
import shutil
import subprocess
import sys

import netCDF4
import numpy as np
import pytest

import cvt_hpc
from cvt_hpc.errors import InputError
from cvt_hpc.storage.netcdf import variable_attributes
from cvt_hpc.storage.output_folder import CHECKSUM, checksum
from cvt_hpc.study import gather, open_results, run
from cvt_hpc.study.description import Study, describe
from cvt_hpc.variables import Status, Vibrates
from support.cf import cf_findings
from support.study_double import Axis, Job, Simulator
from support.study_processes import HERE, clean_environment

AXES = (
    Axis("friction_gradient", (-0.5, -0.25, 0.0), "s/m", "slope of the friction law"),
    Axis("sheave_stiffness", (1.0, math.inf), "", "multiple of the reference stiffness"),
    Axis("friction_law", ("stribeck", "algebraic"), "", "friction law"),
)
JOB = Job(AXES, {"raise_at": -0.25})


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gathered")
    run(JOB, folder, simulator=Simulator(), progress=False)
    return folder


@pytest.fixture
def dataset(out):
    with open_results(out) as opened:
        yield opened


def test_axes_are_the_dimensions(dataset):
    assert dataset["status"].dims == ("friction_gradient", "sheave_stiffness", "friction_law")
    assert dataset["friction_gradient"].values.tolist() == [-0.5, -0.25, 0.0]
    assert dataset["sheave_stiffness"].values.tolist() == [1.0, math.inf]
    assert dataset["friction_law"].values.tolist() == ["stribeck", "algebraic"]
    assert dataset["friction_gradient"].attrs == {
        "units": "s/m",
        "long_name": "friction gradient",
        "comment": "slope of the friction law",
    }
    assert dataset["sheave_stiffness"].attrs["units"] == "1"
    assert "units" not in dataset["friction_law"].attrs


def test_the_names_of_files_that_gave_parameters_are_kept_and_may_change(tmp_path, dataset):
    assert "job_files" not in dataset.attrs
    for name in ("rig.csv", "renamed.csv"):
        run(Job(files={"profile_file": name}), tmp_path, simulator=Simulator(), progress=False)
        with open_results(tmp_path) as opened:
            assert json.loads(opened.attrs["job_files"]) == {"profile_file": name}


def test_each_run_stands_at_its_place(dataset):
    for index in range(12):
        point = JOB.point(index)
        at = {axis.name: point[axis.name] for axis in AXES}
        found = dataset.sel(at)
        if at["friction_gradient"] == -0.25:
            assert found["status"] == Status.FAILED_ERROR
            assert found["reason"] == "ZeroDivisionError: the driven pulley stands still"
            assert found["vibrates"] == Vibrates.UNDECIDED
            assert np.isnan(found["spectrum"]).all()
        else:
            expected = Simulator().run_point(JOB, point, lambda: None)
            assert found["status"] == Status.DONE
            assert found["reason"] == ""
            assert found["amplitude"].values.tobytes() == expected["amplitude"].tobytes()
            assert found["spectrum"].values.tobytes() == expected["spectrum"].tobytes()


def test_status_and_vibrates_are_cf_flags_and_come_first(out):
    with netCDF4.Dataset(out / "results.nc") as file:
        data = [name for name in file.variables if name not in file.dimensions]
        assert data[:2] == ["status", "vibrates"]
        status = file["status"]
        assert status.dtype == np.int8
        assert status.flag_values.dtype == np.int8  # CF: of the type of the variable
        assert status.flag_values.tolist() == [0, 1, 2, 3, 4]
        assert status.flag_meanings == "not_run done failed_numerics failed_error timed_out"
        assert file["vibrates"].flag_meanings == "no yes undecided slips irregular"
        assert "units" not in status.ncattrs()


def test_every_variable_is_named_and_only_real_results_have_a_fill_value(out):
    with netCDF4.Dataset(out / "results.nc") as file:
        for name, variable in file.variables.items():
            assert variable.long_name, name
            real = name in ("amplitude", "spectrum", "core_seconds")
            assert ("_FillValue" in variable.ncattrs()) == real, name
        assert file["spectrum"].dimensions[-2:] == ("strand", "frequency_bin")
        assert file["spectrum"].units == "m"
        assert file["frequency_bin"].units == "Hz"


def test_the_cf_checker_finds_nothing(out):
    assert cf_findings(out / "results.nc") == []


def test_data_are_compressed(out):
    with netCDF4.Dataset(out / "results.nc") as file:
        assert file["spectrum"].filters()["zlib"]
        assert file["status"].filters()["zlib"]
        assert file["reason"].filters()["zlib"]


def test_what_depends_on_the_hour_says_so(dataset):
    volatile = [name for name, variable in dataset.variables.items() if variable.attrs.get("volatile")]
    assert volatile == ["core_seconds"]


def test_the_file_alone_tells_how_to_repeat_it(dataset):
    attributes = dataset.attrs
    assert attributes["Conventions"].startswith("CF-1.")
    assert json.loads(attributes["job"]) == JOB.resolved()
    versions = json.loads(attributes["versions"])
    assert versions["numpy"] == np.__version__
    assert versions["cvt_hpc"] == cvt_hpc.__version__
    assert "git_revision" in attributes
    assert len(attributes["history"].splitlines()) == 2  # the run, the gathering
    assert ", 1 rank(s))" in attributes["history"]


def test_runs_without_a_record_are_not_run_and_no_nan_hides_it(tmp_path):
    run(JOB, tmp_path, simulator=Simulator(), progress=False, time_limit=0.0)
    with open_results(tmp_path) as dataset:
        assert (dataset["status"] == Status.NOT_RUN).all()
        assert (dataset["vibrates"] == Vibrates.UNDECIDED).all()
        assert np.isnan(dataset["amplitude"]).all()


def test_a_job_without_axes_gives_scalars(tmp_path):
    report = run(Job(axes=()), tmp_path, simulator=Simulator(), progress=False)
    assert (report.total, report.done) == (1, 1)
    with open_results(tmp_path / "results.nc") as dataset:
        assert dataset["status"].shape == ()
        assert dataset["spectrum"].dims == ("strand", "frequency_bin")


def test_long_reasons_are_cut_between_characters(tmp_path):
    class Verbose(Simulator):
        def run_point(self, job, point, interrupt):
            raise ValueError("x" + "δ" * 500)  # of two bytes each; the last one that would fit in part

    report = run(Job(axes=()), tmp_path, simulator=Verbose(), progress=False)
    assert report.failed[0].reason == "ValueError: x" + "δ" * 113
    with open_results(tmp_path) as dataset:
        assert dataset["reason"].item() == report.failed[0].reason


def test_an_axis_with_the_name_of_a_result_is_refused(tmp_path):
    with pytest.raises(InputError, match="name of a recorded quantity, found amplitude"):
        run(Job((Axis("amplitude", (1.0, 2.0)),)), tmp_path / "out", simulator=Simulator())
    assert not (tmp_path / "out").exists()


def test_gathering_again_gives_the_same_and_leaves_nothing_aside(out, dataset):
    loaded = dataset.load()
    dataset.close()
    assert gather(out) == out / "results.nc"
    with open_results(out) as again:
        assert again.drop_attrs(deep=False).identical(loaded.drop_attrs(deep=False))
    assert list(out.glob(".*")) == []


def test_gathering_names_damaged_logs(tmp_path, caplog):
    run(JOB, tmp_path, simulator=Simulator(), progress=False)
    (tmp_path / "records" / "notes.txt").write_text("mine")
    gather(tmp_path)
    assert "notes.txt: left out: not a record log" in caplog.text


def test_a_full_disk_leaves_the_dataset_that_was_there(tmp_path):
    run(JOB, tmp_path, simulator=Simulator(), progress=False)
    before = (tmp_path / "results.nc").read_bytes()
    code = "import sys; from cvt_hpc.study import gather; gather(sys.argv[1])"
    finished = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        env=clean_environment(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8000, 8000)),
        capture_output=True,
        text=True,
        cwd=HERE,
    )
    assert finished.returncode == 1
    found = (
        "results.nc: expected to be able to write, found: File too large. The runs recorded so far are kept"
    )
    assert found in finished.stderr.splitlines()[-1]
    assert (tmp_path / "results.nc").read_bytes() == before
    assert list(tmp_path.glob(".*")) == []


def test_results_are_opened_in_the_chunks_of_the_file(dataset, tmp_path):
    stored = {"spectrum": {"chunksizes": (1, 2, 2, 1, 11)}}
    dataset[["spectrum"]].to_netcdf(tmp_path / "results.nc", engine="netcdf4", encoding=stored)
    with open_results(tmp_path / "results.nc") as chunked:
        assert chunked["spectrum"].data.chunksize == (1, 2, 2, 1, 11)
        assert chunked["spectrum"].data.npartitions == 6  # read one by one, as they are needed
        largest = chunked["spectrum"].max("frequency_bin").values
    assert np.array_equal(largest, dataset["spectrum"].values.max(axis=-1), equal_nan=True)


def test_opening_what_is_no_dataset(tmp_path):
    run(JOB, tmp_path, simulator=Simulator(), progress=False)
    (tmp_path / "results.nc").write_text("mine")
    with pytest.raises(InputError, match="expected a netCDF file, found one that is damaged"):
        open_results(tmp_path)
    (tmp_path / "results.nc").unlink()
    with pytest.raises(InputError, match="cvt-hpc gather"):
        open_results(tmp_path)


def test_a_folder_of_an_earlier_version_has_its_sentences_as_comments():
    entry = describe(JOB, Simulator()).to_json()
    for variable in entry["variables"]:
        variable["long_name"] = variable.pop("comment")
    for axis in entry["axes"]:
        axis["long_name"] = axis.pop("comment")
    study = Study.from_json(entry)
    status = variable_attributes(study.variables[0])
    assert (status["long_name"], status["comment"]) == ("status", "how the run ended")
    assert study.axes[0].attributes == {"long_name": "slope of the friction law", "units": "s/m"}


def test_a_dataset_that_a_notebook_writes_to_names_who_has_it(out, tmp_path):
    path = shutil.copy(out / "results.nc", tmp_path)
    program = f"import h5py; file = h5py.File({str(path)!r}, 'r+'); print('open', flush=True); input()"
    with subprocess.Popen([sys.executable, "-c", program], stdin=-1, stdout=-1) as other:
        assert other.stdout.readline() == b"open\n"
        try:
            with pytest.raises(InputError) as caught:
                open_results(path)
        finally:
            other.communicate(b"\n")
    told = f"{path}: expected a file that nobody writes to, found it locked by process {other.pid} (python"
    assert str(caught.value).startswith(told)
    assert str(caught.value).endswith("); close it there, or read a copy of it")
    with open_results(path) as dataset:
        assert "status" in dataset


class TestADatasetThatHoldsMore:
    """A dataset with runs that are not on record stays as it is."""

    @pytest.fixture(autouse=True)
    def folder(self, out, tmp_path):
        shutil.copytree(out, tmp_path / "out")
        self.out = tmp_path / "out"
        self.before = (self.out / "results.nc").read_bytes()

    def refusal(self):
        """Return the one line with which it is refused to gather; the dataset stays."""
        with pytest.raises(InputError) as caught:
            gather(self.out)
        assert (self.out / "results.nc").read_bytes() == self.before
        assert [path.name for path in self.out.glob(".*.part")] == []
        return str(caught.value)

    def write_job(self, **changed):
        entry = json.loads((self.out / "job.json").read_text())
        del entry[CHECKSUM]
        entry |= changed
        (self.out / "job.json").write_text(json.dumps({**entry, CHECKSUM: checksum(entry)}))

    def test_the_job_has_another_constant(self):
        self.write_job(job={**JOB.resolved(), "scene": {"raise_at": 5}}, fingerprint="0" * 64)
        told = self.refusal()
        assert (
            "found 12 of them missing, since it is of another job (scene.raise_at is -0.25 there, 5 here)"
            in told
        )
        assert "; it stays as it is. Bring back job.json and records, or rename it and gather again" in told

    def test_the_job_has_another_fingerprint(self):
        self.write_job(fingerprint="0" * 64)
        assert "expected all of its 12 runs on record, found 12 of them missing; it stays" in self.refusal()

    def test_the_job_is_of_another_folder(self, tmp_path):
        run(Job(), tmp_path / "other", simulator=Simulator(), progress=False)
        shutil.copy(tmp_path / "other" / "job.json", self.out)
        shutil.copytree(tmp_path / "other" / "records", self.out / "records", dirs_exist_ok=True)
        assert "found 12 of them missing, since it is of another job (" in self.refusal()

    def test_records_are_gone(self, caplog):
        (log,) = (self.out / "records").iterdir()
        log.write_bytes(log.read_bytes()[:-5])
        assert "expected all of its 12 runs on record, found 1 of them missing; it stays" in self.refusal()
        broken_off = run(JOB, self.out, simulator=Simulator(), progress=False, time_limit=0.0)
        assert (broken_off.remaining, broken_off.results) == (1, self.out / "results.nc")
        assert "found 1 of them missing" in caplog.text
        assert (self.out / "results.nc").read_bytes() == self.before
        assert run(JOB, self.out, simulator=Simulator(), progress=False).gained == 1
        with open_results(self.out) as dataset:
            assert (dataset["status"] != Status.NOT_RUN).all()

    def test_runs_that_begin_again_may_go(self):
        report = run(
            JOB, self.out, simulator=Simulator(), progress=False, retry=[Status.FAILED_ERROR], time_limit=0.0
        )
        assert report.remaining == 4
        with open_results(self.out) as dataset:
            assert int((dataset["status"] == Status.NOT_RUN).sum()) == 4

    @pytest.mark.parametrize("kind", ["text", "link", "other"])
    def test_what_is_no_dataset_of_this_program_does_not_count(self, kind, tmp_path):
        results = self.out / "results.nc"
        results.unlink()
        if kind == "text":
            results.write_text("notes")
        elif kind == "link":
            (tmp_path / "target").write_bytes(self.before)
            results.symlink_to(tmp_path / "target")
        else:
            with netCDF4.Dataset(results, "w") as file:
                file.job = "[" * 1000
                file.createDimension("run", 3)
                file.createVariable("status", "i1", "run")[:] = 1
        gather(self.out)
        with open_results(self.out) as dataset:
            assert (dataset["status"] != Status.NOT_RUN).all()
