"""README and guide: their commands are legal, their jobs and code are readable, and no link leads nowhere."""

import re
import shlex
import subprocess
import sys
import tomllib
from html import escape
from pathlib import Path

import pytest

from cvt_hpc.cli import _parser
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.job.document import read_document
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.values import read_value
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]


def blocks(kind):
    """Page and text of each block of code of a kind."""
    fenced = re.compile(rf"^```{kind}\n(.*?)^```", re.MULTILINE | re.DOTALL)
    return [(page, text) for page in PAGES for text in fenced.findall(page.read_text())]


def commands():
    """Every call of cvt-hpc in a block of shell commands, as a list of words."""
    for page, text in blocks("bash"):
        for line in text.splitlines():
            for call in re.split(r"&&|;", line.partition(" #")[0]):
                words = shlex.split(call, comments=True)
                if "cvt-hpc" in words:
                    yield page.name, words[words.index("cvt-hpc") + 1 :]


COMMANDS = list(commands())


def test_there_are_commands_to_try():
    assert len(COMMANDS) > 50 and {page for page, _ in COMMANDS} >= {"README.md", "sweeps.md", "tutorial.md"}


@pytest.mark.parametrize(
    ("page", "words"), COMMANDS, ids=[f"{page}: {' '.join(words)}" for page, words in COMMANDS]
)
def test_commands_are_legal_and_their_jobs_are_there(page, words):
    parsed = _parser().parse_args(words)
    path = str(getattr(parsed, "path", ""))
    if path.startswith("jobs/"):
        read_document(ROOT / path)


def test_jobs_in_blocks_are_legal():
    jobs = [tomllib.loads(text) for _, text in blocks("toml")]
    whole = [job for job in jobs if "model" in job]
    assert len(whole) >= 3
    for job in whole:
        job.get("friction", {}).pop("table_file", None)
        build_job(job)


def test_code_in_blocks_is_readable():
    for page, text in blocks("python"):
        code = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
        compile(code, page.name, "exec")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert (page.parent / target).exists(), target


def assumed():
    """Model, key and default of each row of the page of assumptions."""
    text = (ROOT / "docs" / "guide" / "assumptions.md").read_text()
    for section in text.split("\n## ")[1:]:
        model = re.match("`(\\w+)`", section)
        for key, default in re.findall(r"^\| `(\w+)` \| (.*?) ?\|", section, re.MULTILINE):
            yield model[1] if model else "elastic_belt", key, default


@pytest.mark.parametrize(("model", "key", "default"), list(assumed()))
def test_assumptions_are_keys_of_the_model_and_have_its_defaults(model, key, default):
    parameter = load_schema(model, None, "guide").parameters[key]
    if default:
        assert read_value(parameter, default, key) == pytest.approx(parameter.default)


def test_paths_of_tests_and_jobs_in_the_table_of_validation_exist():
    text = (ROOT / "docs" / "guide" / "validation.md").read_text()
    paths = re.findall(r"`((?:\w+/)*(?:\w+\.(?:py|toml)|order|edges))`", text)
    assert len(paths) > 60
    for path in paths:
        assert (ROOT / path if path.startswith("jobs/") else ROOT / "tests" / path).exists(), path


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


def test_the_guide_is_built_and_names_all_its_pages(tmp_path):
    config = ROOT / "docs" / "mkdocs.yml"
    for page in (ROOT / "docs" / "guide").glob("*.md"):
        assert f"- {page.name}" in config.read_text()
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"]
    done = subprocess.run(
        [*build, "-f", config, "-d", tmp_path / "site"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Ten minutes" in (tmp_path / "site" / "tutorial.html").read_text()
    meant = (tmp_path / "site" / "variables.html").read_text()
    for model in map(load_model, MODELS):
        for variable in model.variables if model.is_recorded else ():
            assert (
                f"<td><code>{variable.name}</code></td>" in meant
                and escape(variable.comment, quote=False) in meant
            )


def test_a_command_that_is_none_is_seen():
    with pytest.raises(InputError):
        _parser().parse_args(["draw", "out/x"])
