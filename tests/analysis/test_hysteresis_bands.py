"""Onset lines on maps, and bands between ramps up and down: where they are drawn."""

import numpy as np
import pytest
import xarray as xr

import cvt_hpc.accessor  # noqa: F401  # gives datasets their verbs
from cvt_hpc.analysis.arrangement import ruler
from cvt_hpc.analysis.hysteresis_bands import hysteresis_figure, onset_line, vibration_ranges, within
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.errors import InputError
from cvt_hpc.variables import Vibrates
from cvt_hpc.vibration.classes import OccurrenceClass
from support.studies import ramps, study

Q, V, U, *_ = OccurrenceClass


def test_the_onset_lies_between_quiet_and_vibrating_cells_and_passes_over_undecided_ones():
    x = ruler(xr.DataArray([10.0, 20.0, 30.0, 40.0], dims="load", name="load", attrs={"units": "N m"}))
    y = ruler(xr.DataArray([1.0, 2.0, 3.0], dims="y", name="y"))
    line = onset_line(x, y, np.array([[Q, V, Q, V], [Q, U, V, V], [V, V, Q, Q]], np.int8))
    np.testing.assert_array_equal(line[:, 0], [15.0, 15.0, 20.0, 20.0, np.nan, np.nan])
    np.testing.assert_array_equal(line[:, 1], [0.5, 1.5, 1.5, 2.5, 2.5, 3.5])


@pytest.mark.parametrize("side", ["x", "y"])
def test_a_map_has_the_onset_that_the_accessor_tells(side):
    results = study(stiffnesses=(1.0,))
    onset = results.cvt.onset().isel(sheave_stiffness=0)
    sides = {"x": None, "y": None} if side == "x" else {"x": "friction_gradient", "y": "load"}
    figure = results.cvt.map(**sides)
    axes = figure.axes[0]
    (line,) = [c for c in axes.collections if c.get_label() == "onset of vibration ± 10 N m"]
    (points,) = line.get_segments()
    along = points[::2, 0 if side == "x" else 1]
    np.testing.assert_allclose(along, onset.dropna("friction_gradient"))


def test_a_quiet_map_has_no_line_of_onset():
    results = study(stiffnesses=(1.0,))
    results["vibrates"][:] = Vibrates.NO
    (legend,) = map_figure(results).legends
    assert not any("onset" in text.get_text() for text in legend.get_texts())


def test_a_border_between_cells_is_known_to_half_their_distance():
    units = {"units": "rad/s", "job_units": "rpm"}
    speeds = xr.DataArray(np.array([1000.0, 1500.0, 2000.0]) * np.pi / 30.0, dims="x", attrs=units)
    assert within(speeds) == "± 250 rpm"
    assert within(xr.DataArray([1.0, 2.0, np.inf], dims="x", attrs={"units": "1"})) == "± 0.5"
    assert within(xr.DataArray([1.0, 2.0, 4.0], dims="x", attrs={"units": "N m"})) == "± half a step"


def test_ranges_of_vibration_are_those_of_each_ramp():
    ranges = vibration_ranges(ramps())
    assert (ranges.name, ranges.attrs["units"]) == ("load", "N m")
    up, down = (ranges.sel(ramp=name) for name in ("up", "down"))
    np.testing.assert_array_equal(up.sel(limit="lower"), [85.0, 100.0, np.nan])
    np.testing.assert_array_equal(up.sel(limit="upper"), [173.0, 150.0, np.nan])
    # it is there from the start: as far as the middle of the first of twenty parts
    np.testing.assert_array_equal(down.sel(limit="upper"), [166.0, 195.5, np.nan])
    np.testing.assert_array_equal(down.sel(limit="lower"), [71.0, 96.0, np.nan])


def test_bands_lie_between_the_ramps():
    figure = hysteresis_figure(ramps())
    (axes,) = figure.axes
    (bands,) = [c for c in axes.collections if c.get_hatch()]
    spans = [tuple(path.vertices[:2, 0]) for path in bands.get_paths()]
    assert spans == [(85.0, 71.0), (100.0, 96.0), (173.0, 166.0), (150.0, 195.5)]
    bars = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in axes.patches]
    assert bars == [(85.0, 166.0), (100.0, 150.0)]
    assert axes.get_xlabel() == "load [N m]" and axes.get_ylabel() == "friction gradient [s/m]"
    figure.canvas.draw()  # two $ in the name of the job begin no formula
    assert "up $and$ down" in figure.get_suptitle()


def test_ramps_of_speed_are_in_rpm():
    of_load = ("onset_load", "end_load", "ramp_load")
    results = ramps().rename({name: name.replace("_load", "_speed") for name in of_load})
    (axes,) = hysteresis_figure(results).axes
    assert axes.get_xlabel() == "speed [rpm]"
    (bands,) = [c for c in axes.collections if c.get_hatch()]
    assert bands.get_paths()[0].vertices[0, 0] == pytest.approx(85.0 * 30.0 / np.pi)


@pytest.mark.parametrize(
    ("results", "found"),
    [(ramps().isel(load_start=[0]), "ramps in one direction"), (study(), "no onset along a ramp")],
)
def test_results_without_ramps_in_both_directions_are_refused(results, found):
    with pytest.raises(InputError, match=f"x.nc: expected results of ramps .*, found {found}"):
        hysteresis_figure(results, source="x.nc")
