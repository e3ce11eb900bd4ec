"""Charts from the job to the files, broken off, gone on with, and refused."""

import csv
import io
import json
import logging
import multiprocessing
import shutil
import zipfile
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from threadpoolctl import threadpool_info, threadpool_limits

from cvt_hpc.errors import InputError
from cvt_hpc.experiments.chart import load, make
from cvt_hpc.experiments.chart.making import ChartFolder, _tell_compiling
from cvt_hpc.storage.output_folder import checksum
from cvt_hpc.storage.provenance import git_revision, machine
from cvt_hpc.tables import below_origin
from support.bells import Transient
from support.cf import cf_findings

DAMAGE = {
    "nothing left": lambda whole: b"",
    "two bytes left": lambda whole: whole[:2],
    "200 bytes left": lambda whole: whole[:200],
    "the end is cut": lambda whole: whole[:-1],
    "a byte within": lambda whole: whole[:100] + bytes([whole[100] ^ 1]) + whole[101:],
    "foreign": lambda whole: b"not an archive",
}


def made(job, out="out/bells", fresh=False, tell=lambda *lines: None):
    """What a chart leaves: its lines, and its files by kind."""
    outcome = make(load(job), Path(out), fresh=fresh, tell=tell)
    return SimpleNamespace(lines=outcome.lines, **dict(outcome.files))


@pytest.fixture
def undrawn(monkeypatch):
    """Pictures take most of the time, and are tested elsewhere."""
    monkeypatch.setattr("cvt_hpc.experiments.chart.making.draw", lambda figure, out: out)


@pytest.fixture(scope="module")
def first_made(tmp_path_factory):
    """What `report` made first, when by the bell's clock, and where its folder is kept."""
    return {"folder": tmp_path_factory.mktemp("made") / "bells"}


@pytest.fixture
def report(write_chart, undrawn, bell, first_made, tmp_path):
    """The chart of c.toml, in a folder of its own; measured once, and copied."""
    job, folder = write_chart(), tmp_path / "out/bells"
    if "report" not in first_made:
        first_made["report"], first_made["time"] = made(job), bell.now
        shutil.copytree(folder, first_made["folder"])
    else:
        shutil.copytree(first_made["folder"], folder)
        bell.now = first_made["time"]  # differences of times are the same to the last bit
    return first_made["report"]


def test_the_table_holds_every_point_with_its_outcome(report):
    with report.table.open() as file:
        rows = list(csv.DictReader(below_origin(file)))
    assert str(report.table) == "out/bells/chart.csv"
    told = report.table.read_text().splitlines()
    assert told[0] == f"# revision: {git_revision()}" and told[1].startswith("# job: bells, fingerprint ")
    assert [row["method"] for row in rows] == [
        "exact", *["soft hammer"] * 4, *["clever"] * 3, "hard", "louder", "step 1 us", "cracked",
    ]  # fmt: skip
    assert [row["role"] for row in rows[-3:]] == ["choice", "refinement", "choice"]
    failed = rows[1]
    assert failed["outcome"] == "failed_numerics at 50 ms: the bell has cracked (by 3 mm)"
    assert (failed["setting"], failed["value"]) == ("step", "0.002")
    assert failed["amplitude_error"] == ""
    assert float(failed["core_s_per_s"]) == pytest.approx(20e3 * 1.1e-9 / 2e-3, rel=1e-2)  # until then
    good = rows[3]
    assert good["outcome"] == "done" and good["stepper"] == "soft"
    assert float(good["core_s_per_s"]) == pytest.approx(20e3 * 1.1e-9 / 1e-5, rel=1e-3)
    assert float(good["amplitude [m]"]) == pytest.approx(20.02e-6, rel=1e-3)
    assert float(good["amplitude_error"]) == 0.001
    assert (good["steps"], good["rates"]) == ("6000", "14000")
    assert [row["method"] for row in rows if row["chosen"] == "yes"] == ["clever"]


def test_what_takes_longer_than_its_scene_allows_is_in_the_table_with_its_cost_so_far(write_chart, undrawn):
    report = made(write_chart(('title = "Ringing"', 'time_limit = "0.5 s"')))
    with report.table.open() as file:
        (row,) = [
            row
            for row in csv.DictReader(below_origin(file))
            if row["method"] == "soft hammer" and row["value"] == "1e-06"
        ]
    assert row["outcome"].startswith("timed_out at ")
    assert float(row["core_s_per_s"]) == pytest.approx(20e3 * 1.1e-9 / 1e-6, rel=1e-3)


def test_a_method_is_measured_with_one_thread_of_linear_algebra(write_chart, undrawn, monkeypatch):
    seen = set()
    advance = Transient.advance

    def watched(run, samples):
        seen.update(library["num_threads"] for library in threadpool_info())
        return advance(run, samples)

    monkeypatch.setattr(Transient, "advance", watched)
    with threadpool_limits(2):
        made(write_chart())
    assert seen == {1}


def test_the_cf_checker_finds_nothing(report):
    assert cf_findings(report.dataset) == []


def test_people_read_the_same(report):
    lines = report.lines
    assert lines[0] == "Ringing"
    assert "".join(line for line in lines if line.endswith("<- chosen")).split()[0] == "clever"
    assert sum("failed: failed_numerics at 50 ms: the bell has cracked" in line for line in lines) == 2
    assert next(line for line in lines if line.startswith("  step 1 us")).endswith("is an error of it")


def test_the_dataset_repeats_the_study(report):
    with xr.open_dataset(report.dataset) as dataset:
        assert dataset.attrs["Conventions"] == "CF-1.11"
        job = json.loads(dataset.attrs["job"])
        assert job["points"]["ringing-soft-3"]["job"]["numerics"]["step"] == 1e-5
        assert {"python", "numpy"} <= set(json.loads(dataset.attrs["versions"]))
        assert json.loads(dataset.attrs["machine"])[0]["cores"] >= 1
        point = dataset.sel(point="ringing-soft-3")
        assert float(point["amplitude_error"]) == pytest.approx(1e-3, rel=1e-6)
        assert dataset["amplitude"].attrs["units"] == "m" and dataset["step"].attrs["units"] == "s"
        assert float(point["step"]) == 1e-5 and np.isnan(float(point["tolerance"]))
        assert int(point["failed"]) == 0 and int(dataset["failed"].sum()) == 2
        assert int(dataset["chosen"].sum()) == 1
        for variable in dataset.data_vars.values():
            assert "long_name" in variable.attrs


def test_a_chart_goes_on_where_it_was_broken_off(write_chart, undrawn, monkeypatch):
    job = write_chart()
    measure = Transient.advance

    def broken(run, samples):
        if run.stepper == "clever":
            raise KeyboardInterrupt
        return measure(run, samples)

    monkeypatch.setattr(Transient, "advance", broken)
    with pytest.raises(KeyboardInterrupt):
        made(job)
    monkeypatch.setattr(Transient, "advance", measure)
    told = []
    report = made(job, tell=told.append)
    # the exact solution, the budget and the soft hammer had been measured
    assert [line.split()[1] for line in told] == [
        "ringing-clever-1:", "ringing-clever-2:", "ringing-clever-3:", "ringing-hard-1:",
    ]  # fmt: skip
    assert told[-1].startswith("13/13 ")
    before = report.table.read_bytes()
    told.clear()
    assert made(job, tell=told.append).table.read_bytes() == before
    assert told == []


def test_failures_are_kept_too(write_chart, undrawn):
    told = []
    job = write_chart()
    made(job, tell=told.append)
    assert "failed: failed_numerics at 50 ms" in next(line for line in told if "ringing-soft-1" in line)
    told.clear()
    report = made(job, tell=told.append)
    assert told == []
    assert "failed: failed_numerics at 50 ms" in "".join(report.lines)


def test_another_job_in_the_folder_is_refused_unless_fresh(report, write_chart, tmp_path):
    before = report.table.read_bytes()
    changed = write_chart(("20 um", "21 um"))
    with pytest.raises(InputError) as caught:
        made(changed)
    assert str(caught.value).startswith(
        "out/bells: expected the folder of this job, found that of another (points."
    )
    assert "loudness is 2e-05 there, 2.1e-05 here" in str(caught.value)
    assert str(caught.value).endswith("choose another name or --out, or --fresh to throw its results away")
    assert report.table.read_bytes() == before
    (tmp_path / "out/bells/notes.txt").write_text("mine")
    (tmp_path / "out/bells/mine.png").write_text("mine")
    told = []
    assert made(changed, fresh=True, tell=told.append).table.read_bytes() != before
    assert len(told) == 13
    assert (tmp_path / "out/bells/notes.txt").read_text() == "mine"
    assert (tmp_path / "out/bells/mine.png").read_text() == "mine"


@pytest.mark.parametrize("fresh", [False, True])
def test_a_folder_of_something_else_is_left_alone(write_chart, undrawn, tmp_path, fresh):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/chart.csv").write_text("mine")
    with pytest.raises(InputError, match="expected an empty folder or that of an earlier chart"):
        made(write_chart(), out=tmp_path / "mine", fresh=fresh)
    assert (tmp_path / "mine/chart.csv").read_text() == "mine"
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="expected a folder for the results, found a file"):
        made(write_chart(), out=tmp_path / "file", fresh=fresh)


@pytest.mark.parametrize("damage", [*DAMAGE.values()], ids=[*DAMAGE])
def test_a_damaged_point_is_named_and_measured_again(report, tmp_path, caplog, damage):
    before = report.table.read_bytes()
    point = tmp_path / "out/bells/points/ringing-soft-3.npz"
    whole = point.read_bytes()
    point.write_bytes(damage(whole))
    told = []
    assert made("c.toml", tell=told.append).table.read_bytes() == before
    assert [line.split()[1] for line in told] == ["ringing-soft-3:"]
    assert "out/bells/points/ringing-soft-3.npz: damaged (" in caplog.text
    assert point.read_bytes() == whole


JOB_FILES = {
    "empty": b"",
    "cut": b'{"format": "cvt_hpc',
    "bare": b'{"format": "cvt_hpc chart 2"}',
    "gone": None,
}


@pytest.mark.parametrize("left", [*JOB_FILES.values()], ids=[*JOB_FILES])
def test_without_its_job_file_a_chart_is_known_by_its_points(report, write_chart, tmp_path, left):
    before = report.table.read_bytes()
    job_file = tmp_path / "out/bells/chart.json"
    whole = job_file.read_bytes()

    def damage():
        job_file.unlink()
        if left is not None:
            job_file.write_bytes(left)

    damage()
    told = []
    assert made("c.toml", tell=told.append).table.read_bytes() == before
    assert (told, job_file.read_bytes()) == ([], whole)
    damage()
    changed = write_chart(("20 um", "21 um"))
    with pytest.raises(InputError, match="or --fresh to throw away its results, which are of another job"):
        made(changed)
    assert made(changed, fresh=True, tell=told.append).table.read_bytes() != before
    assert len(told) == 13


@pytest.mark.parametrize(
    ("name", "value", "attribute"),
    [
        ("versions", {"cvt_hpc": "0.0", "python": "2.7"}, "versions"),
        ("git_revision", "deadbeef", "git_revision"),
        ("machine", {"processor": "abacus", "cores": 1}, "machine"),
    ],
)
def test_points_by_other_versions_or_machines_are_named(
    write_chart, undrawn, tmp_path, monkeypatch, caplog, name, value, attribute
):
    job = write_chart()
    with monkeypatch.context() as earlier:
        earlier.setattr(f"cvt_hpc.storage.archives.{name}", lambda: value)
        made(job)
    assert not caplog.records
    (tmp_path / "out/bells/points/ringing-soft-3.npz").unlink()
    report = made(job)
    assert caplog.text.count("earlier points were made with other versions or on another machine") == 1
    with xr.open_dataset(report.dataset) as dataset:
        found = dataset.attrs[attribute]
    old, new = {
        "versions": ("0.0, ", metadata.version("cvt_hpc")),
        "git_revision": ("deadbeef, ", git_revision()),
        "machine": ("abacus", machine()["processor"]),
    }[name]
    assert old in found and new in found
    caplog.clear()
    made(job, fresh=True)
    assert not caplog.records


def test_two_charts_in_one_folder_are_refused(write_chart, undrawn, tmp_path):
    job = write_chart()

    refusals = []

    def second(line):
        if not refusals:
            with pytest.raises(InputError) as caught:
                made(job, fresh=True)
            refusals.append(str(caught.value))

    assert made(job, tell=second).table.exists()
    assert refusals[0].startswith("out/bells: expected a folder that no run is at work in, found process")


def test_one_of_several_processes_tells_what_it_compiles():
    logger, turn, levels = logging.getLogger("cvt_hpc.kernels"), multiprocessing.Lock(), []
    before = logger.level
    for _ in range(2):
        _tell_compiling(turn, logging.INFO)
        levels.append(logger.level)
    logger.setLevel(before)
    assert levels == [logging.INFO, logging.ERROR]


def test_with_fresh_names_of_scenes_in_a_made_up_job_file_remove_nothing_outside(report, tmp_path):
    (tmp_path / "out/mine.png").write_text("mine")
    path = tmp_path / "out/bells/chart.json"
    entry = json.loads(path.read_text())
    del entry["checksum"]
    entry["job"]["scenes"]["../mine"] = {}
    path.write_text(json.dumps({**entry, "checksum": checksum(entry)}))
    made("c.toml", fresh=True)
    assert (tmp_path / "out/mine.png").read_text() == "mine"
    assert report.table.exists()


@pytest.mark.parametrize("name", [".chart.lock", "points", "chart.json"])
def test_links_in_the_folder_of_a_chart_lead_nowhere(report, tmp_path, name):
    path, mine = tmp_path / "out/bells" / name, tmp_path / "mine"
    mine.mkdir()
    (mine / "a.npz").write_text("mine")
    if path.is_dir():
        path.rename(tmp_path / "out/bells_points")
    else:
        path.unlink()
    path.symlink_to(mine)
    if name != "chart.json":  # which the points tell
        with pytest.raises(InputError, match=f"{name}: expected .* found a link; remove it"):
            made("c.toml")
    made("c.toml", fresh=True)
    assert [(path.name, path.read_text()) for path in mine.iterdir()] == [("a.npz", "mine")]


def test_a_point_that_unpacks_to_more_than_a_point_is_measured_again(report, tmp_path, caplog):
    before = report.table.read_bytes()
    point = tmp_path / "out/bells/points/ringing-soft-3.npz"
    np.savez_compressed(point, head=np.zeros(1 << 25))  # 256 MiB in 300 kB
    assert made("c.toml").table.read_bytes() == before
    assert "ringing-soft-3.npz: damaged (it unpacks to more than it may)" in caplog.text


def repacked(whole, compression=zipfile.ZIP_DEFLATED, **replaced):
    """An archive with some entries replaced or added: arrays, or bytes as they are."""
    with np.load(io.BytesIO(whole)) as file:
        arrays = {key: file[key] for key in file.files} | replaced
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", compression) as archive:
        for key, array in arrays.items():
            with archive.open(f"{key}.npy", "w") as entry:
                entry.write(array) if isinstance(array, bytes) else np.save(entry, array)
    return made.getvalue()


def test_a_point_whose_archive_is_in_order_is_kept_however_it_was_packed(report, tmp_path, caplog):
    point = tmp_path / "out/bells/points/ringing-soft-3.npz"
    point.write_bytes(repacked(point.read_bytes(), zipfile.ZIP_STORED))
    told = []
    made("c.toml", tell=told.append)
    assert told == [] and caplog.text == ""


def test_whose_points_are_is_asked_of_their_heads_alone(report, tmp_path, monkeypatch):
    folder = ChartFolder(tmp_path / "out/bells", load("c.toml"))
    read = np.lib.npyio.NpzFile.__getitem__
    keys = set()
    monkeypatch.setattr(
        np.lib.npyio.NpzFile, "__getitem__", lambda file, key: (keys.add(key), read(file, key))[1]
    )
    assert len(folder.parts.fingerprints()) == 1 and keys == {"head"}
