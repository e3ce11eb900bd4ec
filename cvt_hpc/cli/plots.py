"""`plot`: pictures of results beside the map, each by its kind."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from cvt_hpc.cli.parts import (
    DONE,
    PICTURES,
    SOME_FAILED,
    add_assignments,
    add_colour_end,
    add_command,
    add_sides,
    check_output,
    colour_end,
    complain,
    picture_beside,
    say,
    sides_of,
)
from cvt_hpc.errors import InputError
from cvt_hpc.files import StorageError


def add(commands: Any) -> None:
    """Declare the command."""
    plot = commands.add_parser("plot", help="draw spectra, curves or forces", description="Draw results.")
    kinds = plot.add_subparsers(metavar="KIND", required=True)
    text = "spectra of the strands over an axis, with eigenfrequencies where they are known"
    waterfall = add_command(kinds, "waterfall", _waterfall, text, "RESULTS")
    text = "Campbell diagram: spectra over the driving speed, with eigenfrequencies and orders"
    campbell = add_command(kinds, "campbell", _campbell, text, "RESULTS")
    text = "multiples of the driving pulley's turns (default: 1 2 4 8 16)"
    campbell.add_argument("--orders", nargs="+", type=float, metavar="ORDER", help=text)
    text = "where vibration begins and ends along ramps up and down, and the bands between them"
    hysteresis = add_command(kinds, "hysteresis", _hysteresis, text, "RESULTS")
    text = "a quantity over an axis as marks, and others of its unit as lines beside it"
    curve = add_command(kinds, "curve", _curve, text, "RESULTS")
    text = "variable of the results; with --lines, A+B share a panel"
    curve.add_argument("quantities", nargs="+", metavar="QUANTITY", help=text)
    text = "a curve for each value of that axis, and a panel for each quantity"
    curve.add_argument("--lines", metavar="AXIS", help=text)
    text = "forces between belt and pulleys over the wrap, of one run or of several"
    wrap = add_command(kinds, "wrap", _wrap, text, "HISTORY")
    wrap.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    text = "quantities along the belt of one run or of several, such as forces and sliding"
    profile = add_command(kinds, "profile", _profile, text, "HISTORIES")
    profile.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    text = "variable over position; may be repeated (default: push_force, friction_force, ring_friction)"
    profile.add_argument("--of", action="append", default=[], metavar="QUANTITY", help=text)
    profile.add_argument("--region", choices=("driving", "driven"), help="over the wrap of that pulley alone")
    profile.add_argument("--columns", metavar="AXIS", help="a column of panels for each value of an axis")
    text = "motion of a strand along a ramp of load or speed, with its spectrogram"
    ramp = add_command(kinds, "ramp", _ramp, text, "HISTORIES")
    ramp.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    ramp.add_argument(
        "--of", default="t1", metavar="WHAT", help="t1, t2 or a variable over time (default: t1)"
    )
    text = "spectra of the strands side by side along a ramp or over time, with eigenfrequencies"
    spectrogram = add_command(kinds, "spectrogram", _spectrogram, text, "HISTORIES")
    spectrogram.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    text = "sliding of one element on the sheaves over time, along its path"
    element = add_command(kinds, "element", _element, text, "HISTORY")
    element.add_argument("--region", choices=("driving", "driven"), help="one passage of that arc alone")
    text = "what the element meets over time, as a dataset"
    element.add_argument("--data", type=Path, metavar="FILE.nc", help=text)
    text = "tension and push force of the strands over an axis, as bars"
    strands = add_command(kinds, "strands", _strands, text, "RESULTS")
    of_one = {
        "history": "a kept run: displacement, spectrum, load, forces and feeds around the belt",
        "phase": "phase portraits: velocity of each strand over its displacement",
        "flanks": "left and right flank of a spatial pushbelt, with the ends of the arcs enlarged",
        "energy": "powers around the belt: what friction takes on the arcs, what feeds the vibration",
        "variator": "quantities along the belt drawn on the variator, such as forces, speeds and slip",
    }
    for kind, text in of_one.items():
        command = add_command(kinds, kind, _of_one, text, "HISTORIES")
        command.set_defaults(kind=kind)
        text = f"default: HISTORY_{kind}.png beside the dataset; of several with the name of each run"
        command.add_argument("--out", type=Path, metavar="PNG", help=text)
    text = "variable over position; may be repeated (default: push_force, of belt drives tension)"
    command.add_argument("--of", action="append", default=[], metavar="QUANTITY", help=text)
    text = "the belt in the last periods of a run, magnified, as a moving picture"
    animation = add_command(kinds, "animation", _animation, text, "HISTORIES")
    text = "FILE.gif, or FILE.mp4 where there is ffmpeg (default: HISTORY.gif beside it)"
    animation.add_argument("--out", type=Path, metavar="GIF", help=text)
    names = {
        strands: "strands",
        hysteresis: "hysteresis",
        campbell: "campbell",
        spectrogram: "spectrogram",
        waterfall: "waterfall",
        curve: "curve_QUANTITY",
        wrap: "HISTORY_wrap",
        profile: "profile",
    }
    names |= {ramp: "ramp_WHAT", element: "element"}
    for command, name in names.items():
        text = f"default: {name}.png beside the dataset"
        command.add_argument("--out", type=Path, metavar="PNG", help=text)
    sides = {waterfall: ("x", "panel"), campbell: ("panel",), strands: ("x", "panel")}
    sides |= {hysteresis: ("y", "panel"), curve: ()}
    for command, names_of_sides in sides.items():
        add_assignments(command, "--at", "fix an axis at a value")
        add_sides(command, *names_of_sides)
    for command, runs in (
        (waterfall, "runs"),
        (campbell, "runs"),
        (ramp, "moments"),
        (spectrogram, "moments"),
    ):
        add_colour_end(command, runs)


def _waterfall(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.waterfall import draw_waterfall
    from cvt_hpc.study import open_results

    out, vmax = _picture(arguments, "waterfall", *arguments.at), colour_end(arguments.vmax, "m")
    with open_results(arguments.path) as dataset:
        at, sides = _at(arguments, dataset), sides_of(arguments)
        picture = draw_waterfall(dataset, out, at, str(arguments.path), sides, vmax=vmax)
        say(f"picture: {picture}")
    return DONE


def _campbell(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.figures import draw
    from cvt_hpc.analysis.waterfall import ORDERS, campbell_figure
    from cvt_hpc.study import open_results

    out, orders = _picture(arguments, "campbell", *arguments.at), arguments.orders or ORDERS
    chosen = orders, arguments.panel, colour_end(arguments.vmax, "m")
    with open_results(arguments.path) as dataset:
        at = _at(arguments, dataset)
        picture = draw(lambda: campbell_figure(dataset, at, str(arguments.path), *chosen), out)
        say(f"picture: {picture}")
    return DONE


def _hysteresis(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.hysteresis_bands import draw_hysteresis
    from cvt_hpc.study import open_results

    out = _picture(arguments, "hysteresis", *arguments.at)
    with open_results(arguments.path) as dataset:
        at, sides = _at(arguments, dataset), sides_of(arguments)
        say(f"picture: {draw_hysteresis(dataset, out, at, str(arguments.path), sides)}")
    return DONE


def _curve(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.curve_panels import draw_curve_panels
    from cvt_hpc.analysis.curves import draw_curve
    from cvt_hpc.study import open_results

    out = _picture(arguments, "curve", *arguments.quantities, *arguments.at)
    with open_results(arguments.path) as dataset:
        at, source, asked = _at(arguments, dataset), str(arguments.path), arguments.quantities
        if arguments.lines is None:
            picture = draw_curve(dataset, asked, out, at, source)
        else:
            groups = [quantity.split("+") for quantity in asked]
            picture = draw_curve_panels(dataset, groups, arguments.lines, out, at, source)
        say(f"picture: {picture}")
    return DONE


def _strands(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.strand_bars import draw_strand_bars
    from cvt_hpc.study import open_results

    out = _picture(arguments, "strands", *arguments.at)
    with open_results(arguments.path) as dataset:
        at, sides = _at(arguments, dataset), sides_of(arguments)
        say(f"picture: {draw_strand_bars(dataset, out, at, str(arguments.path), sides)}")
    return DONE


def _animation(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.animation import check_animation, draw_animation

    def write(history: Any, out: Path, source: str) -> str:
        return f"animation: {draw_animation(history, out, source)}"

    check_animation(arguments.out or Path("belt.gif"))
    return _each(arguments, lambda file: file.with_suffix(".gif"), write)


def _of_one(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis import flanks, histories, on_variator

    quantities = getattr(arguments, "of", [])

    def write(history: Any, out: Path, source: str) -> str:
        if arguments.kind == "history":
            picture = histories.draw_history(history, out)
        elif arguments.kind == "phase":
            picture = histories.draw_phase(history, out, source)
        elif arguments.kind == "flanks":
            picture = flanks.draw_flanks(history, out, source)
        elif arguments.kind == "energy":
            picture = on_variator.draw_energy(history, out, source)
        else:
            picture = on_variator.draw_variator(history, out, quantities, source)
        return f"picture: {picture}"

    return _each(arguments, lambda file: _picture(arguments, file.stem, arguments.kind, *quantities), write)


def _each(
    arguments: argparse.Namespace, beside: Callable[[Path], Path], write: Callable[[Any, Path, str], str]
) -> int:
    """Write a picture of each history that is given, one by one; of several the others of one that has none.

    Parameters
    ----------
    beside : callable
        Where the picture of a file goes; with --out and several histories there, with the name of the run.
    write : callable
        Draws a history to a place, given its source, and tells in a line what was written.
    """
    from cvt_hpc.analysis.telling_apart import history_files

    files, status = history_files([arguments.path]), DONE
    for file in files:
        out = arguments.out or beside(file)
        if arguments.out and len(files) > 1:
            out = out.with_stem(f"{out.stem}_{file.stem}")
        try:
            with _opened([file]) as (history,):
                say(write(history, out, str(file)))
        except StorageError:
            raise
        except InputError as error:
            if len(files) == 1:
                raise
            complain(str(error))
            status = SOME_FAILED
    return status


def _wrap(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.telling_apart import history_files

    files = history_files([arguments.path, *arguments.others])
    out = _picture(arguments, *(file.stem for file in files), "wrap")
    from cvt_hpc.analysis.wraps import draw_wrap

    with _opened(files) as histories:
        say(f"picture: {draw_wrap(histories, out, [file.stem for file in files])}")
    return DONE


def _profile(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.profiles import DEFAULT, draw_profile
    from cvt_hpc.analysis.telling_apart import history_files

    out = _picture(arguments, "profile", *filter(None, (*arguments.of, arguments.region)))
    files = history_files([arguments.path, *arguments.others])
    with _opened(files) as histories:
        chosen = arguments.of or DEFAULT, arguments.region, arguments.columns
        say(f"picture: {draw_profile(histories, out, *chosen, [file.stem for file in files])}")
    return DONE


def _ramp(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.ramps import draw_ramp
    from cvt_hpc.analysis.telling_apart import history_files

    out = _picture(arguments, "ramp", arguments.of)
    files = history_files([arguments.path, *arguments.others])
    with _opened(files) as histories:
        shown = histories[0].get(arguments.of)
        vmax = colour_end(arguments.vmax, "m" if shown is None else str(shown.attrs.get("units", "")))
        picture = draw_ramp(histories, out, arguments.of, [file.stem for file in files], vmax)
        say(f"picture: {picture}")
    return DONE


def _spectrogram(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.ramps import draw_spectrogram
    from cvt_hpc.analysis.telling_apart import history_files

    out, vmax = _picture(arguments, "spectrogram"), colour_end(arguments.vmax, "m")
    files = history_files([arguments.path, *arguments.others])
    with _opened(files) as histories:
        say(f"picture: {draw_spectrogram(histories, out, [file.stem for file in files], vmax)}")
    return DONE


def _element(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.followed_drawing import draw_element, followed_of
    from cvt_hpc.analysis.telling_apart import history_files
    from cvt_hpc.netcdf import write_history

    out = _picture(arguments, "element", *filter(None, [arguments.region]))
    check_output(arguments.data, (".nc",))
    files, written = history_files([arguments.path]), []
    with _opened(files[:1]) as (history,):
        if arguments.data is not None:
            followed = followed_of(history, arguments.region, str(files[0]))
            written.append(f"data: {write_history(followed, arguments.data)}")
        say(f"picture: {draw_element(history, out, arguments.region, str(files[0]))}", *written)
    return DONE


@contextmanager
def _opened(files: Sequence[Path]) -> Iterator[list[Any]]:
    """Histories of runs, open within."""
    import xarray as xr

    with ExitStack() as stack:
        yield [
            stack.enter_context(xr.open_dataset(file, engine="netcdf4", decode_times=False)) for file in files
        ]


def _picture(arguments: argparse.Namespace, *words: str) -> Path:
    """The picture asked for, or one beside the dataset whose name tells what it shows."""
    check_output(arguments.out, PICTURES)
    return arguments.out or picture_beside(arguments.path, *words)


def _at(arguments: argparse.Namespace, dataset: Any) -> dict[str, Any]:
    from cvt_hpc.job.assignments import read_coordinates

    units = {str(name): array.attrs.get("units") for name, array in dataset.coords.items()}
    return read_coordinates(arguments.at, units, str(arguments.path), "--at")
