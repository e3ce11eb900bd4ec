"""Vectors of three numbers in lanes, and rotations of an element.

The directions x (running), o (outward) and a = o x x (axial) of an element are columns of its orientation.
In that order they are left-handed; a rotation turns each alike.

What acts left and right is summed for either side first, and then both: a belt that is its own mirror image
stays so to the last bit, and a mirrored one moves as the mirror image.
"""

from numba.extending import register_jitable

from cvt_hpc import lanes
from cvt_hpc.lanes import fma, sqrt


@register_jitable
def at(array, j, first):
    """Three fields of a row."""
    return array[j, first], array[j, first + 1], array[j, first + 2]


@register_jitable
def ahead(array, j, first):
    """Three fields of the row ahead."""
    y, z = lanes.ahead(array, j, first), lanes.ahead(array, j, first + 1)
    return y, z, lanes.ahead(array, j, first + 2)


@register_jitable
def behind(array, j, first):
    """Three fields of the row behind."""
    y, z = lanes.behind(array, j, first), lanes.behind(array, j, first + 1)
    return y, z, lanes.behind(array, j, first + 2)


@register_jitable
def store(array, j, first, v):
    """Set three fields of a row."""
    array[j, first], array[j, first + 1], array[j, first + 2] = v


@register_jitable
def add(array, j, first, v):
    """Add to three fields of a row."""
    array[j, first] += v[0]
    array[j, first + 1] += v[1]
    array[j, first + 2] += v[2]


@register_jitable
def plus(a, b):
    """A + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@register_jitable
def minus(a, b):
    """A - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@register_jitable
def times(s, a):
    """S a."""
    return s * a[0], s * a[1], s * a[2]


@register_jitable
def moved(a, s, b):
    """A + s b."""
    return fma(s, b[0], a[0]), fma(s, b[1], a[1]), fma(s, b[2], a[2])


@register_jitable
def dot(a, b):
    """A . b."""
    return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]))


@register_jitable
def cross(a, b):
    """A x b."""
    return (
        fma(a[1], b[2], -(a[2] * b[1])),
        fma(a[2], b[0], -(a[0] * b[2])),
        fma(a[0], b[1], -(a[1] * b[0])),
    )


@register_jitable
def plus_cross(c, a, b):
    """C + a x b."""
    return (
        fma(a[1], b[2], fma(-a[2], b[1], c[0])),
        fma(a[2], b[0], fma(-a[0], b[2], c[1])),
        fma(a[0], b[1], fma(-a[1], b[0], c[2])),
    )


@register_jitable
def unit(a):
    """Direction and size of a vector."""
    size = sqrt(dot(a, a))
    return times(1.0 / size, a), size


@register_jitable
def turning(omega, dt):
    """Factors of a rotation by the vector dt omega, for `turned`: exact below a tenth of a radian."""
    square = dt * dt * dot(omega, omega)
    first = dt * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0))))
    second = dt * dt * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)))
    return first, second


@register_jitable
def turned(v, omega, factors):
    """A vector turned by a rotation vector (Rodrigues), of which `turning` gives the factors."""
    once = cross(omega, v)
    return moved(moved(v, factors[0], once), factors[1], cross(omega, once))


@register_jitable
def squared_up(x, o):
    """Two unit vectors across each other, from two that are so but for rounding."""
    x = times(1.5 - 0.5 * dot(x, x), x)
    o = moved(o, -dot(x, o), x)
    return x, times(1.5 - 0.5 * dot(o, o), o)


# Symmetric matrices of 3 x 3 by the columns of their upper half, others as three columns.


@register_jitable
def plus_square(m, k, v):
    """M + k v v', symmetric."""
    p, q, r = k * v[0], k * v[1], k * v[2]
    return (
        *(fma(p, v[0], m[0]), fma(p, v[1], m[1]), fma(q, v[1], m[2])),
        *(fma(p, v[2], m[3]), fma(q, v[2], m[4]), fma(r, v[2], m[5])),
    )


@register_jitable
def plus_product(m, k, u, v):
    """M + k u v'."""
    return moved(m[0], k * v[0], u), moved(m[1], k * v[1], u), moved(m[2], k * v[2], u)


@register_jitable
def zero6(none):
    """A symmetric matrix of zeros, from one."""
    return none, none, none, none, none, none


@register_jitable
def zero9(none):
    """A matrix of zeros, from one."""
    zero = none, none, none
    return zero, zero, zero


@register_jitable
def joined(a, b):
    """A symmetric matrix of two halves."""
    return a[0], a[1], a[2], b[0], b[1], b[2]


@register_jitable
def full(m):
    """A symmetric matrix as three columns."""
    return (m[0], m[1], m[3]), (m[1], m[2], m[4]), (m[3], m[4], m[5])


@register_jitable
def upper(m):
    """The upper half of a matrix that is symmetric."""
    return m[0][0], m[1][0], m[1][1], m[2][0], m[2][1], m[2][2]


@register_jitable
def transposed(m):
    """M'."""
    a, b, c = m
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


@register_jitable
def symmetric_sum(m, n):
    """M + N, symmetric."""
    return m[0] + n[0], m[1] + n[1], m[2] + n[2], m[3] + n[3], m[4] + n[4], m[5] + n[5]


@register_jitable
def matrix_sum(m, n):
    """M + N."""
    return plus(m[0], n[0]), plus(m[1], n[1]), plus(m[2], n[2])


@register_jitable
def symmetric(array, j, first):
    """Six fields of a row as a symmetric matrix."""
    return joined(at(array, j, first), at(array, j, first + 3))


@register_jitable
def matrix(array, j, first, apart=3):
    """A matrix by columns that begin so many fields apart in a row."""
    return at(array, j, first), at(array, j, first + apart), at(array, j, first + 2 * apart)


@register_jitable
def store_symmetric(array, j, first, m):
    """Set six fields of a row."""
    store(array, j, first, (m[0], m[1], m[2]))
    store(array, j, first + 3, (m[3], m[4], m[5]))


@register_jitable
def store_matrix(array, j, first, m, apart=3):
    """Set fields of a row as `matrix` reads them."""
    store(array, j, first, m[0])
    store(array, j, first + apart, m[1])
    store(array, j, first + 2 * apart, m[2])


@register_jitable
def of_symmetric(m, v):
    """M v, symmetric."""
    return of_matrix(full(m), v)


@register_jitable
def of_matrix(m, v):
    """M v."""
    return moved(moved(times(v[2], m[2]), v[1], m[1]), v[0], m[0])


@register_jitable
def of_transposed(m, v):
    """M' v."""
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


# Screws, which are pairs of vectors in six fields of a row: a velocity with an angular velocity, a force with
# a moment, or the direction of a law by both. A law of slope k along a direction s adds k s s' to a matrix of
# 6 x 6: a symmetric matrix by velocities, one by velocities and angular velocities, a symmetric one by these.


@register_jitable
def screw(array, j, first):
    """Six fields of a row."""
    return at(array, j, first), at(array, j, first + 3)


@register_jitable
def screw_ahead(array, j, first):
    """Six fields of the row ahead."""
    return ahead(array, j, first), ahead(array, j, first + 3)


@register_jitable
def screw_behind(array, j, first):
    """Six fields of the row behind."""
    return behind(array, j, first), behind(array, j, first + 3)


@register_jitable
def store_screw(array, j, first, s):
    """Set six fields of a row."""
    store(array, j, first, s[0])
    store(array, j, first + 3, s[1])


@register_jitable
def add_screw(array, j, first, s):
    """Add to six fields of a row."""
    add(array, j, first, s[0])
    add(array, j, first + 3, s[1])


@register_jitable
def both_plus(s, t):
    """S + T."""
    return plus(s[0], t[0]), plus(s[1], t[1])


@register_jitable
def both_minus(s, t):
    """S - T."""
    return minus(s[0], t[0]), minus(s[1], t[1])


@register_jitable
def both_times(k, s):
    """K S."""
    return times(k, s[0]), times(k, s[1])


@register_jitable
def both_moved(s, k, t):
    """S + k T."""
    return moved(s[0], k, t[0]), moved(s[1], k, t[1])


@register_jitable
def both_dot(s, t):
    """S . T, which is the power of a force and a moment."""
    return dot(s[0], t[0]) + dot(s[1], t[1])


@register_jitable
def plus_law(m, k, s):
    """M + k s s' of a law that stands alone, or between two elements on the side of either."""
    uu, uw, ww = m
    return plus_square(uu, k, s[0]), plus_product(uw, k, s[0], s[1]), plus_square(ww, k, s[1])


@register_jitable
def plus_link(m, k, s, t):
    """M + k s t' of a law between two elements, by the rows of one and the columns of the other.

    M is four matrices: by velocities, of moments by velocities, of forces by angular velocities, by these.
    """
    uu, wu, uw, ww = m
    return (
        plus_product(uu, k, s[0], t[0]),
        plus_product(wu, k, s[1], t[0]),
        plus_product(uw, k, s[0], t[1]),
        plus_product(ww, k, s[1], t[1]),
    )
