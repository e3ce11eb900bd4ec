"""Every block of code of README, guide and the pages beside the code is done, as it stands there, in an empty folder.

A study that its page reads is the job of that name with fewer and shorter runs: `--set` is added to the command, and
nothing else. Of any other the options are parsed and the job is checked.
"""

import re
import runpy
import shutil
import sys
import tomllib
from functools import cache, partial
from pathlib import Path
from typing import ClassVar

import matplotlib.pyplot as plt
import pytest

import cvt_hpc
from cvt_hpc.analysis import animation, figures
from cvt_hpc.cli import _parser, main
from cvt_hpc.job import build_job
from cvt_hpc.job.assignments import read_assignments
from cvt_hpc.job.document import read_document
from support.pages import PAGES, ROOT, blocks, name_of, shell_calls

# Commands that are not done here, and where they are.
ELSEWHERE = {
    ".": "activates the environment, in which the tests already are",
    "bash jobs/quickstart.sh": "tests/cli/test_quickstart.py",
    "bash jobs": "scripts of whole studies, for minutes of a core and more",
    "bash tests/run.sh": "runs this test",
    "bash .ci/run": "runs this test",
    "pip install": "needs the network; tests/run.sh installs the same package",
    "python -m pytest": "runs tests that all runs of the tests have",
    "python -m mkdocs": "tests/cli/test_guide.py builds the guide",
    "python tests/benchmarks": "compares models, for minutes of a core",
    "python jobs/tables.py": "tests/analysis/test_tables.py",
    "sbatch": "tests/slurm submits the batch files to a Slurm of its own",
    "scancel": "tests/slurm stops jobs so",
    "apptainer": "no container is built in a test; tests/slurm/test_launch_script.py starts the ranks through a stand-in",
}
# Blocks that are not done here, by page and kind.
BLOCKS_ELSEWHERE = {
    ("docs/guide/extend.md", "python"): "tests/new_model runs them, each in its place",
}
LINES = [line for page in PAGES for block in blocks(page) for line in block.text.splitlines()]
DRAWING = "text"  # kind of a block that shows something and is no code
# Minutes of a core, however few runs they have: `check` reads their jobs, scenes and options instead, and the tests
# of their own packages run small ones.
CHECKED_ONLY = {"branch", "chart", "fit", "growth", "ladder"}
CHECKED_MODELS = {"beam_pushbelt"}
# What runs here have [SI], by key, or by model, stepper or job and key. Five periods of band_low are judged, the least that
# there may be; slow models have a high band for that.
SMALL = {"duration": 0.04, "longest_duration": 0.04, "rise_time": 0.01}
SHORT = {"duration": 0.022, "longest_duration": 0.022, "rise_time": 0.008, "band_low": 500.0}
SMALL_OF = {
    "belt_drive": {"duration": 0.14, "longest_duration": 0.14, "elements": 104, "band_low": 80.0},
    "elastic_belt": {"stations": 64},
    "explicit": SHORT,
    "pushbelt": SHORT | {"elements": 104, "band_high": 600.0},
    "quasi_static_belt": SHORT,
    "ramps": {"duration": 0.3, "longest_duration": 0.3},
    "spatial_pushbelt": SHORT | {"elements": 104, "band_high": 600.0},
    "steady_variator": {"stations": 64},
    "linear_stability": {"stations": 64},
}
PILOT = SMALL | {"stations": 64}  # of `check --pilots`
PARSER = _parser()
PYTHON_RUN = 'duration = "40 ms"\nlongest_duration = "40 ms"'
# What a page takes for granted: work of its reader, or of another page.
BEFORE = {
    "docs/guide/tutorial.md": "cvt-hpc run jobs/quickstart.toml",
    "docs/guide/python.md": """
        cvt-hpc run jobs/lebrecht_2004.toml --set 'sheave_stiffness=[1.0, 1.5]'
        cvt-hpc run jobs/lebrecht_2004.toml --set name=other --set stations=96 --set 'sheave_stiffness=[1.0, 1.5]'
    """,
    "docs/guide/variables.md": "cvt-hpc run jobs/lebrecht_2004.toml",
    "docs/guide/verdicts.md": """
        cvt-hpc init JOB
        cvt-hpc run jobs/quickstart.toml --set name=coarse --set stations=96
        cvt-hpc run jobs/quickstart.toml --set name=fine
    """,
    "docs/guide/sweeps.md": "cvt-hpc init JOB",
}


class Reader:
    """Someone who does what a page says, in the present folder.

    Parameters
    ----------
    page : Path
        What is read.
    store : Path
        A folder for the studies that others take over.
    """

    done: ClassVar[dict] = {}  # folder in the store, by job and words of a command
    checked: ClassVar[set] = set()  # jobs and settings, of any page

    def __init__(self, page, store):
        self.page, self.store = page, store
        self.model = page.parent.name if page.parent.parent.name == "models" else "elastic_belt"
        document = {"name": "page", "model": self.model, "mesh": SMALL_OF.get(self.model, {})}
        self.names = {}  # of the page's Python blocks
        if "stations" in document["mesh"]:  # a page that takes parameters of the model for granted
            self.names["parameters"] = build_job(document).parameters

    def do(self, block):
        """Do what a block shows."""
        if block.kind == "bash":
            for words in shell_calls(block.text):
                self.call(words)
        elif block.kind == "toml":
            self._check_job(block.text)
        elif block.kind == "python":
            code = "\n".join(line for line in block.text.splitlines() if not line.startswith("%"))
            exec(compile(code, name_of(self.page), "exec"), self.names)
            plt.close("all")
        elif block.kind == "csv":
            _file_of(block.text, "measured.csv").write_text(block.text)
        elif block.kind != DRAWING:
            raise AssertionError(f"nobody does a block of kind {block.kind!r}")

    def call(self, words):
        """Do a command, given by its words."""
        while "=" in words[0]:  # variables of the environment
            words = words[1:]
        if words[:2] == ["mpirun", "-n"]:  # tests/sweep has the same under mpirun
            words = words[3:]
        if words[0] == "cvt-hpc":
            PARSER.parse_args(words[1:])
            status = self._main(_smaller(words[1:], self.page))
            assert status in ((0, 1) if words[1] == "doctor" else (0,))  # 1: of this machine, not of the page
        elif words[0] == "python" and words[1].startswith("jobs/") and " ".join(words[:2]) not in ELSEWHERE:
            sys.argv = words[1:]
            runpy.run_path(words[1], run_name="__main__")
        else:
            command = " ".join(words)
            assert any(f"{command} ".startswith((f"{known} ", f"{known}/")) for known in ELSEWHERE), command
            for word in words[1:]:
                if word.startswith(("jobs/", "slurm/", "tests/")):
                    assert (ROOT / word).exists(), word

    def _main(self, words):
        """Exit status of the command; what another page has had done or checked already is taken over."""
        if words[0] == "check":
            asked = (Path(words[1]).read_text(), *words)
            status = 0 if asked in self.checked else main(words)
            self.checked.add(asked)
            return status
        if words[0] != "run":
            return main(words)
        before, study = set(Path("out").glob("*")), (Path(words[1]).read_text(), *words)
        if study in self.done:
            shutil.copytree(self.done[study], "out", dirs_exist_ok=True)
        status = main(words)
        if study not in self.done and (new := set(Path("out").glob("*")) - before):
            self.done[study] = self.store / str(len(self.done))
            for folder in new:
                shutil.copytree(folder, self.done[study] / folder.name)
        return status

    def _check_job(self, text):
        """Read a job; a fragment is one of the page's model, and a ladder needs loads."""
        tables = tomllib.loads(text)
        if "model" not in tables:
            text = f'name = "fragment"\nmodel = "{self.model}"\n{text}'
        if "ladder" in tables:
            text += "\n[axes]\nload = [60, 120]\n"
        path = _file_of(text, "block.toml")
        path.write_text(text)
        assert main(["check", str(path)]) == 0


def _file_of(text, default):
    """File of a block: that which its first line names, if it does."""
    named = re.match(r"# (\S+\.(?:csv|toml))\n", text)
    return Path(named[1] if named else default)


def _smaller(words, page):
    """The command with fewer and shorter runs."""
    command = words[0]
    if "--pilots" in words:
        return [*words, *(word for key, value in PILOT.items() for word in ("--set", f"{key}={value}"))]
    if command not in {"check", "run", "simulate", *CHECKED_ONLY} or words[1].startswith("jobs/figures/"):
        return words  # figures take half a second each
    given = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    settings = [word for text in given for word in ("--set", text)]
    if command in CHECKED_ONLY:
        return ["check", words[1], "--for", command, *settings]
    if "--for" in words:
        return words
    job = _job(Path(words[1]).read_text(), words[1], tuple(given))
    mentioned = {text.partition("=")[0] for text in given}
    if command == "check":
        return [*words, *_ends(job, mentioned)]
    code = "\n".join(block.text for block in blocks(page))
    if not given and f"calibrate {words[1]} " in code:  # weighs the same runs
        return words
    is_read = "--out" in words if command == "simulate" else re.search(rf"out/{job.name}(?!\w)", code)
    # a course of time cannot be cut short
    if not is_read or job.model in CHECKED_MODELS or job.parameters.get("profile_time"):
        return ["check", words[1], *settings, *_ends(job, mentioned)]
    changed = SMALL | SMALL_OF.get(job.model, {}) | SMALL_OF.get(job.stepper, {}) | SMALL_OF.get(job.name, {})
    changed = {key: value for key, value in changed.items() if key in job.parameters}
    longest = max(job.axes, key=lambda axis: len(axis.values), default=None)
    # of runs with a history, which are those in the whole grid
    by_number = re.findall(rf"out/{job.name}/histories/run-(\d+)", page.read_text())
    if by_number and len(job.axes) == 1:
        changed[longest.name] = list(longest.values[: max(map(int, by_number)) + 1])
    for axis in () if by_number else job.axes:
        first, last = axis.values[0], axis.values[-1]
        named = _named(axis.name, job, Path(words[1]).stem)
        kept = [value for value in named if value in axis.values] or [first]
        if axis is longest and "first_spacing" in job.design:  # traced are axes longer than two spacings
            kept = axis.values[: 2 * job.design["first_spacing"][axis.name] + 1]
        elif "runs" in job.design:
            kept = [first, last]
        elif axis is job.axes[-1] and last not in kept and "elements" not in job.parameters:
            kept.append(last)  # belts of elements are dear: one run each
        changed[axis.name] = list(kept)
    if "runs" in job.design:
        changed["design.runs"] = 2
    return [*words, *_settings(changed, mentioned)]


def _ends(job, mentioned):
    """Options by which a grid has the ends of its axes alone; `test_jobs.py` checks the whole grid of each job."""
    if job.design.keys() & {"runs", "first_spacing"}:
        return []
    return _settings({axis.name: [axis.values[0], axis.values[-1]] for axis in job.axes}, mentioned)


def _settings(changed, mentioned):
    """Options that change keys which are not mentioned."""
    more = [f"{key}={value!r}" for key, value in changed.items() if key not in mentioned]
    return [word for text in more for word in ("--set", text)]


@cache
def _job(_, name, given):
    """The job of a file with this text, by which it is found again."""
    return build_job(read_document(Path(name)), name, given)


def _named(key, job, stem):
    """Values of an axis that commands of a job file name, on whatever page, so that pages share its study [SI]."""
    commands = "\n".join(line for line in LINES if f"/{stem}" in line)
    named = re.findall(rf'--at "?({key}=[^\s"]+(?: \w+")?)', commands)
    return [read_assignments([text.strip('"')], job.schema, "", "--at")[key] for text in dict.fromkeys(named)]


@pytest.fixture
def folder(tmp_path, monkeypatch, unarranged):
    """An empty folder with the jobs alone."""
    shutil.copytree(ROOT / "jobs", tmp_path / "jobs", ignore=shutil.ignore_patterns("results", "notebooks"))
    (tmp_path / "jobs" / "results").mkdir()
    loaded = tmp_path / "jobs" / "lebrecht_2004.toml"  # by blocks of Python, which have no options
    shorter = loaded.read_text().replace('duration = "0.4 s"', PYTHON_RUN)
    loaded.write_text(shorter.replace('rise_time = "30 ms"', 'rise_time = "10 ms"'))
    monkeypatch.setattr(cvt_hpc, "build_job", partial(build_job, overrides=SMALL | {"stations": 64}))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setattr(animation, "FRAMES", 1)  # test_animation.py draws all
    monkeypatch.setattr(figures, "RESOLUTION", 50)  # test_pictures.py looks at them as they are
    return tmp_path


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A folder that all pages share."""
    return tmp_path_factory.mktemp("studies")


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=name_of)
def test_blocks_of_a_page(page, folder, store):
    reader = Reader(page, store)
    for words in shell_calls(BEFORE.get(name_of(page), "")):
        reader.call(words)
    for block in blocks(page):
        if (name_of(page), block.kind) not in BLOCKS_ELSEWHERE:
            reader.do(block)
