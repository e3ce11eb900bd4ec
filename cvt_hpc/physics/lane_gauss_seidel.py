"""The contact of `compliance` by a few sweeps of projected Gauss-Seidel: how inexact may contact be?

Each station in turn takes the force that closes its gap while all others keep theirs, or none if it would
have to pull. The kernel of local bending is Markov, so the effect on a station of stations behind it goes
along with the sweep, and the effect of stations ahead comes from one pass beforehand: a sweep takes linear
time. Forces start from those of the last call. How slowly sweeps converge on soft sheaves:
tests/edges/test_belt_contact.py.
"""

from __future__ import annotations

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import fma, like, maximum
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import Contact


@kernel
def sweep_lane_contact(contact: Contact) -> None:
    """Approximate PUSH from the gaps, by `contact.sweeps` sweeps; it is never negative, and no set is kept.

    Parameters
    ----------
    contact : Contact
        With GAP set; PUSH of the last call is where the sweeps start.
    """
    scalars = contact.scalars
    scalars[0, compliance.SOLVES] = scalars[0, compliance.SOLVES] + 1.0
    for _ in range(contact.sweeps):
        _sweep(contact)


@kernel
def _sweep(contact: Contact) -> None:
    stations, scalars, weight = contact.stations, contact.scalars, contact.weight
    m = weight.size
    a, tilt = scalars[0, compliance.COMPLIANCE], scalars[0, compliance.TILT_COMPLIANCE]
    give = 1.0 / scalars[0, compliance.ELEMENT_STIFFNESS]
    # the kernel exp(-|x| / l) / (2 l k) from its inverse, whose first row is 2 l k (1, -e) / (1 - e^2)
    decay = -scalars[0, compliance.OFF_DIAGONAL] / stations[0, compliance.DIAGONAL]
    local = scalars[0, compliance.DISC_COMPLIANCE] / (
        stations[0, compliance.DIAGONAL] * (1.0 - decay * decay)
    )
    ahead = p1 = p2 = behind = like(0.0, a)
    for j in range(m - 1, -1, -1):
        pressed = weight[j] * stations[j, compliance.PUSH]
        p1 = fma(contact.cosine[j], pressed, p1)
        p2 = fma(contact.sine[j], pressed, p2)
        stations[j, compliance.Y] = ahead
        ahead = decay * (ahead + pressed)
    for j in range(m):
        push, h, c, s = stations[j, compliance.PUSH], weight[j], contact.cosine[j], contact.sine[j]
        bent = local * (behind + h * push + stations[j, compliance.Y]) + tilt * (c * p1 + s * p2)
        gap = stations[j, compliance.GAP] + give * push + a * bent
        # a unit force opens its own gap by this much; the tilt's cos^2 + sin^2 is 1
        opened = give + a * (h * (local + tilt))
        closing = maximum(push - gap / opened, 0.0)
        change = h * (closing - push)
        p1 = fma(c, change, p1)
        p2 = fma(s, change, p2)
        stations[j, compliance.PUSH] = closing
        behind = decay * (behind + h * closing)
