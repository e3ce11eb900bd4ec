"""The cheapest model of the elastic belt's ladder that answers the question, run by run.

`rules.py` has the rules and their grounds, README.md their cost and their rate of errors. Importing this
package is cheap.
"""

from cvt_hpc.models import elastic_belt
from cvt_hpc.parameters import Parameter, not_negative

# Questions that another model of the ladder answers, with the reason
ANSWERED_BY = {
    "frequencies": ("strand", "at which frequencies a strand can vibrate needs only the strand"),
    "growth": ("linear_stability", "whether small motions grow needs only the steady state's eigenvalues"),
}
PARAMETERS = {table: keys for table, keys in elastic_belt.PARAMETERS.items() if table != "rings"} | {
    "auto": {
        "question": Parameter(
            "occurrence",
            "",
            "occurrence: does it vibrate; amplitude: how far, at which frequency, in which strand; "
            "forces: mean forces and slip; frequencies: at which each strand can vibrate; "
            "growth: do small motions grow",
            choices=("occurrence", "amplitude", "forces", *ANSWERED_BY),
        ),
        "least_margin": not_negative(
            0.7, "", "distance from amplitude_threshold, in e-folds, from which a coarse run decides"
        ),
    }
}
DEFAULT_STEPPER = "imex"
STEPPERS = {"imex": elastic_belt.STEPPERS["imex"]}
REFUSED = elastic_belt.REFUSED | {
    name: "its rules were measured with imex" for name in elastic_belt.STEPPERS if name not in STEPPERS
}
GIVES, check, inert = elastic_belt.GIVES, elastic_belt.check, elastic_belt.inert
