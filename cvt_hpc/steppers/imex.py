"""Linearly implicit, explicit in the strands: the step that friction and longitudinal waves do not limit.

Needs of a model: a step kernel that treats its stiff forces by their linearisation and the rest explicitly.

Order 1 (longitudinal forces by backward Euler; the transverse motion is a leapfrog, without numerical
damping). Stable where the explicit part is: the reference belt at 160 stations is computed up to 10 us and
fails, visibly, at 12.5 us. Accurate before that: at 3 us amplitudes of a vibrating strand are within 3 %, its
frequency within 0.6 %.
"""

from cvt_hpc.parameters import Parameter

ORDER = 1
PARAMETERS = {
    "numerics": {
        "step": Parameter(
            3e-6,
            "s",
            "largest time step; a whole number of steps makes a sampling interval",
            minimum=1e-9,
            maximum=1e-3,
        ),
        "precision": Parameter(
            "double",
            "",
            "of the numbers in a step: 8 runs advance together in double, 16 in single",
            choices=("double", "single"),
        ),
    }
}
