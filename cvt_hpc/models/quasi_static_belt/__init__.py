"""The elastic belt with all motion faster than a limit frequency lagging behind its forces.

Another model than `elastic_belt`, made of its parts: `docs/guide/theory_belt.md` states the common and the
dropped parts, and why the equations as printed do not vibrate. Importing this package is cheap.
"""

from cvt_hpc.models import elastic_belt
from cvt_hpc.parameters import Parameter
from cvt_hpc.steppers import taken
from cvt_hpc.variator.scene import TILT

# elements without moment and tilt, no curvature terms, and the rings as one
PARAMETERS = {
    table: {key: parameter for key, parameter in keys.items() if key not in TILT}
    for table, keys in elastic_belt.PARAMETERS.items()
    if table not in ("bending", "rings")
} | {
    "limit": {
        "limit_frequency": Parameter(
            1000.0,
            "Hz",
            "shapes of a higher own frequency follow their forces with a lag",
            minimum=0.0,
            exclusive=True,
            sensible=(10.0, 1e6),
        ),
        "split": Parameter(
            "free_splines",
            "",
            "frequency that counts: that of each spline without grooves or with them, or of eigenmodes",
            choices=("free_splines", "held_splines", "modes"),
        ),
        "spline_spacing": Parameter(
            0.02,
            "m",
            "of the coarse splines all around; halved on the arcs and again at their ends",
            minimum=0.0,
            exclusive=True,
            sensible=(2e-3, 0.1),
        ),
        "longitudinal": Parameter(
            "inertia",
            "",
            "along the path: inertia and the whole equation of continuity, or the steady flow of Bullinger "
            "et al. 2005, eqs 28-30, as printed",
            choices=("inertia", "steady_flow"),
        ),
    },
}
DEFAULT_STEPPER = "split"
OWN_STEPPERS = {"split": "cvt_hpc.models.quasi_static_belt.split_settings"}
REFUSED = elastic_belt.REFUSED | dict.fromkeys(
    (*elastic_belt.OWN_STEPPERS, *taken(elastic_belt.REFUSED)),
    "the rates of what lags follow from forces that know them: the model has a step of its own",
)
STEPPERS = OWN_STEPPERS
KICK, check, inert = elastic_belt.KICK, elastic_belt.check, elastic_belt.inert
