"""`plot`: pictures of results beside the map, each by its kind."""

from __future__ import annotations

import argparse
import re
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from cvt_hpc.cli.parts import DONE, PICTURES, add_assignments, add_command, check_output, folder_of, say
from cvt_hpc.errors import mismatch

LONGEST_NAME = 100  # letters of a picture's name


def add(commands: Any) -> None:
    """Declare the command."""
    plot = commands.add_parser("plot", help="draw spectra, curves or forces", description="Draw results.")
    kinds = plot.add_subparsers(metavar="KIND", required=True)
    text = "spectra of the strands over an axis, with eigenfrequencies where they are known"
    waterfall = add_command(kinds, "waterfall", _waterfall, text, "RESULTS")
    text = "a quantity over an axis as marks, and others of its unit as lines beside it"
    curve = add_command(kinds, "curve", _curve, text, "RESULTS")
    curve.add_argument("quantities", nargs="+", metavar="QUANTITY", help="variable of the results")
    text = "forces between belt and pulleys over the wrap, of one run or of several"
    wrap = add_command(kinds, "wrap", _wrap, text, "HISTORY")
    wrap.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    names = {waterfall: "waterfall", curve: "curve_QUANTITY", wrap: "HISTORY_wrap"}
    for command, name in names.items():
        text = f"default: {name}.png beside the dataset"
        command.add_argument("--out", type=Path, metavar="PNG", help=text)
    for command in (waterfall, curve):
        add_assignments(command, "--at", "fix an axis at a value")


def _waterfall(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.waterfall import draw_waterfall
    from cvt_hpc.study import open_results

    out = _picture(arguments, "waterfall", *arguments.at)
    with open_results(arguments.path) as dataset:
        at = _at(arguments, dataset)
        say(f"picture: {draw_waterfall(dataset, out, at, str(arguments.path))}")
    return DONE


def _curve(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.curves import draw_curve
    from cvt_hpc.study import open_results

    out = _picture(arguments, "curve", *arguments.quantities, *arguments.at)
    with open_results(arguments.path) as dataset:
        at = _at(arguments, dataset)
        say(f"picture: {draw_curve(dataset, arguments.quantities, out, at, str(arguments.path))}")
    return DONE


def _wrap(arguments: argparse.Namespace) -> int:
    from cvt_hpc.netcdf import is_history

    files = [arguments.path, *arguments.others]
    out = _picture(arguments, *(file.stem for file in files), "wrap")
    for file in files:
        if not is_history(file):
            raise mismatch(
                str(file), "a history written by `cvt-hpc simulate --out`", "another file, or none"
            )
    import xarray as xr

    from cvt_hpc.analysis.wraps import draw_wrap

    with ExitStack() as stack:
        histories = [
            stack.enter_context(xr.open_dataset(file, engine="netcdf4", decode_times=False)) for file in files
        ]
        say(f"picture: {draw_wrap(histories, out, [file.stem for file in files])}")
    return DONE


def _picture(arguments: argparse.Namespace, *words: str) -> Path:
    """The picture asked for, or one beside the dataset whose name tells what it shows."""
    check_output(arguments.out, PICTURES)
    name = "_".join(re.sub(r"[^\w.=+-]+", "_", word) for word in words)
    return arguments.out or folder_of(arguments.path) / f"{name[:LONGEST_NAME]}.png"


def _at(arguments: argparse.Namespace, dataset: Any) -> dict[str, Any]:
    from cvt_hpc.job.assignments import read_coordinates

    units = {str(name): array.attrs.get("units") for name, array in dataset.coords.items()}
    return read_coordinates(arguments.at, units, str(arguments.path), "--at")
