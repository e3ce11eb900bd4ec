"""The pages that people read: their blocks of code, their commands, their lines of prose."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
GUIDE = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]
BESIDE_CODE = sorted((ROOT / "cvt_hpc").rglob("*.md"))
PAGES = [*GUIDE, *BESIDE_CODE]
# Held to length of lines and words.
IN_PLAIN_WORDS = [*PAGES, ROOT / "docs" / "CHANGELOG.md", ROOT / "docs" / "coverage.md"]
_FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_MARKER = re.compile(r"<!--.*?-->", re.DOTALL)


class Block(NamedTuple):
    """A block of code: what its fence calls it, its text, and the line of the fence."""

    kind: str
    text: str
    line: int


def name_of(page: Path) -> str:
    """Path of a page in the repository."""
    return str(page.relative_to(ROOT))


def blocks(page: Path) -> list[Block]:
    """Blocks of code of a page, in their order."""
    text = page.read_text()
    return [Block(m[1].strip(), m[2], text.count("\n", 0, m.start()) + 1) for m in _FENCE.finditer(text)]


def prose(page: Path) -> str:
    """Text of a page, with an empty line in the place of each line of a block, or of a marker of a table."""
    text = page.read_text()
    for pattern in (_FENCE, _MARKER):
        text = pattern.sub(lambda block: "\n" * block[0].count("\n"), text)
    return text


def shell_calls(text: str) -> list[list[str]]:
    """Words of each command of a block of shell lines."""
    return [
        words
        for line in text.replace("\\\n", " ").splitlines()
        for call in re.split(r"&&|;", re.split(r"(?:^|\s)#", line)[0])
        if (words := shlex.split(call))
    ]


def inline_commands(page: Path) -> list[list[str]]:
    """Words of each `cvt-hpc ...` in the prose of a page, without the first."""
    found = re.findall(r"`cvt-hpc ([^`]+)`", prose(page))
    return [shlex.split(" ".join(words.split())) for words in found]


def paragraphs(page: Path) -> list[tuple[int, str]]:
    """Number and text of each line of prose: none of a block, a table, a formula on its own, or with a link."""
    text = re.sub(r"\$\$.*?\$\$", lambda formula: "\n" * formula[0].count("\n"), prose(page), flags=re.DOTALL)
    lines = enumerate(text.splitlines(), 1)
    return [
        (number, line)
        for number, line in lines
        if not line.startswith(("|", "!", "    ")) and "](" not in line
    ]
