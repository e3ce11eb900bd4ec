"""A hook of mkdocs: fills the page of terms with the models' declarations and with measured effects."""

from __future__ import annotations

import csv
import tomllib
from pathlib import Path
from typing import Any

from cvt_hpc.job.values import in_words
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.tables import below_origin

PAGE, TERMS = "terms.md", "<!-- terms -->"
HERE = Path(__file__).parent
EFFECTS = HERE.parent / "jobs" / "results" / "terms.csv"
# of rows of EFFECTS: columns, of which the largest counts, digits and unit
MEASURED = {
    "frequency": (("frequency_t1 [Hz]", "frequency_t2 [Hz]"), ".0f", "Hz"),
    "amplitude": (("amplitude_t1 [um]", "amplitude_t2 [um]"), ".1f", "um"),
}
HEAD = ("term", "equation", "key", "default", "models", "switched", *MEASURED, "pushbelt")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return the text of a page; that of PAGE with its table."""
    return markdown.replace(TERMS, table()) if page.file.src_uri == PAGE else markdown


def terms() -> list[dict[str, Any]]:
    """Terms with their equation and keys, as `terms.toml` has them."""
    found: list[dict[str, Any]] = tomllib.loads((HERE / "terms.toml").read_text(encoding="utf-8"))["term"]
    return found


def defaults(key: str) -> dict[str, list[str]]:
    """Models that take a key, by the default in words that it has there."""
    found: dict[str, list[str]] = {}
    for name in MODELS:
        for parameters in load_model(name).parameters.values():
            if key in parameters:
                words = in_words(parameters[key].default, parameters[key].unit)
                found.setdefault(words, []).append(name)
    return found


def effects() -> dict[str, dict[str, float]]:
    """Values of MEASURED by switch."""
    found: dict[str, dict[str, float]] = {}
    lines = below_origin(EFFECTS.read_text(encoding="utf-8").splitlines())
    for row in csv.DictReader(lines):
        found[row["switch"]] = {
            name: max(float(row[column]) for column in columns) for name, (columns, _, _) in MEASURED.items()
        }
    return found


def table() -> str:
    """Rows of all terms, a key of a default in a line of its own."""
    measured, lines = effects(), [HEAD, ("---",) * len(HEAD)]
    for term in terms():
        own = measured.get(term.get("switch"), {})
        changes = [_change(name, measured["none"], own) for name in MEASURED]
        first = (term["name"], term["equation"])
        last = (term.get("told", ""), *changes, term.get("pushbelt", ""))
        for key in term["keys"]:
            for default, models in defaults(key).items():
                lines.append((*first, f"`{key}`", default, ", ".join(models), *last))
                first, last = ("", ""), ("",) * len(last)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _change(name: str, base: dict[str, float], own: dict[str, float]) -> str:
    if name not in own:
        return ""
    _, digits, unit = MEASURED[name]
    return f"{base[name]:{digits}} to {own[name]:{digits}} {unit}"
