"""Maps of a study, pictures and files of a run's history."""

import contextlib
import importlib.util
import os
import sys
from pathlib import Path


def _import_matplotlib() -> None:
    """Import matplotlib without a user's settings: some of them let the import fail.

    Its own settings are found by the first place in which it looks for any, the current folder.
    """
    (package,) = importlib.util.find_spec("matplotlib").submodule_search_locations  # type: ignore[union-attr, misc]  # it is required
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        with contextlib.chdir(Path(package) / "mpl-data"):
            importlib.import_module("matplotlib")
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend


if "matplotlib" not in sys.modules:
    _import_matplotlib()
