"""The history of one run as a picture."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.interpolate import CubicSpline

from cvt_hpc.analysis import courses
from cvt_hpc.analysis import history_panels as panels
from cvt_hpc.analysis.conversion import standard
from cvt_hpc.analysis.figures import LONG, WIDTH, balanced, draw, entitle, headline, styled
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.uncertain import TABLE, with_samples
from cvt_hpc.job.values import JOB_UNITS, POINT_UNITS, shown
from cvt_hpc.variables import Status, Vibrates, flag_in_words, shortened
from cvt_hpc.vibration import settings as vibration_settings
from cvt_hpc.vibration.peaks import fundamental
from cvt_hpc.vibration.ramped import ramped

LONGEST_REASON = 120  # letters, in the title: one or two strands

SHOWN_PERIODS, INK = 3, "#111111"
SAMPLES = 200  # drawn in a period: harmonics have corners otherwise
LEFT, RIGHT, _WHOLE = slice(0, 2), 2, slice(0, 3)  # columns of a panel


def draw_history(dataset: xr.Dataset, out: Path) -> Path:
    """Write the figure of `history_figure`, with its errors, as `save_figure` does."""
    return draw(lambda: history_figure(dataset), out)


@styled
def history_figure(dataset: xr.Dataset, source: str = "history") -> Figure:
    """Draw the history of one run; nothing is written, and what the dataset does not hold is left out.

    Arguments as of all pictures of runs (`figures.py`), with `displacement` (time, probe) [m], `load` (time)
    [N m], `ring_tension` and `push_force` (position) [N], `contact_force` and what feeds the fluctuations
    (position) [N/m, W/m], `region` (position), and the run's verdict.
    """
    dataset = standard(dataset, source)
    title = _title(dataset)  # checks the parameters of the run
    settings, band = settings_of(dataset)
    judged = _judged_share(dataset, settings) if _is_judged(dataset) else 0.0
    strands = panels.read_strands(dataset, judged, band)
    with_spectrum = [strand for strand in strands if strand.has_spectrum]
    rows: list[tuple[float, list[tuple[Any, Callable[..., None], Any]]]] = [
        (1.6, [(LEFT, panels.draw_displacement, strand), (RIGHT, panels.draw_close_up, strand)])
        for strand in strands
    ]
    changing = [dataset[name] for name in panels.COURSES if _changes(dataset, name)]
    changing += courses.thrusts(dataset)
    if changing:
        units = {name: {JOB_UNITS: unit} for name, unit in _job_units(dataset.attrs).items()}
        told = [course.assign_attrs(units.get(str(course.name), {})) for course in changing]
        places = (LEFT, RIGHT) if len(told) < 3 else range(len(told))
        beside = zip(places, told, strict=False)
        rows.append((1.2, [(place, panels.draw_course, course) for place, course in beside]))
    rows += [(1.6, [(_WHOLE, panels.draw_group, group)]) for group in panels.groups(dataset)]
    if with_spectrum:
        rows.append((2.1, [(_WHOLE, panels.draw_spectra, with_spectrum)]))
    for height, names, draw_panel in (
        (2.0, ("ring_tension", "push_force"), panels.draw_forces),
        (1.5, ("contact_force",), panels.draw_contact),
        (1.7, ("flank_feed",), panels.draw_feed),
    ):
        if any(_is_known(dataset, name) for name in names):
            rows.append((height, [(_WHOLE, draw_panel, dataset)]))
    if not rows:
        raise mismatch(source, "displacement, load or forces of a run", "none of them")
    heights = [height for height, _ in rows]
    height = min(sum(heights) + 0.2 * title.count("\n") + 0.4, LONG)
    figure = Figure((WIDTH, height), layout="constrained")
    figure.suptitle(title)
    grid = figure.add_gridspec(len(rows), 3, height_ratios=heights)
    for i, (_, row) in enumerate(rows):
        for columns, draw_panel, what in row:
            axes = figure.add_subplot(grid[i, columns])
            draw_panel(axes, what)
            if columns == RIGHT:
                axes.xaxis.set_major_locator(MaxNLocator(2))
    return figure


@styled
def phase_figure(dataset: xr.Dataset, source: str = "history") -> Figure:
    """Draw the phase portrait of each strand: velocity over displacement where it moves most.

    The whole judged part is drawn thin, or the last half where none was judged, and its last SHOWN_PERIODS
    periods bold.

    Arguments as of all pictures of runs (`figures.py`), with `displacement` (time, probe) [m].
    """
    lines = [headline("Phase portraits", dataset.attrs), *_which(dataset.attrs)]  # checks the parameters
    settings, band = settings_of(dataset)
    judged = _judged_share(dataset, settings) if _is_judged(dataset) else 0.5
    strands = [one for one in panels.read_strands(dataset, judged, band) if one.has_spectrum]
    if not strands:
        raise mismatch(source, "the history of a run with the motion of strands in its last part", "none")
    figure = Figure((WIDTH, 3.7), layout="constrained")
    for axes, strand in zip(figure.subplots(1, len(strands), squeeze=False)[0], strands, strict=True):
        moved = strand.judged[:, strand.strongest]
        frequency, _ = fundamental(moved, strand.rate, band)
        course = CubicSpline(*_above(moved, strand.rate, band[0]))
        start, end = course.x[[0, -1]]
        times = start + np.arange(int((end - start) * frequency * SAMPLES) + 1) / (frequency * SAMPLES)
        moved, speed = course(times), 1e-3 * course(times, 1)  # [mm/s]
        last = SHOWN_PERIODS * SAMPLES + 1
        axes.plot(moved, speed, color=strand.colour, lw=0.4, alpha=0.5, rasterized=True)
        axes.plot(moved[-last:], speed[-last:], color=INK, lw=1.0)
        axes.plot(moved[-1:], speed[-1:], "o", color=INK, ms=4)
        axes.set_title(f"{strand.probes[strand.strongest]}, {frequency:.0f} Hz", loc="left", pad=3)
        axes.set(xlabel="displacement [µm]", ylabel="velocity [mm/s]")
        axes.grid(lw=0.4, alpha=0.5)
    lines.append(f"motion above {band[0]:.0f} Hz; bold: last {SHOWN_PERIODS} periods, dot: their end")
    entitle(figure, lines, 76)
    return figure


def _above(motion: np.ndarray, rate: float, lowest: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and motion (time,) above a frequency [Hz], so without turns of the pulleys.

    The ends that the filter spoils are cut.
    """
    from scipy.signal import butter, sosfiltfilt  # scipy.signal takes long to load

    faster = sosfiltfilt(butter(4, lowest, "highpass", fs=rate, output="sos"), motion)
    cut = min(round(2 * rate / lowest), motion.size // 4)
    return np.arange(cut, motion.size - cut) / rate, faster[cut:-cut]


def _changes(dataset: xr.Dataset, name: str) -> bool:
    """Whether a quantity has a history, and is not the same all along."""
    return name in dataset and "time" in dataset[name].dims and bool(np.ptp(dataset[name].values) > 0)


def _judged_share(dataset: xr.Dataset, settings: Mapping[str, float]) -> float:
    """Share of a run that is judged: of one that changes all along, what follows its start-up."""
    point = {**settings, **json.loads(dataset.attrs.get("point", "{}"))}
    point = {key: tuple(value) if isinstance(value, list) else value for key, value in point.items()}
    if "duration" in point and ramped(point):
        return 1.0 - float(point.get("rise_time", 0.0)) / float(point["duration"])
    return settings["judged_fraction"]


def _is_judged(dataset: xr.Dataset) -> bool:
    """Whether the run reached its end: one that failed or slipped through before has no judged part."""
    if "status" in dataset and int(dataset["status"]) != Status.DONE:
        return False
    return "amplitude" not in dataset or _is_known(dataset, "amplitude")


def _is_known(dataset: xr.Dataset, name: str) -> bool:
    """Whether a quantity is there and has a value: one that failed early has no judged part."""
    return name in dataset and bool(np.isfinite(dataset[name]).any())


def settings_of(dataset: xr.Dataset) -> tuple[dict[str, float], tuple[float, float]]:
    """Table [vibration] of the run's job, with what the run had of its own, else defaults; and its band."""
    declared = vibration_settings.PARAMETERS["vibration"]
    defaults = {key: parameter.default for key, parameter in declared.items()}
    own = {key: dataset.attrs[key] for key in defaults if key in dataset.attrs}
    settings = defaults | json.loads(dataset.attrs.get("job", "{}")).get("vibration", {}) | own
    low, high = vibration_settings.band(settings)
    low = float(dataset["lower_band_edge"]) if _is_known(dataset, "lower_band_edge") else low
    return settings, (low, high)


def _title(dataset: xr.Dataset) -> str:
    """Which run, and what became of it."""
    lines = [headline("One run", dataset.attrs), *_which(dataset.attrs)]
    if "rung" in dataset:
        rung = flag_in_words(dataset["rung"].item(), dataset["rung"].attrs)
        lines.append(f"decided by the {rung} run of model auto, {float(dataset['simulated_seconds']):.3g} s")
    status = Status(int(dataset["status"])) if "status" in dataset else None
    reason = dataset["reason"].item() if "reason" in dataset else ""
    reason = shortened(reason.decode() if isinstance(reason, bytes) else reason, LONGEST_REASON)
    if status is Status.DONE and "vibrates" in dataset:
        verdict = Vibrates(int(dataset["vibrates"]))
        lines.append(f"vibrates: {verdict.name.lower()}" + (f" ({reason})" if reason else ""))
    elif status is not None:
        lines.append(f"{status.name.lower().replace('_', ' ')}" + (f": {reason}" if reason else ""))
    return "\n".join(balanced(line, 76) for line in lines)


def _which(attributes: Mapping[str, Any]) -> list[str]:
    """Place of a run on the axes of its job, and the course that drives it: a line each, if there is any."""
    return [line for line in (", ".join(place_of(attributes)), course_line(attributes)) if line]


def course_line(attributes: Mapping[str, Any]) -> str:
    """State the course that drives a run, but of what stands in its place."""
    changed = courses.of_history(attributes)
    told = values_of(attributes) if changed else {}
    changed = {key: text for key, text in changed.items() if key not in told}
    return courses.line_of(changed, courses.file_of(attributes))


def place_of(attributes: Mapping[str, Any]) -> list[str]:
    """Name the place of a run by the parts of `values_of`, such as "friction gradient -0.8 s/m"."""
    return [f"{key.replace('_', ' ')} {text}" for key, text in values_of(attributes).items()]


def values_of(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return by key the values of a run on the axes of its job, and where else it departs from the job."""
    if not {"job", "point"} <= attributes.keys():
        return {}
    job, point = json.loads(attributes["job"]), json.loads(attributes["point"])
    try:
        schema = load_schema(job["model"], job["stepper"], "history")
        schema = with_samples(schema, job[TABLE]) if TABLE in job else schema
        tables = {key: value for section in schema.sections for key, value in job.get(section, {}).items()}
        # numerics that depart from the job, such as the step, are those that the program has chosen
        chosen = {*job["axes"], *schema.sections.get("numerics", {})}
        others = [key for key in point if key not in chosen and point[key] != tables.get(key)]
        # a parameter that follows from others is in no table; where a load was given there is no `load_share`
        keys = [key for key in (*job["axes"], *others) if key in point]
        units = _job_units(attributes)
        told = {key: {"units": schema.parameters[key].unit, JOB_UNITS: units.get(key, "")} for key in keys}
        changed = courses.of_history(attributes)
        return {key: changed.get(key) or shown(point[key], told[key]) for key in keys}
    except InputError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError):
        raise mismatch("history: job, point", "a job of this program and a point of it", "others") from None


def _job_units(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return by key the unit in which the job of a history gives a parameter, where it names one."""
    return json.loads(attributes.get(POINT_UNITS, "{}"))
