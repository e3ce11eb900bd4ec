"""A hook of mkdocs: pictures of `jobs/results`, which pages show from where they lie in the repository."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

RESULTS = Path(__file__).parents[1] / "jobs" / "results"
IN_REPOSITORY, IN_SITE = "](../../jobs/results/", "](pictures/"


def on_files(files: Files, config: Any) -> Files:
    """Return the files of the site, with the pictures."""
    for picture in RESULTS.glob("*.png"):
        files.append(File.generated(config, f"pictures/{picture.name}", abs_src_path=str(picture)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return the text of a page with the places that pictures have in the site."""
    return markdown.replace(IN_REPOSITORY, IN_SITE)
