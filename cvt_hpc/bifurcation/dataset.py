"""The dataset of a bifurcation diagram: branches over the grid of axes, Hopf points and runs in lists."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from cvt_hpc.bifurcation.job import Diagram
from cvt_hpc.history_files import CONTENT, DIAGRAM
from cvt_hpc.models.linear_stability.branch import Branch, tracks
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.forces import quantities
from cvt_hpc.models.steady_variator.record import VARIABLES, coordinates
from cvt_hpc.study.provenance import command, history_line
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Kind

if TYPE_CHECKING:
    from cvt_hpc.bifurcation.followed import Followed

OF_MODES = {  # what is told of a mode: value, unit, name for people
    "growth_rate": (lambda mode: mode.growth, "s-1", "growth rate of the mode"),
    "frequency": (lambda mode: mode.frequency, "Hz", "frequency of the mode"),
    "vibrating_strand": (
        lambda mode: mode.strand + 1,
        "1",
        "strand in which it is largest: 1 is t1, 2 is t2",
    ),
    "half_waves": (lambda mode: mode.half_waves, "1", "its half waves along that strand"),
}


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


def diagram_dataset(diagram: Diagram, followed: Sequence[Followed]) -> xr.Dataset:
    """All branches in one dataset.

    Parameters
    ----------
    diagram : Diagram
        What was asked for.
    followed : sequence of Followed
        Its first branches, in the order of `diagram.branches`: all, or those that are done.

    Returns
    -------
    Dataset
        Over the axes and `load` the steady states; with `mode` the modes, each followed from one load to
        the next; along `onset` the Hopf points and along `run` the runs, with the number of their branch in
        the grid of the axes, counted in C order.
    """
    axes = {
        axis.name: (axis.name, list(axis.values), _attributes(axis.unit, axis.description))
        for axis in diagram.axes
    }
    lengths = {axis.name: len(axis.values) for axis in diagram.axes}
    for derived in diagram.job.derived:  # none of them along the load
        values = np.array(derived.values).reshape([lengths[name] for name in derived.axes])
        axes[derived.name] = derived.axes, values, _attributes(derived.unit, derived.description)
    axes["load"] = ("load", list(diagram.loads), _attributes("N m", "torque at the driving pulley"))
    labels = {
        name: (name, c.values.astype(object), _attributes(c.units, c.long_name))
        for name, c in coordinates(diagram.job.parameters).items()
    }
    attributes = {
        "Conventions": "CF-1.11",
        "title": diagram.job.description or diagram.job.name,
        "job_name": diagram.job.name,
        "job": json.dumps(diagram.resolved()),
        "history": history_line(command()),
        CONTENT: DIAGRAM,
    }
    variables = _steady(diagram, followed) | _modes(diagram, followed) | _onsets(followed) | _runs(followed)
    return xr.Dataset(variables, axes | labels, attributes)


def _steady(diagram: Diagram, followed: Sequence[Followed]) -> dict[str, Any]:
    """Numbers of the steady states over axes and load, and whether they are stable."""
    sizes = {name: c.values.size for name, c in coordinates(diagram.job.parameters).items()}
    grid, dims = _grid(diagram)
    stability = np.full((len(diagram.branches), len(diagram.loads)), Stability.NOT_COMPUTED, np.int8)
    stability[: len(followed)] = Stability.NOT_FOUND
    values = {v.name: np.full((*stability.shape, *(sizes[d] for d in v.dims)), np.nan) for v in VARIABLES}
    for row, one in enumerate(followed):
        for point in one.branch.points:
            place = row, diagram.loads.index(point.steady.load)
            stability[place] = Stability.UNSTABLE if point.growth > 0.0 else Stability.STABLE
            for name, value in quantities(point.steady, one.grid).items():
                values[name][place] = value
    told = {
        v.name: ((*dims, *v.dims), values[v.name].reshape(*grid, *values[v.name].shape[2:]),
                 _attributes(v.units, v.long_name))
        for v in VARIABLES
    }  # fmt: skip
    flags = _flags(Stability, "whether the steady state is stable")
    return {"stability": (dims, stability.reshape(grid), flags)} | told


def _modes(diagram: Diagram, followed: Sequence[Followed]) -> dict[str, Any]:
    """What is told of the modes over axes, load and mode."""
    grid, dims = _grid(diagram)
    lines = [mode_lines(one.branch) for one in followed]
    most = max((len(of_one) for of_one in lines), default=0)
    told = {}
    for name, (value, unit, long_name) in OF_MODES.items():
        array = np.full((len(diagram.branches), len(diagram.loads), most), np.nan)
        for row, of_one in enumerate(lines):
            for column, line in enumerate(of_one):
                for load, mode in line.items():
                    array[row, diagram.loads.index(load), column] = value(mode)
        told[name] = (*dims, "mode"), array.reshape(*grid, most), _attributes(unit, long_name)
    return told


def mode_lines(branch: Branch) -> list[dict[float, Mode]]:
    """Modes of a branch by load [N m], each followed as far as there are states; the most unstable first."""
    lines = [
        {piece[place].steady.load: mode for place, mode in track.items()}
        for piece in branch.pieces()
        for track in tracks(piece)
    ]
    return sorted(lines, key=lambda line: -max(mode.growth for mode in line.values()))


def _onsets(followed: Sequence[Followed]) -> dict[str, Any]:
    """The Hopf points of all branches, one after the other."""
    rows = [
        (number, onset, kind)
        for number, one in enumerate(followed)
        for onset, kind in zip(one.onsets, one.kinds, strict=True)
    ]
    columns = {
        "onset_branch": ([n for n, *_ in rows], np.int32, "1", "its branch in the grid of the axes"),
        "onset_load": ([o.load for _, o, _ in rows], float, "N m", "load at the Hopf point"),
        "onset_frequency": ([o.mode.frequency for _, o, _ in rows], float, "Hz", "frequency of its mode"),
        "onset_strand": ([o.mode.strand + 1 for _, o, _ in rows], np.int8, "1", "strand: 1 is t1, 2 is t2"),
        "onset_half_waves": ([o.mode.half_waves for _, o, _ in rows], np.int8, "1", "half waves there"),
        "onset_others": ([o.others for _, o, _ in rows], np.int8, "1", "other modes that grow there; 0: "
                         "stability is lost or regained"),
        "hysteresis_width": ([k.width for *_, k in rows], float, "N m", "from the Hopf point to where "
                             "vibration from the large start ends"),
        "hysteresis_error": ([k.error for *_, k in rows], float, "N m", "half the spacing of runs there, "
                             "and the Hopf point's own error"),
    }  # fmt: skip
    told = {
        name: ("onset", np.array(values, dtype), _attributes(unit, long_name))
        for name, (values, dtype, unit, long_name) in columns.items()
    }
    directions = [Direction.GROWS_ABOVE if o.rising else Direction.GROWS_BELOW for _, o, _ in rows]
    told["onset_direction"] = (
        "onset",
        np.array(directions, np.int8),
        _flags(Direction, "whether the mode grows above or below that load"),
    )
    kinds = np.array([kind.kind for *_, kind in rows], np.int8)
    told["onset_kind"] = "onset", kinds, _flags(Kind, "super- or subcritical")
    reasons = np.array([kind.reason for *_, kind in rows], object)
    told["onset_reason"] = "onset", reasons, {"long_name": "why it is found to be so"}
    return told


def _runs(followed: Sequence[Followed]) -> dict[str, Any]:
    """The runs of all branches, one after the other."""
    rows = [(number, run) for number, one in enumerate(followed) for run in one.runs]
    columns = {
        "run_branch": ([n for n, _ in rows], np.int32, "1", "its branch in the grid of the axes"),
        "run_load": ([run.value for _, run in rows], float, "N m", "load"),
        "run_start": (
            [run.start for _, run in rows],
            np.int8,
            "1",
            "0: the steady state; 1: the large one",
        ),
        "run_amplitude": ([run.amplitude for _, run in rows], float, "m", "amplitude in the band"),
        "run_frequency": ([run.frequency for _, run in rows], float, "Hz", "dominant frequency"),
    }
    told = {
        name: ("run", np.array(values, dtype), _attributes(unit, long_name))
        for name, (values, dtype, unit, long_name) in columns.items()
    }
    classes = np.array([run.occurrence for _, run in rows], np.int8)
    told["run_occurrence"] = "run", classes, _flags(OccurrenceClass, "vibration occurrence")
    reasons = np.array([run.reason for _, run in rows], object)
    told["run_reason"] = "run", reasons, {"long_name": "why the run failed, or was found to vibrate or not"}
    return told


def _grid(diagram: Diagram) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Lengths and names of the dimensions of a steady state."""
    axes = [(len(axis.values), axis.name) for axis in diagram.axes] + [(len(diagram.loads), "load")]
    lengths, names = zip(*axes, strict=True)
    return lengths, names


def _flags(kind: type[IntEnum], long_name: str) -> dict[str, Any]:
    return {
        "long_name": long_name,
        "flag_values": np.array(list(kind), np.int8),
        "flag_meanings": " ".join(flag.name.lower() for flag in kind),
    }


def _attributes(unit: str, long_name: str) -> dict[str, str]:
    return {"long_name": long_name, **({"units": unit} if unit else {})}
