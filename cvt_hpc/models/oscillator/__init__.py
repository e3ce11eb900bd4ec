"""A mass on a spring, dragged by a belt that runs below it: the smallest model with friction noise.

    m x'' + c x' + k x = P + N(x) mu(v - x'),   N(x) = N_0 - n x,

x the displacement of the mass, v the speed of the belt, N the normal load, P a constant force. It is the
radial oscillator of Lebrecht et al. 2004 in full (eqs 13-14: elements that creep inwards through the groove
at v_0 = v), x outwards, with the weights of its forces put together:

    c = d_belt,   k = c_belt + 2 c_ele tan(theta)^2,   N_0 = 2 f_ax,0,   n = 2 c_ele tan(theta),
    P = 2 f_ax,0 tan(theta) - f_rad,0   (-2 f_ax,0 mu_0 where x = 0 is steady sliding).

With n = 0 and P = 0, the defaults, it is the mass on a belt. Steady sliding is at x_s = (P + N_0 mu) / (k +
n mu); small motions about it have the eigenvalues of m s^2 + (c + N mu') s + k + n mu = 0.

It answers whether, how fast, how far and at what frequency one mass on one friction law vibrates, whether it
sticks, and from which starts. It knows one direction of sliding and no belt: no load, no strand, no mode, and
no wave that takes energy away. A run in which the normal load falls to 0 has failed: lift-off is not in it.

Steppers other than `moreau` take the friction law with its jump at rest smoothed over `friction_speed`;
`moreau` takes it as it is.
"""

from cvt_hpc.models.oscillator.parameters import PARAMETERS, check, inert
from cvt_hpc.steppers import STEPPERS

DEFAULT_STEPPER = "moreau"

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]
