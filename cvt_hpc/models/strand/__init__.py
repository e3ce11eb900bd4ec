"""The free strands as running beams that are pulled and pushed: eigenfrequencies and critical speed.

It answers at which frequencies a strand can vibrate, in which modes, and how that changes with load
(Lebrecht et al. 2004, sec. 3.2, fig. 3.7). A strand of length L between pinned ends runs at v with the net
force F = T - P, ring tension less push force; with w = sum q_n(t) sin(n pi x / L) its energies (eq. 8)

    kinetic 1/2 m int (w_t + v w_x)^2 dx,    potential 1/2 int (F w_x^2 + EI w_xx^2) dx

give by Lagrange (eqs 7-11) q'' + G q' + K q = 0 with

    K_nn = (F / m - v^2) (n pi / L)^2 + (EI / m) (n pi / L)^4,
    G_jk = 8 v j k / (L (j^2 - k^2)) where j + k is odd, else 0.

Without the terms of v each K_nn stands alone (eq. 12: `resting_frequency`). At the critical speed v^2 = (F +
EI pi^2 / L^2) / m the first K_nn is 0: the strand no longer holds its shape.

It does not know whether anything vibrates (`vibrates` is always undecided: a strand alone has no source of
energy), how far, the arcs at its ends, the neighbouring strand, and damping.
"""

from cvt_hpc.models.strand.parameters import PARAMETERS, check, inert

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]
