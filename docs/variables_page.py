"""A hook of mkdocs: fills the page of variables with what the models declare of their records."""

from __future__ import annotations

from typing import Any

from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.simulation import declared_record

PAGE, VARIABLES, DIMENSIONS = "variables.md", "<!-- variables -->", "<!-- dimensions -->"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return the text of a page; that of PAGE with its tables."""
    if page.file.src_uri != PAGE:
        return markdown
    variables: dict[tuple[str, ...], list[str]] = {}
    dimensions: dict[tuple[str, ...], list[str]] = {}
    recorded = [name for name in MODELS if load_model(name).is_recorded]
    for name in recorded:
        declared, coordinates = declared_record(name, "guide")
        for v in declared:
            row = (f"`{v.name}`", ", ".join(v.dims), v.units, v.meaning)
            variables.setdefault(row, []).append(name)
        for dimension, coordinate in coordinates.items():
            along = (f"`{dimension}`", coordinate.units, coordinate.meaning)
            dimensions.setdefault(along, []).append(name)
    return markdown.replace(
        VARIABLES, _table(("variable", "along", "unit", "meaning", "models"), variables, recorded)
    ).replace(DIMENSIONS, _table(("dimension", "unit", "meaning", "models"), dimensions, recorded))


def _table(head: tuple[str, ...], rows: dict[tuple[str, ...], list[str]], recorded: list[str]) -> str:
    lines = [head, ("---",) * len(head)]
    for row, models in sorted(rows.items(), key=lambda item: (item[0][0].strip("`"), item[1])):
        others = [name for name in recorded if name not in models]
        few = f"all but {', '.join(others)}" if others else "all"
        lines.append((*row, ", ".join(models) if len(models) <= len(others) else few))
    return "\n".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines)
