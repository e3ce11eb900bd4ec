"""Vibration-occurrence maps of metal pushbelt CVTs: thousands of transient runs under MPI.

`load_job`, `simulate`, `run` and `open_results`; what they need is imported at their first use.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

__version__ = "0.1.0"
__all__ = ["load_job", "open_results", "run", "simulate"]

_EXPORTS = {"load_job": "cvt_hpc.job", "run": "cvt_hpc.study", "open_results": "cvt_hpc.study"}


def __getattr__(name: str) -> Any:
    if name == "simulate":
        return import_module("cvt_hpc.simulate")
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


class _CallableModule(ModuleType):
    """The module `cvt_hpc.simulate`, which may be called as the function `simulate` that it holds."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self.simulate(*arguments, **options)


class _Package(ModuleType):
    """The package itself: a submodule, once imported, becomes its attribute, and hides what has its name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "simulate" and type(value) is ModuleType:
            value.__class__ = _CallableModule
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
