"""Write the dataset of a study as a small table: python jobs/tabulate.py OUT/STUDY TABLE.csv."""

import sys

import numpy as np

from cvt_hpc import open_results

COLUMNS = {
    "amplitude": ("um", 1e6, "{:.2f}"),
    "frequency": ("Hz", 1.0, "{:.1f}"),
    "mode": ("", 1, "{:d}"),
}


def rows(results):
    """Yield the lines, one per run: axes, status, verdict, and per strand amplitude, frequency, mode."""
    dims = results["status"].dims
    axes = [str(name) for name, values in results.coords.items() if set(values.dims) <= set(dims)]
    strands = [str(strand) for strand in results["strand"].values]
    units = {name: f" [{unit}]" if unit else "" for name, (unit, *_) in COLUMNS.items()}
    heads = [f"{name}_{strand}{unit}" for name, unit in units.items() for strand in strands]
    yield ",".join([*axes, "status", "vibrates", *heads, "power_residual", "core_seconds"])
    words = {name: results[name].attrs["flag_meanings"].split() for name in ("status", "vibrates")}
    for place in np.ndindex(results["status"].shape):
        run = results.isel(dict(zip(dims, place, strict=True)))
        done = words["status"][int(run["status"])] == "done"
        cells = [f"{run[axis].item():g}" for axis in axes]
        cells += [
            words["status"][int(run["status"])],
            words["vibrates"][int(run["vibrates"])] if done else "",
        ]
        for name, (_, scale, layout) in COLUMNS.items():
            cells += [layout.format(run[name].values[k] * scale) if done else "" for k in range(len(strands))]
        cells += [f"{float(run['power_residual']):.4f}" if done else "", f"{float(run['core_seconds']):.2f}"]
        yield ",".join(cells)


if __name__ == "__main__":
    folder, table = sys.argv[1:]
    with open_results(folder) as results, open(table, "w", encoding="utf-8") as out:
        out.writelines(f"{row}\n" for row in rows(results.load()))
