"""A mass on a spring, dragged by a belt that runs below it: the smallest model with friction noise.

    m x'' + c x' + k x = N mu(v - x'),

x the displacement of the mass, v the speed of the belt, N the normal load. It is the radial oscillator of
Lebrecht et al. 2004 (eqs 13-14: elements that creep through the groove at v_0) with the weights of its forces
put together: c = d_belt, k = c_belt + 2 c_ele tan(theta) (tan(theta) + mu_0), N = 2 f_ax,0.

Steppers other than `moreau` take the friction law with its jump at rest smoothed over `friction_speed`;
`moreau` takes it as it is.
"""

from cvt_hpc.models.oscillator.parameters import PARAMETERS, check
from cvt_hpc.steppers import STEPPERS

DEFAULT_STEPPER = "moreau"
REFUSED = {
    "imex": "it is the elastic belt's own step",
    "explicit": "it is the elastic belt's own step; symplectic_euler is the same method",
}
STEPPER_NAMES = tuple(name for name in STEPPERS if name not in REFUSED)

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "REFUSED", "STEPPER_NAMES", "check"]
