"""Requirements of a chart on its models, checked before anything is computed."""

from collections.abc import Iterable
from itertools import product

from cvt_hpc.chart.measuring import exact_displacement
from cvt_hpc.chart.plan import Chart, Point, Role, Scene
from cvt_hpc.chart.quantities import channels_needed
from cvt_hpc.chart.timed_runs import most_lanes
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.models.contract import load_model


def check_prospects(chart: Chart) -> None:
    """Check that the models record the judged quantities, have the exact solution if used, and the lanes.

    Raises
    ------
    InputError
        If one does not.
    """
    for scene in chart.scenes:
        where = f"{chart.source}: [chart.scenes.{scene.name}]"
        (point,) = chart.points_of(scene.name, Role.REFERENCE)
        if scene.exact:
            _check_exact(point, where)
        models = dict.fromkeys(p.job.model for p in chart.points if p.scene == scene.name)
        _check_channels(models, scene, where)
        if scene.lead is not None:
            _check_lead(point, where)
    for point in chart.points:
        most = most_lanes(point.job)
        if point.lanes > most:
            where = f"{chart.source}: [chart.methods.{point.series}] lanes"
            raise mismatch(where, f"at most {most} with stepper {point.job.stepper}", f"{point.lanes}")


def _check_exact(point: Point, where: str) -> None:
    if not load_model(point.job.model).has_exact:
        found = f"{point.job.model}, which has none"
        raise mismatch(f"{where} reference", "a model with an exact solution", found)
    try:
        exact_displacement(point, 0)
    except InputError as error:
        raise InputError(f"{where} reference: {error}") from error


def _check_lead(point: Point, where: str) -> None:
    if not load_model(point.job.model).takes_over:
        raise mismatch(f"{where} lead", "a model whose runs can take over from others", point.job.model)


def _check_channels(models: Iterable[str], scene: Scene, where: str) -> None:
    needed = channels_needed(scene.quantities)
    if scene.exact and needed:
        raise mismatch(f"{where} quantities", "those that an exact solution has", f"channel {needed[0]}")
    for channel, model in product(needed, models):
        if channel not in load_model(model).channels:
            raise mismatch(f"{where} quantities", f"a model that records {channel}", model)
