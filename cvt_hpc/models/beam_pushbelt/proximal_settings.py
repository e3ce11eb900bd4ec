"""Half explicit: forces at the start of a step, set-valued laws at its end, by proximal points.

Needs of a model: a step kernel that couples its contacts.

Order 1, Moreau's time stepping. Elastic contacts are explicit and limit the step; the ring's elasticity is
linearly implicit unless theta is 0.
"""

from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers.facts import Facts
from cvt_hpc.steppers.settings import own_step

FACTS = Facts(
    order=1,
    order_at_events=1.0,
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of one model's own
    implicit=False,
    l_stable=False,
    stability="step < 2 / w of elements that press on each other; with theta 0 of the ring's beams, too",
    damping="none with theta 1/2; more lets the ring's fast vibrations decay",
)
PARAMETERS = {
    "numerics": {
        "step": own_step(1e-6, 1e-8, 1e-4),
        "theta": Parameter(
            0.5,
            "",
            "0: the ring's elasticity is explicit; 1/2 to 1: linearly implicit, damped above 1/2",
            minimum=0.0,
            maximum=1.0,
        ),
        "law_tolerance": Parameter(
            1e-5,
            "m/s",
            "speed up to which a set-valued law counts as fulfilled, impulses by the speed that they change",
            minimum=1e-12,
            maximum=1.0,
            sensible=(1e-12, 0.01),
        ),
        "most_sweeps": Parameter(500, "", "sweeps over all contacts in a step", minimum=1, maximum=1000000),
    }
}
