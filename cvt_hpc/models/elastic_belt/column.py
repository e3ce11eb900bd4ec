"""Elements that rock on their edges and tilt on their rings: the column of pressed ones, and the saddles.

**The column** of pressed elements has a push force and a bending moment, and edges on which elements rock.

Faces reach from k- inside to k+ outside of the pitch line. Their load, the push force P and its moment M
(P times its distance outwards from the pitch line), lies between the edges: P >= 0, -k- P <= M <= k+ P.
Between the faces the bodies give way by P / EA and bend by M / EI. So the complementary energy is
P^2 / 2 EA + M^2 / 2 EI within that cone, and the energy of a column under the strain eps of its pitch line
and the curvature kappa, per length,

    U(eps, kappa) = max over the cone of  -P eps - M kappa - P^2 / 2 EA - M^2 / 2 EI,
    P = -dU/deps,   M = -dU/dkappa:

- faces that rest on each other, |EI kappa| <= k |EA eps|: P = -EA eps, M = -EI kappa, a beam;
- elements that rock on the edge at y (-k- where kappa > 0, k+ where kappa < 0): M = y P and
  P = -EA (eps + y kappa) / (1 + y^2 EA / EI), the edge's strain against bodies that bend under y P;
- apart: neither.

At a given P this is M of Bullinger et al. 2005, eq. 24. Their eqs 32 and 41 have P = -EA eps beside it, at
any curvature: then dP/dkappa = 0 while dM/deps is not where elements rock, so no energy belongs to both, and
a cycle of eps and kappa does work. Here the edge's strain counts, and none does.

The force M kappa_s along the column, of second order and at most (k P)^2 / 2 EI where an arc ends, is left
out.

On the path itself elements touch without force at eps_0 = 0, whatever k-: eps = eps_0 + k- kappa_path. Both
halves of a cell have the cell's strain, each the curvature of its own station.

**The tilt** of elements on their rings comes of the saddles' friction, which acts a lever above the flanks
and the push. An element turns against the rings' normal by theta, forwards with its outer end. Its saddle is
d, the ring_offset, above the pitch line, where flanks and neighbours hold it, so that it slides on the rings
by sigma + d theta', sigma = (1 + kappa d) v_0 - v_1. With the saddle's friction q, k_a and d_a the spring and
the damper,

    k_a theta + d_a theta' = -d q(sigma + d theta'),    theta' = theta_t + v_0 theta_s.

So what the flanks do to a pressed element is carried by its neighbours at the same height and does not tilt
it; of an element that is apart q balances the flanks. Its compliance d^2 / k_a is in series with the slope of
the rings' friction, D: for small motions at the circular frequency w that has

    Z = D / (1 + i w D d^2 / (k_a + i w d_a)).

Where no saddle is pressed, on the strands, the tilt fades by d_a / k_a. It is carried with the elements.

Left out: inertia against turning, whose frequency sqrt(k_a / J) is 2.4 kHz for elements 13 mm high and the
pushbelt's spring, and that of a centre of gravity at the saddle, sqrt(k_a / m) / d, 9 kHz; the push's own
stiffness P, which adds to k_a; the moment P kappa t / 2 of faces t / 2 ahead of the middle of an element.
"""

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import absolute, fma, maximum, select, with_sign_of
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.physics.friction import saturation


@merged_kernel
def rocking_column(eps, kappa, stiffness, bending, outer, inner):
    """Forces of the column under a strain of the pitch line eps [1] and a curvature kappa [1/m].

    With EA [N], EI [N m^2], k+ and k- [m]. Returns -P / EA, or, where elements are apart, the positive number
    that the same formula gives of the strain of the edge that meets first; its slopes with eps and with kappa
    [m]; and M [N m].
    """
    edge = select(kappa > 0.0, -inner, outer)
    bent = bending * kappa
    give = bending / fma(stiffness * edge, edge, bending)
    strain = give * fma(edge, kappa, eps)
    rests = absolute(bent) <= -stiffness * absolute(edge) * eps
    moment = select(rests, -bent, edge * maximum(-stiffness * strain, 0.0))
    return select(rests, eps, strain), select(rests, 1.0, give), select(rests, 0.0, give * edge), moment


@merged_kernel
def _deviating_curvature(belt: Belt, w: np.ndarray, j: int) -> float:
    """Curvature of the belt at station j beyond that of its path [1/m]."""
    n = belt.cell.size
    a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
    turned = ((w[b] - w[j]) / belt.cell[j] - (w[j] - w[a]) / belt.cell[a]) / belt.dual[j]
    return -turned - belt.squared_curvature[j] * w[j]


@kernel
def column_forces(
    belt: Belt, fields: np.ndarray, eps: np.ndarray, pressed: np.ndarray, moment: np.ndarray
) -> None:
    """Push and moment of the column around the belt, by the elements' strain `eps` in the cells, (N,).

    Results: into `pressed` -P / EA in the cells, mean of both halves, positive where elements are apart; into
    `moment` M at the stations [N m].
    """
    n, w = belt.cell.size, fields[f.W]
    stiffness, bending = belt.element_stiffness, belt.column_stiffness
    outer, inner = belt.outer_edge, belt.inner_edge
    moment[:] = 0.0
    for c in range(n):
        closed, least = 0.0, np.inf
        for half in range(2):
            j = (c + half) % n
            kappa = belt.curvature[c] + _deviating_curvature(belt, w, j)
            pitch = eps[c] + inner * belt.curvature[c]
            strain, _, _, borne = rocking_column(pitch, kappa, stiffness, bending, outer, inner)
            closed += 0.5 * min(strain, 0.0)
            least = min(strain, least)
            moment[j] += 0.5 * belt.cell[c] * fields[f.N_ELEMENT, c] * borne / belt.dual[j]
        pressed[c] = closed if closed < 0.0 else least


@merged_kernel
def column_across(belt: Belt, moment: np.ndarray, j: int) -> float:
    """Line force of the column's moment across the belt at station j, outwards [N/m]."""
    n = belt.cell.size
    a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
    turned = (moment[b] - moment[j]) / belt.cell[j] - (moment[j] - moment[a]) / belt.cell[a]
    return -turned / belt.dual[j] - belt.squared_curvature[j] * moment[j]


@kernel
def pressed_strains(belt: Belt, fields: np.ndarray, eps: np.ndarray) -> np.ndarray:
    """-P / EA in the cells, (N,), positive where elements are apart; `eps` (N,) is their strain."""
    pressed = eps.copy()
    if belt.has_column:
        column_forces(belt, fields, eps, pressed, np.empty(eps.size))
    return pressed


ROUNDS = 8  # of Newton's method: round-off in double precision, and 2e-9 at the knee of 1e6 random laws


@merged_kernel
def tilted_sliding(free, held, grip, damping, per_width):
    """Sliding speed z of a saddle whose element tilts: damping (z - free) + held + grip tanh(z / v_reg) = 0.

    `free` is that if the element did not turn [m/s], `held` the force of the spring at the saddle, k_a theta
    / d, and `grip` the largest friction [N/m], `damping` the force at the saddle by its speed, of the damper
    and in a step of the spring [N s/m^2], `per_width` 1 / v_reg [s/m].
    """
    pull = fma(damping, free, -held)
    size = absolute(pull)
    # both are below the solution, and the function is concave: from there on Newton's method never overshoots
    z = maximum(size / fma(grip, per_width, damping), (size - grip) / damping)
    for _ in range(ROUNDS):
        factor, slope = saturation(z, per_width)
        z = z + (size - fma(damping, z, grip * factor)) / fma(grip, slope, damping)
    return with_sign_of(z, pull)


@merged_kernel
def tilt_rate(belt: Belt, state: State, j: int, drag: float) -> float:
    """Rate of the tilt of station j [rad/s] at its place, under the saddle's friction `drag` [N/m]."""
    tilt = state.fields[f.ELEMENT_TILT]
    a = j - 1 if j > 0 else belt.cell.size - 1
    turning = -(belt.tilt_spring * tilt[j] + belt.ring_offset * drag) / belt.tilt_damper
    return turning - state.fields[f.V_ELEMENT, j] * (tilt[j] - tilt[a]) / belt.cell[a]
