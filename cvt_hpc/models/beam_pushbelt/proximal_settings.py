"""Half explicit: forces at the start of a step, set-valued laws at its end, by proximal points.

Needs of a model: a step kernel that couples its contacts.

Order 1, Moreau's time stepping. Elastic contacts are explicit and limit the step; the ring's elasticity is
linearly implicit.
"""

from cvt_hpc.steppers.facts import Facts
from cvt_hpc.steppers.settings import own_step

FACTS = Facts(
    order=1,
    order_at_events=1.0,
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of one model's own
    implicit=False,
    l_stable=False,
    stability="step < 2 / w of elements that press on each other",
    damping="none",
)
PARAMETERS = {"numerics": {"step": own_step(1e-6, 1e-8, 1e-4)}}
