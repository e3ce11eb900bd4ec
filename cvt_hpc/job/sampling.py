"""Samples of the space that the ranges of a job's axes span, drawn by scipy.stats.qmc."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.job.axes import Axis, read_bounds, read_spacing, read_values
from cvt_hpc.job.design import LISTED, Design
from cvt_hpc.job.values import kind_of
from cvt_hpc.parameters import Parameter

_KEYS = ("from", "to", "spacing")


def sampled_axes(
    found: Mapping[str, tuple[Parameter, Any, str]], design: Design, source: str
) -> tuple[Axis, ...]:
    """Return the axes of a sampled study, each with the value of every sample.

    Parameters
    ----------
    found : mapping
        By name the declaration of the parameter, and the entry in the job file, a table with from, to and
        optionally spacing; and file and key, for the error. In the place of all ranges may stand the lists of
        drawn values, as the resolved job in a dataset gives them; with the kind "listed" they have to.
    design : dict
        Kind, `runs` and `seed`.
    source : str
        The job file, for the error.

    Returns
    -------
    tuple of Axis
        With `runs` values each; values at one place belong together.

    Raises
    ------
    InputError
        If there is no axis, or one has no continuous values or no legal range.
    """
    if not found:
        raise mismatch(f"{source}: [axes]", "one axis or more, to draw samples from", "none")
    for parameter, _, where in found.values():
        if kind_of(parameter) is not float:
            raise mismatch(where, "a parameter with continuous values, to draw samples from", "another one")
    drawn = all(isinstance(raw, list) and len(raw) == design["runs"] for _, raw, _ in found.values())
    if drawn or design["kind"] == LISTED:
        return tuple(_read_listed(name, design["runs"], *entry) for name, entry in found.items())
    ranges = [read_range(*entry) for entry in found.values()]
    shares = _draw(design, len(ranges)).T
    return tuple(
        Axis(name, tuple(between(*ends, share).tolist()), parameter.unit, parameter.description, ends[2])
        for (name, (parameter, _, _)), ends, share in zip(found.items(), ranges, shares, strict=True)
    )


def _read_listed(name: str, runs: int, parameter: Parameter, raw: Any, where: str) -> Axis:
    """Return an axis with the value of each sample, as it stands in the job; values may come again."""
    if not isinstance(raw, (list, tuple, np.ndarray)) or len(raw) != runs:
        found = f"{len(raw)} values" if isinstance(raw, (list, tuple, np.ndarray)) else show(raw)
        raise mismatch(where, f"a list of {runs} values, one for each of the runs of [design]", found)
    return Axis(name, read_values(parameter, raw, where), parameter.unit, parameter.description)


def read_range(parameter: Parameter, raw: Any, where: str) -> tuple[float, float, str]:
    """Return the ends of a range and the spacing of the values drawn from it."""
    if not isinstance(raw, dict):
        raise mismatch(where, "a range {from=, to=}, to draw samples from", show(raw))
    for key in raw:
        if key not in _KEYS:
            raise unknown(f"{where}.{key}", "key of a range to draw samples from", key, _KEYS)
    start, stop = read_bounds(parameter, raw, where)
    return start, stop, read_spacing(raw, start, stop, where)


def _draw(design: Design, dimensions: int) -> np.ndarray:
    """Return samples of the unit cube, shape (runs, dimensions)."""
    from scipy.stats import qmc

    engine = {"sobol": qmc.Sobol, "latin_hypercube": qmc.LatinHypercube}[design["kind"]]
    return engine(dimensions, seed=np.random.default_rng(design["seed"])).random(design["runs"])


def between(start: float, stop: float, spacing: str, share: np.ndarray) -> np.ndarray:
    """Return the values at shares of the way from `start` to `stop`, by their spacing."""
    return start * (stop / start) ** share if spacing == "log" else start + (stop - start) * share
