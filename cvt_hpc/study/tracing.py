"""The cells of a grid that a trace has to run, and the classes that follow for the cells between them.

The grid is cut into boxes that share their sides, at first as wide as the first spacing. The corners of all
boxes are run. A box in which, sides included, runs of different classes are known is cut in halves along
each axis, the corners of these are run as well, and so on down to neighbouring cells. Thus a boundary that
shows in one box is followed into the next, wherever it leads. In the end every box that is wider than that
is of one class, as far as runs know it, and this class is inferred for its inner cells. Along axes that are
not traced nothing is inferred: each of their values has boxes of its own.

A further run can only cut more boxes. Hence a trace runs in the end the least set of cells that
requires no other one: it does not depend on the order of the runs, on rounds, ranks or interruptions.

A trace can miss cells: of cells of one class that are connected, as neighbours along traced axes, all are
found if one of them is run. So only patches without a corner of the first boxes are missed, hence none that
contains as many cells as the first spacing along each traced axis, side by side.
"""

from collections.abc import Iterator
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.study.description import Study
from cvt_hpc.study.record.index import Records
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs

UNKNOWN = OccurrenceClass.NOT_RUN

Interval = tuple[int, int]  # first and last place on an axis
Box = tuple[Interval, ...]


def needed_runs(study: Study, records: Records) -> NDArray[np.bool_]:
    """Return the runs that a study needs by the records, shape (runs,): of a grid or of samples all.

    Parameters
    ----------
    study : Study
        With its design.
    records : Records
        The runs on record; these runs count as needed. Those needed now are among those needed later on.
    """
    if not study.is_traced:
        return np.ones(study.size, bool)
    classes = run_classes(study, records)
    needed = np.zeros(study.shape, bool)
    for box in leaf_boxes(classes, first_intervals(study)):
        needed[np.ix_(*box)] = True
    return needed.ravel() | records.recorded


def inferred_classes(study: Study, records: Records) -> NDArray[np.int8]:
    """Return the class of each cell, shape of the grid: its own, or that of the runs around it.

    NOT_RUN where these do not agree, or are not all known yet.
    """
    classes = run_classes(study, records)
    inferred = classes.copy()
    for box in leaf_boxes(classes, first_intervals(study)):
        corners = classes[np.ix_(*box)]
        if (corners == corners.flat[0]).all():
            inside = inferred[_cells(box)]
            inside[inside == UNKNOWN] = corners.flat[0]
    return inferred


def run_classes(study: Study, records: Records) -> NDArray[np.int8]:
    """Return the class of each run, shape of the grid; NOT_RUN where there is no record."""
    vibrates = records.read(np.arange(study.size), "vibrates")
    return classify_runs(records.status, vibrates).reshape(study.shape)


def first_intervals(study: Study) -> list[list[Interval]]:
    """Return for each axis the intervals that the first boxes are made of."""
    spacings = study.design["first_spacing"]
    return [_intervals(len(axis.values), spacings.get(axis.name)) for axis in study.axes]


def leaf_boxes(classes: NDArray[np.int8], intervals: list[list[Interval]]) -> Iterator[Box]:
    """Yield the boxes that are not cut: neighbours, and those within which all known runs are of one class.

    Parameters
    ----------
    classes : array of int8, shape of the grid
        `OccurrenceClass` of each run; NOT_RUN where it is not known.
    intervals : list of list of (int, int)
        For each axis, the places of which the first boxes are made.
    """
    for box in product(*intervals):
        cells = classes[_cells(box)]
        known = cells[cells != UNKNOWN]
        if max((last - first for first, last in box), default=0) <= 1 or (known == known[:1]).all():
            yield box
        else:
            yield from leaf_boxes(classes, [_halves(*interval) for interval in box])


def _cells(box: Box) -> tuple[slice, ...]:
    return tuple(slice(first, last + 1) for first, last in box)


def _intervals(length: int, spacing: int | None) -> list[Interval]:
    """Cut an axis into intervals that share their ends; without a spacing into single places."""
    if spacing is None or length == 1:
        return [(place, place) for place in range(length)]
    return list(pairwise([*range(0, length - 1, spacing), length - 1]))


def _halves(first: int, last: int) -> list[Interval]:
    middle = (first + last) // 2
    return [(first, middle), (middle, last)] if last - first > 1 else [(first, last)]
