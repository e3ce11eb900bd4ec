"""From a chart job to its measurements: every run of it is built and checked before any computing."""

from pathlib import Path

from cvt_hpc.chart.declarations import CHART
from cvt_hpc.chart.plan import Chart, Point
from cvt_hpc.chart.points import budget_points, method_points, reference_points
from cvt_hpc.chart.scenes import read_stage
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.job.assignments import Assignments, split_assignments
from cvt_hpc.job.definition import HEADER
from cvt_hpc.job.document import read_document, read_table, read_tables


def load_chart(path: str | Path, overrides: Assignments = ()) -> Chart:
    """Read and validate a chart job.

    Parameters
    ----------
    path : str or Path
        A TOML file: a job with a table [chart].
    overrides : mapping, or sequence of "KEY=VALUE"
        Values that replace those of the job and of all its scenes.

    Returns
    -------
    Chart
        With every run built and checked.

    Raises
    ------
    InputError
        If anything is wrong with the file or an override.
    """
    source = str(path)
    document = read_document(Path(path))
    if "chart" not in document:
        then = "`cvt-hpc examples chart_oscillator` copies a job that has one"
        raise mismatch(f"{source}: chart", "a table [chart]", "nothing", then)
    table = document.pop("chart")
    if "axes" in document:
        raise InputError(f"{source}: [axes]: expected no axes in a chart job, found some")
    replaced = split_assignments(overrides, source, "--set")
    for key in replaced:
        if key in HEADER:
            raise mismatch(f"{source}: --set {key}", "a parameter of the scenes", f"the job's {key}")
    where = f"{source}: [chart]"
    settings = read_table(CHART, table, where, ("scenes", "methods", "budget"))
    scenes = read_tables(table.get("scenes"), f"{where} scenes", "scenes")
    stages = [read_stage(name, raw, document, replaced, source) for name, raw in scenes.items()]
    points: list[Point] = []
    for stage, raw in zip(stages, scenes.values(), strict=True):
        points += reference_points(stage, raw.get("reference"))
    for name, raw in read_tables(table.get("methods"), f"{where} methods", "methods").items():
        points += method_points(name, raw, stages, f"{source}: [chart.methods.{name}]")
    budgeted: tuple[str, ...] = ()
    if "budget" in table:
        choices, budgeted = budget_points(table["budget"], stages, f"{source}: [chart.budget]")
        points += choices
    job, chosen = points[0].job, tuple(stage.scene for stage in stages)
    head = job.name, job.description, source
    return Chart(*head, chosen, tuple(points), **settings, budgeted=budgeted)
