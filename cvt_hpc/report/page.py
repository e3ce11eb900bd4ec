"""One self-contained HTML page about a study.

`next_steps` says what to do next with a study: commands and changes of its job, by what came out.
"""

import base64
import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from importlib import resources
from io import BytesIO
from itertools import islice, product
from pathlib import Path
from shlex import quote
from typing import NamedTuple

import jinja2
import numpy as np
import xarray as xr
from markupsafe import Markup
from matplotlib.figure import Figure

from cvt_hpc.analysis import courses
from cvt_hpc.analysis.arrangement import Arrangement, Fixed, Sides, arrange, known_values, value_text
from cvt_hpc.analysis.classes import at_strongest_strand, check_results, map_classes, occurrence_classes
from cvt_hpc.analysis.comparison import sample_sentences
from cvt_hpc.analysis.figures import RESOLUTION, coordinate_unit, in_words, number, with_units
from cvt_hpc.analysis.held_job import job_held
from cvt_hpc.analysis.hysteresis_bands import hysteresis_figure, within
from cvt_hpc.analysis.maps import AXIS, has_starts, map_figure
from cvt_hpc.analysis.measured import File
from cvt_hpc.analysis.measured_score import score, score_sentences
from cvt_hpc.analysis.probability import PROBABILITY, has_samples, over_samples
from cvt_hpc.analysis.probability_drawing import onset_bands_figure, sensitivity_figure
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.analysis.value_maps import WIDE, value_map_figure
from cvt_hpc.errors import InputError, escaped, mismatch, one_line
from cvt_hpc.job import Job
from cvt_hpc.job.axes import SAMPLE, SWAPPED
from cvt_hpc.job.summary import core_time_in_words, rules_in_words, value_in_words
from cvt_hpc.job.values import shown
from cvt_hpc.models.contract import load_model
from cvt_hpc.report import certainty, findings
from cvt_hpc.report.interactive import KEPT, as_script, map_data
from cvt_hpc.storage.files import written_aside
from cvt_hpc.storage.netcdf import CONTENT, HISTORY
from cvt_hpc.study.intervals import VERDICTS, look
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import DECIDED, OccurrenceClass, levels, onsets

_HAS_ENDS = re.compile("vibration (from|up to)")  # a sentence about windows
COARSE = 0.02  # of an axis: a step beyond is worth a smaller one
_RETRIES = {
    Status.FAILED_NUMERICS: "with a smaller step",
    Status.FAILED_ERROR: "once the cause is removed",
    Status.TIMED_OUT: "with a longer `--run-limit`",
}

_MOST_CHANGED = 8  # parameters named on the first page
MOST_FAILURES = 30  # kinds of failure in the table
_MOST_MAPS = 12  # of combinations of the axes that no map has room for
# What tells how well a run was computed, where its model records it
_QUALITY = ("power_residual", "step_ripple", "refinements", "time_step", "simulated_seconds", "core_seconds")


_ORIGIN = ("source", "command", "host", "versions", "git_revision", "job_fingerprint", "history")


class Picture(NamedTuple):
    """A printed map: what is fixed and what came out there, and the PNG in base64."""

    heading: str
    summary: str
    picture: str


class Progress(NamedTuple):
    """Progress of a study: names and values in words, share of the runs on record, when the page was made.

    `every` [s] is after what time a browser reads the page again; None once it is the last one.
    """

    rows: Sequence[tuple[str, str]]
    share: float
    made: str
    every: float | None


class Row(NamedTuple):
    """A parameter of the job: value in words, what it is, and whether it is other than the default."""

    key: str
    value: str
    meaning: str
    changed: bool


def write_report(
    dataset: xr.Dataset,
    out: Path,
    source: str = "results",
    folder: Path | None = None,
    measured: File = None,
    progress: Progress | None = None,
) -> Path:
    """Write the page, and return its path.

    It needs no network: the plotting library, which draws the map with the values of its cells, is in it, and
    pictures of the maps for paper and for browsers without scripts.

    Parameters
    ----------
    dataset, source
        Results of a study, of any model and earlier version, else InputError, which names the source.
    out : Path
        The page; its folder is made if needed.
    folder : Path, optional
        Folder of the study: runs that `--check-step` and `--audit` have left in it are compared with its own.
    measured : str or Path, optional
        Measured file, drawn over the maps of a grid; a sentence says how far they agree.
    progress : Progress, optional
        Heads the page. Of one that a browser reads again the map is the printed one.
    """
    check_results(dataset, source)
    if (content := str(dataset.attrs.get(CONTENT, ""))) == HISTORY:
        raise mismatch(source, "results of a study", f"the {content}; `cvt-hpc plot` draws it")
    page = _template().render(_content(dataset, source, folder, measured, progress))
    with written_aside(Path(out), parents=True) as aside:
        aside.write_text(page, encoding="utf-8")
    return Path(out)


@cache  # for pages that are written again and again
def _template() -> jinja2.Template:
    """The page, to be filled in."""
    loader = jinja2.PackageLoader("cvt_hpc.report", ".")
    templates = jinja2.Environment(loader=loader, autoescape=True, finalize=_as_it_stands)
    return templates.get_template("page.html")


def _as_it_stands(value: object) -> object:
    """Escape the characters of a text that would turn or hide what is beside them."""
    return escaped(value, KEPT) if isinstance(value, str) and not isinstance(value, Markup) else value


def _content(
    dataset: xr.Dataset, source: str, folder: Path | None, measured: File, progress: Progress | None
) -> dict[str, object]:
    attributes = {str(key): str(value) for key, value in dataset.attrs.items()}
    name, job = one_line(attributes.get("job_name", source)), job_held(dataset, source)
    own = ["run", *(axis.name for axis in job.axes)] if job else dataset["status"].dims
    joined = [str(name) for name in dataset["status"].dims if name not in own]
    if joined:  # the attributes are those of one of several studies
        job = None
    cells = over_samples(dataset)
    arrangement = _arrangement(cells, source)
    found = findings.failures(dataset)
    parameters = _parameters(job) if job else {}
    changed = [row for rows in parameters.values() for row in rows if row.changed]
    sentences: list[str] = []
    beyond: list[str] = []
    judged, x = findings.is_judged(dataset), None
    if arrangement:
        axes = [name for name in (arrangement.panel, arrangement.y) if name]
        beyond = [name for name in map(str, cells["status"].dims) if name not in (arrangement.x, *axes)]
        x = arrangement.x if dataset[arrangement.x].dtype.kind in "iuf" else None
        if PROBABILITY in cells:
            sentences = list(certainty.probability_sentences(dataset, cells, arrangement.x))
        elif judged:
            sentences = list(findings.window_sentences(dataset, arrangement.x, [*beyond, *axes]))
            sentences += filter(None, [findings.slip_sentence(dataset, arrangement.x)])
    if not judged and not sentences:
        sentences = list(findings.range_sentences(dataset))
    if measured is not None:
        sentences += score_sentences(score(dataset, measured, source))
    sentences = [*filter(None, [findings.course_sentence(job)]), *sentences] if job else sentences
    basis = [*map(_with_code, _basis(dataset, job, changed)), *_samples(dataset, folder, source)]
    is_renewed = progress is not None and progress.every is not None
    combinations = int(np.prod([dataset.sizes[name] for name in beyond]))
    return {
        "name": name,
        "description": title if (title := attributes.get("title", "")) != name else "",
        "model": f"{job.model}: {load_model(job.model).title}" if job else "",
        "axes": _axes(dataset, job),
        "joined": " and ".join(joined),
        "summary": findings.summary(dataset),
        "sentences": list(map(_with_code, sentences)),
        "ends": within(dataset[x]) if x and any(map(_HAS_ENDS.search, sentences)) else "",
        "progress": progress,
        "next_steps": [] if is_renewed else list(map(_with_code, next_steps(dataset, job, x))),
        # drawn beside the map of the browser, which has no such lines
        "has_lines": ("eigenfrequency" in dataset and "amplitude" not in dataset)
        or PROBABILITY in cells
        or measured is not None,
        "map": None if is_renewed else _map(cells, source),
        "pictures": _pictures(cells, arrangement, beyond, source, measured),
        **{
            name: _encoded(partial(draw, dataset, source=source)) if PROBABILITY in cells else ""
            for name, draw in (
                ("onset", partial(onset_bands_figure, measured=measured)),
                ("sensitivity", sensitivity_figure),
            )
        },
        "hysteresis": _encoded(lambda: hysteresis_figure(dataset, source=source)) if arrangement else "",
        "not_drawn": max(0, combinations - _MOST_MAPS),
        "beyond": " and ".join(beyond),
        "failures": found[:MOST_FAILURES],
        "failed": findings.counted(sum(one.runs for one in found), "run"),
        "cost": _cost(dataset),
        "quality": _quality(dataset),
        "basis": [] if is_renewed else basis,
        "parameters": parameters,
        "changed": changed,
        "derived": rules_in_words(job, job.schema) if job else [],
        "provenance": [(key.replace("_", " "), text) for key in _ORIGIN if (text := attributes.get(key))],
    }


def _arrangement(dataset: xr.Dataset, source: str) -> Arrangement | None:
    """Arrangement of a map of the study; None of samples and of single runs."""
    return None if is_sampled(dataset) or not dataset["status"].dims else arrange(dataset, {}, source)


def _pictures(
    dataset: xr.Dataset, arrangement: Arrangement | None, beyond: list[str], source: str, measured: File
) -> list[Picture]:
    """One printed map, or one for each of the first combinations of the axes beyond x, y and panels."""
    if arrangement is None or not beyond:
        pictures = [Picture("", "", _picture(dataset, {}, source, measured))]
    else:
        pictures = []
        if beyond == [AXIS] and has_starts(dataset, {}):
            heading = "Smallest and largest disturbance in one"
            pictures.append(Picture(heading, "", _picture(dataset, {}, source, measured)))
        sides = Sides(arrangement.x, arrangement.y, arrangement.panel)
        for place in islice(product(*(dataset[name].values.tolist() for name in beyond)), _MOST_MAPS):
            at = dict(zip(beyond, place, strict=True))
            part = arrange(dataset, at, source, sides)
            found = findings.summary(part.dataset)
            pictures.append(Picture("; ".join(part.notes), found, _picture(dataset, at, source, measured)))
    return [one for one in pictures if one.picture]


def _axes(dataset: xr.Dataset, job: Job | None) -> list[tuple[str, str, str]]:
    """Name, meaning and values of each axis, in the units of the job; of an axis that is fixed its value."""
    dims = set(dataset["status"].dims)
    names = list(dict.fromkeys([*dataset.coords, *dataset["status"].dims]))
    names = [str(name) for name in names if dims & set(dataset[name].dims)]
    if job is not None:
        counted = (SAMPLE, SWAPPED)  # by the findings
        names = [axis.name for axis in job.axes if axis.name in dataset.coords and axis.name not in counted]
    rows = []
    for name in names:
        axis = dataset[name]
        meaning = job.schema.parameters[name].description if job else str(axis.attrs.get("long_name", ""))
        if not axis.ndim:
            values = value_text(axis.expand_dims("run"), 0)
        elif is_sampled(dataset) and axis.dtype.kind in "iuf":
            ends = int(np.argmin(axis.values)), int(np.argmax(axis.values))
            values = " to ".join(value_text(axis, place) for place in ends)
        else:
            once = axis.values if axis.ndim == 1 else np.unique(axis.values)
            values = known_values(xr.DataArray(once, name=name, attrs=axis.attrs))
        rows.append((name, meaning, values))
    return rows


def _picture(dataset: xr.Dataset, at: Fixed, source: str, measured: File) -> str:
    """The printed map as a PNG in base64; "" where there is nothing to draw.

    It shows quantities where nothing was judged.
    """
    if drawn := findings.shown_quantities(dataset):
        return _encoded(lambda: value_map_figure(dataset, drawn, at, source, measured=measured))
    return _encoded(lambda: map_figure(dataset, at, source, measured=measured))


def _encoded(compose: Callable[[], Figure]) -> str:
    """A picture as a PNG in base64; "" where there is nothing to draw."""
    try:
        figure = compose()
    except InputError:
        return ""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=RESOLUTION)
    return base64.b64encode(buffer.getvalue()).decode()


def _with_code(text: str) -> Markup:
    """A text as HTML: what stands between backticks as code, numbers never parted from their units."""
    text = with_units(escaped(text, KEPT)).replace("N m", "N\u00a0m")
    parts = enumerate(text.split("`"))
    return Markup("").join(Markup("<code>{}</code>" if k % 2 else "{}").format(part) for k, part in parts)


def _map(dataset: xr.Dataset, source: str) -> dict[str, str] | None:
    """Parts of which a browser draws the map: plotting library, numbers and program; None of single runs."""
    if not dataset["status"].dims:
        return None
    from plotly.offline import get_plotlyjs  # long to load

    program = resources.files("cvt_hpc.report").joinpath("map.js").read_text(encoding="utf-8")
    return {"library": get_plotlyjs(), "numbers": as_script(map_data(dataset, source)), "program": program}


def _basis(dataset: xr.Dataset, job: Job | None, changed: Sequence[Row]) -> Iterator[str]:
    """State what the findings rest on: verdict, parameters, runs without a verdict, program."""
    if job is not None:
        if "amplitude_threshold" in job.parameters:
            least = job.parameters["amplitude_threshold"]
            factor, unit = findings.length_unit(least)
            threshold = f"{factor * least:.3g} {unit} or more (`amplitude_threshold`)"
            yield f"A run vibrates where the amplitude of a strand is {threshold}."
        driven = {courses.TIME, courses.FILE, *courses.of_job(job)}  # the findings begin with them
        rows = [row for row in changed if not (row.key in driven or row.key.endswith("_profile"))]
        told = [f"{row.key.replace('_', ' ')} {row.value}" for row in rows[:_MOST_CHANGED]]
        told += [f"{more} more"] if (more := len(rows) - _MOST_CHANGED) > 0 else []
        start = f"Other than the defaults: {', '.join(told)}. All else" if told else "All that is fixed"
        start += " but the course" if courses.of_job(job) else ""
        yield f"{start} is at its default, which is an assumption where no paper gives it."
    classes = map_classes(dataset).values
    without = [(kind, int(np.sum(classes == kind))) for kind in OccurrenceClass if kind not in DECIDED]
    if counts := ", ".join(f"{count} {kind.label}" for kind, count in without if count):
        yield f"Runs that are neither quiet nor vibrating: {counts}."
    if "source" in dataset.attrs:
        yield f"Computed by {dataset.attrs['source']}."


def _cost(dataset: xr.Dataset) -> str:
    if "core_seconds" not in dataset:
        return ""
    seconds = dataset["core_seconds"].values
    known = seconds[np.isfinite(seconds)]
    if not known.size:
        return ""
    told = f"{np.median(known):.3g} s of a core (median), {known.max():.3g} s at most"
    return f"{core_time_in_words(known.sum())} in all; a run took {told}."


def _quality(dataset: xr.Dataset) -> list[tuple[str, str, str, str, str]]:
    """Name, meaning, unit, median and largest size of what tells how well the runs were computed."""
    rows = []
    for name in _QUALITY:
        if name not in dataset:
            continue
        values = np.abs(dataset[name].values.astype(float).ravel())
        values = values[np.isfinite(values)]
        if values.size:
            attributes = dataset[name].attrs
            unit = str(attributes.get("units", "")).removeprefix("1")
            meaning = str(attributes.get("comment", attributes.get("long_name", "")))
            rows.append((name, meaning, unit, f"{np.median(values):.3g}", f"{values.max():.3g}"))
    return rows


def _samples(dataset: xr.Dataset, folder: Path | None, source: str) -> list[Markup]:
    """State what repeated runs tell; where they cannot be compared, why."""
    if folder is None:
        return []
    try:
        return list(map(_with_code, sample_sentences(dataset, folder, source)))
    except InputError as error:
        return [_with_code(f"Runs were done again, but cannot be compared: {error}.")]


def _parameters(job: Job) -> dict[str, list[Row]]:
    """Values of what neither varies nor follows, by table; the defaults are assumptions of the program.

    Files have their names, and what a course changes its range.
    """
    schema, elsewhere = job.schema, {axis.name for axis in job.axes} | {rule.key for rule in job.rules}
    told = {**job.files, **courses.of_job(job)}
    return {
        section: [
            Row(
                key,
                told.get(key) or value_in_words(schema, key, value),
                parameter.description,
                key in told or value != parameter.default,
            )
            for key, parameter in table.items()
            if key not in elsewhere
            and ((value := job.parameters.get(key)) not in (None, ()) or key in job.files)
        ]
        for section, table in schema.sections.items()
    }


def next_steps(dataset: xr.Dataset, job: Job | None, x: str | None) -> Iterator[str]:
    """Yield what to do next with a study, one sentence each, code between backticks.

    The job is None where this version does not read it, and the numeric axis x, along which windows are told,
    of samples.
    """
    status, classes = dataset["status"].values, map_classes(dataset)
    for kind, how in _RETRIES.items():
        if count := int(np.count_nonzero(status == kind)):
            runs = f"{count} runs" if count > 1 else "run"
            yield f"`cvt-hpc run JOB --retry {kind.name.lower()}` does the {runs} again, {how}."
    missing = (classes == OccurrenceClass.NOT_RUN).values
    if "first_samples" in (design := job.design if job is not None else {}):  # those that its cells want
        of_samples = classes.transpose(..., SAMPLE).values
        wanted = look(of_samples, design).wanted[..., np.newaxis]
        missing = (of_samples == OccurrenceClass.NOT_RUN) & (np.arange(dataset.sizes[SAMPLE]) < wanted)
    if "inferred_class" not in dataset and (left := int(missing.sum())):
        yield f"`cvt-hpc run JOB` goes on: {left} {'runs are' if left > 1 else 'run is'} left."
    undecided = int(np.sum(occurrence_classes(dataset) == OccurrenceClass.UNDECIDED))
    has_transient = job is not None and load_model(job.model).default_stepper is not None
    if has_transient and undecided:
        runs = "The undecided run was" if undecided == 1 else f"The {undecided} undecided runs were"
        yield f"{runs} too short to tell: a larger `longest_duration` in [run] may decide more."
    if has_samples(dataset):
        ended = (classes != OccurrenceClass.NOT_RUN).sum(SAMPLE)
        open_ = ((classes != OccurrenceClass.NOT_RUN) & ~classes.isin(VERDICTS)).sum(SAMPLE) / ended
        widest = design.get("widest_interval", WIDE)
        if count := int((stuck := open_ > widest).sum()):
            where = "In a cell" if count == 1 else f"In {count} cells"
            share = f"more than {100 * widest:.3g} % of the samples have no verdict"
            yield f"{where} {share}: no further samples narrow such intervals."
        wanting = ended >= dataset.sizes[SAMPLE] if "first_samples" in design else True
        if (~stuck & wanting).any():
            command = f"cvt-hpc run JOB --set uncertain.samples={2 * dataset.sizes[SAMPLE]}"
            yield f"`{command}` narrows the intervals by new samples alone."
    elif x is not None and x in classes.dims and dataset[x].dtype.kind in "iuf":
        yield from _along(dataset[x], classes)
    vibrating = (classes == OccurrenceClass.VIBRATING) & (dataset["status"] == Status.DONE)
    if has_transient and vibrating.any() and "run" not in classes.dims:
        sizes = np.where(vibrating, at_strongest_strand(dataset, "amplitude"), -1.0)
        places = np.unravel_index(int(np.nanargmax(sizes)), sizes.shape)
        at = (
            "--at " + quote(f"{name}={shown(dataset[name].values.tolist()[place], dataset[name].attrs)}")
            for name, place in zip(map(str, classes.dims), places, strict=True)
        )
        feeds = "; then `cvt-hpc plot energy run.nc` what feeds it" if "flank_fed" in dataset else ""
        command = f"cvt-hpc simulate JOB {' '.join(at)} --out run.nc --plot run.png"
        yield f"`{command}` shows the run that vibrates most{feeds}."


def _along(axis: xr.DataArray, classes: xr.DataArray) -> Iterator[str]:
    """State how far windows reach along an axis, and how well their ends are known."""
    classes = classes.sortby(str(axis.name)).transpose(..., str(axis.name))
    axis = axis.sortby(str(axis.name))
    values, name = axis.values.astype(float), in_words(axis)
    if np.count_nonzero(np.isfinite(values)) < 2:
        return
    rows = levels(classes.values).reshape(-1, values.size)
    for place, side in ((-1, "largest"), (0, "smallest")):
        if (count := int(np.sum(rows[:, place] > 0.0))) and np.isfinite(values[place]):
            lines = "a line" if count == 1 else f"{count} lines"
            value = value_text(axis, place)
            yield f"Vibration reaches the {side} {name}, {value}, in {lines}: go further there."
    ends = sorted({one.load for row in rows for one in onsets(values, row) if np.isfinite(one.load)})
    steps = np.diff(values[np.isfinite(values)])
    if ends and steps.max() > COARSE * steps.sum():
        factor, unit = coordinate_unit(axis.attrs)
        behind = f" {unit}" if unit else ""
        low, high, step = (number(factor * value, ".4g") for value in (ends[0], ends[-1], steps.max()))
        between = f"near {low}" if low == high else f"between {low} and {high}"
        closer = f"Steps of {name} below {step}{behind} {between}{behind}"
        yield f"{closer} would tell better where windows begin and end."
