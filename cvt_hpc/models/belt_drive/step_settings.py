"""Generalised-alpha by cyclic blocks: belt, contacts and pulleys in one implicit stage, by Newton's method.

Needs of a model: a step kernel with Newton's method and dual slopes of friction.

Order 2 between contacts' events, 1 at these. It resolves motion slower than the step and damps the rest.
"""

from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers.facts import Facts

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
        "step": Parameter(
            1e-4,
            "s",
            "largest time step; a whole number of steps makes a sampling interval",
            minimum=1e-8,
            maximum=1e-3,
            sensible=(1e-8, 1e-3),
        ),
        "spectral_radius": Parameter(
            0.6,
            "",
            "share that a step leaves of a vibration that it does not resolve; 1: the midpoint rule",
            minimum=0.0,
            maximum=1.0,
        ),
        "speed_tolerance": Parameter(
            1e-5,
            "m/s",
            "largest correction of a speed with which the equations of a step count as solved",
            minimum=1e-12,
            maximum=1.0,
            sensible=(1e-12, 0.1),
        ),
        "most_iterations": Parameter(20, "", "iterations of a step", minimum=2, maximum=1000),
    }
}
