"""Closed forms of a belt out of its plane: offset of pulleys, strands that bend sideways under tension.

A strand of length l, tension T (of the rings, less the push force between elements), lateral bending
stiffness EI and line mass m' obeys m' w'' = T w_xx - EI w_xxxx, and with a shear stiffness kGA what a
Timoshenko beam under tension does. It is taken at rest: a belt that runs at v has T - m' v^2 in the place of
T in what does not move, and lower frequencies.
"""

import math

import numpy as np
from scipy.optimize import brentq

from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import driven_radius, variator

# of a pulley the side of its loose sheave: right is where the belt is seen to run counter-clockwise
SIDES = {"left": -1, "right": 1, "both": 0}


def axial_offset(parameters: Parameters, aligned_ratio: float) -> float:
    """Axial offset of the driven pulley's mid plane from the driving one's [m], towards the right.

    Of each pulley one sheave alone moves, on the side s_l (1: right), so that its mid plane goes along: C =
    -s_l tan d0 (R - R_1), R_1 being the radius at which the pulleys are aligned. With the loose sheaves on
    opposite sides, right at the driving pulley, that is

        e = tan d0 [(R_dr - R_dr1) + (R_dn - R_dn1)],  about -tan d0 (R_dn - R_dr)^2 / (pi a)

    of a variator aligned at 1, since the belt's length is constant. Of the parameters `ratio`,
    `driven_radius`, `centre_distance` and `half_wedge_angle` [SI] count, and `driving_loose_side` and
    `driven_loose_side`, of SIDES; `aligned_ratio` is the ratio without offset. ValueError if the belt does
    not close at that ratio.
    """
    p = parameters
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    driven = driven_radius(aligned_ratio, path.path_length, p["centre_distance"])
    tangent = math.tan(p["half_wedge_angle"])
    moved = [
        -SIDES[p[f"{pulley}_loose_side"]] * tangent * change
        for pulley, change in (
            ("driving", path.driving_radius - driven / aligned_ratio),
            ("driven", path.driven_radius - driven),
        )
    ]
    return moved[1] - moved[0]


def clamped_force(
    offset: float,
    length: float,
    tension: float,
    bending_stiffness: float,
    shear_stiffness: float = math.inf,
) -> float:
    """Lateral force of a strand whose ends are offset and held without slope [N].

    V = (1 + T / kGA) e / l / (1 / kGA + (1 - tanh(u) / u) / T), u^2 = l^2 T / (4 EI (1 + T / kGA)); without
    shear T e / l / (1 - tanh(u) / u), without tension either 12 EI e / l^3, and of a string T e / l. Offset e
    and length l [m], tension T >= 0 [N], EI > 0 [N m^2], kGA [N].
    """
    stretched = 1.0 + tension / shear_stiffness
    soft = 0.25 * length**2 / (bending_stiffness * stretched)  # u^2 / T
    u = math.sqrt(soft * tension)
    # 1 - tanh(u) / u is u^2 / 3 less 2 u^4 / 15 there, of which rounding would leave nothing
    bent = soft * (1.0 / 3.0 - 2.0 / 15.0 * u * u) if u < 1e-3 else (1.0 - math.tanh(u) / u) / tension
    return stretched * offset / length / (1.0 / shear_stiffness + bent)


def clamped_moment(
    offset: float,
    length: float,
    tension: float,
    bending_stiffness: float,
    shear_stiffness: float = math.inf,
) -> float:
    """Bending moment at either end of that strand, (V l - T e) / 2 [N m]; arguments as of `clamped_force`."""
    force = clamped_force(offset, length, tension, bending_stiffness, shear_stiffness)
    return 0.5 * (force * length - tension * offset)


def pinned_frequencies(
    count: int,
    length: float,
    tension: float,
    bending_stiffness: float,
    line_mass: float,
    shear_stiffness: float = math.inf,
) -> np.ndarray:
    """Lateral eigenfrequencies of a strand that ends can turn, from the lowest mode on, (count,) [Hz].

    f_n = k / (2 pi) sqrt((T + EI k^2 / (1 + EI k^2 / kGA)) / m'), k = n pi / l; without inertia of rotation.
    Length l [m], tension T [N], EI [N m^2], line mass m' [kg/m], kGA [N].
    """
    k = np.arange(1, count + 1) * math.pi / length
    bending = bending_stiffness * k**2
    held = tension + bending / (1.0 + bending / shear_stiffness)
    return k / (2.0 * math.pi) * np.sqrt(held / line_mass)


def clamped_frequency(
    length: float,
    tension: float,
    bending_stiffness: float,
    line_mass: float,
    shear_stiffness: float = math.inf,
) -> float:
    """Lowest lateral eigenfrequency of a strand whose ends are held without slope [Hz].

    From the middle on it moves as cos(b x) cosh(a l / 2) - cosh(a x) cos(b l / 2). With S = kGA, a^2 and -b^2
    are the roots q^2 of EI (S + T) q^4 - (S T - EI m' w^2) q^2 - S m' w^2 = 0, w = 2 pi f. At the ends the
    cross sections do not turn where B tan(b l / 2) + A tanh(a l / 2) = 0, A = a / (1 - EI a^2 / S) and
    B = b / (1 + EI b^2 / S). Arguments as of `pinned_frequencies`.
    """
    yielding, stretched = bending_stiffness / shear_stiffness, 1.0 + tension / shear_stiffness
    stiff = bending_stiffness * stretched

    def inertia(b: float) -> float:
        """Line mass times (2 pi f)^2 [N/m^2]."""
        return (stiff * b**4 + tension * b * b) / (1.0 + yielding * b * b)

    def open_by(b: float) -> float:
        a = math.sqrt(inertia(b) / stiff) / b
        turned = b / (1.0 + yielding * b * b) * math.sin(0.5 * b * length)
        return turned + a / (1.0 - yielding * a * a) * math.tanh(0.5 * a * length) * math.cos(
            0.5 * b * length
        )

    # between the string's and that of a clamped beam without tension and shear, 4.73
    b = brentq(open_by, math.pi / length, 4.7301 / length, xtol=1e-15, rtol=1e-14)
    return math.sqrt(inertia(b) / line_mass) / (2.0 * math.pi)


def buckling_push(length: float, tension: float, bending_stiffness: float, clamped: bool = False) -> float:
    """Push force under which a strand buckles sideways: T + EI (pi / l)^2, or T + 4 EI (pi / l)^2 [N].

    The latter with `clamped` ends, held without slope; else they can turn. Length l [m], tension T of the
    rings [N], EI [N m^2].
    """
    return tension + (4.0 if clamped else 1.0) * bending_stiffness * (math.pi / length) ** 2
