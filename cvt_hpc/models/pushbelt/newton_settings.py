"""Semi-implicit: magnitudes of stiff forces at the end of a step, their directions at its start.

Needs of a model: a step kernel with Newton's method and dual slopes of friction.

Order 1. Tension, friction and dampers of contacts are implicit, so that they do not limit the step;
transverse motion of the strands is a leapfrog, without numerical damping, which does. Contacts that close one
after the other along a strand take an iteration each, so that a step of 20 us may need 25.
"""

from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers.facts import Facts
from cvt_hpc.steppers.settings import MOST_ITERATIONS, SPEED_TOLERANCE, own_step

FACTS = Facts(
    order=1,
    order_at_events=1.0,  # contacts close and open in every step: tests/exact/test_pushbelt.py halves it
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of the pushbelt's own
    implicit=True,
    l_stable=False,
    stability="transverse waves of the strands: step < pitch / sqrt(T / m)",
    damping="none of the strands' transverse motion; rings like a damper of stiffness x step",
)
PARAMETERS = {
    "numerics": {
        "step": own_step(1e-5, 1e-8, 1e-3),
        "speed_tolerance": SPEED_TOLERANCE,
        "power_tolerance": Parameter(
            1.0,
            "W",
            "largest power that these equations may leave open over the whole belt",
            minimum=1e-9,
            maximum=1e6,
            sensible=(1e-9, 1e3),
        ),
        "most_iterations": MOST_ITERATIONS,
    }
}
