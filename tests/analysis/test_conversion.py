"""Datasets in other units, quantified, lazy or changed by xarray are drawn and reported as those of this program."""

import json
import re

import dask
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import cvt_hpc.accessor  # noqa: F401  datasets have `cvt`
from cvt_hpc.analysis.classes import OccurrenceClass, count_classes
from cvt_hpc.analysis.conversion import UNITS, plain, standard
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.picture_kinds import KINDS, RESULTS
from cvt_hpc.simulation.record import COMMON
from cvt_hpc.storage.netcdf import write_netcdf
from support.foreign import REGISTRY, WAYS, drawn, in_other_units, numbers, other_unit
from support.stored import NAMES, content, stored


def parameters(model):
    """Units of the parameters of a model, which axes are."""
    tables = load_model(model).parameters.values()
    return {key: one.unit or "1" for table in tables for key, one in table.items()}


def recorded(model):
    """Units of the numbers in its records."""
    loaded = load_model(model)
    variables = (*COMMON, *loaded.variables) if loaded.is_recorded else ()
    return {one.name: one.units for one in variables if one.units}


@pytest.mark.parametrize("model", MODELS)
def test_every_variable_of_every_model_is_read_in_any_unit(model):
    for are_coordinates, units in enumerate((recorded(model), parameters(model))):
        assert {*units.values()} <= {*UNITS}
        for first in range(0, len(WAYS), 3):
            given = {
                name: ("x", [2.0 * factor], {"units": text})
                for way, (name, unit) in enumerate(units.items(), first)
                for _, text, factor in [other_unit(unit, way)]
            }
            found = standard(xr.Dataset(coords=given) if are_coordinates else xr.Dataset(given))
            for name, unit in units.items():
                assert REGISTRY.Unit(found[name].attrs["units"]) == REGISTRY.Unit(unit), (name, given[name])
                np.testing.assert_allclose(found[name], 2.0, rtol=1e-12, err_msg=str(given[name]))


@pytest.mark.parametrize("name", NAMES)
def test_stored_datasets_are_the_same_in_any_unit(name):
    dataset = stored(name)
    found = standard(in_other_units(dataset, quantified=NAMES.index(name) % 2 == 1))
    xr.testing.assert_allclose(found, standard(dataset), rtol=1e-12)
    for key, unit in numbers(dataset):
        assert unit in UNITS
        assert REGISTRY.Unit(found[key].attrs["units"]) == REGISTRY.Unit(unit)


def with_derived_axes(dataset):
    """A study with values that follow from its first, its last and all axes; strands have no recorded modes."""
    if "status" not in dataset or not dataset["status"].dims:
        return dataset
    dims = dataset["status"].dims
    derived = {
        "belt_length": (dims[-1], 0.6 + 0.01 * np.arange(dataset.sizes[dims[-1]]), {"units": "m"}),
        "driven_radius": (dims[0], 0.075 + 1e-4 * np.arange(dataset.sizes[dims[0]]), {"units": "m"}),
        "centre_distance": (dims, np.full(dataset["status"].shape, 0.155), {"units": "m"}),
    }
    return dataset.assign_coords(derived).drop_vars(
        "eigenfrequency" if "spectrum" in dataset else [], errors="ignore"
    )


def too_early(*tasks, **options):
    raise AssertionError("computed before it was asked for")


def is_of_a_run(name):
    return name.startswith("history_")


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_draws_lazy_quantities_in_other_units_as_numbers_in_si(kind):
    words = ["core_seconds"] if kind == "curve" else []
    options = {"orders": [10], "bandwidth": 10.0} if kind == "orders" else {}  # runs of a turn alone
    for name in NAMES:
        if is_of_a_run(name) == (KINDS[kind].subject == RESULTS):
            continue
        dataset = with_derived_axes(stored(name))
        if kind in ("onset_bands", "sensitivity"):  # of studies whose cells have samples
            dataset = dataset.expand_dims(sample=np.arange(3)).assign_coords(play=("sample", [1.0, 2.0, 3.0]))
            law = {"distribution": "normal", "mean": 2.0, "standard_deviation": 1.0}
            dataset.attrs["job"] = json.dumps({"uncertain": {"seed": 1, "play": law}})
        try:
            numbers_drawn, texts = drawn(getattr(dataset.cvt, kind)(*words, **options))
        except InputError:
            continue
        break
    foreign = in_other_units(dataset.chunk(), quantified=True)
    with dask.config.set(scheduler=too_early):
        standard(foreign)
    with dask.config.set(scheduler="synchronous"):
        found, found_texts = drawn(getattr(foreign.cvt, kind)(*words, **options))
    assert found_texts == texts and len(found) == len(numbers_drawn)
    for one, other in zip(found, numbers_drawn, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)


def words_of(page):
    """What a report says, without scripts and pictures."""
    return re.sub(r'<script.*?</script>|src="data:[^"]*"', "", page.read_text(), flags=re.DOTALL)


def rearranged(path):
    """In single precision, transposed, and with a variable of somebody's own."""
    dataset = xr.open_dataset(path).transpose(..., "load")
    single = {key: one.astype("f4") for key, one in dataset.items() if one.dtype.kind == "f"}
    return xr.merge([dataset.assign(single), xr.Dataset({"mine": ("other", [1.0, 2.0])})])


ORDINARY = {
    "undecoded": lambda path: xr.open_dataset(path, decode_cf=False),
    "opened": xr.open_dataset,
    "of several files": lambda path: xr.open_mfdataset([path]),
    "quantities": lambda path: in_other_units(xr.open_dataset(path), quantified=True),
    "rearranged": rearranged,
    "by where": lambda path: xr.open_dataset(path).where(xr.open_dataset(path)["status"] >= 0),
}
ARRAYS = ("classes", "strongest", "onset", "boundary")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    written = tmp_path_factory.mktemp("stored") / "grid.nc"
    written.write_bytes(content("grid"))
    return written


@pytest.fixture(scope="module")
def said(path):
    return words_of(stored("grid").cvt.report(path.with_name("report.html")))


@pytest.mark.parametrize("way", ORDINARY)
def test_verbs_read_what_xarray_has_made_of_a_dataset(way, path, said, tmp_path, monkeypatch):
    # of reports the words are compared
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, file, **_: file.write(b"picture"))
    expected = stored("grid")
    with ORDINARY[way](path) as dataset:
        for verb in ARRAYS:
            other = getattr(expected.cvt, verb)()
            found = standard(getattr(dataset.cvt, verb)().to_dataset(name="found"))["found"]
            np.testing.assert_allclose(found.transpose(*other.dims), other, rtol=1e-6)
        if way not in ("opened", "rearranged"):
            assert words_of(dataset.cvt.report(tmp_path / "report.html")) == said


def test_amplitudes_converted_by_pint_are_drawn_in_their_size():
    dataset = stored("grid")
    quantities = dataset.pint.quantify().pint.to(amplitude="um")
    for changed in (quantities, quantities.pint.dequantify(), quantities.pint.dequantify(format="~")):
        np.testing.assert_allclose(changed["amplitude"].data, 1e6 * dataset["amplitude"])
        (found, texts), (expected, others) = drawn(changed.cvt.map()), drawn(dataset.cvt.map())
        assert texts == others
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(one, other)


def test_arrays_that_verbs_return_are_in_the_units_of_the_dataset():
    dataset = stored("grid").cvt.in_units(load="N cm", amplitude="um")
    xr.align(dataset, dataset.cvt.classes(), join="exact")  # so that they select in it
    assert dataset.cvt.onset().attrs["units"] == "N cm" and dataset.cvt.strongest().attrs["units"] == "um"


def test_a_written_dataset_in_other_units_is_drawn_by_the_command_line_as_one_in_si(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, words in (("grid", "map --at load=100 --vmax"), ("history_pushbelt", "plot phase")):
        dataset = stored(name)
        for file, each in (("si", dataset), ("other", in_other_units(dataset))):
            write_netcdf(each, tmp_path / f"{file}.nc")
            kind, *options = words.replace("--vmax", "--vmax 20um").split()
            more = [options.pop(0)] if kind == "plot" else []
            assert main([kind, *more, f"{file}.nc", *options, "--out", f"{file}.png"]) == 0
        assert (tmp_path / "si.png").read_bytes() == (tmp_path / "other.png").read_bytes()


@pytest.mark.parametrize(
    ("name", "unit", "told"),
    [
        ("amplitude", "kN", 'results: amplitude: units: expected a unit of the dimension of m, found "kN"'),
        ("frequency", "rad/s", 'frequency: units: expected a unit of the dimension of Hz, found "rad/s"'),
        ("amplitude", "N", "amplitude: units: expected a unit of the dimension of m"),
        ("frequency", "rad/min", "frequency: units: expected a unit of the dimension of Hz"),
        ("amplitude", "micron-ish", "amplitude: units: expected a unit of the dimension of m, found "),
        ("mine", "a.u.", "mine: units: expected a unit such as mm, kN or rpm, found "),
    ],
)
def test_units_that_cannot_be_read_are_named(name, unit, told):
    dataset = stored("grid").assign(mine=1.0)
    dataset = dataset.assign({name: dataset[name].assign_attrs(units=unit)})
    for verb in ("map", "report"):
        with pytest.raises(InputError) as error:
            getattr(dataset.cvt, verb)()
        assert told in str(error.value)


def test_numbers_without_a_unit_have_the_documented_one_and_units_of_no_quantity_stay():
    dataset = stored("grid").drop_attrs().assign(temperature=((), 20.0, {"units": "degC"}))
    found = standard(dataset)
    assert found["temperature"] == 20.0 and found["temperature"].attrs["units"] == "degC"
    for key in recorded("elastic_belt").keys() & dataset.keys():
        assert found[key].attrs.get("units", "1") == stored("grid")[key].attrs["units"]


def test_means_of_flags_are_no_flags():
    with pytest.raises(InputError, match="vibrates: expected flags, which are whole numbers, found 0.5"):
        stored("grid").mean("load", keep_attrs=True).assign(
            vibrates=("friction_gradient", [0.5, 1.0])
        ).cvt.classes()


def test_what_where_and_concat_leave_open_is_not_run():
    dataset = stored("grid")
    part = dataset.where(dataset["load"] > 50.0)
    classes = part.cvt.classes()
    assert (classes.isel(load=0) == OccurrenceClass.NOT_RUN).all() and classes.dtype == np.int8
    assert classes.isel(load=slice(1, None)).equals(dataset.cvt.classes().isel(load=slice(1, None)))
    joined = xr.concat([dataset, dataset.isel(load=[1])], "design", join="outer")
    assert int((joined.cvt.classes() == OccurrenceClass.NOT_RUN).sum()) == 4


def test_texts_that_where_replaces_by_zeros_are_empty():
    dataset = stored("grid").assign(reason=stored("grid")["status"].astype(str).astype(object))
    part = dataset.where(dataset["load"] > 50.0, 0)
    assert set(part["reason"].isel(load=0).values.flat) == {0}
    assert set(plain(part)["reason"].isel(load=0).values.flat) == {""}
    part.cvt.map()


@pytest.mark.parametrize("dim", ["design", pd.Index([0.6, 0.66], name="belt_length")])
def test_a_report_of_joined_studies_lists_what_varies(dim, tmp_path):
    dataset = stored("grid")
    joined = xr.concat([dataset, dataset.assign_attrs(job="{}")], dim)
    page = words_of(joined.cvt.report(tmp_path / "report.html"))
    name = getattr(dim, "name", dim)
    values = "0.6, 0.66 [m]" if name == "belt_length" else "0, 1"
    assert f"<td>{name}</td><td>{values}</td>" in page and "Parameters" not in page
    assert f"Several studies are joined along {name}" in page


def test_stacked_runs_are_samples(tmp_path):
    dataset = stored("grid")
    stacked = dataset.stack(runs=dataset["status"].dims)
    assert count_classes(stacked.cvt.classes().values) == count_classes(dataset.cvt.classes().values)
    assert standard(stacked)["status"].dims == ("run",)
    assert "6 runs" in words_of(stacked.cvt.report(tmp_path / "report.html"))
    stacked.cvt.map()
