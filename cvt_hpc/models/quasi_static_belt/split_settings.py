"""Leapfrog of the dynamic coordinates, exact lag of the others, friction and layers linearly implicit.

Needs of a model: the shapes with inertia, the lagging shapes, and its stiff forces with their slopes.

Order 1 (the push force by backward Euler; the dynamic coordinates are a leapfrog, without numerical damping).
"""

from cvt_hpc.steppers.facts import Facts
from cvt_hpc.steppers.settings import own_step

FACTS = Facts(
    order=1,
    order_at_events=1.0,  # as imex, whose treatment of gaps and of friction that turns it shares
    adaptive=False,
    needs=frozenset(),  # of a general system: it is a step of the model's own
    implicit=True,
    l_stable=False,
    stability="step < 2 / the fastest frequency of the dynamic coordinates",
    damping="none in dynamic coordinates and rings; pressed elements like a damper EA step [N s]",
)
PARAMETERS = {"numerics": {"step": own_step(50e-6 / 3.0, 1e-9, 1e-3)}}
