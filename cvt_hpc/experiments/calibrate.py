"""`cvt-hpc calibrate`: uncertain parameters of a job, as far as measured noise tells them.

The job's samples are the candidates, drawn from the distributions that [uncertain] states beforehand. Each
is weighed by how well its runs agree with a measured file, by

    ln L = -n c - m ln(2 (1 - p)) - min(h c, h'),    c = ln((1 - p) / p),
    h' = mean((df / s_f)^2) / 2 + (mean ln q / ln 2)^2 / 2,

and, of a file of onsets, -sum((do / s_o)^2) / 2 in addition;
n counting misses and false alarms, m cells without a verdict, which are as likely as not, h hits, and p being
the share of cells that may be judged otherwise by model or rig (`doubt`); df and q are errors of the
frequencies and ratios of the amplitudes of hits, s_f is `scatter`; do are errors of onsets, s_o their
standard errors (`measured_score`). Errors of frequency and amplitude are alike in neighbouring cells: they
count as one measurement each, amplitudes within a factor of two, as a rig measures at another place, and cost
no more together than misses in place of all hits.

Weights are samples of the posterior distribution. A measurement of noise or silence at a further cell tells
most where its outcome is most open, by the mutual information between outcome and sample.

What a file tells of parameters together may be much more than of each: of a combination c z of their normal
scores z, whose covariance C is R before the measurement, most where c C c / c R c is least. So few samples
seem to lie closer together than they do along a c that is found from them: each counts by the c of the others
(leave one out).
"""

import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cvt_hpc.analysis.arrangement import value_text
from cvt_hpc.analysis.classes import OccurrenceClass, map_classes
from cvt_hpc.analysis.figures import COLOURS, WIDTH, axis_label, coordinate_unit, draw
from cvt_hpc.analysis.measured import ONSET, WINDOW, Measured, Overlay, Side, read_measured, side_of, within
from cvt_hpc.analysis.measured_score import COUNTS, Line, joined, score
from cvt_hpc.analysis.sensitivity import independent
from cvt_hpc.errors import HeldError, InputError, JobWarning, mismatch
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.experiments.sweeps import Sweep, load_sweep, run_sweeps, sweep_lines
from cvt_hpc.experiments.uncertain_lines import (
    correlated_groups,
    nearest_distribution,
    shares_of,
    uncertain_lines,
)
from cvt_hpc.job import Job
from cvt_hpc.job.assignments import Assignments
from cvt_hpc.job.axes import SAMPLE, SWAPPED
from cvt_hpc.job.loading import load_job
from cvt_hpc.job.uncertain import OUTERMOST, Distribution, Scatter, Uncertain
from cvt_hpc.job.values import heading, read_value
from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.storage.files import write_rows, written_aside
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study import check_start, process_rank
from cvt_hpc.study.status import STALLED, find_records
from cvt_hpc.tables import columns, number, short

STUDY = "samples"
FEWEST = 8.0  # effective samples, below which the posterior is not told
BAND = np.array([0.025, 0.5, 0.975])  # quantiles
ALIKE = 0.5  # rank correlation from which on two parameters are not told apart
TOLD = 0.9  # of the band before: a parameter whose band is hardly narrower keeps its distribution
_HALF = 0.5  # of the band before: below, the file tells the parameter
LEAST_SHARE = 0.05  # of a parameter in a combination that is told
_LEAST_WEIGHT = 1e-4  # of a sample that has its own combination of the others
_LEAST_BIT = 0.01  # that a further measurement has to tell
_FACTOR = np.log(2.0)  # of amplitudes
_OPTIONS = {
    "doubt": Parameter(0.05, "", "", minimum=0.0, maximum=0.5, exclusive=True),
    "scatter": positive(20.0, "Hz", ""),
}

STANDARD = Distribution("score", "normal", (("mean", 0.0), ("standard_deviation", 1.0)))

Array = NDArray[np.float64]


class Calibration(NamedTuple):
    """A job, a measured file, and how its deviations are weighed."""

    job: Job  # with uncertain parameters
    measured: Path  # the measured file
    # doubt, scatter: share of cells that may be judged otherwise [1], standard error of frequencies [Hz]
    doubt: float
    scatter: float


class Posterior(NamedTuple):
    """Samples, weighed by a measurement."""

    # dataset, measured: results of the study, over `sample` and its grid, and what was measured
    dataset: xr.Dataset
    measured: Measured
    # distributions, values: the uncertain parameters beforehand, and their values [SI], shape (parameter,
    # sample)
    distributions: tuple[Distribution, ...]
    values: Array
    lines: list[Line]  # agreement of each sample
    # log_likelihood, weights, shape (sample,): ln L, and the weights, whose sum is 1
    log_likelihood: Array
    weights: Array
    # those that are nearest to the weighed samples; of too few of them, those beforehand
    after: tuple[Distribution, ...] = ()

    @property
    def best(self) -> Line:
        """Agreement of the likeliest sample."""
        return self.lines[int(np.argmax(self.log_likelihood))]

    @property
    def effective(self) -> float:
        """Effective number of samples."""
        return float(1.0 / (self.weights**2).sum())

    def fault(self, doubt: float) -> str:
        """Why the weights state nothing of the parameters; "" where they do."""
        noise = (self.best.hits + self.best.misses) * np.log((1.0 - doubt) / doubt)
        if -self.log_likelihood.max() > 0.5 * max(noise, 1.0):
            return "no sample agrees with the file: state other distributions, or more doubt"
        if self.effective < FEWEST:
            return f"fewer than {FEWEST:.0f} effective samples, too few to state the parameters: take more"
        return ""

    def bands(self) -> list[tuple[Array, Array]]:
        """Quantiles BAND of each parameter before and after the measurement [SI]."""
        pairs = zip(self.distributions, self.after, strict=True)
        return [(one.quantiles(BAND), other.quantiles(BAND)) for one, other in pairs]

    def narrowed(self) -> dict[str, Distribution]:
        """By its key the distribution after the measurement of each parameter of which the file tells."""
        found = {}
        for one, (before, after) in zip(self.after, self.bands(), strict=True):
            width = np.ptp(before)
            if np.ptp(after) < TOLD * width or abs(after[1] - before[1]) > (1.0 - TOLD) * width:
                found[one.key] = one
        return found

    def correlation(self) -> Array:
        """Rank correlations of the parameters, (parameter, parameter)."""
        shares = np.array([shares_of(values, self.weights) for values in self.values])
        spread = np.cov(shares, aweights=self.weights, ddof=0).reshape(len(shares), -1)
        size = np.sqrt(np.diag(spread))
        found: Array = spread / np.outer(size, size)
        return found

    def probability(self) -> xr.DataArray:
        """Probability of vibration of each cell, over the axes of the grid [1]."""
        classes, weights = map_classes(self.dataset), xr.DataArray(self.weights, dims=SAMPLE)
        kinds = OccurrenceClass.VIBRATING, OccurrenceClass.QUIET
        yes, no = ((weights * (classes == kind)).sum(SAMPLE) for kind in kinds)
        return yes / (yes + no).where(yes + no > 0.0)


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
    path, overrides, measured
        As `load_job` and `analysis.measured.read_measured` take them.
    doubt, scatter : str, optional
        Share of cells that may be judged otherwise; standard error of frequencies with its unit.

    Raises
    ------
    InputError
        If the job is not legal or has no samples, or there is no measured file.
    """
    job = load_job(path, overrides)
    names = {axis.name for axis in job.axes}
    if SAMPLE not in names or not _distributions(job):
        raise mismatch(f"{job.source}: [uncertain]", "samples of uncertain parameters", "none")
    if job.design.get("kind") == "adaptive":
        raise mismatch(f"{job.source}: [design]", "as many samples in each cell", "adaptive")
    where = f"{job.source}: [axes]"
    if not names - {SAMPLE, SWAPPED}:
        raise mismatch(where, "an axis along which noise was measured, such as load", "none")
    if measured is None:
        raise mismatch("--measured", "a file with measured noise", "nothing")
    options = {
        name: default.default if told is None else read_value(default, told, f"--{name}")
        for (name, default), told in zip(_OPTIONS.items(), (doubt, scatter), strict=True)
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", JobWarning)  # comes once the runs are there
        along = read_measured(measured, _without_runs(job), job.source, job).along
    if along not in names:
        raise mismatch(where, f"the axis {along}, as in {measured}", "none of this name")
    return Calibration(job, Path(measured), **options)


def _without_runs(job: Job) -> xr.Dataset:
    """Results of a job before its first run: axes alone, for what a measured file is checked by."""
    known = job.schema.parameters
    units = {axis.name: known[axis.name].unit if axis.name in known else "" for axis in job.axes}
    axes = {axis.name: (axis.name, np.array(axis.values), {"units": units[axis.name]}) for axis in job.axes}
    status = [axis.name for axis in job.axes], np.zeros(job.shape, np.int8)
    return xr.Dataset({"status": status}, axes)


def _distributions(job: Job) -> tuple[Distribution, ...]:
    found = (rule.source for rule in job.rules if isinstance(rule.source, Scatter))
    return tuple(one.uncertain.distributions[one.place] for one in found)


def _uncertain(job: Job) -> Uncertain:
    return next(rule.source.uncertain for rule in job.rules if isinstance(rule.source, Scatter))


def _study(job: Job, out: Path) -> tuple[Sweep, Path]:
    """Return the study of the samples, and where its folder lies: that of `cvt-hpc run` if it has more."""
    own, of_run = (
        -1 if (found := find_records(folder, job)) is None else int(found.recorded.sum())
        for folder in (out / STUDY, out)
    )
    if of_run > own:
        return Sweep(out.absolute().name, (), job), out.absolute().parent
    return Sweep(STUDY, (), job), out


def plan_lines(asked: Calibration, out: Path) -> Iterator[str]:
    """Yield the lines that state the runs and their expected cost."""
    names = ", ".join(one.key for one in _distributions(asked.job))
    yield f"calibrate {asked.job.name} ({asked.job.source}) by {asked.measured}: {names}"
    study, folder = _study(asked.job, out)
    yield from sweep_lines([study], {}, folder)


def make(asked: Calibration, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Do the runs, weigh the samples, and write tables and picture; see `experiment_kinds`.

    InputError if a folder holds another job, the measured file does not fit, or the system refuses a file.
    """
    try:
        check_start(asked.job, out)
    except HeldError as error:  # --fresh repeats the runs of these samples alone
        raise InputError(f"{error.complaint}; choose another name or --out") from None
    study, folder = (Sweep(STUDY, (), asked.job), out) if fresh else _study(asked.job, out)
    status = run_sweeps([study], {}, folder, fresh=fresh, tell=tell)
    if status >= STALLED or process_rank() != 0:
        return Outcome(status=status)
    found = weigh(asked, load_sweep(study.name, folder))
    files = [("table", _write_table(found, out / "calibrated.csv"))]
    for name in ("calibrated.toml", "calibrated.png"):
        (out / name).unlink(missing_ok=True)
    if not (fault := found.fault(asked.doubt)):
        files.append(("job", _write_part(asked, found, out / "calibrated.toml")))
        files.append(("picture", draw(partial(_figure, found), out / "calibrated.png")))
    return Outcome(tuple(_lines(asked, found)), tuple(files), max(status, int(bool(fault))))


def weigh(asked: Calibration, dataset: xr.Dataset) -> Posterior:
    """Weigh the samples of a study by a measured file; InputError if the file does not fit the study."""
    dataset = independent(dataset).load().transpose(SAMPLE, ...)
    # both sets of samples, where there are runs for Sobol indices
    dataset = dataset.assign_coords({SAMPLE: np.arange(dataset.sizes[SAMPLE])})
    agreement = score(dataset, asked.measured, STUDY)
    if not sum(agreement.total[:4]):
        raise mismatch(f"{asked.measured}", "cells in its range of which a run is decided", "none")
    place = agreement.names.index(SAMPLE)
    of_samples: list[list[Line]] = [[] for _ in range(dataset.sizes[SAMPLE])]
    for at, line in agreement.lines:
        of_samples[int(at[place])].append(line)
    lines = [joined(one) for one in of_samples]
    likelihood = np.array([_log_likelihood(one, agreement.measured.kind, asked) for one in lines])
    weights = np.exp(likelihood - likelihood.max())
    distributions = _distributions(asked.job)
    values = np.array([dataset[one.key].values for one in distributions], float)
    weights /= weights.sum()
    found = Posterior(
        dataset, agreement.measured, distributions, values, lines, likelihood, weights, distributions
    )
    if found.effective < FEWEST:
        return found
    pairs = zip(distributions, values, strict=True)
    return found._replace(after=tuple(nearest_distribution(prior, drawn, weights) for prior, drawn in pairs))


def _log_likelihood(line: Line, kind: str, asked: Calibration) -> float:
    """Return ln L of a sample by its counts and errors; `kind` is that of the measured file."""
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


class Combination(NamedTuple):
    """Sum of the parameters' normal scores, each times a coefficient; beforehand it has the deviation 1."""

    coefficients: Array  # shape (parameter,), the largest one positive
    after: Distribution  # of the sum, after the measurement

    def width(self) -> float:
        """Width of the 95 % band after the measurement over that before."""
        return float(np.ptp(self.after.quantiles(BAND)) / np.ptp(STANDARD.quantiles(BAND)))


def told_best(asked: Calibration, found: Posterior) -> Combination:
    """Return the combination of parameters of which the file tells most; by too few samples as before."""
    from scipy.linalg import eigh
    from scipy.special import ndtri

    uncertain, keys = _uncertain(asked.job), [one.key for one in found.distributions]
    before = np.eye(len(keys))
    if uncertain.correlated:
        places = [keys.index(key) for key in uncertain.correlated]
        before[np.ix_(places, places)] = uncertain.matrix
    pairs = zip(found.distributions, found.values, strict=True)
    shares = np.array([one.shares(values) for one, values in pairs])
    scores, weights = ndtri(np.clip(shares, OUTERMOST, 1.0 - OUTERMOST)), found.weights
    off = scores - (scores @ weights)[:, np.newaxis]
    spread = (weights * off) @ off.T

    def narrowest(covariance: Array) -> Array:
        least: Array = eigh(covariance, before)[1][:, 0]
        return least

    best = narrowest(spread)
    best *= np.sign(best[np.argmax(np.abs(best))])
    if found.effective < FEWEST:
        return Combination(best, STANDARD)
    sums = best @ scores
    for k in np.flatnonzero((weights > _LEAST_WEIGHT) & (weights < 1.0)):
        left = 1.0 - weights[k]
        own = narrowest(spread / left - weights[k] / left**2 * np.outer(off[:, k], off[:, k]))
        sums[k] = np.sign(own @ before @ best) * own @ scores[:, k]
    return Combination(best, nearest_distribution(STANDARD, sums, weights))


def information(asked: Calibration, found: Posterior) -> xr.DataArray:
    """Return the information that one more measured cell gives of the samples [bit], over the grid."""

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
        yield from _disagreements(found)
        return
    head = ["before: 2.5 %", "50 %", "97.5 %", "after: 2.5 %", "50 %", "97.5 %", "width"]
    rows = [["parameter", "unit", *head]]
    for one, (low, high) in zip(found.distributions, found.bands(), strict=True):
        factor, unit = coordinate_unit(found.dataset[one.key].attrs)
        numbers = [short(factor * value) for value in (*low, *high)]
        rows.append([one.key, unit or "1", *numbers, f"{np.ptp(high) / np.ptp(low):.2f}"])
    yield from columns(rows)
    yield "width: of the 95 % band after the measurement over that before; 1: the file tells nothing"
    correlation, names = found.correlation(), [one.key for one in found.distributions]
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        if abs(correlation[i, j]) >= ALIKE:
            yield f"not told apart: {names[i]} and {names[j]}, rank correlation {correlation[i, j]:.2f}"
    widths = [float(np.ptp(after) / np.ptp(before)) for before, after in found.bands()]
    if (together := told_best(asked, found)).width() < TOLD * min(widths):
        yield from _combination_lines(together, names)
        names, widths = [*names, "that together"], [*widths, together.width()]
    yield from _told_lines(dict(zip(names, widths, strict=True)))
    bits = information(asked, found).where(~_measured_cells(found)[1], -np.inf).fillna(-np.inf)
    at = {name: int(k) for name, k in bits.argmax(...).items()}
    if (most := float(bits.isel(at))) < _LEAST_BIT:
        yield "no cell beyond the measured range would tell more"
        return
    told = ", ".join(f"{name} {value_text(found.dataset[name], k)}" for name, k in at.items())
    chance = float(found.probability().isel(at))
    yield f"measure next: {told}, which vibrates with a probability of {chance:.2f}: {most:.2f} bit"


def _combination_lines(told: Combination, names: list[str]) -> Iterator[str]:
    """Yield lines that state a combination of parameters."""
    shares = zip(names, told.coefficients.tolist(), strict=True)
    words = [
        f"{'-' if one < 0.0 else '+'} {abs(one):.2f} {name}"
        for name, one in shares
        if abs(one) >= LEAST_SHARE
    ]
    (begin, _, end), (low, _, high) = (map(short, one.quantiles(BAND)) for one in (STANDARD, told.after))
    numbers = f"before {begin} to {end}, after {low} to {high}, width {told.width():.2f}"
    yield f"told best together: {' '.join(words).removeprefix('+ ')}: {numbers}"
    yield "together: each in standard deviations from its median, as they were before"


def _told_lines(widths: dict[str, float]) -> Iterator[str]:
    """Yield lines that state what the file tells and what not, by widths of bands over those before."""
    told, in_part = ([name for name, width in widths.items() if width < most] for most in (_HALF, TOLD))
    yield f"told, a band below half of that before: {', '.join(told) or 'nothing'}"
    yield f"told in part: {', '.join(name for name in in_part if name not in told) or 'nothing'}"
    left = [name for name in widths if name not in in_part]
    yield f"not told, a band hardly narrower: {', '.join(left) or 'nothing'}"


def _disagreements(found: Posterior) -> Iterator[str]:
    """Yield lines that name the range where most samples contradict what was measured."""
    noise, known = _measured_cells(found)
    along, classes = found.dataset[found.measured.along], map_classes(found.dataset)
    kinds = {
        "vibrate": (OccurrenceClass.VIBRATING, known & ~noise, "silence"),
        "are quiet": (OccurrenceClass.QUIET, noise, "noise"),
    }
    for told, (kind, cells, what) in kinds.items() if found.measured.kind != ONSET else ():
        most = cells & ((classes == kind).mean(SAMPLE) > 0.5)
        if count := int(most.sum()):
            (of_axis,) = most.any([name for name in most.dims if name != along.name]).values.nonzero()
            low, high = (value_text(along, k) for k in of_axis[np.argsort(along.values[of_axis])][[0, -1]])
            yield f"most samples {told} in {count} cells from {low} to {high}, where {what} was measured"


def _measured_cells(found: Posterior) -> tuple[xr.DataArray, xr.DataArray]:
    """Whether noise was measured in a cell of the grid, and whether it lies in the measured range."""
    known = xr.zeros_like(found.dataset["status"].isel({SAMPLE: 0}, drop=True), bool)
    noise, loads = known, found.dataset[found.measured.along]
    for row in found.measured.rows:
        inside = swept = row.covers(loads.values)
        if found.measured.kind == WINDOW or np.isfinite(row.swept).all():  # windows without a range: of all
            swept = inside | within(loads.values, row.swept)
        of_row = loads == loads
        for name, value in row.at.items():
            of_row = of_row & (found.dataset[name] == value)
        noise, known = (
            cells | of_row & loads.copy(data=own) for cells, own in ((noise, inside), (known, swept))
        )
    return noise, known


def _write_table(found: Posterior, path: Path) -> Path:
    axes = [found.dataset[one.key] for one in found.distributions]
    head = [
        SAMPLE,
        *(heading(str(axis.name), axis.attrs) for axis in axes),
        *COUNTS,
        "log_likelihood",
        "weight",
    ]
    values = [coordinate_unit(axis.attrs)[0] * own for axis, own in zip(axes, found.values, strict=True)]
    rows = (
        [str(k), *map(number, own), *map(str, line[:5]), number(likelihood, 6), number(weight, 6)]
        for k, (*own, line, likelihood, weight) in enumerate(
            zip(*values, found.lines, found.log_likelihood, found.weights, strict=True)
        )
    )
    return write_rows(path, head, rows, origin_lines(found.dataset.attrs))


def _write_part(asked: Calibration, found: Posterior, path: Path) -> Path:
    """Write the table [uncertain] of a job that goes on from here."""
    narrowed, keys = found.narrowed(), [one.key for one in found.distributions]
    comments = {key: "as before: the file hardly tells of it" for key in keys if key not in narrowed}
    ranks = found.correlation()
    group_of = {key: name for name, own in _uncertain(asked.job).groups().items() for key in own}
    groups = correlated_groups(ranks, found.effective, np.array([group_of[key] for key in keys]))
    # correlation of normal scores by that of ranks
    correlation = np.where(groups == groups[:, np.newaxis], 2.0 * np.sin(np.pi / 6.0 * ranks), 0.0)
    schema = asked.job.schema
    units = {key: schema.unit_in_words(key) for key in keys}
    told = (narrowed.get(one.key, one) for one in found.distributions)
    distributions = [one.in_unit(schema.parameters[one.key].unit, units[one.key]) for one in told]
    lines = uncertain_lines(f"by {found.measured.name}", distributions, units, correlation, comments)
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
        factor, unit = coordinate_unit(found.dataset[one.key].attrs)
        bins = np.linspace(factor * values.min(), factor * values.max(), 13)
        axes.hist(factor * values, bins, density=True, color="0.8", label="before")
        after = {"color": COLOURS[1], "lw": 1.6, "histtype": "step", "label": "after"}
        axes.hist(factor * values, bins, weights=found.weights, density=True, **after)
        axes.set(xlabel=axis_label(found.dataset[one.key], unit), yticks=[])
    for axes in panels.flat[count:]:
        axes.set_axis_off()
    panels[0, 0].set_ylabel("density")
    shown = panels[0, 0].get_legend_handles_labels()
    upper.legend(*shown, loc="outside upper center", ncols=2, frameon=False, fontsize=8)
    _draw_probability(lower.subplots(), found)
    return figure


def _draw_probability(axes: Axes, found: Posterior) -> None:
    name = found.measured.along
    dataset, even = found.dataset.sortby(name), np.full_like(found.weights, 1.0 / found.weights.size)
    factor, unit = coordinate_unit(dataset[name].attrs)
    looks = {"before": (even, "0.5", "--"), "after": (found.weights, COLOURS[1], "-")}
    for told, (weights, colour, style) in looks.items():
        one = found._replace(dataset=dataset, weights=weights)
        shown = one.probability().transpose(name, ...)
        values = shown.values.reshape(shown.sizes[name], -1)
        lines = axes.plot(factor * dataset[name].values, values, marker=".", lw=1.4, color=colour, ls=style)
        lines[0].set_label(told)
    axes.set(xlabel=axis_label(dataset[name], unit), ylabel="probability of vibration", ylim=(-0.03, 1.03))
    over, height = Overlay(found.measured, dataset), Side("", np.array(axes.get_ylim()))
    over.draw(axes, side_of(dataset, name), height, xr.Dataset())
    others = [str(name) for name in shown.dims[1:]]
    title = f"a line for each {', '.join(others).replace('_', ' ')}" if others else None
    handles = [line for line in axes.get_lines() if not line.get_label().startswith("_")]
    beside = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "title": title, "title_fontsize": 8}
    axes.legend(handles=[*handles, *over.handles], frameon=False, fontsize=8, **beside)
