"""`cvt-hpc friction`: laws of friction fitted to measured coefficients, each with its uncertainty.

Each law is fitted by least squares, in x = (mu_k, g, ln v_s) or what it reads of these. With
`_LEAST_SPECIMENS` specimens or more each is fitted by itself: the mean and the covariance of the estimates
are those of a specimen, which is how variators differ, the error of each fit included. With fewer the
covariance is that of the mean law,

    C = s^2 (J^T J)^-1 n / n_e,    n_e = n (1 - r) / (1 + r),    s^2 = (n_e / n) sum of squares / (n_e - k),

k being the number of parameters, J the slopes, and r the correlation of neighbouring residuals in the
order of the speeds: a trace of a thousand samples is no thousand measurements, and where a law misses the
shape of the points, its residuals are correlated as well.

Laws are compared by Akaike's criterion for small samples (Hurvich and Tsai 1989). No law here depends on the
normal force; whether the coefficient does is found from the residuals.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import approx_fprime, least_squares

from cvt_hpc.analysis.figures import WIDTH, draw, line_style
from cvt_hpc.analysis.measured import Fault, read_columns
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.experiments.uncertain_lines import given, uncertain_lines
from cvt_hpc.job.uncertain import Distribution
from cvt_hpc.job.units import from_si
from cvt_hpc.physics.friction import friction_coefficients, friction_law
from cvt_hpc.physics.friction_laws import OTHER_NAMES, Law
from cvt_hpc.storage.files import written_aside
from cvt_hpc.tables import columns, short

_LEAST_SPECIMENS = _LEAST_SPEEDS = 4  # one more than a law has parameters
_COLUMNS = {"force": ("N/m", "N", "Pa"), "speed": ("m/s",), "mu": ("",), "specimen": ("",)}
_SCALES = 7  # speed scales at which the search begins
_LARGEST_CONDITION = 1e8  # condition of J, by columns of one size, up to which the points determine a law
_TWO_SIDED_95 = 1.96  # standard errors
_MUCH_CLOSER = 0.5  # of the root mean square of the best law's residuals
NEGLIGIBLE = 1e-6  # coefficient of friction that nobody measures
_UNITS = {"kinetic_friction": "", "friction_gradient": "s/m", "stribeck_velocity": "m/s"}
_WRITTEN = _UNITS | {"stribeck_velocity": "mm/s"}  # as tribometers state it
_SCALE = "stribeck_velocity"  # in x by its logarithm
_FURTHER = (
    "# what else is uncertain belongs here, or friction alone scatters; about the defaults of most models:",
    '# transverse_damping = { distribution = "uniform", from = "600 N s/m^2", to = "1400 N s/m^2" }',
    '# friction_memory = { distribution = "log_normal", mean = "0.18 ms", standard_deviation = "0.05 ms" }',
)

Array = NDArray[np.float64]


class Points(NamedTuple):
    """Measured coefficients of friction: arrays (n,)."""

    # speed, mu, force, specimen: sliding speed [m/s], coefficient [1], normal force in any unit and number of
    # the specimen; the last two are nan and 0 where the file has no such column
    speed: Array
    mu: Array
    force: Array
    specimen: Array


class Fitted(NamedTuple):
    """A law as it was fitted."""

    law: Law
    estimate: Array  # of x [SI], which has the logarithm of a speed, (k,)
    covariance: Array  # (k, k)
    rms: float  # root mean square of the residuals of the best fit to all points [1]
    independent: float  # n_e / n of these
    of_specimens: int  # specimens whose scatter the covariance is; 0: it is the uncertainty of the mean law
    # Akaike's for small samples, n_e being that of the law whose residuals are correlated least: the law of
    # the least criterion is the best
    criterion: float = np.inf

    @property
    def values(self) -> dict[str, float]:
        """Values of the law's parameters by key [SI]."""
        return _values(self.law, self.estimate)

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of these [SI]; of a speed by its logarithm, to first order."""
        sizes = np.sqrt(np.diag(self.covariance)).tolist()
        found = dict(zip(keys_of(self.law), sizes, strict=True))
        return {key: one * (self.values[key] if key == _SCALE else 1.0) for key, one in found.items()}

    def band(self, speeds: Array) -> tuple[Array, Array]:
        """Coefficients at speeds (n,) [m/s] and their standard deviation, to first order."""
        slopes = _slopes(self.law, self.estimate, speeds)
        deviation = np.sqrt(np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes))
        return _curve(self.law, self.estimate, speeds), deviation


def keys_of(law: Law) -> tuple[str, ...]:
    """Parameters of a law that are fitted, in the order of x."""
    return law.reads[:1] if law is Law.COULOMB else law.reads


def read_points(path: str | Path) -> Points:
    """Read measured coefficients of friction from a CSV file.

    Its columns are `speed` and `mu`; `force` [N, N/m or Pa] and `specimen`, a number, may be there, too. Rows
    may be repeated. InputError if the file cannot be read, or a row is not legal.
    """
    needed = ("speed", "mu")
    found = read_columns(path, "cvt-hpc friction", _COLUMNS, needed, _faults, OTHER_NAMES)
    speed, mu = (found[name] for name in needed)
    force, specimen = (
        found.get(name, np.full(speed.size, none)) for name, none in (("force", np.nan), ("specimen", 0.0))
    )
    return Points(speed, mu, force, specimen)


def _faults(values: dict[str, Array]) -> Iterator[Fault]:
    yield ("speed",), "a speed of 0 or more (a magnitude)", values["speed"] < 0.0
    yield ("mu",), "a coefficient of friction > 0", values["mu"] <= 0.0
    if "force" in values:
        yield ("force",), "a force of 0 or more", values["force"] < 0.0
    if len(np.unique(values["speed"])) < _LEAST_SPEEDS:
        raise ValueError(f"expected {_LEAST_SPEEDS} different speeds or more, found fewer")


def _values(law: Law, x: Array) -> dict[str, float]:
    told = dict(zip(keys_of(law), x.tolist(), strict=True))
    return told | ({_SCALE: float(np.exp(told[_SCALE]))} if _SCALE in told else {})


def _curve(law: Law, x: Array, speeds: Array) -> Array:
    """Coefficients of a law (n,) at speeds (n,) [m/s]."""
    has = dict(zip(_UNITS, (0.0, 0.0, 1.0), strict=True)) | _values(law, x)
    kinetic, gradient, scale = has.values()
    made = friction_law(law.name.lower(), kinetic, gradient, scale)
    found: Array = friction_coefficients(made, speeds, np.zeros_like(speeds))
    return found


def _slopes(law: Law, x: Array, speeds: Array) -> Array:
    """Slopes of the coefficients by x, (n, k)."""
    steps = np.maximum(1e-6 * np.abs(x), 1e-9)
    slopes: Array = approx_fprime(x, lambda at: _curve(law, at, speeds), steps)
    return slopes.reshape(speeds.size, x.size)


def _least(law: Law, speed: Array, mu: Array) -> Array | None:
    """The x of least squares, from several speed scales; None where the points do not determine it.

    `speed` (n,) [m/s], `mu` (n,). The fall is never negative.
    """
    keys, moving, level = keys_of(law), speed[speed > 0.0], float(mu.mean())
    if len(np.unique(speed)) <= len(keys):
        return None
    low, high = np.log(moving.min() / 3.0), np.log(3.0 * moving.max())
    box = dict(zip(_UNITS, ((1e-6, 10.0), (-1e4, 0.0), (low, high)), strict=True))
    scales = np.linspace(low, high, _SCALES + 2)[1:-1] if _SCALE in keys else [np.log(speed.max())]
    drop, fits = max(float(np.ptp(mu)), 1e-6 * level), []
    for scale in scales:
        first = level if law is Law.HYPERBOLIC else max(float(mu.min()), 1e-5)
        start = np.array([first, -drop / np.exp(scale), scale])[: len(keys)]
        sizes = np.maximum(np.abs([*start[:2], 1.0][: len(keys)]), 1e-9)
        bounds = tuple(zip(*(box[key] for key in keys), strict=True))
        fits.append(least_squares(lambda x: _curve(law, x, speed) - mu, start, bounds=bounds, x_scale=sizes))
    x = np.asarray(min(fits, key=lambda fit: fit.cost).x)
    slopes = _slopes(law, x, speed)
    size = np.linalg.norm(slopes, axis=0)
    is_determined = (size > 0.0).all() and np.linalg.cond(slopes / size) < _LARGEST_CONDITION
    return x if is_determined else None


def _independent(residuals: Array, speed: Array) -> float:
    """n_e / n, at most 1, by the correlation of neighbouring residuals (n,) in the order of speeds (n,)."""
    ordered = residuals[np.argsort(speed, kind="stable")]
    total = float((ordered**2).sum())
    r = float((ordered[1:] * ordered[:-1]).sum()) / total if total > 0.0 else 0.0
    r = min(max(r, 0.0), 0.99)
    return (1.0 - r) / (1.0 + r)


def fit_law(law: Law, points: Points) -> Fitted | None:
    """Fit a law; None where the points do not determine it, such as a speed scale without a fall."""
    speed, mu, k = points.speed, points.mu, len(keys_of(law))
    n, x = len(mu), _least(law, speed, mu)
    if n <= k + 2 or x is None:
        return None
    residuals, slopes = _curve(law, x, speed) - mu, _slopes(law, x, speed)
    square, share = float((residuals**2).sum()), _independent(residuals, speed)
    variance = square / max(n - k / share, 1.0)
    covariance: Any = variance * np.linalg.inv(slopes.T @ slopes) / share
    parts = [points.specimen == one for one in np.unique(points.specimen)]
    parts = parts if len(parts) >= _LEAST_SPECIMENS else []
    own = [one for part in parts if (one := _least(law, speed[part], mu[part])) is not None]
    is_scatter = len(own) >= _LEAST_SPECIMENS and bool((np.ptp(own, axis=0) > 0.0).all())
    if is_scatter:
        x, covariance = np.mean(own, axis=0), np.cov(own, rowvar=False).reshape(k, -1).astype(float)
    return Fitted(law, x, covariance, float(np.sqrt(square / n)), share, len(own) * is_scatter)


def fit_laws(points: Points) -> list[Fitted]:
    """Fit every law that has a formula; the best comes first. InputError if the points determine none."""
    found = [one for law in Law if law is not Law.TABLE if (one := fit_law(law, points))]
    if not found:
        raise mismatch("cvt-hpc friction", "more points than a law has parameters", str(len(points.mu)))
    count = len(points.mu) * max(one.independent for one in found)

    def criterion(one: Fitted) -> float:
        k = len(one.estimate) + 1  # the variance, too
        spare = max(count - k - 1.0, 0.5)
        return float(count * np.log(max(one.rms**2, 1e-30)) + 2.0 * k * count / spare)

    judged = (one._replace(criterion=criterion(one)) for one in found)
    return sorted(judged, key=lambda one: one.criterion)


def by_force(fitted: Fitted, points: Points) -> tuple[float, float] | None:
    """Change of the coefficient from the least to the largest force over its mean, and its error."""
    if not np.isfinite(points.force).all() or np.ptp(points.force) == 0.0:
        return None
    residuals = points.mu - _curve(fitted.law, fitted.estimate, points.speed)
    share = (points.force - points.force.min()) / np.ptp(points.force)
    for one in np.unique(points.specimen):  # what specimens have of their own is no effect of their forces
        for values in (share, residuals):
            values[points.specimen == one] -= values[points.specimen == one].mean()
    square = float((share**2).sum())
    if square < 1e-9:
        return None
    slope = float((share * residuals).sum()) / square
    left = residuals - slope * share
    variance = float((left**2).sum()) / max(len(left) - 2, 1) / square / _independent(left, points.speed)
    return slope / float(points.mu.mean()), float(np.sqrt(variance)) / float(points.mu.mean())


def job_lines(fitted: Fitted) -> list[str]:
    """Tables [friction] and [uncertain] of a job, with the law and its uncertainty."""
    values, deviations = fitted.values, np.sqrt(np.diag(fitted.covariance))
    lines = ["[friction]", f'friction_law = "{fitted.law.name.lower()}"']
    if fitted.law is Law.COULOMB:
        lines.append("friction_gradient = 0")
    written = ((key, from_si(value, _UNITS[key], _WRITTEN[key])) for key, value in values.items())
    certain = [f"{key} = {given(value, _WRITTEN[key])}" for key, value in written]
    if not (deviations > 0.0).all():  # points without any scatter
        return [*lines, *certain]
    lines += ["# for the law without its uncertainty, leave the other tables out"]
    lines += [f"# {line}" for line in certain]
    limits = {
        "kinetic_friction": (("from", 0.1 * values["kinetic_friction"]),),
        "friction_gradient": (("to", 0.0),),
    }
    distributions = []
    for (key, mean), deviation in zip(values.items(), deviations.tolist(), strict=True):
        if key == _SCALE:  # moments of a value whose logarithm is normal
            mean *= float(np.exp(0.5 * deviation**2))
            deviation = mean * float(np.sqrt(np.expm1(deviation**2)))
        kind = "log_normal" if key == _SCALE else "normal"
        numbers = (("mean", mean), ("standard_deviation", deviation), *limits.get(key, ()))
        distributions.append(Distribution(key, kind, numbers).in_unit(_UNITS[key], _WRITTEN[key]))
    count = fitted.of_specimens
    what = f"scatter of {count} specimens" if count else "uncertainty of the mean law"
    correlation = fitted.covariance / np.outer(deviations, deviations)
    head, samples, *table = uncertain_lines(what, distributions, _WRITTEN, correlation)
    return [*lines, "", head, samples, *_FURTHER, *table]


def _with_deviation(one: Fitted, key: str) -> str:
    moments = one.values[key], one.deviations[key]
    value, deviation = (from_si(moment, _UNITS[key], _WRITTEN[key]) for moment in moments)
    return f"{short(value)} +- {deviation:.2g}"


def law_lines(laws: Sequence[Fitted], points: Points) -> Iterator[str]:
    """Yield lines that state what was measured and every fit; the best law stands first."""
    best, speeds, specimens = laws[0], points.speed, len(np.unique(points.specimen))
    yield (
        f"{len(speeds)} points from {1e3 * speeds.min():g} to {1e3 * speeds.max():g} mm/s, "
        f"{specimens} specimen{'s' * (specimens > 1)}"
    )
    rows = [["law", *(f"{key} [{unit or 1}]" for key, unit in _WRITTEN.items()), "rms [1]", "criterion"]]
    for one in laws:
        cells = [_with_deviation(one, key) if key in one.values else "" for key in _UNITS]
        rows.append([one.law.name.lower(), *cells, f"{one.rms:.2g}", f"{one.criterion - best.criterion:.1f}"])
    yield from columns(rows, indent="")
    closest = min(laws, key=lambda one: one.rms)
    if _MUCH_CLOSER * best.rms > max(closest.rms, NEGLIGIBLE):
        name = closest.law.name.lower()
        few = f"{len(speeds)} points are few for its {len(closest.estimate)} parameters"
        yield f"{name} is much closer to the points, but {few}: measure more, or choose it by --law {name}"
    if best.of_specimens:
        yield f"standard deviations are the scatter of {best.of_specimens} specimens"
    else:
        whose = f"the scatter of variators takes {_LEAST_SPECIMENS} specimens or more"
        yield f"standard deviations are those of the mean law; {whose}"
    if best.of_specimens and (out := specimens - best.of_specimens):
        yield f"left out of the scatter: {out}, whose points do not determine the law"
    if (change := by_force(best, points)) is not None:
        share, error = (100.0 * one for one in change)
        told = "" if abs(share) <= _TWO_SIDED_95 * error else ": no law has that, but friction_law table"
        changes = f"changes by {share:+.1f} % +- {error:.1f} %{told}"
        yield f"from the least to the largest force the coefficient {changes}"


def write_fit(path: Path, out: Path, law: str | None = None) -> tuple[list[str], list[tuple[str, Path]]]:
    """Fit all laws to a file; write a fragment of a job with the best to `out`, and a picture beside it.

    `law` is the name of another one to be written. Returns what was found, as lines, and what was written.
    InputError if the file is not legal, its points do not determine this law, or the system refuses to write.
    """
    points = read_points(path)
    laws = fit_laws(points)
    fitted = {one.law.name.lower(): one for one in laws}
    if law is not None and law not in fitted:
        raise unknown("--law", f"law that {path} determines", law, fitted)
    chosen = laws[0] if law is None else fitted[law]
    text = [f"# Friction fitted to {path.name} by cvt-hpc friction", *job_lines(chosen)]
    with written_aside(out, parents=True) as aside:
        aside.write_text("\n".join(text) + "\n", encoding="utf-8")
    picture = draw(partial(_figure, laws, points), out.with_suffix(".png"))
    return list(law_lines(laws, points)), [("job", out), ("picture", picture)]


def _figure(laws: Sequence[Fitted], points: Points) -> Figure:
    """Points, all laws, and of the best one the band of two standard deviations."""
    figure = Figure((WIDTH, 4.2), layout="constrained")
    axes, best = figure.subplots(), laws[0]
    grid = np.linspace(0.0, 1.05 * points.speed.max(), 300)
    shown = 1e3 * grid
    axes.plot(1e3 * points.speed, points.mu, ".", color="0.45", markersize=4, label="measured")
    for k, one in enumerate(laws):
        dashes = "-" if k == 0 else (0, (6 - k, 1.5) + (1, 1.5) * (k - 1))  # tells them apart in grey
        look = line_style(k) | {"marker": "", "lw": 1.3 if k else 1.8, "ls": dashes}
        axes.plot(shown, one.band(grid)[0], label=one.law.name.lower() + " (best)" * (k == 0), **look)
    curve, deviation = best.band(grid)
    whose = f"{best.of_specimens} specimens" if best.of_specimens else "the mean law"
    label = f"2 standard deviations of {whose}"
    axes.fill_between(shown, curve - 2.0 * deviation, curve + 2.0 * deviation, alpha=0.25, lw=0, label=label)
    axes.set(xlabel="sliding speed [mm/s]", ylabel="coefficient of friction [1]", xlim=shown[[0, -1]])
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
