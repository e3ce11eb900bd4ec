"""In what two jobs differ, in words."""

from __future__ import annotations

import json
from typing import Any


def describe_difference(found: dict[str, Any], asked: dict[str, Any]) -> str:
    """Return the first few entries in which two resolved jobs differ, as "key is 1 there, 2 here"."""
    there, here = _flatten(found), _flatten(asked)
    keys = [key for key in {**there, **here} if there.get(key) != here.get(key)]
    shown = [f"{key} is {_short(there.get(key))} there, {_short(here.get(key))} here" for key in keys[:3]]
    return "; ".join(shown) + ("; ..." if len(keys) > 3 else "")


def _flatten(entry: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(entry, dict):
        return {prefix: entry}
    parts = (_flatten(value, f"{prefix}.{key}" if prefix else key) for key, value in entry.items())
    return {key: value for part in parts for key, value in part.items()}


def _short(value: Any) -> str:
    text = "not set" if value is None else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
