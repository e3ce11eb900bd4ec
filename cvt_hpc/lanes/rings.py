"""Rings of stations, for kernels that are written once for two ways to fill the lanes.

**Each lane a ring of its own**: N rows; behind the first comes the last.

**One ring in W parts** (`LaneArray(..., linked=True)`): lane k holds the N / W stations from k N / W on;
behind the first row of a lane comes the last row of the lane before it. What is one number of the whole ring,
such as a pulley's speed, stands in all lanes alike; a sum over rows becomes the ring's by `around`.
"""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload, register_jitable

from cvt_hpc.lanes.arithmetic import load, place, rows_of
from cvt_hpc.lanes.functions import anywhere, fma
from cvt_hpc.lanes.kinds import LaneArray, LaneArrayKind, Mask, vector_type


def split(array: LaneArray, parts: int) -> LaneArray:
    """One ring's (N, F, 1) array in linked parts, (N / parts, F, parts)."""
    stations, fields, _ = array.data.shape
    linked = LaneArray(stations // parts, fields, parts, array.data.dtype, linked=True)
    linked.data[:] = array.data[:, :, 0].reshape(parts, -1, fields).transpose(1, 2, 0)
    return linked


def merge_parts(linked, array, fields):
    """Write the first fields of linked parts into their ring's (N, F, 1) array; whole rings have no parts.

    A row that is alike in all parts is taken from the first.
    """
    raise NotImplementedError("for kernels")


@overload(merge_parts)
def _merge_parts(linked, array, fields):
    if not linked.linked:
        return lambda linked, array, fields: None

    def copy(linked, array, fields):
        parts, whole = linked.data, array.data
        rows = parts.shape[0]
        for j in range(whole.shape[0]):
            for field in range(fields):
                whole[j, field, 0] = parts[j % rows, field, j // rows]

    return copy


def _turned(builder, kind, value, distance: int):
    """Each lane's value from the lane `distance` behind."""
    lanes = [(k - distance) % kind.count for k in range(kind.count)]
    order = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), lanes)
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), order)


def _rotation(distance: int):
    @intrinsic
    def rotate(context, x):
        def build(context, builder, sig, arguments):
            return _turned(builder, x, *arguments, distance) if x.linked else arguments[0]

        return x(x), build

    return rotate


from_behind, from_ahead = _rotation(1), _rotation(-1)
from_behind.__doc__ = "What the part behind has; x where each lane is a ring."
from_ahead.__doc__ = "What the part ahead has; x where each lane is a ring."


def _neighbour(name: str, distance: int):
    def build(context, builder, sig, arguments):
        array, j, field = arguments
        kind = sig.args[0]
        first, last = ir.Constant(j.type, 0), builder.sub(rows_of(context, builder, kind, array), j.type(1))
        edge, other = (last, first) if distance < 0 else (first, last)
        at_edge = builder.icmp_signed("==", j, edge)
        row = builder.select(at_edge, other, builder.sub(j, ir.Constant(j.type, distance)))
        value = load(context, builder, kind, array, row, field)
        if isinstance(kind, types.Array) or not kind.linked:
            return value
        return builder.select(at_edge, _turned(builder, kind.element, value, distance), value)

    def typed(context, array, j, field):
        element = array.element if isinstance(array, LaneArrayKind) else array.dtype
        return element(array, types.intp, types.intp), build

    typed.__name__ = name
    return intrinsic(typed)


behind, ahead = _neighbour("behind", 1), _neighbour("ahead", -1)
behind.__doc__ = "Field of the row behind row j; of a plain array of one number a station, that of field 0."
ahead.__doc__ = "Field of the row ahead of row j; of a plain array of one number a station, that of field 0."


@intrinsic
def at_station(context, array, row, part, field):
    """Field of one station, the ring's row of a part; all lanes where each is a ring."""
    kind = array.of_one_part

    def build(context, builder, sig, arguments):
        pointer = _station(context, builder, sig.args[0], *arguments)
        return builder.load(pointer, align=kind.dtype.bitwidth // 8)

    return kind(array, types.intp, types.intp, types.intp), build


@intrinsic
def set_station(context, array, row, part, field, value):
    """Set the values that `at_station` reads."""

    def build(context, builder, sig, arguments):
        pointer = _station(context, builder, sig.args[0], *arguments[:4])
        builder.store(arguments[4], pointer, align=value.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.none(array, types.intp, types.intp, types.intp, array.of_one_part), build


def _station(context, builder, kind, array, row, part, field):
    pointer = place(context, builder, kind, array, row, field)
    if not kind.linked:
        return pointer
    first = builder.bitcast(pointer, ir.PointerType(pointer.type.pointee.element))
    return builder.bitcast(builder.gep(first, [part]), vector_type(kind.of_one_part).as_pointer())


def around(x):
    """Sum over the parts of a ring, or whether a mask holds in any; x where each lane is a ring."""
    raise NotImplementedError("for kernels")


@intrinsic
def _alike(context, pattern, truth):
    """A truth in all lanes of a mask."""

    def build(context, builder, sig, arguments):
        none, every = (ir.Constant(arguments[0].type, [bit] * pattern.count) for bit in (0, 1))
        return builder.select(arguments[1], every, none)

    return pattern(pattern, types.boolean), build


@overload(around)
def _around(x):
    if not x.linked:
        return lambda x: x
    if isinstance(x, Mask):
        return lambda x: _alike(x, anywhere(x))
    # halves first: then all parts add the same pairs, and have the same sum to the last bit
    turns = [_rotation(1 << k) for k in reversed(range(x.count.bit_length() - 1))]
    return _folding(turns)


def _folding(turns: list):
    first, *others = turns
    if not others:
        return lambda x: x + first(x)
    rest = register_jitable(_folding(others))
    return lambda x: rest(x + first(x))


def ring_solution(p, q, r, f0, f1, l00, l01, l10, l11, faded):
    """Solve for two unknowns x0, x1 of each part that are coupled to those of the parts behind and ahead.

    A x + L x_behind + (L_ahead)' x_ahead = f, symmetric and positive definite, by cyclic reduction: each
    stage couples parts twice as far apart, until both neighbours are the part itself. Where lanes are rings
    of their own it is that from the start. p, q, r are the first, mixed and second element of A; couplings
    far below `faded` become zero, before they are too small for the processor's normal numbers.
    """
    raise NotImplementedError("for kernels")


@overload(ring_solution)
def _ring_solution(p, q, r, f0, f1, l00, l01, l10, l11, faded):
    stages = p.count.bit_length() - 1 if p.linked else 0
    return _reducing([1 << k for k in range(stages)])


def _reducing(distances: list[int]):
    if not distances:
        return closed
    reduced = register_jitable(_reduction(distances[0]))
    rest = register_jitable(_reducing(distances[1:]))

    def solve(p, q, r, f0, f1, l00, l01, l10, l11, faded):
        p, q, r, f0, f1, l00, l01, l10, l11 = reduced(p, q, r, f0, f1, l00, l01, l10, l11, faded)
        return rest(p, q, r, f0, f1, l00, l01, l10, l11, faded)

    return solve


def closed(p, q, r, f0, f1, l00, l01, l10, l11, faded):
    """`ring_solution` where a part is its own neighbour."""
    p, q, r = fma(2.0, l00, p), q + (l01 + l10), fma(2.0, l11, r)
    per_determinant = 1.0 / fma(p, r, -q * q)
    return fma(r, f0, -q * f1) * per_determinant, fma(p, f1, -q * f0) * per_determinant


def _reduction(distance: int):
    back, fore = _rotation(distance), _rotation(-distance)

    def reduced(p, q, r, f0, f1, l00, l01, l10, l11, faded):
        per_determinant = 1.0 / fma(p, r, -q * q)
        i00, i01, i11 = r * per_determinant, -q * per_determinant, p * per_determinant
        z0, z1 = fma(i00, f0, i01 * f1), fma(i01, f0, i11 * f1)
        # the coupling ahead is the transposed one of the part there
        r00, r10, r01, r11 = fore(l00), fore(l01), fore(l10), fore(l11)
        p, q, r, f0, f1, m00, m01, m10, m11 = _without(
            (p, q, r, f0, f1), (l00, l01, l10, l11), back(i00), back(i01), back(i11), back(z0), back(z1)
        )
        b00, b01, b10, b11 = back(l00), back(l01), back(l10), back(l11)
        l00, l01 = -fma(m00, b00, m01 * b10), -fma(m00, b01, m01 * b11)
        l10, l11 = -fma(m10, b00, m11 * b10), -fma(m10, b01, m11 * b11)
        p, q, r, f0, f1, m00, m01, m10, m11 = _without(
            (p, q, r, f0, f1), (r00, r01, r10, r11), fore(i00), fore(i01), fore(i11), fore(z0), fore(z1)
        )
        l00, l01 = (l00 + faded) - faded, (l01 + faded) - faded
        l10, l11 = (l10 + faded) - faded, (l11 + faded) - faded
        return p, q, r, f0, f1, l00, l01, l10, l11

    return reduced


@register_jitable
def _without(own, coupling, i00, i01, i11, z0, z1):
    """A part's own block and right side without a neighbour, and its coupling to it times `i`.

    `i` is the inverse of the neighbour's block, `z` that times the neighbour's right side.
    """
    p, q, r, f0, f1 = own
    l00, l01, l10, l11 = coupling
    m00, m01 = fma(l00, i00, l01 * i01), fma(l00, i01, l01 * i11)
    m10, m11 = fma(l10, i00, l11 * i01), fma(l10, i01, l11 * i11)
    p, q = fma(-m00, l00, fma(-m01, l01, p)), fma(-m00, l10, fma(-m01, l11, q))
    r = fma(-m10, l10, fma(-m11, l11, r))
    f0, f1 = fma(-l00, z0, fma(-l01, z1, f0)), fma(-l10, z0, fma(-l11, z1, f1))
    return p, q, r, f0, f1, m00, m01, m10, m11
