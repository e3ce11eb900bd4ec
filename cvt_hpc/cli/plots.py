"""`plot`: pictures of results beside the map, each by its kind; `analysis/kinds.py` declares them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from cvt_hpc.analysis.kinds import HISTORIES, HISTORY, KINDS, RESULTS, Kind, compose, function_of
from cvt_hpc.cli.parts import (
    DONE,
    PICTURES,
    add_assignments,
    add_command,
    add_sides,
    check_output,
    picture_beside,
    say,
)
from cvt_hpc.errors import mismatch


def add(commands: Any) -> None:
    """Declare the command."""
    plot = commands.add_parser("plot", help="draw spectra, curves or forces", description="Draw results.")
    kinds = plot.add_subparsers(metavar="KIND", required=True)
    for name, kind in KINDS.items():
        _add_kind(kinds, name, kind)
    text = "the belt in the last periods of a run, magnified, as a moving picture"
    animation = add_command(kinds, "animation", _animation, text, HISTORY)
    text = "FILE.gif, or FILE.mp4 where there is ffmpeg (default: HISTORY.gif beside it)"
    animation.add_argument("--out", type=Path, metavar="GIF", help=text)


def _add_kind(kinds: Any, name: str, kind: Kind) -> None:
    command = add_command(kinds, name, _draw, kind.text, kind.subject)
    command.set_defaults(kind=name)
    for option in kind.options:
        place: dict[str, Any] = {"dest": option.key} if option.flag else {}
        command.add_argument(option.flag or option.key, help=option.text, **place, **option.settings)
    if kind.subject == HISTORIES:
        command.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    if kind.data:
        text = "what the picture shows, as a dataset"
        command.add_argument("--data", type=Path, metavar="FILE.nc", help=text)
    text = f"default: {kind.picture or name}.png beside the dataset"
    command.add_argument("--out", type=Path, metavar="PNG", help=text)
    add_sides(command, kind.sides)
    if kind.subject == RESULTS:
        add_assignments(command, "--at", "fix an axis at a value")


def _draw(arguments: argparse.Namespace) -> int:
    name, kind = arguments.kind, KINDS[arguments.kind]
    keys = *(option.key for option in kind.options), *kind.sides
    options = {key: value for key in keys if (value := getattr(arguments, key)) not in (None, [])}
    named = [options[option.key] for option in kind.options if option.is_named and option.key in options]
    words = [word for value in named for word in ([value] if isinstance(value, str) else value)]
    if kind.subject == RESULTS:
        return _draw_results(arguments, [name, *words, *arguments.at], options)
    check_output(arguments.out, PICTURES)
    from cvt_hpc.analysis.telling_apart import history_files

    files = history_files([arguments.path, *getattr(arguments, "others", [])])
    if kind.subject == HISTORY and len(files) > 1:
        raise mismatch(str(arguments.path), "one history", f"{len(files)}: {files[0].name}, ...")
    runs = [file.stem for file in files] if kind.picture.startswith(HISTORY) else []
    out = arguments.out or picture_beside(arguments.path, *runs, name, *words)
    sources = [file.stem if kind.subject == HISTORIES else str(file) for file in files]
    written = []
    with _opened(files) as histories:
        if kind.data and arguments.data:
            written.append(f"data: {_write_data(kind, histories[0], arguments.data, sources[0], options)}")
        say(f"picture: {_write(name, histories, out, None, sources, options)}", *written)
    return DONE


def _draw_results(arguments: argparse.Namespace, words: Sequence[str], options: dict[str, Any]) -> int:
    from cvt_hpc.job.assignments import read_coordinates
    from cvt_hpc.study import open_results

    check_output(arguments.out, PICTURES)
    out, source = arguments.out or picture_beside(arguments.path, *words), str(arguments.path)
    with open_results(arguments.path) as dataset:
        units = {str(name): array.attrs.get("units") for name, array in dataset.coords.items()}
        at = read_coordinates(arguments.at, units, source, "--at")
        say(f"picture: {_write(arguments.kind, [dataset], out, at, [source], options)}")
    return DONE


def _write(
    name: str, datasets: Sequence[Any], out: Path, at: Any, sources: Sequence[str], options: dict[str, Any]
) -> Path:
    from cvt_hpc.analysis.figures import draw

    return draw(lambda: compose(name, datasets, at, sources, **options), out)


def _write_data(kind: Kind, history: Any, out: Path, source: str, options: dict[str, Any]) -> Path:
    from cvt_hpc.netcdf import write_history

    check_output(out, (".nc",))
    return write_history(function_of(kind.data)(history, source=source, **options), out)


def _animation(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.animation import check_animation, draw_animation
    from cvt_hpc.analysis.telling_apart import history_files

    (file,) = history_files([arguments.path])
    out = arguments.out or file.with_suffix(".gif")
    check_animation(out)
    with _opened([file]) as (history,):
        say(f"animation: {draw_animation(history, out, str(file))}")
    return DONE


@contextmanager
def _opened(files: Sequence[Path]) -> Iterator[list[Any]]:
    """Histories of runs, open within."""
    import xarray as xr

    with ExitStack() as stack:
        yield [
            stack.enter_context(xr.open_dataset(file, engine="netcdf4", decode_times=False)) for file in files
        ]
