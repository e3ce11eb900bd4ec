"""`plot`: pictures of results beside the map, each by its kind; `picture_kinds.py` declares them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvt_hpc.cli import parts
from cvt_hpc.errors import InputError
from cvt_hpc.picture_kinds import END, HISTORIES, KINDS, RESULTS, Kind
from cvt_hpc.storage.files import StorageError

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.job.values import Point

Options = dict[str, Any]  # of a picture, as they are given


def add(commands: parts.Commands) -> None:
    """Declare the command."""
    plot = commands.add_parser("plot", help="draw spectra, curves or forces", description="Draw results.")
    kinds = plot.add_subparsers(metavar="KIND", required=True)
    for name, kind in KINDS.items():
        _add_kind(kinds, name, kind)
    text = "the belt in the last periods of a run, magnified, as a moving picture"
    animation = parts.add_command(kinds, "animation", _animation, text, HISTORIES)
    text = "FILE.gif, or FILE.mp4 where there is ffmpeg (default: HISTORY_animation.gif beside the dataset)"
    animation.add_argument("--out", type=Path, metavar="GIF", help=text)


def _add_kind(kinds: parts.Commands, name: str, kind: Kind) -> None:
    subject = RESULTS if kind.subject == RESULTS else HISTORIES
    command = parts.add_command(kinds, name, _draw, kind.text, subject)
    command.set_defaults(kind=name)
    for option in kind.options:
        place: dict[str, Any] = {"dest": option.key} if option.flag else {}
        command.add_argument(option.flag or option.key, help=option.text, **place, **option.settings)
    if kind.subject == HISTORIES:
        command.add_argument("others", nargs="*", type=Path, metavar="HISTORY", help="further runs")
    if kind.data:
        text = "what the picture shows, as a dataset; of several runs with the name of each"
        command.add_argument("--data", type=Path, metavar="FILE.nc", help=text)
    named = "".join(f"_{option.key.upper()}" for option in kind.options if option.is_named)
    text = f"default: {'' if kind.subject == RESULTS else 'HISTORY_'}{name}{named}.png beside the dataset"
    command.add_argument("--out", type=Path, metavar="PNG", help=text)
    parts.add_sides(command, kind.sides)
    if kind.subject == RESULTS:
        parts.add_assignments(command, "--at", "fix an axis at a value")


def _draw(arguments: argparse.Namespace) -> int:
    name, kind = arguments.kind, KINDS[arguments.kind]
    keys = *(option.key for option in kind.options), *kind.sides
    options = {key: value for key in keys if (value := getattr(arguments, key)) not in (None, [])}
    named = [options[option.key] for option in kind.options if option.is_named and option.key in options]
    words = [name, *(word for value in named for word in ([value] if isinstance(value, str) else value))]
    parts.check_output(arguments.out, parts.PICTURES)
    if kind.subject in (RESULTS, HISTORIES):
        (_draw_results if kind.subject == RESULTS else _draw_together)(arguments, words, options)
        return parts.DONE
    data = getattr(arguments, "data", None)
    parts.check_output(data, (".nc",))

    def beside(file: Path) -> Path:
        return parts.picture_beside(arguments.path, [file], *words)

    def write(history: xr.Dataset, out: Path, source: str, of_several: str) -> list[str]:
        written = [f"picture: {_write(name, [history], out, None, [source], options)}"]
        if data:
            from cvt_hpc.picture_kinds import function_of
            from cvt_hpc.storage.netcdf import write_history

            shown = function_of(kind.data)(history, source=source, **options)
            written.append(f"data: {write_history(shown, data.with_stem(data.stem + of_several))}")
        return written

    return _each(arguments, beside, write)


def _draw_results(arguments: argparse.Namespace, words: Sequence[str], options: Options) -> None:
    source = str(arguments.path)
    files = parts.files_of(arguments.path)
    out = arguments.out or parts.picture_beside(arguments.path, files, *words, *arguments.at)
    with parts.opened_results(arguments.path) as dataset:
        at = parts.fixed_axes(arguments, dataset, source)
        parts.say(f"picture: {_write(arguments.kind, [dataset], out, at, [source], options)}")


def _draw_together(arguments: argparse.Namespace, words: Sequence[str], options: Options) -> None:
    from cvt_hpc.analysis.telling_apart import history_files

    files = history_files([arguments.path, *arguments.others])
    names = [file.stem for file in files]
    out = arguments.out or parts.picture_beside(arguments.path, files, *words)
    with parts.opened_histories(files) as histories:
        parts.say(f"picture: {_write(arguments.kind, histories, out, None, names, options)}")


def _write(
    name: str, datasets: list[xr.Dataset], out: Path, at: Point | None, sources: list[str], options: Options
) -> Path:
    from cvt_hpc.analysis.figures import draw
    from cvt_hpc.picture_kinds import compose

    if END in options:
        shown = datasets[0].get(options.get("of"))  # else the motion of a strand
        unit = "m" if shown is None else str(shown.attrs.get("units", ""))
        options = options | {END: parts.colour_end(options[END], unit)}
    return draw(lambda: compose(name, datasets, at, sources, **options), out)


def _animation(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.animation import check_animation, draw_animation

    def write(history: xr.Dataset, out: Path, source: str, _: str) -> list[str]:
        return [f"animation: {draw_animation(history, out, source)}"]

    check_animation(arguments.out or Path("belt.gif"))

    def beside(file: Path) -> Path:
        return parts.picture_beside(arguments.path, [file], "animation").with_suffix(".gif")

    return _each(arguments, beside, write)


def _each(
    arguments: argparse.Namespace,
    beside: Callable[[Path], Path],
    write: Callable[[xr.Dataset, Path, str, str], list[str]],
) -> int:
    """Write a picture of each history that is given, one by one; of several the others of one that has none.

    Parameters
    ----------
    beside : callable
        Where the picture of a file goes, with the name of the run.
    write : callable
        Draws a history to a place, given its source and what tells it from several, and tells in lines what
        was written.
    """
    from cvt_hpc.analysis.telling_apart import history_files

    files, status = history_files([arguments.path]), parts.DONE
    for file in files:
        of_several = f"_{file.stem}" if len(files) > 1 else ""
        out = arguments.out
        out = beside(file) if out is None else out.with_stem(out.stem + of_several)
        try:
            with parts.opened_histories([file]) as (history,):
                parts.say(*write(history, out, str(file), of_several))
        except StorageError:
            raise
        except InputError as error:
            if len(files) == 1:
                raise
            parts.complain(str(error))
            status = parts.SOME_FAILED
    return status
