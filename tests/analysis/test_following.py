"""The page of a study that is written again and again while a sweep is at work."""

import re

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.printing import status_rows
from cvt_hpc.report import following
from cvt_hpc.report.following import follow_report
from cvt_hpc.study import run
from cvt_hpc.study.description import describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.gather import recorded_results
from support.study_double import Job, Simulator

JOB = Job(parameters={"raise_at": 3}, units={"load": "kN m"})


def do(out, part=None):
    """Do the runs of a job, or a part of them."""
    return run(JOB, out, simulator=Simulator(), progress=False, part=part)


def follow(monkeypatch, out, renewed, meanwhile):
    """So many pages, while a sweep is at work, and the last one; `meanwhile` happens after each."""
    pages = []

    def sleep(seconds):
        pages.append((seconds, (out / "report.html").read_text()))
        meanwhile()

    monkeypatch.setattr(StudyFolder, "is_in_use", lambda folder: len(pages) < renewed)
    monkeypatch.setattr(following.time, "sleep", sleep)
    assert follow_report(out, out / "report.html", 40.0, status_rows) == out / "report.html"
    return pages, (out / "report.html").read_text()


def rows(page):
    """What the head of a page says of the study."""
    return dict(re.findall(r"<tr><th>(.*?)</th><td>(.*?)</td></tr>", page.partition("<h2>")[0]))


def content(out):
    return {
        path: (path.read_bytes() if path.is_file() else None, path.lstat().st_mtime_ns)
        for path in out.rglob("*")
        if path.name != "report.html"
    }


def test_a_page_follows_a_sweep_to_its_end_and_changes_nothing_else(monkeypatch, tmp_path):
    out = tmp_path / "x"
    do(out, "1/2")
    target = tmp_path / "elsewhere"
    target.write_text("kept")
    (out / "report.html").symlink_to(target)
    before, seen = content(out), []

    def meanwhile():
        if not seen:
            seen.append(content(out))
            do(out, "2/2")

    pages, last = follow(monkeypatch, out, 2, meanwhile)
    (pause, first), (_, second) = pages
    assert seen == [before] and target.read_text() == "kept"
    assert pause == 40.0 and '<meta http-equiv="refresh" content="40">' in first
    assert (rows(first)["job"], rows(first)["runs"]) == ("double (running)", "12")
    assert rows(first)["left"] == "6" and rows(second)["left"] == "0"
    assert '<progress value="0.5">' in first and "map-data" not in first and 'alt="map"' in first
    assert "6 not run" in first and "not run" not in second
    assert rows(second)["failed"] == "1" and "the driven pulley" in second.partition("Failed runs")[2]
    assert (
        "http-equiv" not in last and "map-data" in last and rows(last)["job"].startswith("double (finished")
    )


@pytest.mark.parametrize("second", [False, True])
def test_ctrl_c_leaves_a_last_page(second, monkeypatch, tmp_path):
    do(tmp_path / "x", "1/2")

    def press(*_):
        raise KeyboardInterrupt

    if second:  # pressed again while that page is written
        pages = iter([lambda *_: None, press])
        monkeypatch.setattr(following, "write_report", lambda *given, **options: next(pages)(*given))
        monkeypatch.setattr(StudyFolder, "is_in_use", lambda folder: True)
        monkeypatch.setattr(following.time, "sleep", press)
        with pytest.raises(KeyboardInterrupt):
            follow_report(tmp_path / "x", tmp_path / "report.html", 1.0, status_rows)
        return
    pages, last = follow(monkeypatch, tmp_path / "x", 9, press)
    assert len(pages) == 1 and "http-equiv" not in last
    assert rows(last)["job"] == "double (running)"
    assert [path.name for path in (tmp_path / "x").glob(".report*")] == []


def test_a_study_without_a_record_and_one_that_was_broken_off_have_a_page(monkeypatch, tmp_path):
    with StudyFolder(tmp_path).claimed(describe(JOB, Simulator())):
        pages, last = follow(monkeypatch, tmp_path, 0, lambda: None)
    assert pages == [] and "12 not run" in last and rows(last)["left"] == "12"
    assert "goes on with what is left" in rows(last)["next"]
    with pytest.raises(InputError, match="expected the output folder of a run, found nothing"):
        follow_report(tmp_path / "none", tmp_path / "report.html", 1.0, status_rows)


def test_its_dataset_has_no_spectra(monkeypatch, tmp_path):
    do(tmp_path)
    monkeypatch.setitem(recorded_results.__wrapped__.__globals__, "LONGEST", 4)
    folder = StudyFolder(tmp_path)
    with recorded_results(folder.read_records(folder.load())) as dataset:
        assert "spectrum" not in dataset and dataset["amplitude"].notnull().any()
        assert dataset.attrs["job_name"] == "double"
        assert dataset.attrs["job_units"] == '{"load": "kN m"}'
