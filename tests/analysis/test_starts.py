"""Maps of studies with a small and a large start: classes cell by cell, and what the picture says."""

from itertools import product

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.cells import OF_STARTS, STYLES
from cvt_hpc.analysis.classes import OccurrenceClass, map_classes, occurrence_classes
from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.maps import has_starts, join_starts, map_figure, start_line
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.classes import StartClass, classify_starts
from support.studies import fills_of, study, traced

Q, V, U, F, N, S, IRR = OccurrenceClass
ONLY = StartClass.LARGE_START_ONLY
TABLE = {  # by the class from the small start, then from the large one
    Q: {Q: Q, V: ONLY, U: U, F: F, N: N, S: S, IRR: IRR},
    V: {Q: V, V: V, U: V, F: F, N: V, S: V, IRR: V},
    U: {Q: U, V: U, U: U, F: F, N: N, S: U, IRR: U},
    F: {Q: F, V: F, U: F, F: F, N: F, S: F, IRR: F},
    N: {Q: N, V: N, U: N, F: F, N: N, S: N, IRR: N},
    S: {Q: S, V: S, U: S, F: F, N: S, S: S, IRR: S},
    IRR: {Q: IRR, V: IRR, U: IRR, F: F, N: N, S: IRR, IRR: IRR},
}


def two_starts(make=study):
    """The study from 0.3 mm, and from 1 um, where what is at most 12 um high stays quiet; the larger start first."""
    large = make(stiffnesses=(1.0, np.inf))
    small = large.copy(deep=True)
    weak = (small["amplitude"].max("strand") < 12e-6) & (small["status"] == Status.DONE)
    small["vibrates"] = small["vibrates"].where(~weak, Vibrates.NO).astype(np.int8)
    axis = xr.DataArray([3e-4, 1e-6], dims="disturbance", name="disturbance", attrs={"units": "m"})
    return xr.concat([large, small], axis, combine_attrs="override"), large, small


def figure_of(dataset):
    return map_figure(dataset, {}, "out/x")


def test_class_of_every_pair_of_runs():
    pairs = list(product(OccurrenceClass, OccurrenceClass))
    found = classify_starts(*np.array(pairs).T)
    assert [StartClass(kind) for kind in found] == [TABLE[small][large] for small, large in pairs]


def test_the_class_of_two_starts_has_the_values_of_the_class_of_runs():
    assert [StartClass[kind.name] for kind in OccurrenceClass] == list(OccurrenceClass)
    assert [StartClass[kind.name].label for kind in OccurrenceClass] == [
        kind.label for kind in OccurrenceClass
    ]


def test_cells_are_joined_by_size_of_the_start_in_whatever_order():
    dataset, large, small = two_starts()
    joined = join_starts(dataset)
    assert joined["status"].dims == small["status"].dims
    expected = classify_starts(occurrence_classes(small).values, occurrence_classes(large).values)
    assert np.array_equal(occurrence_classes(joined), expected)
    only = int((expected == ONLY).sum())
    assert only > 5
    assert start_line(dataset, {}, "x").startswith(f"{only} of {expected.size} cells: ")
    assert joined.attrs["starts"] == "0.001 mm and 0.3 mm"


def test_of_several_starts_the_smallest_and_the_largest_count():
    dataset, large, small = two_starts()
    between = large.copy(deep=True)
    between["vibrates"][:] = Vibrates.UNDECIDED
    axis = xr.DataArray([1e-5, 3e-4, 1e-6], dims="disturbance", name="disturbance", attrs={"units": "m"})
    three = xr.concat([between, large, small], axis, combine_attrs="override")
    joined = join_starts(three)
    assert np.array_equal(joined["occurrence_class"], join_starts(dataset)["occurrence_class"])
    assert joined.attrs["starts"] == "0.001 mm and 0.3 mm"


def test_cells_are_counted_that_the_map_shows():
    dataset, *_ = two_starts()
    at = {"sheave_stiffness": 1.0}
    shown = dataset.sel(at)
    only = int((join_starts(shown)["occurrence_class"] == ONLY).sum())
    cells = shown["status"][0].size
    assert only > 0 and cells == dataset["status"][0].size / 2
    assert start_line(dataset, at, "x").startswith(f"{only} of {cells} cells: ")


def test_the_map_has_one_panel_for_both_starts_and_counts_cells():
    joined = join_starts(two_starts()[0])
    figure = figure_of(joined)
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    assert [axes.get_title(loc="left") for axes in panels] == [
        "sheave stiffness: 1",
        "sheave stiffness: rigid",
    ]
    title = figure.get_suptitle().replace("\n", " ")
    only = int((joined["occurrence_class"] == ONLY).sum())
    assert "60 cells: " in title and f"{only} vibrates from a large start only" in title
    assert "disturbance 0.001 mm and 0.3 mm" in title
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][-3:] == [
        "vibrates from a large start only",
        "onset from a small start ± 10 N m",
        "onset from a large start ± 10 N m",
    ]
    assert sum(fills_of(axes)[OF_STARTS[ONLY].fill] for axes in panels) == only


def test_a_map_of_one_start_is_as_without_the_axis(tmp_path):
    dataset, large, _ = two_starts()
    draw(lambda: map_figure(large.assign_attrs(job_name="x")), tmp_path / "alone.png")
    one = dataset.assign_attrs(job_name="x").isel(disturbance=0, drop=True)
    draw(lambda: map_figure(one), tmp_path / "one.png")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "alone.png").read_bytes()
    assert not has_starts(dataset, {"disturbance": 3e-4}) and has_starts(dataset, {})
    assert not has_starts(dataset.isel(disturbance=[0]), {})
    assert not has_starts(dataset, {"load": 1.0, "friction_gradient": 1.0, "sheave_stiffness": 1.0})


def test_the_look_of_the_class_is_its_own():
    style = OF_STARTS[ONLY]
    others = [other for other in STYLES.values()]
    assert style.hatch not in {other.hatch for other in others} | {""}
    assert style.fill not in {other.fill for other in others}
    assert style.mark not in {other.mark for other in others}


def test_of_a_trace_inferred_cells_are_joined_as_well():
    dataset, large, small = two_starts(traced)
    joined = join_starts(dataset)
    expected = classify_starts(map_classes(small).values, map_classes(large).values)
    assert np.array_equal(map_classes(joined), expected)
    not_run = large["status"].values == Status.NOT_RUN
    assert (occurrence_classes(joined).values[not_run] == N).all() and (expected[not_run] != N).any()


@pytest.mark.parametrize("at", [{}, {"friction_gradient": -2.4}])
def test_the_picture_is_written(at, tmp_path):
    assert draw(lambda: map_figure(two_starts()[0], at), tmp_path / "map.png").stat().st_size > 10_000
