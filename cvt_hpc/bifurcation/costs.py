"""Expected cost of a bifurcation diagram, by the cost models of its steady states and its runs."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cvt_hpc.bifurcation.job import Asked, Diagram
from cvt_hpc.job.summary import core_time_in_words, values_in_words
from cvt_hpc.models.contract import load_model
from cvt_hpc.tables import columns

# of a first state: a further one beside a known state with its modes, 40 ms and 100 ms where that takes 1 s
FURTHER = 0.14
ENDS = 2  # places along the load where vibration begins or ends, with closer runs beside them


class Cost(NamedTuple):
    """Of a branch: core-seconds of its steady states and of its runs, and the number of runs."""

    steady: float
    transient: float
    runs: int

    @property
    def total(self) -> float:
        """Core-seconds [s]."""
        return self.steady + self.transient


def predicted_cost(diagram: Diagram, asked: Asked) -> Cost:
    """Return the cost of a branch where vibration begins once and ends once.

    Parameters
    ----------
    diagram : Diagram
        The requested diagram.
    asked : Asked
        One of its branches.
    """
    first = float(load_model(diagram.job.model).cost(asked.parameters, None))
    steady = first * (1.0 + FURTHER * len(diagram.loads))
    if not diagram.disturbance:
        return Cost(steady, 0.0, 0)
    closer = np.ceil(np.diff(diagram.loads).mean() / diagram.resolution) - 1.0
    runs = len(diagram.disturbance) * (len(diagram.loads) + ENDS * int(max(closer, 0.0)))
    model, parameters, stepper = load_model(asked.runs.model), asked.runs.parameters, asked.runs.stepper
    each = float(model.cost(parameters, stepper)) / model.lanes(parameters, stepper)
    return Cost(steady, runs * each, runs)


def plan_lines(diagram: Diagram) -> Iterator[str]:
    """Yield the lines that describe a diagram and its expected cost."""
    job, loads = diagram.job, diagram.loads
    costs = [predicted_cost(diagram, asked) for asked in diagram.branches]
    yield f"diagram {job.name} ({job.source}): {len(costs)} branches of {len(loads)} loads"
    if job.description:
        yield job.description
    axes = [(axis.name, values_in_words(axis, job.schema), f"{len(axis.values)} values") for axis in job.axes]
    yield from columns(axes)
    steady, transient = (sum(getattr(cost, name) for cost in costs) for name in ("steady", "transient"))
    yield f"steady states: {len(costs) * len(loads)}, {core_time_in_words(steady)}"
    runs = sum(cost.runs for cost in costs)
    ends = f", if vibration begins and ends once along each branch: {core_time_in_words(transient)}"
    yield f"runs: {f'about {runs}{ends}' if runs else 'none'}"
    total = core_time_in_words(steady + transient)
    yield f"estimated cost: {total}, in one process"
