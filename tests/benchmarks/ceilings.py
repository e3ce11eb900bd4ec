"""What a step of the elastic belt needs, what this machine can give, and how far the step is from it.

    python tests/benchmarks/ceilings.py

Operations and bytes are counted by running the very source of the step on numbers that count. The ceilings
are measured by kernels of the same lanes: fused products and sums in registers, quotients, and sums of arrays
as large as the step's working set. Takes about a minute; the machine ought to be idle.
"""

from __future__ import annotations

import collections
import time
from types import SimpleNamespace

import numpy as np

from cvt_hpc import lanes
from cvt_hpc.job import build_job
from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma, like, rings
from cvt_hpc.models.elastic_belt import (
    imex,
    imex_stations,
    lane_column,
    lane_forces,
    pulley_step,
    pulleys,
)
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.step_choice import REFERENCE_STEP as STEP
from cvt_hpc.models.elastic_belt.transient import PRECISIONS, Batch
from cvt_hpc.physics import compliance, flank, friction
from cvt_hpc.variator import course

CALLS = 15
STATIONS = 160


class Counted:
    """A number that counts what is done with it."""

    tally: collections.Counter = collections.Counter()

    def __init__(self, value: float) -> None:
        self.value = value

    def _done(self, kind: str, value: float) -> Counted:
        Counted.tally[kind] += 1
        return Counted(value)


def _value(x) -> float:
    return x.value if isinstance(x, Counted) else float(x)


def _counting(symbol: str, kind: str):
    function = {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "truediv": lambda a, b: a / b if b else 0.0,
    }[symbol]
    setattr(Counted, f"__{symbol}__", lambda a, b: a._done(kind, function(_value(a), _value(b))))
    setattr(Counted, f"__r{symbol}__", lambda a, b: a._done(kind, function(_value(b), _value(a))))


for _symbol in ("add", "sub", "mul"):
    _counting(_symbol, "sums and products")
_counting("truediv", "quotients and roots")
Counted.__neg__ = lambda a: Counted(-a.value)  # part of a fused operation
for _name, _test in (
    ("lt", lambda a, b: a < b),
    ("le", lambda a, b: a <= b),
    ("gt", lambda a, b: a > b),
    ("ge", lambda a, b: a >= b),
):
    setattr(
        Counted,
        f"__{_name}__",
        lambda a, b, test=_test: (Counted.tally.update(["comparisons"]), test(_value(a), _value(b)))[1],
    )


def _fma(a, b, c):
    Counted.tally["fused"] += 1
    return Counted(_value(a) * _value(b) + _value(c))


def _choice(mask, yes, no):
    Counted.tally["comparisons"] += 1
    return Counted(_value(yes) if mask else _value(no))


def _root(x):
    Counted.tally["quotients and roots"] += 1
    return Counted(np.sqrt(max(_value(x), 0.0)))


def _decay(x, terms: int):
    # as `lanes.decay`: clamp (2), nearest integer with its product (2), two fused to reduce, the polynomial, 2^n
    Counted.tally.update({"comparisons": 2, "sums and products": 3, "fused": 2 + terms, "other": 3})
    return Counted(np.exp(-min(_value(x), 80.0)))


def _reciprocals(a, b):
    Counted.tally.update({"quotients and roots": 1, "sums and products": 3})
    return Counted(1.0 / _value(a)), Counted(1.0 / _value(b))


def _counting_functions(terms: int) -> dict:
    return {
        "fma": _fma,
        "select": _choice,
        "sqrt": _root,
        "decay": lambda x: _decay(x, terms),
        "reciprocals": _reciprocals,
        "minimum": lambda a, b: _choice(_value(a) < _value(b), a, b),
        "maximum": lambda a, b: _choice(_value(a) > _value(b), a, b),
        "absolute": lambda x: x._done("other", abs(x.value)),
        "with_sign_of": lambda size, sign: Counted(np.copysign(_value(size), _value(sign))),
        "like": lambda x, pattern: Counted(_value(x)),
        "anywhere": bool,
        "behind": lambda array, j, field: _row(array, (j or len(_data(array))) - 1, field),
        "ahead": lambda array, j, field: _row(array, (j + 1) % len(_data(array)), field),
        "from_behind": lambda x: x,
        "from_ahead": lambda x: x,
        "around": lambda x: x,
        "at_station": lambda array, row, part, field: array[row, field],
        "set_station": lambda array, row, part, field, value: array.__setitem__((row, field), value),
        "ring_solution": lambda *system: rings.closed(*system),
    }


def _data(array) -> np.ndarray:
    return array.data if isinstance(array, CountingArray) else array


def _row(array, row: int, field: int):
    return array[row, field] if isinstance(array, CountingArray) else array[row]


class CountingArray:
    """A LaneArray of one lane, whose places count when they are read and written."""

    def __init__(self, array: LaneArray, memory: str) -> None:
        self.data, self.rows, self.memory = array.data, len(array.data), memory

    def __getitem__(self, place) -> Counted:
        Counted.tally[f"{self.memory} read"] += 1
        return Counted(float(self.data[place][0]))

    def __setitem__(self, place, value) -> None:
        Counted.tally[f"{self.memory} written"] += 1
        self.data[place] = _value(value)


def _counting_tuple(values, memory: str = "array"):
    """A NamedTuple with counting arrays in place of LaneArrays."""
    kind = type(values)
    parts = []
    for part in values:
        if isinstance(part, LaneArray):
            parts.append(CountingArray(part, "constant" if part.data.shape[0] == 1 else memory))
        elif isinstance(part, tuple):
            parts.append(_counting_tuple(part, memory))
        else:
            parts.append(part)
    return kind(*parts) if hasattr(kind, "_fields") else tuple(parts)


def count(step: float, precision: str) -> collections.Counter:
    """Operations and array places of one step without a second pass, for one lane, in a loaded belt.

    Slopes of friction count, five products and sums at each station of an arc, though machine code, which reads
    friction alone, has none of them.
    """
    batch = _batch(1, step, "double")
    batch.advance(700)
    functions = _counting_functions(7 if precision == "single" else 13)
    kept = []
    of_step = imex, imex_stations, pulley_step
    for module in (*of_step, lane_forces, lane_column, pulleys, course, compliance, flank, friction, rings):
        for name, thing in list(vars(module).items()):
            plain = functions.get(name) or getattr(thing, "py_func", None)
            if plain is not None:
                kept.append((module, name, thing))
                setattr(module, name, plain)
    try:
        state, work, belt = (_counting_tuple(part) for part in (batch.state, batch.work, batch._belt))
        for _ in range(50):
            passes = state.scalars.data[0, lf.REPEATS, 0]
            Counted.tally = collections.Counter()
            imex.step_imex(belt, state, work, step)
            if state.scalars.data[0, lf.REPEATS, 0] == passes:
                return Counted.tally
        raise RuntimeError("no step without a second pass in 50")
    finally:
        for module, name, thing in kept:
            setattr(module, name, thing)


def _batch(runs: int, step: float, precision: str) -> Batch:
    job = build_job(
        {"name": "ceilings", "model": "elastic_belt", "stepper": "imex"},
        "ceilings",
        {"load": 120.0, "step": step, "precision": precision, "stations": STATIONS, "duration": 0.2},
    )
    return Batch([job.point(0) | {"seed": k} for k in range(runs)], "imex")


@kernel
def _fused(array, turns):
    """Twelve independent chains of fused operations: enough to hide their latency."""
    a, b = array[0, 0], array[0, 1]
    c0 = c1 = c2 = c3 = c4 = c5 = c6 = c7 = c8 = c9 = ca = cb = array[0, 2]
    c1, c2, c3, c4, c5 = c1 + 1.0, c2 + 2.0, c3 + 3.0, c4 + 4.0, c5 + 5.0
    c6, c7, c8, c9, ca, cb = c6 + 6.0, c7 + 7.0, c8 + 8.0, c9 + 9.0, ca + 10.0, cb + 11.0
    for _ in range(turns):
        c0, c1, c2, c3 = fma(c0, a, b), fma(c1, a, b), fma(c2, a, b), fma(c3, a, b)
        c4, c5, c6, c7 = fma(c4, a, b), fma(c5, a, b), fma(c6, a, b), fma(c7, a, b)
        c8, c9, ca, cb = fma(c8, a, b), fma(c9, a, b), fma(ca, a, b), fma(cb, a, b)
    array[0, 2] = c0 + c1 + c2 + c3 + c4 + c5 + c6 + c7 + c8 + c9 + ca + cb


@kernel
def _quotients(array, turns):
    """Four independent chains of quotients."""
    a = array[0, 0]
    c0, c1, c2, c3 = array[0, 1], array[0, 1] + 1.0, array[0, 1] + 2.0, array[0, 1] + 3.0
    for _ in range(turns):
        c0, c1, c2, c3 = a / c0, a / c1, a / c2, a / c3
    array[0, 2] = c0 + c1 + c2 + c3


@kernel
def _traffic(array, turns):
    """Three places read and one written at each row."""
    for _ in range(turns):
        for j in range(STATIONS):
            for k in range(0, 40, 4):
                array[j, k] = array[j, k + 1] + like(0.5, array[j, k]) * array[j, k + 2] + array[j, k + 3]


def _best(function) -> float:
    """Least processor time of several calls [s], the first, which compiles, left out."""
    function()
    times = []
    for _ in range(CALLS):
        start = time.thread_time()
        function()
        times.append(time.thread_time() - start)
    return min(times)


def ceilings(precision: str) -> SimpleNamespace:
    """Fused operations, quotients and bytes per second of one core."""
    dtype = PRECISIONS[precision]
    width = lanes.ALIGNMENT // np.dtype(dtype).itemsize
    few, many = LaneArray(1, 4, width, dtype), LaneArray(STATIONS, 40, width, dtype)
    few.data[0, 0], few.data[0, 1] = 0.5, 1.5
    turns = 20_000
    return SimpleNamespace(
        width=width,
        fused=12 * turns / _best(lambda: _fused(few, turns)),
        quotients=4 * turns / _best(lambda: _quotients(few, turns)),
        bytes=4 * 10 * STATIONS * 64 * 100 / _best(lambda: _traffic(many, 100)),
    )


def step_time(precision: str, step: float, runs: int) -> float:
    """Time of a step of a batch [s], recording at 20 kHz included."""
    batch = _batch(runs, step, precision)
    batch.advance(700)
    batch.advance(700)

    def some():
        batch.advance(100)

    return _best(some) / (100 * batch.steps_per_sample)


def main() -> None:
    """Print the table."""
    for precision in ("single", "double"):
        needs, gives = count(STEP, precision), ceilings(precision)
        vector = needs["sums and products"] + needs["fused"] + needs["comparisons"] + needs["other"]
        flops = needs["sums and products"] + 2 * needs["fused"] + needs["quotients and roots"]
        moved = needs["array read"] + needs["array written"]
        took, alone = step_time(precision, STEP, gives.width), step_time(precision, STEP, 1)
        floors = {
            "arithmetic": vector / gives.fused,
            "quotients and roots": needs["quotients and roots"] / gives.quotients,
            "arrays": 64 * moved / gives.bytes,
        }
        print(f"{precision} precision, {STATIONS} stations, {gives.width} lanes")
        print(
            f"  a step needs, per lane: {flops} flops ({needs['quotients and roots']} of them quotients and"
        )
        print(f"    roots), {moved} places of arrays, {moved * 64 // gives.width} bytes; {dict(needs)}")
        print(
            f"  one core gives: {gives.fused / 1e9:.2f} G fused vector operations/s, "
            f"{gives.quotients / 1e9:.2f} G vector quotients/s, {gives.bytes / 1e9:.0f} GB/s at this size"
        )
        for name, seconds in floors.items():
            print(f"  floor by {name}: {seconds * 1e6:.1f} us a step, {seconds / took:.0%} of the time taken")
        rate = flops * gives.width / took
        print(
            f"  taken: {took * 1e6:.1f} us a step, {took / gives.width * 1e6:.2f} us a lane, {rate / 1e9:.1f} Gflop/s, "
            f"{rate / (2 * gives.fused * gives.width):.0%} of the peak; one run alone: {alone * 1e6:.1f} us a step"
        )


if __name__ == "__main__":
    main()
