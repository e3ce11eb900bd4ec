"""README, guide and the pages beside the code: commands in their prose, links, lengths and words.

Their blocks of code are done by `test_guide_blocks.py`.
"""

import re
import runpy
import subprocess
import sys
from html import escape

import pytest

from cvt_hpc.cli import _parser
from cvt_hpc.errors import InputError
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.values import read_value
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from support.pages import IN_PLAIN_WORDS, PAGES, ROOT, inline_commands, name_of, paragraphs, prose

LONGEST_LINE = 120
# Words of a dialect, for which the field has its own: model, iteration, uncertainty, stated.
DIALECT = re.compile(r"\b(rungs?|climb(s|ed|ing)?|doubt(s|ed)?|in turns?|asked|said)\b", re.IGNORECASE)
PLACEHOLDERS = {"K/N": "1/2", "N": "2"}
COMMANDS = [(name_of(page), words) for page in PAGES for words in inline_commands(page)]


def test_there_are_commands_in_prose():
    assert len(COMMANDS) > 30 and {page for page, _ in COMMANDS} >= {"README.md", "docs/guide/verdicts.md"}


@pytest.mark.parametrize(
    ("page", "words"), COMMANDS, ids=[f"{page}: {' '.join(words)}" for page, words in COMMANDS]
)
def test_commands_in_prose_are_legal(page, words):
    """As they stand, or with the kind, job, folder or quantity that a sentence leaves out."""
    words = [PLACEHOLDERS.get(word, word) for word in words if word != "..."]
    for left_out in ([], ["X"], ["X", "Y"], ["history", "X"]):
        try:
            _parser().parse_args([*words, *left_out])
            return
        except InputError as error:
            refused = error
    raise refused


@pytest.mark.parametrize("page", IN_PLAIN_WORDS, ids=name_of)
def test_lines_of_prose_are_short(page):
    assert [f"{n}: {len(line)}" for n, line in paragraphs(page) if len(line) > LONGEST_LINE] == []


@pytest.mark.parametrize("page", IN_PLAIN_WORDS, ids=name_of)
def test_words_are_those_of_the_field(page):
    text = re.sub(r"`[^`]*`", "", prose(page))
    assert [found[0] for found in DIALECT.finditer(text)] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
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


def test_assumptions_are_keys_of_the_model_and_have_its_defaults():
    rows = list(assumed())
    assert len(rows) > 80
    for model, key, default in rows:
        parameter = load_schema(model, None, "guide").parameters[key]
        if default:
            assert read_value(parameter, default, key) == pytest.approx(parameter.default), key


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
    site = {page.stem: page.read_text() for page in (tmp_path / "site").glob("*.html")}
    assert "Ten minutes" in site["tutorial"]
    loaded = re.compile(r'(?:src|<link[^>]*href)="(?:https?:)?//')
    assert not [name for name, text in site.items() if loaded.search(text)]
    assert site["theory_belt"].count("<svg") > 100 and "arithmatex" not in "".join(site.values())
    assert (tmp_path / "site" / "pictures" / "lebrecht_2004.png").exists() and "pictures/lebrecht" in site[
        "tutorial"
    ]
    results = [page for page in (ROOT / "docs" / "guide").glob("*.md") if "<!-- table" in page.read_text()]
    assert results
    for page in results:
        assert site[page.stem].count("jobs/results/") >= page.read_text().count("<!-- table")
        assert "<!-- table" not in site[page.stem]
    meant = (tmp_path / "site" / "variables.html").read_text()
    for model in map(load_model, MODELS):
        for variable in model.variables if model.is_recorded else ():
            assert (
                f"<td><code>{variable.name}</code></td>" in meant
                and escape(variable.comment, quote=False) in meant
            )


STORED = """# revision: stored by 1234567890123456789012345678901234567890 (1 of 2 lines)
# date: 2026-01-31
# older than the code: another law
part,load [N m],vibrates,amplitude_t1 [um],amplitude_t2 [um],frequency_t1 [Hz],frequency_t2 [Hz]
shaft,30,undecided,1,0.5,300,400
shaft,10,yes,2,34.56,500,512.6
shaft,20,yes,1200.4,3,507,600
shaft,15,,,,,
none,10,no,,,,
none,20,irregular,,,,
"""
MARKER = """before
<!-- table
of = "small"
caption = "Small"
by = {"what" = "part"}
[columns]
"window" = "window(load, vibrates)"
"largest" = ["amplitude.max(), frequency[vibrates == 'yes']", "{} at {}"]
-->
after"""


def test_a_marker_becomes_a_table_of_results(tmp_path, monkeypatch):
    hook = runpy.run_path(str(ROOT / "docs" / "results_tables.py"))["on_page_markdown"]
    monkeypatch.setitem(hook.__globals__, "RESULTS", tmp_path)
    (tmp_path / "small.csv").write_text(STORED)
    *_, shaft, none, _, origin, after = hook(MARKER).splitlines()
    assert shaft == "| shaft | 10 to 20, 30? | 1200 at 507 to 513 |"
    assert none == "| none | 20 irregular | - |"
    assert origin == (
        "*`jobs/results/small.csv`, revision 123456789, 2026-01-31; **older than the code**: another law*"
    )
    columns = hook(
        MARKER.replace('by = {"what" = "part"}', 'across = "load"\nrows = "load > 10"')
    ).splitlines()
    assert "| 1 at - |  |" in columns[5] and after == "after"
    with pytest.raises(ValueError, match="expected rows where load > 99"):
        hook(MARKER.replace("[columns]", 'rows = "load > 99"\n[columns]'))


def test_a_command_that_is_none_is_seen():
    with pytest.raises(InputError):
        _parser().parse_args(["draw", "out/x"])
