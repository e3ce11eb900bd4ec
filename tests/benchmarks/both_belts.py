"""Growth of small motions in the elastic belt and in the pushbelt of the same terms, and the forces before it.

    python tests/benchmarks/both_belts.py jobs/both_belts.toml > jobs/results/both_belts.csv
    python tests/benchmarks/both_belts.py jobs/both_belts.toml --set 'load=[140]' --pushbelt elements=432

The cells are the runs of a job of the elastic belt, the load as its last axis; `cvt_hpc/models/pushbelt/continuous.py`
gives the pushbelt. Of the elastic belt stands the mode that grows fastest about its steady state, also with those
elements apart that hardly touch (loosened).

The pushbelt is marched for `SETTLED`. From its rise time on it is calmed: at each sample it loses a part of the speed at
which the belt's line moves across itself, which in a steady motion is none, so that the state stays what it is. Then it
is let go three times, with a kick, a speed outwards of both strands, with half of it, and without. Each motion is
decomposed in several windows that end while it is small. The table has the median of the strongest mode, and half of
the range between the quartiles.
"""

import argparse
import csv
import sys
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

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
from cvt_hpc.vibration.damped_modes import LEAST_SAMPLES, damped_modes, thinned

SETTLED, RECORD = 0.085, 0.014  # [s]: until the kick, and from it on
CALMED = 0.4  # of a speed across the belt, at each sample
KICK, SHARES = 0.006, (0.0, 0.5, 1.0)  # [m/s]
BEGINS, LASTS = (0.5e-3, 1e-3, 2e-3, 3e-3), (7e-3, 9e-3, 11e-3)  # [s]: of windows
ORDERS = (6, 8, 10)  # of decompositions
LOWEST = 200.0  # [Hz]: above judder; the highest frequency is band_high
SMALL = 8e-6  # [m]: rms at the end of a window, less than a limit cycle has
FORCES = {"push_force": STRANDS, "ring_tension": STRANDS, "axial_force": PULLEYS}
HEAD = (
    "belt",
    "growth [1/s]",
    "scatter [1/s]",
    "frequency [Hz]",
    "loosened growth [1/s]",
    "loosened frequency [Hz]",
)


def calm(run: ElementRun) -> None:
    """Take a part of the speed across the belt from its elements."""
    elements, speeds = run._by_field(), list(run._speeds[:2])
    line = elements[list(run._saddle)].reshape(2, -1)
    along = np.roll(line, -1, axis=1) - np.roll(line, 1, axis=1)
    along /= np.hypot(*along)
    across = np.array([along[1], -along[0]])
    lost = CALMED * (elements[speeds].reshape(2, -1) * across).sum(axis=0) * across
    elements[speeds] -= lost.reshape(elements[speeds].shape)


def marched(run: ElementRun, samples: int) -> None:
    """March, or say why not."""
    if (failure := run.advance(samples)) is not None:
        raise RuntimeError(failure[1])


def twins(run: ElementRun, samples: int) -> np.ndarray:
    """Displacement (3, time, probe) [m] from the present state on, without a kick, with half of it, and with it."""
    begun, state, found = run.done, [array.copy() for array in run._reached()], []
    for share in SHARES:
        run.done = begun
        for own, kept in zip(run._reached(), state, strict=True):
            own[...] = kept
        run.parameters = {**run.parameters, "kick": share * KICK}
        if share:
            run._kick()
        marched(run, samples)
        found.append(run.displacement[begun:].copy())
    return np.array(found)


def strongest(motions: np.ndarray, rate: float, highest: float) -> list[float]:
    """Growth rate, its scatter [1/s], and frequency [Hz] of the strongest mode of small motions; nan: none is."""
    found = []
    for motion in motions:
        seen, thin = thinned(motion - motion.mean(axis=0), rate, highest)
        for begin, last in product(BEGINS, LASTS):
            part = seen[round(begin * thin) : round((begin + last) * thin)]
            part = part - part.mean(axis=0)
            if len(part) < LEAST_SAMPLES or part[-len(part) // 4 :].std() > SMALL:
                continue
            for one in damped_modes(part, thin, ORDERS):
                inside = (one.frequency > LOWEST) & (one.frequency < highest)
                if inside.any():
                    k = np.argmax(np.where(inside, one.share, 0.0))
                    found.append((one.growth[k], one.frequency[k]))
    if not found:
        return [np.nan] * 3
    low, growth, high = np.quantile([growth for growth, _ in found], [0.25, 0.5, 0.75])
    return [growth, 0.5 * (high - low), np.median([frequency for _, frequency in found])]


def of_pushbelt(cell: Job, settings: dict[str, Any]) -> list[float]:
    """Numbers of the pushbelt of a cell, as HEAD and FORCES."""
    job = pushbelt_jobs(cell, settings)[0]
    run = load_model(job.model).batch([job.point(0)], job.stepper).runs[0]
    rate = 1.0 / run.interval
    run.first_judged = run.samples  # nothing is summed
    marched(run, run.risen)
    while run.done < round(SETTLED * rate):
        calm(run)
        marched(run, 1)
    late = slice(run.done - round(5e-3 * rate), run.done)
    forces = [run.channel(f"{name} {place}")[late].mean() for name, at in FORCES.items() for place in at]
    found = strongest(twins(run, round(RECORD * rate)), rate, cell.parameters["band_high"])
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
    parser.add_argument(
        "--pushbelt", action="append", default=[], metavar="KEY=VALUE", help="of its own keys"
    )
    arguments = parser.parse_args()
    job, of_elastic_belt = load_job(arguments.job, arguments.set), ElasticBelts()
    settings = dict(assignment.split("=") for assignment in arguments.pushbelt)
    names = [axis.name for axis in job.axes]
    forces = [f"{name} {place} [N]" for name, at in FORCES.items() for place in at]
    sys.stdout.writelines(origin_lines())
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow([*names, *HEAD, *forces, "reason"])
    belts = {
        "elastic_belt": of_elastic_belt,
        " ".join(["pushbelt", *arguments.pushbelt]): lambda cell: of_pushbelt(cell, settings),
    }
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
