"""A hook of mkdocs: formulas as drawings within the page, the same in every browser and without a network."""

from __future__ import annotations

import re
from functools import cache
from html import escape, unescape
from typing import Any

import ziamath

SIZE = 17  # [px], beside prose of 16
# as pymdownx.arithmatex writes them in its generic mode
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(html: str, **_: Any) -> str:
    """Return the content of a page with its formulas drawn."""
    return _FORMULA.sub(lambda found: _drawn(found[1], unescape(found[2]).strip()), html)


@cache
def _drawn(kind: str, latex: str) -> str:
    within = kind == "span"
    formula = ziamath.Latex(latex, size=SIZE, inline=within)
    place = f"vertical-align: {formula.getyofst():.2f}px" if within else "display: block; margin: 1em auto"
    label = f'<svg role="img" aria-label="{escape(latex)}" style="{place}; max-width: 100%" '
    return formula.svg().replace("<svg ", label, 1).replace('fill="black"', 'fill="currentColor"')
