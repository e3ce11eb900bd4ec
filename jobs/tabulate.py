"""Write the dataset of a study as a small table: tabulate.py OUT/STUDY TABLE.csv [QUANTITY ...].

A row has a run, or, where parameters are uncertain, all samples of a cell: what is said of them together.
"""

import sys
from itertools import product

import numpy as np

from cvt_hpc import open_results
from cvt_hpc.errors import InputError, unknown
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.variables import Status, Vibrates

FLAGS = {"status": Status, "vibrates": Vibrates}
OF_A_BELT = ("amplitude", "frequency", "mode", "power_residual")
# unit, factor and digits of quantities that are not written in SI units, to six digits
LAYOUTS = {
    "amplitude": ("um", 1e6, "{:.2f}"),
    "half_stroke": ("um", 1e6, "{:.2f}"),
    "frequency": ("Hz", 1.0, "{:.1f}"),
    "eigenfrequency": ("Hz", 1.0, "{:.1f}"),
    "mode": ("", 1, "{:d}"),
}


def rows(results, quantities=OF_A_BELT):
    """Yield the lines, one per run: axes, status, verdict, and the quantities, per strand and the like."""
    cost = ["core_seconds"] if "core_seconds" in results else []
    dims = results["status"].dims
    axes = [str(name) for name, values in results.coords.items() if set(values.dims) <= set(dims)]
    for name in quantities:
        if name not in results.data_vars:
            raise unknown(name, "variable", name, map(str, results.data_vars))
    columns = [column for name in quantities for column in _columns(results[name], dims)]
    yield ",".join([*axes, "status", "vibrates", *(head for head, *_ in columns), *cost])
    words = {name: [flag.name.lower() for flag in kind] for name, kind in FLAGS.items()}
    for place in np.ndindex(results["status"].shape):
        run = results.isel(dict(zip(dims, place, strict=True)))
        done = words["status"][int(run["status"])] == "done"
        cells = [_number(run[axis].item()) for axis in axes]
        cells += [
            words["status"][int(run["status"])],
            words["vibrates"][int(run["vibrates"])] if done else "",
        ]
        cells += [layout(run[name].isel(at).item()) if done else "" for _, name, at, layout in columns]
        yield ",".join([*cells, *(f"{float(run[name]):.2f}" for name in cost)])


def _columns(array, dims):
    """Yield head, name, place and layout of each column that a quantity takes."""
    name = str(array.name)
    unit, factor, digits = LAYOUTS.get(name, (array.attrs.get("units", ""), 1, "{:.6g}"))
    words = array.attrs.get("flag_meanings", "").split()

    def layout(value):
        return words[value] if words else digits.format(value * factor)

    extra = [dim for dim in array.dims if dim not in dims]
    for place in product(*(range(array.sizes[dim]) for dim in extra)):
        at = dict(zip(extra, place, strict=True))
        labels = [str(array[dim].values[k]) for dim, k in at.items()]
        yield "_".join([name, *labels]) + (f" [{unit}]" if unit not in ("", "1") else ""), name, at, layout


def _number(value):
    return value if isinstance(value, str) else f"{value:g}"


if __name__ == "__main__":
    folder, table, *asked = sys.argv[1:]
    try:
        with open_results(folder) as results:
            of_cells = results.load().cvt.probability() if "sample" in results.dims else results.load()
            body = [f"{row}\n" for row in rows(of_cells, asked or OF_A_BELT)]
            lines = [*origin_lines(results.attrs), *body]
    except InputError as error:
        sys.exit(f"tabulate.py: {error}")
    with open(table, "w", encoding="utf-8") as out:
        out.writelines(lines)
