"""`cvt-hpc friction`: laws of friction fitted to measured coefficients, each with its uncertainty.

Each law is fitted by least squares, in x = (mu_k, g, ln v_s) or what it reads of these. With
`LEAST_SPECIMENS` specimens or more each is fitted by itself: the mean and the covariance of the estimates
are those of a specimen, which is how variators differ, the error of each fit included. With fewer the
covariance is that of the mean law,

    C = s^2 (J^T J)^-1 n / n_e,    n_e = n (1 - r) / (1 + r),    s^2 = (n_e / n) sum of squares / (n_e - k),

k being the number of parameters, J the slopes, and r the correlation of neighbouring residuals in the
order of the speeds: a trace of a thousand samples is no thousand measurements, and where a law misses the
shape of the points, its residuals are correlated as well.

Laws are compared by Akaike's criterion for small samples (Hurvich and Tsai 1989). No law here depends on the
normal force; whether the coefficient does is found from the residuals.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cvt_hpc.analysis.figures import WIDTH, draw, line_style
from cvt_hpc.errors import mismatch
from cvt_hpc.experiments.uncertain_lines import Scattered, given, uncertain_lines
from cvt_hpc.job.csv_files import read_csv
from cvt_hpc.parameters import Column, FromFile, RowError
from cvt_hpc.physics.friction import friction_coefficients, friction_law
from cvt_hpc.physics.friction_laws import OTHER_NAMES, Law
from cvt_hpc.storage.files import written_aside
from cvt_hpc.tables import columns, short

LEAST_SPECIMENS = 4  # one more than a law has parameters
_COLUMNS = {"force": ("N/m", "N", "Pa"), "speed": ("m/s",), "mu": ("",), "specimen": ("",)}
_SCALES = 7  # speed scales at which the search begins
_LARGEST = 1e8  # condition of J, by columns of one size, up to which the points determine a law
_CERTAIN = 1.96  # standard errors
_PARAMETERS = {"kinetic_friction": "", "friction_gradient": "s/m", "stribeck_velocity": "m/s"}

Array = NDArray[np.float64]


class Measured(NamedTuple):
    """Measured coefficients of friction, (n,) each.

    Attributes
    ----------
    speed, mu, force, specimen : (n,) arrays
        Sliding speed [m/s], coefficient [1], normal force [`force_unit`] and number of the specimen; the last
        two are nan and 0 where the file has no such column.
    force_unit : str
        SI unit of the forces.
    """

    speed: Array
    mu: Array
    force: Array
    specimen: Array
    force_unit: str


class Fitted(NamedTuple):
    """A law as it was fitted.

    Attributes
    ----------
    law : Law
        Which one.
    keys : tuple of str
        The parameters that it reads, in the order of x.
    estimate, covariance : (k,) and (k, k) arrays
        Of x [SI]; the logarithm of a speed.
    rms : float
        Root mean square of the residuals of the best fit to all points [1].
    independent : float
        n_e / n of these.
    criterion : float
        Akaike's criterion for small samples, n_e being that of the law whose residuals are correlated least:
        the law of the least criterion is the best.
    of_specimens : int
        Specimens whose scatter the covariance is; 0: it is the uncertainty of the mean law.
    """

    law: Law
    keys: tuple[str, ...]
    estimate: Array
    covariance: Array
    rms: float
    independent: float
    criterion: float
    of_specimens: int

    def values(self) -> dict[str, float]:
        """Values of the law's parameters by key [SI]."""
        return _values(self.keys, self.estimate)

    def deviations(self) -> dict[str, float]:
        """Standard deviations of these [SI]; of a speed by its logarithm, to first order."""
        found = dict(zip(self.keys, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))
        return {key: one * (self.values()[key] if _is_log(key) else 1.0) for key, one in found.items()}

    def band(self, speeds: Array) -> tuple[Array, Array]:
        """Coefficients at speeds (n,) [m/s] and their standard deviation, to first order."""
        slopes = _slopes(self.law, self.keys, self.estimate, speeds)
        deviation = np.sqrt(np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes))
        return _curve(self.law, self.keys, self.estimate, speeds), deviation


def read_measured(path: str | Path) -> Measured:
    """Read measured coefficients of friction from a CSV file.

    Parameters
    ----------
    path : path-like
        Columns `speed` [m/s] and `mu`; `force` [N, N/m or Pa] and `specimen`, a number, may be there, too.
        Rows may be repeated.

    Raises
    ------
    InputError
        If the file cannot be read, or a row is not legal.
    """
    file = FromFile(_COLUMNS, ("speed", "mu"), (), _measured, OTHER_NAMES)
    found: Measured = read_csv(file, str(path), "", "cvt-hpc friction")["measured"]
    return found


def _measured(table: Mapping[str, Column]) -> dict[str, Any]:
    arrays = {name: np.array(column.values) for name, column in table.items()}
    for row, (speed, mu) in enumerate(zip(arrays["speed"], arrays["mu"], strict=True)):
        if speed < 0.0:
            raise RowError(row, "a speed of 0 or more (a magnitude)", f"{speed:g} m/s")
        if mu <= 0.0:
            raise RowError(row, "a coefficient of friction > 0", f"{mu:g}")
    count = len(arrays["speed"])
    force = arrays.get("force", np.full(count, np.nan))
    unit = table["force"].unit if "force" in table else ""
    specimen = arrays.get("specimen", np.zeros(count))
    if len(np.unique(arrays["speed"])) < LEAST_SPECIMENS:
        raise ValueError(f"expected {LEAST_SPECIMENS} different speeds or more, found fewer")
    return {"measured": Measured(arrays["speed"], arrays["mu"], force, specimen, unit)}


def _is_log(key: str) -> bool:
    return key == "stribeck_velocity"


def _values(keys: Sequence[str], x: Array) -> dict[str, float]:
    return {key: float(np.exp(one) if _is_log(key) else one) for key, one in zip(keys, x, strict=True)}


def _curve(law: Law, keys: Sequence[str], x: Array, speeds: Array) -> Array:
    """Coefficients of a law (n,) at speeds (n,) [m/s]."""
    has = {"friction_gradient": 0.0, "stribeck_velocity": 1.0} | _values(keys, x)
    kinetic, gradient, scale = (has[key] for key in _PARAMETERS)
    made = friction_law(law.name.lower(), kinetic, gradient, scale)
    found: Array = friction_coefficients(made, speeds, np.zeros_like(speeds))
    return found


def _slopes(law: Law, keys: Sequence[str], x: Array, speeds: Array) -> Array:
    """Slopes of the coefficients by x, (n, k)."""
    steps = np.maximum(1e-6 * np.abs(x), 1e-9)
    ways = np.diag(steps)
    return np.stack(
        [
            (_curve(law, keys, x + way, speeds) - _curve(law, keys, x - way, speeds)) / (2.0 * step)
            for way, step in zip(ways, steps, strict=True)
        ],
        axis=1,
    )


def _least(law: Law, keys: Sequence[str], speed: Array, mu: Array) -> Array:
    """The x of least squares, from several speed scales; the fall is never negative."""
    moving, level = speed[speed > 0.0], float(mu.mean())
    low, high = np.log(moving.min() / 3.0), np.log(3.0 * moving.max())
    box = {
        "kinetic_friction": (1e-6, 10.0),
        "friction_gradient": (-1e4, 0.0),
        "stribeck_velocity": (low, high),
    }
    scales = (
        np.linspace(low, high, _SCALES + 2)[1:-1] if "stribeck_velocity" in keys else [np.log(speed.max())]
    )
    best = None
    for scale in scales:
        drop = max(float(np.ptp(mu)), 1e-6 * level)
        first = {
            "kinetic_friction": level if law is Law.HYPERBOLIC else max(float(mu.min()), 1e-5),
            "friction_gradient": -drop / float(np.exp(scale)),
            "stribeck_velocity": scale,
        }
        found = least_squares(
            lambda x: _curve(law, keys, x, speed) - mu,
            [first[key] for key in keys],
            bounds=tuple(zip(*(box[key] for key in keys), strict=True)),
            x_scale=[1.0 if _is_log(key) else max(abs(first[key]), 1e-9) for key in keys],
        )
        best = found if best is None or found.cost < best.cost else best
    assert best is not None
    return np.asarray(best.x)


def _independent(residuals: Array, speed: Array) -> float:
    """n_e / n, by the correlation of neighbouring residuals in the order of the speeds, at most 1."""
    ordered = residuals[np.argsort(speed, kind="stable")]
    total = float((ordered**2).sum())
    r = float((ordered[1:] * ordered[:-1]).sum()) / total if total > 0.0 else 0.0
    r = min(max(r, 0.0), 0.99)
    return (1.0 - r) / (1.0 + r)


def fit_law(law: Law, measured: Measured) -> Fitted | None:
    """Fit a law to measured coefficients.

    Returns
    -------
    Fitted or None
        None where the points do not determine the law's parameters, such as a speed scale without a fall.
    """
    read = law.reads[:1] if law is Law.COULOMB else law.reads
    keys = tuple(key for key in _PARAMETERS if key in read)
    speed, mu, k = measured.speed, measured.mu, len(keys)
    x = _least(law, keys, speed, mu)
    residuals = _curve(law, keys, x, speed) - mu
    n, square = len(mu), float((residuals**2).sum())
    slopes = _slopes(law, keys, x, speed)
    if n <= k + 2 or not _determined(slopes):
        return None
    share = _independent(residuals, speed)
    variance = square / max(n - k / share, 1.0)
    covariance: Any = variance * np.linalg.inv(slopes.T @ slopes) / share
    count, parts = 0, (measured.specimen == one for one in np.unique(measured.specimen))
    own = [
        one for one in (_of_specimen(law, keys, speed[part], mu[part]) for part in parts) if one is not None
    ]
    if len(own) >= LEAST_SPECIMENS and (np.ptp(own, axis=0) > 0.0).all():
        count, x = len(own), np.mean(own, axis=0)
        covariance = np.cov(own, rowvar=False).reshape(k, -1).astype(np.float64)
    return Fitted(law, keys, x, covariance, float(np.sqrt(square / n)), share, np.inf, count)


def _of_specimen(law: Law, keys: Sequence[str], speed: Array, mu: Array) -> Array | None:
    """The x of a specimen alone; None where its points do not determine it."""
    if len(np.unique(speed)) <= len(keys):
        return None
    x = _least(law, keys, speed, mu)
    return x if _determined(_slopes(law, keys, x, speed)) else None


def _determined(slopes: Array) -> bool:
    size = np.linalg.norm(slopes, axis=0)
    return bool((size > 0.0).all() and np.linalg.cond(slopes / size) < _LARGEST)


def fit_laws(measured: Measured) -> list[Fitted]:
    """Fit every law that has a formula; the best comes first.

    Raises
    ------
    InputError
        If the points determine none.
    """
    found = [fit_law(law, measured) for law in Law if law is not Law.TABLE]
    sound = [one for one in found if one]
    if not sound:
        raise mismatch("cvt-hpc friction", "more points than a law has parameters", str(len(measured.mu)))
    points = len(measured.mu) * max(one.independent for one in sound)

    def criterion(one: Fitted) -> float:
        k = len(one.keys) + 1  # the variance, too
        spare = max(points - k - 1.0, 0.5)
        return points * np.log(max(one.rms**2, 1e-30)) + 2.0 * k * points / spare

    judged = (one._replace(criterion=float(criterion(one))) for one in sound)
    return sorted(judged, key=lambda one: one.criterion)


def by_force(fitted: Fitted, measured: Measured) -> tuple[float, float] | None:
    """Change of the coefficient from the least to the largest force over its mean, and its error."""
    if not np.isfinite(measured.force).all() or np.ptp(measured.force) == 0.0:
        return None
    residuals = measured.mu - _curve(fitted.law, fitted.keys, fitted.estimate, measured.speed)
    share = (measured.force - measured.force.min()) / np.ptp(measured.force)
    for one in np.unique(measured.specimen):  # what specimens have of their own is no effect of their forces
        part = measured.specimen == one
        share[part], residuals[part] = (
            share[part] - share[part].mean(),
            residuals[part] - residuals[part].mean(),
        )
    square = float((share**2).sum())
    if square < 1e-9:
        return None
    slope = float((share * residuals).sum()) / square
    left = residuals - slope * share
    variance = float((left**2).sum()) / max(len(left) - 2, 1) / square / _independent(left, measured.speed)
    return slope / float(measured.mu.mean()), float(np.sqrt(variance)) / float(measured.mu.mean())


def job_lines(fitted: Fitted) -> list[str]:
    """Tables [friction] and [uncertain] of a job, with the law and its uncertainty."""
    values = fitted.values()
    lines = ["[friction]", f'friction_law = "{fitted.law.name.lower()}"']
    if fitted.law is Law.COULOMB:
        lines.append("friction_gradient = 0")
    certain = [f"{key} = {given(value, _PARAMETERS[key])}" for key, value in values.items()]
    if not (np.diag(fitted.covariance) > 0.0).all():  # points without any scatter
        return [*lines, *certain]
    lines += ["# for the law without its uncertainty, leave the other tables out"]
    lines += [f"# {line}" for line in certain]
    least = 0.1 * values["kinetic_friction"]
    limits = {"kinetic_friction": (least, np.inf), "friction_gradient": (-np.inf, 0.0)}
    parameters = [
        Scattered(key, unit, _is_log(key), *limits.get(key, ()))
        for key, unit in _PARAMETERS.items()
        if key in fitted.keys
    ]
    count = fitted.of_specimens
    what = f"scatter of {count} specimens" if count else "uncertainty of the mean law"
    return [*lines, "", *uncertain_lines(parameters, fitted.estimate, fitted.covariance, what)]


def law_lines(laws: Sequence[Fitted], measured: Measured) -> list[str]:
    """Lines that state what was measured and every fit; the best law stands first."""
    rows = [("law", *(f"{key} [{unit or 1}]" for key, unit in _PARAMETERS.items()), "rms [1]", "criterion")]
    for one in laws:
        values, deviations = one.values(), one.deviations()
        cells = [
            f"{short(values[key])} +- {deviations[key]:.2g}" if key in values else "" for key in _PARAMETERS
        ]
        rows.append(
            (one.law.name.lower(), *cells, f"{one.rms:.2g}", f"{one.criterion - laws[0].criterion:.1f}")
        )
    speeds, specimens = measured.speed, len(np.unique(measured.specimen))
    lines = [
        f"{len(speeds)} points from {1e3 * speeds.min():g} to {1e3 * speeds.max():g} mm/s, "
        f"{specimens} specimen{'s' * (specimens > 1)}",
        *columns(rows, indent=""),
    ]
    best = laws[0]
    whose = (
        f"are the scatter of {best.of_specimens} specimens"
        if best.of_specimens
        else f"are those of the mean law; the scatter of variators takes {LEAST_SPECIMENS} specimens or more"
    )
    lines.append(f"standard deviations {whose}")
    if best.of_specimens and (out := specimens - best.of_specimens):
        lines.append(f"left out of the scatter: {out}, whose points do not determine the law")
    if (change := by_force(best, measured)) is not None:
        share, error = change
        lines.append(
            f"from the least to the largest force the coefficient changes by {100 * share:+.1f} % "
            f"+- {100 * error:.1f} %"
            + ("" if abs(share) <= _CERTAIN * error else ": no law has that, but friction_law table")
        )
    return lines


def write_fit(path: Path, out: Path) -> tuple[list[str], list[tuple[str, Path]]]:
    """Fit all laws to a file; write a fragment of a job with the best, and a picture.

    Parameters
    ----------
    path : Path
        The measured file.
    out : Path
        The fragment, .toml; the picture stands beside it, .png.

    Returns
    -------
    lines, files
        What was found, and what was written.

    Raises
    ------
    InputError
        If the file is not legal, or the system refuses to write.
    """
    measured = read_measured(path)
    laws = fit_laws(measured)
    text = [f"# Friction fitted to {path.name} by cvt-hpc friction", *job_lines(laws[0])]
    with written_aside(out, parents=True) as aside:
        aside.write_text("\n".join(text) + "\n", encoding="utf-8")
    picture = draw(partial(_figure, laws, measured), out.with_suffix(".png"))
    return law_lines(laws, measured), [("job", out), ("picture", picture)]


def _figure(laws: Sequence[Fitted], measured: Measured) -> Figure:
    """Points, all laws, and of the best one the band of two standard deviations."""
    figure = Figure((WIDTH, 4.2), layout="constrained")
    axes = figure.subplots()
    grid = np.linspace(0.0, 1.05 * measured.speed.max(), 300)
    axes.plot(1e3 * measured.speed, measured.mu, ".", color="0.45", markersize=4, label="measured")
    for k, one in enumerate(laws):
        curve, deviation = one.band(grid)
        name = one.law.name.lower() + (" (best)" if k == 0 else "")
        axes.plot(
            1e3 * grid, curve, label=name, **line_style(k) | {"marker": "", "lw": 1.8 if k == 0 else 1.1}
        )
        if k == 0:
            whose = f"{one.of_specimens} specimens" if one.of_specimens else "the mean law"
            low, high = curve - 2.0 * deviation, curve + 2.0 * deviation
            axes.fill_between(
                1e3 * grid, low, high, alpha=0.25, lw=0, label=f"2 standard deviations of {whose}"
            )
    axes.set(xlabel="sliding speed [mm/s]", ylabel="coefficient of friction [1]")
    axes.set_xlim(0.0, 1e3 * grid[-1])
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
