"""A hook of mkdocs: fills the page of variables with what the models declare of their records."""

from __future__ import annotations

from typing import Any

from cvt_hpc.job import build_job
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.simulation import record_coordinates, record_variables

PAGE, VARIABLES, DIMENSIONS = "variables.md", "<!-- variables -->", "<!-- dimensions -->"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return the text of a page; that of PAGE with its tables."""
    if page.file.src_uri != PAGE:
        return markdown
    variables: dict[tuple[str, ...], list[str]] = {}
    dimensions: dict[tuple[str, ...], list[str]] = {}
    recorded = [name for name in MODELS if load_model(name).is_recorded]
    for name in recorded:
        job = build_job({"name": "guide", "model": name}, "guide")
        declared = {v.name: v for v in (*record_variables(job), *load_model(name).variables)}
        for v in declared.values():
            meaning = f"{v.words}: {v.comment}" if v.words else v.comment
            if v.flags is not None:
                meaning += f" ({', '.join(f'{flag.value} {flag.name.lower()}' for flag in v.flags)})"
            row = (f"`{v.name}`", ", ".join(v.dims), v.units, meaning)
            variables.setdefault(row, []).append(name)
        for dimension, coordinate in record_coordinates(job).items():
            meaning = ": ".join(filter(None, (coordinate.long_name, coordinate.comment)))
            dimensions.setdefault((f"`{dimension}`", coordinate.units, meaning), []).append(name)
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
