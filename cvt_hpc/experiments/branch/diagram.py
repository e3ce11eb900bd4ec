"""A bifurcation diagram made: branches followed, Hopf points found and classified, kept, written, drawn.

The dataset holds branches over the grid of axes, and Hopf points and runs in lists.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from enum import IntEnum
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.figures import draw
from cvt_hpc.experiments.branch.attractors import (
    OF_MODES,
    STRAND,
    Attractor,
    Followed,
    Stability,
    Start,
    attractors,
    states_of,
)
from cvt_hpc.experiments.branch.drawing import branch_figure
from cvt_hpc.experiments.branch.job import (
    LOAD,
    Asked,
    Diagram,
    load_attributes,
    predicted_cost,
)
from cvt_hpc.experiments.branch.table import branch_lines, failure_lines, lowest_judged, with_kinds
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.experiments.parts import PartsFolder
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.models.elastic_belt.belt import State, mesh
from cvt_hpc.models.linear_stability.branch import Branch, Onset, branch, onsets
from cvt_hpc.models.linear_stability.modes import LOW
from cvt_hpc.models.steady_variator.record import VARIABLES, coordinates
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from cvt_hpc.storage import netcdf
from cvt_hpc.storage.archives import Arrays
from cvt_hpc.storage.output_folder import Kind as FolderKind
from cvt_hpc.study.description import axis_dimension, derived_coordinate
from cvt_hpc.study.ranks.progress import Steps
from cvt_hpc.study.status import DONE, SOME_FAILED
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Kind

_PICTURE = re.compile(r"branch(?:_([1-9]\d{0,8}))?\.png", re.ASCII)

_Numbered = Sequence[tuple[int, Followed]]

_BRANCH = "number of the branch in the grid of the axes, counted in C order"
_OF_KIND = "why the Hopf point is found to be of its kind"
_START = "0: near the steady state; 1: the large disturbance"
_REASON = "why the run failed, or was found to vibrate or not"


def _picture_names(branches: int) -> list[str]:
    """Return the names of the pictures of so many branches."""
    return [f"branch_{number}.png" for number in range(1, branches + 1)] if branches > 1 else ["branch.png"]


class DiagramFolder(PartsFolder[Diagram]):
    """The output folder of a bifurcation diagram. Its parts are branches, numbered as the pictures are."""

    kind = FolderKind(
        "bifurcation diagram", "branch.json", ".branch.lock", "cvt_hpc bifurcation 1", ("branches",)
    )

    def is_picture(self, name: str, job: dict[str, Any]) -> bool:
        """Return whether a file of this name is a picture of as many branches as a diagram has."""
        branches = prod(len(values) for axis, values in dict(job["axes"]).items() if axis != "load")
        return bool((number := _PICTURE.fullmatch(name)) and int(number[1] or 1) <= branches)

    def load_branch(self, number: int) -> Followed | None:
        """Return branch `number`, counted from 0; None if it is not done, or cannot be read."""

        def restored(plain: Any, states: Arrays) -> Followed:
            onsets = [Onset(*one) for one in plain["onsets"]]
            runs = [Attractor(*run) for run in plain["runs"]]
            asked = self._asked.branches[number]
            return with_kinds(self._asked, asked, states, onsets, plain["hidden"], runs)

        return self.parts.load(f"branch_{number + 1}", restored)

    def save_branch(self, number: int, followed: Followed) -> None:
        """Keep branch `number`."""
        plain = {"onsets": followed.onsets, "hidden": followed.hidden, "runs": followed.runs}
        self.parts.save(f"branch_{number + 1}", plain, followed.states)


def make(diagram: Diagram, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Follow the branches that are not kept in the folder, and write dataset and pictures.

    See `experiment_kinds`. Each branch is kept, and in the dataset, once it is done.

    Raises
    ------
    InputError
        If the folder holds the diagram of another job or is in use, or the system refuses.
    """
    folder, branches = DiagramFolder(out, diagram), diagram.branches
    pictures = [out / name for name in _picture_names(len(branches))]
    with folder.claimed(diagram, fresh=fresh):
        loaded = ((number, folder.load_branch(number)) for number in range(len(branches)))
        followed = {number: one for number, one in loaded if one is not None}
        folder.parts.warn_of_others(folder.dataset)
        for number, one in followed.items():
            draw(partial(branch_figure, diagram, one), pictures[number])
        missing = [number for number in range(len(branches)) if number not in followed]
        if not missing:
            netcdf.store(diagram_dataset(diagram, followed, folder.parts.makers), folder.dataset)
        costs = [predicted_cost(diagram, branches[number]).total for number in missing]
        with closing(Steps(costs, len(followed), "branch", tell)) as steps:
            for number in missing:
                # matrices are small: threads of the linear algebra would wait for each other in loops
                with one_thread():
                    one = followed[number] = _follow(diagram, branches[number])
                folder.save_branch(number, one)
                netcdf.store(diagram_dataset(diagram, followed, folder.parts.makers), folder.dataset)
                draw(partial(branch_figure, diagram, one), pictures[number])
                steps.ended(f"branches: {len(one.onsets)} Hopf points")
    found = [one for _, one in sorted(followed.items())]
    failures = [line for one in found for line in failure_lines(diagram, one)]
    tell(*failures)
    lines = [line for one in found for line in (*branch_lines(diagram, one), "")]
    files = [("dataset", folder.dataset), *(("picture", picture) for picture in pictures)]
    return Outcome(lines, files, SOME_FAILED if failures else DONE)


def _follow(diagram: Diagram, asked: Asked) -> Followed:
    """Follow one branch."""
    p, grid, belt = asked.parameters, mesh(asked.parameters), SteadyBelt(asked.parameters)
    band = LOW, p["band_high"]  # from far below that of runs: a mode that enters a band seems to cross zero
    found = branch(belt, grid, diagram.loads, band)
    hopf, hidden = onsets(belt, grid, found, band)
    runs: list[Attractor] = []
    if diagram.disturbance:
        small, large = ({"disturbance": size} for size in diagram.disturbance)
        # the load that rises within tens of milliseconds is itself a large disturbance
        starts = (Start(small, partial(_steady_state, belt, found)), Start(large))
        places = [onset.load for onset in hopf if onset.frequency >= lowest_judged(asked, onset.load)]
        runs = attractors(asked.runs, "load", starts, diagram.loads, places, diagram.resolution)
    return with_kinds(diagram, asked, states_of(found, grid, diagram.loads), hopf, hidden, runs)


def _steady_state(belt: SteadyBelt, found: Branch, load: float) -> State | None:
    """Return the steady state under a load; none beside a gap, where a search takes long."""
    points = found.points
    if not points or _beside_gap(found, load):
        return None
    near = min(points, key=lambda point: abs(point.steady.load - load)).steady
    try:
        return (near if near.load == load else belt.at(load, near)).state
    except NoSteadyState:
        return None


def _beside_gap(found: Branch, load: float) -> bool:
    """Tell whether the next load of the branch, on either side, has no steady state."""
    loads = np.array(sorted([*found.missed, *(point.steady.load for point in found.points)]))
    at = np.searchsorted(loads, load)
    beside = loads[at : at + 1] if load in loads else loads[max(at - 1, 0) : at + 1]
    return any(float(one) in found.missed for one in beside)


class Direction(IntEnum):
    """Side of a Hopf point on which its mode grows."""

    GROWS_ABOVE = 0
    GROWS_BELOW = 1


def diagram_dataset(
    diagram: Diagram, followed: Mapping[int, Followed], makers: Sequence[Mapping[str, Any]] = ()
) -> xr.Dataset:
    """Return all branches that are followed in one dataset, by their place in `diagram.branches`.

    Over the axes and `load` the steady states; with `mode` the modes, each followed from one load to the
    next; along `onset` the Hopf points and along `run` the runs, with the number of their branch in the grid
    of the axes, counted in C order. `makers` is the origin of the results, as `global_attributes` takes it.
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
        name: (name, c.values.astype(object), netcdf.attributes(c.long_name, c.units, c.comment))
        for name, c in coordinates(diagram.job.parameters).items()
    }
    subject = f"bifurcations of model {diagram.job.model}"
    told = {
        **netcdf.global_attributes(diagram.job, diagram.resolved(), subject, makers=makers),
        netcdf.CONTENT: "bifurcation diagram",
    }
    rows = sorted(followed.items())
    variables = _states(diagram, rows) | _onsets(rows) | _runs(rows)
    return xr.Dataset(variables, axes | labels, told)


def _states(diagram: Diagram, followed: _Numbered) -> dict[str, Any]:
    """Return steady states with their stability, and modes, over axes and load."""
    axes = [(len(axis.values), axis.name) for axis in diagram.axes] + [(len(diagram.loads), "load")]
    grid, dims = zip(*axes, strict=True)
    states = [(number, one.states) for number, one in followed]

    def over(name: str, shape: tuple[int, ...], blank: Any) -> np.ndarray:
        array = np.full((len(diagram.branches), len(diagram.loads), *shape), blank)
        for number, values in states:
            if name in values:
                array[number][tuple(map(slice, values[name].shape))] = values[name]
        return array.reshape(*grid, *shape)

    flags = netcdf.attributes("stability", comment="of the steady state") | netcdf.flag_attributes(Stability)
    told: dict[str, Any] = {
        "stability": (dims, over("stability", (), np.int8(Stability.NOT_COMPUTED)), flags)
    }
    sizes = {name: c.values.size for name, c in coordinates(diagram.job.parameters).items()}
    for v in VARIABLES:
        array = over(v.name, tuple(sizes[dim] for dim in v.dims), np.nan)
        told[v.name] = (*dims, *v.dims), array, netcdf.attributes(v.long_name, v.units, v.comment)
    most = max((values["growth_rate"].shape[1] for _, values in states), default=0)
    for name, (_, *named) in OF_MODES.items():
        told[name] = (*dims, "mode"), over(name, (most,), np.nan), netcdf.attributes(*named)
    return told


def _onsets(followed: _Numbered) -> dict[str, Any]:
    """Return the Hopf points of all branches, one after the other."""
    rows = [
        (number, onset, kind)
        for number, one in followed
        for onset, kind in zip(one.onsets, one.kinds, strict=True)
    ]
    sides = [Direction.GROWS_ABOVE if o.rising else Direction.GROWS_BELOW for _, o, _ in rows]
    columns: dict[str, tuple[list[Any], Any, str, str, str]] = {
        "onset_branch": ([n for n, *_ in rows], np.int32, "1", "branch", _BRANCH),
        "onset_load": ([o.load for _, o, _ in rows], float, "N m", "onset load", "load at the Hopf point"),
        "onset_frequency": ([o.frequency for _, o, _ in rows], float, "Hz", "onset frequency",
                            "frequency of the mode whose growth rate is 0 at the Hopf point"),
        "onset_strand": ([o.strand + 1 for _, o, _ in rows], np.int8, "1", "vibrating strand", STRAND),
        "onset_half_waves": ([o.half_waves for _, o, _ in rows], np.int8, "1", "half waves",
                             "of the mode along its vibrating strand"),
        "onset_others": ([o.others for _, o, _ in rows], np.int8, "1", "other growing modes",
                         "number of them; 0: stability is lost or regained at this Hopf point"),
        "hysteresis_width": ([k.width for *_, k in rows], float, "N m", "hysteresis width",
                             "from the Hopf point to where vibration from the large start ends"),
        "hysteresis_error": ([k.error for *_, k in rows], float, "N m", "error of the hysteresis width",
                             "half the spacing of runs there, and the Hopf point's own error"),
        "onset_direction": (sides, Direction, "", "side of growth",
                            "whether the mode grows above or below the Hopf point"),
        "onset_kind": ([k.kind for *_, k in rows], Kind, "", "kind of Hopf point", ""),
        "onset_reason": ([k.reason for *_, k in rows], object, "", "reason", _OF_KIND),
    }  # fmt: skip
    return {name: ("onset", *_column(*column)) for name, column in columns.items()}


def _runs(followed: _Numbered) -> dict[str, Any]:
    """Return the runs of all branches, one after the other."""
    rows = [(number, run) for number, one in followed for run in one.runs]
    columns: dict[str, tuple[list[Any], Any, str, str, str]] = {
        "run_branch": ([n for n, _ in rows], np.int32, "1", "branch", _BRANCH),
        "run_load": ([run.value for _, run in rows], float, "N m", "load", LOAD),
        "run_start": ([run.start for _, run in rows], np.int8, "1", "start", _START),
        "run_amplitude": ([run.amplitude for _, run in rows], float, "m", "amplitude", "in the band"),
        "run_frequency": ([run.frequency for _, run in rows], float, "Hz", "fundamental frequency", ""),
        "run_occurrence": ([run.occurrence for _, run in rows], OccurrenceClass, "", "vibration occurrence",
                           ""),
        "run_reason": ([run.reason for _, run in rows], object, "", "reason", _REASON),
    }  # fmt: skip
    return {name: ("run", *_column(*column)) for name, column in columns.items()}


def _column(
    values: list[Any], kind: Any, units: str, long_name: str, comment: str
) -> tuple[np.ndarray, dict[str, Any]]:
    """Return values, and attributes, of a type of numpy or of flags."""
    is_flag = isinstance(kind, type) and issubclass(kind, IntEnum)
    flags = netcdf.flag_attributes(kind) if is_flag else {}
    return np.array(values, np.int8 if is_flag else kind), netcdf.attributes(
        long_name, units, comment
    ) | flags
