"""Datasets that somebody else has made to harm or to mislead: each changes a sound `results.nc`, and what is told of it."""

import os

import h5py
import netCDF4
import numpy as np

SECRET = "the user's own"  # in the file beside the dataset, which none of them may reach
TEXTS = "job_name", "title", "job", "history", "command", "versions", "cvt_hpc_content", "point"


def of_hdf5(change):
    """What makes a dataset, given what changes it as an HDF5 file."""

    def make(path):
        with h5py.File(path, "r+") as file:
            change(file)

    return make


def of_netcdf(change):
    """What makes a dataset, given what changes it as a netCDF file."""

    def make(path):
        with netCDF4.Dataset(path, "r+") as file:
            change(file)

    return make


def instead(content):
    """What makes a dataset of bytes."""
    return lambda path: path.write_bytes(content)


def replaced(name, *shape, **how):
    """What puts another variable in the place of one."""

    def change(file):
        del file[name]
        file.create_dataset(name, shape or None, **how)

    return of_hdf5(change)


def linked(link):
    def make(path):
        with h5py.File(path, "r+") as file:
            del file["loss"]
            file["loss"] = link(path)

    return make


def attribute(name, value, variable=None):
    def change(file):
        place = file[variable] if variable else file
        place.attrs[name] = value

    return of_hdf5(change)


def virtual(path):
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource(str(path.with_name("other.nc")), "loss", (4,))
    with h5py.File(path, "r+") as file:
        del file["loss"]
        file.create_virtual_dataset("loss", layout)


def raw(path):
    size = len(SECRET)
    replaced("loss", size, dtype="u1", external=[(str(path.with_name("secret")), 0, size)])(path)


def cycle(file):
    group = file.create_group("group")
    for number in range(30):
        group[f"again_{number}"] = group


def committed(file):
    file["kind"] = np.dtype([("a", "f8"), ("b", "i4")])


def many(file):
    for number in range(1_500):
        file[f"loss_{number}"] = file["loss"]


def wide_chunk(path):
    replaced("loss", 1, dtype="f8", maxshape=(None,), chunks=(2**28,), compression="gzip")(path)


def twice(file):
    del file["loss"]
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((4,))
    for _ in range(2):
        plan.set_deflate(9)
    space = h5py.h5s.create_simple((4,))
    h5py.h5d.create(file.id, b"loss", h5py.h5t.IEEE_F64LE, space, plan)


def texts_of_one(path):
    """A long text, to which the file refers very often."""
    with h5py.File(path, "r+") as file:
        file.attrs["x"] = np.array(["y" * 60_000] * 3_000, h5py.string_dtype())


def classic(path):
    path.unlink()
    with netCDF4.Dataset(path, "w", format="NETCDF3_CLASSIC") as file:
        file.title = "old"


def pipe(path):
    path.unlink()
    os.mkfifo(path)


def to(target):
    def make(path):
        path.unlink()
        path.symlink_to(target)

    return make


def single_dimension(file):
    del file["load"]
    file.create_dataset("load", data=1.0).make_scale("load")


def several_lines(file):
    file["strand"].set_auto_chartostring(False)
    file["strand"][:] = np.array([[b"\n", b"1"], [b"t", b"2"]])


VAST = (100_000, 100_000)
PLACES = {  # something lies elsewhere, or is not what it should be: how it is made, what is told of it
    "external link": (linked(lambda path: h5py.ExternalLink(str(path.with_name("other.nc")), "/loss")), "a link"),
    "external link to a pipe": (linked(lambda path: h5py.ExternalLink(str(path.with_name("pipe")), "/loss")), "a link"),
    "soft link": (linked(lambda path: h5py.SoftLink("/status")), "a link"),
    "soft link to itself": (linked(lambda path: h5py.SoftLink("/loss")), "a link"),
    "virtual": (virtual, "values in another one"),
    "raw storage": (raw, "values in another one"),
    "group": (of_hdf5(lambda file: file.create_group("group/within")), "a group"),
    "cycle of groups": (of_hdf5(cycle), "a group"),
    "root in itself": (of_hdf5(lambda file: file.__setitem__("again", file["/"])), "a group"),
    "named type": (of_hdf5(committed), "a type of the file's own"),
    "pipe": (pipe, "a pipe"),
    "device": (to("/dev/zero"), "a device"),
    "link to nothing": (to("nothing"), "nothing"),
    "of the kernel": (to("/proc/self/maps"), "one that is damaged"),
    "folder": (lambda path: (path.unlink(), path.mkdir()), "no job.json in it"),
    "empty": (instead(b""), "one that is damaged"),
    "text": (instead(b"load,loss\n1,2\n"), "one that is damaged"),
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:3000]), "one that is damaged"),
    "head alone": (instead(b"\x89HDF\r\n\x1a\n" + bytes(100)), "one that is damaged"),
    "netCDF-3": (classic, "netCDF-3"),
}  # fmt: skip
SIZES = {
    "vast": (replaced("loss", *VAST, dtype="f8", chunks=(1000, 1000), compression="gzip"), "values of at most"),
    "vast, in one": (replaced("loss", 2**40, dtype="f8"), "values of at most"),
    "vast flags": (replaced("status", *VAST, dtype="i1", chunks=(1000, 1000), compression="gzip"), "values of at most"),
    "vast axis": (of_netcdf(lambda file: file.createDimension("vast", 10**10)), "values of at most"),
    "wide chunk": (wide_chunk, "values of at most"),
    "compressed twice": (of_hdf5(twice), "compressed once"),
    "many names of one": (of_hdf5(many), "variables and attributes"),
    "many attributes": (of_hdf5(lambda file: [file.attrs.__setitem__(f"x{k}", k) for k in range(201)]), "at most 200 attributes"),
    "texts of one": (texts_of_one, "an attribute that fits"),
}  # fmt: skip
TYPES = {
    "compound": (replaced("loss", 4, dtype=[("a", "f8"), ("b", "f8")]), "something else"),
    "complex": (replaced("loss", 4, dtype="c16"), "something else"),
    "lists": (replaced("loss", 4, dtype=h5py.vlen_dtype("f8")), "something else"),
    "references": (replaced("loss", 4, dtype=h5py.ref_dtype), "something else"),
    "opaque": (replaced("loss", 4, dtype="V8"), "something else"),
    "words of bits": (replaced("loss", 4, dtype=h5py.enum_dtype({"a": 1}, "i1")), "something else"),
    "half precision": (replaced("loss", 4, dtype="f2"), "something else"),
    "long double": (replaced("loss", 4, dtype="f16"), "something else"),
    "without values": (replaced("loss", dtype=None, data=h5py.Empty("f8")), "one that is damaged"),
    "compound attribute": (attribute("x", np.zeros(2, [("a", "f8")]), "loss"), "something else"),
    "complex attribute": (attribute("units", np.complex128(1)), "something else"),
    # at which the netCDF library breaks, or makes room for as many as a number says
    "long name of an attribute": (attribute("x" * 1_000, 1.0, "loss"), "loss: expected names of at most 256 bytes"),
    "long name of the file's attribute": (attribute("\u00e9" * 200, 1.0), "expected names of at most 256 bytes"),
    "long name of a variable": (of_hdf5(lambda file: file.move("loss", "x" * 300)), "expected names of at most 256 bytes"),
    "dimension of one value": (of_hdf5(single_dimension), "load: CLASS: expected what the netCDF library writes"),
    "names of a dimension": (attribute("NAME", np.array([b"load"] * 9_000), "load"), "load: NAME: expected what the netCDF library writes"),
    "numbers for a name": (attribute("NAME", np.arange(10_000), "load"), "load: NAME: expected what the netCDF library writes"),
    "any text for a class": (attribute("CLASS", "DIMENSION_SCALE", "load"), "load: CLASS: expected what the netCDF library writes"),
    "a dimension's many numbers": (attribute("_Netcdf4Dimid", np.arange(10_000), "load"), "load: _Netcdf4Dimid: expected what the netCDF library writes"),
    "a dimension's vast number": (attribute("_Netcdf4Dimid", np.int32(2**31 - 1), "load"), "load: _Netcdf4Dimid: expected what the netCDF library writes"),
    "properties of many texts": (attribute("_NCProperties", np.array([b"version=2"] * 6_000)), "_NCProperties: expected what the netCDF library writes"),
    "dimensions of numbers": (attribute("DIMENSION_LIST", np.arange(3), "loss"), "something else"),
}  # fmt: skip
FORMS = {
    "numeric title": (attribute("title", 5.0), "title: expected a text, found 5.0"),
    "numeric units": (attribute("units", 5, "loss"), "loss: units: expected a text, found 5"),
    "units of several lines": (attribute("units", "W\n\u202e", "loss"), "loss: units: expected a unit"),
    "list of units": (attribute("units", np.array(["W", "m"], h5py.string_dtype()), "load"), "units: expected a text"),
    "number for meanings": (attribute("flag_meanings", 1.0, "vibrates"), "flag_meanings: expected a text"),
    "numbers to add": (attribute("add_offset", [1.0, 2.0], "loss"), "one that xarray cannot read"),
    "numbers times 0": (attribute("scale_factor", 0.0, "loss"), "loss: scale_factor: expected a factor, with which values differ, found 0.0"),
    "whole numbers times 0": (attribute("scale_factor", 0, "status"), "status: scale_factor: expected a factor"),
    "numbers times 1e308": (attribute("scale_factor", 1e308, "loss"), "loss: scale_factor: expected a number of at most 1e+100"),
    "numbers beside 1e308": (attribute("add_offset", -1e308, "loss"), "loss: add_offset: expected a number of at most 1e+100"),
    "axis of several lines": (of_netcdf(several_lines), "strand: expected texts of printable characters"),
    "job that is no table": (attribute("job", "[1]"), "job: expected a table in JSON"),
    "job of a model that is no text": (attribute("job", '{"model": ["criterion"]}'), "job: model: expected a text"),
    "axis without values": (of_netcdf(lambda file: file["load"].__setitem__(slice(None), np.nan)), "values that differ"),
    "axis of one value": (of_netcdf(lambda file: file["load"].__setitem__(slice(None), 2.0)), "values that differ"),
    "deep job": (attribute("job", "[" * 50_000), "job: expected a table in JSON"),
    "changed name": (lambda path: path.write_bytes(path.read_bytes().replace(b"loss", b"lo\x1bs")), "one that is damaged"),
}  # fmt: skip
HOSTILE = PLACES | SIZES | TYPES | FORMS
