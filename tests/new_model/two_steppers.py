"""The same runs by two steppers: how many vibrate, and what a run costs."""

from typing import NamedTuple

from matplotlib.figure import Figure

from cvt_hpc.analysis.figures import WIDTH, draw
from cvt_hpc.experiments.outcome import Outcome
from cvt_hpc.experiments.sweeps import Sweep, load_sweep, run_sweeps, sweep_lines
from cvt_hpc.job import Job, build_job, rebuild_job
from cvt_hpc.job.document import read_document, read_table
from cvt_hpc.parameters import Parameter
from cvt_hpc.storage.files import write_rows
from cvt_hpc.storage.netcdf import global_attributes
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study import process_rank
from cvt_hpc.study.status import STALLED
from cvt_hpc.tables import columns
from cvt_hpc.variables import Vibrates

KEYS = {"second": Parameter(None, "", "stepper beside that of the job")}
HEAD = ["stepper", "vibrating", "core_seconds"]


class Asked(NamedTuple):
    """The job, and its runs by each stepper."""

    job: Job
    sweeps: list[Sweep]


def load(path, overrides=()):
    """Read and check a job file."""
    document = read_document(path)
    table = read_table(KEYS, document.pop("two_steppers", None), f"{path}: [two_steppers]")
    job = build_job(document, str(path), overrides)
    second = rebuild_job(job.resolved() | {"stepper": table["second"]}, str(path), job.units)
    return Asked(job, [Sweep(each.stepper, (), each) for each in (job, second)])


def plan_lines(asked, out):
    """Yield the lines of `cvt-hpc check`."""
    yield f"two_steppers {asked.job.name} ({asked.job.source}): {asked.job.size} runs by two steppers"
    yield from sweep_lines(asked.sweeps, {}, out)


def make(asked, out, *, fresh, tell):
    """Do the runs, and write a table and a picture."""
    status = run_sweeps(asked.sweeps, {}, out, fresh=fresh, tell=tell)
    if status >= STALLED or process_rank() != 0:
        return Outcome(status=status)
    rows = []
    for sweep in asked.sweeps:
        found = load_sweep(sweep.name, out)
        vibrating = int((found["vibrates"] == Vibrates.YES).sum())
        rows.append([sweep.name, str(vibrating), f"{found['core_seconds'].mean().item():.3g}"])
    made = global_attributes(asked.job, asked.job.resolved(), "runs by two steppers")
    table = write_rows(out / "two_steppers.csv", HEAD, rows, origin_lines(made))
    picture = draw(lambda: figure(rows), out / "two_steppers.png")
    return Outcome(list(columns([HEAD, *rows])), [("table", table), ("picture", picture)], status)


def figure(rows):
    """Compose the picture: vibrating runs against cost."""
    sheet = Figure((WIDTH, 3.0), layout="constrained")
    axes = sheet.subplots()
    for stepper, vibrating, cost in rows:
        axes.plot(float(cost), int(vibrating), "o", label=stepper)
    axes.set(xlabel="core-seconds per run", ylabel="vibrating runs")
    axes.legend()
    return sheet
