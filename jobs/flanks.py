"""Write which flank carries alone at the ends of the arcs of kept runs: flanks.py OUT/STUDY TABLE.csv."""

import sys
from pathlib import Path

import numpy as np
import xarray as xr

from cvt_hpc.analysis.profiles import AROUND, alone, ends_of_arcs, from_end
from cvt_hpc.analysis.telling_apart import history_files, on_axes
from cvt_hpc.storage.provenance import origin_lines

HEAD = "run,end,flank alone,alone [mm],its largest sliding along the belt [m/s],and along the meridian [m/s]"


def rows(histories, names):
    """Yield the lines, one for each end of an arc of each run: the flank alone there, first or last."""
    yield HEAD
    _, labels = on_axes(histories, names)
    for history, label in zip(histories, labels, strict=True):
        for end in ends_of_arcs(history):
            side, length = alone(history, end)
            near = np.abs(from_end(history, end)) < AROUND
            speeds = [history[f"{name}_{side}"].values[near] for name in ("flank_slip", "radial_slip")]
            fastest = [f"{speed[np.nanargmax(np.abs(speed))]:.3f}" for speed in speeds]
            told = [side if length else "both", f"{1e3 * length:.2f}", *fastest]
            yield ",".join([" ".join(label.values()), end.name, *told])


if __name__ == "__main__":
    folder, table = map(Path, sys.argv[1:])
    files = history_files([folder])
    opened = [xr.open_dataset(file, engine="netcdf4", decode_times=False) for file in files]
    body = [f"{row}\n" for row in rows(opened, [file.stem for file in files])]
    table.write_text("".join([*origin_lines(opened[0].attrs), *body]), encoding="utf-8")
