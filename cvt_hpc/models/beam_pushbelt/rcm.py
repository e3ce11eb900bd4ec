"""A ring of planar beams in redundant coordinates (RCM): large motions, exact inertia, one mean strain each.

Coordinates of a beam of length l0 (Zander and Ulbrich 2006) are q = (x1, y1, phi1, a1, a2, x2, y2, phi2):
both nodes with their tangent angles, and the distances a1, a2 of the quarter points from the tangent of the
node next to them. With t = (cos, sin), n = (-sin, cos) and s = l0 x from the node,

    first half:   r = r1 + (1 + eps) s t(phi1) + w(x) n(phi1),              0 <= x <= 1/2,
    second half:  r = r2 - (1 + eps) s t(phi2) + w(x) n(phi2),    from the second node backwards,

where w is a quartic, linear in v = (a1, a2, psi, delta), psi = l0 (phi2 - phi1), in the first half and in
(a2, a1, psi, -delta) in the second. Position, slope, curvature and shear force are continuous between them.
Of all coordinates only the mean strain and the step between the tangents depend on q nonlinearly: with
r2 - r1 = T t(phi_m) + N n(phi_m), phi_m the mean angle and h = (phi2 - phi1) / 2,

    delta = N / cos h,    eps = (T - sin h (16/9 (a1 + a2) + 5/18 l0 h)) / (l0 cos h) - 1.

Inertia without that of rotation, elastic energy 1/2 EA l0 e^2 + 1/2 EI int (w'' - kappa0)^2 ds with
e = eps + (1 + eps) / (2 l0) int w'^2 ds. All integrals are those of polynomials and done beforehand, so that
mass matrix and forces are exact.
"""

import math
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel

# w = sum of v_j x^2 (SHAPE[j][0] + SHAPE[j][1] x + SHAPE[j][2] x^2)
SHAPE = (
    (344 / 9, -976 / 9, 704 / 9),
    (-88 / 9, 464 / 9, -448 / 9),
    (-7 / 18, 16 / 9, -8 / 9),
    (-9 / 2, 23.0, -20.0),
)
# integrals over a half of w, x w and w w, for v
_W1, _W2, _W3, _W4 = 209 / 540, 47 / 540, 13 / 2160, 3 / 64
_X1, _X2, _X3, _X4 = 133 / 1080, 43 / 1080, 47 / 17280, 41 / 1920
_G11, _G12, _G13, _G14 = 9829 / 25515, 2557 / 25515, 49 / 7290, 2423 / 45360
_G22, _G23, _G24 = 1441 / 25515, 199 / 51030, 197 / 6480
_G33, _G34, _G44 = 887 / 3265920, 191 / 90720, 1321 / 80640
# integrals over both halves of w' w' and w'' w'', for the v of the first: only these entries and, by
# symmetry, 22 = 11, 23 = 13, 24 = -14 are not zero
_S11, _S12, _S13, _S14, _S33, _S44 = 79424 / 8505, -1984 / 1215, 296 / 1701, -88 / 35, 1583 / 34020, 313 / 140
_B11, _B12, _B13, _B14, _B33, _B44 = 50432 / 81, -121088 / 405, -4096 / 405, -144.0, 661 / 405, 57.0


class RcmBeam(NamedTuple):
    """Constants of a beam."""

    length: float  # without load [m]
    line_mass: float  # [kg/m]
    axial_stiffness: float  # EA [N]
    bending_stiffness: float  # EI [N m^2]
    curvature: float = 0.0  # without load [1/m], positive where the path turns to the left


class Kinematics(NamedTuple):
    """Shape of an element by its coordinates."""

    cos_mean: float
    sin_mean: float
    cos_half: float  # of half the angle between the nodes' tangents
    sin_half: float
    along: float  # T and N [m]
    across: float
    bulge: float  # 16/9 (a1 + a2) + 5/18 l0 h [m]
    stretch: float  # 1 + eps
    psi: float  # [m]
    delta: float  # [m]


@kernel
def kinematics(l0: float, q: np.ndarray) -> Kinematics:
    """Shape of an element of length `l0` [m] at coordinates `q`, an (8,) array [m, rad]."""
    mean, half = 0.5 * (q[2] + q[7]), 0.5 * (q[7] - q[2])
    cm, sm, c, s = math.cos(mean), math.sin(mean), math.cos(half), math.sin(half)
    dx, dy = q[5] - q[0], q[6] - q[1]
    along, across = dx * cm + dy * sm, dy * cm - dx * sm
    bulge = 16 / 9 * (q[3] + q[4]) + 5 / 18 * l0 * half
    return Kinematics(
        cm, sm, c, s, along, across, bulge, (along - s * bulge) / (l0 * c), 2.0 * l0 * half, across / c
    )


class LinePoint(NamedTuple):
    """A material point of the line, and the line's direction there."""

    x: float  # [m]
    y: float
    cos: float  # of the line's angle
    sin: float
    stretch: float  # length of the line by length without load, |dr/ds|
    bend: float  # change of the angle by length without load [1/m]


@kernel
def line_point(l0: float, q: np.ndarray, s: float, along: np.ndarray, across: np.ndarray) -> LinePoint:
    """The material point `s` [m] from the centre without load, -l0/2 to l0/2, at coordinates `q` (8,).

    The rows `along` and `across` (8,) become t.J and n.J, J the derivative of the position by q, t the line's
    tangent and n the normal to its left.
    """
    shape = kinematics(l0, q)
    first = s < 0.0
    side = 1.0 if first else -1.0
    node = 0 if first else 5
    x = 0.5 - abs(s) / l0
    v = (q[3], q[4], shape.psi, shape.delta) if first else (q[4], q[3], shape.psi, -shape.delta)
    w = slope = curve = 0.0
    for j in range(4):
        k0, k1, k2 = SHAPE[j]
        w += v[j] * x * x * (k0 + x * (k1 + x * k2))
        slope += v[j] * x * (2.0 * k0 + x * (3.0 * k1 + x * 4.0 * k2))
        curve += v[j] * (2.0 * k0 + x * (6.0 * k1 + x * 12.0 * k2))
    slope, curve = side * slope / l0, curve / (l0 * l0)
    c, sn = math.cos(q[node + 2]), math.sin(q[node + 2])
    ahead, e1 = side * l0 * x, shape.stretch
    size = math.sqrt(e1 * e1 + slope * slope)
    # in the frame of the node: t = (p, r), n = (-r, p)
    p, r = e1 / size, slope / size

    stretch, delta = _gradients(l0, shape)
    for k in range(8):
        by_w = 0.0
        for j in range(4):
            k0, k1, k2 = SHAPE[j]
            rate = 0.0
            if j == 3:
                rate = side * delta[k]
            elif j == 2:
                rate = l0 if k == 7 else (-l0 if k == 2 else 0.0)
            elif k == (3 + j if first else 4 - j):
                rate = 1.0
            by_w += rate * x * x * (k0 + x * (k1 + x * k2))
        on_t, on_n = ahead * stretch[k], by_w
        if k == node:
            on_t, on_n = on_t + c, on_n - sn
        elif k == node + 1:
            on_t, on_n = on_t + sn, on_n + c
        elif k == node + 2:
            on_t, on_n = on_t - w, on_n + ahead * e1
        along[k], across[k] = p * on_t + r * on_n, p * on_n - r * on_t
    forth = ahead * e1
    x, y = q[node] + forth * c - w * sn, q[node + 1] + forth * sn + w * c
    return LinePoint(x, y, p * c - r * sn, p * sn + r * c, size, e1 * curve / (size * size))


@kernel
def mean_strain(l0: float, q: np.ndarray) -> float:
    """Mean axial strain e of an element of length `l0` [m] at coordinates `q`, an (8,) array [m, rad]."""
    shape = kinematics(l0, q)
    v = _first_half(q, shape.psi, shape.delta)
    return shape.stretch - 1.0 + shape.stretch * _dot(v, _slopes(v)) / (2.0 * l0 * l0)


@kernel
def elastic_energy(beam: RcmBeam, q: np.ndarray) -> float:
    """Elastic energy of a beam [J] at coordinates `q` (8,)."""
    l0 = beam.length
    shape = kinematics(l0, q)
    v = _first_half(q, shape.psi, shape.delta)
    bent = _dot(v, _curvatures(v)) / l0**3 - 2.0 * beam.curvature * shape.psi / l0 + l0 * beam.curvature**2
    return 0.5 * (beam.axial_stiffness * l0 * mean_strain(l0, q) ** 2 + beam.bending_stiffness * bent)


@kernel
def equations_of_motion(beam, q, u, stiff, mass, force):
    """Matrix and forces of a beam, (M + stiff K) u' = h, at coordinates and rates (8,); stiff in s^2.

    Places of the results are `mass`, an (8, 8) array, and `force`, an (8,) array [N, N m]. K is the tangent
    stiffness without the change of directions: of axial strain, of bending, and of tension against
    deflection. So it is positive semidefinite.
    """
    l0, rho = beam.length, beam.line_mass
    shape = kinematics(l0, q)
    rates = _rates(l0, shape, u)
    cm, sm, c, s = shape.cos_mean, shape.sin_mean, shape.cos_half, shape.sin_half
    c1, s1, c2, s2 = cm * c + sm * s, sm * c - cm * s, cm * c - sm * s, sm * c + cm * s
    e1 = shape.stretch
    v, r = _first_half(q, shape.psi, shape.delta), _first_half(u, rates.psi, rates.delta)
    v_, r_ = _second_half(v), _second_half(r)

    # elasticity
    sloped, curved = _slopes(v), _curvatures(v)
    deflected = _dot(v, sloped) / (2.0 * l0 * l0)
    lever, by_stretch = e1 / (l0 * l0), 1.0 + deflected  # of the strain's gradient
    axial, bending = beam.axial_stiffness * l0, beam.bending_stiffness / l0**3
    push = axial * (e1 - 1.0 + e1 * deflected)
    pull, held = push * lever, max(push, 0.0) * lever
    f1 = pull * sloped[0] + bending * curved[0]
    f2 = pull * sloped[1] + bending * curved[1]
    f3 = pull * sloped[2] + bending * (curved[2] - l0 * l0 * beam.curvature)
    f4 = pull * sloped[3] + bending * curved[3]
    f_stretch = push * by_stretch

    # inertia: accelerations where those of the coordinates vanish
    grown, jumped = rates.stretch_change, rates.delta_change
    first = _inertia(1.0, l0, e1, v, r, u[2], rates.stretch, grown, jumped)
    second = _inertia(-1.0, l0, e1, v_, r_, u[7], rates.stretch, grown, -jumped)
    f1 += rho * (first[4] + second[5])
    f2 += rho * (first[5] + second[4])
    f3 += rho * (first[6] + second[6])
    f4 += rho * (first[7] - second[7])
    f_stretch += rho * (first[3] + second[3])

    stretch, delta = _gradients(l0, shape)
    for k in range(8):
        force[k] = -f_stretch * stretch[k] - f4 * delta[k]
    force[0] -= rho * (first[0] * c1 - first[1] * s1)
    force[1] -= rho * (first[0] * s1 + first[1] * c1)
    force[2] -= rho * first[2] - l0 * f3
    force[3] -= f1
    force[4] -= f2
    force[5] -= rho * (second[0] * c2 - second[1] * s2)
    force[6] -= rho * (second[0] * s2 + second[1] * c2)
    force[7] -= rho * second[2] + l0 * f3

    # the matrix in the coordinates, eps and delta, the latter two as if independent
    m, b, t = rho * l0, stiff * bending, stiff * held
    k11, k12, k13 = b * _B11 + t * _S11, b * _B12 + t * _S12, b * _B13 + t * _S13
    k14, k33, k44 = b * _B14 + t * _S14, b * _B33 + t * _S33, b * _B44 + t * _S44
    turned, psi = m * l0 * e1, l0 * (m * 2.0 * _G33 + k33) * l0
    weight, sum_w, turned_sum = 0.5 * m, m * _W3 * l0, turned * _X3 * l0
    arm = 0.125 * m * l0 * e1 - sum_w
    side = l0 * (m * (_G13 + _G23) + k13)
    square = m * l0 * l0 / 24.0
    n1, n2 = m * _W1, m * _W2
    w1, w2 = m * _w(v), m * _w(v_)
    mass[:] = 0.0
    mass[0, 0] = mass[1, 1] = mass[5, 5] = mass[6, 6] = weight
    mass[0, 2], mass[1, 2] = -w1 * c1 - arm * s1, -w1 * s1 + arm * c1
    mass[0, 3], mass[1, 3], mass[0, 4], mass[1, 4] = -n1 * s1, n1 * c1, -n2 * s1, n2 * c1
    mass[0, 7], mass[1, 7] = -sum_w * s1, sum_w * c1
    mass[2, 5], mass[2, 6] = sum_w * s2, -sum_w * c2
    mass[3, 5], mass[3, 6], mass[4, 5], mass[4, 6] = -n2 * s2, n2 * c2, -n1 * s2, n1 * c2
    mass[5, 7], mass[6, 7] = -w2 * c2 + arm * s2, -w2 * s2 - arm * c2
    mass[2, 2] = square * e1 * e1 + m * _dot(v, _w_w(v)) - 2.0 * turned_sum + psi
    mass[7, 7] = square * e1 * e1 + m * _dot(v_, _w_w(v_)) - 2.0 * turned_sum + psi
    mass[2, 7] = 2.0 * turned_sum - psi
    mass[2, 3], mass[2, 4] = turned * _X1 - side, turned * _X2 - side
    mass[3, 7], mass[4, 7] = side - turned * _X2, side - turned * _X1
    mass[3, 3] = mass[4, 4] = m * (_G11 + _G22) + k11
    mass[3, 4] = 2.0 * m * _G12 + k12
    by_delta = m * _W4
    odd = m * (_G14 - _G24) + k14
    wound = turned * _X4
    on_delta = m * _G44 + 0.5 * k44
    shift = 0.125 * m * l0
    p = (shift * c1, shift * s1, -m * l0 * _x_w(v), 0.0, 0.0, -shift * c2, -shift * s2, m * l0 * _x_w(v_))
    o = (-by_delta * s1, by_delta * c1, wound, odd, -odd, by_delta * s2, -by_delta * c2, wound)
    a = (0.0, 0.0, -l0 * sloped[2], sloped[0], sloped[1], 0.0, 0.0, l0 * sloped[2])
    for i in range(8):
        p_i, o_i = p[i] + square * stretch[i], o[i] + on_delta * delta[i]
        grad_i = stiff * axial * (by_stretch * stretch[i] + lever * (a[i] + sloped[3] * delta[i]))
        for j in range(i, 8):
            p_j, o_j = p[j] + square * stretch[j], o[j] + on_delta * delta[j]
            grad_j = by_stretch * stretch[j] + lever * (a[j] + sloped[3] * delta[j])
            mass[i, j] += (
                p_i * stretch[j] + stretch[i] * p_j + o_i * delta[j] + delta[i] * o_j + grad_i * grad_j
            )
            mass[j, i] = mass[i, j]


class _Rates(NamedTuple):
    stretch: float  # rates of eps, psi, delta
    psi: float
    delta: float
    stretch_change: float  # second derivatives of eps and delta where those of the coordinates vanish
    delta_change: float


@kernel
def _rates(l0, shape, u):
    cm, sm, c, s = shape.cos_mean, shape.sin_mean, shape.cos_half, shape.sin_half
    mean, half, tangent = 0.5 * (u[2] + u[7]), 0.5 * (u[7] - u[2]), s / c
    dx, dy = u[5] - u[0], u[6] - u[1]
    along, across = dx * cm + dy * sm, dy * cm - dx * sm
    bulge = 16 / 9 * (u[3] + u[4]) + 5 / 18 * l0 * half
    delta = (across - shape.along * mean) / c + shape.delta * tangent * half
    stretch = (along + shape.across * mean - s * bulge - c * half * shape.bulge) / (l0 * c)
    stretch += shape.stretch * tangent * half
    stretch_change = 2.0 * mean * across - mean * mean * shape.along
    stretch_change += s * half * half * shape.bulge - 2.0 * c * half * bulge
    stretch_change = stretch_change / (l0 * c) + half * half * shape.stretch + 2.0 * tangent * half * stretch
    delta_change = (-2.0 * mean * along - mean * mean * shape.across) / c
    delta_change += half * half * shape.delta + 2.0 * tangent * half * delta
    return _Rates(stretch, 2.0 * l0 * half, delta, stretch_change, delta_change)


@kernel
def _gradients(l0, shape):
    """Derivatives of eps and delta by the coordinates."""
    cm, sm, c, s = shape.cos_mean, shape.sin_mean, shape.cos_half, shape.sin_half
    tx, ty, nx, ny = cm / (l0 * c), sm / (l0 * c), -sm / c, cm / c
    by_mean = 0.5 * shape.across / (l0 * c)
    by_step = -0.5 * shape.bulge / l0 + (0.5 * shape.stretch - 5 / 36) * s / c
    by_bulge = -16 / 9 * s / (l0 * c)
    stretch = (-tx, -ty, by_mean - by_step, by_bulge, by_bulge, tx, ty, by_mean + by_step)
    by_mean, by_step = -0.5 * shape.along / c, 0.5 * shape.delta * s / c
    return stretch, (-nx, -ny, by_mean - by_step, 0.0, 0.0, nx, ny, by_mean + by_step)


@kernel
def _inertia(side, l0, e1, v, r, spin, stretch_rate, stretch_change, delta_change):
    """Of a half per line mass: generalised forces on r_t, r_n, phi of its node, eps, and v."""
    along = stretch_change - e1 * spin * spin
    coriolis = 2.0 * spin * stretch_rate
    first, second = side * l0 * l0 / 8.0, l0**3 / 24.0
    w, x_w, x_r = l0 * _w(v), side * l0 * l0 * _x_w(v), side * l0 * l0 * _x_w(r)
    wv, wr = _w_w(v), _w_w(r)
    on_t = along * first - 2.0 * spin * l0 * _w(r)
    on_n = coriolis * first + l0 * _W4 * delta_change - spin * spin * w
    on_stretch = along * second - 2.0 * spin * x_r
    on_phi = -along * x_w + 2.0 * spin * l0 * _dot(v, wr)
    on_phi += e1 * (coriolis * second + side * l0 * l0 * _X4 * delta_change - spin * spin * x_w)
    by_x, by_delta, by_v = side * l0 * l0 * coriolis, l0 * delta_change, -l0 * spin * spin
    on_1 = by_x * _X1 + by_delta * _G14 + by_v * wv[0]
    on_2 = by_x * _X2 + by_delta * _G24 + by_v * wv[1]
    on_3 = by_x * _X3 + by_delta * _G34 + by_v * wv[2]
    on_4 = by_x * _X4 + by_delta * _G44 + by_v * wv[3]
    return on_t, on_n, on_phi, on_stretch, on_1, on_2, on_3, on_4


@kernel
def _first_half(q, psi, delta):
    return q[3], q[4], psi, delta


@kernel
def _second_half(v):
    """V of the other half, whose shape is the mirror image."""
    return v[1], v[0], v[2], -v[3]


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@kernel
def _w(v):
    return _W1 * v[0] + _W2 * v[1] + _W3 * v[2] + _W4 * v[3]


@kernel
def _x_w(v):
    return _X1 * v[0] + _X2 * v[1] + _X3 * v[2] + _X4 * v[3]


@kernel
def _w_w(v):
    a, b, c, d = v
    return (
        _G11 * a + _G12 * b + _G13 * c + _G14 * d,
        _G12 * a + _G22 * b + _G23 * c + _G24 * d,
        _G13 * a + _G23 * b + _G33 * c + _G34 * d,
        _G14 * a + _G24 * b + _G34 * c + _G44 * d,
    )


@kernel
def _slopes(v):
    return _even_and_odd(_S11, _S12, _S13, _S14, _S33, _S44, v)


@kernel
def _curvatures(v):
    return _even_and_odd(_B11, _B12, _B13, _B14, _B33, _B44, v)


@kernel
def _even_and_odd(m11, m12, m13, m14, m33, m44, v):
    a, b, c, d = v
    return (
        m11 * a + m12 * b + m13 * c + m14 * d,
        m12 * a + m11 * b + m13 * c - m14 * d,
        m13 * (a + b) + m33 * c,
        m14 * (a - b) + m44 * d,
    )
