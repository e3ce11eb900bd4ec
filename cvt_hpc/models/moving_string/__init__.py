"""A string that runs between two eyes: the strand of a belt without bending, push force and neighbours.

    m (w_tt + 2 v w_xt + v^2 w_xx) = T w_xx,   w = 0 at x = 0 and x = L,

m its mass per length, T its tension, v its speed, c = sqrt(T / m). Eigenfrequencies n (c^2 - v^2) / (2 c L);
from v = c on it holds no shape (critical speed).
"""

from cvt_hpc.models.moving_string.parameters import PARAMETERS, check, inert
from cvt_hpc.steppers import taken

DEFAULT_STEPPER = "runge_kutta_4"
REFUSED = {
    "moreau": "nothing rubs here: it is for set-valued friction and rigid contact",
}
STEPPERS = taken(REFUSED)

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
