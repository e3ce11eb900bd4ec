"""Labels of runs that are drawn together: what they have in common, and by what they differ."""

import json
from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.arrangement import infinity_in_words
from cvt_hpc.analysis.figures import check_known, entitle, headline
from cvt_hpc.analysis.histories import course_line, place_of, values_of
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.storage.files import kind_of

Histories = Sequence[xr.Dataset]


def named(histories: Histories, sources: Sequence[str] = ()) -> list[str]:
    """Names of runs: where they are from, or else their numbers."""
    return list(sources) or [f"history {k + 1}" for k in range(len(histories))]


def told_apart(histories: Sequence[xr.Dataset], names: Sequence[str]) -> tuple[str, list[str]]:
    """Return what the runs' points have in common, and by what each differs, with its name where need be."""
    if len(histories) == 1:
        return ", ".join(place_of(histories[0].attrs)), ["simulated"]
    places = [place_of(dataset.attrs) for dataset in histories]
    common = [part for part in places[0] if all(part in place for place in places)]
    labels = [", ".join(part for part in place if part not in common) for place in places]
    if len(set(labels)) < len(labels) or not all(labels):
        labels = [f"{name}: {label}".removesuffix(": ") for name, label in zip(names, labels, strict=True)]
    return ", ".join(common), labels


def on_axes(
    histories: Sequence[xr.Dataset], names: Sequence[str] = ()
) -> tuple[list[str], list[dict[str, str]]]:
    """Tell runs apart by models and axes of the jobs alone: common parts, and for each run text by axis.

    Runs that do not differ there are told apart by their names, under the axis "".
    """
    parts = [_axes_of(dataset) for dataset in histories]
    common = {key for key in parts[0] if len({part.get(key) for part in parts}) == 1}
    labels = [{key: text for key, text in part.items() if key not in common} for part in parts]
    if len(histories) > 1 and len({tuple(label.items()) for label in labels}) < len(labels):
        labels = [{"": name} for name in named(histories, names)]
    return [parts[0][key] for key in parts[0] if key in common and key != "model"], labels


def _axes_of(dataset: xr.Dataset) -> dict[str, str]:
    """Return by axis its value with its name, such as "load 120 N m", and the model by "model"."""
    job = json.loads(dataset.attrs.get("job", "{}"))
    axes, model = job.get("axes", {}), {"model": str(job.get("model", "")).replace("_", " ")}
    told = values_of(dataset.attrs).items()
    texts = {key: text if text != "inf" else infinity_in_words(key) for key, text in told}
    return model | {key: f"{key} {texts[key]}".replace("_", " ") for key in axes if key in texts}


def entitle_runs(
    figure: Figure, histories: Sequence[xr.Dataset], subject: str, *further: str, width: int = 76
) -> None:
    """Title of a picture of runs: subject with the names of jobs, what they have in common, further lines."""
    common, _ = on_axes(histories)
    head = headline(subject, *(dataset.attrs for dataset in histories))
    entitle(figure, [head, ", ".join(common), common_course(histories), *further], width)


def common_course(histories: Sequence[xr.Dataset]) -> str:
    """State the course that drives all runs; "" where there is none, or several."""
    lines = {course_line(dataset.attrs) for dataset in histories}
    return lines.pop() if len(lines) == 1 else ""


def check_holds(histories: Sequence[xr.Dataset], names: Sequence[str], wanted: dict[str, str]) -> None:
    """Raise InputError if a history lacks a variable; `wanted` has for each what gives it."""
    for dataset, name in zip(histories, names, strict=True):
        for key, by in wanted.items():
            if key not in dataset:
                raise mismatch(name, f"a history with {key} ({by})", "none")
            check_known(dataset, [key], name)


def history_files(paths: Sequence[Path]) -> list[Path]:
    """Files of histories; of a folder all that it keeps, those of a study in its folder `histories`.

    InputError if a file is no history, or a folder has none.
    """
    from cvt_hpc.storage.netcdf import is_history

    found: list[Path] = []
    for path in paths:
        inside = path / "histories" if (path / "histories").is_dir() else path
        files = sorted(inside.glob("*.nc")) if path.is_dir() else [path]
        if path.is_dir():
            files = [file for file in files if kind_of(file) == "a file" and is_history(file)]
        if not files or not all(map(is_history, files)):
            raise _no_history(path)
        found += files
    return found


def _no_history(path: Path) -> InputError:
    """The error for a place without histories, with what makes one or draws what is there."""
    if path.is_dir():
        found, then = "none", "a sweep keeps those of the runs that `history` in [record] of its job names"
    elif path.exists():
        found, then = "another file", "`cvt-hpc map` and `cvt-hpc plot curve` draw the results of a study"
    else:
        found, then = "nothing", f"`cvt-hpc simulate JOB --out {path}` writes one"
    return mismatch(str(path), "a history written by `cvt-hpc simulate --out`", found, then)
