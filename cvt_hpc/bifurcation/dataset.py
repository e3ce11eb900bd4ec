"""The dataset of a bifurcation diagram: branches over the grid of axes, Hopf points and runs in lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from cvt_hpc.bifurcation.job import LOAD, Diagram, load_attributes
from cvt_hpc.models.linear_stability.branch import Branch, tracks
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.forces import quantities
from cvt_hpc.models.steady_variator.record import VARIABLES, coordinates
from cvt_hpc.netcdf import CONTENT, DIAGRAM, attributes, flag_attributes, global_attributes
from cvt_hpc.study.dimensions import axis_dimension, derived_coordinate
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Kind

if TYPE_CHECKING:
    from cvt_hpc.bifurcation.followed import Followed

    _Numbered = Sequence[tuple[int, Followed]]

STRAND = "strand in which the mode is largest: 1 is t1, 2 is t2"
OF_MODES = {  # attributes of a mode: value, unit, name for people, comment
    "growth_rate": (lambda mode: mode.growth, "s-1", "growth rate", "of the mode"),
    "frequency": (lambda mode: mode.frequency, "Hz", "frequency", "of the mode"),
    "vibrating_strand": (lambda mode: mode.strand + 1, "1", "vibrating strand", STRAND),
    "half_waves": (lambda mode: mode.half_waves, "1", "half waves", "of the mode along its vibrating strand"),
}
BRANCH = "number of the branch in the grid of the axes, counted in C order"
OF_KIND = "why the Hopf point is found to be of its kind"
START = "0: near the steady state; 1: the large disturbance"
REASON = "why the run failed, or was found to vibrate or not"


class Stability(IntEnum):
    """Of a steady state."""

    STABLE = 0
    UNSTABLE = 1
    NOT_FOUND = 2
    NOT_COMPUTED = 3


class Direction(IntEnum):
    """Where the mode of a Hopf point grows."""

    GROWS_ABOVE = 0
    GROWS_BELOW = 1


def diagram_dataset(
    diagram: Diagram, followed: Mapping[int, Followed], makers: Sequence[Mapping[str, Any]] = ()
) -> xr.Dataset:
    """All branches in one dataset.

    Parameters
    ----------
    diagram : Diagram
        The requested diagram.
    followed : mapping
        Branches by their place in `diagram.branches`: all, or the finished ones.
    makers : sequence of mapping
        Origin of the results, as `global_attributes` takes it.

    Returns
    -------
    Dataset
        Over the axes and `load` the steady states; with `mode` the modes, each followed from one load to
        the next; along `onset` the Hopf points and along `run` the runs, with the number of their branch in
        the grid of the axes, counted in C order.
    """
    axes: dict[str, Any] = {
        axis.name: (axis.name, list(axis.values), axis_dimension(axis, diagram.job).attributes)
        for axis in diagram.axes
    }
    lengths = {axis.name: len(axis.values) for axis in diagram.axes}
    for derived in diagram.job.derived:  # none of them along the load
        values = np.array(derived.values).reshape([lengths[name] for name in derived.axes])
        axes[derived.name] = derived.axes, values, derived_coordinate(derived, diagram.job).attributes
    axes["load"] = ("load", list(diagram.loads), load_attributes(diagram.job))
    labels = {
        name: (name, c.values.astype(object), attributes(c.long_name, c.units, c.comment))
        for name, c in coordinates(diagram.job.parameters).items()
    }
    subject = f"bifurcations of model {diagram.job.model}"
    told = {**global_attributes(diagram.job, diagram.resolved(), subject, makers=makers), CONTENT: DIAGRAM}
    rows = sorted(followed.items())
    variables = _steady(diagram, rows) | _modes(diagram, rows) | _onsets(rows) | _runs(rows)
    return xr.Dataset(variables, axes | labels, told)


def _steady(diagram: Diagram, followed: _Numbered) -> dict[str, Any]:
    """Numbers of the steady states over axes and load, and whether they are stable."""
    sizes = {name: c.values.size for name, c in coordinates(diagram.job.parameters).items()}
    grid, dims = _grid(diagram)
    stability = np.full((len(diagram.branches), len(diagram.loads)), Stability.NOT_COMPUTED, np.int8)
    stability[[row for row, _ in followed]] = Stability.NOT_FOUND
    values = {v.name: np.full((*stability.shape, *(sizes[d] for d in v.dims)), np.nan) for v in VARIABLES}
    for row, one in followed:
        for point in one.branch.points:
            place = row, diagram.loads.index(point.steady.load)
            stability[place] = Stability.UNSTABLE if point.growth > 0.0 else Stability.STABLE
            for name, value in quantities(point.steady, one.grid).items():
                values[name][place] = value
    told = {
        v.name: ((*dims, *v.dims), values[v.name].reshape(*grid, *values[v.name].shape[2:]),
                 attributes(v.long_name, v.units, v.comment))
        for v in VARIABLES
    }  # fmt: skip
    flags = attributes("stability", comment="of the steady state") | flag_attributes(Stability)
    return {"stability": (dims, stability.reshape(grid), flags)} | told


def _modes(diagram: Diagram, followed: _Numbered) -> dict[str, Any]:
    """Attributes of the modes over axes, load and mode."""
    grid, dims = _grid(diagram)
    lines = [(row, mode_lines(one.branch)) for row, one in followed]
    most = max((len(of_one) for _, of_one in lines), default=0)
    told = {}
    for name, (value, *named) in OF_MODES.items():
        array = np.full((len(diagram.branches), len(diagram.loads), most), np.nan)
        for row, of_one in lines:
            for column, line in enumerate(of_one):
                for load, mode in line.items():
                    array[row, diagram.loads.index(load), column] = value(mode)
        told[name] = (*dims, "mode"), array.reshape(*grid, most), _named(*named)
    return told


def mode_lines(branch: Branch) -> list[dict[float, Mode]]:
    """Modes of a branch by load [N m], each followed as far as there are states; the most unstable first."""
    lines = [
        {piece[place].steady.load: mode for place, mode in track.items()}
        for piece in branch.pieces()
        for track in tracks(piece)
    ]
    return sorted(lines, key=lambda line: -max(mode.growth for mode in line.values()))


def _onsets(followed: _Numbered) -> dict[str, Any]:
    """The Hopf points of all branches, one after the other."""
    rows = [
        (number, onset, kind)
        for number, one in followed
        for onset, kind in zip(one.onsets, one.kinds, strict=True)
    ]
    columns = {
        "onset_branch": ([n for n, *_ in rows], np.int32, "1", "branch", BRANCH),
        "onset_load": ([o.load for _, o, _ in rows], float, "N m", "onset load", "load at the Hopf point"),
        "onset_frequency": ([o.mode.frequency for _, o, _ in rows], float, "Hz", "onset frequency",
                            "frequency of the mode whose growth rate is 0 at the Hopf point"),
        "onset_strand": ([o.mode.strand + 1 for _, o, _ in rows], np.int8, "1", "vibrating strand", STRAND),
        "onset_half_waves": ([o.mode.half_waves for _, o, _ in rows], np.int8, "1", "half waves",
                             "of the mode along its vibrating strand"),
        "onset_others": ([o.others for _, o, _ in rows], np.int8, "1", "other growing modes",
                         "number of them; 0: stability is lost or regained at this Hopf point"),
        "hysteresis_width": ([k.width for *_, k in rows], float, "N m", "hysteresis width",
                             "from the Hopf point to where vibration from the large start ends"),
        "hysteresis_error": ([k.error for *_, k in rows], float, "N m", "error of the hysteresis width",
                             "half the spacing of runs there, and the Hopf point's own error"),
    }  # fmt: skip
    told = {
        name: ("onset", np.array(values, dtype), _named(*named))
        for name, (values, dtype, *named) in columns.items()
    }
    directions = [Direction.GROWS_ABOVE if o.rising else Direction.GROWS_BELOW for _, o, _ in rows]
    told["onset_direction"] = (
        "onset",
        np.array(directions, np.int8),
        attributes("side of growth", comment="whether the mode grows above or below the Hopf point")
        | flag_attributes(Direction),
    )
    kinds = np.array([kind.kind for *_, kind in rows], np.int8)
    told["onset_kind"] = "onset", kinds, attributes("kind of Hopf point") | flag_attributes(Kind)
    reasons = np.array([kind.reason for *_, kind in rows], object)
    told["onset_reason"] = (
        "onset",
        reasons,
        attributes("reason", comment=OF_KIND),
    )
    return told


def _runs(followed: _Numbered) -> dict[str, Any]:
    """The runs of all branches, one after the other."""
    rows = [(number, run) for number, one in followed for run in one.runs]
    columns = {
        "run_branch": ([n for n, _ in rows], np.int32, "1", "branch", BRANCH),
        "run_load": ([run.value for _, run in rows], float, "N m", "load", LOAD),
        "run_start": ([run.start for _, run in rows], np.int8, "1", "start", START),
        "run_amplitude": ([run.amplitude for _, run in rows], float, "m", "amplitude", "in the band"),
        "run_frequency": ([run.frequency for _, run in rows], float, "Hz", "dominant frequency", ""),
    }
    told = {
        name: ("run", np.array(values, dtype), _named(*named))
        for name, (values, dtype, *named) in columns.items()
    }
    classes = np.array([run.occurrence for _, run in rows], np.int8)
    told["run_occurrence"] = (
        "run",
        classes,
        attributes("vibration occurrence") | flag_attributes(OccurrenceClass),
    )
    reasons = np.array([run.reason for _, run in rows], object)
    told["run_reason"] = "run", reasons, attributes("reason", comment=REASON)
    return told


def _grid(diagram: Diagram) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Lengths and names of the dimensions of a steady state."""
    axes = [(len(axis.values), axis.name) for axis in diagram.axes] + [(len(diagram.loads), "load")]
    lengths, names = zip(*axes, strict=True)
    return lengths, names


def _named(units: str, long_name: str, comment: str) -> dict[str, str]:
    return attributes(long_name, units, comment)
