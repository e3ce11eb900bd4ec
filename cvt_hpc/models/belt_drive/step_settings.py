"""Generalised-alpha by cyclic blocks: belt, contacts and pulleys in one implicit stage, by Newton's method.

Needs of a model: a step kernel with Newton's method and dual slopes of friction.

Order 2 between contacts' events, 1 at these. It resolves motion slower than the step and damps the rest.
"""

from dataclasses import replace

from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers.facts import Facts
from cvt_hpc.steppers.settings import MOST_ITERATIONS, SPEED_TOLERANCE, own_step

FACTS = Facts(
    order=2,
    order_at_events=1.0,
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of the belt drive's own
    implicit=True,
    l_stable=False,
    stability="no limit",
    damping="a vibration that the step does not resolve keeps spectral_radius of its amplitude a step",
)
PARAMETERS = {
    "numerics": {
        "step": own_step(1e-4, 1e-8, 1e-3),
        "spectral_radius": Parameter(
            0.6,
            "",
            "share that a step leaves of a vibration that it does not resolve; 1: the midpoint rule",
            minimum=0.0,
            maximum=1.0,
        ),
        "speed_tolerance": replace(SPEED_TOLERANCE, default=1e-5),
        "most_iterations": replace(MOST_ITERATIONS, default=20),
    }
}
