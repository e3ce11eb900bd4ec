"""Texts of a user's files on the terminal: whatever they hold, they are lines of letters, and not long."""

import json
import os
from dataclasses import replace

import pytest

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError, one_line, show
from cvt_hpc.job import load_job
from cvt_hpc.study.folder import StudyFolder
from support.toy_jobs import GRID

NASTY = "a\x1b[2J\nb\r\u202e\x9b"
ESCAPED = r"a\x1b[2J\nb\r\u202e\x9b"


def assert_clean(lines, most=4100):
    assert lines
    assert all(line.isprintable() and len(line) < most for line in lines), lines


def test_what_does_not_print_is_escaped_and_long_texts_are_cut():
    assert one_line(NASTY) == ESCAPED
    assert one_line("µm Größe 10 °C") == "µm Größe 10 °C"
    assert one_line(os.fsdecode(b"\xff")) == r"\udcff"
    assert len(one_line("x" * 10_000_000 + "end")) < 4100
    assert one_line("x" * 10_000_000 + "end").endswith("xend")
    assert show(NASTY) == r'"a\u001b[2J\nb\r\u202e\x9b"'
    assert str(InputError(NASTY)) == ESCAPED


@pytest.mark.parametrize("key", [NASTY, "k" * 1_000_000], ids=["escapes", "long"])
@pytest.mark.parametrize(
    "table", ["scene.{}", "{}", "{}.x", "axes.{}", "scene.load.{}", "design.{}", "derived.{}"]
)
def test_keys_of_a_job_file(write_job, call, key, table):
    key = json.dumps(key)  # as TOML quotes it, but for one letter
    write_job(table.format(key.replace("\x9b", "")) + " = 1\n")
    status, out, err = call("check", "x.toml")
    assert status == 2
    assert_clean(err, 300)
    assert err[0].startswith('cvt-hpc: x.toml: expected keys of at most 100 printable characters, found "')


def test_keys_of_an_assignment(write_job, call):
    write_job(GRID)
    for key in (NASTY, "k" * 100_000):
        status, _, err = call("check", "x.toml", "--set", f"{key}=1")
        assert status == 2
        assert_clean(err, 300)


def test_a_description_is_shown_line_by_line(write_job, mechanics, call):
    write_job(GRID, head='name = "x"\nmodel = "toy"\ndescription = "one\\n\\u001b[2Jtwo"\n')
    _, out, _ = call("check", "x.toml")
    assert out[1:3] == ["one", r"\x1b[2Jtwo"]
    text = json.dumps("\n".join(["long"] * 100_000) + "y" * 100_000)
    write_job(GRID, head=f'name = "x"\nmodel = "toy"\ndescription = {text}\n')
    _, out, _ = call("check", "x.toml")
    assert_clean([line for line in out if line])
    assert len(out) < 100


def test_names_of_files(write_job, mechanics, call, tmp_path):
    write_job(GRID)
    (tmp_path / "x.toml").rename(tmp_path / NASTY)
    status, out, _ = call("check", NASTY)
    assert status == 0
    assert_clean([line for line in out if line])
    assert f"({ESCAPED})" in out[0]
    status, out, err = call("run", NASTY, "--out", "out" + NASTY)
    assert status == 0
    assert_clean(out)
    status, _, err = call("status", "no" + NASTY)
    assert status == 2
    assert_clean(err)


def test_the_name_in_a_folder(write_job, mechanics, call, tmp_path):
    write_job(GRID)
    call("run", "x.toml")
    folder = tmp_path / "out" / "x"
    study = StudyFolder(folder).load()
    StudyFolder(folder).job_file.unlink()
    StudyFolder(folder).save(replace(study, name=NASTY))
    (folder / "records" / "rank-\n.log").write_text("nothing")
    status, out, err = call("status", folder)
    assert (status, len(err)) == (0, 1)
    assert_clean([*out, *err])
    assert any(ESCAPED in line for line in out)


def test_bytes_that_are_no_text_are_refused_once(write_job, capfd):
    write_job(GRID)
    for arguments in (
        ["run", "x.toml", "--out", os.fsdecode(b"\xff")],
        ["check", os.fsdecode(b"x\xfe.toml")],
    ):
        assert main(arguments) == 2
        out, err = capfd.readouterr()
        assert out == ""
        assert err.startswith('cvt-hpc: command line: expected names and values in UTF-8, found "')
        assert err.count("\n") == 1


def test_an_error_of_the_package_is_a_line_too(write_job, tmp_path):
    with pytest.raises(InputError) as caught:
        load_job(tmp_path / NASTY)
    assert_clean([str(caught.value)])
