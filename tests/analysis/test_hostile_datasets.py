"""Datasets of somebody else: each of the table gets one line, from every command, and reaches nothing beside it."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import cvt_hpc.accessor  # noqa: F401
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.storage.foreign_files import EXPANSION
from cvt_hpc.storage.netcdf import is_history, open_netcdf, write_history, write_netcdf
from cvt_hpc.study import open_results
from support.hostile_datasets import FORMS, HOSTILE, SECRET, raw
from support.studies import study

VERBS = [
    ["map"],
    ["report"],
    ["plot", "curve", "loss"],
    ["plot", "waterfall"],
    ["compare", "other.nc"],
    ["map", "--show", "loss"],
]
# Calls commands one after the other, and prints what each took: seconds of a core, and the peak of memory [MB].
LIMITED = """
import pathlib, re, sys, time
from cvt_hpc.cli import main
for path in sys.argv[1:]:
    began = time.process_time()
    assert main(["report", path]) == 2
    # the peak of this process: getrusage tells that of the one which started it, where that is larger
    peak = re.search(r"VmHWM:\\s+(\\d+)", pathlib.Path("/proc/self/status").read_text())[1]
    print(time.process_time() - began, int(peak) / 1024)
"""


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The bytes of a sound dataset with all that the table changes."""
    results = study(gradients=(-2.4, -0.8), stiffnesses=(1.0, np.inf), loads=(20.0, 60.0, 100.0))
    results["loss"] = results["status"].dims, np.ones(results["status"].shape), {"units": "W"}
    path = tmp_path_factory.mktemp("sound") / "results.nc"
    write_netcdf(results, path)
    return path.read_bytes()


@pytest.fixture
def path(tmp_path, monkeypatch, sound):
    """Path of the dataset, beside another one, a pipe and a file of the user's, all of which stay as they are."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results.nc").write_bytes(sound)
    (tmp_path / "other.nc").write_bytes(sound)
    (tmp_path / "secret").write_text(SECRET)
    return tmp_path / "results.nc"


@pytest.mark.parametrize("number", range(len(HOSTILE)), ids=list(HOSTILE))
def test_each_gets_one_line(path, capsys, number):
    make, told = list(HOSTILE.values())[number]
    make(path)
    before = sorted(path.parent.iterdir())
    verb, *words = VERBS[number % len(VERBS)]
    place = 1 if verb == "plot" else 0
    assert main([verb, *words[:place], "results.nc", *words[place:]]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and SECRET not in err
    assert "results.nc" in err and told in err
    assert sorted(path.parent.iterdir()) == before


@pytest.mark.parametrize("name", FORMS)
def test_what_the_user_has_opened_herself_gets_one_line(path, name):
    make, _ = HOSTILE[name]
    make(path)
    try:
        dataset = xr.open_dataset(path, engine="netcdf4", decode_times=False)
    except (OSError, TypeError, ValueError):  # of xarray's own
        return
    with dataset, pytest.raises(InputError, match="^results.*expected "):
        dataset.cvt.map()


@pytest.mark.parametrize(
    "values", [np.zeros(2, complex), np.zeros(2, [("a", "f8")]), np.array([[], {}, 1], object)[:2]]
)
def test_types_that_no_picture_has(values):
    dataset = xr.Dataset({"status": ("load", np.ones(2, "i1")), "loss": ("load", values)})
    with pytest.raises(InputError, match="^results: loss: expected numbers or texts, found something else"):
        dataset.cvt.map()


def without_status(results):
    return results.drop_vars("status")


def texts_for_flags(results):
    return results.assign(status=(results["status"].dims, np.full(results["status"].shape, "done")))


def one_flag_for_all(results):
    return results.assign(status=((), np.int8(1)))


def amplitude_without_an_axis(results):
    return results.assign(amplitude=results["amplitude"].isel(load=0, drop=True))


def texts_for_amplitudes(results):
    return results.assign(amplitude=results["amplitude"].astype(str))


def one_text_twice(results):
    return results.assign_coords(load=("load", ["short", "long", "short"]))


def one_number_twice(results):
    return results.assign_coords(load=("load", np.array([1, 2, 2], "u8")))


CHANGES = [
    *(without_status, texts_for_flags, one_flag_for_all, amplitude_without_an_axis),
    *(texts_for_amplitudes, one_text_twice, one_number_twice),
]


@pytest.mark.parametrize("change", CHANGES)
def test_a_map_of_other_than_results_is_refused_in_one_line(path, capsys, change):
    with xr.open_dataset(path) as opened:
        write_netcdf(change(opened.load()), path.with_name("changed.nc"))
    assert main(["map", "changed.nc"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "changed.nc" in err and "expected" in err


def test_limits_of_time_and_memory(path, sound):
    names = [
        "vast",
        "wide chunk",
        "cycle of groups",
        "many names of one",
        "texts of one",
        "external link to a pipe",
    ]
    for number, name in enumerate(names):
        made = path.with_name(f"{number}.nc")
        made.write_bytes(sound)
        HOSTILE[name][0](made)
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, *(f"{number}.nc" for number in range(len(names)))],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    taken = np.array([line.split() for line in done.stdout.splitlines()], float)
    assert taken.shape == (len(names), 2) and (taken < [5.0, 500.0]).all()
    assert len(done.stderr.splitlines()) == len(names)


def test_cells_without_a_result_take_their_room(path):
    empty = np.full((300, 300, 20), np.nan)
    dataset = xr.Dataset(
        {"status": (("a", "b"), np.zeros((300, 300), "i1")), "loss": (("a", "b", "c"), empty)}
    )
    write_netcdf(dataset, path)
    assert empty.nbytes / path.stat().st_size > EXPANSION / 3
    with open_results(path) as opened:
        assert np.isnan(opened["loss"]).all()


def test_variable_texts_are_read_where_they_fit(path):
    texts = xr.Dataset(
        {"status": ("a", np.zeros(3, "i1")), "reason": ("a", np.array(["", "x", "µ"], object))}
    )
    texts.assign_attrs(notes=["a", "b"]).to_netcdf(path)
    with open_results(path) as opened:
        assert opened["reason"].values.tolist() == ["", "x", "µ"] and list(opened.attrs["notes"]) == [
            "a",
            "b",
        ]


def test_a_link_is_followed_where_the_user_names_it_and_not_within_a_folder(path):
    folder = path.parent / "out"
    folder.mkdir()
    (folder / "results.nc").symlink_to(path)
    with open_results(folder / "results.nc") as opened:
        assert "loss" in opened
    with pytest.raises(InputError, match="results.nc: expected a netCDF dataset, found: a link in the place"):
        open_results(folder)
    (folder / "histories").mkdir()
    (folder / "histories" / "run-000001.nc").symlink_to(path)
    assert main(["plot", "history", str(folder)]) == 2


def test_histories_are_checked_as_results_are(path, capsys):
    write_history(xr.Dataset({"loss": ("time", np.zeros(4))}), path.with_name("history.nc"))
    raw(path.with_name("history.nc"))
    assert is_history(path.with_name("history.nc"))  # by its attribute alone
    assert main(["plot", "history", "history.nc"]) == 2
    assert capsys.readouterr().err == (
        "cvt-hpc: history.nc, loss: expected values in this file, found values in another one\n"
    )


def test_damage_among_the_values_is_one_line(path, capsys):
    with h5py.File(path) as file:
        place = file["loss"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[place.byte_offset : place.byte_offset + place.size] = bytes(place.size)
    path.write_bytes(content)
    assert main(["plot", "curve", "results.nc", "loss"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "damaged" in err


def test_all_that_opens_a_dataset_does_so_by_one_function():
    package = Path(cvt_hpc.__file__).parent
    openers = ("xr.open_dataset(", "open_mfdataset(", "h5py.File(", "netCDF4.Dataset(")
    found = {
        str(source.relative_to(package)): [one for one in openers if one in source.read_text()]
        for source in package.rglob("*.py")
    }
    found["accessor.py"] = []  # in its docstring, as the user does
    assert {source for source, names in found.items() if names} == {
        "storage/foreign_files.py",
        "storage/netcdf.py",
        "job/netcdf_files.py",  # of bytes that were read, and checked
        "study/gather.py",  # written by the process itself, or checked
    }
    with pytest.raises(InputError):
        open_netcdf(Path("nothing.nc"))
