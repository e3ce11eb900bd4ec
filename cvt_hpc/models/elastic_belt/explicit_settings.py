"""Symplectic Euler: the plain explicit step, slow and simple, by which faster ones are judged.

Needs of a model: its right-hand side alone.

Order 1. Stable below 2 / (largest rate of the model): dampers of the layers and waves in the shortest cells,
then friction near zero sliding speed. With the default mesh the limit is 0.05 us; with even cells friction
sets it, at 0.19 to 0.24 us over the map of jobs/lebrecht_2004.toml.
"""

from dataclasses import replace

from cvt_hpc.models.elastic_belt.belt_settings import layer_count
from cvt_hpc.models.elastic_belt.deflection_settings import refuse_moving_discs
from cvt_hpc.models.elastic_belt.imex_settings import LARGEST_STEP
from cvt_hpc.parameters import Parameter, Parameters, Problem
from cvt_hpc.steppers.facts import LANES, Facts

FACTS = Facts(
    order=1,
    order_at_events=1.0,  # with gaps that close and friction that turns: tests/order/test_steps.py
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of the belt's own
    implicit=False,
    l_stable=False,
    rest_limit=2.0,
    vibration_limit=2.0,
    stability="step < 2 / the fastest rate: dampers and waves in the shortest cells, friction at rest",
    damping="none",
)
PARAMETERS = {
    "numerics": {
        "step": replace(LARGEST_STEP, default=4e-8),
        "precision": Parameter(
            "double",
            "",
            "precision of the numbers in a step; this step has no other; 8 runs advance together",
            choices=("double",),
        ),
        "lanes": LANES,
    }
}


def check(parameters: Parameters) -> list[Problem]:
    """Problems of a run: the step's kernels know the rings as one, and discs without inertia."""
    found, count = refuse_moving_discs(parameters), layer_count(parameters)
    if count > 1:
        told = "1 with the explicit step; layers take imex or a general method such as dormand_prince"
        found.insert(0, ("ring_layers", told, str(count)))
    return found
