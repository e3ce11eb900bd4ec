"""The datasets that this version of the program keeps for its tests, as xarray opens them."""

import lzma
from functools import cache
from pathlib import Path

import netCDF4
import xarray as xr

import cvt_hpc

FOLDER = Path(__file__).parents[1] / "datasets" / cvt_hpc.__version__
NAMES = sorted(path.name.removesuffix(".nc.xz") for path in FOLDER.glob("*.nc.xz"))


def content(name):
    """The bytes of a file, which is stored compressed."""
    return lzma.decompress((FOLDER / f"{name}.nc.xz").read_bytes())


@cache
def stored(name):
    """A dataset in memory, which tests leave as it is."""
    file = netCDF4.Dataset(name, memory=content(name))  # xarray closes it
    return xr.load_dataset(xr.backends.NetCDF4DataStore(file), decode_times=False)
