"""Growth of small motions in the elastic belt and in the pushbelt of the same terms, and the forces before it.

    python tests/benchmarks/both_belts.py jobs/both_belts.toml > jobs/results/both_belts.csv
    python tests/benchmarks/both_belts.py jobs/both_belts.toml --pushbelt elements=432 'step=5 us'

The cells are the runs of a job of the elastic belt, the load as its last axis; `cvt_hpc/models/pushbelt/continuous.py`
gives the pushbelt. Of the elastic belt stands the mode that grows fastest about its steady state, also with those
elements apart that hardly touch (loosened).

The pushbelt is marched for `SETTLED`, until the loaded strand has closed its gaps: up to 0.1 s after the start its push
falls and jumps by up to 3 kN as they go round, and a jump throws both strands by some um.
From its rise time on it is calmed: at each sample it loses a part of the speed at which the belt's line moves across
itself. A steady motion has that speed, too, where the curvature of the path changes, 30 to 70 mm/s at the ends of the
arcs, so that the calmed line lies some 10 um beside the steady one. So the rate of calming fades within `LET_GO`. A
vibration that grows then does so from the chatter of the elements to its limit cycle. A cubic term limits
its amplitude a by da/dt = sigma a (1 - a^2 / a_inf^2), so that its energy is E_inf / (1 + c exp(-2 sigma t)). The growth
rate sigma is that of the course of this form that fits the energy of the probes best, and `misfit` how far the energy is
from it (rms of the logarithm). The table has the median over several beginnings, and half of the range between the
quartiles. A pushbelt whose energy does not grow, or by another course, has no growth rate.
"""

import argparse
import csv
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import butter, hilbert, sosfiltfilt

from cvt_hpc.experiments.ladder.loading import pushbelt_jobs
from cvt_hpc.job import Job, build_job, load_job
from cvt_hpc.models.contract import load_model
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.linear_stability.modes import loosened, modes
from cvt_hpc.models.pushbelt.run import ElementRun
from cvt_hpc.models.steady_variator.record import quantities
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.variator import PULLEYS, STRANDS

SETTLED, RECORD = 0.12, 0.08  # [s]: until it is let go, and from then on
CALMING = 4.6e4  # [1/s]: rate at which the speed across the belt falls
LET_GO, FADING = 5.4e-3, 1e-3  # [s]: last part of SETTLED, in which that rate falls to 200 1/s; its decay
BEGINS, LEFT_OUT = (
    (2e-3, 4e-3, 6e-3),
    4e-3,
)  # [s]: of the courses that are fitted, and at the end, of the filter
LOWEST = 350.0  # [Hz]: above judder and the first modes that decay; the highest frequency is band_high
LEAST_GROWTH = 2.0  # of the logarithm of the energy, from the first to the last value of the course
MOST_MISFIT = 0.12
FORCES = {"push_force": STRANDS, "ring_tension": STRANDS, "axial_force": PULLEYS}
HEAD = (
    "belt",
    "growth [1/s]",
    "scatter [1/s]",
    "frequency [Hz]",
    "misfit",
    "limit cycle [m]",
    "loosened growth [1/s]",
    "loosened frequency [Hz]",
)


def calm(run: ElementRun, share: float) -> None:
    """Take a share of the speed across the belt from its elements."""
    elements, speeds = run._by_field(), list(run._speeds[:2])
    line = elements[list(run._saddle)].reshape(2, -1)
    along = np.roll(line, -1, axis=1) - np.roll(line, 1, axis=1)
    along /= np.hypot(*along)
    across = np.array([along[1], -along[0]])
    lost = share * (elements[speeds].reshape(2, -1) * across).sum(axis=0) * across
    elements[speeds] -= lost.reshape(elements[speeds].shape)


def marched(run: ElementRun, samples: int) -> None:
    """March, or say why not."""
    if (failure := run.advance(samples)) is not None:
        raise RuntimeError(failure[1])


class Course(NamedTuple):
    """The course of a vibration that a cubic term limits, and how far the motion is from it."""

    growth: float  # [1/s]
    frequency: float  # [Hz], of the part with less than half of the energy at last
    misfit: float  # rms of the logarithm of the energy
    limit: float  # amplitude at last [m], rms over the probes
    grown: float  # of the logarithm of the energy


def course(motion: np.ndarray, rate: float, band: tuple[float, float], begin: float) -> Course:
    """Return the course that fits a motion (time, probe) [m] at a rate [Hz] best from a time [s] on.

    With the energy E = E_inf / (1 + c exp(-2 sigma t)), log E is linear in t at first, constant at last.
    """
    passed = sosfiltfilt(
        butter(4, band, "bandpass", fs=rate, output="sos"), motion - motion.mean(axis=0), axis=0
    )
    analytic = hilbert(passed, axis=0)[round(begin * rate) : -round(LEFT_OUT * rate)]
    energy = 0.5 * (np.abs(analytic) ** 2).mean(axis=1)
    measured, time = np.log(energy), np.arange(len(energy)) / rate

    def log_energy(of: np.ndarray) -> np.ndarray:
        last, begun, growth = of
        return last - np.logaddexp(0.0, -(begun + 2.0 * growth * time))

    fits = [
        least_squares(
            lambda of: log_energy(of) - measured, [measured.max(), -4.0, guess], loss="soft_l1", f_scale=0.3
        )
        for guess in (30.0, 100.0, 300.0)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    followed = log_energy(best.x)
    turned = np.angle((analytic[1:] * analytic[:-1].conj()).sum(axis=1))
    weights = np.where(followed[:-1] < best.x[0] - np.log(2.0), energy[:-1], 0.0)
    return Course(
        growth=float(best.x[2]),
        frequency=float(np.average(turned, weights=weights) * rate / (2.0 * np.pi))
        if weights.any()
        else np.nan,
        misfit=float(np.sqrt(((followed - measured) ** 2).mean())),
        limit=float(np.exp(0.5 * best.x[0])),
        grown=float(followed[-1] - followed[0]),
    )


def growth(motion: np.ndarray, rate: float, highest: float) -> list[float]:
    """Growth rate, its scatter [1/s], frequency [Hz], misfit, and limit cycle [m] of a motion; nan: none grows."""
    courses = [course(motion, rate, (LOWEST, highest), begin) for begin in BEGINS]
    fitting = [one for one in courses if one.grown > LEAST_GROWTH and one.misfit < MOST_MISFIT]
    if not fitting:
        return [np.nan] * 5
    low, median, high = np.quantile([one.growth for one in fitting], [0.25, 0.5, 0.75])
    others = np.median([(one.frequency, one.misfit, one.limit) for one in fitting], axis=0)
    return [median, 0.5 * (high - low), *others]


def of_pushbelt(cell: Job, settings: dict[str, Any]) -> list[float]:
    """Numbers of the pushbelt of a cell, as HEAD and FORCES."""
    job = pushbelt_jobs(cell, settings)[0]
    run = load_model(job.model).batch([job.point(0)], job.stepper).runs[0]
    rate = 1.0 / run.interval
    run.first_judged = run.samples  # nothing is summed
    marched(run, run.risen)
    while run.done < round(SETTLED * rate):
        fading = max(0.0, run.done / rate - (SETTLED - LET_GO)) / FADING
        calm(run, -np.expm1(-CALMING / rate * np.exp(-fading)))
        marched(run, 1)
    late = slice(run.done - round(5e-3 * rate), run.done)
    forces = [run.channel(f"{name} {place}")[late].mean() for name, at in FORCES.items() for place in at]
    begun = run.done
    marched(run, round(RECORD * rate))
    found = growth(run.displacement[begun : run.done], rate, cell.parameters["band_high"])
    return [*found, np.nan, np.nan, *forces]


class ElasticBelts:
    """The elastic belts of cells, each steady state from the one before."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = {}

    def __call__(self, cell: Job) -> list[float]:
        """Numbers of the elastic belt of a cell, as HEAD and FORCES."""
        alike = {key: value for key, value in cell.parameters.items() if key != "load"}
        if alike != self._known:
            self._known, self._belt, self._near = alike, SteadyBelt(cell.parameters), None
        grid = mesh(cell.parameters)
        try:
            self._near = self._belt.at(cell.parameters["load"], self._near)
        except NoSteadyState as error:
            raise RuntimeError(str(error)) from error
        band = LOWEST, cell.parameters["band_high"]
        first, loose = modes(self._near, grid, band)[0], loosened(self._near)
        apart = modes(loose, grid, band)[0] if loose else first
        means = quantities(self._near, grid)
        named = (means[name] if name in means else means[f"mean_{name}"] for name in FORCES)
        return [
            first.growth,
            np.nan,
            first.frequency,
            np.nan,
            np.nan,
            apart.growth,
            apart.frequency,
            *np.concatenate(list(named)),
        ]


def cells(job: Job) -> Iterator[Job]:
    """Yield a job of one run for each run of a job."""
    given = {*job.given, *(axis.name for axis in job.axes)}
    for index in range(job.size):
        point = job.point(index)
        yield build_job(
            {"name": job.name, "model": job.model}, job.source, {key: point[key] for key in given}
        )


def main() -> None:
    """Print two rows for each cell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("job")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of the job")
    told = "of one pushbelt, by its own keys; may be repeated"
    parser.add_argument("--pushbelt", action="append", nargs="+", metavar="KEY=VALUE", help=told)
    arguments = parser.parse_args()
    job, of_elastic_belt = load_job(arguments.job, arguments.set), ElasticBelts()
    names = [axis.name for axis in job.axes]
    forces = [f"{name} {place} [N]" for name, at in FORCES.items() for place in at]
    sys.stdout.writelines(origin_lines())
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow([*names, *HEAD, *forces, "reason"])
    belts: dict[str, Callable[[Job], list[float]]] = {"elastic_belt": of_elastic_belt}
    for asked in arguments.pushbelt or [[]]:
        settings = dict(assignment.split("=") for assignment in asked)
        belts[" ".join(["pushbelt", *asked])] = partial(of_pushbelt, settings=settings)
    for cell in cells(job):
        for belt, numbers in belts.items():
            found, reason = [np.nan] * (len(HEAD) - 1 + len(forces)), ""
            try:
                found = numbers(cell)
            except RuntimeError as error:
                reason = str(error)
            shown = ["" if np.isnan(number) else f"{number:.5g}" for number in found]
            rows.writerow([*(f"{cell.parameters[name]:g}" for name in names), belt, *shown, reason])
            sys.stdout.flush()


if __name__ == "__main__":
    main()
