"""The types of lanes, masks and arrays of lanes, as the compiler knows them."""

from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numpy.typing import DTypeLike

ALIGNMENT = 64  # bytes: the widest register, so that no access crosses a line of the cache


class LaneArray:
    """Array of W-lane numbers: `data` (rows, fields, lanes) in order of memory, zero at first.

    Parameters
    ----------
    rows, fields, lanes : int
        Shape.
    dtype : type
        np.float64 or np.float32.
    linked : bool
        Whether the lanes are parts of one ring, each ahead of the last, and not systems of their own.
    """

    def __init__(
        self, rows: int, fields: int, lanes: int, dtype: DTypeLike = np.float64, linked: bool = False
    ) -> None:
        self.linked = linked
        size = rows * fields * lanes * np.dtype(dtype).itemsize
        memory = np.zeros(size + ALIGNMENT, dtype=np.uint8)
        first = -memory.ctypes.data % ALIGNMENT
        self.data: np.ndarray = memory[first : first + size].view(dtype).reshape(rows, fields, lanes)

    if TYPE_CHECKING:  # the part that kernels see
        rows: int

        def __getitem__(self, place: tuple[int, int]) -> Any: ...

        def __setitem__(self, place: tuple[int, int], number: Any) -> None: ...


class Lanes(types.Type):
    """Type of a number of `count` lanes."""

    def __init__(self, dtype: types.Float, count: int, linked: bool) -> None:
        self.dtype, self.count, self.linked = dtype, count, linked
        super().__init__(name=f"Lanes({dtype} x {count}, linked={linked})")


class Mask(types.Type):
    """Type of a truth of `count` lanes."""

    def __init__(self, count: int, linked: bool) -> None:
        self.count, self.linked = count, linked
        super().__init__(name=f"Mask({count}, linked={linked})")


class LaneArrayKind(types.Type):
    """Type of a LaneArray."""

    def __init__(self, dtype: types.Float, count: int, linked: bool) -> None:
        self.dtype, self.count, self.linked = dtype, count, linked
        self.array = types.Array(dtype, 3, "C")
        self.element = Lanes(dtype, count, linked)
        self.of_one_part = Lanes(dtype, 1, False) if linked else self.element
        super().__init__(name=f"LaneArray({dtype} x {count}, linked={linked})")


def vector_type(kind: Lanes) -> ir.VectorType:
    """The register that holds lanes of a type."""
    return ir.VectorType(ir.FloatType() if kind.dtype == types.float32 else ir.DoubleType(), kind.count)


@extending.register_model(Lanes)
class _LanesModel(extending.models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, vector_type(kind))


@extending.register_model(Mask)
class _MaskModel(extending.models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), kind.count))


@extending.register_model(LaneArrayKind)
class _LaneArrayModel(extending.models.StructModel):
    """Place and number of the values: calls hand over three numbers, of an array eleven."""

    def __init__(self, manager, kind):
        parts = [("first", types.CPointer(kind.dtype)), ("rows", types.intp), ("fields", types.intp)]
        super().__init__(manager, kind, parts)


@extending.typeof_impl.register(LaneArray)
def _type_of_lane_array(value, context):
    dtype = types.float32 if value.data.dtype == np.float32 else types.float64
    return LaneArrayKind(dtype, value.data.shape[2], value.linked)


extending.make_attribute_wrapper(LaneArrayKind, "rows", "rows")


@infer_getattr
class _Attributes(AttributeTemplate):
    key = LaneArrayKind

    def resolve_data(self, kind):
        return kind.array


@extending.lower_getattr(LaneArrayKind, "data")
def _as_array(context, builder, kind, value):
    """The values as an array, which owns nothing: the LaneArray outlasts it."""
    lanes = cgutils.create_struct_proxy(kind)(context, builder, value=value)
    array = context.make_array(kind.array)(context, builder)
    count, itemsize = (
        context.get_constant(types.intp, number) for number in (kind.count, kind.dtype.bitwidth // 8)
    )
    row = builder.mul(itemsize, count)
    context.populate_array(
        array,
        data=lanes.first,
        shape=[lanes.rows, lanes.fields, count],
        strides=[builder.mul(row, lanes.fields), row, itemsize],
        itemsize=itemsize,
        meminfo=None,
    )
    return array._getvalue()


@extending.unbox(LaneArrayKind)
def _unbox_lane_array(kind, value, context):
    data = context.pyapi.object_getattr_string(value, "data")
    native = context.unbox(kind.array, data)
    context.pyapi.decref(data)
    array = context.context.make_array(kind.array)(context.context, context.builder, native.value)
    lanes = cgutils.create_struct_proxy(kind)(context.context, context.builder)
    lanes.first = array.data
    lanes.rows, lanes.fields, _ = cgutils.unpack_tuple(context.builder, array.shape)

    def release():
        if context.context.enable_nrt:  # only where kernels are compiled by plain numba
            context.context.nrt.decref(context.builder, kind.array, native.value)

    return extending.NativeValue(lanes._getvalue(), is_error=native.is_error, cleanup=release)


def converted(context, builder, value, kind, wanted: Lanes):
    """A value of any numeric type or precision as one of type `wanted`.

    Between one lane and several: the values that all lanes have in common.
    """
    if isinstance(kind, Lanes):
        if kind == wanted:
            return value
        if kind.count == wanted.count:
            return _in_precision(builder, value, kind, wanted)
        if 1 not in (kind.count, wanted.count):
            raise TypeError(f"{kind} cannot be {wanted}")
        plain = builder.extract_element(value, ir.Constant(ir.IntType(32), 0))
        plain = context.cast(builder, plain, kind.dtype, wanted.dtype)
    else:
        plain = context.cast(builder, value, kind, wanted.dtype)
    vector = vector_type(wanted)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), plain, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), wanted.count), [0] * wanted.count)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), zeros)


def _in_precision(builder, value, kind: Lanes, wanted: Lanes):
    if kind.dtype == wanted.dtype:
        return value
    narrows = wanted.dtype == types.float32
    return (builder.fptrunc if narrows else builder.fpext)(value, vector_type(wanted))
