"""Several studies in one picture: joined over their axes, on one scale of colours."""

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.arrangement import Sides
from cvt_hpc.analysis.studies import join_studies
from cvt_hpc.analysis.value_maps import value_map_figure
from cvt_hpc.errors import InputError
from cvt_hpc.variables import Status


def study(name, ratios, loads, size=1.0):
    """A study that is done, whose loss [W] is 100 times ratio times load."""
    over, shape = ("ratio", "load"), (len(ratios), len(loads))
    variables = {
        "status": (over, np.full(shape, Status.DONE, np.int8)),
        "vibrates": (over, np.zeros(shape, np.int8)),
        "amplitude": ((*over, "strand"), np.zeros((*shape, 2)), {"units": "m"}),
        "loss": (over, 100.0 * size * np.outer(ratios, loads), {"units": "W"}),
    }
    axes = {"ratio": ratios, "load": ("load", loads, {"units": "N m"}), "strand": ["t1", "t2"]}
    return xr.Dataset(variables, axes, {"job_name": name})


def test_runs_stand_at_their_places_and_what_a_study_lacks_was_not_run():
    first = study("one", [1.0, 2.0], [10.0, 20.0])
    other = study("two", [2.0, 3.0], [20.0 * (1 + 1e-12), 30.0], size=2.0)
    joined = join_studies([first, other], ["a", "b"], ["loss"])
    assert joined.sizes["ratio"] == joined.sizes["load"] == 3
    assert list(joined["study"].values) == ["one", "two"]
    assert joined["load"].attrs["units"] == "N m"
    for k, dataset in enumerate((first, other)):
        at = dataset["loss"].assign_coords(load=dataset["load"].values.round(9))
        known = joined["loss"].isel(study=k).sel(ratio=at["ratio"], load=at["load"])
        np.testing.assert_array_equal(known, at)
        run = joined["status"].isel(study=k) != Status.NOT_RUN
        assert int(run.sum()) == 4 and np.isfinite(joined["loss"].isel(study=k).values[run.values]).all()


def test_a_panel_for_each_study_has_one_scale_of_colours():
    datasets = [study("one", [1.0, 2.0], [10.0, 20.0]), study("two", [1.0, 2.0], [10.0, 20.0], size=5.0)]
    joined = join_studies(datasets, ["a", "b"], ["loss"])
    figure = value_map_figure(joined, ["loss"], sides=Sides("load", "ratio", "study"))
    bars = [axes.get_ylim() for axes in figure.axes if axes.get_label() == "<colorbar>"]
    assert bars[0] == bars[1]
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert titles == ["loss [W], study one", "loss [W], study two"]


def test_studies_of_one_name_are_named_by_their_places():
    joined = join_studies([study("one", [1.0], [10.0, 20.0])] * 2, ["a/results.nc", "b/results.nc"])
    assert list(joined["study"].values) == ["a/results.nc", "b/results.nc"]


def test_other_axes_are_refused():
    other = study("two", [1.0, 2.0], [10.0, 20.0]).isel(ratio=0)
    with pytest.raises(InputError, match="^b: expected the axes of a: ratio, load, found load$"):
        join_studies([study("one", [1.0, 2.0], [10.0, 20.0]), other], ["a", "b"])
