"""Vibration-occurrence maps of metal pushbelt CVTs: thousands of transient runs under MPI.

`build_job`, `load_job`, `simulate`, `run`, `open_results`, `read_table`, `map_figure`, `maps_figure` and
`history_figure`; what they need is imported at their first use. Datasets have `dataset.cvt` (`accessor.py`).
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"
__all__ = [
    "build_job",
    "history_figure",
    "load_job",
    "map_figure",
    "maps_figure",
    "open_results",
    "read_table",
    "run",
    "simulate",
]

_EXPORTS = {
    "build_job": "cvt_hpc.job",
    "history_figure": "cvt_hpc.analysis.histories",
    "load_job": "cvt_hpc.job",
    "map_figure": "cvt_hpc.analysis.maps",
    "maps_figure": "cvt_hpc.analysis.studies",
    "open_results": "cvt_hpc.accessor",
    "read_table": "cvt_hpc.accessor",
    "run": "cvt_hpc.study",
    "simulate": "cvt_hpc.simulation",
}


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
