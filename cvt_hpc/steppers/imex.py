"""Linearly implicit, explicit in the strands: the step that friction and longitudinal waves do not limit.

Needs of a model: a step kernel that treats its stiff forces by their linearisation and the rest explicitly.

Order 1 (longitudinal forces by backward Euler; the transverse motion is a leapfrog, without numerical
damping). Stable where the explicit part is: on the reference belt at 160 stations up to 7.7 us. Accurate
before that: c dt / h below about 5, c the speed of longitudinal waves in the pressed elements, h the mesh
width.
"""

from cvt_hpc.parameters import Parameter

ORDER = 1
PARAMETERS = {
    "numerics": {
        "step": Parameter(
            2.5e-6,
            "s",
            "largest time step; a whole number of steps makes a sampling interval",
            minimum=1e-9,
            maximum=1e-3,
        )
    }
}
