"""`dataset.cvt` on made-up studies: classes, onsets, boundaries, and pictures laid out as asked."""

import inspect
import re
import runpy
import sys
import zipfile
from pathlib import Path

import dask
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import cvt_hpc
from cvt_hpc.accessor import Results
from cvt_hpc.analysis.classes import OccurrenceClass
from cvt_hpc.analysis.figures import LONG
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.picture_kinds import END, HISTORIES, KINDS, RESULTS
from cvt_hpc.variables import Status, Vibrates
from support.studies import GRADIENTS, LOADS, STIFFNESSES, study, traced

pytestmark = pytest.mark.usefixtures("unarranged")  # test_pictures.py looks at the places

NO, YES, SLIPS = Vibrates.NO, Vibrates.YES, Vibrates.SLIPS


def results(rows, loads=(20.0, 40.0, 60.0, 80.0, 100.0)):
    """A study of one row of verdicts for each gradient."""
    vibrates = np.array(rows, np.int8)
    axes = {
        "friction_gradient": ("friction_gradient", np.arange(len(rows)) * -0.2, {"units": "s m-1"}),
        "load": ("load", np.array(loads), {"units": "N m"}),
    }
    dims = ("friction_gradient", "load")
    return xr.Dataset(
        {"status": (dims, np.full(vibrates.shape, Status.DONE)), "vibrates": (dims, vibrates)}, axes
    )


def test_opening_results_gives_datasets_their_methods():
    assert cvt_hpc.open_results and hasattr(xr.Dataset, "cvt")


def test_boundaries_lie_midway_and_onset_is_where_a_window_begins():
    rows = [
        [NO, NO, YES, YES, NO],
        [YES, YES, NO, NO, YES],  # from the first load on: that window has no onset
        [NO, NO, NO, NO, NO],
        [NO, SLIPS, YES, NO, YES],  # what is neither quiet nor vibrating is passed over
    ]
    found = results(rows).cvt.boundary()
    assert found.dims == ("friction_gradient", "boundary") and found.attrs["units"] == "N m"
    nan = np.nan
    expected = [[50, 90, nan, nan], [50, 90, nan, nan], [nan] * 4, [40, 70, 90, nan]]
    np.testing.assert_array_equal(found, expected)
    expected = [[1, 0, nan, nan], [0, 1, nan, nan], [nan] * 4, [1, 0, 1, nan]]
    np.testing.assert_array_equal(found.rising, expected)
    onset = results(rows).cvt.onset()
    np.testing.assert_array_equal(onset, [50, 90, nan, 40])
    assert onset.attrs == {"units": "N m", "long_name": "onset of vibration in load"}
    # the order of an axis changes nothing
    turned = results([row[::-1] for row in rows], (100.0, 80.0, 60.0, 40.0, 20.0))
    np.testing.assert_array_equal(turned.cvt.onset(), onset)
    along = results(rows).cvt.boundary("friction_gradient").sel(load=20.0)
    np.testing.assert_allclose(along.dropna("boundary"), [-0.3, -0.1])


def too_early(*tasks, **options):
    raise AssertionError("computed before it was asked for")


def test_verbs_take_chunked_datasets_and_read_what_they_need_alone():
    whole = study(gradients=GRADIENTS, stiffnesses=STIFFNESSES, loads=LOADS)

    def untouched(block):
        raise AssertionError("spectra are read for a verdict")

    spectra = xr.zeros_like(whole["amplitude"]).chunk()
    lazy = whole.chunk({"load": 2}).assign(spectrum=spectra.map_blocks(untouched, template=spectra))
    for verb in ("classes", "onset", "boundary", "strongest"):
        with dask.config.set(scheduler=too_early):
            asked = getattr(lazy.cvt, verb)()
        assert asked.chunks
        xr.testing.assert_identical(asked.compute(), getattr(whole.cvt, verb)())
    inferred = traced()
    with dask.config.set(scheduler=too_early):
        asked = inferred.chunk({"sheave_stiffness": 1}).cvt.classes()
    xr.testing.assert_identical(asked.compute(), inferred.cvt.classes())
    assert [image.get_array().tolist() for axes in lazy.cvt.map().axes for image in axes.images] == [
        image.get_array().tolist() for axes in whole.cvt.map().axes for image in axes.images
    ]


def test_a_failed_run_is_no_boundary():
    study = results([[NO, NO, YES, YES, YES]])
    study["status"][0, 1] = Status.FAILED_NUMERICS
    assert study.cvt.onset() == 40.0  # midway between the quiet 20 and the vibrating 60 N m


def test_the_strongest_strand_where_the_run_vibrates():
    dataset = study()
    strongest = dataset.cvt.strongest()
    vibrating = dataset.cvt.classes() == OccurrenceClass.VIBRATING
    assert np.isfinite(strongest).values.tolist() == vibrating.values.tolist()
    inside = dataset.amplitude.max("strand").where(vibrating)
    np.testing.assert_array_equal(strongest.transpose(*inside.dims), inside)


def test_a_map_is_laid_out_as_asked():
    figure = study().cvt.map(x="sheave_stiffness", y="load", panel="friction_gradient")
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert len(panels) == 2 * len(GRADIENTS)  # amplitude and frequency
    assert figure.get_figheight() <= LONG
    assert panels[-1].get_xlim()[1] > STIFFNESSES[0] and panels[0].get_ylim()[1] > LOADS[-1]
    figure = study().cvt.map(x="sheave_stiffness", vmax=5e-6, load=LOADS[3])
    bar = next(axes for axes in figure.axes if axes.get_label() == "<colorbar>")
    assert bar.get_ylim()[1] == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda ds: ds.cvt.map(x="lod"), "x lod: unknown axis of the results; did you mean load?"),
        (lambda ds: ds.cvt.map(x="load", y="load"), "expected an axis on one side"),
        (lambda ds: ds.cvt.map(x="load", load=LOADS[0]), "expected an axis that is not fixed"),
        (lambda ds: ds.cvt.onset("strand"), "expected one of the axes"),
        (lambda ds: ds.cvt.strongest("amplitud"), "did you mean amplitude?"),
        (lambda ds: xr.Dataset().cvt.onset(), "expected results of a study"),
    ],
)
def test_what_there_is_not_is_named(call, told):
    with pytest.raises(InputError, match=told.replace("?", r"\?")):
        call(study())


def test_a_table_is_read_as_the_dataset_that_it_was_made_of(tmp_path):
    rows = runpy.run_path(str(Path(__file__).parents[2] / "jobs" / "tabulate.py"))["rows"]
    made = study()
    made["core_seconds"] = made["status"].astype(float)
    made.coords["thrust"] = "load", 10.0 * made["load"].values  # linked, as is a coordinate of fewer values
    made.coords["tilt_factor"] = "load", np.where(made["load"] < made["load"][-1], 1.0, np.inf)
    path = tmp_path / "table.csv"
    path.write_text("\n".join(rows(made, ("amplitude", "frequency"))))
    found = cvt_hpc.read_table(path)
    assert found["load"].attrs["units"] == "N m" and found.amplitude.attrs["units"] == "m"
    for name in ("thrust", "tilt_factor"):
        np.testing.assert_array_equal(found[name], made[name])
        assert found[name].dims == ("load",)
    np.testing.assert_array_equal(found.status, made.status)
    done = made.status == Status.DONE
    np.testing.assert_array_equal(found.vibrates.where(done), made.vibrates.where(done))
    np.testing.assert_allclose(found.amplitude, made.amplitude.where(done), atol=0.51e-8)  # two digits in um
    np.testing.assert_allclose(found.frequency, made.frequency.where(done), atol=0.051)  # one digit in Hz
    np.testing.assert_array_equal(found.cvt.onset(), made.cvt.onset())


@pytest.mark.parametrize(
    "text",
    [
        "",
        "load,amplitude\n1,2\n",
        "load,status,vibrates\n1,done\n",
        "load,status,vibrates\n1,done,no\n1,done,no\n",
    ],
)
def test_what_is_no_table_of_a_study_is_refused(text, tmp_path):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(InputError, match="x.csv: expected a "):
        cvt_hpc.read_table(tmp_path / "x.csv")


@pytest.mark.parametrize(
    ("results", "name"), [(study(), "status"), (study().drop_vars("amplitude"), "frequency")]
)
def test_the_strongest_strand_is_that_of_variables_over_strands(results, name):
    with pytest.raises(InputError, match=f"results: {name}: expected a variable with the dimensions of amp"):
        results.cvt.strongest(name)


@pytest.mark.parametrize("ask", ["map", "onset", "strongest", "classes"])
def test_a_part_without_runs_is_refused(ask):
    with pytest.raises(InputError, match="expected results of a study of one run at least, found none"):
        getattr(study().isel(load=slice(0)).cvt, ask)()


def test_other_units_are_those_of_values_attributes_and_axes_of_pictures():
    whole = study()
    units = {"load": "N cm", "amplitude": "um"}
    with dask.config.set(scheduler=too_early):
        converted = whole.chunk({"load": 2}).cvt.in_units(**units)
    np.testing.assert_allclose(converted["load"], 100.0 * whole["load"])
    np.testing.assert_allclose(converted.amplitude, 1e6 * whole.amplitude)
    assert {name: converted[name].attrs["units"] for name in units} == units
    assert converted.indexes["load"].equals(converted["load"].to_index())
    assert whole["load"].attrs["units"] == "N m" and "units" in converted.frequency.attrs
    at = {"friction_gradient": GRADIENTS[0], "sheave_stiffness": 1.0}
    one, other = (each.cvt.curve("frequency", **at).axes[0] for each in (whole, converted))
    assert (one.get_xlabel(), other.get_xlabel()) == ("load [N m]", "load [N cm]")
    one, other = (each.cvt.map(sheave_stiffness=1.0) for each in (whole, converted))
    assert scales(other) == pytest.approx(scales(one))  # amplitudes in um are not taken for metres
    np.testing.assert_allclose(converted.cvt.onset(), 100.0 * whole.cvt.onset())
    back = converted.cvt.in_units(load="N m")
    np.testing.assert_allclose(back["load"], whole["load"])


@pytest.mark.parametrize(
    ("units", "told"),
    [
        ({"lod": "N m"}, "did you mean load?"),
        ({"load": "kN"}, "load: expected a unit of the dimension of N m"),
        ({"status": "kN"}, "status: expected a variable with a unit, found a flag or a text"),
        (
            {"frequency": "rad/s"},
            "expected a unit of the dimension of Hz",
        ),  # 2 pi apart, and not to be mixed up
    ],
)
def test_units_of_another_dimension_are_refused(units, told):
    with pytest.raises(InputError, match=told.replace("?", r"\?")):
        study().cvt.in_units(**units)


def test_quantities_of_pint_are_those_of_the_dataset():
    """The snippet of the guide."""
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "python.md").read_text()
    snippet = guide.split("cf_xarray.units")[1].split("```")[0]
    results = study().assign(loss=("load", np.full(len(LOADS), 2500.0), {"units": "W"})).chunk()
    names = {"results": results}
    exec("import cf_xarray.units" + snippet, names)
    assert names["loss"].pint.units == "kilowatt"
    np.testing.assert_allclose(names["loss"].pint.magnitude, 2.5)


def scales(figure):
    return [axes.get_ylim()[1] for axes in figure.axes if axes.get_label() == "<colorbar>"]


def test_several_studies_are_drawn_on_one_scale():
    small = study(gradients=GRADIENTS[:2], stiffnesses=STIFFNESSES[:1])
    larger = [
        (k * small).assign(small[["status", "vibrates"]]).assign_attrs(job_name=f"{k} times") for k in (2, 3)
    ]
    figure, same = small.cvt.map(beside=larger), cvt_hpc.maps_figure([small, *larger])
    assert scales(figure) == scales(same)
    assert scales(figure)[0] == pytest.approx(scales(larger[-1].cvt.map())[0])
    titles = " ".join(axes.get_title(loc="left") for axes in figure.axes)
    assert all(name in titles for name in ("occurrence", "2 times", "3 times"))  # a panel for each
    shown = cvt_hpc.maps_figure([small, *larger], ["frequency"])
    assert len(shown.axes) > len(small.cvt.map("frequency").axes)


def test_each_kind_of_picture_is_a_verb_with_its_options():
    for name, kind in KINDS.items():
        verb = getattr(Results, name)
        taken = set(inspect.signature(verb).parameters)
        assert {option.key for option in kind.options} | {*kind.sides} <= taken
        assert ("at" in taken, "beside" in taken) == (kind.subject == RESULTS, kind.subject == HISTORIES)
        assert kind.text in verb.__doc__ and all(
            o.key == END or o.text[1:] in verb.__doc__ for o in kind.options
        )
        assert "%%" not in verb.__doc__ and "'20 um'" not in verb.__doc__  # words of the command line
    with pytest.raises(TypeError, match="unexpected keyword argument 'loads'"):
        study().cvt.phase(loads=3.0)


def test_a_notebook_is_given_a_picture():
    assert study().cvt.map(sheave_stiffness=1.0)._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "kind", [*(name for name, kind in KINDS.items() if kind.subject != RESULTS), "animation"]
)
def test_pictures_of_single_runs_refuse_a_study(kind):
    results = xr.Dataset({"status": ("load", np.zeros(2, "i1"))}, {"load": [20.0, 40.0]})
    with pytest.raises(InputError, match=f"expected the history of a run, which {kind} draws, found a study"):
        getattr(results.cvt, kind)()


def test_a_curve_of_nothing_is_refused():
    with pytest.raises(InputError, match="curve: expected variable of the results; .*, found nothing"):
        study().cvt.curve()


def in_rpm(whole):
    """A study with an axis of speeds whose job gives them in rpm, and with what a table leaves out or names."""
    speeds = np.array([1000.0, 3000.0]) * np.pi / 30.0
    shown = {"units": "rad/s", "job_units": "rpm"}
    whole = whole.expand_dims(driving_speed=speeds).copy()
    whole["driving_speed"].attrs |= shown
    shape = whole["status"].shape
    reasons = np.full(shape, b"", "S240")
    reasons[0, 0, 0, 0] = b"=1+1"
    whole["reason"] = whole["status"].dims, reasons
    whole["spectrum"] = (*whole["amplitude"].dims, "frequency_bin"), np.zeros((*shape, 2, 3))
    twice = (whole["load"] * 2.0).assign_attrs(units="N m", job_units="kN mm")
    return whole.assign_coords(frequency_bin=[0.0, 10.0, 20.0], driven_load=twice)


@pytest.mark.parametrize("chunks", [None, {"load": 2}])
def test_a_table_has_a_row_for_each_run_with_units_words_and_a_column_for_each_strand(chunks):
    whole = in_rpm(study())
    table = (whole if chunks is None else whole.chunk(chunks)).cvt.table()
    assert list(table.columns) == [
        "driving_speed [rpm]",
        "friction_gradient [s/m]",
        "sheave_stiffness",
        "load [N m]",
        "driven_load [kN mm]",
        "status",
        "class",
        "vibrates",
        "amplitude_t1 [m]",
        "amplitude_t2 [m]",
        "frequency_t1 [Hz]",
        "frequency_t2 [Hz]",
        "reason",
    ]
    assert len(table) == whole["status"].size
    assert set(table["driving_speed [rpm]"]) == {1000.0, 3000.0}
    np.testing.assert_allclose(table["driven_load [kN mm]"], 2.0 * table["load [N m]"])
    classes = whole.cvt.classes().values.ravel()
    assert [OccurrenceClass[name.upper()] for name in table["class"]] == list(classes)
    assert table["reason"][0] == "=1+1" and set(table["status"][classes == OccurrenceClass.FAILED]) == {
        "failed_numerics",
        "failed_error",
        "timed_out",
    }
    for k, strand in enumerate(("t1", "t2")):
        column = table[f"amplitude_{strand} [m]"]
        np.testing.assert_array_equal(column, whole["amplitude"].values[..., k].ravel())
    of_one = whole.isel(load=2).cvt.in_units(amplitude="um").cvt.table()
    np.testing.assert_allclose(of_one["amplitude_t1 [um]"], 1e6 * table["amplitude_t1 [m]"][2::10])


def test_a_table_of_many_runs_leaves_spectra_unread():
    whole = study(loads=tuple(np.linspace(20.0, 200.0, 9000)))

    def untouched(block):
        raise AssertionError("spectra are read for a table")

    spectra = xr.zeros_like(whole["amplitude"]).expand_dims(frequency_bin=[0.0, 1.0], axis=-1).chunk()
    lazy = whole.chunk({"load": 500}).assign(spectrum=spectra.map_blocks(untouched, template=spectra))
    assert len(lazy.cvt.table()) == whole["status"].size > 1e5


def test_a_table_is_written_for_programs_and_for_spreadsheets(tmp_path, capsys, monkeypatch):
    whole = in_rpm(study())
    whole.to_netcdf(tmp_path / "results.nc")
    assert main(["table", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"table: {tmp_path}/table.csv\n"
    read, table = pd.read_csv(tmp_path / "table.csv"), whole.cvt.table()
    assert list(read.columns) == list(table.columns) and len(read) == len(table)
    np.testing.assert_array_equal(read["amplitude_t2 [m]"], table["amplitude_t2 [m]"])
    assert main(["table", str(tmp_path), "--out", str(tmp_path / "x.xlsx")]) == 0
    sheet = zipfile.ZipFile(tmp_path / "x.xlsx").read("xl/worksheets/sheet1.xml").decode()
    rows = re.findall("<row .*?</row>", sheet)
    assert len(rows) == len(table) + 1
    assert re.findall("<t>([^<]*)</t>", rows[0]) == list(table.columns)
    assert "<t>=1+1</t>" in rows[1] and "<f>" not in sheet  # a text, and no formula
    assert main(["table", str(tmp_path), "--out", str(tmp_path / "x.txt")]) == 2
    monkeypatch.setitem(sys.modules, "xlsxwriter", None)
    assert main(["table", str(tmp_path), "--out", str(tmp_path / "y.xlsx")]) == 2
    assert 'found none; `pip install "cvt_hpc[xlsx]"`, or write a .csv' in capsys.readouterr().err
    assert not (tmp_path / "y.xlsx").exists()
