"""Tilt of the elements on their rings: friction of the saddles acts a lever above the flanks and the push.

An element turns against the rings' normal by theta, forwards with its outer end. Its saddle is d, the
ring_offset, above the pitch line, where flanks and neighbours hold it, so that it slides on the rings by
sigma + d theta', sigma = (1 + kappa d) v_0 - v_1. With the saddle's friction q, k_a and d_a the spring and
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

from cvt_hpc.kernels import merged_kernel
from cvt_hpc.lanes import absolute, fma, maximum, with_sign_of
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.physics.friction import saturation

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
