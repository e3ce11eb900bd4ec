"""The energy criterion: whether friction feeds a small radial vibration of elements that creep in the groove.

It answers one question, *does friction that falls as steeply as this excite a contact that slides like
that?*, for a metre of belt in the wrap that is pressed by `contact_force` and slides at given speeds.
Lebrecht et al. 2004 derive it in sec. 4 (eqs 13-19) from an oscillator of mass m. It is taken per length
here, so that its quantities are the elastic belt's:

    m x'' = f_rad - d x' - c_belt x - 2 (f_ax + c_ele x tan(th)) (tan(th) + mu_r(v_r + x')),

x inwards, v_r the radial creep, mu_r its friction. A harmonic motion x = X cos(w t) does the work

    E(X) = -pi w X^2 (d + 2 f_ax mu')  at small X,    w^2 = [c_belt + 2 c_ele tan(th) (tan(th) + mu_r)] / m

in a period: the preload's terms cancel, and c_ele's do no work by symmetry. So it grows where mu' < -d / (2
f_ax) (eq. 19). A flank that slides in two directions, at |v| with the radial part |v| sin(gamma), has mu_r =
mu(|v|) v_r / |v|, whose slope in v_r is

    mu' sin(gamma)^2 + (mu / |v|) cos(gamma)^2

in the place of mu': tangential sliding makes dry friction viscous across, and damps. With friction memory the
falling part of mu' is divided by 1 + (w tau)^2, its share in phase with the speed. At finite X the same
work is integrated over the friction law as it is, sliding that turns about included; where E(X) comes back
to zero from above is the amplitude of a limit cycle in harmonic balance.

It cannot answer at which load or ratio a belt vibrates (that needs the sliding of each element: the
elastic belt), in which mode and strand, or with which amplitude the strands move; motions that are not
harmonic, which have a `damping_ratio` below -0.1; and stick-slip.
"""

from cvt_hpc.models.criterion.parameters import PARAMETERS, check, inert

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]
