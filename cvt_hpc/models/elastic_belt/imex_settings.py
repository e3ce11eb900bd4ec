"""Linearly implicit, explicit in the strands: the step that friction, bending and layer waves do not limit.

Needs of a model: a step kernel that treats its stiff forces by their linearisation and the rest explicitly.

Order 1: the push force by backward Euler, bending a quarter step ahead; the rest of the transverse motion is
a leapfrog, without numerical damping.
Stable where the explicit part is. Without a step of the job's own the model chooses one for the scene.
"""

from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers.facts import LANES, Facts
from cvt_hpc.steppers.settings import own_step

FACTS = Facts(
    order=1,
    order_at_events=1.0,  # with gaps that close and friction that turns: tests/order/test_steps.py
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of the belt's own
    implicit=True,
    l_stable=False,
    stability="tension and contact of the strands: step < 2 / their fastest frequency",
    damping="bending (w step)^2 / 8 a step, none in rings; pressed elements like a damper EA step [N s]",
)
LARGEST_STEP = own_step(None, 1e-9, 1e-3)
PARAMETERS = {
    "numerics": {
        "step_error": Parameter(
            0.02,
            "",
            "error in a vibration's amplitude that the step may cause; gives the step",
            minimum=1e-4,
            maximum=0.2,
        ),
        "step": LARGEST_STEP,
        "precision": Parameter(
            "single",
            "",
            "of the numbers in a step: 8 runs advance together in double, 16 in single",
            choices=("double", "single"),
        ),
        "lanes": LANES,
    }
}
