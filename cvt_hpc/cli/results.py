"""`status`, `gather`, `table`, `map`, `figure` and `compare`: what a run has left in its folder."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from cvt_hpc.cli import parts
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.picture_kinds import MEASURED

if TYPE_CHECKING:
    from cvt_hpc.analysis.comparison import Comparison

# Exit status of `compare`: some cells are quiet by one method, or as measured, that vibrate by the other
_CONTRADICTING = 1


def add(commands: parts.Commands) -> None:
    """Declare the commands."""
    status = parts.add_command(commands, "status", _status, "how far a study is", "DIR")
    status.add_argument("--json", action="store_true", help="for programs: one line of JSON, times in s")
    parts.add_command(commands, "gather", _gather, "write DIR/results.nc again, from the records", "DIR")
    text = "write the results as a table with a row for each run: axes, class, and what each run gave"
    text += "; of uncertain parameters also the probabilities of each cell"
    table = parts.add_command(commands, "table", _table, text, "RESULTS")
    text = "FILE.csv, or FILE.xlsx for a spreadsheet (default: table.csv beside the dataset)"
    table.add_argument("--out", type=Path, metavar="FILE", help=text)
    text = "draw where vibration occurs, or quantities over two axes"
    picture = parts.add_command(commands, "map", _map, text, "RESULTS")
    text = "further studies over the same axes: a panel for each, on one scale of colours"
    picture.add_argument("others", type=Path, nargs="*", metavar="RESULTS", help=text)
    text = "variable of the results, such as efficiency, instead of where vibration occurs; may be repeated"
    picture.add_argument("--show", action="append", default=[], metavar="QUANTITY", help=text)
    text = "default: map.png, map_QUANTITY.png or, of several studies, maps.png beside the first dataset"
    picture.add_argument("--out", type=Path, metavar="PNG", help=text)
    parts.add_assignments(picture, "--at", "fix an axis at a value")
    parts.add_sides(picture)
    _add_measured(picture)
    text = "value at which the colours end, such as '20 um', or fit: that of 98 %% of the cells (default: "
    text += "fit, but of occurrence 2 to 200 um on a logarithmic scale, as in all maps)"
    picture.add_argument("--vmax", metavar="VALUE", help=text)
    text = "draw an axis log or linear (default: log where its values are spread so); may be repeated"
    picture.add_argument("--spacing", action="append", default=[], metavar="AXIS=SPACING", help=text)
    text = "draw the figure of a paper that a study repeats, and measure what the paper says of it"
    parts.add_command(commands, "figure", _figure, text, "DIR")
    text = "write a page about a study: what was found, a map with values, failed runs, cost, assumptions"
    page = parts.add_command(commands, "report", _report, text, "RESULTS")
    page.add_argument("--out", type=Path, metavar="HTML", help="default: report.html beside the dataset")
    text = "write it again every so often, such as 30s, from the records of a running sweep, until that ends"
    page.add_argument("--every", metavar="TIME", help=text)
    text = "the same every 30 s"
    page.add_argument("--follow", dest="every", action="store_const", const="30s", help=text)
    _add_measured(page)
    text = "compare two methods or two designs, or a study with measurements, cell by cell"
    end = "; exit status 1: two methods, or computed and measured, contradict somewhere."
    compare = parts.add_command(commands, "compare", _compare, text, "RESULTS", end)
    text = "the study to compare with it, or the CSV file of a test rig: hits, misses, false alarms, silences"
    compare.add_argument("other", type=Path, metavar="RESULTS|CSV", help=text)
    folder = "folder of compare.csv and compare.png (default: that of the second study, or the only one)"
    compare.add_argument("--out", type=Path, metavar="DIR", help=folder)


def _add_measured(command: argparse.ArgumentParser) -> None:
    command.add_argument("--measured", metavar="CSV", help=MEASURED.text)


def _status(arguments: argparse.Namespace) -> None:
    from cvt_hpc.printing import status_rows
    from cvt_hpc.study import read_status
    from cvt_hpc.tables import columns

    status = read_status(arguments.path)
    parts.complain(*status.warnings)
    parts.say(*([json.dumps(asdict(status))] if arguments.json else columns(status_rows(status), indent="")))


def _gather(arguments: argparse.Namespace) -> None:
    from cvt_hpc.study import gather

    parts.say(f"results: {gather(arguments.path)}")


def _table(arguments: argparse.Namespace) -> None:
    from cvt_hpc.analysis.conversion import plain
    from cvt_hpc.analysis.run_table import FORMATS, tables, write_tables
    from cvt_hpc.study import open_results

    out = arguments.out or parts.folder_of(arguments.path) / "table.csv"
    parts.check_output(out, FORMATS)
    with open_results(arguments.path) as dataset:
        frames = tables(plain(dataset, str(arguments.path)), str(arguments.path))
    parts.say(f"table: {', '.join(map(str, write_tables(frames, out)))}")


def _map(arguments: argparse.Namespace) -> None:
    from cvt_hpc.analysis.arrangement import with_spacings
    from cvt_hpc.analysis.classes import check_results
    from cvt_hpc.job.assignments import split_assignments

    paths = [arguments.path, *arguments.others]
    source, kind = ", ".join(map(str, paths)), "maps" if arguments.others else "map"
    with ExitStack() as opened:
        datasets = [opened.enter_context(parts.opened_results(path)) for path in paths]
        for dataset, path in zip(datasets, paths, strict=True):
            check_results(dataset, str(path))
        dataset, sides = datasets[0], parts.sides_of(arguments)
        if arguments.others:
            from cvt_hpc.analysis.studies import side_by_side

            dataset, sides = side_by_side(datasets, list(map(str, paths)), arguments.show, sides)
        dataset = with_spacings(dataset, split_assignments(arguments.spacing, source, "--spacing"), source)
        at = parts.fixed_axes(arguments, dataset, source)
        from cvt_hpc.analysis.figures import draw
        from cvt_hpc.analysis.maps import has_starts, map_figure, start_line
        from cvt_hpc.analysis.value_maps import value_map_figure
        from cvt_hpc.report.findings import shown_quantities

        files = [file for path in paths for file in parts.files_of(path)]
        words = (kind, *arguments.show, *arguments.at)
        out = arguments.out or parts.picture_beside(arguments.path, files, *words)
        measured, vmax = arguments.measured, None
        shown = arguments.show or shown_quantities(dataset)
        coloured = shown[0] if shown else "amplitude"
        if coloured in dataset:  # what draws it refuses a quantity that is not known
            unit = str(dataset[coloured].attrs.get("units", ""))
            vmax = parts.colour_end(arguments.vmax, unit, fits=bool(shown))
        if shown:
            draw(lambda: value_map_figure(dataset, shown, at, source, sides, vmax, measured), out)
        else:
            draw(lambda: map_figure(dataset, at, source, sides, vmax, measured), out)
            if has_starts(dataset, at) and not arguments.others:
                parts.say(start_line(dataset, at, source))
        parts.say(f"map: {out}")


def _figure(arguments: argparse.Namespace) -> None:
    from cvt_hpc.papers.figures import figure_of, finding_lines

    picture, table, findings = figure_of(arguments.path)
    parts.say(*finding_lines(findings), f"picture: {picture}", f"table: {table}")


def _report(arguments: argparse.Namespace) -> None:
    from cvt_hpc.report import write_report

    out = arguments.out or parts.folder_of(arguments.path) / "report.html"
    parts.check_output(out, (".html",))
    if arguments.every and arguments.measured:
        raise mismatch("--every", "no --measured beside it: a running sweep is drawn alone", "both")
    if arguments.every:
        from cvt_hpc.job.units import read_duration
        from cvt_hpc.printing import status_rows
        from cvt_hpc.report.following import follow_report

        every = read_duration(arguments.every, "--every")
        parts.say(f"report: {follow_report(arguments.path, out, every, status_rows)}")
        return
    with parts.opened_results(arguments.path) as dataset:
        source, folder = str(arguments.path), parts.folder_of(arguments.path)
        parts.say(f"report: {write_report(dataset, out, source, folder, arguments.measured)}")


def _compare(arguments: argparse.Namespace) -> int:
    from cvt_hpc.analysis.comparison import compare
    from cvt_hpc.printing import comparison_lines

    sources = str(arguments.path), str(arguments.other)
    if arguments.other.suffix.lower() == ".csv":
        return _compare_measured(arguments, *sources)
    with parts.opened_results(arguments.path) as a, parts.opened_results(arguments.other) as b:
        found = compare(a, b, sources)
    written = leave_comparison(found, arguments.out or parts.folder_of(arguments.other), sources)
    parts.say(*comparison_lines(found, sources), *written)
    return _CONTRADICTING if found.contradicts.any() and not found.are_designs else parts.DONE


def _compare_measured(arguments: argparse.Namespace, source: str, path: str) -> int:
    from cvt_hpc.analysis.figures import draw
    from cvt_hpc.analysis.maps import map_figure
    from cvt_hpc.analysis.measured_score import score, score_lines, write_score

    folder = arguments.out or parts.folder_of(arguments.path)
    with parts.opened_results(arguments.path) as dataset:
        found = score(dataset, path, source)
        parts.say(*score_lines(found, source, path), f"table: {write_score(found, folder / 'compare.csv')}")
        try:
            figure = map_figure(dataset, source=source, measured=path)
        except InputError as error:  # more panels than a page holds
            parts.complain(f"no picture: {error}")
        else:
            parts.say(f"picture: {draw(lambda: figure, folder / 'compare.png')}")
    return _CONTRADICTING if found.contradicts else parts.DONE


def leave_comparison(found: Comparison, folder: Path, sources: tuple[str, str]) -> list[str]:
    """Leave table and picture of a comparison, and return the lines that say where."""
    from cvt_hpc.analysis.comparison import write_comparison
    from cvt_hpc.analysis.comparison_drawing import draw_comparison

    picture = draw_comparison(found, folder / "compare.png", sources)
    return [f"picture: {picture}", f"table: {write_comparison(found, folder / 'compare.csv')}"]
