"""`cvt-hpc calibrate`: uncertain parameters of a job, as far as measured noise tells them.

The job's samples are the candidates, drawn from the distributions that [uncertain] states beforehand. Each
is weighed by how well its runs agree with a measured file, by

    ln L = -n c - m ln(2 (1 - p)) - min(h c, h'),    c = ln((1 - p) / p),
    h' = mean((df / s_f)^2) / 2 + (mean ln q / ln 2)^2 / 2,    of onsets  -sum((do / s_o)^2) / 2,

n counting misses and false alarms, m cells without a verdict, which are as likely as not, h hits, and p being
the share of cells that may be judged otherwise by model or rig (`doubt`); df and q are errors of the
frequencies and ratios of the amplitudes of hits, s_f is `scatter`; do are errors of onsets, s_o their
standard errors (`measured_score`). Errors of frequency and amplitude are alike in neighbouring cells: they
count as one measurement each, amplitudes within a factor of two, as a rig measures at another place, and cost
no more together than misses in place of all hits.

Weights are samples of the posterior distribution. A measurement of noise or silence at a further cell tells
most where its outcome is most open, by the mutual information between outcome and sample.
"""

import json
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cvt_hpc.analysis.arrangement import value_text
from cvt_hpc.analysis.classes import OccurrenceClass, map_classes
from cvt_hpc.analysis.figures import WIDTH, axis_label, coordinate_unit, draw
from cvt_hpc.analysis.measured import ONSET, Measured, read_measured
from cvt_hpc.analysis.measured_score import Line, Score, joined, score
from cvt_hpc.analysis.sensitivity import independent
from cvt_hpc.errors import JobWarning, mismatch
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.experiments.sweeps import Sweep, load_sweep, run_sweeps, sweep_lines
from cvt_hpc.experiments.uncertain_lines import Scattered, given, uncertain_lines
from cvt_hpc.job import Job
from cvt_hpc.job.assignments import Assignments
from cvt_hpc.job.axes import SAMPLE, SWAPPED
from cvt_hpc.job.loading import load_job
from cvt_hpc.job.uncertain import Distribution, Scatter
from cvt_hpc.job.values import heading, read_value
from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.storage.files import read_regular, storage_error, write_rows, written_aside
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study import process_rank
from cvt_hpc.study.status import STALLED
from cvt_hpc.tables import columns, number, short

STUDY = "samples"
FEWEST = 8.0  # effective samples, below which the posterior is not told
BAND = (0.025, 0.5, 0.975)  # quantiles
ALIKE = 0.5  # rank correlation from which on two parameters are not told apart
TOLD = 0.9  # of the band before: a parameter whose band is hardly narrower keeps its distribution
LEAST_BIT = 0.01  # that a further measurement has to tell
_FACTOR = np.log(2.0)  # of amplitudes
_LARGEST_FILE = 2**20
_DOUBT = Parameter(0.05, "", "", minimum=0.0, maximum=0.5, exclusive=True)
_SCATTER = positive(20.0, "Hz", "")

Array = NDArray[np.float64]


class Calibration(NamedTuple):
    """What is asked.

    Attributes
    ----------
    job : Job
        With uncertain parameters.
    measured : Path
        The measured file.
    doubt : float
        Share of cells that may be judged otherwise [1].
    scatter : float
        Standard error of frequencies [Hz].
    rungs : tuple of Sweep
        The one study of the samples.
    """

    job: Job
    measured: Path
    doubt: float
    scatter: float
    rungs: tuple[Sweep, ...]


class Posterior(NamedTuple):
    """Samples, weighed by a measurement.

    Attributes
    ----------
    dataset : Dataset
        Results of the study, over `sample`.
    measured : Measured
        What was measured.
    distributions : tuple of Distribution
        The uncertain parameters beforehand.
    values : (parameter, sample) array
        Their values [SI].
    lines : list of Line
        Agreement of each sample.
    log_likelihood, weights : (sample,) arrays
        ln L, and the weights, whose sum is 1.
    """

    dataset: xr.Dataset
    measured: Measured
    distributions: tuple[Distribution, ...]
    values: Array
    lines: list[Line]
    log_likelihood: Array
    weights: Array

    @property
    def best(self) -> Line:
        """Agreement of the likeliest sample."""
        return self.lines[int(np.argmax(self.log_likelihood))]

    def fault(self, doubt: float) -> str:
        """Why the weights state nothing of the parameters; "" where they do."""
        noise = (self.best.hits + self.best.misses) * np.log((1.0 - doubt) / doubt)
        if -self.log_likelihood.max() > 0.5 * max(noise, 1.0):
            return "no sample agrees with the file: state other distributions, or more doubt"
        if self.effective < FEWEST:
            return f"fewer than {FEWEST:.0f} effective samples, too few to state the parameters: take more"
        return ""

    @property
    def effective(self) -> float:
        """Effective number of samples."""
        return float(1.0 / (self.weights**2).sum())

    def bands(self) -> tuple[Array, Array]:
        """Quantiles BAND of each parameter before and after the measurement, (parameter, 3) each [SI]."""
        even = np.full_like(self.weights, 1.0 / self.weights.size)
        before, after = (np.array([_quantiles(row, w) for row in self.values]) for w in (even, self.weights))
        return before, after

    def correlation(self) -> Array:
        """Rank correlations of the parameters after the measurement, (parameter, parameter)."""
        ranks = self.values.argsort(axis=1).argsort(axis=1).astype(float)
        spread = np.cov(ranks, aweights=self.weights, ddof=0).reshape(len(ranks), -1)
        size = np.sqrt(np.diag(spread))
        found: Array = spread / np.outer(size, size)
        return found

    def probability(self) -> xr.DataArray:
        """Probability of vibration of each cell after the measurement, over the axes of the grid [1]."""
        classes = map_classes(self.dataset).compute()
        weights = xr.DataArray(self.weights, dims=SAMPLE)
        yes, no = (
            (weights * (classes == kind)).sum(SAMPLE)
            for kind in (OccurrenceClass.VIBRATING, OccurrenceClass.QUIET)
        )
        return (yes / (yes + no).where(yes + no > 0.0)).assign_attrs(units="1", long_name="probability")


def load(
    path: str | Path,
    overrides: Assignments = (),
    measured: str | None = None,
    doubt: str | None = None,
    scatter: str | None = None,
) -> Calibration:
    """Read a job, and return the runs by which a measured file tells its uncertain parameters.

    Parameters
    ----------
    path, overrides
        As `load_job` takes them.
    measured : str
        A file as `analysis.measured.read_measured` takes it.
    doubt, scatter : str, optional
        Share of cells that may be judged otherwise; standard error of frequencies with its unit.

    Raises
    ------
    InputError
        If the job is not legal or has no samples, or there is no measured file.
    """
    job = load_job(path, overrides)
    if SAMPLE not in {axis.name for axis in job.axes} or not _distributions(job):
        raise mismatch(f"{job.source}: [uncertain]", "samples of uncertain parameters", "none")
    if job.design.get("kind") == "adaptive":
        raise mismatch(f"{job.source}: [design]", "as many samples in each cell", "adaptive")
    if not {axis.name for axis in job.axes} - {SAMPLE, SWAPPED}:
        raise mismatch(
            f"{job.source}: [axes]", "an axis along which noise was measured, such as load", "none"
        )
    if measured is None:
        raise mismatch("--measured", "a file with measured noise", "nothing")
    try:
        read_regular(Path(measured), _LARGEST_FILE)
    except (OSError, ValueError) as error:
        raise storage_error(Path(measured), error) from None
    shares = {
        name: default.default if told is None else read_value(default, told, f"--{name}")
        for name, told, default in (("doubt", doubt, _DOUBT), ("scatter", scatter, _SCATTER))
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", JobWarning)  # comes once the runs are there
        along = read_measured(measured, _without_runs(job), job.source).along
    if along not in {axis.name for axis in job.axes}:
        raise mismatch(f"{job.source}: [axes]", f"the axis {along}, as in {measured}", "none of this name")
    return Calibration(job, Path(measured), **shares, rungs=(Sweep(STUDY, (), job),))


def _without_runs(job: Job) -> xr.Dataset:
    """Results of a job before its first run: axes alone, for what a measured file is checked by."""
    known = job.schema.parameters
    units = {axis.name: known[axis.name].unit if axis.name in known else "" for axis in job.axes}
    axes = {axis.name: (axis.name, np.array(axis.values), {"units": units[axis.name]}) for axis in job.axes}
    status = [axis.name for axis in job.axes], np.zeros(job.shape, np.int8)
    return xr.Dataset({"status": status}, axes, {"job": json.dumps(job.resolved())})


def _distributions(job: Job) -> tuple[Distribution, ...]:
    found = (rule.source for rule in job.rules if isinstance(rule.source, Scatter))
    return tuple(one.uncertain.distributions[one.place] for one in found)


def plan_lines(asked: Calibration, out: Path) -> Iterator[str]:
    """Yield the lines that state the runs and their expected cost."""
    names = ", ".join(one.key for one in _distributions(asked.job))
    yield f"calibrate {asked.job.name} ({asked.job.source}) by {asked.measured}: {names}"
    yield from sweep_lines(asked.rungs, {}, out)


def make(asked: Calibration, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Do the runs, weigh the samples, and write tables and picture; see `experiment_kinds`.

    Raises
    ------
    InputError
        If a folder holds another job, the measured file does not fit, or the system refuses a file.
    """
    status = run_sweeps(asked.rungs, {}, out, fresh=fresh, tell=tell)
    if status >= STALLED or process_rank() != 0:
        return Outcome(status=status)
    found = weigh(asked, load_sweep(STUDY, out))
    files = [("table", _write_table(found, out / "calibrated.csv"))]
    for name in ("calibrated.toml", "calibrated.png"):
        (out / name).unlink(missing_ok=True)
    if not (fault := found.fault(asked.doubt)):
        files.append(("job", _write_part(asked, found, out / "calibrated.toml")))
        files.append(("picture", draw(partial(_figure, found), out / "calibrated.png")))
    return Outcome(tuple(_lines(asked, found)), tuple(files), max(status, int(bool(fault))))


def weigh(asked: Calibration, dataset: xr.Dataset) -> Posterior:
    """Weigh the samples of a study by a measured file.

    Raises
    ------
    InputError
        If the file does not fit the study.
    """
    dataset = independent(dataset).load()
    # both sets of samples, where there are runs for Sobol indices
    dataset = dataset.assign_coords({SAMPLE: np.arange(dataset.sizes[SAMPLE])})
    agreement = score(dataset, asked.measured, STUDY)
    lines = _by_sample(agreement, dataset)
    if not sum(agreement.total[:4]):
        raise mismatch(f"{asked.measured}", "cells in its range of which a run is decided", "none")
    values = np.array([_log_likelihood(one, agreement.measured.kind, asked) for one in lines])
    weights = np.exp(values - values.max())
    distributions = _distributions(asked.job)
    parameters = np.array([dataset[one.key].values for one in distributions], float)
    return Posterior(
        dataset, agreement.measured, distributions, parameters, lines, values, weights / weights.sum()
    )


def _by_sample(agreement: Score, dataset: xr.Dataset) -> list[Line]:
    """Agreement of each sample, along all its lines."""
    place = agreement.names.index(SAMPLE)
    found: dict[str, list[Line]] = {value_text(dataset[SAMPLE], k): [] for k in range(dataset.sizes[SAMPLE])}
    for values, line in agreement.lines:
        found[values[place]].append(line)
    return [joined(own) for own in found.values()]


def _log_likelihood(line: Line, kind: str, asked: Calibration) -> float:
    each = np.log((1.0 - asked.doubt) / asked.doubt)
    found = -(line.misses + line.false_alarms) * each - line.neither * np.log(2.0 * (1.0 - asked.doubt))
    of_hits = 0.0
    if line.frequency:
        of_hits += 0.5 * float(np.mean((np.array(line.frequency) / asked.scatter) ** 2))
    if line.amplitude:
        of_hits += 0.5 * (float(np.mean(np.log(line.amplitude))) / _FACTOR) ** 2
    found -= min(of_hits, line.hits * each)
    if kind == ONSET:
        found -= 0.5 * float(np.sum((np.array(line.onset) / np.array(line.standard)) ** 2))
    return float(found)


def _quantiles(values: Array, weights: Array) -> Array:
    """Quantiles BAND of weighed samples (n,)."""
    order = np.argsort(values)
    shares = np.cumsum(weights[order]) - 0.5 * weights[order]
    found: Array = np.interp(BAND, shares, values[order])
    return found


def information(asked: Calibration, found: Posterior) -> xr.DataArray:
    """What noise or silence, measured in one cell more, tells of the samples [bit], over the grid."""

    def entropy(share: Any) -> Any:
        p = np.clip(share, 1e-12, 1.0 - 1e-12)
        return -(p * np.log2(p) + (1.0 - p) * np.log2(1.0 - p))

    p = found.probability()
    return entropy(p * (1.0 - asked.doubt) + (1.0 - p) * asked.doubt) - entropy(asked.doubt)


def _lines(asked: Calibration, found: Posterior) -> Iterator[str]:
    """Yield the lines that state the result."""
    best = found.best
    yield (
        f"{found.values.shape[1]} samples weighed by {found.measured.name}, {found.effective:.0f} effective; "
        f"best: {best.hits} hits, {best.silences} silences, {best.misses} misses, "
        f"{best.false_alarms} false alarms"
    )
    if fault := found.fault(asked.doubt):
        yield fault
        return
    rows = [
        ["parameter", "unit", "before: 2.5 %", "50 %", "97.5 %", "after: 2.5 %", "50 %", "97.5 %", "width"]
    ]
    before, after = found.bands()
    for one, low, high in zip(found.distributions, before, after, strict=True):
        factor, unit = coordinate_unit(found.dataset[one.key].attrs)
        numbers = [short(factor * value) for value in (*low, *high)]
        rows.append([one.key, unit or "1", *numbers, f"{np.ptp(high) / np.ptp(low):.2f}"])
    yield from columns(rows)
    yield "width: of the 95 % band after the measurement over that before; 1: the file tells nothing"
    correlation, names = found.correlation(), [one.key for one in found.distributions]
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        if abs(correlation[i, j]) >= ALIKE:
            yield f"not told apart: {names[i]} and {names[j]}, rank correlation {correlation[i, j]:.2f}"
    bits = information(asked, found).transpose(*_grid(found))
    bits = bits.where(~_measured_cells(found).transpose(*_grid(found)), -np.inf).fillna(-np.inf)
    k = np.unravel_index(int(np.argmax(bits.values)), bits.shape)
    if bits.values[k] < LEAST_BIT:
        yield "no cell beyond the measured range would tell more"
        return
    axes = [found.dataset[name] for name in _grid(found)]
    told = (f"{axis.name} {value_text(axis, int(n))}" for axis, n in zip(axes, k, strict=True))
    chance = float(found.probability().transpose(*_grid(found)).values[k])
    odds = f"which vibrates with a probability of {chance:.2f}: {bits.values[k]:.2f} bit"
    yield f"measure next: {', '.join(told)}, {odds}"


def _measured_cells(found: Posterior) -> xr.DataArray:
    """Whether a cell of the grid lies in the measured range, or has an onset or a peak."""
    grid = found.dataset["status"].isel({SAMPLE: 0}, drop=True)
    known, loads = xr.zeros_like(grid, bool), found.dataset[found.measured.along]
    for row in found.measured.rows:
        span = row.swept if np.isfinite(row.swept).all() else row.span
        inside = (loads >= span[0]) & (loads <= span[1]) | (loads == row.cell)
        for name, value in row.at.items():
            inside = inside & (found.dataset[name] == value)
        known = known | inside
    return known


def _grid(found: Posterior) -> list[str]:
    return [str(name) for name in found.dataset["status"].dims if name != SAMPLE]


def _write_table(found: Posterior, path: Path) -> Path:
    keys = [one.key for one in found.distributions]
    head = [SAMPLE, *(heading(key, found.dataset[key].attrs) for key in keys)]
    head += ["hits", "misses", "false_alarms", "correct_silences", "neither", "log_likelihood", "weight"]
    factors = [coordinate_unit(found.dataset[key].attrs)[0] for key in keys]
    rows = (
        [
            str(k),
            *(number(factor * value) for factor, value in zip(factors, found.values[:, k], strict=True)),
            *map(str, line[:5]),
            number(found.log_likelihood[k], 6),
            number(found.weights[k], 6),
        ]
        for k, line in enumerate(found.lines)
    )
    return write_rows(path, head, rows, origin_lines(found.dataset.attrs))


def _write_part(asked: Calibration, found: Posterior, path: Path) -> Path:
    """Write the table [uncertain] of a job that goes on from here."""
    parameters, told, kept = [], [], []
    before, after = found.bands()
    for k, one in enumerate(found.distributions):
        has, unit = dict(one.numbers), asked.job.schema.parameters[one.key].unit
        width, moved = np.ptp(before[k]), abs(after[k, 1] - before[k, 1])
        if np.ptp(after[k]) >= TOLD * width and moved <= (1.0 - TOLD) * width:
            numbers = ", ".join(f"{name} = {given(value, unit)}" for name, value in one.numbers)
            told_before = f'{{ distribution = "{one.kind}", {numbers} }}'
            kept.append(f"{one.key} = {told_before} # as before: the file hardly tells of it")
            continue
        limits = has.get("from", -np.inf), has.get("to", np.inf)
        parameters.append(Scattered(one.key, unit, one.kind == "log_normal", *limits))
        told.append(np.log(found.values[k]) if one.kind == "log_normal" else found.values[k])
    logs = np.array(told).reshape(len(told), -1)
    spread = np.cov(logs, aweights=found.weights, ddof=0) if told else np.empty(0)
    covariance = spread.reshape(len(told), -1)
    mean = logs @ found.weights if told else np.empty(0)
    lines = uncertain_lines(parameters, mean, covariance, f"by {found.measured.name}")
    lines[2:2] = kept
    with written_aside(path) as aside:
        aside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _figure(found: Posterior) -> Figure:
    """Each parameter before and after, and the probability of vibration along the measured axis."""
    count = len(found.distributions)
    rows = -(-count // 3)
    figure = Figure((WIDTH, 2.3 * rows + 2.6), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(2.3 * rows, 2.6))
    panels = upper.subplots(rows, min(count, 3), squeeze=False)
    for axes, one, values in zip(panels.flat, found.distributions, found.values, strict=False):
        array = found.dataset[one.key]
        factor, unit = coordinate_unit(array.attrs)
        bins = np.linspace(factor * values.min(), factor * values.max(), 13)
        axes.hist(factor * values, bins, density=True, color="0.8", label="before")
        after = {"color": "#0072b2", "lw": 1.6, "histtype": "step", "label": "after"}
        axes.hist(factor * values, bins, weights=found.weights, density=True, **after)
        axes.set_xlabel(axis_label(array, unit))
        axes.set_yticks([])
    for axes in list(panels.flat)[count:]:
        axes.set_axis_off()
    panels[0, 0].set_ylabel("density")
    panels[0, 0].legend(frameon=False, fontsize=8)
    _draw_probability(lower.subplots(), found)
    return figure


def _draw_probability(axes: Any, found: Posterior) -> None:
    along = found.measured.along
    factor, unit = coordinate_unit(found.dataset[along].attrs)
    places = factor * found.dataset[along].values
    even = found._replace(weights=np.full_like(found.weights, 1.0 / found.weights.size))
    for one, style in ((even, {"color": "0.5", "ls": "--"}), (found, {"color": "#0072b2"})):
        shown = one.probability().transpose(..., along)
        for k, line in enumerate(shown.values.reshape(-1, shown.sizes[along])):
            label = ("before" if one is even else "after") if k == 0 else None
            axes.plot(places, line, marker=".", lw=1.4, label=label, **style)
    ends = np.array([places.min(), places.max()])
    named: str | None = "measured"
    for row in found.measured.rows:
        low, high = (factor * value for value in row.span)
        if low < high and low < ends[1] and high > ends[0]:
            axes.axvspan(*np.clip([low, high], *ends), color="#e69f00", alpha=0.25, lw=0, label=named)
        elif np.isfinite(row.cell) and ends[0] <= low <= ends[1]:
            axes.axvline(low, color="#e69f00", lw=1.6, ls="-.", label=named)
        else:  # a row of silence, or beyond the axis
            continue
        named = None
    axes.set(
        xlabel=axis_label(found.dataset[along], unit), ylabel="probability of vibration", ylim=(-0.03, 1.03)
    )
    others = ", ".join(name.replace("_", " ") for name in _grid(found) if name != along)
    title = f"a line for each {others}" if others else None
    axes.legend(frameon=False, fontsize=8, title=title, title_fontsize=8)
